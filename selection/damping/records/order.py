"""The order in which the rows of a record were taken, the direction and rate of its sweeps, and rows out of order."""

import numpy as np

from damping.arrays import ComplexArray, FloatArray, IntArray
from damping.records.record import Record


def order_taken(record: Record) -> FloatArray:
    """Time of each row, -1/2 to 1/2 over the record; the order of the rows where no time is given."""
    time = np.arange(len(record), dtype=float)
    if "time" in record.frame.columns and np.isfinite(record.column("time")).all():
        time = record.column("time")
    span = float(np.ptp(time))
    return np.asarray((time - time.min()) / span - 0.5) if span > 0.0 else np.zeros(len(record))


def find_direction(record: Record) -> FloatArray:
    """1 in sweeps whose frequency rises in the order measured, -1 where it falls, (n,)."""
    time, frequency, up = order_taken(record), record.column("frequency"), np.ones(len(record))
    for rows in record.frame.groupby("sweep", sort=False).indices.values():
        t, f = time[rows], frequency[rows]
        up[rows] = np.sign(np.sum((t - t.mean()) * (f - f.mean()))) or 1.0
    return up


def list_rates(record: Record, rate: float | None) -> FloatArray:
    """df/dt of each row, Hz/s, (n,): that stated in the row, else of the rig, else of the sweep's other rows; else 0.

    A ``rate`` of the rig above 0 is a speed: df/dt is below 0 in sweeps whose frequency falls. One below 0 is df/dt.
    """
    stated, time = record.column("sweep_rate", np.nan), order_taken(record)
    if rate is not None:
        return np.where(np.isfinite(stated), stated, rate * find_direction(record) if rate > 0.0 else rate)
    rates = np.nan_to_num(stated)
    for rows in map(np.asarray, record.frame.groupby("sweep", sort=False).indices.values()):
        known = np.isfinite(stated[rows])
        if known.any():
            order = rows[known][np.argsort(time[rows[known]], kind="stable")]
            rates[rows[~known]] = np.interp(time[rows[~known]], time[order], stated[order])
    return rates


#: Fewest rows of a sweep that have an order.
FEWEST_IN_ORDER = 8
#: Least departure, ln |Y|, of the reading of a misplaced row from the other rows at its stated frequency,
OUT_OF_PLACE = 0.25
#: and over its departure from its neighbours in the order taken.
OVER_ITS_PLACE = 5.0
OF_JUMP = 0.5  #: share of that departure in a single step from row to row from which on the sweep jumps
#: Rows tried in a sweep: one mistyped frequency breaks the order at two places, three rows each, with some to spare.
_MOST_TRIED = 9


def find_misplaced_rows(record: Record) -> dict[int, str]:
    """Positions of rows with a mistyped frequency, and their sweeps; at most one row in a sweep.

    Without that row the frequencies of the sweep rise or fall throughout. Its Y = F exp(i phase)/A lies between those
    of the rows before and after it, and far from those of the rows at its stated frequency, so that it is no point that
    was taken again; nor one that was taken again after a jump, on the branch of the rows before and after it.
    """
    found, time = dict[int, str](), order_taken(record)
    for sweep, rows in record.frame.groupby("sweep", sort=False).indices.items():
        taken = np.asarray(rows)[np.argsort(time[rows], kind="stable")]
        f = record.column("frequency")[taken]
        if len(taken) >= FEWEST_IN_ORDER and not _is_monotone(f):
            phase = record.column("phase")[taken] if record.has_phase else np.zeros(len(taken))
            Y = record.column("force")[taken] / record.column("amplitude")[taken] * np.exp(1j * phase)
            breaks = np.flatnonzero(np.diff(np.sign(np.diff(f))))
            near = np.unique((breaks[:, np.newaxis] + np.arange(3)).clip(1, len(f) - 2))[:_MOST_TRIED]
            found |= {int(taken[k]): str(sweep) for k in near if _is_misplaced(f, Y, int(k))}
    return found


def _is_monotone(f: FloatArray) -> bool:
    step = np.diff(f)
    return bool(np.all(step >= 0.0) or np.all(step <= 0.0))


def _is_misplaced(f: FloatArray, Y: ComplexArray, k: int) -> bool:
    """Whether row ``k`` of a sweep (f, Y in the order taken) belongs to its place and not to its frequency."""
    if not _is_monotone(np.delete(f, k)):
        return False
    order: IntArray = np.argsort(np.delete(f, k), kind="stable")
    g, there = np.delete(f, k)[order], np.delete(Y, k)[order]
    stated = np.interp(f[k], g, there.real) + 1j * np.interp(f[k], g, there.imag)
    off, off_place = (abs(np.log(Y[k] / value)) for value in (stated, 0.5 * (Y[k - 1] + Y[k + 1])))
    jumps, step = np.abs(np.log(there[1:] / there[:-1])).max() > OF_JUMP * off, f[k + 1] - f[k - 1]
    if jumps and step != 0.0:  # the line through its neighbours at its stated frequency: the branch after the jump
        onward = Y[k - 1] + (Y[k + 1] - Y[k - 1]) * (f[k] - f[k - 1]) / step
        off = min(off, abs(np.log(Y[k] / onward)))
    return bool(off > max(OUT_OF_PLACE, OVER_ITS_PLACE * off_place))
