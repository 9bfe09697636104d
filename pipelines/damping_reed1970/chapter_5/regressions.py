"""Every regression of chapter V from printed, corrected and recovered inputs, side by side (Eqs. 5.3.1 to 5.3.15).

Fig. 5.1 has its counterpart in the energy of Configuration I (its own data are not printed). The report's figure is
fitted to fifteen points "with zero error"; what a fit that close is worth shows between its points: the nine terms of
Eq. 5.3.6 go below zero there, where a law of damping cannot.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from damping.arrays import FloatArray
from damping.plots import ALERT, WIDTH, styled
from damping.regression.fit import Fit, fit
from damping.regression.program import deviations_of
from damping.regression.subsets import best_subsets
from damping_reed1970 import Run, Version, columns, load_table
from damping_reed1970.chapter_2 import CASES
from damping_reed1970.chapter_5 import (
    E4_POINTS,
    EQUATION_5_3_3,
    EQUATION_5_3_9_E1,
    EQUATION_5_3_9_E2,
    EQUATION_5_3_14,
    EQUATION_5_3_15,
    TERMS,
    Polynomial,
    energy_design,
    polynomial,
    table_5_i,
)
from damping_reed1970.chapter_5.nine_terms import INPUTS, Inputs, nine_term_design

#: Case of Table 5.I of each energy term.
TERM_CASES = {"A2w": "I", "A2": "II", "A3w2": "III", "A3w": "IV", "A4w": "V"}
#: What the inputs of a fit may be, by the name in the tables.
INPUT_VERSIONS: dict[str, Version] = {"printed": "printed", "corrected": "corrected", "recovered": "used"}


@dataclass(frozen=True)
class EnergyFit:
    """One fit of an energy polynomial as the report made it.

    ``printed`` coefficients by term, in the report's order; ``forces`` the printed force coefficients (Table 5.I);
    ``table`` and ``amplitude`` say where A is; ``run`` which inputs of Table 5.IV were used; ``rows`` the points
    fitted; ``fitted`` and ``percent`` the printed columns of fitted energy and per cent deviation, where there are any.
    """

    name: str
    equation: str
    table: str
    amplitude: str
    printed: Polynomial
    erratum: str
    forces: Polynomial = field(default_factory=dict)
    run: Run = "E4"
    rows: slice = field(default_factory=lambda: slice(None))
    fitted: str = ""
    percent: str = ""

    def data(self, version: Version) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A, omega, E of the points fitted."""
        A, omega, E = columns(load_table(self.table, version, self.run), self.amplitude, "omega_rad_s", "E_in_lb")
        return A[self.rows], omega[self.rows], E[self.rows]

    def fit(self, A: FloatArray, omega: FloatArray, E: FloatArray) -> Fit:
        """Least squares with this fit's terms."""
        return fit(energy_design(self.printed, A, omega, E))


CHECK_OUT_TWO = EnergyFit("check-out, two terms", "5.3.1", "5_II", "A_in", {"A2w": 1.571, "A3w": 1.066}, "E5II-5")
CHECK_OUT_FIVE = EnergyFit(
    "check-out, five terms", "5.3.3", "5_II", "A_in", EQUATION_5_3_3, "E5II-3",
    fitted="E_eq533_in_lb", percent="percent_deviation",
)  # fmt: skip
E_1 = EnergyFit(
    "E1", "5.3.9", "5_III", "A2bar_in", EQUATION_5_3_9_E1, "E5III-1, E5III-2", {"A2w": 1.66, "A3w": 4.15},
    fitted="E1_in_lb",
)  # fmt: skip
E_2 = EnergyFit(
    "E2", "5.3.9", "5_III", "A2bar_in", EQUATION_5_3_9_E2, "E5III-1, E5III-2", {"A2w": 3.165},
    fitted="E2_in_lb", percent="percent_deviation_E2",
)  # fmt: skip
E_3 = EnergyFit(
    "E3", "5.3.14", "5_IV", "A2p_in", EQUATION_5_3_14, "E5IV-1", {"A2w": 0.373, "A3w2": 0.230}, "E3",
    fitted="E3_in_lb",
)  # fmt: skip
E_4 = EnergyFit(
    "E4", "5.3.15", "5_IV", "A2p_in", EQUATION_5_3_15, "E5IV-1, E5IV-2", {"A3w2": 0.265}, "E4", E4_POINTS,
    fitted="E4_in_lb", percent="percent_deviation_E4",
)  # fmt: skip
VISCOUS = EnergyFit("viscous 2.39", "end of 5.3", "5_IV", "A2p_in", {"A2w": np.nan}, "E5IV-1", {"A2w": 2.39})
FITS = (CHECK_OUT_TWO, CHECK_OUT_FIVE, E_1, E_2, E_3, E_4, VISCOUS)


