"""Schema of a record (column names and ranges), and TOML tables checked key by key, with the line of an error."""

from __future__ import annotations

import csv
import math
import re
import tomllib
from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import date, time
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args

from damping.errors import InputError, check_whole, list_nearest, naming
from damping.records.text import DEFAULT_MAX_SIZE, decode, describe_shortened, read_bytes, too_large

if TYPE_CHECKING:
    from pydantic import BaseModel

    from damping.arrays import BoolArray, FloatArray

Schema = TypeVar("Schema", bound="BaseModel")

#: The defined columns of a record, in the order in which they are checked.
_COLUMNS = list(csv.DictReader(Path(__file__).with_name("columns.csv").read_text("utf-8").splitlines()))
#: Columns that every record has.
REQUIRED_COLUMNS = tuple(column["column"] for column in _COLUMNS if column["presence"] == "required")
#: Columns of a record that may be absent.
OPTIONAL_COLUMNS = tuple(column["column"] for column in _COLUMNS if column["presence"] == "optional")
#: Columns of a record that hold text; the others are numbers.
TEXT_COLUMNS = tuple(column["column"] for column in _COLUMNS if column["range"] == "text")
#: Columns of a record in which a cell may be empty: a row without ``mass`` has the mass of the mode file.
BLANK_COLUMNS = tuple(column["column"] for column in _COLUMNS if column["cells"] == "may be blank")
#: Powers of (force, length) in the unit of each column, if the mass is force s^2/length.
POWERS = {column["column"]: (int(column["force"]), int(column["length"])) for column in _COLUMNS}
#: Expected content of a numeric cell, where it differs for a cell with text, and for an empty cell that must be filled.
A_NUMBER = "a finite number"
IN_TEXT = {"time": "a finite number: s since any moment, not a time of day"}
IN_BLANK = dict.fromkeys(OPTIONAL_COLUMNS, f"{A_NUMBER}: leave out the rows that have none, or the column for all")
#: Kinds of values that pandas would convert to numbers with another meaning, and what is expected instead.
NO_NUMBERS = dict.fromkeys(("boolean", "date", "period"), "numbers") | {
    "complex": "real numbers: of a complex response its size in amplitude and the lag of its angle in phase",
    **dict.fromkeys(("datetime64", "datetime", "timedelta64", "timedelta"), "numbers, times in s"),
}

#: Magnitudes that a nonzero number of a record or mode may have: products and powers of a few stay finite.
SMALLEST = 1e-50
LARGEST = 1e50


#: A test of cells, and what is expected of a cell that fails it.
Test = tuple[Callable[["FloatArray"], "BoolArray"], str]


def _list_tests(column: Mapping[str, str]) -> list[Test]:
    wanted = f"{column['meaning']} {column['range']}"
    # numbers <= 0 have a test of their own
    magnitude = (lambda x: (x <= 0.0) | (x >= SMALLEST) & (x <= LARGEST), f"a magnitude of {SMALLEST:g} to {LARGEST:g}")
    within = "radians within -2 pi..2 pi (phases in degrees?)"
    within += ", less whole turns" if column["column"] == "phase_3" else ""  # three times a lag passes 2 pi
    turn: Test = (lambda x: (x >= -2.0 * pi) & (x <= 2.0 * pi), within)
    positive, least = [(lambda x: x > 0.0, wanted), magnitude], [(lambda x: x >= 0.0, wanted), magnitude]
    return {"> 0": positive, ">= 0": least, "radians": [turn]}.get(column["range"], [])


#: The tests of each column of a record. A standard uncertainty of zero means that none is stated. Empty cells (NaN) are
#: not tested here: the reader of the file decides whether a cell may be empty.
COLUMN_TESTS = {column["column"]: tests for column in _COLUMNS if (tests := _list_tests(column))}


MAX_TOML_SIZE = 1_000_000  #: largest TOML file that is read, bytes (a mode takes less than one thousand)

_LONGEST_VALUE = 100  # most lines of one value in the search for the line of a key
_PLACE = re.compile(r"\(at (?:line (\d+), column (\d+)|end of document)\)")
_TOML = "TOML, a key = value on each line"  #: what was expected where TOML cannot be read


