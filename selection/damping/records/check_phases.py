"""Checks of phases: radians, the lag of the displacement behind the force, no constant offset."""

from math import pi

import numpy as np

from damping.effects.rig import LARGEST_LAG
from damping.records.check_sweeps import check_several_modes
from damping.records.implied import SURE_OF_LINE, Implied
from damping.records.phase_kinds import has_antiresonance, is_in_turns
from damping.records.view import MOST_OFFSET, Finding, NamedFinding, View, label_sweeps, name_sweeps


def check_phase_unit(view: View) -> Finding | None:
    """Phases not in radians: they turn far more than a mode can, or are unrelated to the amplitudes.

    In few rows, phases that turn back where the amplitude is least, between two resonances, are no fault of the unit.
    """
    if not view.incoherent or not view.curve:
        return None
    incoherent = [run for run in view.runs if run.sweep in view.incoherent]
    if all(map(has_antiresonance, incoherent)) and (split := check_several_modes(view)) and split.verdict == "refuse":
        return None
    what = f"the phases of {name_sweeps(view.incoherent)} jump or turn unlike any lag in radians"
    what += ", though the amplitudes do not"
    advice = "are they degrees? divide by 57.3 (degrees taken modulo 2 pi cannot be recovered: import the file again)"
    if all(map(is_in_turns, incoherent)):
        what = f"the phases of {name_sweeps(view.incoherent)} pass the resonance within one radian"
        advice = "are they turns? multiply by 2 pi"
    return Finding("phase-unit", "refuse", what, advice, view.incoherent)


_KINDS = {
    "negated": ("falls through -pi/2: it is the lead of the displacement, or of force over displacement", "negate it"),
    "minus pi": (
        "runs from -pi to 0: half a turn too small, as with a sensor mounted backwards or an acceleration's lag",
        "add pi (before it is conditioned: lag = -pi in [node]), or reverse the sensor",
    ),
    "acceleration": ("falls from pi to 0: it is the lead of the acceleration", "take pi - phase"),
    "folded": ("falls from pi/2 to -pi/2 at resonance: an arc tangent without quadrant", "add pi where it is negative"),
}


def check_phase_sign(view: View) -> Finding | None:
    """Phases with which the structure would supply energy."""
    if not view.wrong_sign:
        return None
    wrong = view.wrong_sign
    kinds = {kind: [sweep for sweep in wrong if wrong[sweep] == kind] for kind in dict.fromkeys(wrong.values())}
    all_alike = len(kinds) == 1 and len(wrong) == len(view.record.sweeps)
    named = {kind: "" if all_alike else f" of {name_sweeps(sweeps)}" for kind, sweeps in kinds.items()}
    what = " and ".join(f"the phase{named[kind]} {_KINDS[kind][0]}" for kind in kinds)
    what += ", so the structure would supply energy; the phase must be the lag of displacement behind force, 0 to pi"
    advice = "; ".join(_KINDS[kind][1] + named[kind].replace(" of ", " in ") for kind in kinds)
    imported = "" if "folded" in kinds else " (lead_deg where the file is imported)"
    advice += imported if all_alike else ", and leave the others as they are"
    return Finding("phase-sign", "refuse", what, advice, tuple(view.wrong_sign))


#: Least phase offset, rad, in the median and, by half, in most sweeps: phase meters are accurate to 2 degrees.
OFFSET = 0.04
OFFSET_ERRORS = 3.0  #: and least number of standard errors
#: Lag, rad, of a swept resonance against a steady one, over (df/dt)/(2 zeta f)^2: a' = -i a omega'/(zeta omega) adds
#: 2 M omega omega'/(zeta omega) to the stiffness (`damping.predict.sweep_rate`), which turns c omega by that angle.
DRAGGED_PER_RATE = 2.0 / pi


def check_phase_offset(view: View) -> Finding | None:
    """A constant offset of all phases: they are not pi/2 at the resonance that pairs of equal amplitude imply.

    A diagnosis names one up to ``LARGEST_LAG``, within the accuracy of a phase meter; a larger one is another quantity,
    such as the phase of a velocity.
    """
    turns = [(run, turn) for run, turn in view.turns if turn and (turn.both_sides or _is_far(turn))]
    turns = [(run, turn) for run, turn in turns if run.sweep not in view.wrong_sign]
    if not turns:
        return None
    offsets = np.array([turn.offset for _, turn in turns])
    middle = float(np.median(offsets))
    spread = float(np.sqrt(np.mean([turn.scatter**2 for _, turn in turns]) / len(turns)))
    other_law = float(np.median([turn.damping for _, turn in turns]))
    in_most = np.mean(offsets * np.sign(middle) > 0.5 * OFFSET) >= 0.5
    dragged = DRAGGED_PER_RATE * max(view.rates.values(), default=0.0)
    if abs(middle) < max(OFFSET + other_law + dragged, OFFSET_ERRORS * spread) or not in_most:
        return None
    sweeps = label_sweeps(run for run, turn in turns if abs(turn.offset) > 0.5 * OFFSET)
    way = "large" if middle > 0.0 else "small"
    what = f"the phases are {abs(middle):.3f} rad ({np.degrees(abs(middle)):.1f} degrees) too {way}"
    what += f" in {name_sweeps(sweeps)}: they are not pi/2 between rows of like amplitude"
    far = abs(middle) > MOST_OFFSET
    taken = f"{'take' if middle > 0.0 else 'add'} {abs(middle):.3f} {'off' if middle > 0.0 else 'to'} the column phase"
    before = f"before it is conditioned: lag = {middle:.3f} rad in [node], in the unit of the phase there"
    advice = f"correct the delay of the channels ({taken}; {before}), or look for a second mode beside"
    kind = NamedFinding if abs(middle) < LARGEST_LAG + OFFSET else Finding
    return kind("phase-offset", "refuse" if far else "caution", what, advice, sweeps)


def _is_far(turn: Implied) -> bool:
    """Whether a run too short for pairs has phases of another quantity: a bent resonance does not turn its line so."""
    return turn.scatter < SURE_OF_LINE and abs(turn.offset) > MOST_OFFSET
