"""Checks of sweeps against each other: levels under one label, copies, amplitudes that fall with force."""

from __future__ import annotations

from math import log

import numpy as np

from damping.records.runs import FEWEST_ROWS, Run
from damping.records.view import Finding, View, label_sweeps, name_sweeps

#: Forces of levels differ by this factor at least; of one level by less than a quarter of that (in the logarithm).
LEVEL = 1.12


def check_mixed_levels(view: View) -> Finding | None:
    """One label, several forces: rows of different levels take turns over the same frequencies."""
    mixed = {
        sweep: levels
        for sweep, levels in ((sweep, _find_levels(view, sweep)) for sweep in view.record.sweeps)
        if levels
    }
    if not mixed:
        return None
    levels = next(iter(mixed.values()))
    forces = ", ".join(f"{force:.4g}" for force in levels[:6])
    what = f"{name_sweeps(mixed)}: forces of {len(levels)} levels under one label ({forces})"
    return Finding("mixed-levels", "caution", what, "give every level a label of its own", tuple(mixed))


def _find_levels(view: View, sweep: str) -> list[float]:
    """Forces of the levels that one label holds; none where it is one level."""
    table = view.record.table[view.record.table["sweep"] == sweep].sort_values("frequency", kind="stable")
    x = np.log(table["force"].to_numpy(dtype=np.float64))
    order = np.sort(x)
    cuts = np.flatnonzero(np.diff(order) > log(LEVEL))
    groups = np.split(order, cuts + 1)
    if len(groups) < 2 or min(map(len, groups)) < 2 or max(map(np.ptp, groups)) > 0.5 * np.diff(order)[cuts].min():
        return []
    level = np.searchsorted(order[cuts], x - 1e-12)
    frequency = table["frequency"].to_numpy(dtype=np.float64)
    spans = [(frequency[level == k].min(), frequency[level == k].max()) for k in range(len(groups))]
    low, high = max(span[0] for span in spans), min(span[1] for span in spans)
    shared = (frequency >= low) & (frequency <= high)
    changes = int(np.sum(np.diff(level[shared]) != 0))
    return [float(np.exp(group.mean())) for group in groups] if changes >= max(4, len(groups)) else []


def check_repeats(view: View) -> Finding | None:
    """A sweep that is another one to the last digit, or a multiple of it: noise never repeats itself."""
    runs = [run for run in view.raw]
    copies: list[tuple[Run, Run, float]] = []
    for k, second in enumerate(runs):
        for first in runs[:k]:
            factor = _find_factor(first, second)
            if factor is not None and first.sweep != second.sweep:
                copies.append((first, second, factor))
                break
    if not copies:
        return None
    first, second, factor = copies[0]
    scaled = "" if abs(factor - 1.0) < 1e-9 else f" times {factor:.4g}"
    what = f"sweep {second.sweep} repeats sweep {first.sweep}{scaled} to the last digit, which no measurement does"
    return Finding(
        "repeated-sweep",
        "caution",
        what,
        "leave the copy out: its rows would count twice",
        label_sweeps(c[1] for c in copies),
    )


#: Proportional rows are a copy where their ratio is constant to so many parts: six digits, rounded.
COPY = 2e-4
#: And where the noise of their rows is larger than that by this factor.
NOISE_OF_COPY = 5.0


def _find_factor(first: Run, second: Run) -> float | None:
    """The factor by which the amplitudes of two runs differ, the same for all rows; None where they are no copy."""
    if len(first) != len(second) or not np.allclose(first.omega, second.omega, rtol=1e-9):
        return None
    same_phase = first.phase is None or (
        second.phase is not None and np.allclose(first.phase, second.phase, rtol=0.0, atol=1e-9)
    )
    if len(first) < FEWEST_ROWS:
        same = np.allclose(first.A, second.A, rtol=1e-12) and np.allclose(first.F, second.F, rtol=1e-12)
        return 1.0 if same and same_phase else None
    if np.allclose(first.A, second.A, rtol=1e-12) and same_phase:
        return 1.0
    ratio = np.log(second.A / first.A)
    if np.ptp(np.log(second.F / first.F)) > COPY:
        return None
    noisy = first.noise > NOISE_OF_COPY * COPY
    return float(np.exp(np.median(ratio))) if noisy and same_phase and np.ptp(ratio) < COPY else None


#: Levels are compared where their forces differ by this factor.
FORCE_STEP = 1.1
#: A resonant amplitude has fallen below this share of that at less force.
FALLEN = 0.87


def check_amplitude_falls(view: View) -> Finding | None:
    """A resonant amplitude that falls with force: no passive structure does that."""
    table = view.implied[
        [
            all(seen for run, seen in zip(view.runs, view.resonant, strict=True) if run.sweep == sweep)
            for sweep in view.implied["sweep"]
        ]
    ]
    table = table.sort_values("force", kind="stable")
    F, A = table["force"].to_numpy(), table["amplitude"].to_numpy()
    pairs = [(i, j) for i in range(len(F)) for j in range(i + 1, len(F)) if F[j] > FORCE_STEP * F[i]]
    falling = [(i, j) for i, j in pairs if A[j] < FALLEN * A[i]]
    if not falling or len(falling) < 0.3 * len(pairs):
        return None
    i, j = min(falling, key=lambda pair: A[pair[1]] / A[pair[0]])
    what = f"resonant amplitude falls from {A[i]:.4g} at force {F[i]:.4g} to {A[j]:.4g} at force {F[j]:.4g}"
    advice = "check the labels and the force of each level, and whether the structure was altered between them"
    return Finding("amplitude-falls", "refuse", what, advice, tuple(table["sweep"].iloc[sorted({i, j})]))
