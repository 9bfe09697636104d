"""Files of laboratories to records: UFF data set 58, MAT, HDF5, CSV with a column map, lock-in columns.

Input is bytes or a path; output is a record and a summary of what was understood. Every module is pure; none evaluates
file content or loads a pickle. ``read_file`` (here) reads any file into ``series.Series``, one sweep or time history
each with the facts that the file states. ``steady.steady_record`` converts sweeps to a record, and
``motions.time_histories`` converts time histories to displacement for ``signals.ringdown``. An error asks for facts
that neither the file nor the user states; nothing is guessed.
"""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError, naming
from damping.formats.array_series import list_array_series, list_channels
from damping.formats.cells import DECIMALS, DELIMITERS
from damping.formats.columns import Layout, TextTable, open_table
from damping.formats.conversion import RESPONSES, SCALINGS
from damping.formats.headers import ABSCISSAS, NAMES, ROLES, ColumnHeader
from damping.formats.levels import ArrayTable, read_levels, split_levels
from damping.formats.named import find_scaling, note_unheeded_units, read_facts, require_linear, to_series
from damping.formats.quantity import SYSTEMS
from damping.formats.roles import find_roles
from damping.formats.sampling import find_rows
from damping.formats.series import Series, Stated, Summary, require_no_force, require_response
from damping.formats.sweeps import join_refined
from damping.formats.uff import read_uff
from damping.formats.wave import read_wav
from damping.formats.workbook import is_workbook, read_workbook
from damping.records.text import DEFAULT_MAX_SIZE, describe_meant, describe_shortened, is_binary, read_bytes, read_start

FORMATS = ("auto", "uff", "mat", "hdf5", "tdms", "lvm", "wav", "xlsx", "csv", "lock-in")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_LOOKED_AT = 2100  # first bytes of a file, by which its format is known
_ARRAYS = ("mat5", "mat73", "hdf5", "tdms", "lvm")
#: In-phase and quadrature readings, and the redundant magnitude and angle.
_TWICE = {("x", "y"): ("amplitude", "lead_deg"), ("force_x", "force_y"): ("force", "force_lead_deg")}
_FIRST = 1000  # samples by which the times of a signal are known
_ENDLESS = 2**53  # samples of a file of unknown length


def read_file(path: str | Path, stated: Stated, *, max_size: int = DEFAULT_MAX_SIZE) -> tuple[list[Series], Summary]:
    """The series of a file, and a summary of how it was understood.

    InputError: a file that cannot be read, is larger than ``max_size`` bytes or broken, a statement that is not
    understood, or a fact that neither the file nor the user states.
    """
    check(stated)
    summary = Summary()
    with naming(path):
        series = _list_series(path, stated, summary, max_size)
    is_named = stated.labels or stated.forces  # one for each sweep
    return series if is_named else join_refined([series], summary)[0], summary


def _list_series(path: str | Path, stated: Stated, summary: Summary, max_size: int) -> list[Series]:
    kind = find_format(path, stated, summary)
    _heeded(stated, kind)
    if kind in _ARRAYS:
        own = Summary()
        try:
            series = _list_part_series(path, kind, stated, own, max_size)
        except InputError:
            if not (levels := read_levels(path, kind, max_size)):
                raise
            return [one for level in levels for one in _list_table_series(level, path, "csv", stated, summary)]
        summary.extend(own)
        return series
    data = read_bytes(path, max_size)
    if kind == "uff":
        return read_uff(data, summary, stated.datasets, stated.labels)
    if kind == "wav":
        return list_channels(read_wav(data, stated), stated, summary)
    if kind == "xlsx":
        data, kind = read_workbook(data, max_size, stated.datasets, stated.decimal), "csv"
        stated = replace(stated, delimiter="tab", decimal="point")
    table = open_table(data, stated.delimiter, stated.skip, stated.decimal)
    tables = split_levels(table) or [table]
    return [series for level in tables for series in _list_table_series(level, path, kind, stated, summary)]


def _list_part_series(path: str | Path, kind: str, stated: Stated, summary: Summary, max_size: int) -> list[Series]:
    """Series of a file of arrays, cut to ``stated.span`` if its first samples tell where that is; else whole.

    A part is read without the rest of the file in memory.
    """
    if stated.span is not None:
        with suppress(InputError):  # such as a part beyond the end: the whole says what is wrong
            own, first = Summary(), list_array_series(path, kind, stated, Summary(), max_size, (0, _FIRST))
            parts = {_find_part(row, stated.span) for row in first}
            rows = parts.pop() if len(parts) == 1 else None
            series = list_array_series(path, kind, stated, own, max_size, rows) if rows else []
            if rows and all(_holds(row.abscissa, rows, stated.span) for row in series):
                summary.extend(own)
                return series
    return list_array_series(path, kind, stated, summary, max_size)


def _find_part(row: Series, span: tuple[float, float]) -> tuple[int, int] | None:
    """First sample and end of a span of an even motion, by its first samples; None beside a force: all is needed."""
    t = row.abscissa
    if not row.is_time or row.force is not None or len(t) < 2 or not t[-1] > t[0]:
        return None
    return find_rows(span, float(t[0]), float(t[-1] - t[0]) / (len(t) - 1), _ENDLESS)