def read_toml(path: str | Path, max_size: int = DEFAULT_MAX_SIZE) -> TomlTable:
    """The top table of a TOML file. InputError, with the line, if it cannot be read or is not TOML."""
    check_whole(max_size=max_size)
    with naming(path):
        return parse_toml(read_bytes(path, min(max_size, MAX_TOML_SIZE)), str(path))


def parse_toml(data: bytes, file: str) -> TomlTable:
    """The top table in the bytes of a TOML ``file``. InputError: as of `read_toml`."""
    with naming(file):
        if len(data) > MAX_TOML_SIZE:
            raise too_large(file, MAX_TOML_SIZE)
        content, broken = decode(data)
        if broken is not None:
            raise broken
        content = content.replace("\r\n", "\n")
        try:
            return TomlTable(tomllib.loads(content), (), file, content)
        except ValueError as error:  # tomllib.TOMLDecodeError, or an integer of thousands of digits
            reason, place = str(error), _PLACE.search(str(error))
            if place is None:
                raise InputError(f"not TOML: {reason}", expected=_TOML) from None
            line = int(place[1]) if place[1] else content.rstrip("\n").count("\n") + 1
            reason = reason[: place.start()].strip()
            raise InputError(f"not TOML: {reason}", line=line, column=place[2], expected=_TOML) from None
        except RecursionError:
            raise InputError("not TOML: nested too deeply", expected="tables of a mode") from None


@dataclass(frozen=True)
class TomlTable:
    """A table of a TOML file: its ``values``, the keys that lead to it, and the text it was read from."""

    values: dict[str, Any]
    path: tuple[str, ...]
    file: str
    content: str

    def only(self, *known: str) -> None:
        """Raise InputError for the first key that is not in ``known``; it names the nearest known key."""
        for key in self.values:
            if not (isinstance(key, str) and key in known):
                where = f" in [{'.'.join(self.path)}]" if self.path else ""
                raise self.error(str(key), f"unknown key{where}", list_nearest(str(key), known))

    def table(self, key: str, *known: str, required: bool = False, expected: str = "a table") -> TomlTable:
        """The table under ``key``; if ``known`` keys are given, others are refused.

        A missing table is empty, or an error if ``required``; ``expected`` describes the table in errors.
        """
        if required and key not in self.values:
            raise InputError(f"no table [{key}]", file=self.file, expected=f"[{key}]")
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            raise self.error(key, f"is {_describe_kind(value)}", expected)
        table = TomlTable(value, (*self.path, key), self.file, self.content)
        if known:
            table.only(*known)
        return table

    def text(self, key: str, *, default: str) -> str:
        """The text under ``key``, or ``default``."""
        value = self.values.get(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"is {_describe_kind(value)}", "a text in quotes")
        return value

    def truth(self, key: str) -> bool:
        """Whether ``key`` is set to true; false if it is missing."""
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            raise self.error(key, f"is {_describe_kind(value)}", "true or false")
        return value

    def number(
        self,
        key: str,
        *,
        default: float | None = None,
        above: float = -math.inf,
        least: float = -math.inf,
        below: float = math.inf,
    ) -> float:
        """The finite number under ``key``, or ``default``: > ``above``, >= ``least`` and < ``below``."""
        value = self.values.get(key, default)
        expected = f"a number > {above:g}" if above > -math.inf else f"a number >= {least:g}"
        expected = "a finite number" if above == least else expected
        expected += f" and < {below:g}" if below < math.inf else ""
        if value is None:
            line = line_of(self.content, self.path) if self.path else None
            raise InputError(f"no {key} in [{'.'.join(self.path)}]", file=self.file, line=line, expected=expected)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"is {_describe_kind(value)}", expected)
        try:
            number = float(value)
        except OverflowError:  # an integer of more than 308 digits
            number = math.inf
        if not (math.isfinite(number) and above < number < below and number >= least):
            raise self.error(key, f"is {number:g}", expected)
        if number != 0.0 and not SMALLEST <= abs(number) <= LARGEST:
            raise self.error(key, f"is {number:g}", f"a magnitude of {SMALLEST:g} to {LARGEST:g}")
        return number

    def known(self, key: str, least: float = -math.inf) -> float | None:
        """The finite number >= ``least`` under ``key``; None if it is missing or None."""
        return None if self.values.get(key) is None else self.number(key, least=least)

    def error(self, key: str, message: str, expected: str) -> InputError:
        """An InputError on the value under ``key``, with its line."""
        line = line_of(self.content, (*self.path, key))
        return InputError(message, file=self.file, line=line, column=describe_shortened(key), expected=expected)


