"""Check of sweeps of two or three rows, which are too few to show whether a resonance lies within them."""

from math import log

import numpy as np

from damping.records.check_sweeps import RISEN
from damping.records.runs import FEWEST_ROWS, Run
from damping.records.view import Finding, View, label_sweeps, name_sweeps


def check_few(view: View) -> Finding | None:
    """Sweeps of few rows without phases whose response rises to their edge, which is taken for the resonance."""
    if not (sweeps := list_at_edge(view)):
        return None
    what = (
        f"{name_sweeps(sweeps)}: the largest response is at the edge of the few rows, so the resonance may lie beyond"
    )
    advice = (
        "add a row past it, or record the phase: if the edge, which is taken, is not the resonance, damping reads high"
    )
    return Finding("edge-of-sweep", "caution", what, advice, sweeps)


def list_at_edge(view: View) -> tuple[str, ...]:
    """The sweeps of few rows whose edge is taken for the resonance without a phase or energy that shows it is one."""
    if "energy" in view.record.frame.columns:
        return ()
    whole = {leg.run.sweep for leg in view.legs if leg.lag is not None or not _rises_to_edge(leg.run)}
    return label_sweeps(leg.run for leg in view.legs if leg.run.sweep not in whole)


def _rises_to_edge(run: Run) -> bool:
    """Whether A/F of two or three rows is largest at the edge, by more than near a resonance (``RISEN``)."""
    if not 1 < len(run) < FEWEST_ROWS:
        return False
    top = int(np.argmax(run.compliance))
    beside = {0: 1, len(run) - 1: len(run) - 2}.get(top)
    return beside is not None and bool(run.compliance[top] - run.compliance[beside] > log(RISEN))
