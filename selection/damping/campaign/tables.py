"""Tables of steady states to runs: the drive and every sensor of ``formats.tables``, one run for each sweep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.runs import (
    NUMBERED,
    CampaignRun,
    describe_quantity,
    find_level_of_ratio,
    refuse_forces,
    split_ratio,
)
from damping.campaign.tracked import Source
from damping.errors import InputError
from damping.formats.conversion import SCALINGS
from damping.formats.quantity import find_powers, unit
from damping.formats.sensors import SensorColumns, group_columns
from damping.formats.series import Samples, Series
from damping.formats.tables import SensorTable, list_reading_series, read_tables
from damping.records.text import count

#: Least area, twice and over the largest |H|^2, that H passes round 0 in the mean of sensors and sweeps, for phases to
#: be a lead or a lag: a resonance has pi/2, a tail next to nothing, and noise of neighbouring rows cancels.
TURNS = 0.2


@dataclass(frozen=True)
class _Content:
    """A table with its values by column, the label of each row, and the drives and sensors among its columns."""

    table: SensorTable
    values: Mapping[int, Samples]
    labels: Sequence[str] | None
    drives: Sequence[SensorColumns]
    sensors: Sequence[SensorColumns]
    source: Source

    def list_series(self, reading: SensorColumns, drive: SensorColumns | None) -> list[Series]:
        """The series of a sensor or drive, one for each sweep, each with the ``drive``."""
        roles = {role: place for role, place in self.table.rows.items() if role != "sweep"} | dict(reading.roles)
        if drive is not None:
            has_parts = "x" in drive.roles
            roles |= {f"force_{r}": drive.roles[r] for r in "xy"} if has_parts else {"force": drive.main}
        stated, summary = self.source.facts, self.source.summary
        return list_reading_series(self.table, roles, self.values, self.labels, stated, summary)

    def find_unit(self, reading: SensorColumns, what: str) -> str:
        """Unit of a reading: as stated, else in its header. InputError: it has none."""
        text = self.table.headers[reading.main].unit
        own = self.source.stated.of(reading.name).unit or self.source.facts.units.get(what) or text
        if not own:
            such = "N" if what == "force" else "m/s^2"
            expected = f"in its header, by --unit {what}={such}, or in --correct FILE.toml"
            raise InputError(f"the unit of {reading.name!r} is not known", expected=expected)
        return own.replace("m/s2", "m/s^2")

    def find_factor(self, reading: SensorColumns) -> float:
        """Factor of a reading to peak values, by its header."""
        scaling = self.table.headers[reading.main].scaling or "peak"
        if scaling != "peak":
            self.source.summary.add(
                f"amplitudes of {reading.name!r}", f"{scaling}, made peak values", "found in the file"
            )
        return SCALINGS[scaling]


def read_table_runs(source: Source) -> list[CampaignRun]:
    """The runs of a file with one or several tables of steady states.

    InputError: no table, no drive, a sensor without a phase or a unit, or phases of which neither lead nor lag is said
    nor can be determined.
    """
    tables = read_tables(source.file, source.facts, source.summary, source.most)
    return [run for table in tables for run in _list_runs(_read_content(table, source))]


def _read_content(table: SensorTable, source: Source) -> _Content:
    stated = source.stated
    out = [name for name, channel in stated.channels.items() if channel.role == "out"]
    source.channels.update(set(out) & {name for header in table.headers for name in (header.name, header.text)})
    readings = group_columns(table.headers, table.is_complex, table.rows.values(), out)
    names = [reading.name for reading in readings]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{names.count(twice)} sensors are {twice!r}", expected="columns whose names differ")
    source.channels.update(names)
    drives = _choose_drives(table, readings, source)
    sensors = [reading for reading in readings if reading not in drives]
    if not sensors:
        raise InputError(f"{table.label}: no response", expected="columns of sensors, each with its phase")
    phaseless = next((reading.name for reading in sensors if not reading.has_phase), None)
    if phaseless is not None:
        expected = f"a column {phaseless} phase [deg], or parts re and im; --correct FILE.toml: role = 'out'"
        raise InputError(f"{phaseless!r} has no phase", expected=expected)
    values, labels = table.read(table.rows, [place for reading in readings for place in reading.roles.values()])
    if labels is not None:
        said = table.headers[table.rows["sweep"]].unit
        labels = [f"{label} {said}".strip() for label in labels]
    return _Content(table, values, labels, drives, sensors, source)


def _choose_drives(table: SensorTable, readings: Sequence[SensorColumns], source: Source) -> list[SensorColumns]:
    """Drives: the column stated, those called so, that with a usual name of a force, or the only force."""
    stated, place = source.stated, table.setting.get("force")
    at_place = [reading for reading in readings if reading.main == place and not stated.of(reading.name).role]
    numbered = [reading for reading in readings if NUMBERED.search(reading.name) and not stated.of(reading.name).role]
    named = [reading for reading in readings if stated.is_drive(reading.name)] or numbered
    units = {reading.name: table.headers[reading.main].unit for reading in readings}
    by_unit = stated.choose_drive(units)
    drives = at_place if "force" in source.facts.columns else named or at_place
    drives = drives or [reading for reading in readings if reading.name == by_unit]
    forces = [reading.name for reading in drives if find_powers(units[reading.name]) == (1, 0, 0)]
    if forces and len(drives) > 1:
        raise refuse_forces(table.label, [reading.name for reading in drives])
    return drives


def _list_runs(content: _Content) -> list[CampaignRun]:
    """The runs of a table. InputError: phases whose sense is neither said nor to be found, or no level."""
    drive = content.drives[0] if content.drives else None
    series = {reading.name: content.list_series(reading, drive) for reading in content.sensors}
    for reading in content.drives:
        of_force = [replace(s, response=np.asarray(s.force)) for s in content.list_series(content.sensors[0], reading)]
        series[reading.name] = content.list_series(reading, drive) if reading.has_phase else of_force
    factors = {reading.name: content.find_factor(reading) for reading in (*content.sensors, *content.drives)}
    first = series[content.sensors[0].name]
    sweeps = [
        _list_rows(content, s, {name: factors[name] * of[k].response for name, of in series.items()})
        for k, s in enumerate(first)
    ]
    return [_make_run(content, sweep) for sweep in _settle_sense(content, sweeps)]


@dataclass(frozen=True)
class _SweepRows:
    """Rows of a sweep by rising frequency: ``x`` (n,) Hz, and values (n,) of every sensor and drive by name."""

    label: str
    x: FloatArray
    values: Mapping[str, Samples]


def _list_rows(content: _Content, of: Series, values: Mapping[str, Samples]) -> _SweepRows:
    """The rows of a sweep at which everything was measured, in the order of frequency."""
    measured = np.all([np.isfinite(of.abscissa), of.abscissa > 0.0, *map(np.isfinite, values.values())], axis=0)
    measured &= np.all([np.abs(values[reading.name]) > 0.0 for reading in content.drives], axis=0)
    if not measured.any():
        raise InputError(
            f"{of.label}: no row has all numbers", expected="a frequency > 0, a drive > 0 and every response"
        )
    if lost := int(np.count_nonzero(~measured)):
        content.source.summary.note(f"{count(lost, 'row')} of {of.label!r} left out: without all numbers")
    order = np.flatnonzero(measured)[np.argsort(of.abscissa[measured], kind="stable")]
    return _SweepRows(of.label, of.abscissa[order], {name: column[order] for name, column in values.items()})


def _settle_sense(content: _Content, sweeps: Sequence[_SweepRows]) -> Sequence[_SweepRows]:
    """Sweeps with angles read as lead or as lag, whichever lets responses fall behind the drive at resonances.

    Where H = x/F passes a resonance it goes round clockwise if its phase is a lead: the sum of Im(conj(H_i) H_i+1) of
    all sensors, each over its largest |H|^2, is below 0, for whatever sign a mode has at a sensor.
    """
    angular = {reading.name for reading in (*content.sensors, *content.drives) if "angle" in reading.roles}
    if not angular:
        return sweeps
    turned = []
    for sweep in sweeps:
        drive = sweep.values[content.drives[0].name] if content.drives else np.ones(len(sweep.x))
        for H in (sweep.values[reading.name] / drive for reading in content.sensors):
            if H.any():  # else it is dead
                unit_H = H / np.max(np.abs(H))
                turned.append(float(np.sum(np.imag(np.conj(unit_H[:-1]) * unit_H[1:]))))
    if not turned or abs(np.mean(turned)) < TURNS:
        message = f"whether the phases of {content.table.label!r} lead or lag cannot be determined from their direction"
        raise InputError(message, expected="columns called lead or lag, such as tip lag [deg]")
    is_lead = bool(np.mean(turned) < 0.0)
    sense = f"a {'lead' if is_lead else 'lag'} of the responses"
    content.source.summary.add("phases", sense, "follows: a passive structure absorbs energy")
    if is_lead:
        return sweeps
    return [
        replace(s, values={name: np.conj(v) if name in angular else v for name, v in s.values.items()}) for s in sweeps
    ]


def _make_run(content: _Content, sweep: _SweepRows) -> CampaignRun:
    """The run of a sweep, with its level."""
    source, stated = content.source, content.source.stated
    units = {reading.name: content.find_unit(reading, "response") for reading in content.sensors}
    drive_unit = content.find_unit(content.drives[0], "force") if content.drives else ""
    ratios = {name: split_ratio(text, drive_unit) for name, text in units.items()}
    if content.drives:
        drive = stated.join_controls(
            [stated.of(reading.name).scale * sweep.values[reading.name] for reading in content.drives]
        )
    else:
        per = next((parts[1] for parts in ratios.values() if parts), None)
        if per is None:
            expected = "a column called control, drive, base or force, or --column force=NAME"
            raise InputError(f"{sweep.label}: no drive", expected=expected)
        level, drive_unit = find_level_of_ratio(sweep.label.replace("_", " "), per)
        drive = np.full(len(sweep.x), level, dtype=complex)
    channels = []
    for name, ratio in ratios.items():
        text, per = ratio or (units[name], drive_unit)
        factor = unit(drive_unit).factor / unit(per).factor
        quantity = describe_quantity(text, name)
        channels.append(
            source.make_channel(name, text, sweep.values[name] * factor, quantity, per_drive=ratio is not None)
        )
    run = CampaignRun(sweep.label, None, drive_unit, sweep.x, drive, tuple(filter(None, channels)))
    return source.leave_flat(source.set_level(run, sweep.label))
