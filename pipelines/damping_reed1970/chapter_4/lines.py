"""Lines through the resonances of three sweeps: both power laws (section 4.3), linear coefficients (section 4.1).

A linear coefficient C_1 = F_e/(omega A_m) (Eq. 4.1.7) that grows as C_01 + C_11 A is case I with C_01 beside case IV
with 3 pi C_11/4 (Eqs. 4.1.11, 4.1.13); one that grows as C_01 + C_11 A^2 is case I beside q^2 q' with 4 C_11 (case V).
"""

from dataclasses import dataclass
from itertools import product
from math import pi

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from damping.arrays import FloatArray
from damping.extrapolation.draws import Member
from damping.extrapolation.prediction import Loads, predict
from damping.ranking import Ranking
from damping.regression.design import design_of_arrays
from damping.regression.fit import Fit, Form, PowerLaw, fit, fit_power_law, tabulate_terms
from damping_reed1970 import Version, columns, load_table
from damping_reed1970.chapter_4 import F_EXAMPLE, PRINTED, equation_4_3_9, equation_4_3_19, resonances, section_4_3

VERSIONS: tuple[Version, ...] = ("printed", "corrected")
LEVEL = 0.90  #: content of the t intervals of coefficients and exponents


def fit_mode(mode: int, form: Form, version: Version) -> PowerLaw:
    """The power law of a mode from the resonances of its three sweeps."""
    return fit_power_law(*resonances(mode, version), form, LEVEL)


def tabulate_power_laws() -> pd.DataFrame:
    """One row per mode, form and inputs: exponent with t interval and coefficient, printed beside ours.

    ``alpha_A`` to ``alpha_C``: of each sweep with our p, ``alpha_at_printed_p`` their mean with the printed p (Eqs.
    4.3.9, 4.3.19); lb (s/in)^p (4.3.3) or lb s^p/in^(p+1) (4.3.4).
    """
    rows = []
    for printed, version in product(PRINTED["exponents"], VERSIONS):
        mode, form = printed["mode"], printed["form"]
        law, (F, A, omega) = fit_mode(mode, form, version), resonances(mode, version)
        coefficient = equation_4_3_9 if form == "velocity-power" else equation_4_3_19
        rows.append(
            {
                "mode": mode,
                "form": form,
                "equation": printed["equation"],
                "inputs": version,
                "p_printed": printed["p"],
                "p": law.p,
                "p_std_error": law.std_error,
                **{name: getattr(law, name) for name in ("degrees_of_freedom", "level", "p_low", "p_high", "factor")},
                "alpha_printed": printed["alpha"],
                "alpha_at_printed_p": float(np.mean(coefficient(F, A, float(omega.mean()), printed["p"]))),
                "alpha": law.alpha,
                "alpha_std_error": law.std_error_alpha,
                **{f"alpha_{sweep}": float(a) for sweep, a in zip("ABC", law.alphas, strict=True)},
                "r_squared_centred": law.r_squared_centred,
                "erratum": printed["erratum"],
            }
        )
    return pd.DataFrame(rows)