def tabulate_regressions() -> pd.DataFrame:
    """One row per fit, inputs and term.

    Coefficients belong to energy in in-lb with A in inches and omega in rad/s; ``force_coefficient`` is that of the
    damping force of the term (Table 5.I; lb, in, s). ``cells_changed``: input cells that differ from the print.
    ``printed``, ``printed_force``: as printed, NaN where the report prints none.
    """
    parts = []
    for report_fit in FITS:
        printed = np.concatenate(report_fit.data("printed"))
        for inputs, data in _inputs(report_fit).items():
            changed = int(np.sum(np.concatenate(data) != printed))
            parts.append(_tabulate_rows(report_fit, inputs, changed, report_fit.fit(*data)))
    return pd.concat(parts, ignore_index=True)


def tabulate_regression_deviations() -> pd.DataFrame:
    """Per cent deviations 100 (E - fitted)/E of Tables 5.II, 5.III and 5.IV beside ours, one row per fit and point.

    ``*_printed`` are the table's own columns (NaN where it has none), ``*_from_X_inputs`` those of our fit to the
    inputs X, of the fit's own points.
    """
    parts = []
    for report_fit in FITS:
        if not report_fit.fitted:
            continue
        table = load_table(report_fit.table)[report_fit.rows]
        A, omega, E = report_fit.data("printed")
        part = pd.DataFrame({"fit": report_fit.name, "table": report_fit.table.replace("_", ".")}, index=table.index)
        part["point"] = table["row" if "row" in table else "point"]
        part = part.assign(omega_rad_s=omega, A_printed_in=A, E_printed_in_lb=E)
        part["fitted_printed_in_lb"] = table[report_fit.fitted]
        part["percent_printed"] = table[report_fit.percent] if report_fit.percent else np.nan
        for inputs, data in _inputs(report_fit).items():
            if inputs != "generator":
                deviations = deviations_of(report_fit.fit(*data))
                part[f"fitted_from_{inputs}_inputs_in_lb"] = deviations.fitted
                part[f"percent_from_{inputs}_inputs"] = deviations.percent
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def generator_data() -> tuple[FloatArray, FloatArray, FloatArray]:
    """A and omega of the corrected Table 5.II with the energy pi/2 A^2 omega + 16/15 A^3 omega to three decimals.

    The printed generator 1.571, 1.067 rounds pi/2 and 16/15; fitted, this gives the printed 1.571 and 1.066.
    """
    A, omega, _ = CHECK_OUT_TWO.data("corrected")
    return A, omega, np.round(polynomial({"A2w": pi / 2.0, "A3w": 16.0 / 15.0}, A, omega), 3)


def _inputs(report_fit: EnergyFit) -> dict[str, tuple[FloatArray, FloatArray, FloatArray]]:
    """Inputs of a fit by name; of the check-out data there are none recovered but the generator that made them."""
    if report_fit.table == "5_II":
        both: tuple[Version, Version] = ("printed", "corrected")
        return {version: report_fit.data(version) for version in both} | {"generator": generator_data()}
    return {name: report_fit.data(version) for name, version in INPUT_VERSIONS.items()}


def _tabulate_rows(report_fit: EnergyFit, inputs: str, changed: int, fitted: Fit) -> pd.DataFrame:
    deviations = deviations_of(fitted)
    terms = list(report_fit.printed)
    return pd.DataFrame(
        {
            "fit": report_fit.name,
            "equation": report_fit.equation,
            "inputs": inputs,
            "cells_changed": changed,
            "points": fitted.n,
            "term": [TERMS[term].name for term in terms],
            "coefficient": fitted.coefficients,
            "std_error": fitted.std_errors,
            "t_ratio": fitted.t_ratios,
            "printed": list(report_fit.printed.values()),
            "force": [CASES[TERM_CASES[term]] for term in terms],
            "force_coefficient": [table_5_i(TERM_CASES[t], a) for t, a in zip(terms, fitted.coefficients, strict=True)],
            "printed_force": [report_fit.forces.get(term, np.nan) for term in terms],
            "r_squared_without_constant": fitted.r_squared,
            "rms_error_in_lb": fitted.rms_error,
            "average_absolute_percent": deviations.average_absolute_percent,
            "largest_absolute_percent": deviations.largest_absolute_percent,
            "condition_number": fitted.condition_number,
            "erratum": report_fit.erratum,
        }
    )


@dataclass(frozen=True)
class EnergySurface:
    """Two surfaces on the grid ``amplitude`` (a,) times ``omega`` (f,), energies (a, f) in in-lb.

    ``physical``: best subset of the nine terms with every coefficient > 0, by BIC, its terms in ``law``; ``nine``: all
    nine terms, free. ``points``: ``omega_rad_s, amplitude_in, energy_in_lb``. ``rms_errors``: of both at the points.
    ``negative_share``: share of the grid on which the nine terms give energy to the structure. ``lowest``: the least.
    """

    amplitude: FloatArray
    omega: FloatArray
    physical: FloatArray
    nine: FloatArray
    law: tuple[str, ...]
    points: pd.DataFrame
    rms_errors: tuple[float, float]
    negative_share: float
    lowest: float


