"""Checks that every sweep shows its resonance: it may lie beyond the rows, between coarse rows, or be jumped past.

Of a bistable mode a sweep may jump onto the large branch past the resonance: up, of a hardening mode downward, of a
softening one upward. The other direction follows the large branch to the resonance, or nearly, and jumps down after it.
"""

from math import log

import numpy as np

from damping.arrays import FloatArray
from damping.records.peaks import find_noise, find_peak
from damping.records.phase_kinds import SMOOTH
from damping.records.resonance import find_jump
from damping.records.runs import FEWEST_ROWS, WHITE, Run, measure_whiteness, order_rows
from damping.records.view import MOST_NAMED, Finding, View, label_sweeps, name_sweeps


def check_noise(view: View) -> Finding | None:
    """Amplitudes that differ from row to row as much as over the whole sweep: there is no resonance.

    Phases may still show one that turn in every sweep, and do not differ from row to row as much as over the sweep.
    """
    if view.curve:
        return None
    phases = [run.phase for run in view.runs if run.phase is not None]
    smooth = [phase for phase in phases if np.mean(np.cos(np.diff(phase))) > SMOOTH]
    white = measure_whiteness([np.exp(1j * phase) for phase in smooth])
    if len(smooth) == len(view.runs) and (white is None or white < WHITE):
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


#: A sweep without phases jumps up to its largest reading if A and A/F (a held response has falling forces instead) rise
#: to it from one row to the next by this factor,
RISE = 1.3
#: and, in ln, by this many times what it falls within twice that step of frequency on the other side, and by this many
#: standard deviations of the noise. The largest row of a linear mode lies within half a step of its resonance, so that
#: A/F falls by at least its rise there, however coarse the rows. Of 750 sweeps of linear or bent modes without a jump
#: up (noise 0.2 to 3 %, steps of 0.1 to 3 half-widths) none is taken for one; of 250 with a jump up 82 are named, whose
#: largest readings lie 3 % below the resonance in the middle, up to 20 % and more. Coarser rows hide the others.
ONE_SIDED = 3.0


def check_jump(view: View) -> Finding | None:
    """Sweeps with phases that jump past their resonance."""
    jumps: dict[str, str] = {}
    table = view.resonances[view.resonances["method"] == "beside"]
    for sweep, offset in zip(table["sweep"].astype(str), table["phase_offset"].astype(float), strict=True):
        rows, _ = order_rows(view.right.of(sweep).frame)
        F, f, A, phase = (rows[name].to_numpy(float) for name in ("force", "frequency", "amplitude", "phase"))
        if (row := find_jump(F, f, A, phase - offset)) is not None:
            jumps[sweep] = _name_jump(sweep, f, row)
    if not jumps:
        return None
    what = f"jumps past the resonance: {_list_jumps(jumps)}; the damping is that of the row beside it"
    advice = "sweep the other way, or hold the phase at 90 degrees, to reach the resonance"
    return Finding("edge-of-sweep", "caution", what, advice, tuple(jumps))


def check_jump_up(view: View) -> Finding | None:
    """Sweeps without phases or energies that jump up to their largest reading, which is taken for the resonance."""
    if view.record.has_phase or "energy" in view.record.frame.columns:
        return None
    jumps: dict[str, str] = {}
    for sweep, table in view.right.frame.groupby("sweep", sort=False):
        rows, legs = order_rows(table)
        F, f, A = (rows[name].to_numpy(dtype=np.float64) for name in ("force", "frequency", "amplitude"))
        leg = next(leg for leg in legs if find_peak(F, f, A) in leg)
        if (row := find_jump_up(F[leg], f[leg], A[leg])) is not None:
            jumps[str(sweep)] = _name_jump(str(sweep), f[leg], row)
    if not jumps:
        return None
    what = f"jumps up to the largest reading: {_list_jumps(jumps)}; a bistable mode jumps past its resonance so, and "
    what += "that reading, which is taken for it, is too low, its damping too high"
    advice = "sweep the other way or record the phase; state time if the rows are not in the order in which they were "
    advice += "taken"
    return Finding("edge-of-sweep", "caution", what, advice, tuple(jumps))


def find_jump_up(force: FloatArray, frequency: FloatArray, amplitude: FloatArray) -> int | None:
    """The row (n rows in the order of the sweep, in one direction) from which A jumps up to the largest amplitude.

    None without a jump (``RISE``, ``ONE_SIDED``), or if no row lies twice its step beyond that amplitude.
    """
    g, top = np.log(amplitude / force), find_peak(force, frequency, amplitude)
    step = np.abs(frequency - frequency[top])
    beyond = np.flatnonzero(step[top + 1 :] >= (2.0 - 1e-6) * step[top - 1]) if top else np.empty(0, np.int64)
    if not len(beyond):
        return None
    rise = min(g[top] - g[top - 1], log(amplitude[top] / amplitude[top - 1]))
    fall = float(g[top] - g[top + 1 + beyond[0]])
    return top - 1 if rise > max(log(RISE), ONE_SIDED * max(fall, find_noise(g))) else None


def _name_jump(sweep: str, frequency: FloatArray, row: int) -> str:
    return f"sweep {sweep} between {frequency[row]:.4g} and {frequency[row + 1]:.4g} Hz"


def _list_jumps(jumps: dict[str, str]) -> str:
    return ", ".join(list(jumps.values())[:MOST_NAMED])
