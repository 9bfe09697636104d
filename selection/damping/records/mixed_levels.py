"""Several levels of force under one label, which their rows show: they alternate over the frequencies, or are peaks."""

from math import log

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, IntArray
from damping.records.record import Record
from damping.records.runs import FEWEST_ROWS

#: Least ratio of the forces of two levels; within a level, forces differ by less than half that gap (in the logarithm).
LEVEL = 1.12
FEWEST_CHANGES = 4  #: fewest changes of level from row to row, by frequency, of levels that alternate
#: Rows under one label are peaks of several levels if their phases differ by less than this, rad,
PEAKS_IN_PHASE = 0.5
#: and ln amplitude grows by more than this times ln force: peaks grow by 0.5 (velocity-squared damping) or more; within
#: one resonance the shaker's force drops as amplitude grows.
GROWS = 0.3
#: Without phases they are peaks if it grows by more than this, which no rig causes within one resonance,
GROWS_AS_FORCE = 0.75
#: or if F/A changes by more than this many times the inertia over the range of frequencies;
BEYOND_INERTIA = 2.0
LIGHTEST = 5e-4  #: damping ratio from which that inertia takes a mass that is not stated


def find_mixed_levels(record: Record, mass: float) -> dict[str, list[float]]:
    """Forces of the levels under each label that holds several; ``mass``: as stated, NaN where it is not."""
    by_sweep = record.frame.groupby("sweep", sort=False)
    return {str(sweep): levels for sweep, rows in by_sweep if (levels := _find_levels(rows, mass))}


def _find_levels(rows: pd.DataFrame, mass: float) -> list[float]:
    """Forces of the levels in the ``rows`` of one label; empty if there is one level."""
    if len(rows) == 1:
        return []
    table = rows.sort_values("frequency", kind="stable")
    frequency, x = table["frequency"].to_numpy(dtype=np.float64), np.log(table["force"].to_numpy(dtype=np.float64))
    rising = np.sort(x)
    gaps = np.diff(rising)
    cuts = np.flatnonzero(gaps > log(LEVEL))
    groups = np.split(rising, cuts + 1)
    if len(groups) < 2 or max(map(np.ptp, groups)) > 0.5 * gaps[cuts].min():
        return []
    level = np.searchsorted(rising[cuts], x - 1e-12)
    of_levels = [frequency[level == k] for k in range(len(groups))]
    shared = (frequency >= max(map(np.min, of_levels))) & (frequency <= min(map(np.max, of_levels)))
    changes = int(np.sum(np.diff(level[shared]) != 0)) if min(map(len, groups)) > 1 else 0
    is_mixed = changes >= max(FEWEST_CHANGES, len(groups)) or _are_peaks(table, level, mass)
    return [float(np.exp(group.mean())) for group in groups] if is_mixed else []


def _are_peaks(table: pd.DataFrame, level: IntArray, mass: float) -> bool:
    """Whether the few rows of one label, with the number of the force ``level`` (rows,), are peaks and not one sweep.

    In one sweep |Z| = F/A obeys |Z|^2 = M^2 (omega_n^2 - omega^2)^2 + C^2, whatever the forces, so that
    sqrt(Z_max^2 - Z_min^2) <= M (omega_max^2 - omega_min^2).
    """
    means = table[["force", "amplitude"]].transform(np.log).groupby(level).mean()
    steps = means["amplitude"].diff() / means["force"].diff()
    if len(table) >= FEWEST_ROWS * (len(means) - 1) or not (steps[1:] > GROWS).all():
        return False
    if "phase" in table.columns:
        return bool(np.ptp(table["phase"]) < PEAKS_IN_PHASE)
    Z, squared = table["force"] / table["amplitude"], (RAD_S_PER_HZ * table["frequency"]) ** 2
    M = np.nan_to_num(mass, nan=Z.min() / (2.0 * LIGHTEST * squared.mean()))
    apart = (Z.max() ** 2 - Z.min() ** 2) ** 0.5
    whole = np.ptp(means["amplitude"]) / np.ptp(means["force"])
    return bool(whole > GROWS_AS_FORCE or apart > BEYOND_INERTIA * M * np.ptp(squared))
