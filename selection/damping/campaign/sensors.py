"""Sensors of a campaign whose readings are not to be believed, each with why: dead, reversed, of another gain."""

from collections.abc import Sequence

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.modal_fit import LEAST_T, Level

DEAD = 0.02  #: a sensor is dead where it reads less than this share of what the sensors read in the middle
#: Least share of a sensor's motion at the frequency of a mode that is the mode's, for the sensor to count.
FOLLOWS = 0.9
#: A sensor that reads more of the base than this below resonance, where 1 is right, is in another unit or of another
#: gain: the share comes out within a third of 1 even of a fast sweep, and m/s^2 read as g make 9.8 of it.
MISREAD = 2.0
LOWEST = 1.1  #: rows up to this many times the lowest frequency show the motion of the base
#: Change of a sensor's gain from level to level beside the others at which it is left out: mode shapes of joints that
#: slip change by a few per cent.
CHANGED = 0.1
#: ... and how many times the other sensors' largest change it is.
STANDS_OUT = 3.0


def find_misread(levels: Sequence[Level]) -> dict[str, str]:
    """Sensors that read a multiple of the base where half of them read the base itself, each with why.

    One that reads ten times too much outweighs all others in the fit: modes are to be sought again without it.
    """
    share = np.median([_measure_base(level) for level in levels], axis=0)
    if not levels[0].run.is_base_driven or not 1.0 / MISREAD < np.median(share) < MISREAD:
        return {}
    why = "of the base below resonance: another unit than the file says, or another gain (--correct: unit or scale)"
    parts = zip(levels[0].run.names, share, strict=True)
    return {name: f"misread: it reads {part:.3g} {why}" for name, part in parts if abs(part) > MISREAD}


def find_bad_sensors(levels: Sequence[Level]) -> dict[str, str]:
    """Sensors that are dead, of a gain that changes, or reversed where all see the base or the force acts at them."""
    bad, run = {}, levels[0].run
    size = np.median([np.median(np.abs(level.H), axis=1) for level in levels], axis=0)
    # share of the base's own motion in each sensor: 1 where it is absolute, 0 where relative
    base = np.median([_measure_base(level) for level in levels], axis=0)
    absolute = run.is_base_driven and np.median(base) > 0.5
    for s, name in enumerate(run.names):
        if size[s] < DEAD * np.median(size):
            bad[name] = "dead: it reads next to nothing"
        elif absolute and abs(base[s]) < 0.3:
            bad[name] = f"dead: it follows {base[s]:.2f} of the base, others {np.median(base):.2f}"
        elif absolute and base[s] < 0.0:
            bad[name] = "reversed: it moves against the base below resonance"
    if not run.is_base_driven:
        residues = np.median([level.fit.residues for level in levels], axis=0)
        at_drive = [s.name for s, row in zip(run.channels, residues, strict=True) if s.at_drive and np.all(row < 0.0)]
        bad |= dict.fromkeys(at_drive, "reversed: it moves against the force where the force acts")
    return find_changed_gains(levels) | bad


def find_unfit_sensors(names: Sequence[str], x: FloatArray, follows: FloatArray) -> dict[str, str]:
    """Sensors of a free decay x (sensors, n) with nothing of a mode, each with why; ``follows``: the mode's share."""
    size = np.std(x, axis=1)
    out: dict[str, str] = {}
    for name, motion, part in zip(names, size, follows, strict=True):
        if motion < DEAD * np.median(size):
            out[name] = "dead: it reads next to nothing"
        elif part < FOLLOWS:
            out[name] = f"only {100.0 * part:.0f} % of its motion there follows this mode"
    return out


def _measure_base(level: Level) -> FloatArray:
    """Motion of each sensor (sensors,), per that of the base, in the lowest rows, without that of the modes.

    In a mode's band the constant of the fit is no such share: neighbours too close to be told apart are in it.
    """
    rows = level.f <= LOWEST * level.f[0]
    modes = level.fit.residues @ level.fit.columns(level.f[rows])[:, 2:].T
    return np.asarray(np.median((level.H[:, rows] - modes).real, axis=1))


def find_changed_gains(levels: Sequence[Level]) -> dict[str, str]:
    """The sensor whose share of the modes' motion is another at one level, where one stands out of three or more.

    A shape hardly changes with level: ln|r| of a mode less its median over the levels, less that of the sensors in the
    middle, is a gain. Of several modes the median counts, each where the sensor moves with it.
    """
    names = levels[0].run.names
    if len(levels) < 2 or len(names) < 3:
        return {}
    r = np.abs([level.fit.residues for level in levels])  # (levels, sensors, modes)
    sd = np.array([level.fit.residues_sd for level in levels])
    seen = np.all(r > LEAST_T * sd, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(seen, np.log(r), np.nan)
    known = np.count_nonzero(seen, axis=0) >= 3
    if not known.any():
        return {}
    size = size[..., known]
    moved = size - np.median(size, axis=0)
    moved -= np.nanmedian(moved, axis=1, keepdims=True)
    gain = np.array([_find_middle(own) for own in moved.swapaxes(0, 1)])  # (sensors, levels)
    change = np.ptp(gain, axis=1)
    worst = int(np.argmax(change))
    if change[worst] < CHANGED or change[worst] < STANDS_OUT * np.max(np.delete(change, worst)):
        return {}
    at = int(np.argmax(np.abs(gain[worst])))  # of two levels neither is the odd one
    times = np.exp(gain[worst, at] - np.median(np.delete(gain[worst], at)))
    told = f"{times:.3g} times what it reads beside the others in {'the other' if len(levels) == 2 else 'other runs'}"
    return {names[worst]: f"its gain changes: in run {levels[at].run.label!r} it reads {told}"}


def _find_middle(moved: FloatArray) -> FloatArray:
    """Medians (levels,) of what is known of a sensor's modes, (levels, modes); 0 where nothing is."""
    known = moved[:, np.isfinite(moved).all(axis=0)]
    return np.asarray(np.median(known, axis=1)) if known.size else np.zeros(len(moved))
