"""Section 5.3: the nine-term polynomial (5.3.6), free and with coefficients >= 0, and how few terms the data carry.

Fig. 5.1 has its counterpart in the energy of Configuration I (its own data are not printed). The report's figure is
fitted to fifteen points "with zero error"; what a fit that close is worth shows between its points: the nine terms of
Eq. 5.3.6 go below zero there, where a law of damping cannot.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from damping.arrays import FloatArray
from damping.plots import ALERT, LINEAR, MUTED, build_panels, styled
from damping.plots.scales import plain_log
from damping.regression.design import Design
from damping.regression.fit import Fit, fit, one_term_fits, tabulate_terms
from damping.regression.selecting import fit_nonnegative, stepwise
from damping.regression.subsets import Subsets, all_subsets, best_subsets
from damping_reed1970 import Version
from damping_reed1970.chapter_5 import E_1, E_3, PRINTED, EnergyFit, Points, energy_design

#: Eq. 5.3.6, in its order.
NINE_TERMS: tuple[str, ...] = tuple(PRINTED["nine_terms"])
#: Models listed of each kind.
BEST = 5
_T_ALWAYS = 1e300  # T-ratio to stop at that drops terms down to the last one
#: The rough data (Table 5.III) and the principal pitch data (5.IV), as printed and as the report's runs used them.
INPUTS: dict[str, tuple[EnergyFit, Version]] = {
    "5.III printed": (E_1, "printed"),
    "5.III recovered": (E_1, "used"),
    "5.IV printed": (E_3, "printed"),
    "5.IV recovered": (E_3, "used"),
}


def nine_terms(names: Sequence[str] = tuple(INPUTS)) -> dict[str, pd.DataFrame]:
    """The nine-term study on each of the inputs, a column of every table.

    ``nine_terms``: all nine terms at once, ``term, one_term_rank`` (1 most significant alone), coefficient, standard
    error and T-ratio of the free fit, ``nonnegative`` coefficient. ``nine_terms_summary``: scaled condition number,
    negative coefficients of the free fit, largest term over largest energy (cancellation), R^2 and RMS error free and
    >= 0, terms that >= 0 leaves, subsets of 511 with all coefficients > 0. ``nine_terms_elimination``: terms dropped by
    least |T|, down to one, free and >= 0. ``nine_terms_best``: the ``BEST`` subsets by BIC, free and with all > 0.
    ``nine_terms_by_size``: least RMS error of each number of terms, free and > 0 (NaN where none is).
    """
    parts = defaultdict[str, list[pd.DataFrame]](list)
    for name in names:
        design = energy_design(NINE_TERMS, *load_inputs(name))
        free, held, subsets = fit(design), fit_nonnegative(design), all_subsets(design)
        positive = subsets.take(((subsets.coefficients > 0.0) == subsets.members).all(axis=1))
        order = [single.names[0] for single in one_term_fits(design)]
        full = tabulate_terms(free).drop(columns="p_value").rename(columns={"name": "term"})
        full.insert(1, "one_term_rank", [order.index(term) + 1 for term in free.names])
        tables = {
            "nine_terms": full.assign(nonnegative=held.coefficients),
            "nine_terms_summary": _tabulate_summary(design, free, held, len(positive)),
            "nine_terms_elimination": _tabulate_elimination(design),
            "nine_terms_best": pd.concat([_tabulate_best(subsets, "free"), _tabulate_best(positive, "> 0")]),
            "nine_terms_by_size": pd.concat([_tabulate_by_size(subsets, "free"), _tabulate_by_size(positive, "> 0")]),
        }
        for key, table in tables.items():
            table.insert(0, "inputs", name)
            parts[key].append(table)
    return {key: pd.concat(tables, ignore_index=True) for key, tables in parts.items()}


def load_inputs(name: str) -> Points:
    """A, omega, E of one of ``INPUTS``."""
    energy_fit, version = INPUTS[name]
    return energy_fit.data(version)


def _tabulate_summary(design: Design, free: Fit, held: Fit, positive: int) -> pd.DataFrame:
    largest = np.abs(design.columns * free.coefficients).max()
    return pd.DataFrame(
        {
            "condition_number": [free.condition_number],
            "negative_coefficients": int((free.coefficients < 0.0).sum()),
            "largest_term_over_energy": float(largest / np.abs(design.observed).max()),
            "r_squared": free.r_squared,
            "rms_error_in_lb": free.rms_error,
            "nonnegative_terms": held.k,
            "nonnegative_r_squared": held.r_squared,
            "nonnegative_rms_error_in_lb": held.rms_error,
            "subsets_all_positive": positive,
        }
    )


def _tabulate_elimination(design: Design) -> pd.DataFrame:
    rows = []
    for kind, fitter in (("free", fit), (">= 0", fit_nonnegative)):
        for step in stepwise(design, "backward", t_stop=_T_ALWAYS, fitter=fitter).steps:
            if step.action == "drop" and np.isnan(step.t_ratio):  # a term that >= 0 holds at 0: the fit stays the same
                continue
            rows.append(
                {
                    "coefficients": kind,
                    "terms_left": step.fit.k,
                    "dropped": step.term,
                    "t_ratio_dropped": step.t_ratio,
                    "negative": int((step.fit.coefficients < 0.0).sum()),
                    "rms_error_in_lb": step.fit.rms_error,
                    "bic": float(step.fit.criteria.bic),
                    "left": ", ".join(np.array(step.fit.names)[step.fit.active]),
                }
            )
    return pd.DataFrame(rows)


def _tabulate_best(models: Subsets, kind: str) -> pd.DataFrame:
    order = np.argsort(models.scores("bic"), kind="stable")[:BEST]
    return pd.DataFrame(
        {
            "coefficients": kind,
            "rank": np.arange(len(order)) + 1,
            "terms": [", ".join(models.label(i)) for i in order],
            "bic": models.scores("bic")[order],
            "rms_error_in_lb": models.rms_errors[order],
            "least_t_ratio": np.nanmin(np.abs(models.t_ratios[order]), axis=1),
            "negative": (models.coefficients[order] < 0.0).sum(axis=1),
            "values": [", ".join(f"{c:.4g}" for c in models.coefficients[i][models.members[i]]) for i in order],
        }
    )


def _tabulate_by_size(models: Subsets, kind: str) -> pd.DataFrame:
    sizes = np.arange(1, len(NINE_TERMS) + 1)
    least = [float(models.rms_errors[models.sizes == size].min(initial=np.inf)) for size in sizes]
    rms = np.where(np.isfinite(least), least, np.nan)
    counts = [int((models.sizes == size).sum()) for size in sizes]
    return pd.DataFrame({"coefficients": kind, "terms": sizes, "models": counts, "rms_error_in_lb": rms})


DRAWN = ("5.III recovered", "5.IV recovered")  #: inputs drawn, a panel each


@styled
def draw_terms_against_error(study: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw least RMS error against number of terms, free and with coefficients > 0, and the way of elimination."""
    figure, panels = build_panels(2.7 * len(DRAWN), len(DRAWN), sharex=True, sharey=True)
    for axes, name in zip(panels, DRAWN, strict=True):
        sizes = study["nine_terms_by_size"].query("inputs == @name")
        steps = study["nine_terms_elimination"].query("inputs == @name and coefficients == 'free'")
        axes.set_yscale("log")
        for kind, colour, label in (("free", MUTED, "free"), ("> 0", "#009e73", "all > 0")):
            rows = sizes[sizes["coefficients"] == kind]
            axes.plot(rows["terms"], rows["rms_error_in_lb"], "o-", color=colour, label=f"best of its size, {label}")
        way = steps[["terms_left", "rms_error_in_lb", "negative"]].to_numpy()
        axes.plot(way[:, 0], way[:, 1], "x", color=LINEAR, markersize=6, label="backward elimination")
        text: dict[str, Any] = {"textcoords": "offset points", "fontsize": 6.5, "color": LINEAR}
        for terms, error, negative in way[way[:, 2] > 0]:
            axes.annotate(f"{negative:.0f} < 0", (terms, error), (3, 5), **text)
        axes.set(title=name, xticks=range(1, 10), ylabel="rms error of energy (in-lb)")
        plain_log(axes.yaxis)
    panels[-1].set_xlabel("number of terms")
    panels[0].legend(loc="lower left", fontsize=7)
    return figure


