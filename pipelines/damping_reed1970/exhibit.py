"""The reproduction of the report as an exhibit of a study: its chapters, gaps, printed numbers and errata."""

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping.extrapolation.prediction import Loads
from damping.infer.chains import load_arviz
from damping.plots import identifier
from damping.ranking import Ranking
from damping.report.page import Heading, Link, Links, Section, Text
from damping.report.results import Exhibit, FurtherPage
from damping_pipelines import give_back_memory
from damping_pipelines.study_files import to_netcdf
from damping_pipelines.terminal import progress
from damping_reed1970 import CLOSE, LABELS, ReportPart, chapter_of, data_folder, load_text
from damping_reed1970.chapter_2.page import write_chapter_2
from damping_reed1970.chapter_3.page import write_chapter_3
from damping_reed1970.chapter_3.planar_posterior import PlanarPosterior
from damping_reed1970.chapter_3.study import Chapter3, chapter_3_results
from damping_reed1970.chapter_4.lines import section_4_3_example, tabulate_linear_coefficients, tabulate_power_laws
from damping_reed1970.chapter_4.page import write_chapter_4
from damping_reed1970.chapter_5 import tabulate_regression_deviations, tabulate_regressions
from damping_reed1970.chapter_5.page import write_chapter_5
from damping_reed1970.chapter_6 import section_6_1, section_6_1_errors, write_chapter_6
from damping_reed1970.reproduction import errata_part, reproduce, reproduction_part
from damping_reed1970.studies import ReportResults, Studies, compute_studies, diagnose_gaps, gaps_part


@dataclass(frozen=True)
class StartedReport:
    """Chapters under way in other processes."""

    studies: Future[Studies]
    chapter_3: Future[tuple[Chapter3, dict[str, bytes]]]

    def finish(self, rankings: Mapping[str, Ranking], loads: Mapping[str, Loads]) -> Exhibit:
        """Wait for the chapters and set the report's tables beside them; arguments as for ``source_tables``."""
        with progress("source report", 4) as done:
            tables = source_tables(rankings, loads)
            done("tables")
            gaps = diagnose_gaps()
            done("gaps between simulation and test")
            studies = self.studies.result()
            done("chapters II, IV, V")
            chapter_3, posteriors = self.chapter_3.result()
            done("chapter III")
        return exhibit(ReportResults(studies, chapter_3, tables, gaps), posteriors)


def settings_file() -> Path:
    """Settings of the study of the Saturn V tests."""
    return data_folder() / "saturn-v" / "study.toml"


def start(pool: Executor, seed: int) -> StartedReport:
    """Start the work that needs no ranking, in parallel with the study."""
    return StartedReport(pool.submit(compute_studies, seed), pool.submit(_sample_chapter_3, seed))


def _sample_chapter_3(seed: int) -> tuple[Chapter3, dict[str, bytes]]:
    """Chapter III, and its sampled planar posteriors as netCDF by file."""
    results = chapter_3_results(seed)
    sampled = {key: posterior for key, posterior in results.posteriors.items() if posterior.chains}
    give_back_memory()  # before ArviZ is loaded: the largest moment of a study
    files = {
        f"chapter-3--{identifier('-'.join(key))}": to_netcdf(describe_draws(*key, posterior))
        for key, posterior in sampled.items()
    }
    return replace(results, posteriors=sampled), files  # the tables hold what is needed of the others


def exhibit(results: ReportResults, posteriors: Mapping[str, bytes]) -> Exhibit:
    """What the study gets: a section with links, a page a chapter, the summary's keys, sampled planar posteriors."""
    parts = report_parts(results)
    pages = build_pages(parts)
    # in the list of files the picture of all printed numbers stands before those of the chapters
    figures = {
        name: figure
        for p in sorted(parts, key=lambda p: p.section.id != "reproduction")
        for name, figure in p.figures.items()
    }
    return Exhibit(
        sections=[link_pages(pages, results.tables["reproduction"])],
        pages=pages,
        figures={name: figure.svg for name, figure in figures.items()},
        drawings={name: figure.draw for name, figure in figures.items()},
        tables={**results.tables, **{name: table for part in parts for name, table in part.tables.items()}},
        summary=summarise(results),
        posteriors=posteriors,
    )


def report_parts(results: ReportResults) -> list[ReportPart]:
    """Chapters II to VI, two gaps between simulation and test, every printed number, and the errata."""
    printed = results.tables["reproduction"]
    return [
        write_chapter_2(results),
        write_chapter_3(results),
        write_chapter_4(results),
        write_chapter_5(results),
        write_chapter_6(results),
        gaps_part(results.gaps),
        reproduction_part(printed),
        errata_part(results.tables["errata"], printed),
    ]


