"""Chapter V: energy surface (Fig. 5.1), nine terms, false terms, circularity.

Chapter V in the report: energy as a polynomial (5.1), regressions, and the terms that the data carry (5.3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from damping.arrays import FloatArray
from damping.plots import ALERT, AVERAGE, LINEAR, MUTED, WIDTH, draw_plain_rows, law_style, plain_log, styled
from damping.report import format_between, number
from damping.report.page import Table
from damping_reed1970.chapter_5.circularity import ROUTES, Circularity
from damping_reed1970.chapter_5.false_terms import FARTHER, METHODS, FalseTerms
from damping_reed1970.chapter_5.regressions import EnergySurface
from damping_reed1970.common import ReportPart, chapter_table, row, write_chapter
from damping_reed1970.studies import ReportResults, Studies

_METHODS = {
    "backward elimination, |T| >= 2": (LINEAR, "o", "-"),
    "best subset, BIC": (AVERAGE, "s", (0, (4, 2))),
    "best subset, BIC, coefficients > 0": ("#009e73", "D", "-"),
}
_CLASSES = {
    "linear (viscous or displacement)": "#c3cad1",
    "with velocity squared": law_style("velocity-squared").colour,
    "other nonlinear": law_style("displacement-velocity").colour,
}


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
        drawn = _surface(axes, result, surface, levels)
        axes.set_title(title, fontsize=8.5)
        axes.set_ylabel("amplitude (in)")
    panels[1].set_xlabel("frequency ω (rad/s)")
    bar = figure.colorbar(drawn, ax=panels, label="energy per cycle (in-lb)", shrink=0.95)
    bar.outline.set_visible(False)
    return figure


def _surface(axes: Axes, result: EnergySurface, surface: FloatArray, levels: FloatArray) -> QuadContourSet:
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


@styled
def draw_terms_against_error(by_size: pd.DataFrame, elimination: pd.DataFrame, inputs: Sequence[str]) -> Figure:
    """Draw least RMS error against number of terms, free and with coefficients > 0, and the way of elimination.

    Args:
        by_size: ``inputs, coefficients, terms, rms_error_in_lb``. elimination: ``inputs, coefficients, terms_left,
            negative, rms_error_in_lb``. inputs: those drawn, a panel each.
    """
    figure = Figure(figsize=(WIDTH, 2.7 * len(inputs)))
    panels = np.atleast_1d(figure.subplots(len(inputs), sharex=True, sharey=True))
    for axes, name in zip(panels, inputs, strict=True):
        mine = by_size[by_size["inputs"] == name]
        steps = elimination[(elimination["inputs"] == name) & (elimination["coefficients"] == "free")]
        axes.set_yscale("log")
        for kind, colour, label in (
            ("free", MUTED, "best of its size, free"),
            ("> 0", "#009e73", "best of its size, all > 0"),
        ):
            rows = mine[mine["coefficients"] == kind]
            axes.plot(rows["terms"], rows["rms_error_in_lb"], "o-", color=colour, label=label)
        axes.plot(
            steps["terms_left"], steps["rms_error_in_lb"], "x", color=LINEAR, markersize=6, label="backward elimination"
        )
        for terms, error, negative in steps[["terms_left", "rms_error_in_lb", "negative"]].itertuples(index=False):
            if negative:
                axes.annotate(
                    f"{negative} < 0", (terms, error), (3, 5), textcoords="offset points", fontsize=6.5, color=LINEAR
                )
        axes.set_title(name)
        axes.set_xticks(range(1, 10))
        axes.set_ylabel("rms error of energy (in-lb)")
        plain_log(axes.yaxis)
    panels[-1].set_xlabel("number of terms")
    panels[0].legend(loc="lower left", fontsize=7)
    return figure


@styled
def draw_false_terms(selection: pd.DataFrame) -> Figure:
    """Draw how often a term is selected that is not there, and the energy error at twice the amplitude, against noise.

    Args:
        selection: ``terms, method, noise_percent, share_false, energy_error_percent``.
    """
    sets = list(selection["terms"].unique())
    figure = Figure(figsize=(WIDTH, 5.6))
    panels = figure.subplots(2, len(sets), sharex=True, sharey="row", squeeze=False)
    for column, terms in enumerate(sets):
        share, error = panels[0, column], panels[1, column]
        for method, (colour, marker, line) in _METHODS.items():
            rows = selection[(selection["terms"] == terms) & (selection["method"] == method)]
            style = {"color": colour, "marker": marker, "linestyle": line, "markersize": 4}
            share.plot(rows["noise_percent"], rows["share_false"], label=method.replace(">=", "≥"), **style)
            error.plot(rows["noise_percent"], rows["energy_error_percent"], **style)
        share.set_title(f"chosen among\n{terms}")
        share.set(xscale="log", ylim=(0.0, 1.0))
        error.set(yscale="log")
        plain_log(error.xaxis)
        plain_log(error.yaxis)
        error.set_xlabel("noise of the energy (per cent)")
    panels[0, 0].set_ylabel("share of runs\nwith a false term")
    panels[1, 0].set_ylabel("energy error\nat 2 A (per cent)")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=1, fontsize=7.5)
    return figure


@styled
def draw_circularity(laws: pd.DataFrame, routes: Sequence[str]) -> Figure:
    """Draw which kind of law comes out of known structures, a panel a route, a bar a truth and noise.

    Args:
        laws: ``truth, noise_percent, route, law, share``; the measured data are the truth ``measured``.
        routes: those drawn.
    """
    kinds = laws.assign(kind=[_describe_kind(law) for law in laws["law"]])
    known = kinds[(kinds["truth"] != "measured") & (kinds["noise_percent"] > 0)]
    cases = list(known[["truth", "noise_percent"]].drop_duplicates().itertuples(index=False, name=None))
    figure = Figure(figsize=(WIDTH, 0.9 + (0.6 + 0.2 * len(cases)) * len(routes)))
    panels = np.atleast_1d(figure.subplots(len(routes), sharex=True))
    labels = [f"{truth}, {noise:g} %" for truth, noise in cases]
    for axes, route in zip(panels, routes, strict=True):
        draw_plain_rows(axes, ["measured", *labels])
        rows = kinds[(kinds["truth"] == "measured") & (kinds["route"] == route)]
        _draw_bars(axes, 0, rows)
        for place, (truth, noise) in enumerate(cases, start=1):
            mine = (known["truth"] == truth) & (known["noise_percent"] == noise) & (known["route"] == route)
            _draw_bars(axes, place, known[mine])
        axes.set(xlim=(0.0, 1.0), xticks=[0.0, 0.5, 1.0])
        axes.set_title(route, fontsize=7.5, x=-0.5)
    panels[-1].set_xlabel("share of runs")
    handles = [Patch(color=colour, label=kind) for kind, colour in _CLASSES.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=7.5)
    return figure


def _draw_bars(axes: Axes, row: int, laws: pd.DataFrame) -> None:
    left = 0.0
    for kind, colour in _CLASSES.items():
        share = float(laws.loc[laws["kind"] == kind, "share"].sum())
        axes.barh(row, share, left=left, color=colour, height=0.72, linewidth=0)
        left += share


def _describe_kind(law: str) -> str:
    """Class of a law: a narrow band cannot tell viscous from displacement-proportional damping."""
    forces = set(law.split(" + "))
    linear, squared, other = _CLASSES
    if forces <= {"viscous", "displacement"}:
        return linear
    return squared if "velocity-squared" in forces else other


def _describe_pretty(term: str) -> str:
    """A term with its powers raised: A²ω."""
    return term.replace("*", "").replace("omega", "ω").replace("^2", "²").replace("^3", "³").replace("^4", "⁴")


#: A coefficient comes out where it is this close to the print, relative: half a unit of a second digit.
CLOSE = 0.005
#: Noise, per cent, at which sentences speak of the simulations: about that of the energies of Configuration I.
NOISE = 3.0
#: Subsets of nine terms.
SUBSETS = 511
#: Studies of the chapter that are written whole.
_TABLES = (
    *("nine_terms", "nine_terms_summary", "nine_terms_elimination", "nine_terms_best", "nine_terms_by_size"),
    *("false_terms", "false_terms_frequency", "false_terms_inflation", "circular_laws", "circular_claims"),
)


def write_chapter_5(results: ReportResults) -> ReportPart:
    """The page: energy surface, regressions from three kinds of inputs, and which terms the data carry."""
    studies, every, regressions = results.studies, results.studies.tables(), results.tables["regressions"]
    shown = {
        "coefficients": Table(
            tabulate_regression_rows(regressions), "", headings={"T-ratio": "its T-ratio"}, key="regressions"
        ),
        "measured": chapter_table(5, "circular_claims", _tabulate_measured(studies.circular)),
    }
    values = {
        "surface": studies.surface,
        "largest_energy": studies.surface.points["energy_in_lb"].max(),
        "nine": studies.nine.summary,
        "span": _describe_span,
        "subsets": SUBSETS,
        "noise": NOISE,
        **_collect_coefficient_values(regressions),
        **_collect_check_out_values(regressions),
        **_collect_false_values(studies.false),
        **_collect_circle_values(studies.circular),
    }
    return write_chapter(
        5,
        "Chapter V: energy as a polynomial",
        Path(__file__).with_suffix(".txt"),
        results.tables,
        values=values,
        figures=collect_figures(studies),
        shown=shown,
        tables={name: every[name] for name in _TABLES},
    )


def collect_figures(studies: Studies) -> dict[str, Callable[[], Figure]]:
    """How each figure of the chapter is drawn, by name."""
    nine, inputs = studies.nine, ("5.III recovered", "5.IV recovered")
    return {
        "configuration-1-energy": lambda: draw_energy_surfaces(studies.surface),
        "nine-terms": lambda: draw_terms_against_error(nine.by_size, nine.elimination, inputs),
        "false-terms": lambda: draw_false_terms(studies.false.selection),
        "circularity": lambda: draw_circularity(studies.circular.laws, ROUTES),
    }


def tabulate_regression_rows(regressions: pd.DataFrame) -> pd.DataFrame:
    """One row per fit and term: printed coefficient beside those from printed, corrected and recovered inputs.

    The check-out data have no recovered inputs but the law that made them.
    """
    rows = []
    for (fit, equation, term), rows_of_term in regressions.groupby(["fit", "equation", "term"], sort=False):
        values, last = rows_of_term.set_index("inputs")["coefficient"], rows_of_term.iloc[-1]
        rows.append(
            {
                "fit": fit,
                "equation": equation,
                "term": term,
                "printed": last["printed"],
                "from printed inputs": values["printed"],
                "from corrected": values["corrected"],
                "from recovered or made": last["coefficient"],
                "T-ratio": last["t_ratio"],
            }
        )
    return pd.DataFrame(rows)


def _collect_coefficient_values(regressions: pd.DataFrame) -> dict[str, Any]:
    """How many of the printed coefficients come out of which inputs."""
    fits = regressions[regressions["fit"].isin(["E1", "E2", "E3", "E4"]) & regressions["printed"].notna()]
    close = (fits["coefficient"] / fits["printed"] - 1.0).abs() <= CLOSE
    inputs = {name: close[fits["inputs"] == name] for name in ("printed", "corrected", "recovered")}
    return {
        "coefficients": len(inputs["printed"]),
        "come_out": [f"{int(one.sum())} from the {name} inputs" for name, one in inputs.items()],
        "close_percent": 100.0 * CLOSE,
        "viscous": row(fits, fit="E3", inputs="recovered", force="viscous"),
        "squared": row(fits, fit="E3", inputs="recovered", force="velocity-squared"),
    }


def _collect_check_out_values(regressions: pd.DataFrame) -> dict[str, Any]:
    """The check-out run with two and with five terms."""
    fits = ("check-out, two terms", "check-out, five terms")
    two, five = (regressions[(regressions["fit"] == fit) & (regressions["inputs"] == "corrected")] for fit in fits)
    made = regressions[(regressions["fit"] == fits[0]) & (regressions["inputs"] == "generator")]
    return {
        "check_out_points": int(two["points"].iloc[0]),
        "errors": [float(one["average_absolute_percent"].iloc[0]) for one in (two, five)],
        "ratios": five["t_ratio"].abs(),
        "two": two["coefficient"],
        "made": made["coefficient"],
        "printed": two["printed"],
    }


def _describe_span(values: pd.Series, digits: int = 2) -> str:
    """``4 to 5``; one number where all are equal."""
    low, high = values.min(), values.max()
    return number(low, digits) if low == high else format_between(low, high, digits=digits)


def _collect_false_values(false: FalseTerms) -> dict[str, Any]:
    """How often selection finds what is not there."""
    nine = false.selection[false.selection["terms"] == "nine terms (5.3.6)"]
    methods = dict(zip(("backward", "best", "physical"), METHODS, strict=True))
    return {
        **{name: row(nine, method=method, noise_percent=NOISE) for name, method in methods.items()},
        "clean": row(nine, method=METHODS[0], noise_percent=min(nine["noise_percent"])),
        "replicates": false.replicates,
        "farther": FARTHER,
        "inflation": false.inflation["over_true_terms"].iloc[-1],
    }


def _collect_circle_values(circular: Circularity) -> dict[str, Any]:
    """What the energies of Table 5.IV are, and what selection makes of structures that are known."""
    claims = circular.claims[circular.claims["noise_percent"] == NOISE]
    linear = [row(claims, truth="linear, planes as fitted", route=route) for route in ROUTES[:2]]
    laws = _tabulate_measured(circular)[["route", "law"]].to_numpy()
    return {
        "circular": circular,
        "nonlinear": [one["nonlinear_share"] for one in linear],
        "selected": [f"{law} ({route})" for route, law in laws],
    }


def _tabulate_measured(circular: Circularity) -> pd.DataFrame:
    """The measured data by route."""
    laws = circular.laws[circular.laws["truth"] == "measured"].set_index("route")["law"]
    claims = circular.claims[circular.claims["truth"] == "measured"]
    return pd.DataFrame(
        {
            "route": claims["route"],
            "law": [laws[route] for route in claims["route"]],
            "A³ω² before A²ω": claims["cubed_share"] > 0.5,
            "C₁": claims["C_1"],
            "C₃": claims["C_3"],
        }
    )
