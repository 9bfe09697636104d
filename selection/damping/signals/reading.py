"""What a raw table says: its description, its numbers in range, and its uncertainties carried through the chain.

Every row of a record comes from one row of the raw table. Each stated uncertainty is therefore carried by moving its
column, in all rows at once, a small part of the uncertainty up and down, and running the whole chain again: a central
difference of the record, so that a force that is in a reading per unit of force, in the corrections and in the modal
force counts in all three. Contributions of independent readings add as squares (JCGM 100:2008, Eq. 10).

Included are those of force, sensors and phase as they are stated row by row. Mode factors, masses, frequencies, the
angle of the planes, known corrections and R^2/I (held at the value identified) are taken as exact: their errors are
common to all rows, and a record has no place for such. Where amplitude or phase have been corrected, their errors are
correlated, which a record does not say either. Near a point without a damping factor (Eq. 3.2.15) first order is poor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.records.keys import TomlTable, describe_nearest, locate, read_schema, read_toml
from damping.records.reading import read_table, require_numbers
from damping.records.text import DEFAULT_MAX_SIZE, CsvRows, read_bytes
from damping.signals.chain import ConditioningStep, condition
from damping.signals.description import Description

#: Part of an uncertainty by which a column is moved: errors of the difference are of the square of it.
_PART = 1e-3


def condition_steps(raw: pd.DataFrame, description: Description) -> tuple[ConditioningStep, ...]:
    """All steps of a test with the uncertainties that the raw table states; the last one's ``after`` is the record."""
    return with_uncertainties(condition(raw, description), raw, description)


def with_uncertainties(
    steps: tuple[ConditioningStep, ...], raw: pd.DataFrame, description: Description
) -> tuple[ConditioningStep, ...]:
    """The steps with one more, that adds ``NAME_sd`` to the record; unchanged where no uncertainty is stated.

    ``force_sd``, ``amplitude_sd`` and ``phase_sd`` are there where the uncertainty of that reading is stated, and 0
    (none) in rows in which it is stated as 0; ``energy_sd`` and ``xi_sd`` go with ``amplitude_sd``.

    Args:
        steps: of ``condition(raw, description)``. raw: the raw table, uncertainties >= 0.

    Raises:
        AnalysisError: a damping factor that is lost as soon as a reading is moved.
    """
    stated = description.uncertainties
    if not stated:
        return steps
    record = steps[-1].after
    held = _with_r2_over_i_held(description, steps)
    owners = {name: column for name, column in _owners(description) if column in stated and name in record}
    squares = {name: np.zeros(len(record)) for name in owners}
    for column, sd in stated.items():
        step = _PART * raw[sd]
        up, down = (condition(raw.assign(**{column: raw[column] + sign * step}), held)[-1].after for sign in (1, -1))
        for name in owners:
            squares[name] += (_difference(name, record, up, down) / (2.0 * _PART)) ** 2
    given = {
        f"{name}_sd": np.where(raw.loc[record.index, stated[column]] > 0.0, np.sqrt(squares[name]), 0.0)
        for name, column in owners.items()
    }
    after = record.assign(**given)
    return (*steps, ConditioningStep("uncertainties", "first order", record, after, pd.DataFrame(index=record.index)))


def _owners(description: Description) -> Iterator[tuple[str, str | None]]:
    """Columns of the record with the raw column that they stand for."""
    node = next(sensor.column for sensor in description.sensors if sensor.name == description.node.sensor)
    yield "force", description.raw.force
    yield "phase", description.node.phase
    for name in ("amplitude", "energy", "xi"):
        yield name, node


def _with_r2_over_i_held(description: Description, steps: tuple[ConditioningStep, ...]) -> Description:
    r2_over_i = next((step.constants["r2_over_i"] for step in steps if "r2_over_i" in step.constants), None)
    if description.rigid_body is None or r2_over_i is None:
        return description
    rigid = description.rigid_body.model_copy(update={"r2_over_i": r2_over_i, "identify_from": None})
    return description.model_copy(update={"rigid_body": rigid})


def _difference(name: str, record: pd.DataFrame, up: pd.DataFrame, down: pd.DataFrame) -> FloatArray:
    """Change from down to up, (rows,); twice that of one side where the other side has no damping factor."""
    middle = record[name].to_numpy(float)
    above, below = (table[name].reindex(record.index).to_numpy(float) for table in (up, down))
    above, below = (np.where(np.isnan(a), 2.0 * middle - b, a) for a, b in ((above, below), (below, above)))
    change = above - below
    if np.isnan(change).any():
        row = int(np.isnan(change).argmax()) + 1
        raise AnalysisError(f"row {row} of the record loses its damping factor as soon as a reading is moved")
    return np.asarray((change + np.pi) % (2.0 * np.pi) - np.pi if name == "phase" else change)


