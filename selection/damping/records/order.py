"""The order in which the rows of a record were taken, and the direction and rate of its sweeps."""

import numpy as np

from damping.arrays import FloatArray
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
    """df/dt of each row, Hz/s, (n,): that stated in the row, else that of the rig; 0 where neither is.

    A ``rate`` of the rig above 0 is a speed: df/dt is below 0 in sweeps whose frequency falls. One below 0 is df/dt.
    """
    of_rig = np.full(len(record), rate or 0.0)
    of_rig = np.where(of_rig > 0.0, of_rig * find_direction(record), of_rig)
    stated = record.column("sweep_rate", np.nan)
    return np.where(np.isfinite(stated), stated, of_rig)
