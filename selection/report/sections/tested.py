"""What was tested: records, levels, and what the simulation assumes of each mode."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from selection.report.page import Block, Fold, Heading, Section, Table, Text
from selection.report.results import RecordResult, StudyResult
from selection.report.sections.common import file_stem
from selection.report.tables import observations_table
from selection.report.words import count, number, quantity

#: More points are folded away; of still more, the page shows the first.
FOLDED_POINTS, MOST_POINTS = 30, 300


def tested(study: StudyResult) -> Section:
    """The section: a table of tested levels, and for each record where its numbers come from."""
    levels = pd.concat([_levels(result) for result in study.records], ignore_index=True)
    units = {str(result.mode.units) for result in study.records}
    caption = f"Tested levels, each at its phase resonance. Units: {'; '.join(sorted(units))}; frequency in Hz."
    blocks: list[Block] = [Table(levels, caption)]
    for result in study.records:
        blocks += [Heading(result.title), Text(_said(result)), *_points(result)]
    return Section("tested", "What was tested", blocks)


def _levels(result: RecordResult) -> pd.DataFrame:
    data = result.data
    return pd.DataFrame(
        {
            "record": result.title,
            "sweep": data.sweeps,
            "points": data.rows_per_sweep,
            "force": data.tested_force,
            "frequency": data.tested_omega / (2.0 * np.pi),
            "amplitude": data.tested_amplitude,
        }
    )


def _said(result: RecordResult) -> str:
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
        f"{Path(record.source).name}. {energy}{unused} The simulation assumes {quantity(mode.frequency, 'Hz', 4)} "
        f"and a generalized mass of {quantity(mode.mass, mass_unit, 4)}, known to "
        f"{number(100 * tolerance.frequency, 2)} and {number(100 * tolerance.mass, 2)} per cent, and its viscous "
        f"damping to {number(100 * tolerance.viscous, 2)} per cent."
    )


def _points(result: RecordResult) -> list[Block]:
    """All points of a record that has more than its resonances."""
    if len(result.data.A) <= len(result.data.sweeps):
        return []
    table = observations_table(result).drop(columns="omega")
    caption = "Points used: frequency (Hz), amplitude, force in quadrature E/(π A), and energy per cycle E."
    block = Table(table.head(MOST_POINTS), caption, key=file_stem(result, "observations"))
    if len(table) <= FOLDED_POINTS:
        return [block]
    return [Fold(f"The first {len(block.frame)} of {count(len(table), 'point')}; the file has all", [block])]