def section_4_3_example(ranking: Ranking, predicted: Loads | None) -> pd.DataFrame:
    """The extrapolation of the first mode to 90 lb: printed, recomputed, and from all laws by weight.

    Linear amplitudes are proportional to the force; ``error`` is by how many per cent linear from sweep C overpredicts.
    Intervals: of the power law, t interval of the line; of all laws, predictive.

    Args:
        ranking: of the record ``config-2-mode-1``.
        predicted: design loads of that record, which answer for all laws where 90 lb is among them; else the weighted
            laws of the ranking do.
    """
    (F, A, _), example = resonances(1, "corrected"), PRINTED["example"]
    linear = A * F_EXAMPLE / F
    line = fit_mode(1, "velocity-power", "corrected")
    power = float(line.amplitude(F_EXAMPLE))
    low, high = line.amplitude_interval(F_EXAMPLE)
    from_c = section_4_3("corrected")["sec43.A90_power_p1859"]
    average = predicted if predicted and F_EXAMPLE in predicted.force else average_laws(ranking)
    at, band = int(np.flatnonzero(average.force == F_EXAMPLE)[0]), average.average
    excess = [100.0 * (linear[2] / value - 1.0) for value in (from_c, power, high, low)]
    nan = np.nan
    whole = [float(values[at]) for values in (band.median, band.low, band.high)]
    over = (average.overprediction, average.overprediction_low, average.overprediction_high)
    excess_over_all = [float(values[at]) for values in over]
    rows = [
        ("force over largest tested", "ratio", 3.0, F_EXAMPLE / F[2], nan, nan, "sweep C: 28.98 lb", ""),
        ("linear amplitude, from sweep A", "in", nan, linear[0], nan, nan, "A_m 90/F_e", ""),
        ("linear amplitude, from sweep B", "in", nan, linear[1], nan, nan, "A_m 90/F_e", ""),
        ("linear amplitude, from sweep C", "in", example["linear"], linear[2], nan, nan, "A_m 90/F_e", "E43-5"),
        ("power law amplitude, p = 1.859", "in", example["power"], from_c, nan, nan, "through sweep C", "E43-1, E43-5"),
        ("power law amplitude, p refitted", "in", nan, power, low, high, f"p = {line.p:.3f}, least squares", "E43-5"),
        ("amplitude over all laws", "in", nan, *whole, "laws by weight", ""),
        ("error of linear, p = 1.859", "per cent", 67.0, excess[0], nan, nan, "both through sweep C", "E43-5"),
        ("error of linear, p refitted", "per cent", nan, excess[1], excess[2], excess[3], "from sweep C", "E43-5"),
        ("error of linear, over all laws", "per cent", nan, *excess_over_all, "laws by weight", ""),
    ]
    return pd.DataFrame(rows, columns=["quantity", "unit", "printed", "recomputed", "low", "high", "how", "erratum"])


def average_laws(ranking: Ranking) -> Loads:
    """Prediction at 90 lb from the weighted importance draws of every law that has a weight."""
    members = [Member(row.name, row.weight, row.coordinates, row.weighed.draws) for row in ranking.weighted()]
    return predict(members, np.array([F_EXAMPLE]), ranking.data, LEVEL, seed=0)


@dataclass(frozen=True)
class SweepLines:
    """The three sweeps of a mode and the lines through them: a figure's data."""

    mode: int
    points: pd.DataFrame
    lines: pd.DataFrame
    #: of the refitted power law and of the printed one, for the figure of forces
    exponents: tuple[float, float] = (np.nan, np.nan)


def force_amplitude_lines(mode: int) -> SweepLines:
    """Fig. 4.10 for a mode, over amplitudes from below the test to the force of the example or three times the test.

    ``points``: ``sweep, force_lb, amplitude_in``. ``lines``: ``force_lb``, amplitude of the refitted line with its t
    interval (``low``, ``high``), of the printed slope through sweep C, and of slope 1 (linear) through sweep C, all in.
    """
    F, A, _ = resonances(mode, "corrected")
    law, p = fit_mode(mode, "velocity-power", "corrected"), PRINTED["power_laws"][mode - 1]["p"]
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
    return SweepLines(mode, points, pd.DataFrame(lines), (law.p, p))


@dataclass(frozen=True)
class CoefficientModel:
    """C_1 = C_01 + C_11 A^power; ``factor`` C_11 is the coefficient of ``force`` beside viscous damping."""

    name: str
    cases: str
    power: int
    force: str
    factor: float
    units: tuple[str, str]


IV = CoefficientModel("C_01 + C_11 A", "I + IV", 1, "displacement-velocity", 0.75 * pi, ("lb s/in", "lb s/in^2"))
V = CoefficientModel("C_01 + C_11 A^2", "I + V", 2, "quadratic-displacement", 4.0, ("lb s/in", "lb s/in^3"))
MODELS = (IV, V)


def tabulate_linear_coefficients() -> pd.DataFrame:
    """One row per mode, inputs, model and coefficient, with statistics from 1 degree of freedom (three sweeps).

    ``inputs``: ``printed`` takes C_1 of Table 4.II, ``corrected`` F_e/(omega A_m) of the corrected Table 4.I.
    ``report_method``: mean slope of the two segments, line through the middle sweep. ``low``, ``high``: t interval.
    """
    parts = [_tabulate_coefficients(*choice) for choice in product((1, 2), MODELS, VERSIONS)]
    return pd.concat(parts, ignore_index=True)


