"""Checks of sweeps of a bistable mode that jump onto its large branch past the resonance, so that no row is at it.

A hardening mode jumps up in a downward sweep, a softening one in an upward sweep. The other direction follows the large
branch to the resonance, or nearly, and jumps down after it.
"""

from math import log

import numpy as np

from damping.arrays import FloatArray
from damping.records.peaks import find_noise, find_peak
from damping.records.resonance import find_jump
from damping.records.runs import order_rows
from damping.records.view import MOST_NAMED, Finding, View

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
