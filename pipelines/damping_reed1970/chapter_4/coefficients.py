"""Section 4.1: the linear coefficient against amplitude, converted to cases I + IV and I + V.

A linear coefficient C_1 = F_e/(omega A_m) (Eq. 4.1.7) that grows as C_01 + C_11 A is case I with C_01 beside case IV
with 3 pi C_11/4 (Eqs. 4.1.11, 4.1.13); one that grows as C_01 + C_11 A^2 is case I beside q^2 q' with 4 C_11 (case V).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
import pandas as pd
from scipy import stats

from damping.arrays import FloatArray
from damping.regression.design import design_of_arrays
from damping.regression.fit import Fit, fit
from damping_reed1970.chapter_4 import resonances
from damping_reed1970.tables import Version, columns, load_table

#: Content of the t interval of a coefficient.
LEVEL = 0.90


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

#: Printed C_01 and C_11 by model and mode (4.1.10), printed force coefficients (4.1.14, 4.1.15, 4.2.11), erratum.
PRINTED = {(IV.name, 1): (0.506, 0.800), (IV.name, 2): (3.715, 5.127)}
PRINTED_FORCES = {(IV.name, 1): (0.506, 1.886), (IV.name, 2): (3.715, 12.08), (V.name, 1): (0.5486, 0.5486)}
ERRATA = {(IV.name, 1): "E41-3", (IV.name, 2): "E41-3", (V.name, 1): "E4-1"}


def tabulate_linear_coefficients() -> pd.DataFrame:
    """A row a mode, inputs, model and coefficient, with statistics from 1 degree of freedom (three sweeps).

    ``inputs``: ``printed`` takes C_1 of Table 4.II, ``corrected`` F_e/(omega A_m) of the corrected Table 4.I.
    ``report_method``: mean slope of the two segments, line through the middle sweep. ``low``, ``high``: t interval.
    """
    versions: tuple[Version, ...] = ("printed", "corrected")
    parts = [
        _tabulate_rows(mode, version, model, *coefficients_against_amplitude(mode, version))
        for mode in (1, 2)
        for model in MODELS
        for version in versions
    ]
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


def _tabulate_rows(mode: int, inputs: str, model: CoefficientModel, A: FloatArray, C_1: FloatArray) -> pd.DataFrame:
    found, key = fit_model(model, A, C_1), (model.name, mode)
    half = float(stats.t.ppf(0.5 + 0.5 * LEVEL, found.n - found.k)) * found.std_errors
    factors, nothing = np.array([1.0, model.factor]), (np.nan, np.nan)
    by_hand = report_method(model, A, C_1)
    return pd.DataFrame(
        {
            "mode": mode,
            "model": model.name,
            "inputs": inputs,
            "parameter": found.names,
            "unit": model.units,
            "coefficient": found.coefficients,
            "std_error": found.std_errors,
            "t_ratio": found.t_ratios,
            "p_value": found.p_values,
            "low": found.coefficients - half,
            "high": found.coefficients + half,
            "report_method": by_hand,
            "printed": PRINTED.get(key, nothing),
            "cases": model.cases,
            "force": ["viscous", model.force],
            "force_coefficient": factors * found.coefficients,
            "force_std_error": factors * found.std_errors,
            "force_report_method": factors * by_hand,
            "printed_force": PRINTED_FORCES.get(key, nothing),
            "rms_error_lb_s_per_in": found.rms_error,
            "r_squared_centred": found.r_squared_centred,
            "degrees_of_freedom": found.n - found.k,
            "erratum": ERRATA.get(key, ""),
        }
    )


@dataclass(frozen=True)
class CoefficientLines:
    """Fig. 4.1 or 4.2 with what the lines are worth.

    ``points``: ``sweep, amplitude_in, C_1_lb_s_per_in``. ``lines``: ``amplitude_in`` and, for each model by its cases,
    fitted C_1 with the t interval of the line (``low``, ``high``); ``printed`` is Eq. 4.1.10.
    """

    mode: int
    points: pd.DataFrame
    lines: pd.DataFrame


def coefficient_lines(mode: int, version: Version = "corrected") -> CoefficientLines:
    """Linear coefficient of a mode against resonant amplitude, from rest to half as far again as tested."""
    A, C_1 = coefficients_against_amplitude(mode, version)
    grid = np.linspace(0.0, 1.5 * A.max(), 100)
    C_01, C_11 = PRINTED[IV.name, mode]
    parts = []
    for model in MODELS:
        found = fit_model(model, A, C_1)
        basis = np.column_stack([np.ones_like(grid), grid**model.power])
        line = basis @ found.coefficients
        error = np.sqrt(np.einsum("nk,kl,nl->n", basis, found.covariance, basis))
        half = float(stats.t.ppf(0.5 + 0.5 * LEVEL, found.n - found.k)) * error
        columns_ = {"cases": model.cases, "amplitude_in": grid, "C_1_lb_s_per_in": line}
        parts.append(pd.DataFrame({**columns_, "low": line - half, "high": line + half}))
    printed = pd.DataFrame({"cases": "printed", "amplitude_in": grid, "C_1_lb_s_per_in": C_01 + C_11 * grid})
    points = pd.DataFrame({"sweep": list("ABC"), "amplitude_in": A, "C_1_lb_s_per_in": C_1})
    return CoefficientLines(mode, points, pd.concat([*parts, printed], ignore_index=True))
