"""Cautions, all in one place: each said once, with the records it holds for."""

from __future__ import annotations

from collections.abc import Iterator

from selection.report.page import Block, Callout, Heading, List, Section, Text
from selection.report.results import RecordResult, StudyResult
from selection.report.sections.answer import largest
from selection.report.sections.common import failed_chains, weighted
from selection.report.words import count

#: Cautions of laws with less weight change nothing.
LEAST_WEIGHT = 0.01

STANDING = (
    "The weights compare the candidates listed and no others; a law that nobody proposed has no weight.",
    "An extrapolation holds while the same sources of damping act in the same proportion. A joint that begins to "
    "slip, or a crack, is in no band.",
    "Credible bands hold the uncertainty of the parameters and of the choice among the candidates; predictive bands "
    "add the scatter of one more test. Neither holds an error of mode shape, generalized mass or force calibration.",
    "Laws with the same power of amplitude cannot be told apart by steady tests of one mode, whose frequency hardly "
    "changes.",
)


def cautions(study: StudyResult) -> Section:
    """The section."""
    said: dict[str, list[str]] = {}
    for result in study.records:
        for caution in dict.fromkeys(_of(result)):
            said.setdefault(caution, []).append(result.title)
    failed = [f"{result.title}: {failure}" for result in study.records for failure in failed_chains(result)]
    blocks: list[Block] = [Text("What no number on this page knows:"), List(STANDING)]
    if failed:
        blocks.append(Callout("Chains that failed; nothing here rests on them", failed))
    if said:
        blocks += [Heading("Of these records"), List([_sentence(caution, titles) for caution, titles in said.items()])]
    return Section("cautions", "Cautions", blocks)


def _of(result: RecordResult) -> Iterator[str]:
    """Cautions of the laws that carry weight, of their checks, and of the predictions."""
    for candidate in weighted(result):
        if candidate.weight > LEAST_WEIGHT:
            yield from candidate.cautions
    rough = [s for s in result.posteriors if s.leave_one_out.caution]
    if rough:
        yield f"PSIS-LOO is rough, by arviz's own warning, for {len(rough)} of {count(len(result.posteriors), 'law')}"
    i = largest(result.design)
    if result.design is not None:
        yield from result.design.cautions[len(result.design.cautions) - 1 if i is None else i]


def _sentence(caution: str, titles: list[str]) -> str:
    return f"{caution[:1].upper()}{caution[1:]} ({'; '.join(titles)})."
