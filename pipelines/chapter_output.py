"""What a study of the source report leaves behind of its chapters: numbers for ``summary.json``, planar posteriors."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import arviz
import numpy as np
import pandas as pd

from selection.report.chapters.common import chapter_of
from selection.report.results import ChapterResults
from selection.reproduction.chapter_3_posterior import Known

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


def planar_data(known: Known) -> arviz.InferenceData:
    """Draws of a planar oscillator that was sampled, as ArviZ groups; chains are the independent ensembles.

    Single precision: seven digits are far more than the Monte Carlo error leaves.
    """
    assert known.posterior is not None  # asked of sampled posteriors only
    ensembles, kept = known.posterior.chains.x.shape[:2]
    draws = {name: np.asarray(values, dtype=np.float32) for name, values in known.parameters.items()}
    return arviz.from_dict(
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
