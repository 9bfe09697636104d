"""Any file of a laboratory to series: the format by its first bytes or as stated."""

from __future__ import annotations

import codecs
import os
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from damping.errors import InputError
from damping.formats.arrays import Array, Arrays, read_arrays
from damping.formats.columns import read_columns
from damping.formats.headers import ABSCISSAS, parse_header
from damping.formats.layout import DECIMALS, DELIMITERS
from damping.formats.named import COLUMNS as LOCKIN_COLUMNS
from damping.formats.named import ROLES, Said, once, to_series
from damping.formats.quantity import SYSTEMS, unit
from damping.formats.series import RESPONSES, SCALINGS, Found, Series, Stated, Summary
from damping.formats.uff import read_uff
from damping.records.keys import describe_nearest
from damping.records.text import DEFAULT_MAX_SIZE, describe_shortened, read_bytes

FORMATS = ("auto", "uff", "mat", "hdf5", "tdms", "lvm", "csv", "lock-in")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_ARRAYS = ("mat5", "mat73", "hdf5", "tdms", "lvm")
_CONTROLS = bytes(set(range(32)) - set(b"\t\n\v\f\r"))
#: Names of columns and arrays by role where no map is stated: the role itself, and the parts of a complex number.
_OWN_NAMES: dict[str, tuple[str, ...]] = {role: (role,) for role in ROLES} | {
    "x": ("x", "real", "re"),
    "y": ("y", "imag", "im"),
}
#: What the unit in the header of a role's column belongs to.
_UNIT_OF = (
    dict.fromkeys(("force", "force_x", "force_y"), "force")
    | dict.fromkeys(("response", "x", "y", "amplitude"), "response")
    | {role: role for role in ("energy", "mass", *ABSCISSAS)}
)


def read_file(path: str | Path, stated: Stated, *, max_size: int = DEFAULT_MAX_SIZE) -> tuple[list[Series], Summary]:
    """The series of a file, and what was understood so far.

    Raises:
        InputError: a file that cannot be read, is larger than ``max_size`` bytes or broken, a statement that is not
            understood, or something that neither the file nor the user says.
    """
    check(stated)
    summary = Summary()
    kind = _format(path, stated, summary)
    _heeded(stated, kind, path)
    if kind in _ARRAYS:
        return _list_arrays(path, kind, stated, summary, max_size), summary
    data = read_bytes(path, max_size)
    if kind == "uff":
        return read_uff(data, path, summary, stated.datasets, stated.labels), summary
    known = LOCKIN_COLUMNS if kind == "lock-in" else _OWN_NAMES
    found = read_columns(data, path, stated.columns, known, stated.delimiter, stated.skip, stated.decimal)
    if "auto" in (stated.delimiter, stated.decimal):
        by = "no header, columns by number" if found.layout.numbered else "columns by name"
        layout = f"{found.layout.delimiter} between cells, decimal {found.layout.decimal}, {by}"
        summary.add("table", layout, "found in the file")
    numbers = found.numbers if stated.columns or kind == "csv" else once(found.numbers)
    for role, header in found.headers.items():
        if role in numbers or role == "sweep":
            whence = "stated" if role in stated.columns else "by its name"
            summary.add(f"column {describe_shortened(header.text)!r}", f"{role}: {ROLES[role]}", whence)
    headers = {role: header for role, header in found.headers.items() if role in numbers}
    if kind == "csv":
        _require_response({role: header.text for role, header in headers.items()}, found.layout.names, stated, path)
    said = Said(
        units=_units({role: header.unit for role, header in headers.items() if header.unit}, stated),
        response=found.response,
        scaling=next(
            (h.scaling for role, h in headers.items() if _UNIT_OF.get(role) == "response" and h.scaling), None
        ),
        force_scaling=next((h.scaling for role, h in headers.items() if role.startswith("force") and h.scaling), None),
        degrees=tuple(role for role, header in headers.items() if header.angle == "degrees"),
    )
    return to_series(numbers, found.sweep, said, path, Path(path).stem, summary, peak=kind == "csv"), summary


