"""Chapters and tables of the Saturn V report beside their recomputation: everything is computed elsewhere.

What a study of the source report leaves behind of its chapters: numbers for ``summary.json``, planar posteriors.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd

from damping.extrapolation.prediction import Loads
from damping.infer.diagnostics import load_arviz
from damping.ranking import Ranking
from damping.report.results import ChapterResults
from damping_pipelines.terminal import progress
from damping_reed1970.chapter_3.planar_fits import Known
from damping_reed1970.chapter_3.study import Chapter3, chapter_3_results
from damping_reed1970.chapter_4.coefficients import linear_coefficients
from damping_reed1970.chapter_4.power_laws import power_laws, section_4_3_example
from damping_reed1970.chapter_5.regressions import regression_deviations, regressions
from damping_reed1970.chapter_6 import section_6_1, section_6_1_errors
from damping_reed1970.common import chapter_of
from damping_reed1970.records import historic_gaps
from damping_reed1970.reproduce import Studies, reproduce, studies
from damping_reed1970.tables import load_errata


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


#: Tables of each chapter that the summary holds whole, by where they are.
CHAPTER_3 = ("planar_fits", "planar_posteriors", "planar_evidence", "implications", "branches", "branch_means")
STUDIES = (
    *("response_points", "level_variations", "chance_of_exponent", "nine_terms_summary"),
    *("false_terms", "false_terms_inflation", "circular_claims"),
)
TABLES = ("linear_coefficients", "power_laws", "section_4_3_example", "regressions")


def chapters_summary(chapters: ChapterResults) -> dict[str, Any]:
    """The chapters as plain data: how many printed numbers agree how well, and the key tables as lists of rows."""
    found = {name: chapters.chapter_3.tables[name] for name in CHAPTER_3}
    every = chapters.studies.tables()
    found |= {name: every[name] for name in STUDIES}
    found |= {name: chapters.tables[name] for name in TABLES}
    return {
        "agreement": _agreement(chapters.tables["reproduction"]),
        "picked": [
            {"mode": mode, "kept": kept, "case": levels.picked}
            for (mode, kept), levels in chapters.studies.levels.items()
        ],
        **{name: rows(table) for name, table in found.items()},
    }


def rows(table: pd.DataFrame) -> list[Any]:
    """A table as a list of rows; a number that does not exist is None."""
    plain: list[Any] = json.loads(table.to_json(orient="records", double_precision=15))
    return plain


def planar_data(known: Known) -> Any:
    """Draws of a planar oscillator that was sampled, as ArviZ groups; chains are the independent ensembles.

    Single precision: seven digits are far more than the Monte Carlo error leaves.
    """
    assert known.posterior is not None  # asked of sampled posteriors only
    ensembles, kept = known.posterior.chains.x.shape[:2]
    draws = {name: np.asarray(values, dtype=np.float32) for name, values in known.parameters.items()}
    return load_arviz().from_dict(
        posterior={name: values.reshape(ensembles, kept) for name, values in draws.items()},
        attrs={"data": known.data, "fit": known.variant, "converged": str(known.posterior.chains.converged)},
    )


def _agreement(reproduction: pd.DataFrame) -> dict[str, Mapping[str, int]]:
    """By chapter: printed numbers by how well they come out."""
    chapter = reproduction["id"].map(chapter_of)
    return {
        str(number): {str(name): int(n) for name, n in mine.value_counts().items()}
        for number, mine in reproduction["agreement"].groupby(chapter)
    }
