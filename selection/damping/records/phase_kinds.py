"""Kinds of phases: the lag of the displacement, another quantity's, or angles that are unrelated to the amplitudes."""

from collections.abc import Callable
from dataclasses import replace
from math import pi

import numpy as np

from damping.arrays import FloatArray
from damping.records.implied import Implied, measure_miss
from damping.records.runs import FALL, NOISE_BESIDE_FALL, Run, has_resonance

#: Median distance of Y from a straight line, over |Y|, above which phases are unrelated to amplitudes.
INCOHERENT = 0.5
SMOOTH = 0.75  #: mean cosine of the steps of phase from row to row below which phases are not a smooth curve
MOST_RADIANS = 6.0 * pi  #: largest range of a phase over a few modes; phases in degrees pass 180
CERTAIN = 4.0  #: standard errors from 0 beyond which the sign of a mean sine of the phase is certain
#: Least |sine| of the phase at the row of largest A/F from which that sign is certain too, if the sines of all rows
#: have it: no noise turns a phase so far. Of 2203 sweeps with phases of the wrong sign, 3 go unnoticed with this and
#: ``CERTAIN_BESIDE``, and 46 without; none of 1434 sweeps with the right sign is taken for one of the wrong sign.
CERTAIN_AT_PEAK = 0.7
CERTAIN_BESIDE = 2.0  #: standard errors that suffice for the kind that other sweeps of the record certainly have


def is_in_turns(run: Run) -> bool:
    """Whether the phases pass a resonance within one radian, and fit a line in Y better if read as turns."""
    assert run.phase is not None
    if np.abs(run.phase).max() > 1.0 or not has_resonance(run, None):
        return False
    return measure_miss(replace(run, phase=2.0 * pi * run.phase)) < measure_miss(run)


def is_incoherent(run: Run, turn: Implied) -> bool:
    """Whether the phases of a run are unrelated to its amplitudes, turn more than any mode can, or are in turns."""
    assert run.phase is not None
    in_turns = is_in_turns(run)
    if in_turns or len(run) < 6:
        return in_turns
    jumps = float(np.mean(np.cos(np.diff(run.phase)))) < SMOOTH
    return bool(np.ptp(np.unwrap(run.phase)) > MOST_RADIANS) or (turn.miss > INCOHERENT and jumps)


#: Conversion of each kind of phase to the lag of the displacement.
AS_LAG: dict[str, Callable[[FloatArray], FloatArray]] = {
    "": lambda phase: phase,
    "negated": lambda phase: -phase,
    "minus pi": lambda phase: phase + pi,
    "acceleration": lambda phase: pi - phase,
    "folded": lambda phase: np.mod(phase, pi),
}
#: Least cosine of a phase between -pi/2 and pi/2, with noise; its largest where A/F is largest: that of pi/4.
_WITHIN = -0.1
_TURNED = 0.7


def classify_phase(run: Run, turn: Implied, certain: float = CERTAIN) -> str:
    """Kind of a phase that is not a lag, of ``AS_LAG``; empty if it may be a lag.

    A lag between 0 and pi has a negative sine once negated or reduced by pi: a phase whose sine is positive at every
    row is neither, whatever line its rows follow beside the resonance. The mean sine of few rows across a narrow
    resonance is uncertain, because one is large; where all have one sign, it is that of the mean. ``certain``: least
    standard errors of the mean.
    """
    assert run.phase is not None
    peak = int(np.argmax(run.compliance))
    if is_folded(run.phase, peak):
        return "folded"
    half = abs(round(turn.offset / (0.5 * pi))) == 2  # the offset is nearest to half a turn
    sine = np.sin(run.phase - turn.offset)
    agree = bool(np.all(sine * sine[peak] > 0.0)) and abs(sine[peak]) > CERTAIN_AT_PEAK
    sign = np.sign(turn.energy_sign) if agree or abs(turn.energy_sign) > certain else 0.0
    kind = ("acceleration" if half else "negated") if sign < 0.0 else ""
    if half and sign > 0.0:
        kind = "minus pi"
    return "" if kind != "acceleration" and bool(np.all(np.sin(run.phase) > 0.0)) else kind


def is_folded(phase: FloatArray, peak: int) -> bool:
    """Whether a phase is a lag modulo pi, as an arc tangent gives: positive before resonance and negative after it.

    The lead of a velocity is so too, but passes 0 at resonance (row ``peak``).
    """
    if not 0 < peak < len(phase) - 1 or np.cos(phase).min() < _WITHIN or np.cos(phase[peak]) > _TURNED:
        return False
    return bool(np.median(phase[:peak]) > 0.0 > np.median(phase[peak + 1 :]))


def has_antiresonance(run: Run) -> bool:
    """Whether the phase, between 0 and pi, falls through pi/2 where A/F is least, as with a vibration absorber.

    The lead of an acceleration also falls through pi/2, but where A/F is largest.
    """
    if run.phase is None or np.mean(np.sin(run.phase)) <= 0.0:
        return False
    cos, g = np.cos(run.phase), run.compliance
    fallen = np.flatnonzero((cos[:-1] <= 0.0) & (cos[1:] > 0.0))
    if len(fallen) == 0:
        return False
    first, last = int(fallen[0]), int(fallen[-1]) + 1  # the rows about all falls, which resonances may surround
    if first == 0 or last == len(run) - 1:
        return False
    rise = min(g[:first].max(), g[last + 1 :].max()) - g[first : last + 1].max()
    return bool(rise > max(FALL, NOISE_BESIDE_FALL * run.noise))
