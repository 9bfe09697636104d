"""A study rendered: the page, every table and every figure, of its records and of the exhibits that join it.

Above the fold of each screen stands what is decided on (:mod:`damping.report.screens`); here what it rests on, folded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from damping.extrapolation.prediction import Loads
from damping.plots import Drawn
from damping.report import (
    count,
    format_between,
    format_force_text,
    format_joined,
    format_percent,
    format_share,
    number,
    tables,
)
from damping.report.figures import leading, record_figures
from damping.report.method import build_cautions, build_method, describe_record
from damping.report.page import Block, Callout, Fold, Footer, Heading, List, Section, Table, Text, describe_page
from damping.report.results import (
    RecordResult,
    StudyResult,
    Svgs,
    build_figure,
    describe_file_stem,
    list_failed_chains,
)
from damping.report.screens import build_screens
from damping.report.tables import INTERVAL, record_tables


@dataclass(frozen=True)
class Rendered:
    """``html``: the page. ``tables``, ``figures`` (SVG), ``pages`` (HTML): by name of their file, without ending."""

    html: str
    tables: dict[str, pd.DataFrame]
    figures: dict[str, str]
    pages: dict[str, str]


def render(study: StudyResult) -> Rendered:
    """Render a study; equal studies give equal text."""
    figures, tables = _figures(study), _tables(study)
    further = [section for exhibit in study.exhibits for section in exhibit.sections]
    sections = [*build_screens(study, figures), *further, _build_details(study, figures)]
    for exhibit in study.exhibits:
        figures |= exhibit.figures
        tables |= {name: table for name, table in exhibit.tables.items() if not table.empty}
    footer = Footer(seed=study.seed, versions=study.versions, inputs=study.inputs)
    further_pages = [page for exhibit in study.exhibits for page in exhibit.pages]
    pages = {page.file: describe_page(page.title, page.sections, footer) for page in further_pages}
    return Rendered(describe_page(study.title, sections, footer), tables, figures, pages)


def _figures(study: StudyResult) -> dict[str, str]:
    drawn: dict[str, Drawn] = {}
    for result in study.records:
        drawn |= {
            describe_file_stem(result, name): figure for name, figure in record_figures(result, study.level).items()
        }
    return {name: figure.to_svg(name) for name, figure in drawn.items()}


def _tables(study: StudyResult) -> dict[str, pd.DataFrame]:
    tables: dict[str, pd.DataFrame] = {}
    for result in study.records:
        tables |= {describe_file_stem(result, name): table for name, table in record_tables(result).items()}
    return tables


def _build_details(study: StudyResult, svgs: Svgs) -> Section:
    """What the screens rest on, a fold a record, and how it was made."""
    folds: list[Block] = [
        Fold(f"{result.title}: data, every law, posteriors, predictions of each law", _list_parts(result, svgs))
        for result in study.records
    ]
    folds += [Fold("Every caution", build_cautions(study)), Fold("Method", build_method(study))]
    text = Text("Data, every law with its coefficients, posteriors and their convergence, all cautions and the method.")
    return Section("details", "What this rests on", [text, *folds])


def _list_parts(result: RecordResult, svgs: Svgs) -> list[Block]:
    return [
        *_build_data(result),
        *_build_ranking(result, svgs),
        *_build_posteriors(result, svgs),
        *(_build_by_model(result, result.design) if result.design else []),
    ]


#: Points that the page shows of a longer record, the first.
MOST_POINTS = 60


def _build_data(result: RecordResult) -> list[Block]:
    """Tested levels, what the mode file assumes, and the points used."""
    data = result.data
    levels = pd.DataFrame(
        {
            "sweep": data.sweeps,
            "points": data.rows_per_sweep,
            "force": data.tested_force,
            "frequency": data.tested_omega / (2.0 * np.pi),
            "amplitude": data.tested_amplitude,
        }
    )
    caption = f"Tested levels, each at its phase resonance. Units: {result.mode.units}; frequency in Hz."
    shown = ["sweep", "point", "frequency", "amplitude", "damping_force", "energy"]
    table = tables.tabulate_observations(result)[shown]
    points = Table(
        table.head(MOST_POINTS),
        f"The first {min(len(table), MOST_POINTS)} of {count(len(table), 'point')} used: frequency (Hz), amplitude, "
        "force in quadrature E/(π A), and energy per cycle E.",
        key=describe_file_stem(result, "observations"),
    )
    return [Text(describe_record(result)), Table(levels, caption), *([points] if len(table) > len(levels) else [])]


def _build_ranking(result: RecordResult, svgs: Svgs) -> list[Block]:
    table = tables.tabulate_ranking(result)
    candidates = result.ranking.candidates
    notes = list(dict.fromkeys(caution for candidate in candidates for caution in candidate.cautions))
    table["cautions"] = [format_joined(str(1 + notes.index(c)) for c in candidate.cautions) for candidate in candidates]
    headings = {
        "score": "−2 ln Zπ",
        "held_out_error": "held-out error (%)",
        "average_absolute_percent": "mean |%|",
    }
    formats = {
        "weight": format_share,
        "held_out_error": format_percent,
        "average_absolute_percent": format_percent,
        "score": _describe_decimals,
    }
    caption = (
        f"Every distinct law, sorted by {result.ranking.criterion} (Z is the marginal likelihood, π the prior). "
        "Held-out error: root mean square per cent error of resonant amplitude, each level predicted from the others; "
        "mean |%|: as fitted. Equivalents predict the same on this record."
    )
    blocks: list[Block] = [
        Heading("Every law"),
        *build_figure(
            svgs,
            describe_file_stem(result, "ranking"),
            "Weight of each distinct law: its posterior probability, before the test equal for each number of terms. "
            "Hatched: with a viscous part. Right: error of the resonant amplitude at the tested forces, fitted and "
            "with the level held out.",
        ),
        Table(
            table.drop(columns="score_standard_error"),
            caption,
            formats,
            headings,
            key=describe_file_stem(result, "ranking"),
        ),
        *([Text("Cautions, by the numbers in the table:"), List(notes, numbered=True)] if notes else []),
        _build_coefficient_table(result),
        _build_deviations(result),
    ]
    return blocks


def _describe_decimals(value: float) -> str:
    return f"{value:.1f}".replace("-", "−") if value == value else "–"


def _build_coefficient_table(result: RecordResult) -> Table:
    content = f"{100 * INTERVAL:g} %"
    headings = {"credible_low": f"{content} low", "credible_high": f"{content} high"}
    caption = (
        "Least-squares value, standard error and T-ratio of each parameter; the credible interval is of the posterior, "
        "where coefficients are at least 0."
    )
    formats = dict.fromkeys(("value", "std_error", "t_ratio", "credible_low", "credible_high"), number)
    return Table(
        tables.tabulate_coefficients(result), caption, formats, headings, key=describe_file_stem(result, "coefficients")
    )


#: A table of deviations has a column for each of so many points, not of more.
MOST_COLUMNS = 24


def _build_deviations(result: RecordResult) -> Table:
    """A row a law, a column a point; for many points the mean and the largest only."""
    deviations = tables.tabulate_deviations(result)
    by_law = deviations["percent"].abs().groupby(deviations["law"], sort=False)
    many = len(result.data.A) > MOST_COLUMNS
    table = pd.DataFrame({"mean |%|": by_law.mean(), "largest |%|": by_law.max()})
    if not many:
        points = list(dict.fromkeys(deviations["point"]))
        table = table.join(deviations.pivot_table(index="law", columns="point", values="percent")[points])
    caption = "Per cent deviation 100 (measured − fitted)/measured of the energy per cycle of every law."
    formats = dict.fromkeys(map(str, table.columns), format_percent)
    return Table(table.rename_axis("law").reset_index(), caption, formats, key=describe_file_stem(result, "deviations"))


def _build_posteriors(result: RecordResult, svgs: Svgs) -> list[Block]:
    best = leading(result)
    if not result.posteriors:
        return []
    failed = list_failed_chains(result)
    blocks: list[Block] = [Heading("Posteriors")]
    if failed:
        blocks.append(Callout(f"{count(len(failed), 'chain')} failed and not used in any average", failed))
    if best is not None:
        content = f"{100 * INTERVAL:g} per cent"
        blocks += build_figure(
            svgs,
            describe_file_stem(result, "corner"),
            f"Posterior of the leading law, {best.law.name}: each parameter with its prior density, median and "
            f"{content} interval (dashed); contours hold 50 and 90 per cent of the draws.",
        )
    blocks += build_figure(
        svgs,
        describe_file_stem(result, "predictive_check"),
        "Predictive intervals of the tested resonant amplitudes; 100 is what was measured.",
    )
    blocks.append(_build_checks(result))
    return [*blocks, _build_intervals(result), _build_convergence(result)]


def _build_checks(result: RecordResult) -> Table:
    table = tables.tabulate_checks(result)
    table["chain"] = ["converged" if ok else "FAILED" for ok in table["converged"]]
    columns = ["law", "weight", "chain", "steps", "elpd_loo", "elpd_standard_error", "p_loo", "largest_pareto_k"]
    columns += ["predictive_p_value", "caution"]
    headings = {"elpd_loo": "PSIS-LOO", "elpd_standard_error": "its error", "largest_pareto_k": "largest k"}
    headings |= {"predictive_p_value": "predictive p"}
    unit = format_joined(dict.fromkeys(table["unit_left_out"]))
    caption = (
        f"Sampled laws. PSIS-LOO: expected log predictive density, a {unit} left out at a time, with its standard "
        "error and effective number of parameters; k above 0.7 makes it rough. Predictive p: share of replicated "
        "data sets that fit worse than the measured one; near 0 the law does not describe its data."
    )
    formats = {"weight": format_share} | dict.fromkeys(columns[4:9], _describe_two)
    return Table(table[columns], caption, formats, headings, key=describe_file_stem(result, "checks"))


def _describe_two(value: float) -> str:
    return f"{value:.2f}".replace("-", "−") if value == value else "–"


def _build_intervals(result: RecordResult) -> Table:
    content = f"{100 * INTERVAL:g} %"
    caption = f"Prior and posterior median and {content} interval of each parameter; a dash where the chain failed."
    table = tables.tabulate_posteriors(result)
    numbers = [column for column in table.columns if pd.api.types.is_float_dtype(table[column])]
    return Table(
        table,
        caption,
        dict.fromkeys(numbers, number) | {"weight": format_share},
        key=describe_file_stem(result, "posteriors"),
    )


def _build_convergence(result: RecordResult) -> Table:
    formats = {"r_hat": lambda value: f"{value:.4f}"} | dict.fromkeys(
        ("effective_size", "lengths"), lambda v: f"{v:.0f}"
    )
    headings = {"r_hat": "R-hat", "lengths": "length / τ", "autocorrelation": "τ (steps)"}
    caption = (
        "Convergence: mean, standard deviation and Monte Carlo error of each reported quantity, and what it rests on."
    )
    table = tables.tabulate_convergence(result)
    return Table(table, caption, formats, headings, key=describe_file_stem(result, "convergence"))


def _build_by_model(result: RecordResult, design: Loads) -> list[Block]:
    """A row a model, a column a force: median and predictive interval."""
    unit = result.mode.units.force
    columns: dict[str, list[str]] = {
        "model": [band.name for band in design.by_model],
    }
    for i, force in enumerate(design.force):
        columns[f"at {format_force_text(force, unit)}"] = [
            f"{number(band.median[i])} ({format_between(band.low[i], band.high[i])})" for band in design.by_model
        ]
    caption = f"Each model's own median, and its {100 * design.level:g} % predictive interval in parentheses."
    table = Table(pd.DataFrame(columns), caption, key=describe_file_stem(result, "design_loads_by_model"))
    return [Heading("Predictions of each law"), table]