FOLDER = "reproduction"  #: folder of the pages of the reproduction, beside the report


def build_pages(parts: Sequence[ReportPart]) -> list[FurtherPage]:
    """A page for each part, its headings as sections, with the way back to the report above and other pages below."""
    links = [Link(part.section.title, f"{part.section.id}.html") for part in parts]
    back = Links([Link("Back to the report of the study", "../report.html")])
    pages = []
    for part, own in zip(parts, links, strict=True):
        first, *rest = split_at_headings(part.section)
        others = Section("others", "Other pages", [Links([link for link in links if link != own])])
        sections = [replace(first, blocks=[back, *first.blocks]), *rest, others]
        pages.append(FurtherPage(f"{FOLDER}/{part.section.id}", part.section.title, sections))
    return pages


def split_at_headings(section: Section) -> list[Section]:
    """The section as one for what stands before its first heading, and one for each heading, numbered."""
    sections: list[Section] = [Section(section.id, "In short", [])]
    for block in section.blocks:
        if isinstance(block, Heading):
            sections.append(Section(f"{section.id}-{len(sections)}", block.text, []))
        else:
            sections[-1] = replace(sections[-1], blocks=[*sections[-1].blocks, block])
    return sections


def link_pages(pages: Sequence[FurtherPage], reproduction: pd.DataFrame) -> Section:
    """The section of the report that leads to the pages, with how well the printed numbers come out."""
    close = int(reproduction["agreement"].isin(CLOSE).sum())
    summary = (
        f"{len(reproduction)} numbers that the report of 1970 prints as results were recomputed by its own recipes "
        f"from its own tables. {close} agree to the print or within half a per cent. Every figure is redrawn and every "
        "erratum proved, chapter by chapter:"
    )
    links = Links([Link(page.title, f"{page.file}.html") for page in pages])
    return Section("source-report", "The report of 1970, recomputed", [Text(summary), links])


def source_tables(rankings: Mapping[str, Ranking], loads: Mapping[str, Loads] | None = None) -> dict[str, pd.DataFrame]:
    """Named tidy tables of the report's results beside ours.

    Args:
        rankings: by the names of the report's records (``config-2-mode-1`` and so on).
        loads: design loads of those that have them.
    """
    return {
        "reproduction": reproduce(),
        "errata": load_text("errata").sort_values("severity", kind="stable", ignore_index=True),
        "regressions": tabulate_regressions(),
        "regression_deviations": tabulate_regression_deviations(),
        "linear_coefficients": tabulate_linear_coefficients(),
        "power_laws": tabulate_power_laws(),
        "section_4_3_example": section_4_3_example(
            rankings["config-2-mode-1"], predicted=(loads or {}).get("config-2-mode-1")
        ),
        "section_6_1": section_6_1(rankings),
        "section_6_1_errors": section_6_1_errors(rankings),
    }


def summarise(results: ReportResults) -> dict[str, Any]:
    """The report as plain data: printed numbers, how well they agree, section 6.1, errata, tables of the chapters."""
    printed, levels = results.tables["reproduction"], results.studies.levels
    tables = {**results.chapter_3.tables, **results.studies.tables(), **results.tables}
    agreements = printed["agreement"].groupby(printed["id"].map(chapter_of))
    chapters = {
        "agreement": {
            str(number): {str(name): int(n) for name, n in own.value_counts().items()} for number, own in agreements
        },
        "picked": [{"mode": mode, "kept": kept, "case": level.picked} for (mode, kept), level in levels.items()],
        **{name: _convert_rows(tables[name]) for name in LABELS["summary"]["tables"]},
    }
    return {
        "reproduction": _convert_rows(printed[LABELS["summary"]["reproduction"]]),
        "section_6_1": _convert_rows(tables["section_6_1"]),
        "errata": _convert_rows(tables["errata"]),
        "chapters": chapters,
    }


def _convert_rows(table: pd.DataFrame) -> list[Any]:
    """A table as a list of rows; a number that does not exist is None."""
    plain: list[Any] = json.loads(table.to_json(orient="records", double_precision=15))
    return plain


def describe_draws(data: str, variant: str, posterior: PlanarPosterior) -> Any:
    """Draws of a planar oscillator that was sampled, as ArviZ groups; chains are the independent ensembles."""
    chains = posterior.chains
    assert chains is not None  # asked of sampled posteriors only
    ensembles, kept = chains.x.shape[:2]
    # single precision: seven digits are far more than the Monte Carlo error leaves
    draws = {name: np.asarray(values, dtype=np.float32) for name, values in posterior.parameters.items()}
    return load_arviz().from_dict(
        posterior={name: values.reshape(ensembles, kept) for name, values in draws.items()},
        attrs={"data": data, "fit": variant, "converged": str(chains.converged)},
    )
