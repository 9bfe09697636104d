"""Further tables of a study, whatever they are; those of the source report get a title and an explanation.

Two gaps of the source report on the page: what the diagnosis says of each from its table alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees

import pandas as pd

from damping.effects import CATALOGUE
from damping.gap.corrected import effect_values, refitted_values
from damping.gap.diagnose import Diagnosis
from damping.plots.style import to_svg
from damping.report.gap_figures import gap_figures
from damping.report.gap_page import doubts, following, place, reach, trends, verdict
from damping.report.page import Block, FigureBlock, Fold, Heading, List, Part, Section, Table, Text
from damping.report.results import ChapterResults, StudyResult, Svgs, figure
from damping.report.words import number, share
from damping_reed1970.records import Gaps
from damping_validation.blind_page import blind_rows, load_blind_table

#: A table with more rows than this is folded away.
MOST_ROWS = 24


@dataclass(frozen=True)
class Known:
    """A table that is known by name: its title, what it says, and the columns that the page shows (all if empty)."""

    title: str
    said: str
    columns: tuple[str, ...] = ()


KNOWN = {
    "section_6_1": Known(
        "Damping forces of section 6.1, printed and ours",
        "Each printed coefficient beside its recomputation by the report's own method on corrected tables, and "
        "beside our fit with its 90 per cent credible interval. A law reproduces the tests when its amplitudes are "
        "within 5 per cent.",
        (
            *("configuration", "mode", "equation", "force", "parameter", "unit", "printed", "recomputed", "ours"),
            *("low", "high", "printed_in_interval", "printed_percent_resonance", "recomputed_percent_resonance"),
            *("ours_percent_resonance", "printed_reproduces", "recomputed_reproduces", "ours_reproduces", "erratum"),
        ),
    ),
    "section_6_1_errors": Known(
        "Errors of the laws of section 6.1, point by point",
        "Per cent error of resonant amplitude and of energy per cycle at each tested point, for each version of "
        "each law.",
    ),
    "section_4_3_example": Known(
        "The example of section 4.3: what becomes of 67 per cent",
        "The report extrapolates the first mode of Configuration II to 90 lb. Its numbers beside their "
        "recomputation, with intervals where there are any.",
    ),
    "power_laws": Known(
        "Power laws of section 4.3, printed and recomputed",
        "Exponent and coefficient from the printed and from the corrected tables, beside the printed values.",
        (
            *("mode", "form", "equation", "inputs", "p_printed", "p", "p_std_error", "p_low", "p_high"),
            *("alpha_printed", "alpha_at_printed_p", "alpha", "erratum"),
        ),
    ),
    "linear_coefficients": Known(
        "Linear coefficients against amplitude, section 4.1",
        "The amplitude-dependent linear coefficient and the forces it is converted to, from one degree of freedom.",
        (
            *("mode", "model", "inputs", "parameter", "unit", "coefficient", "std_error", "t_ratio", "low", "high"),
            *("report_method", "printed", "force", "force_coefficient", "printed_force", "erratum"),
        ),
    ),
    "regressions": Known(
        "Regressions of chapter V, printed and recomputed",
        "Every energy polynomial the report fitted, from printed, corrected and recovered inputs. R² is without a "
        "constant.",
        (
            *("fit", "equation", "inputs", "cells_changed", "points", "term", "coefficient", "std_error", "t_ratio"),
            *("printed", "force", "force_coefficient", "printed_force", "r_squared_without_constant"),
            *("average_absolute_percent", "largest_absolute_percent", "erratum"),
        ),
    ),
    "regression_deviations": Known(
        "Per cent deviations of Tables 5.II to 5.IV",
        "The report's own column of per cent deviations beside those of our fits to printed, corrected and "
        "recovered inputs.",
    ),
    "errata": Known(
        "Errata of the report",
        "Misprints, misreadings and derivation errors with their proofs. Severity A changes results, B changes "
        "numbers, C is minor.",
        ("id", "severity", "where", "as_printed", "should_be"),
    ),
    "reproduction": Known(
        "Every printed result recomputed",
        "Printed values beside what their own recipe gives, from the tables as printed and after correction.",
        ("id", "where", "printed", "computed", "computed_after_correction", "agreement", "erratum", "reason"),
    ),
}
_ORDER = tuple(KNOWN)


def source(study: StudyResult, svgs: Svgs) -> list[Section]:
    """The section: all further tables, or those that the chapters of the source report do not show; maybe none."""
    left = [name for name in study.tables if study.chapters is None or name not in KNOWN]
    if not left:
        return []
    names = sorted(left, key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))
    blocks: list[Block] = []
    for name in names:
        known = KNOWN.get(name, Known(name.replace("_", " ").capitalize(), ""))
        blocks.append(Heading(known.title))
        if name == "reproduction":
            blocks += figure(
                svgs,
                "reproduction",
                "Per cent difference between each printed number and its recomputation, by group of ids (count).",
            )
        blocks += _table(name, study.tables[name], known)
    return [Section("source", "Beside the source report", blocks)]


def known_table(name: str, frame: pd.DataFrame) -> list[Block]:
    """A table that is known by name with what it says, folded where it is long."""
    return _table(name, frame, KNOWN[name])


def _table(name: str, frame: pd.DataFrame, known: Known) -> list[Block]:
    """A table, folded where it is long; errata that change results come first and stay open."""
    shown = frame[[column for column in known.columns if column in frame]] if known.columns else frame
    if name == "errata" and "severity" in frame:
        serious = frame["severity"] == "A"
        open_, rest = shown[serious].drop(columns="severity"), shown[~serious]
        folded = Fold(f"The other {len(rest)} errata", [Table(rest, "Errata that change numbers, and minor ones.")])
        return [Table(open_, f"{known.said} Here: those that change results.", key=name), folded]
    if len(shown) <= MOST_ROWS:
        return [Table(shown, known.said or known.title, key=name)]
    said = [Text(known.said)] if known.said else []
    return [*said, Fold(f"{known.title}: all {len(shown)} rows", [Table(shown, known.title, key=name)])]


#: Figures shown of each gap, and hypotheses listed.
SHOWN, _MOST = ("overlay", "local", "probabilities"), 8


def gaps(results: ChapterResults) -> Part:
    """The part: Configuration I against one plane, Configuration II against viscous damping."""
    found: Gaps = results.gaps
    blocks: list[Block] = [
        Text(
            "Two gaps between simulation and test whose cause the report found by hand. The diagnosis sees the table "
            "and the simulation, nothing else."
        )
    ]
    figures: dict[str, str] = {}
    tables: dict[str, pd.DataFrame] = {}
    for number_, (one, what) in enumerate(((found.configuration_1, _planes), (found.configuration_2, _damping)), 1):
        blocks += [Heading(one.mode.name), Text(verdict(one), lead=True)]
        said = [place(one), *doubts(one), *trends(one), *what(one)]
        blocks.append(List([*said, reach(one), following(one)]))
        for name, drawn in gap_figures(one).items():
            if name in SHOWN:
                file = f"gap-configuration-{number_}-{name}"
                figures[file] = to_svg(drawn.figure, file, drawn.title, drawn.description)
                blocks.append(FigureBlock(figures[file], f"{drawn.title}. {drawn.description}"))
        key = f"gap_configuration_{number_}"
        tables[key] = hypotheses_table(one)
        caption = "The most probable explanations, with the natural logarithm of their evidence"
        blocks.append(Table(tables[key].head(_MOST), caption, {"probability": share}, key=key))
    blocks += [
        Heading("How far such a diagnosis can be trusted"),
        Text(_TRUST),
        Table(blind_rows(load_blind_table()), _BLIND),
    ]
    return Part(Section("gaps", "Two gaps between simulation and test", blocks), figures, tables)


_TRUST = (
    "The same diagnosis answered 1500 generated cases whose effect was withheld from it (the command damping blind): "
    "goals beside measured values, with 95 per cent intervals. Names of forces whose predictions a record cannot tell "
    "apart count as wrong in the strict figures of the leading class; the line below each counts them as right where "
    "the answer says so."
)
_BLIND = "Blind check of the gap diagnosis"


def hypotheses_table(one: Diagnosis) -> pd.DataFrame:
    """Every hypothesis that was fitted, most probable first: ``explanation, probability, log_evidence``."""
    return pd.DataFrame(
        {
            "explanation": [" + ".join(each.effects) or "no effect" for each in one.hypotheses],
            "probability": [each.probability for each in one.hypotheses],
            "log_evidence": [each.hypothesis.log_evidence for each in one.hypotheses],
        }
    )


def _planes(one: Diagnosis) -> list[str]:
    """The second plane in rad/s, if that is the explanation."""
    values = effect_values(one.leading.best).get("planar-coupling")
    if values is None:
        return []
    first = one.mode.omega_n * (1.0 + refitted_values(one.leading.best)["frequency"])
    return [
        f"The second plane lies at {number(first * values['frequency_ratio'], 4)} rad/s, the first at "
        f"{number(first, 4)}, and the drive {number(degrees(values['angle']), 2)} degrees from the first. (The fit of "
        "section 3.1, which sees the phase of every node too, is in chapter III.)"
    ]


def _damping(one: Diagnosis) -> list[str]:
    """How probable it is that damping forces, and no other effects, are missing."""
    kinds = [{CATALOGUE[name].kind for name in each.effects} for each in one.hypotheses]
    forces = sum(each.probability for each, kind in zip(one.hypotheses, kinds, strict=True) if kind == {"force"})
    return [f"Missing forces that grow with amplitude, whichever they are, have probability {share(forces)} together."]
