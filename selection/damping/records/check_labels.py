"""Checks of labels: several force levels under one label, or a label of its own for every row of a sweep."""

from math import log, pi

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, IntArray
from damping.records.runs import FEWEST_ROWS
from damping.records.view import Finding, View, name_sweeps

#: Least ratio of the forces of two levels; within a level, forces differ by less than half that gap (in the logarithm).
LEVEL = 1.12
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


#: Fewest rows at one force, with lags on both sides of resonance beyond this distance from pi/2, that are a sweep.
FEWEST_OF_SWEEP = 5
BESIDE_RESONANCE = 0.25 * pi


def check_unlabelled(view: View) -> Finding | None:
    """Rows with a label each that are sweeps: at one force their lags turn through resonance."""
    table = view.record.frame
    if "phase" not in table or table["sweep"].nunique() < len(table):
        return None
    turns = table.groupby("force")["phase"].agg(["size", "min", "max"])
    passes = (turns["min"] < 0.5 * pi - BESIDE_RESONANCE) & (turns["max"] > 0.5 * pi + BESIDE_RESONANCE)
    sweeps = int(np.sum(passes & (turns["size"] >= FEWEST_OF_SWEEP)))
    if not sweeps:
        return None
    what = f"every row has a label of its own, though rows at one force turn through resonance ({sweeps} such forces)"
    advice = "give the rows of one sweep one label: with its own, each row counts as a level"
    return Finding("mixed-levels", "caution", what, advice, view.record.sweeps)


def check_mixed_levels(view: View) -> Finding | None:
    """Several force levels under one label: their rows alternate over the same frequencies, or are single peaks.

    The record is refused if the levels would be taken for one sweep without a resonance.
    """
    mixed = find_mixed_levels(view)
    resonant = {leg.run.sweep for leg in view.legs if leg.resonant}
    if not mixed or view.record.is_decay:
        return None
    levels = next(iter(mixed.values()))
    forces = ", ".join(f"{force:.4g}" for force in levels[:6])
    what = f"{name_sweeps(mixed)}: forces of {len(levels)} levels under one label ({forces})"
    advice = "give every level a label of its own"
    uses_all_rows = view.record.has_phase or "energy" in view.record.frame
    advice += "" if uses_all_rows else ": of one label only the largest amplitude is used"
    blind = any(leg.lag is None and leg.run.sweep in mixed.keys() - resonant for leg in view.legs)
    return Finding("mixed-levels", "refuse" if blind else "caution", what, advice, tuple(mixed))


def find_mixed_levels(view: View) -> dict[str, list[float]]:
    """Forces of the levels under each label that holds several."""
    by_sweep = view.record.frame.groupby("sweep", sort=False)
    return {str(sweep): levels for sweep, rows in by_sweep if (levels := _find_levels(view, rows))}


def _find_levels(view: View, rows: pd.DataFrame) -> list[float]:
    """Forces of the levels in the ``rows`` of one label; empty if there is one level."""
    if len(rows) == 1:
        return []
    table = rows.sort_values("frequency", kind="stable")
    frequency, x = table["frequency"].to_numpy(dtype=np.float64), np.log(table["force"].to_numpy(dtype=np.float64))
    order = np.sort(x)
    cuts = np.flatnonzero(np.diff(order) > log(LEVEL))
    groups = np.split(order, cuts + 1)
    if len(groups) < 2 or max(map(np.ptp, groups)) > 0.5 * np.diff(order)[cuts].min():
        return []
    level = np.searchsorted(order[cuts], x - 1e-12)
    spans = [(frequency[level == k].min(), frequency[level == k].max()) for k in range(len(groups))]
    low, high = max(span[0] for span in spans), min(span[1] for span in spans)
    shared = (frequency >= low) & (frequency <= high)
    changes = int(np.sum(np.diff(level[shared]) != 0)) if min(map(len, groups)) > 1 else 0
    mixed = changes >= max(4, len(groups)) or _are_peaks(view, table, level)
    return [float(np.exp(group.mean())) for group in groups] if mixed else []


def _are_peaks(view: View, table: pd.DataFrame, level: IntArray) -> bool:
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
    mass = np.nan_to_num(view.stated_mass, nan=Z.min() / (2.0 * LIGHTEST * squared.mean()))
    apart = (Z.max() ** 2 - Z.min() ** 2) ** 0.5
    whole = np.ptp(means["amplitude"]) / np.ptp(means["force"])
    return bool(whole > GROWS_AS_FORCE or apart > BEYOND_INERTIA * mass * np.ptp(squared))
