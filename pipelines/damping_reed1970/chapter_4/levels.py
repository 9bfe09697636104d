"""Tables 4.IV and 4.V as methods: which damping case keeps one coefficient from level to level (section 4.2).

At phase resonance a case with unit force C(A, omega) needs the coefficient F/C(A_m, omega). The right case needs the
same one at every level. What is kept may be the coefficient itself, or, as the report has it,
xi = coefficient/(2 M omega) with the generalized mass M of each sweep (Eq. 4.2.7): where M differs from sweep to sweep
the two are different questions. Cases: I to IV and the second term of V alone, V with the alphas asked for, and viscous
with each nonlinear one in the ratio alpha that keeps the coefficient best.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.optimize import minimize_scalar
from scipy.special import ndtr, ndtri

from damping.arrays import FloatArray
from damping.forces import make
from damping.forces.contract import Sum
from damping.infer.observations import Observations
from damping.plots import INK, MUTED, build_panel, draw_plain_rows, styled
from damping.plots.scales import plain_log
from damping.predict.steady import resonant_amplitude
from damping.records.record import Record
from damping.records.resonance import tabulate_resonances
from damping_reed1970 import LABELS
from damping_reed1970.chapter_2 import CASES
from damping_reed1970.chapter_4 import resonances
from damping_reed1970.chapter_4.lines import fit_mode

#: One-term cases of Table 2.I by force name; of case V the second term alone.
ONE_TERM = {"V, second term" if case == "V" else case: force for case, force in CASES.items()}
QUADRATIC = ONE_TERM["V, second term"]
#: Range in which a free alpha is looked for, in units of the one that makes both terms equal at the reference.
_ALPHAS = np.geomspace(1e-3, 1e3, 121)


@dataclass(frozen=True)
class LevelCase:
    """A case of Table 2.I or a sum of two."""

    name: str
    forces: tuple[str, ...]  #: one or two
    alpha: float = np.nan  #: coefficient of the second over that of the first; infinite: the second alone
    free: bool = False  #: whether alpha is fitted

    def force(self, coefficient: FloatArray | float) -> Sum:
        """The damping force for coefficients that broadcast."""
        if len(self.forces) == 1 or self.alpha == 0.0:
            return Sum((make(self.forces[0], coefficient=coefficient),))
        if np.isinf(self.alpha):
            return Sum((make(self.forces[1], coefficient=coefficient),))
        first, second = self.forces
        return Sum((make(first, coefficient=coefficient), make(second, coefficient=self.alpha * coefficient)))


@dataclass(frozen=True)
class LevelMethods:
    """What the two methods say; percentages are of the measured or base value."""

    coefficients: pd.DataFrame  #: Table 4.V
    #: ``largest_percent`` by base (signed, as the report), ``spread_percent`` (:func:`spread`)
    variations: pd.DataFrame
    predictions: pd.DataFrame  #: Table 4.IV; base ``others`` takes coefficient and free alpha from all other sweeps
    picked: str  #: case of least spread


def level_methods(data: Observations, mass: FloatArray | None = None, alphas: Sequence[float] = (1.0,)) -> LevelMethods:
    """Both methods on the resonances of three sweeps or more.

    Args:
        data: tested force, amplitude and frequency of each sweep.
        mass: generalized mass of each sweep (sweeps,), where xi is to be kept as in the report; None: the coefficient.
        alphas: of case V, in 1/length^2.
    """
    scale = np.ones(len(data.sweeps)) if mass is None else 2.0 * mass * data.tested_omega
    cases = _build_cases(data, scale, alphas)
    held = [(case, held_values(case, data, scale)) for case in cases]
    coefficients = [{"case": c.name, "alpha": c.alpha, "sweep": data.sweeps, "held": values} for c, values in held]
    variations = pd.concat([_tabulate_variations(case, data, scale) for case in cases], ignore_index=True)
    spread = variations.drop_duplicates("case").set_index("case")["spread_percent"]
    return LevelMethods(
        coefficients=pd.concat(map(pd.DataFrame, coefficients), ignore_index=True),
        variations=variations,
        predictions=pd.concat([_tabulate_predictions(case, data, scale) for case in cases], ignore_index=True),
        picked=str(spread.idxmin()),
    )


def held_values(case: LevelCase, data: Observations, scale: FloatArray) -> FloatArray:
    """F/(C(A_m, omega) scale) of each sweep, the quantity that should not vary (Eq. 4.2.7)."""
    return np.asarray(data.tested_force / case.force(1.0).quadrature(data.tested_amplitude, data.tested_omega) / scale)


def spread(case: LevelCase, data: Observations, scale: FloatArray) -> float:
    """Standard deviation of ln(held value) over the levels; a free alpha takes a degree of freedom."""
    logarithm = np.log(held_values(case, data, scale))
    return float(np.sqrt(np.sum((logarithm - logarithm.mean()) ** 2) / (len(data.sweeps) - 1 - int(case.free))))


def masses(record: Record, data: Observations) -> FloatArray:
    """Generalized mass of each sweep, in its row at resonance."""
    rows = tabulate_resonances(record).set_index("sweep").loc[list(data.sweeps), "row"]
    return np.asarray(record.table["mass"].to_numpy(dtype=float)[rows.to_numpy()])


def _build_cases(data: Observations, scale: FloatArray, alphas: Sequence[float]) -> tuple[LevelCase, ...]:
    """All cases, those with a free alpha last."""
    single = [LevelCase(name, (force,)) for name, force in ONE_TERM.items()]
    fixed = [LevelCase(f"V, alpha = {alpha:g}", (ONE_TERM["I"], QUADRATIC), float(alpha)) for alpha in alphas]
    names = {"I + II": "II", "I + III": "III", "I + IV": "IV", "V": "V, second term"}
    free = [LevelCase(f"{name}, alpha free", (ONE_TERM["I"], ONE_TERM[own]), 1.0, True) for name, own in names.items()]
    return (*single, *fixed, *(fit_alpha(case, data, scale) for case in free))


def fit_alpha(case: LevelCase, data: Observations, scale: FloatArray) -> LevelCase:
    """The case with the alpha >= 0 that keeps its value best over the levels of ``data``.

    Where the best is at an end of the range looked at (a thousandth or a thousand times equal parts) one of the two
    terms is best alone: alpha is 0 or infinite.
    """
    A, omega, _ = data.reference
    first, second = (float(make(force, coefficient=1.0).quadrature(A, omega)) for force in case.forces)

    def variance(log_alpha: float) -> float:
        return float(np.var(np.log(held_values(replace(case, alpha=np.exp(log_alpha)), data, scale))))

    grid = np.log(_ALPHAS * first / second)
    best = int(np.argmin([variance(u) for u in grid]))
    if best in (0, len(grid) - 1):
        return replace(case, alpha=0.0 if best == 0 else np.inf)
    ends = (grid[best - 1], grid[best + 1])
    minimum = minimize_scalar(variance, bounds=ends, method="bounded", options={"xatol": 1e-10})
    return replace(case, alpha=float(np.exp(minimum.x)))


def _tabulate_variations(case: LevelCase, data: Observations, scale: FloatArray) -> pd.DataFrame:
    """One row per base sweep."""
    held = held_values(case, data, scale)
    percent = 100.0 * (held[None, :] / held[:, None] - 1.0)
    largest = percent[np.arange(len(held)), np.abs(percent).argmax(axis=1)]
    head = {"case": case.name, "alpha": case.alpha, "free": case.free, "base": data.sweeps}
    return pd.DataFrame({**head, "largest_percent": largest, "spread_percent": 100.0 * spread(case, data, scale)})


def _tabulate_predictions(case: LevelCase, data: Observations, scale: FloatArray) -> pd.DataFrame:
    """One row per base and sweep other than the base; then each sweep from all others."""
    held, n = held_values(case, data, scale), len(data.sweeps)
    base, sweep = np.nonzero(~np.eye(n, dtype=bool))
    names = [*(data.sweeps[b] for b in base), *(["others"] * n)]
    from_others = [_predict_from_others(case, data, scale, s) for s in range(n)]
    predicted = np.append(_predict(case, held[base] * scale[sweep], data, sweep), from_others)
    sweep = np.append(sweep, np.arange(n))
    amplitude, error = data.tested_amplitude[sweep], 100.0 * (predicted / data.tested_amplitude[sweep] - 1.0)
    head = {"case": case.name, "alpha": case.alpha, "base": names, "sweep": [data.sweeps[s] for s in sweep]}
    return pd.DataFrame({**head, "predicted": predicted, "amplitude": amplitude, "percent_error": error})


def _predict_from_others(case: LevelCase, data: Observations, scale: FloatArray, sweep: int) -> float:
    """Amplitude of one sweep from the geometric mean of the others' values (and their alpha)."""
    keep = np.arange(len(data.sweeps)) != sweep
    rest = data.take_sweeps(keep)
    if case.free:
        case = fit_alpha(case, rest, scale[keep])
    held = np.exp(np.mean(np.log(held_values(case, rest, scale[keep]))))
    return float(_predict(case, np.array([held * scale[sweep]]), data, np.array([sweep]))[0])


