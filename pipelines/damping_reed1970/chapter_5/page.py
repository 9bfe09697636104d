"""Chapter V in the report: energy as a polynomial (5.1), regressions, and the terms that the data carry (5.3)."""

from collections.abc import Callable

import pandas as pd
from matplotlib.figure import Figure

from damping.report.page import Table
from damping_reed1970 import ReportPart, chapter_table, write_chapter
from damping_reed1970.chapter_5.circularity import ROUTES, Circularity, draw_circularity
from damping_reed1970.chapter_5.false_terms import FARTHER, METHODS, draw_false_terms
from damping_reed1970.chapter_5.nine_terms import draw_energy_surfaces, draw_terms_against_error
from damping_reed1970.studies import ReportResults, Studies


def write_chapter_5(results: ReportResults) -> ReportPart:
    """The page: energy surface, regressions from three kinds of inputs, and which terms the data carry."""
    studies, every, regressions = results.studies, results.studies.tables(5), results.tables["regressions"]
    measured = _tabulate_measured(studies.circular)
    shown = {
        "coefficients": Table(
            tabulate_regression_rows(regressions), headings={"T-ratio": "its T-ratio"}, key="regressions"
        ),
        "measured": chapter_table(5, "circular_claims", measured),
    }
    values = {"studies": studies, "methods": list(METHODS), "farther": FARTHER, "routes": ROUTES, "measured": measured}
    return write_chapter(5, results.tables, values=values, figures=collect_figures(studies), shown=shown, tables=every)


def collect_figures(studies: Studies) -> dict[str, Callable[[], Figure]]:
    """How each figure of the chapter is drawn, by name."""
    return {
        "configuration-1-energy": lambda: draw_energy_surfaces(studies.surface),
        "nine-terms": lambda: draw_terms_against_error(studies.nine),
        "false-terms": lambda: draw_false_terms(studies.false.selection),
        "circularity": lambda: draw_circularity(studies.circular.laws),
    }


def tabulate_regression_rows(regressions: pd.DataFrame) -> pd.DataFrame:
    """One row per fit and term: printed coefficient beside those from printed, corrected and recovered inputs.

    The check-out data have no recovered inputs but the law that made them.
    """
    keys, shown = ["fit", "equation", "term"], ["printed", "coefficient", "t_ratio"]
    values = regressions.pivot_table("coefficient", keys, "inputs")[["printed", "corrected"]].add_prefix("from ")
    rows = regressions.groupby(keys, sort=False)[shown].last().join(values).reset_index()
    names = {"coefficient": "from recovered or made", "t_ratio": "T-ratio", "from printed": "from printed inputs"}
    rows = rows.rename(columns=names)
    return rows[[*keys, "printed", "from printed inputs", "from corrected", "from recovered or made", "T-ratio"]]


def _tabulate_measured(circular: Circularity) -> pd.DataFrame:
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