def coefficients_against_amplitude(mode: int, version: Version) -> tuple[FloatArray, FloatArray]:
    """A_m and C_1 of the three sweeps of a mode."""
    F_e, A, omega_n = resonances(mode, version)
    if version == "printed":
        return A, columns(load_table("4_II").query("mode == @mode"), "C1_lb_s_per_in")[0]
    return A, F_e / (omega_n * A)


def fit_model(model: CoefficientModel, A: FloatArray, C_1: FloatArray) -> Fit:
    """Least squares of C_1 on 1 and A^power."""
    return fit(design_of_arrays(np.column_stack([np.ones_like(A), A**model.power]), C_1, ["C_01", "C_11"], "C_1"))


def report_method(model: CoefficientModel, A: FloatArray, C_1: FloatArray) -> FloatArray:
    """C_01 and C_11 as the report has them: mean of the slopes of the segments, line through the middle sweep."""
    x = A**model.power
    slope = float(np.mean(np.diff(C_1) / np.diff(x)))
    middle = len(x) // 2
    return np.array([C_1[middle] - slope * x[middle], slope])


def _tabulate_coefficients(mode: int, model: CoefficientModel, inputs: Version) -> pd.DataFrame:
    A, C_1 = coefficients_against_amplitude(mode, inputs)
    line = fit_model(model, A, C_1)
    printed = next(row for row in PRINTED["lines"] if (row["mode"], row["power"]) == (mode, model.power))
    half = float(stdtrit(line.n - line.k, 0.5 + 0.5 * LEVEL)) * line.std_errors
    factors, by_hand = np.array([1.0, model.factor]), report_method(model, A, C_1)
    return pd.DataFrame(
        {
            "mode": mode,
            "model": model.name,
            "inputs": inputs,
            "parameter": line.names,
            "unit": model.units,
            **tabulate_terms(line).drop(columns="name").to_dict("list"),
            "low": line.coefficients - half,
            "high": line.coefficients + half,
            "report_method": by_hand,
            "printed": printed["line"],
            "cases": model.cases,
            "force": ["viscous", model.force],
            "force_coefficient": factors * line.coefficients,
            "force_std_error": factors * line.std_errors,
            "force_report_method": factors * by_hand,
            "printed_force": printed["forces"],
            "rms_error_lb_s_per_in": line.rms_error,
            "r_squared_centred": line.r_squared_centred,
            "degrees_of_freedom": line.n - line.k,
            "erratum": printed["erratum"],
        }
    )


def coefficient_lines(mode: int) -> SweepLines:
    """Fig. 4.1 or 4.2: linear coefficient of a mode against amplitude, from rest to half as far again as tested.

    ``points``: ``sweep, amplitude_in, C_1_lb_s_per_in``. ``lines``: ``amplitude_in`` and, for each model by its cases,
    fitted C_1 with the t interval of the line (``low``, ``high``); ``printed`` is Eq. 4.1.10.
    """
    A, C_1 = coefficients_against_amplitude(mode, "corrected")
    grid = np.linspace(0.0, 1.5 * A.max(), 100)
    C_01, C_11 = PRINTED["lines"][mode - 1]["line"]
    parts = []
    for model in MODELS:
        fitted = fit_model(model, A, C_1)
        basis = np.column_stack([np.ones_like(grid), grid**model.power])
        line = basis @ fitted.coefficients
        error = np.sqrt(np.einsum("nk,kl,nl->n", basis, fitted.covariance, basis))
        half = float(stdtrit(fitted.n - fitted.k, 0.5 + 0.5 * LEVEL)) * error
        columns_ = {"cases": model.cases, "amplitude_in": grid, "C_1_lb_s_per_in": line}
        parts.append(pd.DataFrame({**columns_, "low": line - half, "high": line + half}))
    printed = pd.DataFrame({"cases": "printed", "amplitude_in": grid, "C_1_lb_s_per_in": C_01 + C_11 * grid})
    points = pd.DataFrame({"sweep": list("ABC"), "amplitude_in": A, "C_1_lb_s_per_in": C_1})
    return SweepLines(mode, points, pd.concat([*parts, printed], ignore_index=True))