def _predict(case: LevelCase, coefficient: FloatArray, data: Observations, sweep: np.ndarray) -> FloatArray:
    return resonant_amplitude(case.force(coefficient), data.tested_force[sweep], data.tested_omega[sweep])


_SCATTERS = (1.0, 2.0, 3.0, 5.0, 10.0)  #: scatter of the amplitude from level to level, per cent


def tabulate_chance_of_exponent() -> pd.DataFrame:
    """How likely linear damping gives the exponents of section 4.3 by scatter of the amplitude from level to level.

    With relative scatter s of each resonant amplitude the slope of ln F on ln A is 1 + s z/sqrt(sum (ln A - mean)^2),
    z standard normal, to first order. ``needed_percent``: scatter at which p as found or more has a chance of 1 in 20.
    """
    rows = []
    for mode in (1, 2):
        A, p = resonances(mode, "corrected")[1], fit_mode(mode, "velocity-power", "corrected").p
        root = float(np.std(np.log(A)) * np.sqrt(A.size))
        chances = {f"chance_at_{s:g}_percent": float(ndtr(-(p - 1.0) * root / (0.01 * s))) for s in _SCATTERS}
        rows.append({"mode": mode, "p": p, "needed_percent": 100.0 * (p - 1.0) * root / float(ndtri(0.95)), **chances})
    return pd.DataFrame(rows)


