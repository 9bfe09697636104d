"""Chapter V in the report: energy as a polynomial (5.1), the check-out run and the regressions (5.3)."""

from __future__ import annotations

import pandas as pd

from selection.report.chapters.chosen_terms import TERM_TABLES, term_blocks
from selection.report.chapters.common import Figures, agreement_text, figure, of_chapter, part, row
from selection.report.page import Block, Heading, Table, Text
from selection.report.part import Part
from selection.report.results import ChapterResults
from selection.report.sections.source import known_table
from selection.report.words import between, count, joined, number, percent
from selection.reproduction.energy_surface import EnergySurface

#: A coefficient comes out where it is this close to the print, relative.
CLOSE = 0.005


def chapter_5(results: ChapterResults, figures: Figures) -> Part:
    """The part: energy surface, regressions from three kinds of inputs, and which terms the data carry."""
    tables, every = results.tables, results.studies.tables()
    blocks: list[Block] = [
        Text(
            "Chapter V writes the energy loss per cycle as a polynomial in amplitude and frequency, each term the "
            "energy of a damping force (Table 5.I), fits it to fifteen points of Configuration I by least squares, "
            "and drops the terms of least T-ratio."
        ),
        Text(agreement_text(of_chapter(tables["reproduction"], 5))),
        Heading("5.1: the energy surface"),
        Text(_surface(results.studies.surface)),
        figure(figures, "configuration-1-energy", 5),
        Heading("5.3: regressions from printed, corrected and recovered inputs"),
        Text(_coefficients(tables["regressions"])),
        Text(_check_out(tables["regressions"])),
        Table(
            regression_rows(tables["regressions"]), _REGRESSIONS, headings={"T-ratio": "its T-ratio"}, key="regressions"
        ),
        *known_table("regressions", tables["regressions"]),
        *known_table("regression_deviations", tables["regression_deviations"]),
        *term_blocks(results.studies, figures),
    ]
    return part(5, "Chapter V: energy as a polynomial", blocks, {name: every[name] for name in TERM_TABLES})


_REGRESSIONS = (
    "Coefficients of the energy polynomials: as printed, and by least squares from each kind of input; T-ratio of the "
    "last."
)


def regression_rows(regressions: pd.DataFrame) -> pd.DataFrame:
    """A row a fit and term: printed coefficient beside those from printed, corrected and recovered inputs.

    The check-out data have no recovered inputs but the law that made them.
    """
    rows = []
    for (fit, equation, term), found in regressions.groupby(["fit", "equation", "term"], sort=False):
        values, last = found.set_index("inputs")["coefficient"], found.iloc[-1]
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


def _surface(surface: EnergySurface) -> str:
    """What a fit with nine terms does between its points."""
    largest = surface.points["energy_in_lb"].max()
    return (
        "The data of Fig. 5.1 are not printed; its counterpart is the energy of Configuration I. All nine terms of "
        f"Eq. 5.3.6 fit the {len(surface.points)} points to {number(surface.rms_errors[1], 2)} in-lb root mean square, "
        f"and give energies below 0 on {percent(100.0 * surface.negative_share)} per cent of the surface, down to "
        f"{number(surface.lowest)} in-lb where the largest measured one is {number(largest)}. The best law with all "
        f"coefficients above 0, {joined(surface.law)}, fits to {number(surface.rms_errors[0], 2)} in-lb and is "
        "positive everywhere. A fit “with zero error” is no evidence for its terms."
    )


def _coefficients(regressions: pd.DataFrame) -> str:
    """How many of the printed coefficients come out of which inputs."""
    fits = regressions[regressions["fit"].isin(["E1", "E2", "E3", "E4"]) & regressions["printed"].notna()]
    close = (fits["coefficient"] / fits["printed"] - 1.0).abs() <= CLOSE
    inputs = {name: close[fits["inputs"] == name] for name in ("printed", "corrected", "recovered")}
    said = joined(f"{int(one.sum())} from the {name} inputs" for name, one in inputs.items())
    viscous, squared = (
        row(fits, fit="E3", inputs="recovered", force=force) for force in ("viscous", "velocity-squared")
    )
    return (
        f"Of the {len(inputs['printed'])} coefficients printed for E₁ to E₄, {said} come out within "
        f"{100.0 * CLOSE:g} per cent. The recovered inputs are what the report's own columns of fitted energy and per "
        "cent deviation were computed from: its tables are not quite what it regressed (errata E5III-1, E5III-2, "
        "E5IV-1, E5IV-2). Of the two forces that the report adopts (5.3.16) the viscous one has a T-ratio of "
        f"{number(viscous['t_ratio'], 2)}, velocity-squared one of {number(squared['t_ratio'], 2)}."
    )


def _check_out(regressions: pd.DataFrame) -> str:
    """The check-out run with two and with five terms."""
    fits = ("check-out, two terms", "check-out, five terms")
    two, five = (regressions[(regressions["fit"] == fit) & (regressions["inputs"] == "corrected")] for fit in fits)
    made = regressions[(regressions["fit"] == fits[0]) & (regressions["inputs"] == "generator")]
    errors = [float(one["average_absolute_percent"].iloc[0]) for one in (two, five)]
    ratios = five["t_ratio"].abs()
    return (
        f"The check-out run (Table 5.II, {count(int(two['points'].iloc[0]), 'point')} made from a law of two terms) is "
        f"to show that the program finds the law. From the corrected table two terms give {_values(two)}, from the "
        f"generator's own energies {_values(made)}, against {_printed(two)} printed. The report says that the error "
        "with five terms is more than twice as large; least squares with more terms cannot fit worse: the average "
        f"deviation is {number(errors[0])} per cent with two terms and {number(errors[1])} with five. With five, "
        f"T-ratios of {between(ratios.min(), ratios.max(), digits=2)} leave hardly a digit of the printed coefficients "
        "determined (erratum E5II-3)."
    )


def _values(rows: pd.DataFrame) -> str:
    return joined(number(value, 4) for value in rows["coefficient"])


def _printed(rows: pd.DataFrame) -> str:
    return joined(number(value, 4) for value in rows["printed"])
