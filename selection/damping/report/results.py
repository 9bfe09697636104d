"""The results of a study, as the report and the tables need them, with functions that several of their parts share."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.extrapolation.backbone import Backbone
from damping.extrapolation.cautions import BEYOND_TEST, find_refusal
from damping.extrapolation.curve import Curve
from damping.extrapolation.draws import LEAST_WEIGHT, NextLevel
from damping.extrapolation.prediction import Loads
from damping.infer.chains import Posterior
from damping.infer.checks import LeaveOneOut, PredictiveCheck
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.ranking import Ranking
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.text import AGREED, Disagreement
from damping.records.view import Finding
from damping.regression.fit import PowerLaw
from damping.report import count, format_force_text, format_joined
from damping.report.page import Block, Section, write_blocks


@dataclass(frozen=True)
class LawPosterior:
    """A sampled law with its checks."""

    law: Law
    weight: float
    posterior: Posterior
    leave_one_out: LeaveOneOut
    check: PredictiveCheck
    of_source: bool  #: whether the source report states this law
    file: bytes = b""  #: its netCDF


@dataclass(frozen=True)
class RecordResult:
    """One record's results."""

    name: str
    title: str
    record: Record
    mode: Mode
    data: Observations
    ranking: Ranking
    posteriors: tuple[LawPosterior, ...]
    bands: Loads | None = None  #: predictions on a fine grid of forces, for the figure
    design: Loads | None = None  #: at the design forces; None, as the bands, where the study asks for none
    power_laws: tuple[PowerLaw, ...] = ()  #: of both forms; empty with fewer than two levels
    findings: tuple[Finding, ...] = ()  #: of the audit of the record
    against: Disagreement = AGREED  #: where the diagnosis disagrees with the predictions
    remarks: tuple[str, ...] = ()  #: on the rows that the answers rest on, as `rank` and `extrapolate` say them
    curve: Curve | None = None  #: damping ratio over amplitude; None where laws could not be weighed
    drawn_curve: Curve | None = None  #: the same at as many amplitudes as a drawing needs
    design_curve: Curve | None = None  #: the same at the design forces
    backbone: Backbone | None = None  #: frequency and mass
    next_level: NextLevel | None = None  #: what to test next
    note: str = ""  #: what to know of where its numbers come from
    design_levels: tuple[str, ...] = ()  #: what each design force stands for, in words; empty where for itself

    def stem(self, name: str) -> str:
        """Name of the file of a table or figure, without its ending."""
        return f"{self.name}-{name.replace('_', '-')}"


@dataclass(frozen=True)
class FurtherPage:
    """A separate page."""

    file: str  #: its address relative to the report, without ending (``reproduction/page``)
    title: str
    sections: Sequence[Section]


@dataclass(frozen=True)
class Exhibit:
    """An addition to a study beside its records, such as the reproduction of a report; files without endings."""

    sections: Sequence[Section]  #: of the report's page
    figures: Mapping[str, str] = field(default_factory=dict)  #: SVG by file
    drawings: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)  #: how each is drawn, for other formats
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)  #: by file
    summary: Mapping[str, Any] = field(default_factory=dict)  #: what it adds to that of the study, by key
    posteriors: Mapping[str, bytes] = field(default_factory=dict)  #: netCDF by file
    pages: Sequence[FurtherPage] = ()  #: of its own, which one of the sections links


@dataclass(frozen=True)
class StudyResult:
    """A whole study."""

    title: str
    seed: int
    level: float
    records: tuple[RecordResult, ...]
    inputs: Mapping[str, str]  #: file name to SHA-256
    versions: Mapping[str, str]  #: package to version
    exhibits: tuple[Exhibit, ...] = ()  #: what joins it


PRIOR_DRAWS = 40_000  #: draws of a prior: the 5 % point of a density is then known to 1 % of its spread


def prior_draws(coordinates: Coordinates) -> dict[str, FloatArray]:
    """Draws of the prior of each parameter: standard normal variables through ``coordinates.parameters``."""
    x = np.random.default_rng(0).standard_normal((PRIOR_DRAWS, coordinates.dimension))
    return coordinates.parameters(x)


def posterior_draws(sampled: LawPosterior) -> dict[str, FloatArray]:
    """Draws of the posterior of each parameter, ensembles after one another."""
    return {name: values.ravel() for name, values in sampled.posterior.parameters().items()}


#: Name of a figure's file, without its ending, and its SVG.
Svgs = Mapping[str, str]


def describe_failed_chains(result: RecordResult) -> list[str]:
    """Laws whose chain did not converge, with the reason."""
    return [f"{s.law.name}: {s.posterior.failure}" for s in result.posteriors if not s.posterior.converged]


def find_largest(loads: Loads | None) -> int | None:
    """Index of the largest design force that has a prediction."""
    if loads is None or not np.isfinite(loads.average.median).any():
        return None
    return int(np.nanargmax(np.where(np.isfinite(loads.average.median), loads.force, np.nan)))


def list_design_cautions(result: RecordResult) -> tuple[str, ...]:
    """Cautions at the largest design force that has a prediction, or at the last where none has."""
    i, design = find_largest(result.design), result.design
    return () if design is None else design.cautions[-1 if i is None else i]


def list_refused(result: RecordResult) -> list[str]:
    """Why design forces have no prediction where another has one, the largest force first."""
    design = result.design
    if design is None or find_largest(design) is None:
        return []
    forces = [format_force_text(force, result.mode.units.force) for force in design.force]
    refused = [i for i in np.argsort(-design.force) if np.isnan(design.average.median[i])]
    own = result.design_levels or forces
    why = ((own[i], filter(None, [find_refusal(design.cautions[i])])) for i in refused)
    return [f"at {format_joined(levels)}: {caution}" for caution, levels in collect_holders(why)]


MOST_CAUTIONS = 3  #: cautions of a record or mode above the fold at most, the gravest first


def keep_gravest(cautions: Iterable[str]) -> list[str]:
    """The first cautions, each once, without extrapolation, which the conditions of an answer state."""
    return [caution for caution in dict.fromkeys(cautions) if not caution.startswith(BEYOND_TEST)][:MOST_CAUTIONS]


def collect_holders(cautions: Iterable[tuple[str, Iterable[str]]]) -> list[tuple[str, list[str]]]:
    """Each caution once, with the titles of its records or modes; given pairs of a title and its cautions."""
    holders: dict[str, list[str]] = {}
    for title, own in cautions:
        for caution in dict.fromkeys(own):
            holders.setdefault(caution, []).append(title)
    return list(holders.items())


def build_cautions(study: StudyResult) -> list[Block]:
    """Every caution, with its records."""
    failed = [f"{result.title}: {failure}" for result in study.records for failure in describe_failed_chains(result)]
    values = {"failed": failed, "cautions": collect_holders((r.title, _collect_cautions(r)) for r in study.records)}
    return write_blocks(Path(__file__).with_name("cautions.txt"), values)


def _collect_cautions(result: RecordResult) -> Iterator[str]:
    """Refusals, objections of the diagnosis, findings and notes on rows, cautions of laws, checks and predictions."""
    yield from (*list_refused(result), *result.against, *map(str, result.findings), *result.remarks)
    for candidate in result.ranking.weighted(LEAST_WEIGHT):
        yield from candidate.cautions
    rough = [s for s in result.posteriors if s.leave_one_out.caution]
    if rough:
        yield f"PSIS-LOO is rough, by arviz's own warning, for {len(rough)} of {count(len(result.posteriors), 'law')}"
    yield from list_design_cautions(result)