#: Names of a column beside x and y that make them readings of an amplifier.
_MODULI = {"r", "mag", "magnitude", "theta"}
_MOTIONS = ("response", "x", "y", "amplitude")


def _require_response(of_role: Mapping[str, str], names: Iterable[str], stated: Stated, path: str | Path) -> None:
    """InputError where no column is the response, or a real one would be half of a complex one that nobody said."""
    own = {parse_header(name.strip()).name.lower() for name in names}
    if not set(_MOTIONS) & set(of_role):
        free = [name.strip() for name in names if name.strip() and name not in of_role.values()]
        unit_too = "" if any(parse_header(name).unit for name in free) else " --unit response=UNIT"
        raise InputError(
            f"which column is the response? {describe_shortened(', '.join(free), 80)}",
            file=path,
            expected=f"--column response=NAME (of complex numbers x=NAME and y=NAME){unit_too}; damping campaign for all",
        )
    halves = {role: of_role.get(role, "") for role in ("x", "y")}
    guessed = not set(halves) & set(stated.columns) and parse_header(halves["x"]).name.lower() == "x"
    if guessed and not own & _MODULI:
        raise InputError(
            "are x and y the parts of one complex response, or two motions?",
            file=path,
            expected="--column x=x --column y=y for parts, --column amplitude=x for a motion",
        )


def _units(of_roles: Mapping[str, str], stated: Stated) -> dict[str, str]:
    """The first unit of each quantity that the columns or arrays of some roles name; of an abscissa the stated one."""
    units = {role: text for role, text in stated.units.items() if role in ABSCISSAS}
    for role, text in of_roles.items():
        if role in _UNIT_OF:
            units.setdefault(_UNIT_OF[role], text)
    return units


def check(stated: Stated) -> None:
    """InputError for a statement that is not understood, naming what is."""
    _one_of("--format", stated.format, FORMATS)
    _one_of("--response", stated.response, RESPONSES)
    _one_of("--scaling", stated.scaling, SCALINGS)
    _one_of("--to", stated.system, SYSTEMS)
    _one_of("--scaling force", stated.force_scaling, SCALINGS)
    _one_of("--delimiter", stated.delimiter, ("auto", *DELIMITERS))
    _one_of("--decimal", stated.decimal, ("auto", *DECIMALS))
    if stated.decimal == stated.delimiter == "comma":
        raise InputError("--decimal comma beside --delimiter comma", expected="another delimiter, such as semicolon")
    for option, known, given in (
        ("--column", tuple(ROLES), stated.columns),
        ("--unit", ("force", "response", "energy", "mass", *ABSCISSAS), stated.units),
        ("--scale", ("force", "response"), stated.scale),
    ):
        for key in given:
            _one_of(option, key, known)
    if stated.band is not None and not 0.0 <= stated.band[0] < stated.band[1]:
        raise InputError("--band is no band", expected="LO:HI in Hz with 0 <= LO < HI")
    if stated.consistent and stated.units:
        raise InputError("--consistent beside --unit", expected="one of them")


def _heeded(stated: Stated, kind: str, path: str | Path) -> None:
    """InputError for a statement that nothing in a file of this kind would heed."""
    layout = {"skip": "--skip", "delimiter": "--delimiter", "decimal": "--decimal"}
    if kind == "uff":
        unheeded = {"columns": "--column"} | layout
    else:
        unheeded = {"datasets": "--dataset"} | (layout if kind in _ARRAYS else {})
    for name, option in unheeded.items():
        if getattr(stated, name) != getattr(Stated(), name):
            raise InputError(f"{option} means nothing in a file of format {kind}", file=path, expected=f"no {option}")


def _one_of(option: str, value: str | None, known: Mapping[str, object] | tuple[str, ...]) -> None:
    if value is not None and value not in known:
        alike = describe_nearest(value, known, likeness=0.5)
        hint = f" (is {alike!r} meant?)" if alike else ""
        raise InputError(f"{option} {describe_shortened(value)!r} is unknown{hint}", expected=", ".join(known))


