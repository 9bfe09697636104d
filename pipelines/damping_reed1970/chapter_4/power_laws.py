"""Section 4.3: both power laws for both modes, and what becomes of the example of 67 per cent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import ndtr, ndtri

from damping.extrapolation.draws import Member
from damping.extrapolation.prediction import Loads, predict
from damping.ranking import Ranking
from damping.regression.power_law import Form, PowerLaw, fit_power_law
from damping_reed1970.chapter_4 import (
    A_LINEAR_PRINTED,
    A_POWER_PRINTED,
    F_EXAMPLE,
    P_1,
    equation_4_3_9,
    equation_4_3_19,
    resonances,
)
from damping_reed1970.tables import Version

#: Printed p and alpha (4.3.13 to 4.3.24) and the errata that change them, by form and mode.
PRINTED: dict[tuple[Form, int], tuple[float, float, str, str]] = {
    ("velocity-power", 1): (1.859, 0.1917, "4.3.14", "E43-1, E43-3"),
    ("velocity-power", 2): (1.342, 3.005, "4.3.16", "E43-2, E43-3, E4I-1"),
    ("displacement-velocity-power", 1): (0.865, 3.89, "4.3.23", "E43-1, E43-6"),
    ("displacement-velocity-power", 2): (0.342, 59.4, "4.3.24", "E43-4, E4I-1"),
}
VERSIONS: tuple[Version, ...] = ("printed", "corrected")
LEVEL = 0.90


def fit_mode(mode: int, form: Form, version: Version, level: float = LEVEL) -> PowerLaw:
    """The power law of a mode from the resonances of its three sweeps."""
    return fit_power_law(*resonances(mode, version), form, level)


def tabulate_power_laws() -> pd.DataFrame:
    """A row a mode, form and inputs: exponent and coefficient, printed beside ours.

    ``p_low``, ``p_high``: t interval from 1 degree of freedom. ``alpha_A`` to ``alpha_C`` of each sweep with our p,
    ``alpha_at_printed_p`` their mean with the printed p. alpha in lb (s/in)^p (4.3.3) or lb s^p/in^(p+1) (4.3.4).
    """
    rows = []
    for (form, mode), (p, alpha, equation, erratum) in PRINTED.items():
        for version in VERSIONS:
            found, (F, A, omega) = fit_mode(mode, form, version), resonances(mode, version)
            rows.append(
                {
                    "mode": mode,
                    "form": form,
                    "equation": equation,
                    "inputs": version,
                    "p_printed": p,
                    "p": found.p,
                    "p_std_error": found.std_error,
                    "degrees_of_freedom": found.degrees_of_freedom,
                    "level": found.level,
                    "p_low": found.p_low,
                    "p_high": found.p_high,
                    "factor": found.factor,
                    "alpha_printed": alpha,
                    "alpha_at_printed_p": float(np.mean(alphas(form, p, F, A, float(omega.mean())))),
                    "alpha": found.alpha,
                    "alpha_std_error": found.std_error_alpha,
                    **{f"alpha_{sweep}": float(a) for sweep, a in zip("ABC", found.alphas, strict=True)},
                    "r_squared_centred": found.r_squared_centred,
                    "erratum": erratum,
                }
            )
    return pd.DataFrame(rows)


def alphas(form: Form, p: float, F: np.ndarray, A: np.ndarray, omega: float) -> np.ndarray:
    """Coefficient of each sweep for a given exponent (Eqs. 4.3.9, 4.3.19)."""
    return np.asarray((equation_4_3_9 if form == "velocity-power" else equation_4_3_19)(F, A, omega, p))


def section_4_3_example(
    ranking: Ranking, level: float = 0.90, seed: int = 0, predicted: Loads | None = None
) -> pd.DataFrame:
    """The extrapolation of the first mode to 90 lb: printed, recomputed, and from all laws by weight.

    Linear amplitudes are proportional to the force; ``error`` is by how many per cent linear from sweep C overpredicts.
    Intervals: of the power law, t interval of the line; of all laws, predictive.

    Args:
        ranking: of the record ``config-2-mode-1``. predicted: design loads of that record, which answer for all laws
            where 90 lb is among them; else the weighted laws of the ranking do.
    """
    F, A, _ = resonances(1, "corrected")
    linear = A * F_EXAMPLE / F
    line = fit_mode(1, "velocity-power", "corrected", level)
    power = float(line.amplitude(F_EXAMPLE))
    low, high = line.amplitude_interval(F_EXAMPLE)
    from_c = float(A[2] * (F_EXAMPLE / F[2]) ** (1.0 / P_1))
    average = predicted if predicted and F_EXAMPLE in predicted.force else averaged(ranking, level, seed)
    at, band = int(np.flatnonzero(average.force == F_EXAMPLE)[0]), average.average
    excess = [100.0 * (linear[2] / value - 1.0) for value in (from_c, power, high, low)]
    nan = np.nan
    rows = [
        ("force over largest tested", "ratio", 3.0, F_EXAMPLE / F[2], nan, nan, "sweep C: 28.98 lb", ""),
        ("linear amplitude, from sweep A", "in", nan, linear[0], nan, nan, "A_m 90/F_e", ""),
        ("linear amplitude, from sweep B", "in", nan, linear[1], nan, nan, "A_m 90/F_e", ""),
        ("linear amplitude, from sweep C", "in", A_LINEAR_PRINTED, linear[2], nan, nan, "A_m 90/F_e", "E43-5"),
        ("power law amplitude, p = 1.859", "in", A_POWER_PRINTED, from_c, nan, nan, "through sweep C", "E43-1, E43-5"),
        ("power law amplitude, p refitted", "in", nan, power, low, high, f"p = {line.p:.3f}, least squares", "E43-5"),
        ("amplitude over all laws", "in", nan, *_at(at, band.median, band.low, band.high), "laws by weight", ""),
        ("error of linear, p = 1.859", "per cent", 67.0, excess[0], nan, nan, "both through sweep C", "E43-5"),
        ("error of linear, p refitted", "per cent", nan, excess[1], excess[2], excess[3], "from sweep C", "E43-5"),
        (
            "error of linear, over all laws", "per cent", nan,
            *_at(at, average.overprediction, average.overprediction_low, average.overprediction_high),
            "laws by weight", "",
        ),
    ]  # fmt: skip
    names = ["quantity", "unit", "printed", "recomputed", "low", "high", "how", "erratum"]
    return pd.DataFrame(rows, columns=names)


def averaged(ranking: Ranking, level: float, seed: int) -> Loads:
    """Prediction at 90 lb from the weighted importance draws of every law that has a weight."""
    members = [
        Member(c.name, c.weight, c.coordinates, c.evidence.draws)
        for c in ranking.weighted()
        if c.coordinates is not None and c.evidence is not None
    ]
    return predict(members, np.array([F_EXAMPLE]), ranking.data, level, seed)


def _at(index: int, *values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value[index]) for value in values)


@dataclass(frozen=True)
class ForceAmplitudeLines:
    """Fig. 4.10 for one mode, over amplitudes from below the test to the force of the example or three times the test.

    ``points``: ``sweep, force_lb, amplitude_in``. ``lines``: ``force_lb``, amplitude of the refitted line with its t
    interval (``low``, ``high``), of the printed slope through sweep C, and of slope 1 (linear) through sweep C, all in.
    """

    mode: int
    law: PowerLaw
    p_printed: float
    points: pd.DataFrame
    lines: pd.DataFrame


def force_amplitude_lines(mode: int) -> ForceAmplitudeLines:
    """Resonant force against amplitude of a mode with the lines through it, from the corrected tables."""
    F, A, _ = resonances(mode, "corrected")
    law, p = fit_mode(mode, "velocity-power", "corrected"), PRINTED["velocity-power", mode][0]
    force = np.geomspace(0.85 * F.min(), 1.05 * max(F_EXAMPLE, 3.0 * F.max()), 80)
    interval = np.array([law.amplitude_interval(float(f)) for f in force])
    lines = {
        "force_lb": force,
        "refitted": law.amplitude(force),
        "low": interval[:, 0],
        "high": interval[:, 1],
        "printed_slope": A[2] * (force / F[2]) ** (1.0 / p),
        "linear": A[2] * force / F[2],
    }
    points = pd.DataFrame({"sweep": list("ABC"), "force_lb": F, "amplitude_in": A})
    return ForceAmplitudeLines(mode, law, p, points, pd.DataFrame(lines))


def tabulate_chance_of_exponent(noise: Sequence[float] = (1.0, 2.0, 3.0, 5.0, 10.0)) -> pd.DataFrame:
    """How likely linear damping gives the exponents of section 4.3 by scatter of the amplitude from level to level.

    With relative scatter s of each resonant amplitude the slope of ln F on ln A is 1 + s z/sqrt(sum (ln A - mean)^2),
    z standard normal, to first order. ``needed_percent``: scatter at which p as found or more has a chance of 1 in 20.
    """
    rows = []
    for mode in (1, 2):
        A, p = resonances(mode, "corrected")[1], fit_mode(mode, "velocity-power", "corrected").p
        root = float(np.std(np.log(A)) * np.sqrt(A.size))
        chances = {f"chance_at_{s:g}_percent": float(ndtr(-(p - 1.0) * root / (0.01 * s))) for s in noise}
        rows.append({"mode": mode, "p": p, "needed_percent": 100.0 * (p - 1.0) * root / float(ndtri(0.95)), **chances})
    return pd.DataFrame(rows)