def _holds(t: FloatArray, rows: tuple[int, int], span: tuple[float, float]) -> bool:
    """Whether times (n,), of the samples ``rows``, reach over a span, or to the ends of the file."""
    to_end = len(t) < rows[1] - rows[0]
    return len(t) > 1 and bool((rows[0] == 0 or t[0] <= span[0]) and (to_end or t[-1] >= span[1]))


def _list_table_series(
    table: TextTable | ArrayTable, path: str | Path, kind: str, stated: Stated, summary: Summary
) -> list[Series]:
    known = NAMES["amplifier" if kind == "lock-in" else "own"]
    roles = find_roles(table.headers, stated.columns, known, table.line)
    places, response = roles.places, roles.response
    numbers, labels = table.read(places)
    headers = {role: table.headers[place] for role, place in places.items()}
    require_linear(headers)
    _require_reference(places, table.headers, numbers, stated)
    if isinstance(table, TextTable) and "auto" in (stated.delimiter, stated.decimal):
        summary.add("table", _describe_layout(table.layout, stated.skip), "found in the file")
    if not stated.columns and kind != "csv":
        for parts, twice in _TWICE.items():
            if set(parts) <= set(numbers):
                numbers = {role: values for role, values in numbers.items() if role not in twice}
    _summarise_columns(table, {role: k for role, k in places.items() if role in (*numbers, "sweep")}, stated, summary)
    if stated.rate is not None:
        if set(ABSCISSAS) & set(numbers):
            raise InputError("--rate beside a column of times or frequencies", expected="one of them")
        numbers["time"] = np.arange(len(next(iter(numbers.values())))) / stated.rate
    headers = {role: header for role, header in headers.items() if role in numbers}
    if stated.rate is not None and "amplitude" not in stated.columns and "amplitude" in numbers:  # a signal
        numbers["response"], headers["response"] = numbers.pop("amplitude"), headers.pop("amplitude")
    if kind == "csv":
        texts = {role: header.text for role, header in headers.items()}
        is_time = "time" in texts and not {"frequency", "omega"} & set(texts)
        require_response(texts, [header.text for header in table.headers], stated, many=is_time)
    scaling, force_scaling = (find_scaling(headers, quantity) for quantity in ("response", "force"))
    silent = {"response": scaling is None, "force": force_scaling is None and scaling not in (None, "peak")}
    label = Path(path).stem
    if table.level is not None:
        level, unit = table.level
        label = f"{level:g} {unit}"
        if not {"force", "force_x"} & set(numbers):
            headers["force"] = ColumnHeader("force", "force", unit)
            numbers["force"] = np.full(len(next(iter(numbers.values()))), level)
            summary.note("caution: the level in the names of columns is taken as the drive in every row")
    if not {"force", "force_x"} & set(numbers) and not stated.forces and {"frequency", "omega"} & set(numbers):
        require_no_force([header for k, header in enumerate(table.headers) if k not in places.values()])
    note_unheeded_units(numbers, stated, summary)
    facts = replace(
        read_facts(headers, stated),
        response=response or None,
        scaling=scaling,
        peak_assumed=[what for what, says_nothing in silent.items() if says_nothing and response is not None],
        force_scaling=force_scaling,
        remarks=(*table.remarks, *(header.text for header in table.headers)),
    )
    return to_series(numbers, labels, facts, label, summary, peak=kind == "csv")


def _require_reference(
    places: Mapping[str, int], headers: Sequence[ColumnHeader], numbers: Mapping[str, FloatArray], stated: Stated
) -> None:
    """Raise InputError if a bare ``Phase`` beside ``Force phase`` may be against the force or its reference."""
    if "force_angle" in stated.columns or not np.any(numbers.get("force_angle", 0.0)):
        return
    phase, of_force = headers[places["angle"]], headers[places["force_angle"]].text
    if phase.name.lower() == "phase":
        message = f"is {phase.text!r} against the force, or against the reference of {of_force!r}?"
        expected = "--column amplitude=NAME --column angle=NAME, in the second case --column force_angle=NAME too"
        raise InputError(message, expected=expected)


def _summarise_columns(
    table: TextTable | ArrayTable, places: Mapping[str, int], stated: Stated, summary: Summary
) -> None:
    """Add a row for each column that has a role, and one for all others."""
    for role, place in places.items():
        source = "stated" if role in stated.columns else "by its name"
        summary.add(f"column {describe_shortened(table.headers[place].text)!r}", f"{role}: {ROLES[role]}", source)
    others = [repr(header.text) for k, header in enumerate(table.headers) if header.text and k not in places.values()]
    if others:
        summary.add("columns not read", describe_shortened(", ".join(others), 100), "no known name (--column)")


