"""What several sections need."""

from __future__ import annotations

from collections.abc import Mapping

from selection.compare.ranking import Candidate
from selection.report.page import Block, FigureBlock
from selection.report.results import RecordResult

#: Name of a figure's file, without its ending, and its SVG.
Svgs = Mapping[str, str]


def figure(svgs: Svgs, name: str, caption: str) -> list[Block]:
    """The figure with its caption; nothing where the results could not fill it."""
    return [FigureBlock(svgs[name], caption)] if name in svgs else []


def file_stem(result: RecordResult, name: str) -> str:
    """Name of the file of a record's table or figure, without its ending."""
    return f"{result.name}-{name.replace('_', '-')}"


def weighted(result: RecordResult) -> list[Candidate]:
    """Candidates with a weight, the largest first."""
    carrying = [candidate for candidate in result.ranking.candidates if candidate.weight > 0.0]
    return sorted(carrying, key=lambda candidate: -candidate.weight)


def failed_chains(result: RecordResult) -> list[str]:
    """Laws whose chain did not get there, and why."""
    return [f"{s.law.name}: {s.posterior.failure}" for s in result.posteriors if not s.posterior.converged]
