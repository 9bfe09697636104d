"""Checks of the phase: its unit, its sign, a constant that all phases carry."""

from __future__ import annotations

from math import pi

import numpy as np

from damping.records.view import Finding, View, label_sweeps, name_sweeps


def check_phase_unit(view: View) -> Finding | None:
    """Phases that are no radians: they turn far more than a mode can, or have nothing to do with the amplitudes."""
    if not view.incoherent or not view.curve:
        return None
    what = f"the phases of {name_sweeps(view.incoherent)} jump or turn as no lag in radians does"
    what += ", though the amplitudes do not"
    advice = "are they degrees? divide by 57.3 (degrees taken modulo 2 pi cannot be saved: import the file anew)"
    return Finding("phase-unit", "refuse", what, advice, view.incoherent)


_KINDS = {
    "negated": (
        "falls through -pi/2: it is the lead of the displacement, or of force over displacement",
        "negate it",
    ),
    "minus pi": (
        "runs from -pi to 0: half a turn too small, as of a sensor mounted backwards or an acceleration's lag",
        "add pi, or reverse the sensor",
    ),
    "acceleration": ("falls from pi to 0: it is the lead of the acceleration", "take pi - phase"),
}


def check_phase_sign(view: View) -> Finding | None:
    """Phases by which the structure would give energy."""
    if not view.wrong_sign:
        return None
    kinds = list(dict.fromkeys(view.wrong_sign.values()))
    what = " and ".join(f"the phase {_KINDS[kind][0]}" for kind in kinds)
    what += ", so that the structure would give energy; wanted is the lag of displacement behind force, 0 to pi"
    advice = "; ".join(dict.fromkeys(_KINDS[kind][1] for kind in kinds)) + " (lead_deg where the file is imported)"
    return Finding("phase-sign", "refuse", what, advice, tuple(view.wrong_sign))


#: A constant offset is one beyond this, rad, in the mean and in most sweeps: phase meters are good to 2 degrees.
OFFSET = 0.04
#: It is one beyond so many standard errors, too.
OFFSET_ERRORS = 3.0


def check_phase_offset(view: View) -> Finding | None:
    """A constant that all phases carry: they are not pi/2 where rows of like amplitude say the resonance is."""
    turns = [(run, turn) for run, turn in zip(view.runs, view.turns, strict=True) if turn and turn.both_sides]
    turns = [(run, turn) for run, turn in turns if run.sweep not in view.wrong_sign]
    if not turns:
        return None
    offsets = np.array([turn.offset for _, turn in turns])
    middle = float(np.median(offsets))
    spread = float(np.sqrt(np.mean([turn.scatter**2 for _, turn in turns]) / len(turns)))
    other_law = float(np.median([turn.damping for _, turn in turns]))
    if (
        abs(middle) < max(OFFSET + other_law, OFFSET_ERRORS * spread)
        or np.mean(offsets * np.sign(middle) > 0.5 * OFFSET) < 0.5
    ):
        return None
    sweeps = label_sweeps(run for run, turn in turns if abs(turn.offset) > 0.5 * OFFSET)
    way = "large" if middle > 0.0 else "small"
    what = f"the phases are {abs(middle):.3f} rad ({np.degrees(abs(middle)):.1f} degrees) too {way}"
    what += f" in {name_sweeps(sweeps)}: they are not pi/2 between rows of like amplitude"
    far = abs(middle) > 0.25 * pi
    advice = (
        f"correct the delay of the channels (lead_deg = {np.degrees(middle):.1f}), or look for a second mode beside"
    )
    return Finding("phase-offset", "refuse" if far else "caution", what, advice, sweeps)
