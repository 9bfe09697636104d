"""What a user says about a raw table, and the table itself, read and checked before any step of the conditioning."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import BaseModel, ValidationError

from damping.errors import InputError
from damping.records.keys import TomlTable, describe_nearest, line_of, read_toml
from damping.records.reading import read_table
from damping.records.text import DEFAULT_MAX_SIZE, CsvRows, read_bytes
from damping.signals import description as schema
from damping.signals.description import Description

#: What must come before a key on its line, for the line of a key in an array of tables.
_KEY = r"^\s*{}\s*="

#: How the keys that hold more than one thing are written.
_EXPECTED: dict[tuple[str | int, ...], str] = {
    ("sensors",): "[[sensors]], one for each reading",
    ("yaw",): "[[yaw]], one for each node",
    ("modes",): "[[modes]], one for each mode",
    ("raw", "keep"): 'a list of columns, ["point"]',
}


def read_description(path: str | Path) -> Description:
    """Read and check a CONDITION.toml. InputError with the line and key of the first thing that is wrong."""
    return _described(read_toml(path))


def describe(values: Mapping[str, Any]) -> Description:
    """A description in the keys of a CONDITION.toml, checked. InputError with the key of what is wrong."""
    return _described(TomlTable(dict(values), (), "description", ""))


def _described(table: TomlTable) -> Description:
    try:
        description = Description.model_validate(table.values)
    except ValidationError as error:
        # a misspelt key explains a missing one, so it comes first
        problems = sorted(error.errors(), key=lambda problem: problem["type"] != "extra_forbidden")
        raise _input_error(problems[0], table.file, table.content) from None
    for keys, message, expected in description.problems():
        raise InputError(
            message, file=table.file, line=_line(table.content, keys), column=_name(keys), expected=expected
        )
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
    for name in dict.fromkeys([*d.columns, *([d.raw.sweep] if d.raw.sweep else []), *d.raw.keep]):
        if name not in table.columns:
            hint = describe_nearest(name, map(str, table.columns))
            raise InputError(f"no column {name!r}", expected=f"{hint} or another column")
        numbers = pd.to_numeric(table[name], errors="coerce") if name in d.columns else None
        if numbers is not None and not np.isfinite(numbers.to_numpy(float)).all():
            raise InputError("not a number in every row", column=name, expected="finite numbers")
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
    found = [(int(np.argmax(wrong)), order.index(name), name) for name, (wrong, _) in bad.items() if wrong.any()]
    if not found:
        return None
    row, _, name = min(found)
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
    return [line for line, _ in CsvRows(read_bytes(path, max_size), path)][1:]


def _input_error(problem: Any, path: str, content: str) -> InputError:
    """Pydantic's problem as one line for people."""
    keys = problem["loc"]
    line = _line(content, keys)
    if problem["type"] == "extra_forbidden":
        known = _model(keys[:-1]).model_fields
        expected = f"{describe_nearest(str(keys[-1]), known)} (nearest of {', '.join(known)})"
        return InputError("unknown key", file=path, line=line, column=_name(keys), expected=expected)
    if problem["type"] == "missing":
        what = "key" if len(keys) > 1 else "table"
        expected = str(keys[-1]) if len(keys) > 1 else _EXPECTED.get(keys, f"[{keys[0]}]")
        return InputError(f"missing {what}", file=path, line=line, column=_name(keys), expected=expected)
    if problem["type"] in ("tuple_type", "model_type"):
        expected = _EXPECTED.get(keys) or _EXPECTED.get(keys[:1], f"a table [{keys[0]}]")
        return InputError("another kind of value", file=path, line=line, column=_name(keys), expected=expected)
    return InputError(problem["msg"], file=path, line=line, column=_name(keys))


def _model(keys: tuple[str | int, ...]) -> type[BaseModel]:
    """The table of the schema that ``keys`` lead to."""
    tables: dict[str, type[BaseModel]] = {
        "units": schema.SignalUnits,
        "raw": schema.Raw,
        "sensors": schema.Sensor,
        "yaw": schema.Yaw,
        "node": schema.Node,
        "mode": schema.ModeFactor,
        "modes": schema.OtherMode,
        "rigid_body": schema.RigidBody,
        "correction": schema.Correction,
        "principal": schema.Principal,
    }
    return tables[str(keys[0])] if keys else Description


def _name(keys: tuple[str | int, ...]) -> str:
    """Keys as people count them: ``sensors 2, factor``."""
    return ", ".join(f"{key}" for key in _list_joined(keys))


def _list_joined(keys: tuple[str | int, ...]) -> list[str]:
    parts: list[str] = []
    for key in keys:
        if isinstance(key, int):
            parts[-1] += f" {key + 1}"
        else:
            parts.append(key)
    return parts


def _line(content: str, keys: tuple[str | int, ...]) -> int | None:
    """Line on which a key is set, or its table begins; None where neither is in the text."""
    if len(keys) < 2 or not isinstance(keys[1], int):
        names = tuple(str(key) for key in keys if not isinstance(key, int))
        return line_of(content, names) or (line_of(content, names[:-1]) if len(names) > 1 else None)
    lines = content.split("\n")
    headers = [i for i, line in enumerate(lines) if re.match(rf"^\s*\[\[\s*{keys[0]}\s*\]\]", line)]
    if keys[1] >= len(headers):
        return line_of(content, (str(keys[0]),))  # written inline
    begin = headers[keys[1]]
    if len(keys) > 2:
        for i in range(begin + 1, len(lines)):
            if lines[i].lstrip().startswith("["):
                break
            if re.match(_KEY.format(re.escape(str(keys[2]))), lines[i]):
                return i + 1
    return begin + 1
