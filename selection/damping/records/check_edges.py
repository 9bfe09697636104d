"""Checks that every sweep shows its resonance: it may lie beyond the rows or between coarse rows."""

from math import log

import numpy as np

from damping.records.phase_kinds import SMOOTH
from damping.records.runs import FEWEST_ROWS, Run
from damping.records.view import Finding, View, label_sweeps, name_sweeps


def check_noise(view: View) -> Finding | None:
    """Amplitudes that differ from row to row as much as over the whole sweep: there is no resonance."""
    if view.curve:
        return None
    smooth = [run for run in view.runs if run.phase is not None and np.mean(np.cos(np.diff(run.phase))) > SMOOTH]
    if len(smooth) == len(view.runs):
        return None
    what = "amplitudes jump from row to row as much as over the whole sweep: this record has no resonance"
    advice = "check the channel and the tracking filter, or take a band with a resonance"
    return Finding("edge-of-sweep", "refuse", what, advice, view.record.sweeps)


def check_edge(view: View) -> Finding | None:
    """Sweeps that contain no resonance: without a phase the row at their edge would be taken for it."""
    seen = {leg.run.sweep for leg in view.legs if leg.resonant}
    beside = [leg for leg in view.legs if leg.run.sweep not in seen and leg.run.sweep not in view.mixed_levels]
    if not beside:
        return None
    below = all(np.argmax(leg.run.compliance) > len(leg.run) // 2 for leg in beside)
    above = all(np.argmax(leg.run.compliance) < len(leg.run) // 2 for leg in beside)
    where = "stops below its resonance" if below else "starts above its resonance" if above else "holds no resonance"
    sweeps = label_sweeps(leg.run for leg in beside)
    blind = any(leg.lag is None for leg in beside)
    what = f"{name_sweeps(sweeps)}: the range {where}; the largest response is at its edge"
    advice = "sweep on past the resonance"
    advice += ", or record the phase: without it the edge would be taken for the resonance" if blind else ""
    return Finding("edge-of-sweep", "refuse" if blind else "caution", what, advice, sweeps)


def check_few(view: View) -> Finding | None:
    """Sweeps of few rows without phases whose response rises to their edge, which is taken for the resonance."""
    if not (sweeps := list_at_edge(view)):
        return None
    what = f"{name_sweeps(sweeps)}: the largest response is at the edge of the few rows, "
    what += "so the resonance may lie beyond"
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


#: A resonance that lies above the largest reading by this factor is reported: bands of careful tests are narrower.
RISEN = 1.05


def check_coarse(view: View) -> Finding | None:
    """Sweeps without phases whose largest reading lies well below the resonance, because rows are far apart."""
    if view.record.has_phase or "energy" in view.record.frame.columns:
        return None
    table = view.resonances[view.resonances["method"] == "between"]
    largest = view.right.frame.loc[table["row"], ["force", "amplitude"]].to_numpy(dtype=np.float64)
    rise = (table["amplitude"] / table["force"]).to_numpy(dtype=np.float64) * largest[:, 0] / largest[:, 1]
    if not np.any(rise > RISEN):
        return None
    sweeps = tuple(table["sweep"][rise > RISEN].astype(str))
    what = f"{name_sweeps(sweeps)}: no row at the resonance, which lies up to {100.0 * (rise.max() - 1.0):.0f} % above "
    what += "the largest reading by a curve through the rows; bands allow for its error"
    advice = "sweep with closer rows, dwell at the peak or record phases"
    return Finding("edge-of-sweep", "caution", what, advice, sweeps)
