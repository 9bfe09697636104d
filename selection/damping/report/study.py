"""A rendered study: the page, every table and every figure of its records and exhibits.

The screens (:mod:`damping.report.screens`) hold what decisions need; this module adds the folded details.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

import pandas as pd

from damping import report as words
from damping.extrapolation.draws import AVERAGE_DRAWS
from damping.forces import CATALOGUE, component, shapes
from damping.infer.chains import Settings
from damping.infer.discrepancy import DISCREPANCY_LOG_SD, DISCREPANCY_MEDIAN, LENGTH, SLOPES
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN, TOTAL_LOG_SD
from damping.ranking.candidates import INTERVAL
from damping.report import forms, page, tables
from damping.report.figures import leading, record_figures
from damping.report.page import Block, Fold, Section, Table, write_blocks
from damping.report.results import RecordResult, StudyResult, Svgs, build_cautions, describe_failed_chains
from damping.report.screens import build_screens
from damping.report.tables import record_tables

#: The tables of a record by name, as of `record_tables`: the same on the page as in the files.
Tables: TypeAlias = Mapping[str, pd.DataFrame]


@dataclass(frozen=True)
class Rendered:
    """A study as files, by their names without ending."""

    html: str  #: the page
    tables: dict[str, pd.DataFrame]
    figures: dict[str, str]  #: SVG
    pages: dict[str, str]  #: HTML


def render(study: StudyResult) -> Rendered:
    """Render a study; equal studies give equal text."""
    figures: dict[str, str] = {}
    tables: dict[str, pd.DataFrame] = {}
    made = [record_tables(result) for result in study.records]
    for result, own in zip(study.records, made, strict=True):
        for name, drawn in record_figures(result, study.level).items():
            stem = result.stem(name)
            figures[stem] = drawn.to_svg(stem)
        tables |= {result.stem(name): table for name, table in own.items()}
    further = [section for exhibit in study.exhibits for section in exhibit.sections]
    sections = [*build_screens(study, figures), *further, _build_details(study, made, figures)]
    for exhibit in study.exhibits:
        figures |= exhibit.figures
        tables |= {name: table for name, table in exhibit.tables.items() if not table.empty}
    footer = page.Footer(seed=study.seed, versions=study.versions, inputs=study.inputs)
    further_pages = [page for exhibit in study.exhibits for page in exhibit.pages]
    pages = {own.file: page.render_page(own.title, own.sections, footer) for own in further_pages}
    return Rendered(page.render_page(study.title, sections, footer), tables, figures, pages)


def _build_details(study: StudyResult, made: Sequence[Tables], svgs: Svgs) -> Section:
    """The details behind the screens, one fold per record, and the method; ``made``: the tables of each record."""
    folds: list[Block] = [
        Fold(f"{result.title}: data, every law, posteriors, predictions of each law", _build_parts(result, own, svgs))
        for result, own in zip(study.records, made, strict=True)
    ]
    folds += [Fold("Every caution", build_cautions(study)), Fold("Method", _build_method(study))]
    holds = "Data, every law with its coefficients, posteriors and their convergence, all cautions and the method."
    return Section("details", "What this rests on", [page.Text(holds), *folds])


MOST_POINTS = 60  #: points that the page shows of a longer record, the first
MOST_COLUMNS = 24  #: most points for each of which a table of deviations has a column


def _build_parts(result: RecordResult, made: Tables, svgs: Svgs) -> list[Block]:
    """Data, every law, posteriors, predictions of each law, by the text ``details.txt``."""
    best, design = leading(result), result.design
    notes = list(dict.fromkeys(caution for law in result.ranking.candidates for caution in law.cautions))
    observations = made["observations"]
    points = observations[["sweep", "point", "frequency", "amplitude", "damping_force", "energy"]]
    shown = {"levels": Table(forms.tabulate_tested(result.data)), "observations": Table(points[:MOST_POINTS])}
    shown |= _tabulate_laws(result, made, notes)
    if result.posteriors:
        shown |= _tabulate_posteriors(made)
    if design:
        shown["design_loads_by_model"] = Table(tables.tabulate_by_model(design, result.mode.units.force))

    parts: dict[str, Block] = {
        name: replace(table, key="" if name == "levels" else result.stem(name)) for name, table in shown.items()
    }
    stems = {f"{name}-figure": result.stem(name) for name in ("ranking", "corner", "predictive_check")}
    parts |= {name: page.FigureBlock(svgs[stem]) for name, stem in stems.items() if stem in svgs}
    parts["notes"] = page.List(notes, numbered=True)
    units = result.mode.units
    mass_unit = (
        words.format_dimension_text(shapes.FORCE * shapes.TIME**2.0 / shapes.LENGTH, units)
        if all(vars(units).values())
        else ""
    )
    values = {
        **vars(result),
        "mass": words.format_quantity(result.mode.mass, mass_unit, 4),
        "file": Path(result.record.source).name,
        "used": len(observations),
        "shown": min(len(observations), MOST_POINTS),
        "notes": notes,
        "failed": describe_failed_chains(result),
        "leading": best.law.name if best else "",
        "content": 100 * INTERVAL,
        "left_out": list(dict.fromkeys(made["checks"]["unit_left_out"])) if result.posteriors else [],
    }
    return write_blocks(Path(__file__).with_name("details.txt"), values, page.take_parts(parts))


def _tabulate_laws(result: RecordResult, made: Tables, notes: list[str]) -> dict[str, Table]:
    """Every law with its cautions by number, coefficients and deviations."""
    ranking = made["ranking"].drop(columns="score_standard_error")
    cautions = [law.cautions for law in result.ranking.candidates]
    ranking["cautions"] = [words.format_joined(str(1 + notes.index(caution)) for caution in own) for own in cautions]
    content, numbers = f"{100 * INTERVAL:g} %", ("value", "std_error", "t_ratio", "credible_low", "credible_high")
    ends = {"credible_low": f"{content} low", "credible_high": f"{content} high"}
    deviations = _tabulate_deviations(made)
    return {
        "ranking": list_laws(ranking),
        "coefficients": Table(made["coefficients"], dict.fromkeys(numbers, words.number), ends),
        "deviations": Table(deviations, dict.fromkeys(map(str, deviations.columns[1:]), words.format_percent)),
    }


def list_laws(ranking: pd.DataFrame) -> Table:
    """Every law with weight, score and errors, formatted for pages: columns of ``forms.tabulate_candidates``."""
    names = {"score": "−2 ln Zπ", "held_out_error": "held-out error (%)", "average_absolute_percent": "mean |%|"}
    formats: dict[str, page.Format] = {"weight": words.format_share, "score": partial(words.format_decimals, digits=1)}
    formats |= dict.fromkeys(("held_out_error", "average_absolute_percent"), words.format_percent)
    return Table(ranking, formats, names)


def _tabulate_deviations(made: Tables) -> pd.DataFrame:
    """One row for each law, one column for each point; for many points the mean and the largest only."""
    deviations = made["deviations"]
    by_law = deviations["percent"].abs().groupby(deviations["law"], sort=False)
    table = pd.DataFrame({"mean |%|": by_law.mean(), "largest |%|": by_law.max()})
    if len(made["observations"]) <= MOST_COLUMNS:
        points = list(dict.fromkeys(deviations["point"]))
        table = table.join(deviations.pivot_table(index="law", columns="point", values="percent")[points])
    return table.rename_axis("law").reset_index()


def _tabulate_posteriors(made: Tables) -> dict[str, Table]:
    """Checks of the sampled laws, intervals of their parameters, convergence of their chains."""
    checks, intervals = made["checks"], made["posteriors"]
    chain = ["converged" if converged else "FAILED" for converged in checks["converged"]]
    columns = ["law", "weight", "chain", "steps", "elpd_loo", "elpd_standard_error", "p_loo", "largest_pareto_k"]
    columns += ["predictive_p_value", "caution"]
    names = {"elpd_loo": "PSIS-LOO", "elpd_standard_error": "its error", "largest_pareto_k": "largest k"}
    formats = {"weight": words.format_share} | dict.fromkeys(columns[4:9], partial(words.format_decimals, digits=2))
    numbers = dict.fromkeys(intervals.select_dtypes("float").columns, words.number) | {"weight": words.format_share}
    lengths = {"r_hat": "{:.4f}".format, "effective_size": "{:.0f}".format, "lengths": "{:.0f}".format}
    symbols = {"r_hat": "R-hat", "lengths": "length / τ", "autocorrelation": "τ (steps)"}
    shown = checks.assign(chain=chain)[columns]
    return {
        "checks": Table(shown, formats, names | {"predictive_p_value": "predictive p"}),
        "posteriors": Table(intervals, numbers),
        "convergence": Table(made.get("convergence", pd.DataFrame()), lengths, symbols),
    }


def _build_method(study: StudyResult) -> list[Block]:
    """The method in words, with its constants."""
    shapes = dict.fromkeys(shape for name in CATALOGUE for shape in component(name).free_shapes)
    values = {
        "priors": [(shape.label or shape.name, shape.prior.text) for shape in shapes if shape.prior],
        "run": Settings(),
        "total_sd": TOTAL_LOG_SD,
        "scatter": (SCATTER_MEDIAN, SCATTER_LOG_SD),
        "discrepancy": (DISCREPANCY_MEDIAN, DISCREPANCY_LOG_SD, LENGTH),
        "slopes": SLOPES,
        "draws": AVERAGE_DRAWS // 1000,
        "content": 100 * INTERVAL,
        "level": 100 * study.level,
    }
    laws = page.take_parts({"laws": _tabulate_forces(study)})
    return write_blocks(Path(__file__).with_name("method.txt"), values, laws)


def _tabulate_forces(study: StudyResult) -> Table:
    """Every force of the candidates, with its formula."""
    names = [name for r in study.records for c in r.ranking.candidates for name in c.law.components]
    table = pd.DataFrame(
        {
            "force": part.name,
            "what it is": part.example.label,
            "formula": part.example.formula,
            "free beside the coefficient": ", ".join(shape.name for shape in part.free_shapes),
        }
        for part in map(component, dict.fromkeys(names))
    )
    return Table(table)
