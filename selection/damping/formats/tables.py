"""Tables of steady states of several sensors in any file: a text table, the sheets of a workbook, or groups of arrays.

Read by the readers of a single response (``columns``, ``workbook``, ``arrays``, ``named``), each file once.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path

import numpy as np

from damping.errors import InputError
from damping.formats import find_format
from damping.formats.array_series import list_members
from damping.formats.arrays import read_arrays
from damping.formats.columns import TextTable, open_table
from damping.formats.headers import ColumnHeader
from damping.formats.levels import ArrayTable, find_level, split_levels
from damping.formats.sampling import split
from damping.formats.sensors import describe_array, find_setting
from damping.formats.series import MOST_SWEEPS, Samples, Stated, Summary
from damping.formats.workbook import list_sheets
from damping.records.text import describe_shortened, read_bytes

_EXPECTED = (
    "frequency, drive and responses (--column frequency=NAME), or a column of time beside motions "
    "(CSV, MAT, HDF5, TDMS, UFF)"
)


@dataclass(frozen=True)
class SensorTable:
    """Columns by place: their headers, and the text or the arrays that they are of."""

    label: str
    setting: Mapping[str, int]  #: columns of the roles ``sensors.SETTING``
    content: TextTable | ArrayTable

    @property
    def headers(self) -> tuple[ColumnHeader, ...]:
        """Headers of the columns."""
        return self.content.headers

    @property
    def is_complex(self) -> list[bool]:
        """Whether each column is of complex values."""
        of_file = self.content.places or range(len(self.headers))
        arrays = self.content.columns if isinstance(self.content, ArrayTable) else ()
        return [bool(arrays) and np.iscomplexobj(arrays[place]) for place in of_file]

    @property
    def rows(self) -> dict[str, int]:
        """The columns of the roles that set a row."""
        return {role: place for role, place in self.setting.items() if role != "force"}

    def read(self, further: Sequence[int]) -> tuple[dict[int, Samples], Sequence[str] | None]:
        """Values by place of the columns that set a row, and of ``further`` ones; and the label of each row."""
        roles = self.rows | {str(k): k for k in further if k not in self.rows.values()}
        numbers, texts = self.content.read(roles)
        return {roles[role]: values for role, values in numbers.items()}, texts

    def split_levels(self) -> "list[SensorTable]":
        """A table for each level that the names of columns hold (``levels.find_levels``), else the table."""
        return [self._take_level(table) for table in split_levels(self.content)] or [self]

    def _take_level(self, table: TextTable | ArrayTable) -> "SensorTable":
        of, (level, text) = table.places, table.level or (0.0, "")
        setting = {role: of.index(place) for role, place in self.setting.items() if place in of}
        return SensorTable(f"{level:g} {text}", setting, table)


def read_tables(path: Path, stated: Stated, summary: Summary, max_size: int) -> list[SensorTable]:
    """The tables of a file, at least one. InputError: the file cannot be read, or has none."""
    kind = find_format(path, stated, summary)
    if kind in ("mat5", "mat73", "hdf5", "tdms"):
        return _list_array_tables(path, kind, stated, max_size)
    if kind not in ("xlsx", "csv"):
        raise InputError(f"no table: {kind.upper()}", expected=_EXPECTED)
    data = read_bytes(path, max_size)
    texts = {path.stem: data}
    if kind == "xlsx":
        sheets = list_sheets(data, max_size, stated.decimal)
        several = {title: text for (_, title), text in sheets.items()}
        texts = several if len(sheets) > 1 else {path.stem: b"".join(sheets.values())}
        stated = replace(stated, delimiter="tab", decimal="point")
    tables = [table for label, text in texts.items() for table in _lay_out(label, text, stated)]
    with_frequency = [table for table in tables if {"frequency", "omega"} & set(table.setting)]
    if not with_frequency:
        raise _no_abscissa(", ".join(header.text for header in tables[0].headers))
    for table in tables:
        if table not in with_frequency:
            summary.note(f"{path.name}: sheet {table.label!r} is skipped: no column of frequency")
    return with_frequency


def _no_abscissa(names: str) -> InputError:
    return InputError(f"columns {describe_shortened(names, 80)}: no frequency", expected=_EXPECTED)


def _lay_out(label: str, data: bytes, stated: Stated) -> list[SensorTable]:
    """A text table, or that of each level if they are side by side."""
    table = open_table(data, stated.delimiter, stated.skip, stated.decimal)
    if table.layout.numbered:
        expected = "a line of names, such as frequency [Hz], force [N], tip [g], tip phase [deg]"
        raise InputError(f"{label}: the table has no header", expected=expected)
    return SensorTable(label, find_setting(table.headers, stated.columns), table).split_levels()


def _list_array_tables(path: Path, kind: str, stated: Stated, max_size: int) -> list[SensorTable]:
    """A table for each group or structure with a frequency, and for each member of an array of structures.

    Groups without a frequency have that of the top of the file.
    """
    known = read_arrays(path, kind, [], None, rows=(0, 1)).known
    wrong = next((name for name in stated.columns.values() if not _names([name]) & _names(known)), None)
    if wrong is not None:
        raise InputError(f"no array {describe_shortened(wrong)!r}", expected=describe_shortened(", ".join(known), 100))
    groups: dict[str, list[str]] = {}
    for name in known:
        groups.setdefault("/".join(split(name)[:-1]), []).append(name)
    shared = {role: groups[""][k] for role, k in _find_rows(groups.get("", []), stated).items()}
    tables = []
    for group, names in groups.items():
        rows = {role: names[k] for role, k in _find_rows(names, stated).items()}
        if group and not {"frequency", "omega"} & set(rows):
            rows = {role: name for role, name in shared.items() if role != "sweep"} | rows
        n = next((prod(known[rows[role]]) for role in ("frequency", "omega") if role in rows), 0)
        sized = [name for name in names if n > 1 and n in known[name] and prod(known[name]) <= MOST_SWEEPS * n]
        if set(sized) - set(rows.values()):
            wanted = list(dict.fromkeys([*rows.values(), *sized]))
            tables += _read_group(path, kind, wanted, group or path.stem, stated, max_size)
    if not tables:
        raise _no_abscissa(", ".join(known))
    is_named = len(tables) > 1 or find_level(tables[0].label.replace("_", " "))
    return tables if is_named else [replace(tables[0], label=path.stem)]


def _names(known: Iterable[str]) -> set[str]:
    """Names of arrays, with and without their groups."""
    return {*known, *(split(name)[-1] for name in known)}


def _find_rows(names: Sequence[str], stated: Stated) -> dict[str, int]:
    """Arrays of the roles ``SETTING`` in a group, stated ones if they are in it."""
    there = {role: split(name)[-1] for role, name in stated.columns.items() if _names([name]) & _names(names)}
    return find_setting([describe_array(name, "") for name in names], there)


def _read_group(
    path: Path, kind: str, names: Sequence[str], label: str, stated: Stated, max_size: int
) -> list[SensorTable]:
    contents = read_arrays(path, kind, names, max_size)
    names = [name for name in names if name in contents.arrays]
    headers = [describe_array(name, contents.units.get(name, "")) for name in names]
    sweeps, tables = list_members(names, contents.arrays), []
    for k, values in enumerate(sweeps, 1):
        columns = _split_sensors(list(zip(headers, values, strict=True)), _find_rows(names, stated), kind)
        table = ArrayTable(tuple(header for header, _ in columns), tuple(array for _, array in columns))
        setting = _find_rows([header.text for header in table.headers], stated)
        tables += SensorTable(label if len(sweeps) == 1 else f"{label} {k}", setting, table).split_levels()
    return tables


def _split_sensors(
    columns: Sequence[tuple[ColumnHeader, Samples]], rows: Mapping[str, int], kind: str
) -> list[tuple[ColumnHeader, Samples]]:
    """Arrays with a column for each sensor as columns ``name(:,1)``; unchanged if there is a force for each column.

    Of those with a row for each sensor ``name(1,:)``; in HDF5, as its readers count, ``name[0]``.
    """
    n = columns[next(rows[role] for role in ("frequency", "omega") if role in rows)][1].size
    per_sweep = [columns[rows[role]][1].size for role in ("force", "sweep") if role in rows]
    parts = []
    for header, values in columns:
        many = values.size // n if n and n in values.shape else 1
        if many < 2 or any(size in (many, many * n) for size in per_sweep):
            parts.append((header, values))
            continue
        across = values.shape[0] == n
        for k, part in enumerate(values.reshape(n, many).T if across else values.reshape(many, n), 1):
            row = f"[{k - 1}]" if kind == "hdf5" else f"({k},:)"
            name = f"{header.name}(:,{k})" if across else f"{header.name}{row}"
            parts.append((replace(header, text=name, name=name, title=name), part))
    return parts
