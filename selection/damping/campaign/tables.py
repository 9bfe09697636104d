"""Tables of steady states to runs: the drive and every sensor of ``formats.tables``, one run for each sweep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.runs import (
    LABEL_AGREES,
    CampaignRun,
    describe_quantity,
    find_level_of_ratio,
    is_motion,
    refuse_forces,
    split_ratio,
)
from damping.campaign.sensors import find_exchanged, refuse_exchanged
from damping.campaign.tracked import Source
from damping.errors import InputError
from damping.formats.conversion import SCALINGS
from damping.formats.excitation import note_excitation
from damping.formats.levels import find_level
from damping.formats.named import read_facts, require_linear, to_series
from damping.formats.quantity import find_powers, unit
from damping.formats.sensors import SensorColumns, find_largest_angle, group_columns
from damping.formats.series import Samples, Series, require_finite
from damping.formats.steady import FOLLOWS, measure_turn
from damping.formats.sweeps import join_refined
from damping.formats.tables import SensorTable, read_tables
from damping.records.keys import LARGEST
from damping.records.text import count, describe_shortened

#: Least mean of `measure_turn`, for phases to be a lead or a lag: a resonance has pi/2, a tail next to nothing.
TURNS = 0.2
_PHASES = "a column tip phase [deg], or parts re and im; --correct FILE.toml: role = 'out'"


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
        """The series of a sensor or drive, one for each sweep, each with the ``drive``.

        InputError: decibels, parts in different units, or values that cannot be of these roles.
        """
        roles = {role: place for role, place in self.table.rows.items() if role != "sweep"} | dict(reading.roles)
        if drive is not None:
            roles |= {f"force_{r}": drive.roles[r] for r in "xy"} if "x" in drive.roles else {"force": drive.main}
        headers = {role: self.table.headers[place] for role, place in roles.items()}
        require_linear(headers)
        arrays = {role: self.values[place] for role, place in roles.items()}
        largest = find_largest_angle(reading, drive, [*self.drives, *self.sensors], self.table.headers, self.values)
        facts = replace(read_facts(headers, self.source.facts), largest_angle=largest)
        with np.errstate(all="ignore"):  # rows without finite numbers are left out
            return to_series(arrays, self.labels, facts, self.table.label, self.source.summary, peak=True)

    def find_unit(self, reading: SensorColumns, what: str, usual: str = "") -> str:
        """Unit of a reading: as stated, else in its header, else the ``usual`` one. InputError: it has none."""
        own = self.source.find_unit(reading.name, what, self.table.headers[reading.main].unit or usual)
        if own in ("", "-", "1"):
            such = "N" if what == "force" else "g/g" if own else "m/s^2"
            expected = f"in its header, by --unit {what}={such}, or in --correct FILE.toml"
            raise InputError(f"the unit of {reading.name!r} is not known", expected=expected)
        option = f"--unit {what}=UNIT, or of volts unit and scale in --correct FILE.toml,"
        return unit(own, what=f"of {reading.name!r} the unit", option=option).text

    def find_read_unit(self, sweep: "_SweepRows") -> str:
        """Unit of the level in the label of a sweep if a drive reads that number; else ''."""
        level = find_level(sweep.label.replace("_", " "))
        sizes = [self.source.stated.of(r.name).scale * np.median(np.abs(sweep.values[r.name])) for r in self.drives]
        return level[1] if level and any(abs(abs(x) - level[0]) <= LABEL_AGREES * level[0] for x in sizes) else ""


def read_table_runs(source: Source) -> list[CampaignRun]:
    """The runs of a file with one or several tables of steady states.

    InputError: no table, no drive, a sensor without a phase or a unit, or phases of which neither lead nor lag is said
    nor can be determined.
    """
    tables = read_tables(source.file, source.facts, source.summary, source.most)
    contents = [_read_content(table, source, is_only=len(tables) == 1) for table in tables]
    if not any(contents):
        raise InputError("no sensor has a phase", expected=_PHASES)
    return [run for content in contents if content for run in _list_runs(content)]


def _read_content(table: SensorTable, source: Source, *, is_only: bool) -> _Content | None:
    """The content of a table; None of one without phases, such as a list of modes, unless it ``is_only``."""
    out = [name for name, channel in source.stated.channels.items() if channel.role == "out"]
    source.channels.update(set(out) & {name for header in table.headers for name in (header.name, header.text)})
    readings = group_columns(table.headers, table.is_complex, table.rows.values(), out)
    if not is_only and not any(reading.has_phase or table.is_complex[reading.main] for reading in readings):
        source.summary.note(f"{table.label!r} is skipped: no sensor has a phase")
        return None
    names = [reading.name for reading in readings]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{names.count(twice)} sensors are {twice!r}", expected="columns whose names differ")
    source.channels.update(names)
    if not any(header.scaling for header in table.headers):
        source.note_scaling([table.label])
    drives = _choose_drives(table, readings, source)
    sensors = _choose_sensors(table, [reading for reading in readings if reading not in drives], source)
    kept = [reading for reading in readings if reading in drives or reading in sensors]
    values, labels = table.read([place for reading in kept for place in reading.roles.values()])
    for reading in kept:
        if table.is_complex[reading.main]:  # in a text a cell may be empty
            named = f"drive of {table.label}" if reading in drives else reading.name
            require_finite(named, values[reading.main])
    if labels is not None:
        said = table.headers[table.rows["sweep"]].unit
        labels = [f"{label} {said}".strip() for label in labels]
    return _Content(table, values, labels, drives, sensors, source)


def _choose_drives(table: SensorTable, readings: Sequence[SensorColumns], source: Source) -> list[SensorColumns]:
    """The drives: the column stated, else as of `Corrections.list_drives`. InputError: several, one of them a force."""
    units = {reading.name: table.headers[reading.main].unit for reading in readings}
    usual = next((reading.name for reading in readings if reading.main == table.setting.get("force")), "")
    wanted = {name: text for name, text in units.items() if name == usual or "force" not in source.facts.columns}
    names = source.stated.list_drives(wanted, usual)
    kinds = {name: find_powers(source.find_unit(name, "force", units[name])) for name in names}
    if len(names) > 1 and any(of == (1, 0, 0) or (not of and "force" in name.lower()) for name, of in kinds.items()):
        raise refuse_forces(table.label, names)
    drives = [reading for reading in readings if reading.name in names]
    joined = f", one of {len(drives)}, joined by their {source.stated.control}" if len(drives) > 1 else ""
    for drive in drives:
        source.summary.add(f"channel {drive.name!r}", f"drive{joined}", "found in the file")
    return drives


def _choose_sensors(table: SensorTable, others: Sequence[SensorColumns], source: Source) -> list[SensorColumns]:
    """The sensors among the columns beside the drives, each with a phase.

    Those without are left out beside complex values, or if others have a unit of motion and they have none. InputError:
    there is no sensor, or elsewhere a motion, or in a table without units any column, has no phase.
    """
    if not others:
        raise InputError(f"{table.label}: no response", expected="columns of sensors, each with its phase")
    has_complex = any(table.is_complex[reading.main] for reading in others)
    phaseless = [reading for reading in others if not reading.has_phase]
    moving = [one for one in others if is_motion(source.stated.of(one.name).unit or table.headers[one.main].unit)]
    has_units = any(reading.has_phase for reading in moving)
    left_out = [reading for reading in phaseless if has_complex or (has_units and reading not in moving)]
    if lost := [repr(reading.name) for reading in phaseless if reading not in left_out]:
        further = f" (likewise of {describe_shortened(', '.join(lost[1:]), 100)})" if lost[1:] else ""
        raise InputError(f"{lost[0]} has no phase", expected=_PHASES.replace("tip", lost[0].strip("'")) + further)
    if left_out:
        listed = describe_shortened(", ".join(reading.name for reading in left_out), 100)
        why = "no complex values" if has_complex else "neither a phase nor a unit of motion"
        source.summary.note(f"{table.label}: {listed} left out: {why}")
    return [reading for reading in others if reading not in left_out]


def _list_runs(content: _Content) -> list[CampaignRun]:
    """The runs of a table. InputError: phases whose sense is neither said nor to be found, or no level."""
    drive = content.drives[0] if content.drives else None
    series = {reading.name: content.list_series(reading, drive) for reading in content.sensors}
    for reading in content.drives:
        of_force = [replace(s, response=np.asarray(s.force)) for s in content.list_series(content.sensors[0], reading)]
        series[reading.name] = content.list_series(reading, drive) if reading.has_phase else of_force
    if drive is not None:
        forces = [s.response for s in series[drive.name]]
        driven = [[replace(s, force=F) for s, F in zip(of, forces, strict=True)] for of in series.values()]
        series = dict(zip(series, join_refined(driven, content.source.summary), strict=True))
    factors = _find_peak_factors(content)
    first = series[content.sensors[0].name]
    sweeps = [
        _list_rows(content, s, {name: factors[name] * of[k].response for name, of in series.items()})
        for k, s in enumerate(first)
    ]
    runs = [_make_run(content, sweep) for sweep in _settle_sense(content, sweeps)]
    if any(channel.per_drive for run in runs for channel in run.channels):
        table, labels = content.table, (run.label for run in runs)
        headers = (header.text for header in table.headers)
        texts = (content.source.file.stem, table.label, *labels, *table.content.remarks, *headers)
        note_excitation(texts, content.source.summary)
    return runs


def _find_peak_factors(content: _Content) -> dict[str, float]:
    """Factor of each sensor and drive to peak values, by the scaling in its header; other than peak is said."""
    summary = content.source.summary
    scalings = {r.name: content.table.headers[r.main].scaling for r in (*content.sensors, *content.drives)}
    scaled = {name: scaling for name, scaling in scalings.items() if scaling not in (None, "peak")}
    for name, scaling in scaled.items():
        summary.add(f"amplitudes of {name!r}", f"{scaling}, made peak values", "found in the file")
    silent = [repr(name) for name, scaling in scalings.items() if scaling is None]
    if silent and scaled:
        listed = describe_shortened(", ".join(silent), 100)
        summary.note(f"caution: {listed}: taken as peak values, beside others that are not")
    return {name: SCALINGS[scaling or "peak"] for name, scaling in scalings.items()}


@dataclass(frozen=True)
class _SweepRows:
    """Rows of a sweep by rising frequency: ``x`` (n,) Hz, and values (n,) of every sensor and drive by name."""

    label: str
    x: FloatArray
    values: Mapping[str, Samples]
    rate: FloatArray | None = None  #: sweep rate, Hz/s, if known (n,)


def _list_rows(content: _Content, of: Series, values: Mapping[str, Samples]) -> _SweepRows:
    """The rows of a sweep at which everything was measured, in the order of frequency."""
    known = {name: np.abs(column) <= LARGEST for name, column in values.items()}  # false of NaN
    driven = (values[reading.name] != 0.0 for reading in content.drives)
    measured = np.all([of.abscissa > 0.0, of.abscissa <= LARGEST, *known.values(), *driven], axis=0)
    if not measured.any():
        empty = next((f" ({name!r} has none)" for name, rows in known.items() if not rows.any()), "")
        expected = "a frequency > 0, a drive > 0 and every response; --correct FILE.toml: role = 'out'"
        raise InputError(f"{of.label}: no row has all numbers{empty}", expected=expected)
    if lost := int(np.count_nonzero(~measured)):
        content.source.summary.note(f"{count(lost, 'row')} of {of.label!r} left out: without all numbers")
    order = np.flatnonzero(measured)[np.argsort(of.abscissa[measured], kind="stable")]
    rate, moved = of.extra.get("sweep_rate"), {name: column[order] for name, column in values.items()}
    return _SweepRows(of.label, of.abscissa[order], moved, None if rate is None else rate[order])


def _settle_sense(content: _Content, sweeps: Sequence[_SweepRows]) -> Sequence[_SweepRows]:
    """Sweeps with angles read as lead or as lag, whichever lets responses fall behind the drive at resonances.

    That is the mean of `measure_turn` of H = x/F over all sensors and sweeps.
    """
    angular = {reading.name for reading in (*content.sensors, *content.drives) if "angle" in reading.roles}
    if not angular:
        return sweeps
    turned, exchanged = [], []
    for sweep in sweeps:
        drive = sweep.values[content.drives[0].name] if content.drives else np.ones(len(sweep.x))
        motions = {reading.name: sweep.values[reading.name] for reading in content.sensors}
        exchanged.append(find_exchanged(drive, motions))
        for H in (x / drive for x in motions.values()):
            if H.any():  # else it is dead
                turned.append(measure_turn(H))
    if not turned or abs(np.mean(turned)) < TURNS:
        refuse_exchanged(exchanged)
        message = f"whether the phases of {content.table.label!r} lead or lag cannot be determined from their direction"
        raise InputError(message, expected="columns called lead or lag, such as tip lag [deg]")
    is_lead = bool(np.mean(turned) < 0.0)
    sense = f"a {'lead' if is_lead else 'lag'} of the responses"
    content.source.summary.add("phases", sense, FOLLOWS)
    if is_lead:
        return sweeps
    lags = [{name: np.conj(sweep.values[name]) for name in angular} for sweep in sweeps]
    return [replace(sweep, values={**sweep.values, **lag}) for sweep, lag in zip(sweeps, lags, strict=True)]


def _make_run(content: _Content, sweep: _SweepRows) -> CampaignRun:
    source, stated = content.source, content.source.stated
    units = {reading.name: content.find_unit(reading, "response") for reading in content.sensors}
    drive_unit = content.find_unit(content.drives[0], "force", content.find_read_unit(sweep)) if content.drives else ""
    ratios = {name: split_ratio(text, drive_unit) for name, text in units.items()}
    if content.drives:
        controls = (reading.name for reading in content.drives)
        drive = stated.join_controls([stated.of(name).scale * sweep.values[name] for name in controls])
    else:
        level, drive_unit = _read_level(sweep, next((parts[1] for parts in ratios.values() if parts), ""), source)
        drive = np.full(len(sweep.x), level, dtype=complex)
    channels = []
    for name, ratio in ratios.items():
        text, per = ratio or (units[name], drive_unit)
        values = sweep.values[name] * (unit(drive_unit).factor / unit(per).factor)
        quantity = describe_quantity(text, name)
        channels.append(source.make_channel(name, text, values, quantity, per_drive=ratio is not None))
    run = CampaignRun(sweep.label, None, drive_unit, sweep.x, drive, tuple(filter(None, channels)), sweep.rate)
    return source.leave_flat(source.set_level(run, sweep.label))


def _read_level(sweep: _SweepRows, per: str, source: Source) -> tuple[float, str]:
    """Amplitude of the drive of a sweep without one, from its label, and its unit; ``per``: that of ratios, or ''.

    InputError: the label has no level.
    """
    label = sweep.label.replace("_", " ")
    if not per and find_level(label) is None:
        expected = "a column called control, drive, base or force, --column force=NAME, or a level in the label"
        raise InputError(f"{sweep.label}: no drive", expected=expected)
    level, drive_unit = find_level_of_ratio(label, per)
    if not per:
        taken = f"{level:g} {drive_unit} of its label is taken as its amplitude in every row"
        source.summary.note(f"caution: {sweep.label!r} has no drive: {taken}")
    return level, drive_unit
