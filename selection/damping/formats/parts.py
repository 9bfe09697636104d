"""A part of a large file of arrays or channels: that of the times that are asked for, without the rest in memory."""

from contextlib import suppress
from pathlib import Path

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.arrays import list_array_series
from damping.formats.sampling import find_rows
from damping.formats.series import Series, Stated, Summary

_FIRST = 1000  # samples by which the times of a signal are known
_ENDLESS = 2**53  # samples of a file of unknown length


def list_part_series(path: str | Path, kind: str, stated: Stated, summary: Summary, max_size: int) -> list[Series]:
    """Series of a file, cut to ``stated.span`` if its first samples tell where that is; else whole.

    InputError: as of ``list_array_series``.
    """
    if stated.span is not None:
        with suppress(InputError):  # such as a part beyond the end: the whole says what is wrong
            own, first = Summary(), list_array_series(path, kind, stated, Summary(), max_size, (0, _FIRST))
            parts = {_find_part(row, stated.span) for row in first}
            rows = parts.pop() if len(parts) == 1 else None
            series = list_array_series(path, kind, stated, own, max_size, rows) if rows else []
            if rows and all(_holds(row.abscissa, rows, stated.span) for row in series):
                summary.rows += own.rows
                summary.notes += own.notes
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
