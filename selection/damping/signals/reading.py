"""A raw table and its description: reading, range checks, and uncertainties propagated through the chain.

Every row of a record comes from one row of the raw table. Each stated uncertainty is therefore propagated by moving its
column, in all rows at once, a small part of the uncertainty up and down, and running the whole chain again. This is a
central difference of the record, in which a force counts in a reading per unit of force, in the corrections and in the
modal force. Contributions of independent readings add as squares (JCGM 100:2008, Eq. 10).

Uncertainties of force, sensors and phase are included as stated row by row. Mode factors, masses, frequencies, the
angle of the planes, known corrections and R^2/I (held at the identified value) are taken as exact: their errors are
common to all rows, which a record cannot express. Nor can it express that corrections correlate the errors of amplitude
and phase. Near a point without a damping factor (Eq. 3.2.15) first order is inaccurate, which `list_doubts` says.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, wrap_lag
from damping.errors import AnalysisError, InputError
from damping.records.check_ceiling import find_ceiling
from damping.records.keys import TomlTable, locate, read_schema, read_toml
from damping.records.reading import read_table, require_column, take_numbers
from damping.records.text import DEFAULT_MAX_SIZE, CsvRows, read_bytes
from damping.signals.chain import IN_PHASE, ConditioningStep, condition, find_nearer_root
from damping.signals.description import Description

_PART = 1e-3  #: share of an uncertainty by which a column is moved; the relative error of the difference is its square
#: Factor between an uncertainty of first order and that by moves of a whole uncertainty, either way, from which first
#: order fails in a row: a smooth curve to which a tangent is a guide stays within it.
_BENT = 1.5


def condition_steps(raw: pd.DataFrame, description: Description) -> tuple[ConditioningStep, ...]:
    """The steps of `condition`, and one that adds uncertainties if the raw table states them (>= 0).

    It adds ``force_sd``, ``amplitude_sd`` and ``phase_sd`` to the record if the uncertainty of that reading is stated,
    and 0 (none) in rows in which it is stated as 0; ``energy_sd`` and ``xi_sd`` accompany ``amplitude_sd``.

    AnalysisError: a damping factor that vanishes when a reading is moved.
    """
    steps = condition(raw, description)
    stated = description.uncertainties
    if not stated:
        return steps
    record = steps[-1].after
    deviations = _propagate(raw, _hold_identified(description, steps), record, _PART)
    lost = np.any([np.isnan(sd) for sd in deviations.values()], axis=0)
    if np.any(lost):
        row = int(np.argmax(lost)) + 1
        raise AnalysisError(f"row {row} of the record loses its damping factor as soon as a reading is moved")
    columns = _list_raw_columns(description)
    given = {
        f"{name}_sd": np.where(raw.loc[record.index, stated[columns[name]]] > 0.0, sd, 0.0)
        for name, sd in deviations.items()
    }
    after = record.assign(**given)
    return (*steps, ConditioningStep("uncertainties", "first order", record, after, pd.DataFrame(index=record.index)))


def _hold_identified(description: Description, steps: tuple[ConditioningStep, ...]) -> Description:
    """The description with R^2/I as the steps identified it."""
    r2_over_i = next((step.constants["r2_over_i"] for step in steps if "r2_over_i" in step.constants), None)
    if description.rigid_body is None or r2_over_i is None:
        return description
    known = description.rigid_body.model_copy(update={"r2_over_i": r2_over_i, "identify_from": None})
    return description.model_copy(update={"rigid_body": known})


def _list_raw_columns(description: Description) -> dict[str, str]:
    """The raw column whose reading a column of the record is, by column of the record."""
    node = next(sensor.column for sensor in description.sensors if sensor.name == description.node.sensor)
    phase = {} if description.node.phase is None else {"phase": description.node.phase}
    return {"force": description.raw.force, **phase, **dict.fromkeys(("amplitude", "energy", "xi"), node)}


def _propagate(raw: pd.DataFrame, description: Description, record: pd.DataFrame, part: float) -> dict[str, FloatArray]:
    """Standard deviations of columns of the record whose reading states one, by moves of a ``part`` of it, (rows,)."""
    stated = description.uncertainties
    owners = [name for name, own in _list_raw_columns(description).items() if own in stated and name in record]
    squares = {name: np.zeros(len(record)) for name in owners}
    for column, sd in stated.items():
        step = part * raw[sd]
        moved = (raw.assign(**{column: raw[column] + way * step}) for way in (1, -1))
        up, down = (condition(table, description)[-1].after for table in moved)
        for name in owners:
            squares[name] += (_difference(name, record, up, down) / (2.0 * part)) ** 2
    return {name: np.sqrt(square) for name, square in squares.items()}


def _difference(name: str, record: pd.DataFrame, up: pd.DataFrame, down: pd.DataFrame) -> FloatArray:
    """Change from down to up, (rows,); twice that of one side where the other has no damping factor, or NaN."""
    middle = record[name].to_numpy(float)
    above, below = (table[name].reindex(record.index).to_numpy(float) for table in (up, down))
    above, below = (np.where(np.isnan(a), 2.0 * middle - b, a) for a, b in ((above, below), (below, above)))
    return wrap_lag(above - below, -np.pi) if name == "phase" else above - below


def list_doubts(raw: pd.DataFrame, description: Description, steps: tuple[ConditioningStep, ...]) -> tuple[str, ...]:
    """Cautions: readings at a ceiling, removals beyond every measured amplitude, uncertain roots and uncertainties."""
    doubts = [*_doubt_first_order(raw, description, steps), *_doubt_branch(description, steps)]
    force = raw[description.raw.force].to_numpy(float)
    labels = raw[description.raw.sweep].astype(str) if description.raw.sweep else pd.Series("", raw.index)
    for sensor in description.sensors:
        written = raw[sensor.column].to_numpy(float)
        for label, rows in labels.groupby(labels, sort=False).indices.items():
            top = find_ceiling(written[rows], force[rows], per_force=sensor.per_force)
            if top is not None:
                stays = f"readings of {sensor.name}{' times force' * sensor.per_force} stay at {top:.4g}"
                of_sweep = f" in sweep {label}" if label else ""
                doubts.append(f"{stays}{of_sweep}: does the sensor, its amplifier or its range clip them?")
    for step in (step for step in steps if step.name in IN_PHASE):
        measured, removed = step.before["amplitude"].max(), step.removed.abs().max()
        for part, most in removed[removed > measured].items():
            more = f"{part} takes off up to {most:.3g}, more than the largest amplitude, {measured:.3g}"
            doubts.append(f"{more}: do unit, factor, phi and mass belong together?")
    return tuple(doubts)


def _doubt_first_order(raw: pd.DataFrame, description: Description, steps: tuple[ConditioningStep, ...]) -> list[str]:
    """Columns of uncertainties that a move of the readings by a whole uncertainty contradicts.

    The planes are found from the readings by a root, which is bent where they are close; all else is nearly linear.
    """
    if description.principal is None or steps[-1].name != "uncertainties":
        return []
    record, doubts = steps[-1].after, []
    for name, whole in _propagate(raw, _hold_identified(description, steps), steps[-2].after, 1.0).items():
        first = record[f"{name}_sd"].to_numpy(float)
        bent = (first > 0.0) & ~((whole < _BENT * first) & (first < _BENT * whole))
        if bent.any():
            rows = f"{np.sum(bent)} of {len(bent)} rows"
            doubts.append(f"{name}_sd is rough in {rows}: the readings are too uncertain to separate planes so close")
    return doubts


def _doubt_branch(description: Description, steps: tuple[ConditioningStep, ...]) -> list[str]:
    """A caution where another root is nearer to the median of the roots taken than the one taken there.

    "low" and "high" take the same side of the largest energy loss at every row, but a damping factor lies on either
    side: on the high side near resonance, on the low side away from it.
    """
    step = next((step for step in steps if step.name == "principal planes"), None)
    if step is None or description.principal is None or description.principal.branch == "near":
        return []
    xi = step.after["xi"].to_numpy(float)
    nearer = find_nearer_root(step.before.loc[step.after.index], xi, description)
    other = np.sum(nearer != xi)
    if not other:
        return []
    taken = f"the {description.principal.branch} roots run from xi = {xi.min():.3g} to {xi.max():.3g}"
    nearest = f"in {other} of {len(xi)} rows another root is nearer to their median"
    return [f'{taken}, and {nearest}: branch = "near" with the xi of the mode takes either side']


#: Notation of keys with several values.
_WRITTEN = {
    "sensors": "[[sensors]], one for each reading",
    "yaw": "[[yaw]], one for each node",
    "modes": "[[modes]], one for each mode",
    "keep": 'a list of columns, ["point"]',
}


def read_description(description: object) -> Description:
    """A checked description from a `Description`, the path of a CONDITION.toml, or a mapping of its keys.

    InputError: line and key of the first problem.
    """
    if isinstance(description, Description):
        return description
    if isinstance(description, str | Path):
        table = read_toml(description)
    elif isinstance(description, Mapping):
        table = TomlTable(dict(description), (), "description", "")
    else:
        raise InputError(f"description is of type {type(description).__name__}", expected="a Mapping")
    checked = read_schema(table, Description, _WRITTEN)
    for keys, message, expected in checked.problems():
        raise locate(table, keys, message, expected)
    return checked


def read_raw(path: Path, description: Description, max_size: int = DEFAULT_MAX_SIZE) -> pd.DataFrame:
    """The raw table, checked to have every used cell in range.

    InputError: all that ``read_table`` refuses; a frequency, a force, or an amplitude of the node or of a yaw ratio
    that is not positive; another amplitude below 0; a phase beyond one turn; an uncertainty below 0.
    """
    d = description
    labels = [d.raw.sweep] if d.raw.sweep else []
    text = [*labels, *(name for name in d.raw.keep if name not in d.columns)]
    table = read_table(path, required=[*d.columns, *labels], text_columns=text, max_size=max_size)
    for name in d.raw.keep:
        require_column(table, name, path, line=1, why=" to keep")
    for row, name, expected in _find_out_of_range(table, d):
        line = _lines(path, max_size)[row]
        raise InputError(f"{table[name].iloc[row]:g}", file=path, line=line, column=name, expected=expected)
    return table


def check_raw(table: pd.DataFrame, description: Description) -> pd.DataFrame:
    """A raw table from memory, checked like a file; rows are renumbered.

    InputError: a column that is missing or not finite numbers, a number out of range, or no rows.
    """
    d = description
    raw = take_numbers(table, d.columns).reset_index(drop=True)
    for name in [*([d.raw.sweep] if d.raw.sweep else []), *d.raw.keep]:
        require_column(table, name)
    if table.empty:
        raise InputError("no data rows", expected="at least one row")
    for row, name, expected in _find_out_of_range(raw, d):
        raise InputError(f"{raw[name].iloc[row]:g} in row {row}", column=name, expected=expected)
    return raw


def _find_out_of_range(table: pd.DataFrame, description: Description) -> list[tuple[int, str, str]]:
    """Row, column and expectation of the first number out of range in each column, first rows first."""
    d = description
    divided = {d.node.sensor, *(name for yaw in d.yaw for name in (yaw.tip_pitch, yaw.pitch))}
    bad: dict[str, tuple[pd.Series, str]] = {}
    for sensor in d.sensors:
        amplitude, positive = table[sensor.column], sensor.name in divided
        wrong = amplitude <= 0.0 if positive else amplitude < 0.0
        bad[sensor.column] = wrong, f"an amplitude {'>' if positive else '>='} 0"
    bad |= {name: (table[name] < 0.0, "a standard uncertainty >= 0") for name in d.uncertainties.values()}
    bad[d.raw.frequency] = table[d.raw.frequency] <= 0.0, "a frequency > 0"
    bad[d.raw.force] = table[d.raw.force] <= 0.0, "a force amplitude > 0"
    if d.node.phase:
        turn = 2.0 * np.pi / d.units.rad
        hint = "" if d.units.phase == "degrees" else '; of degrees say phase = "degrees" in [units]'
        bad[d.node.phase] = table[d.node.phase].abs() > turn, f"a phase within one turn ({d.units.phase}){hint}"
    in_order = ((name, *bad[name]) for name in map(str, table) if name in bad)
    places = [(int(np.argmax(wrong)), name, expected) for name, wrong, expected in in_order if wrong.any()]
    return sorted(places, key=lambda place: place[0])


def check_repeats(record: pd.DataFrame, raw: Path, max_size: int) -> None:
    """Raise InputError for the first raw row that gives the same row of the record as an earlier one."""
    repeats = record.duplicated().to_numpy()
    if repeats.any():
        second = int(np.argmax(repeats))
        first = int(np.argmax((record == record.iloc[second]).all(axis=1).to_numpy()))
        lines = np.array(_lines(raw, max_size))[record.index.to_numpy()]
        message = f"gives the same row of the record as line {lines[first]}"
        raise InputError(message, file=raw, line=int(lines[second]), expected="each measured state once")


def _lines(path: Path, max_size: int) -> list[int]:
    """Line on which each data row of a CSV file starts."""
    return [line for line, _ in CsvRows(read_bytes(path, max_size))][1:]
