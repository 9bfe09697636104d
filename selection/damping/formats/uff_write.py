"""A record as a universal file: for each sweep its receptance (type 4) and its force amplitude (spectrum, type 12).

Values as bytes (58b) keep every digit; as text, 13 digits of the ordinate and 6 of the abscissa, as the format has
it. The fourth ID line says that amplitudes are peak values, which the format has no field for; reading knows it.
"""

from __future__ import annotations

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.formats.series import Samples
from damping.records.keys import OPTIONAL_COLUMNS, REQUIRED_COLUMNS
from damping.records.record import Record

#: Fourth ID line of a set whose amplitudes are those of the sine.
PEAK = "peak amplitudes"
#: Data types of data set 58: abscissa, numerator and denominator.
_FREQUENCY = 18
_DISPLACEMENT = 8
_FORCE = 13
_END = b"    -1\n"


def uff(record: Record, length: str, force: str, *, binary: bool) -> tuple[bytes, list[str]]:
    """The universal file of a record, and notes on what it does not hold.

    Args:
        record: with phases, or with sweeps of one row, which is at phase resonance.
        length, force: labels of the units, up to 18 characters; '' where none is named.
        binary: values as bytes.

    Raises:
        AnalysisError: a sweep of several rows without phases.
    """
    notes = [f"column {name} is not in the universal file" for name in _list_left_out(record)]
    sets = []
    for label in record.sweeps:
        sweep = record.of(label)
        f, F = sweep.column("frequency"), sweep.column("force")
        receptance = sweep.column("amplitude") / F * np.exp(-1j * _lag(sweep, label))
        title = " ".join(label.split())
        if len(title.encode()) > 80 or title != label:
            notes.append(f"label {label!r} is shortened")
            title = title.encode()[:80].decode(errors="ignore")
        ratio = (_describe_axis(_DISPLACEMENT, "Displacement", length), _describe_axis(_FORCE, "Force", force))
        sets.append(_set(title, 4, f, receptance, ratio, binary))
        sets.append(
            _set(title, 12, f, F, (_describe_axis(_FORCE, "Force", force), _describe_axis(0, "NONE", "")), binary)
        )
    return b"".join(sets), notes


def _list_left_out(record: Record) -> list[str]:
    kept = (*REQUIRED_COLUMNS, "phase")
    return [name for name in record.table.columns if name not in kept and name in (*OPTIONAL_COLUMNS, *record.table)]


def _lag(record: Record, label: str) -> FloatArray:
    if record.has_phase:
        return record.column("phase")
    if len(record) > 1:
        raise AnalysisError(f"sweep {label!r} has no phases, and a frequency response is not complete without them")
    return np.full(1, 0.5 * np.pi)


def _describe_axis(code: int, label: str, unit: str) -> str:
    return f"{code:10d}{0:5d}{0:5d}{0:5d} {label:<20s} {unit or 'NONE':<20s}\n"


def _set(title: str, function: int, x: FloatArray, y: Samples, axes: tuple[str, str], binary: bool) -> bytes:
    """One data set of uneven spacing and double precision."""
    numbers = np.column_stack([x, y.real, y.imag] if np.iscomplexobj(y) else [x, y])
    first = f"{58:6d}{'':74s}\n"
    if binary:
        first = f"{58:6d}b{1:6d}{2:6d}{11:12d}{numbers.nbytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}\n"
    lines = [
        f"{-1:6d}\n",
        first,
        *(f"{line or 'NONE'}\n" for line in (title, "", "", PEAK, "")),
        f"{function:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10s}{1:10d}{0:4d} {'NONE':<10s}{1:10d}{0:4d}\n",
        f"{6 if np.iscomplexobj(y) else 4:10d}{len(x):10d}{0:10d}{0.0:13.5e}{0.0:13.5e}{0.0:13.5e}\n",
        _describe_axis(_FREQUENCY, "Frequency", "Hz"),
        *axes,
        _describe_axis(0, "NONE", ""),
    ]
    values = numbers.astype("<f8").tobytes() if binary else _as_text(numbers)
    return "".join(lines).encode() + values + _END


def _as_text(numbers: FloatArray) -> bytes:
    """Format 1E13.5,2E20.12 of complex and 2(1E13.5,1E20.12) of real values."""
    points = [f"{row[0]:13.5E}" + "".join(f"{value:20.12E}" for value in row[1:]) for row in numbers.tolist()]
    if numbers.shape[1] == 2:
        points = ["".join(points[i : i + 2]) for i in range(0, len(points), 2)]
    return "".join(f"{point}\n" for point in points).encode()
