"""Levels side by side in a table: the columns of each level, such as ``0.5 g amp``, as a table of its own."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import TypeVar

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.arrays import read_arrays
from damping.formats.columns import TextTable
from damping.formats.headers import ABSCISSAS, NAMES, SCALING_WITHIN, ColumnHeader, name_scaling, parse_header
from damping.formats.quantity import find_powers, unit
from damping.formats.roles import recognise
from damping.formats.sampling import split
from damping.formats.series import Samples
from damping.records.text import describe_shortened

#: A level in a label: a number with a unit, as 0.5 g, 0,5 g or, in names of files, 0p5g.
LEVEL = re.compile(
    r"(?<![\w.,])(?:run[_ -]?)?(?:[A-Za-z]+\s*=\s*)?(\d+(?:[.,p]\d+)?)[\s_]*(mN|kN|N|lbf|g|m/s(?:\^?2|²))(?![\w/])"
)
#: Names of channels that drive.
DRIVE = re.compile(
    r"(?i)\b(control|ctrl|drive|base|input|force|shaker|reference|excitation|steuerung|steuerkanal|regelung|regelkanal"
    r"|kraft|erregung|anregung|effort|pilote|pilotage|commande)\b"
)
#: Names of numbered drive channels, such as ``force_1``.
NUMBERED = re.compile(r"(?i)(?:^|[\W_])(?:control|drive|base|input|force|shaker)[ _-]?\d+$")
_MOST_ROWS = 100_000  # of a sweep: longer arrays are histories
_MARKS = " _-@:;,|"  # beside a level


def find_level(text: str) -> tuple[float, str] | None:
    """A level and its unit in a label; None if there is none."""
    match = LEVEL.search(text)
    return (float(re.sub("[,p]", ".", match[1])), re.sub("m/s.*", "m/s^2", match[2])) if match else None


@dataclass(frozen=True)
class ArrayTable:
    """Arrays of numbers as the columns of a table, as ``columns.TextTable`` is."""

    headers: tuple[ColumnHeader, ...]
    columns: tuple[Samples, ...]  #: values of every array
    places: tuple[int, ...] = ()  #: of its columns among the arrays, if it has only some of them
    level: tuple[float, str] | None = None  #: that these are of, with its unit
    line: None = None  #: a text has that of its header
    remarks: tuple[str, ...] = ()  #: a text has lines above its header

    def read(self, places: Mapping[str, int]) -> tuple[dict[str, Samples], tuple[str, ...] | None]:
        """Columns by role, and the text of the role ``sweep`` in each row; None if it has no place, or one number."""
        of_file = self.places or range(len(self.headers))
        values = {role: self.columns[of_file[place]] for role, place in places.items()}
        sweep = values.pop("sweep", np.empty(0)).real.reshape(-1)
        is_of_rows = len(sweep) == max((values[role].size for role in ABSCISSAS if role in values), default=0)
        return values, tuple(f"{value:g}" for value in sweep) if is_of_rows and len(sweep) else None


AnyTable = TypeVar("AnyTable", bound=TextTable | ArrayTable)


def read_levels(path: str | Path, kind: str, max_size: int) -> list[ArrayTable]:
    """Levels side by side in a file of arrays, a table each; none if the names of its arrays hold none.

    Each has every array that is as long as those of the levels, a complex one as its parts, which are called re and im
    alone if a level has no other. InputError: as of ``read_arrays`` and `find_levels`.
    """
    contents = read_arrays(path, kind, [], None, rows=(0, 1))
    known, steps = contents.known, contents.steps
    lengths = {prod(known[name]) for name in known if find_level(_space(split(name)[-1]))}
    names = [name for name, shape in known.items() if {prod(shape)} == lengths and name not in steps]
    if all(find_level(_space(split(name)[-1])) for name in names) or max(lengths) > _MOST_ROWS:  # no frequency
        return []
    contents = read_arrays(path, kind, names, max_size)
    arrays = {name: contents.arrays[name][0].reshape(-1) for name in names if name in contents.arrays}
    levels = [find_level(_space(split(name)[-1])) for name, values in arrays.items() if np.iscomplexobj(values)]
    columns: dict[str, FloatArray] = {}
    for name, values in arrays.items():
        leaf, unit_text = split(name)[-1], f" [{contents.units[name]}]" if name in contents.units else ""
        if np.iscomplexobj(values):
            level = find_level(_space(leaf))
            title = f"{level[0]:g} {level[1]}" if level and levels.count(level) == 1 else leaf
            columns |= {f"{title} re{unit_text}": values.real, f"{title} im{unit_text}": values.imag}
        else:
            columns[f"{leaf}{unit_text}"] = values
    return split_levels(ArrayTable(tuple(map(parse_header, columns)), tuple(columns.values())))


def split_levels(table: AnyTable) -> list[AnyTable]:
    """A table for each level as of `find_levels`, its headers without it. InputError: as there."""
    by_level = find_levels(table.headers, table.line)
    return [
        replace(table, headers=tuple(of[k] for k in sorted(of)), places=tuple(sorted(of)), level=level)
        for level, of in by_level.items()
    ]


def find_levels(headers: Sequence[ColumnHeader], line: int | None) -> dict[tuple[float, str], dict[int, ColumnHeader]]:
    """Columns by place, with headers without the level, of each level that the names of columns hold.

    None unless two levels or more have the same columns, or if a drive of another kind has a column, as beside sensors
    called by their range. ``line``: of the headers in a text.

    InputError: a drive of that kind has a column, levels are of several kinds, or one is not a peak value.
    """
    found = {k: (header, level) for k, header in enumerate(headers) if (level := find_level(_space(header.name)))}
    by_level: dict[tuple[float, str], dict[int, ColumnHeader]] = {}
    for k, (header, level) in found.items():
        by_level.setdefault(level, {})[k] = _drop_level(header)
    columns = [sorted((header.title, header.unit) for header in of.values()) for of in by_level.values()]
    if len(by_level) < 2 or any(of != columns[0] for of in columns):
        return {}
    shared = {k: header for k, header in enumerate(headers) if k not in found}
    powers = {unit(text).powers for _, text in by_level}
    force = recognise([*shared.values()]).places.get("force")
    drives = [
        header
        for k, header in enumerate(shared.values())
        if k == force or any(of.search(header.name) for of in (DRIVE, NUMBERED)) or find_powers(header.unit) in powers
    ]
    if any(header.unit and find_powers(header.unit) not in powers for header in drives):
        return {}
    if drives or len(powers) > 1:
        beside = f"{describe_shortened(drives[0].text)!r} beside levels" if drives else "forces and motions as levels"
        expected = "one kind of level, and no other drive"
        raise InputError(f"{beside} in the names of columns", line=line, expected=expected)
    _require_peak([header.text for header, _ in found.values()], line)
    return {level: shared | of for level, of in by_level.items()}


def _space(name: str) -> str:
    return name.replace("_", " ")


def _drop_level(header: ColumnHeader) -> ColumnHeader:
    """The header without its level; called amplitude or phase if nothing else is left of its name."""
    parts = [part.strip(_MARKS) for part in LEVEL.split(_space(header.name), 1)[:: LEVEL.groups + 1]]
    name = " ".join(filter(None, parts)).strip("()[] ")
    if not name or name.lower() in NAMES["part"]["amplitude"]:
        name = "phase" if header.angle else "amplitude"
    scaling = f" {header.scaling}" if header.scaling and not SCALING_WITHIN.search(name) else ""
    own = parse_header(f"{name} [{header.unit}{scaling}]" if header.unit else f"{name}{scaling}")
    return replace(own, text=header.text) if own.text == "phase" else own  # that alone is a lag in rad, as in a record


def find_level_scaling(text: str) -> str | None:
    """The scaling that stands behind the level in a text, as of 0.5 g rms; None if none does."""
    match = LEVEL.search(text)
    return name_scaling(SCALING_WITHIN.match(text[match.end() :].lstrip(_MARKS))) if match else None


def _require_peak(texts: list[str], line: int | None) -> None:
    """Raise InputError for a level such as 0.5 g rms: the word may be of the drive or of the response."""
    for text in texts:
        if find_level_scaling(_space(text)) in ("rms", "peak-to-peak"):
            what = f"{describe_shortened(text)!r}: is the level {find_level_scaling(_space(text))}, or the response?"
            raise InputError(what, line=line, expected="peak levels, and of a response amp [mm rms]")