def _format(path: str | Path, stated: Stated, summary: Summary) -> str:
    """``uff``, ``mat5``, ``mat73``, ``hdf5``, ``tdms``, ``lvm``, ``csv`` or ``lock-in``."""
    start = _start(path)
    hdf = any(start[place : place + len(_HDF5)] == _HDF5 for place in (0, 512, 1024, 2048))
    first = next((line.strip() for line in start.replace(b"\r", b"\n").split(b"\n") if line.strip()), b"")
    if start.startswith(b"MATLAB 5.0"):
        found = "mat5"
    elif hdf:
        found = "mat73" if start.startswith(b"MATLAB 7.3") or stated.format == "mat" else "hdf5"
    elif first == b"-1":
        found = "uff"
    elif start.startswith(b"TDSm"):
        found = "tdms"
    elif first.startswith(b"LabVIEW Measurement"):
        found = "lvm"
    else:
        found = "csv"
    if stated.format == "auto":
        if found == "csv" and _is_binary(start):
            raise InputError(
                "neither UFF, MAT 5 to 7.3, HDF5, TDMS, LVM nor text",
                file=path,
                expected="a file of one of these (save a MAT file of version 4 again with -v7)",
            )
        summary.add("format", _TITLES[found], "found in the file")
        return found
    if stated.format == "mat" and found not in ("mat5", "mat73"):
        raise InputError("not a MAT file", file=path, expected="a MAT file of version 5 to 7.3")
    if stated.format == "hdf5":
        found = "hdf5"
    kind = found if stated.format == "mat" else stated.format
    summary.add("format", _TITLES[kind], "stated")
    return kind


def _is_binary(start: bytes) -> bool:
    """Whether these are no lines of text, of whatever encoding: one byte in twenty is a control character."""
    controls = len(start) - len(start.translate(None, _CONTROLS))
    return not start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and 20 * controls > len(start)


_TITLES = {
    "uff": "universal file (UFF, UNV)",
    "mat5": "MAT file, version 5",
    "mat73": "MAT file, version 7.3",
    "hdf5": "HDF5",
    "tdms": "TDMS of National Instruments",
    "lvm": "LabVIEW measurement file",
    "csv": "CSV",
    "lock-in": "readings of a lock-in amplifier",
}


def _start(path: str | Path) -> bytes:
    """The first bytes of a file."""
    try:
        if stat.S_ISREG(os.stat(path).st_mode):
            with Path(path).open("rb") as stream:
                return stream.read(2100)
    except FileNotFoundError:
        raise InputError("no such file", file=path) from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise InputError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=path) from None
    raise InputError("is no regular file", file=path, expected="a file")


def _list_arrays(path: str | Path, kind: str, stated: Stated, summary: Summary, max_size: int) -> list[Series]:
    """Series of a file of named arrays or channels."""
    channels = kind in ("tdms", "lvm")
    own = [name for names in _OWN_NAMES.values() for name in names]
    wanted = [] if channels else list(stated.columns.values()) or own
    found = read_arrays(path, kind, wanted, max_size)
    if channels or not found.arrays:
        everything = found if channels else read_arrays(path, kind, [], max_size) if kind == "hdf5" else found
        if everything.steps or channels:
            return _list_channels(everything, stated, path, summary)
    arrays, known = found.arrays, found.known
    names = dict(stated.columns)
    if stated.columns:
        missing = next((name for name in wanted if name not in arrays), None)
        if missing is not None:
            raise InputError(f"no array {describe_shortened(missing)!r}", file=path, expected=_has(known))
        names = _with_setting(names, known)
        if len(names) > len(stated.columns):
            arrays = arrays | read_arrays(path, kind, list(names.values()), max_size).arrays
    else:
        names = {role: name for role, own in _OWN_NAMES.items() for name in own if name in arrays}
        if not names:
            groups = "damping campaign (a group a run), or " if any("/" in name for name in known) else ""
            raise InputError(
                "no array has the name of a role",
                file=path,
                expected=f"{groups}--column ROLE=NAME; it has {_has(known)}",
            )
    _require_response(names, known, stated, path)
    for role, name in names.items():
        shape = " x ".join(str(n) for n in arrays[name][0].shape) or "1"
        many = f"{len(arrays[name])} of " if len(arrays[name]) > 1 else ""
        whence = "stated" if role in stated.columns else "by its name"
        summary.add(f"array {describe_shortened(name)!r}", f"{role}: {ROLES[role]} ({many}{shape})", whence)
    said = Said(units=_units({role: found.units[name] for role, name in names.items() if name in found.units}, stated))
    return _list_each(names, arrays, said, path, summary)


