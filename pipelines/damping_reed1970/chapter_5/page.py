"""Chapter V in the report: energy as a polynomial (5.1), regressions, and the terms that the data carry (5.3)."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd
from matplotlib.figure import Figure

from damping.report import format_between, number
from damping.report.page import Table
from damping_reed1970.chapter_5.circularity import ROUTES, Circularity, draw_circularity
from damping_reed1970.chapter_5.false_terms import FARTHER, METHODS, draw_false_terms
from damping_reed1970.chapter_5.nine_terms import draw_energy_surfaces, draw_terms_against_error
from damping_reed1970.common import ReportPart, chapter_table, write_chapter
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
    measured = _tabulate_measured(studies.circular)
    shown = {
        "coefficients": Table(
            tabulate_regression_rows(regressions), "", headings={"T-ratio": "its T-ratio"}, key="regressions"
        ),
        "measured": chapter_table(5, "circular_claims", measured),
    }
    values = {
        "surface": studies.surface,
        "span": _describe_span,
        "subsets": SUBSETS,
        "noise": NOISE,
        "close": CLOSE,
        "methods": list(METHODS),
        "replicates": studies.false.replicates,
        "farther": FARTHER,
        "circular": studies.circular,
        "routes": ROUTES,
        "measured": measured,
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


def _describe_span(values: pd.Series, digits: int = 2) -> str:
    """``4 to 5``; one number where all are equal."""
    low, high = values.min(), values.max()
    return number(low, digits) if low == high else format_between(low, high, digits=digits)


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
