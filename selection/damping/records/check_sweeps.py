"""Checks of single sweeps: a resonance, one only, slowly enough, and no wild reading."""

from __future__ import annotations

from math import pi

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.records.implied import INCOHERENT, SMOOTH, Implied
from damping.records.runs import Run, count_beats, find_peaks_of
from damping.records.view import WILD, Finding, View, label_sweeps, name_sweeps


def check_noise(view: View) -> Finding | None:
    """Amplitudes that jump from row to row as much as over the whole sweep: no resonance at all."""
    if view.curve:
        return None
    smooth = [run for run in view.runs if run.phase is not None and np.mean(np.cos(np.diff(run.phase))) > SMOOTH]
    if len(smooth) == len(view.runs):
        return None
    return Finding(
        "edge-of-sweep",
        "refuse",
        "amplitudes jump from row to row as much as over the whole sweep: there is no resonance in this record",
        "check the channel and the tracking filter, or take a band with a resonance",
        view.record.sweeps,
    )


def check_outlier(view: View) -> Finding | None:
    """Single amplitudes far from what the rows beside them say."""
    if not view.wild:
        return None
    table = view.record.table
    places = [f"row {row + 1} ({table['frequency'][row]:g} Hz, sweep {view.wild[row]})" for row in sorted(view.wild)]
    peaks = table.groupby("sweep", sort=False)["amplitude"].idxmax().tolist()
    taken = not view.record.has_phase and any(row in peaks for row in view.wild)
    values = ", ".join(f"{table['amplitude'][row]:g}" for row in sorted(view.wild)[:3])
    what = f"amplitude {values} at {', '.join(places[:3])}: more than {WILD:g} times off the rows beside it"
    advice = "correct the gain range of that reading, or leave the row out"
    return Finding("outlier", "refuse" if taken else "caution", what, advice, tuple(dict.fromkeys(view.wild.values())))


def check_edge(view: View) -> Finding | None:
    """Sweeps that hold no resonance: without a phase their last row would be taken for it."""
    beside = [(run, lag) for run, lag, seen in zip(view.runs, view.lags, view.resonant, strict=True) if not seen]
    seen = {run.sweep for run, held in zip(view.runs, view.resonant, strict=True) if held}
    beside = [(run, lag) for run, lag in beside if run.sweep not in seen]
    if not beside:
        return None
    below = all(np.argmax(run.compliance) > len(run) // 2 for run, _ in beside)
    above = all(np.argmax(run.compliance) < len(run) // 2 for run, _ in beside)
    where = "stops below its resonance" if below else "starts above its resonance" if above else "holds no resonance"
    sweeps = label_sweeps(run for run, _ in beside)
    blind = any(lag is None for _, lag in beside)
    what = f"{name_sweeps(sweeps)}: the range {where}; the largest response stands at its edge"
    advice = "sweep on past the resonance" + (
        ", or record the phase: without it the edge would be taken for it" if blind else ""
    )
    return Finding("edge-of-sweep", "refuse" if blind else "caution", what, advice, sweeps)


#: Peaks farther apart than this ratio of frequencies are of different modes for certain.
SEPARATE = 1.08


def _find_further_peaks(view: View) -> list[tuple[Run, FloatArray]]:
    peaks = [(run, run.omega[find_peaks_of(run)] / RAD_S_PER_HZ) for run in view.runs]
    return [(run, peaks) for run, peaks in peaks if len(peaks) > 1]


def check_several_modes(view: View) -> Finding | None:
    """More than one resonance in the range."""
    further = _find_further_peaks(view)
    if not further:
        return None
    run, peaks = max(further, key=lambda pair: len(pair[1]))
    apart = any(float(p.max() / p.min()) > SEPARATE for _, p in further)
    most = len(further) >= 0.5 * len(view.record.sweeps)
    what = f"{len(peaks)} resonances in sweep {run.sweep}: at {', '.join(f'{p:.4g}' for p in peaks[:6])} Hz"
    advice = "keep the rows of one mode only" if apart else "is it two close modes, or one in two planes? see gap"
    sweeps = label_sweeps(run for run, _ in further)
    return Finding("several-modes", "refuse" if apart and most else "caution", what, advice, sweeps)


#: Half-power bandwidths in the time one takes, (df/dt)/(2 zeta f)^2, beyond which a sweep is no steady state.
FAST = 0.3
#: The same beyond which no answer holds.
TOO_FAST = 3.0


def check_sweep_rate(view: View) -> Finding | None:
    """Sweeps faster than the resonance can follow: by their rate where it is known, else by beats after the peak."""
    rates = _measure_rates(view)
    fast = {sweep: eta for sweep, eta in rates.items() if eta > FAST}
    if fast:
        sweep = max(fast, key=lambda label: fast[label])
        what = f"{name_sweeps(fast)}: the frequency moves {fast[sweep]:.2g} half-power bandwidths in the time one takes"
        verdict = "refuse" if fast[sweep] > TOO_FAST else "caution"
        return Finding(
            "sweep-rate", verdict, what, f"sweep {fast[sweep] / 0.1:.0f} times slower, or dwell", tuple(fast)
        )
    if rates:
        return None
    beats = {run.sweep: count_beats(run) for run in view.runs}
    turned = label_sweeps(run for run, turn in zip(view.runs, view.turns, strict=True) if turn and _is_dragged(turn))
    ringing = {sweep: count for sweep, count in beats.items() if count or sweep in turned}
    if len(ringing) < 0.5 * len(view.record.sweeps):
        return None
    what = f"the response of {name_sweeps(ringing)} "
    what += "beats after its peak" if any(ringing.values()) else "lags ever more behind the frequency"
    sure = max(ringing.values()) > 1 or bool(turned)
    what += ": the sweep was faster than the mode could follow" + (
        "" if sure else ", or a second mode stands beside it"
    )
    verdict = "refuse" if sure else "caution"
    return Finding("sweep-rate", verdict, what, "sweep slower, or dwell; state sweep_rate (Hz/s)", tuple(ringing))


#: A phase offset, rad, that with ``CURVED`` only a sweep faster than the mode could follow has.
DRAGGED = 0.5
#: Misfit of Y by a straight line, relative to |Y|, beside that offset.
CURVED = 0.25


def _is_dragged(turn: Implied) -> bool:
    return turn.both_sides and DRAGGED < abs(turn.offset) < 0.75 * pi and CURVED < turn.miss < INCOHERENT


def _measure_rates(view: View) -> dict[str, float]:
    """(df/dt)/(2 zeta f)^2 of each sweep at its resonance, where the rate is known."""
    table = view.record.table
    if "sweep_rate" not in table.columns:
        return {}
    implied = view.implied
    half_power = 2.0 * (implied["damping_ratio"] * implied["frequency"]).to_numpy(dtype=np.float64)
    speeds = {}
    for sweep, width in zip(implied["sweep"], half_power, strict=True):
        rates = np.abs(table.loc[table["sweep"] == sweep, "sweep_rate"].to_numpy(dtype=np.float64))
        rate = float(np.max(rates[np.isfinite(rates)], initial=0.0))
        if width > 0.0:
            speeds[str(sweep)] = rate / width**2
    return speeds