@styled
def draw_level_variation(variations: pd.DataFrame, held: str) -> Figure:
    """Draw by how much each case's coefficient varies from level to level, with every choice of base (Table 4.V).

    ``variations`` as in :class:`LevelMethods`; ``held``: what is kept from level to level.
    """
    order = variations.drop_duplicates("case").sort_values("spread_percent", na_position="last")
    figure, axes = build_panel(1.5 + 0.24 * len(order))
    labels = order["case"].str.replace("alpha free", "α = ") + order["alpha"].map("{:.3g} (free)".format)
    labels = labels.str.replace("inf", "∞").where(order["free"], order["case"].str.replace("alpha", "α"))
    draw_plain_rows(axes, list(labels))
    markers = "osD^vPX"
    for number, (base, rows) in enumerate(variations.groupby("base", sort=False)):
        largest = rows.set_index("case")["largest_percent"].abs()
        axes.plot(largest[order["case"]], range(len(order)), markers[number % len(markers)], markersize=4.5,
                  color=MUTED, alpha=0.9, linestyle="none", label=f"largest, base {base}")  # fmt: skip
    axes.plot(order["spread_percent"], range(len(order)), "|", color=INK, markersize=13, markeredgewidth=2.2,
              label="standard deviation")  # fmt: skip
    axes.set_xscale("log")
    plain_log(axes.xaxis)
    axes.set_xlabel(f"variation of the {LABELS['kept'][held][0]}\nfrom level to level (per cent)")
    figure.legend(loc="outside lower center", ncols=2, fontsize=7.5)
    return figure