def line_of(content: str, path: tuple[str | int, ...]) -> int | None:
    """Line of a TOML text that sets the key at ``path``: the first that, with all lines before it, sets the key.

    A number in the path is an index of a list, from 0.
    """
    lines = content.split("\n")
    line = bisect_left(range(len(lines)), True, key=lambda last: _sets(lines, last, path))
    return line + 1 if line < len(lines) else None


def _sets(lines: list[str], last: int, path: tuple[str | int, ...]) -> bool:
    """Whether the text up to line ``last``, and on to the end of a value that spans lines, sets the key at ``path``."""
    for end in range(last + 1, min(len(lines), last + _LONGEST_VALUE) + 1):
        try:
            value: Any = tomllib.loads("\n".join(lines[:end]))
        except ValueError:
            continue
        for key in path:
            keys = range(len(value)) if isinstance(value, list) else value if isinstance(value, dict) else ()
            if key not in keys:
                return False
            value = value[key]
        return True
    return False


def _describe_kind(value: object) -> str:
    kinds = {bool: "true or false", str: "text", int: "a number", float: "a number", list: "a list", dict: "a table"}
    other = "a date or time" if isinstance(value, date | time) else f"a {type(value).__name__}"
    return "None" if value is None else kinds.get(type(value), other)


#: Expected values by pydantic's name of the error.
_EXPECTED = {
    "string_type": "text",
    "string_pattern_mismatch": "letters, digits, - and _, the first a letter or digit",
    "string_too_long": "at most 80 characters",
    "tuple_type": "a list",
    "model_type": "a table",
    "int_type": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "too_short": "at least one",
}


_LIMIT = "Input should be "  #: beginning of pydantic's message on a number beyond a limit


def read_schema(table: TomlTable, schema: type[Schema], written: Mapping[str, str]) -> Schema:
    """A whole TOML file checked by a schema; ``written``: notation of keys with several values, by key.

    InputError: line and key of the first problem, and what was expected.
    """
    from pydantic import ValidationError  # noqa: PLC0415 - slow to import, and few commands read such a file

    try:
        return schema.model_validate(table.values)
    except ValidationError as error:
        # a misspelt key explains a missing one, so it comes first
        problem = min(error.errors(), key=lambda problem: problem["type"] != "extra_forbidden")
    loc, kind = problem["loc"], problem["type"]
    key, message = str(loc[-1]), problem["msg"].removeprefix("Value error, ")
    expected = written.get(key)
    if kind == "extra_forbidden":
        message, expected = "unknown key", list_nearest(key, _find_schema(schema, loc[:-1]).model_fields)
    elif kind == "missing":
        is_table = expected is not None or _find_schema(schema, loc) is not _find_schema(schema, loc[:-1])
        message = f"missing {'table' if is_table else 'key'}"
        expected = expected or (f"[{key}]" if is_table else f"{key} = ...")
    elif kind in _EXPECTED:
        message, expected = describe_shortened(repr(problem["input"])), expected or _EXPECTED[kind]
    elif message.startswith(_LIMIT):
        message, expected = describe_shortened(repr(problem["input"])), message.removeprefix(_LIMIT)
        expected = expected if kind == "literal_error" else f"a number {expected}"
    raise locate(table, loc, message, expected)


def locate(table: TomlTable, keys: tuple[str | int, ...], message: str, expected: str | None) -> InputError:
    """An InputError at ``keys``, on the line of the innermost one found; list places are shown counted from 1."""
    lines = (line_of(table.content, keys[:length]) for length in range(len(keys), 0, -1))
    line = next((line for line in lines if line is not None), None)
    name = "".join(f" {key + 1}" if isinstance(key, int) else f", {key}" for key in keys).removeprefix(", ")
    return InputError(message, file=table.file, line=line, column=name, expected=expected)


def _find_schema(schema: type[BaseModel], keys: tuple[str | int, ...]) -> type[BaseModel]:
    """The table of a schema at ``keys``; for other values, the table that contains them."""
    for key in keys:
        field = schema.model_fields.get(str(key))
        parts = [field.annotation] if field else []
        while parts:
            part = parts.pop()
            if isinstance(part, type) and hasattr(part, "model_fields"):
                schema, parts = part, []
            parts += get_args(part)
    return schema