def energy_surface(inputs: Inputs = INPUTS[0], cells: int = 80) -> EnergySurface:
    """The surfaces over the rectangle that the points span and a little more, from zero amplitude.

    Args:
        inputs: A, omega and E of a table; by default the rough data of Table 5.III. cells: grid points each way.
    """
    A, omega, E = inputs.data()
    design = nine_term_design(A, omega, E)
    members = np.flatnonzero(best_subsets(design, "bic", nonnegative=True).members[0])
    physical, nine = fit(design.take(members)), fit(design)
    beyond = 0.03 * np.ptp(omega)
    grid_A = np.linspace(0.02 * A.max(), 1.05 * A.max(), cells)
    grid_omega = np.linspace(omega.min() - beyond, omega.max() + beyond, cells)
    surfaces = [_surface(law, grid_A, grid_omega, terms) for law, terms in ((physical, members), (nine, range(9)))]
    return EnergySurface(
        amplitude=grid_A,
        omega=grid_omega,
        physical=surfaces[0],
        nine=surfaces[1],
        law=physical.names,
        points=pd.DataFrame({"omega_rad_s": omega, "amplitude_in": A, "energy_in_lb": E}),
        rms_errors=(physical.rms_error, nine.rms_error),
        negative_share=float((surfaces[1] < 0.0).mean()),
        lowest=float(surfaces[1].min()),
    )


def _surface(fitted: Fit, A: FloatArray, omega: FloatArray, terms: np.ndarray | range) -> FloatArray:
    """Fitted energy (a, f) on a grid."""
    rows = [np.ravel(axis) for axis in np.meshgrid(A, omega, indexing="ij")]
    grid = nine_term_design(rows[0], rows[1], np.ones(rows[0].size)).columns[:, list(terms)]
    return np.asarray(grid @ fitted.coefficients).reshape(A.size, omega.size)


@styled
def draw_energy_surfaces(result: EnergySurface) -> Figure:
    """Draw energy over frequency and amplitude: a law with coefficients > 0 beside all nine terms (Fig. 5.1)."""
    figure = Figure(figsize=(WIDTH, 5.6))
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    top = float(result.points["energy_in_lb"].max())
    law = " + ".join(_describe_pretty(term) for term in result.law)
    titles = (
        f"{law}\nrms error {result.rms_errors[0]:.1f} in-lb",
        f"nine terms\nrms error {result.rms_errors[1]:.1f} in-lb",
    )
    levels = np.asarray(MaxNLocator(12).tick_values(0.0, 1.2 * top))
    for axes, surface, title in zip(panels, (result.physical, result.nine), titles, strict=True):
        drawn = _draw_surface(axes, result, surface, levels)
        axes.set_title(title, fontsize=8.5)
        axes.set_ylabel("amplitude (in)")
    panels[1].set_xlabel("frequency ω (rad/s)")
    bar = figure.colorbar(drawn, ax=panels, label="energy per cycle (in-lb)", shrink=0.95)
    bar.outline.set_visible(False)
    return figure


def _draw_surface(axes: Axes, result: EnergySurface, surface: FloatArray, levels: FloatArray) -> QuadContourSet:
    drawn = axes.contourf(result.omega, result.amplitude, surface, levels, cmap="cividis", extend="max")
    if (surface < 0.0).any():
        below = [float(surface.min()) - 1.0, 0.0]
        axes.contourf(result.omega, result.amplitude, surface, below, colors=["white"])
        axes.contourf(result.omega, result.amplitude, surface, below, colors="none", hatches=["////"])
        axes.contour(result.omega, result.amplitude, surface, [0.0], colors=ALERT, linewidths=1.2)
        below_zero = Patch(facecolor="white", edgecolor=ALERT, hatch="////", label="energy < 0")
        axes.legend(handles=[below_zero], loc="upper left", frameon=True, fontsize=7.5)
    axes.scatter(
        result.points["omega_rad_s"], result.points["amplitude_in"], c=result.points["energy_in_lb"], cmap="cividis",
        vmin=levels[0], vmax=levels[-1], s=34, edgecolors="white", linewidths=1.1, zorder=4,
    )  # fmt: skip
    axes.grid(visible=False)
    return drawn


def _describe_pretty(term: str) -> str:
    """A term with its powers raised: A²ω."""
    return term.replace("*", "").replace("omega", "ω").replace("^2", "²").replace("^3", "³").replace("^4", "⁴")
