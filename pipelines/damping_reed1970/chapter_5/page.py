"""Chapter V in the report: energy as a polynomial (5.1), regressions, and the terms that the data carry (5.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from damping.report import format_between, number
from damping.report.page import Table
from damping_reed1970.chapter_5.circularity import ROUTES, Circularity, draw_circularity
from damping_reed1970.chapter_5.false_terms import FARTHER, METHODS, FalseTerms, draw_false_terms
from damping_reed1970.chapter_5.nine_terms import draw_energy_surfaces, draw_terms_against_error
from damping_reed1970.common import ReportPart, chapter_table, row, write_chapter
from damping_reed1970.studies import ReportResults, Studies

#: A coefficient comes out where it is this close to the print, relative: half a unit of a second digit.
CLOSE = 0.005
#: Noise, per cent, at which sentences speak of the simulations: about that of the energies of Configuration I.
NOISE = 3.0
#: Subsets of nine terms.
SUBSETS = 511


def write_chapter_5(results: ReportResults) -> ReportPart:
    """The page: energy surface, regressions from three kinds of inputs, and which terms the data carry."""
    studies, every, regressions = results.studies, results.studies.tables(5), results.tables["regressions"]
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
    figures = collect_figures(studies)
    return write_chapter(5, results.tables, values=values, figures=figures, shown=shown, tables=every)


def collect_figures(studies: Studies) -> dict[str, Callable[[], Figure]]:
    """How each figure of the chapter is drawn, by name."""
    return {
        "configuration-1-energy": lambda: draw_energy_surfaces(studies.surface),
        "nine-terms": lambda: draw_terms_against_error(studies.nine),
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
        "come_out": [f"{int(holds.sum())} from the {name} inputs" for name, holds in inputs.items()],
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
        "errors": [float(fits_of["average_absolute_percent"].iloc[0]) for fits_of in (two, five)],
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
        "clean": row(nine, method=methods["backward"], noise_percent=min(nine["noise_percent"])),
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
        "nonlinear": [claim["nonlinear_share"] for claim in linear],
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