@dataclass(frozen=True)
class EnergySurface:
    """Two surfaces on the grid ``amplitude`` (a,) times ``omega`` (f,), energies (a, f) in in-lb."""

    amplitude: FloatArray
    omega: FloatArray
    physical: FloatArray  #: best subset of the nine terms with every coefficient > 0, by BIC
    nine: FloatArray  #: all nine terms, free
    law: tuple[str, ...]  #: terms of the first
    points: pd.DataFrame  #: ``omega_rad_s, amplitude_in, energy_in_lb``
    rms_errors: tuple[float, float]  #: of both at the points
    negative_share: float  #: of the grid on which the nine terms give energy to the structure
    lowest: float  #: the least energy


def energy_surface(cells: int = 80) -> EnergySurface:
    """The surfaces over the rectangle that the data of Table 5.III span and a little more, from zero amplitude."""
    A, omega, E = load_inputs("5.III printed")
    design = energy_design(NINE_TERMS, A, omega, E)
    members = np.flatnonzero(best_subsets(design, "bic", nonnegative=True).members[0])
    physical, nine = fit(design.take(members)), fit(design)
    beyond = 0.03 * np.ptp(omega)
    grid_A = np.linspace(0.02 * A.max(), 1.05 * A.max(), cells)
    grid_omega = np.linspace(omega.min() - beyond, omega.max() + beyond, cells)
    rows = [np.ravel(axis) for axis in np.meshgrid(grid_A, grid_omega, indexing="ij")]
    terms = energy_design(NINE_TERMS, rows[0], rows[1], np.ones(rows[0].size)).columns
    energies = terms[:, members] @ physical.coefficients, terms @ nine.coefficients
    surfaces = [np.asarray(energy).reshape(cells, cells) for energy in energies]
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


@styled
def draw_energy_surfaces(result: EnergySurface) -> Figure:
    """Draw energy over frequency and amplitude: a law with coefficients > 0 beside all nine terms (Fig. 5.1)."""
    figure, panels = build_panels(5.6, 2, sharex=True, sharey=True)
    top = float(result.points["energy_in_lb"].max())
    law = " + ".join(result.law).replace("*", "").replace("omega", "ω")  # A²ω
    names = law.replace("^2", "²").replace("^3", "³").replace("^4", "⁴"), "nine terms"
    titles = [f"{name}\nrms error {e:.1f} in-lb" for name, e in zip(names, result.rms_errors, strict=True)]
    levels = np.asarray(MaxNLocator(12).tick_values(0.0, 1.2 * top))
    for axes, surface, title in zip(panels, (result.physical, result.nine), titles, strict=True):
        drawn = _draw_surface(axes, result, surface, levels)
        axes.set_title(title, fontsize=8.5)
        axes.set_ylabel("amplitude (in)")
    panels[1].set_xlabel("frequency ω (rad/s)")
    figure.colorbar(drawn, ax=panels, label="energy per cycle (in-lb)", shrink=0.95).outline.set_visible(False)
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