def _describe_layout(layout: Layout, skip: int) -> str:
    line = skip + layout.header - layout.units
    by = "columns by number" if layout.numbered else "columns by name"
    header = "no header" if layout.numbered else "" if layout.comments or line == 1 else f"header in line {line}"
    parts = (f"{layout.delimiter} between cells", f"decimal {layout.decimal}", header, by)
    units = "units below the names" if layout.units else ""
    encoding = f"text in {layout.encoding}" if layout.encoding else ""
    return ", ".join(part for part in (*parts, units, encoding) if part)


def check(stated: Stated) -> None:
    """Raise InputError for an invalid statement; it lists the valid values."""
    if stated.decimal == stated.delimiter == "comma":
        raise InputError("--decimal comma beside --delimiter comma", expected="another delimiter, such as semicolon")
    given: list[tuple[str, str | None, Collection[str]]] = [
        ("--format", stated.format, FORMATS),
        ("--response", stated.response, RESPONSES),
        ("--scaling", stated.scaling, SCALINGS),
        ("--to", stated.system, SYSTEMS),
        ("--scaling force", stated.force_scaling, SCALINGS),
        ("--delimiter", stated.delimiter, ("auto", *DELIMITERS)),
        ("--decimal", stated.decimal, ("auto", *DECIMALS)),
        *(("--column", role, ROLES) for role in stated.columns),
        *(("--unit", what, ("force", "response", "energy", "mass", "sweep_rate", *ABSCISSAS)) for what in stated.units),
        *(("--scale", what, ("force", "response")) for what in stated.scale),
    ]
    for option, value, known in given:
        if value is not None and value not in known:
            message = f"{option} {describe_shortened(value)!r} is unknown{describe_meant(value, known)}"
            raise InputError(message, expected=", ".join(known))
    if stated.rate is not None and not 0.0 < stated.rate < float("inf"):
        raise InputError("--rate is no sampling rate", expected="a number of Hz > 0")
    if stated.rate is not None and "time" in stated.units:
        raise InputError("--unit time beside --rate, which gives times in s", expected="one of them")
    if stated.band is not None and not 0.0 <= stated.band[0] < stated.band[1]:
        raise InputError("--band is no band", expected="LO:HI in Hz with 0 <= LO < HI")
    if stated.consistent and stated.units:
        raise InputError("--consistent beside --unit", expected="one of them")


def _heeded(stated: Stated, kind: str) -> None:
    """Raise InputError for a statement that has no effect on a file of this kind."""
    layout = {"skip": "--skip", "delimiter": "--delimiter", "decimal": "--decimal"}
    if kind == "uff":
        unheeded = {"columns": "--column", "rate": "--rate"} | layout
    else:
        unheeded = {"datasets": "--dataset"} | (layout if kind in (*_ARRAYS, "wav") else {})
    if kind == "xlsx":  # a data set is a sheet
        unheeded = {"delimiter": "--delimiter"}
    for name, option in unheeded.items():
        if getattr(stated, name) != getattr(Stated(), name):
            raise InputError(f"{option} means nothing in a file of format {kind}", expected=f"no {option}")


def detect_format(path: str | Path) -> str:
    """The format by the first bytes of a file: as of `find_format`, ``csv`` of one that is none of the others."""
    start = read_start(path, _LOOKED_AT)
    first = next((line.strip() for line in start.replace(b"\r", b"\n").split(b"\n") if line.strip()), b"")
    is_hdf = any(start.startswith(_HDF5, place) for place in (0, 512, 1024, 2048))
    begins = {
        "mat5": start.startswith(b"MATLAB 5.0"),
        "mat73": is_hdf and start.startswith(b"MATLAB 7.3"),
        "hdf5": is_hdf,
        "uff": first == b"-1",
        "tdms": start.startswith(b"TDSm"),
        "wav": start[:4] in (b"RIFF", b"RF64") and start[8:12] == b"WAVE",
        "xlsx": start.startswith(b"PK\x03\x04") and is_workbook(path),
        "lvm": first.startswith(b"LabVIEW Measurement"),
    }
    return next((kind for kind, is_it in begins.items() if is_it), "csv")


def find_format(path: str | Path, stated: Stated, summary: Summary) -> str:
    """``uff``, ``mat5``, ``mat73``, ``hdf5``, ``tdms``, ``lvm``, ``wav``, ``xlsx``, ``csv`` or ``lock-in``."""
    text = detect_format(path)
    text = "mat73" if (stated.format, text) == ("mat", "hdf5") else text
    if stated.format == "auto" and text == "csv" and is_binary(read_start(path, _LOOKED_AT)):
        expected = "a file of one of these, WAV or XLSX, unpacked (save MAT of version 4 again with -v7, XLS as XLSX)"
        raise InputError("neither UFF, MAT 5 to 7.3, HDF5, TDMS, LVM nor text", expected=expected)
    if stated.format == "mat" and text not in ("mat5", "mat73"):
        raise InputError("not a MAT file", expected="a MAT file of version 5 to 7.3")
    kind = text if stated.format in ("auto", "mat") else stated.format
    summary.add("format", NAMES["title"][kind], "found in the file" if stated.format == "auto" else "stated")
    return kind