#: How the keys that hold more than one thing are written.
_WRITTEN = {
    "sensors": "[[sensors]], one for each reading",
    "yaw": "[[yaw]], one for each node",
    "modes": "[[modes]], one for each mode",
    "keep": 'a list of columns, ["point"]',
}


def read_description(path: str | Path) -> Description:
    """Read and check a CONDITION.toml. InputError with the line and key of the first thing that is wrong."""
    return _described(read_toml(path))


def describe(description: object) -> Description:
    """A description as it is, from the path of a CONDITION.toml or in its keys, checked. InputError with the key."""
    if isinstance(description, str | Path):
        return read_description(description)
    if isinstance(description, Description):
        return description
    if not isinstance(description, Mapping):
        raise InputError(f"description is a {type(description).__name__}", expected="a Mapping")
    return _described(TomlTable(dict(description), (), "description", ""))


def _described(table: TomlTable) -> Description:
    description = read_schema(table, Description, _WRITTEN)
    for keys, message, expected in description.problems():
        raise locate(table, keys, message, expected)
    return description


def read_raw(path: Path, description: Description, max_size: int = DEFAULT_MAX_SIZE) -> pd.DataFrame:
    """The raw table with every cell that is used in range.

    Raises:
        InputError: what ``read_table`` refuses; a frequency, a force, or an amplitude of the node or of a yaw ratio
            that is not positive; another amplitude below 0; a phase beyond one turn.
    """
    d = description
    numbers = d.columns
    labels = [d.raw.sweep] if d.raw.sweep else []
    text = [*labels, *(name for name in d.raw.keep if name not in numbers)]
    table = read_table(path, required=[*numbers, *labels], text_columns=text, max_size=max_size)
    for name in d.raw.keep:
        if name not in table:
            hint = describe_nearest(name, map(str, table.columns))
            raise InputError(f"no column {name!r} to keep", file=path, line=1, expected=f"{hint} or another column")
    problem = _out_of_range(table, d)
    if problem is not None:
        row, name, expected = problem
        line = _lines(path, max_size)[row]
        raise InputError(f"{table[name].iloc[row]:g}", file=path, line=line, column=name, expected=expected)
    return table


def check_raw(table: pd.DataFrame, description: Description) -> pd.DataFrame:
    """A raw table that is no file, checked as one; rows numbered anew.

    Raises:
        InputError: a column that is missing or holds no finite numbers, or a number out of range.
    """
    d = description
    require_numbers(table, d.columns)
    for name in [*([d.raw.sweep] if d.raw.sweep else []), *d.raw.keep]:
        if name not in table.columns:
            hint = describe_nearest(name, map(str, table.columns))
            raise InputError(f"no column {name!r}", expected=f"{hint} or another column")
    raw = table.reset_index(drop=True)
    problem = _out_of_range(raw, d)
    if problem is not None:
        row, name, expected = problem
        raise InputError(f"{raw[name].iloc[row]:g} in row {row}", column=name, expected=expected)
    return raw


def _out_of_range(table: pd.DataFrame, description: Description) -> tuple[int, str, str] | None:
    """Row, column and what was expected of the first row, then column, that holds a number out of range."""
    d = description
    turn = 2.0 * np.pi / d.units.rad
    divided = {d.node.sensor, *(name for yaw in d.yaw for name in (yaw.tip_pitch, yaw.pitch))}
    bad: dict[str, tuple[np.ndarray, str]] = {}

    def check(column: str, wrong: Any, expected: str) -> None:
        bad[column] = (np.asarray(wrong), expected)

    for sensor in d.sensors:
        if sensor.name in divided:
            check(sensor.column, table[sensor.column] <= 0.0, "an amplitude > 0")
        else:
            check(sensor.column, table[sensor.column] < 0.0, "an amplitude >= 0")
    for column in d.uncertainties.values():
        check(column, table[column] < 0.0, "a standard uncertainty >= 0")
    check(d.raw.frequency, table[d.raw.frequency] <= 0.0, "a frequency > 0")
    check(d.raw.force, table[d.raw.force] <= 0.0, "a force amplitude > 0")
    if d.node.phase:
        check(d.node.phase, table[d.node.phase].abs() > turn, f"a phase within one turn ({d.units.phase})")
    order = list(table.columns)
    places = [(int(np.argmax(wrong)), order.index(name), name) for name, (wrong, _) in bad.items() if wrong.any()]
    if not places:
        return None
    row, _, name = min(places)
    return row, name, bad[name][1]


def check_repeats(record: pd.DataFrame, raw: Path, max_size: int) -> None:
    """InputError for the first raw row that gives the same row of the record as an earlier one."""
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
