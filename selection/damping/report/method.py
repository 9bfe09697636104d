"""How the numbers were made, what the rows of a record are, and every caution with the records it holds for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from damping.extrapolation.draws import AVERAGE_DRAWS
from damping.forces import CATALOGUE, component
from damping.infer.chains import Settings
from damping.infer.doubt import DOUBT_LOG_SD, DOUBT_MEDIAN, LENGTH, SLOPES
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN, TOTAL_LOG_SD
from damping.ranking import INTERVAL
from damping.report import count, format_quantity, number
from damping.report.page import Block, Callout, Heading, List, Table, Text, join_lines, write_blocks
from damping.report.results import RecordResult, StudyResult, list_failed_chains, weighted
from damping.report.screens import find_largest


def build_method(study: StudyResult) -> list[Block]:
    """The method in words, with the constants that made the numbers."""
    shapes = dict.fromkeys(shape for name in CATALOGUE for shape in component(name).free_shapes)
    values = {
        "priors": [(shape.label or shape.name, shape.prior.text) for shape in shapes if shape.prior],
        "run": Settings(),
        "total_sd": TOTAL_LOG_SD,
        "scatter": (SCATTER_MEDIAN, SCATTER_LOG_SD),
        "doubt": (DOUBT_MEDIAN, DOUBT_LOG_SD, LENGTH),
        "slopes": SLOPES,
        "draws": AVERAGE_DRAWS // 1000,
        "content": 100 * INTERVAL,
        "level": 100 * study.level,
    }
    text = Path(__file__).with_suffix(".txt")
    return write_blocks(text, values, lambda kind, name, caption: [_tabulate_laws(study, join_lines(caption))])


def _tabulate_laws(study: StudyResult, caption: str) -> Table:
    """Every force that takes part in a candidate, with its formula."""
    names = [name for r in study.records for c in r.ranking.candidates for name in c.law.components]
    parts = [component(name) for name in dict.fromkeys(names)]
    table = pd.DataFrame(
        {
            "force": [part.name for part in parts],
            "what it is": [part.example.label for part in parts],
            "formula": [part.example.formula for part in parts],
            "free beside the coefficient": [", ".join(shape.name for shape in part.free_shapes) for part in parts],
        }
    )
    return Table(table, caption)


def describe_record(result: RecordResult) -> str:
    """The record and its mode in sentences."""
    record, mode, units = result.record, result.mode, result.mode.units
    columns = record.table.columns
    energy = (
        "The energy per cycle is the record's own column."
        if "energy" in columns
        else "The energy per cycle is π F A sin φ from the recorded phases."
        if record.has_phase
        else "No phases were recorded: the largest amplitude of a sweep is taken as phase resonance, energy π F A."
    )
    left_out = len(record) - len(result.data.A)
    unused = f" {count(left_out, 'row')} away from resonance without phase or energy are not used." if left_out else ""
    mass_unit = f"{units.force}·{units.time}²/{units.length}" if units.force and units.time and units.length else ""
    tolerance = mode.tolerance
    return (
        f"{mode.name}: {count(len(record), 'point')} in {count(len(record.sweeps), 'sweep')} from "
        f"{Path(record.source).name}. {energy}{unused} The simulation assumes "
        f"{format_quantity(mode.frequency, 'Hz', 4)} "
        f"and a generalized mass of {format_quantity(mode.mass, mass_unit, 4)}, known to "
        f"{number(100 * tolerance.frequency, 2)} and {number(100 * tolerance.mass, 2)} per cent, and its viscous "
        f"damping to {number(100 * tolerance.viscous, 2)} per cent."
    )


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


def build_cautions(study: StudyResult) -> list[Block]:
    """Every caution, with the records it holds for."""
    said: dict[str, list[str]] = {}
    for result in study.records:
        for caution in dict.fromkeys(_of(result)):
            said.setdefault(caution, []).append(result.title)
    failed = [f"{result.title}: {failure}" for result in study.records for failure in list_failed_chains(result)]
    blocks: list[Block] = [Text("What no number on this page knows:"), List(STANDING)]
    if failed:
        blocks.append(Callout("Chains that failed; nothing here rests on them", failed))
    if said:
        blocks += [
            Heading("Of these records"),
            List([_describe_sentence(caution, titles) for caution, titles in said.items()]),
        ]
    return blocks


def _of(result: RecordResult) -> Iterator[str]:
    """Findings of the audit, cautions of the laws that carry weight, of their checks, and of the predictions."""
    yield from map(str, result.findings)
    for candidate in weighted(result):
        if candidate.weight > LEAST_WEIGHT:
            yield from candidate.cautions
    rough = [s for s in result.posteriors if s.leave_one_out.caution]
    if rough:
        yield f"PSIS-LOO is rough, by arviz's own warning, for {len(rough)} of {count(len(result.posteriors), 'law')}"
    i = find_largest(result.design)
    if result.design is not None:
        yield from result.design.cautions[len(result.design.cautions) - 1 if i is None else i]


def _describe_sentence(caution: str, titles: list[str]) -> str:
    return f"{caution[:1].upper()}{caution[1:]} ({'; '.join(titles)})."