def _with_setting(names: dict[str, str], known: Mapping[str, tuple[int, ...]]) -> dict[str, str]:
    """The roles with the abscissa that the file has by its own name, where none is stated."""
    abscissas = ("frequency", "omega", "time")
    if set(abscissas) & set(names):
        return names
    return names | {role: role for role in abscissas if known.get(role)}


def _list_each(
    names: Mapping[str, str],
    arrays: Mapping[str, list[Array]],
    said: Said,
    path: str | Path,
    summary: Summary,
) -> list[Series]:
    """Series of arrays of which a role may have several, one a sweep; a role with one has it for all."""
    count = max(len(arrays[name]) for name in names.values())
    odd = next((role for role, name in names.items() if len(arrays[name]) not in (1, count)), None)
    if odd is not None:
        number = len(arrays[names[odd]])
        raise InputError(f"{number} arrays of {odd} beside {count} of others", file=path, expected=f"1 or {count}")
    stem, series = Path(path).stem, []
    for k in range(count):
        of_role = {role: arrays[name][min(k, len(arrays[name]) - 1)] for role, name in names.items()}
        label = stem if count == 1 else f"{stem} {k + 1}"
        labels = None
        if "sweep" in of_role:
            labels = [f"{value:g}" for value in of_role.pop("sweep").real.reshape(-1)]
        series += to_series(of_role, labels, said, path, label, summary, peak=True)
    return series


def _list_channels(found: Arrays, stated: Stated, path: str | Path, summary: Summary) -> list[Series]:
    """Time histories of a file that says the time step of each of its channels."""
    unheeded = next((role for role in stated.columns if role != "response"), None)
    if unheeded:
        raise InputError(f"--column {unheeded} of a file of channels", file=path, expected="--column response=NAME")
    asked = stated.columns.get("response")
    names = [name for name in found.arrays if asked in (None, name) or name.split("/")[-1] == asked]
    if not names:
        raise InputError(f"no channel {describe_shortened(asked or '')!r}", file=path, expected=_has(found.known))
    for name in names:
        if name not in found.steps:
            raise InputError(f"channel {name!r} has no time step", file=path, expected="a file with its time step")
        summary.add(
            f"channel {describe_shortened(name)!r}",
            f"{found.arrays[name][0].size} samples, step {found.steps[name][1]:g} s",
            "found in the file",
        )
    kinds = {unit(found.units[name]).powers for name in names if name in found.units} if not stated.units else set()
    if len(kinds) > 1:
        listed = ", ".join(f"{name} ({found.units.get(name, 'no unit')})" for name in names[:8])
        raise InputError(f"channels of several kinds: {listed}", file=path, expected="--column response=NAME")
    series = []
    for name in names:
        start, step = found.steps[name]
        values = np.asarray(found.arrays[name][0], dtype=np.float64).reshape(-1)
        said = Found(units={"response": found.units[name]} if name in found.units else {})
        t = np.asarray(start + step * np.arange(len(values)), dtype=np.float64)
        series.append(Series(name, t, values, is_time=True, has_phase=False, found=said))
    return series


def _has(known: Mapping[str, tuple[int, ...]]) -> str:
    listed = ", ".join(f"{name} ({' x '.join(map(str, shape)) or '1'})" for name, shape in list(known.items())[:12])
    return listed or "arrays of numbers"
