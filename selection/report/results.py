"""Everything a study found, as the report and the tables need it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from selection.compare.ranking import Ranking
from selection.gap.history import Gaps
from selection.loads.prediction import Loads
from selection.posterior.checks import LeaveOneOut, PredictiveCheck
from selection.posterior.law import Law
from selection.posterior.observations import Observations
from selection.posterior.sampling import Posterior
from selection.records.mode import Mode
from selection.records.record import Record
from selection.regression.power_law import PowerLaw
from selection.reproduction.chapter_3_study import Chapter3
from selection.reproduction.studies import Studies


@dataclass(frozen=True)
class LawPosterior:
    """A sampled law with its checks; ``of_source`` marks a law the source report states."""

    law: Law
    weight: float
    posterior: Posterior
    leave_one_out: LeaveOneOut
    check: PredictiveCheck
    of_source: bool


@dataclass(frozen=True)
class RecordResult:
    """One record's results.

    Attributes:
        bands: predictions on a fine grid of forces, for the figure; design: at the design forces; None where the
            study asks for none. power_laws: of both forms; empty with fewer than two levels.
    """

    name: str
    title: str
    record: Record
    mode: Mode
    data: Observations
    ranking: Ranking
    posteriors: tuple[LawPosterior, ...]
    bands: Loads | None
    design: Loads | None
    power_laws: tuple[PowerLaw, ...]


@dataclass(frozen=True)
class ChapterResults:
    """The chapters of the source report recomputed.

    Attributes:
        studies: of chapters II, IV and V. chapter_3: of chapter III. tables: of the report beside ours, by name, those
            of ``selection.report.sections.source.KNOWN``. gaps: two gaps between simulation and test, diagnosed.
    """

    studies: Studies
    chapter_3: Chapter3
    tables: Mapping[str, pd.DataFrame]
    gaps: Gaps


@dataclass(frozen=True)
class StudyResult:
    """A whole study.

    Attributes:
        inputs: file name to SHA-256. versions: package to version. tables: further tables by name (regressions,
            reproduction, errata, ...), each written as CSV. chapters: where the study is of the source report.
    """

    title: str
    seed: int
    level: float
    records: tuple[RecordResult, ...]
    inputs: Mapping[str, str]
    versions: Mapping[str, str]
    tables: Mapping[str, pd.DataFrame]
    chapters: ChapterResults | None = None
