"""Sensors of a campaign whose readings are not to be believed, each with why: dead, reversed, of another gain."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.modal_fit import LEAST_T, Level
from damping.campaign.runs import Channel
from damping.errors import InputError
from damping.formats.quantity import unit

DEAD = 0.02  #: a sensor is dead where it reads less than this share of what the sensors read in the middle
#: Least share of a sensor's motion at the frequency of a mode that is the mode's, for the sensor to count.
FOLLOWS = 0.9
#: A sensor that reads more of the base than this below resonance, where 1 is right, is in another unit or of another
#: gain: half way from 2 of peak-to-peak values to the third that a fast sweep may be off.
MISREAD = 1.6
#: A share of the base this near to 1 or 0 is that of an absolute motion or of one relative to it or across it: half of
#: mounting, of calibration and of the slope of a resonance; rms values for peak are 0.29 off.
NEAR = 0.25
ACROSS = 0.1  #: largest share of the base that a sensor across it reads by its transverse sensitivity and by tilt
EXPLAINED = 0.05  #: relative deviation up to which a share is that of a wrong unit or scaling
ALIKE = 0.1  #: relative deviation from the middle of the sensors up to which shares are one common factor
LEAST_SHARE = 0.3  #: share of the base below which a sensor does not follow it, where most do
LOWEST = 1.1  #: rows up to this many times the lowest frequency show the motion of the base
#: What a share of the base is where amplitudes are not those of the drive.
SCALINGS = {
    0.5: "peak-to-peak of the drive?",
    0.5**0.5: "rms for peak?",
    2.0**0.5: "rms of the drive for peak?",
    2.0: "peak-to-peak for peak?",
}
#: Units that a motion may be in, by the power of time.
UNITS: dict[int, tuple[str, ...]] = {0: ("m", "mm", "cm", "in", "ft"), -1: ("m/s", "mm/s", "cm/s", "in/s", "ft/s")}
UNITS[-2] = ("g", *(f"{length}/s^2" for length in UNITS[0]))
#: Change of a sensor's gain from level to level beside the others at which it is left out: mode shapes of joints that
#: slip change by a few per cent.
CHANGED = 0.1
#: ... and how many times the other sensors' largest change it is.
STANDS_OUT = 3.0


def find_misread(levels: Sequence[Level], trusted: Collection[str] = ()) -> dict[str, str]:
    """Sensors that are in another unit or of another gain by what they read of the base, each with why.

    One that reads ten times too much outweighs all others in the fit: modes are to be sought again without it.
    ``trusted``: stated to be right. InputError: no sensor is left.
    """
    odd = _find_odd_shares(levels, trusted)
    bad = {name: told for name, told in odd.items() if abs(told[0]) > MISREAD or abs(told[0]) < NEAR}
    if len(bad) == len(levels[0].run.names):
        expected = "--correct FILE.toml with their unit or that of the drive, or role = 'sensor' of one that is right"
        raise InputError(f"every sensor is misread: {_join_shares(bad)}", expected=expected)
    why = "of the base below resonance: another unit than stated, or another gain (--correct: unit or scale)"
    return {name: f"misread: it reads {share:.3g}{cause} {why}" for name, (share, cause) in bad.items()}


def describe_shares(levels: Sequence[Level], trusted: Collection[str] = ()) -> list[str]:
    """A caution of the sensors that read another share of the base than 1 or 0, of those that are not left out."""
    bad = find_bad_sensors(levels)
    odd = {name: told for name, told in _find_odd_shares(levels, trusted).items() if name not in bad}
    right = "below resonance a sensor reads 1 times the base, or 0 across or relative to it"
    other = "another unit, scaling or gain (--correct: unit or scale), a tilted axis, or a sweep from above a mode"
    return [f"caution: {right}; {_join_shares(odd)}: {other}"] if odd else []


def _join_shares(odd: Mapping[str, tuple[float, str]]) -> str:
    """Sensors and what they read of the base, those with one cause together."""
    told = []
    for cause in dict.fromkeys(cause for _, cause in odd.values()):
        shares = {name: share for name, (share, own) in odd.items() if own == cause}
        ends = dict.fromkeys(f"{end(shares.values()):.3g}" for end in (min, max))
        verb = "reads" if len(shares) == 1 else "read"
        told.append(f"{', '.join(map(repr, shares))} {verb} {' to '.join(ends)}{cause}")
    return ", ".join(told)


def _find_odd_shares(levels: Sequence[Level], trusted: Collection[str]) -> dict[str, tuple[float, str]]:
    """The share of the base of each sensor that reads neither 1 nor 0 of it, with what explains it.

    Where most sensors have an explanation or one common factor, explained shares near 0 and 1 are told too. Else, where
    most are odd or fewer than half read 1 or 0 closely, the sweep may begin above a mode, whose motion is in all of
    them: then a share is told from ``MISREAD`` on, and only beside a majority of others.
    """
    run = levels[0].run
    if not run.is_base_driven:
        return {}
    share, doubt = _measure_shares(levels)
    causes = [_explain(*of, run.drive_unit) for of in zip(share, doubt, run.channels, strict=True)]
    explained = np.array([bool(cause) for cause in causes])
    off = np.minimum(np.abs(share), np.abs(share - 1.0))
    odd = off > np.maximum(NEAR, doubt)
    alike = np.abs(share - np.median(share)) < ALIKE * abs(np.median(share))
    common = explained | (odd & alike & (len(share) > 1))
    if np.mean(common) > 0.5:
        odd |= explained
    elif np.mean(odd) > 0.5 or np.mean(off < ACROSS) < 0.5:
        odd &= (np.abs(share) > MISREAD) & (np.mean(odd) <= 0.5)
    told = zip(run.names, odd, share, causes, strict=True)
    return {name: (float(part), cause) for name, is_odd, part, cause in told if is_odd and name not in trusted}


def _explain(share: float, doubt: float, sensor: Channel, drive: str) -> str:
    """The wrong scaling, or unit of the sensor or of the ``drive``, that gives such a share of the base; '': none."""
    causes = [*SCALINGS.items(), *((k, f"{other} for {sensor.unit}?") for other, k in _list_factors(sensor.unit))]
    causes += [(1.0 / k, f"the drive in {other} for {drive}?") for other, k in _list_factors(drive)]
    known = (cause for k, cause in causes if abs(share - k) < EXPLAINED * k and doubt < NEAR * k)
    return f" ({cause})" if (cause := next(known, "")) else ""


def _list_factors(text: str) -> list[tuple[str, float]]:
    """Other units of the same kind, and how many of each make one of this."""
    own = unit(text)
    others = (other for other in UNITS.get(own.powers[2], ()) if not unit(other).agrees_with(own))
    return [(other, own.factor / unit(other).factor) for other in others]


def find_bad_sensors(levels: Sequence[Level]) -> dict[str, str]:
    """Sensors that are dead, of a gain that changes, or reversed where all see the base or the force acts at them."""
    bad, run = {}, levels[0].run
    size = np.median([np.median(np.abs(level.H), axis=1) for level in levels], axis=0)
    # share of the base's own motion in each sensor: 1 where it is absolute, 0 where relative or across
    base, doubt = _measure_shares(levels)
    across = np.maximum(ACROSS, doubt)
    moves = np.any([np.abs(level.fit.residues) > LEAST_T * level.fit.residues_sd for level in levels], axis=(0, 2))
    absolute = run.is_base_driven and np.median(base) > 0.5
    for s, name in enumerate(run.names):
        if size[s] < DEAD * np.median(size):
            bad[name] = "dead: it reads almost nothing"
        elif absolute and abs(base[s]) < LEAST_SHARE and not (moves[s] and abs(base[s]) < across[s]):
            bad[name] = f"dead: it follows {base[s]:.2f} of the base, others {np.median(base):.2f}"
        elif absolute and base[s] < -across[s]:
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
            out[name] = "dead: it reads almost nothing"
        elif part < FOLLOWS:
            out[name] = f"only {100.0 * part:.0f} % of its motion there follows this mode"
    return out


def _measure_shares(levels: Sequence[Level]) -> tuple[FloatArray, FloatArray]:
    """Share of the base in each sensor (sensors,) and its doubt, in the middle of the levels."""
    share, doubt = np.median([_measure_base(level) for level in levels], axis=0)
    return share, doubt


def _measure_base(level: Level) -> tuple[FloatArray, FloatArray]:
    """Motion of each sensor (sensors,), per that of the base, in the lowest rows, without that of the modes; its doubt.

    In a mode's band the constant of the fit is no such share: neighbours too close to be told apart are in it. What
    modes that were not found leave grows about as f^2: the doubt is what a line in f^2 loses on the way to f = 0.
    """
    rows = level.f <= LOWEST * level.f[0]
    modes = level.fit.residues @ level.fit.columns(level.f[rows])[:, 2:].T
    left = (level.H[:, rows] - modes).real
    square = level.f[rows] ** 2 / np.mean(level.f[rows] ** 2) - 1.0
    if len(square) < 2:
        return np.median(left, axis=1), np.full(len(left), NEAR)
    return np.median(left, axis=1), np.abs(left @ square) / (square @ square)


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
    told = (
        f"{times:.3g} times its reading relative to the others in {'the other' if len(levels) == 2 else 'other runs'}"
    )
    return {names[worst]: f"its gain changes: in run {levels[at].run.label!r} it reads {told}"}


def _find_middle(moved: FloatArray) -> FloatArray:
    """Medians (levels,) of what is known of a sensor's modes, (levels, modes); 0 where nothing is."""
    known = moved[:, np.isfinite(moved).all(axis=0)]
    return np.asarray(np.median(known, axis=1)) if known.size else np.zeros(len(moved))
