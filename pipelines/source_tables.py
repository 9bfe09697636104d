"""Chapters and tables of the Saturn V report beside their recomputation: everything is computed elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass

import pandas as pd

from pipelines.progress import progress
from selection.compare.ranking import Ranking
from selection.gap.history import historic_gaps
from selection.loads.prediction import Loads
from selection.records.report_tables import load_errata
from selection.report.results import ChapterResults
from selection.reproduction.chapter_3_study import Chapter3, chapter_3_results
from selection.reproduction.force_laws import section_6_1, section_6_1_errors
from selection.reproduction.linear_coefficients import linear_coefficients
from selection.reproduction.power_laws import power_laws, section_4_3_example
from selection.reproduction.regressions import regression_deviations, regressions
from selection.reproduction.reproduce import reproduce
from selection.reproduction.studies import Studies, studies


@dataclass(frozen=True)
class StartedChapters:
    """Studies of the chapters under way in other processes."""

    studies: Future[Studies]
    chapter_3: Future[Chapter3]


def start_chapters(pool: Executor, seed: int) -> StartedChapters:
    """Start what needs no ranking, beside whatever else the study does."""
    return StartedChapters(pool.submit(compute_studies, seed), pool.submit(compute_chapter_3, seed))


def finish_chapters(
    started: StartedChapters, rankings: Mapping[str, Ranking], loads: Mapping[str, Loads]
) -> ChapterResults:
    """Wait for the chapters and set the report's tables beside them; arguments as for ``source_tables``."""
    with progress("source report", 4) as done:
        tables = source_tables(rankings, loads)
        done("tables")
        gaps = historic_gaps()
        done("gaps between simulation and test")
        found = started.studies.result()
        done("chapters II, IV, V")
        chapter_3 = started.chapter_3.result()
        done("chapter III")
    return ChapterResults(found, chapter_3, tables, gaps)


def compute_studies(seed: int) -> Studies:
    """Chapters II, IV and V; here so that another process that looks for it imports ``pipelines`` before numpy."""
    return studies(seed)


def compute_chapter_3(seed: int) -> Chapter3:
    """Chapter III; here for the same reason."""
    return chapter_3_results(seed)


def source_tables(rankings: Mapping[str, Ranking], loads: Mapping[str, Loads] | None = None) -> dict[str, pd.DataFrame]:
    """Named tidy tables of the report's results beside ours.

    Args:
        rankings: by the names of the report's records (``config-2-mode-1`` and so on). loads: design loads of those
            that have them.
    """
    return {
        "reproduction": pd.DataFrame([{**asdict(r), "agreement": r.agreement} for r in reproduce()]),
        "errata": load_errata().sort_values("severity", kind="stable", ignore_index=True),
        "regressions": regressions(),
        "regression_deviations": regression_deviations(),
        "linear_coefficients": linear_coefficients(),
        "power_laws": power_laws(),
        "section_4_3_example": section_4_3_example(
            rankings["config-2-mode-1"], predicted=(loads or {}).get("config-2-mode-1")
        ),
        "section_6_1": section_6_1(rankings),
        "section_6_1_errors": section_6_1_errors(rankings),
    }
