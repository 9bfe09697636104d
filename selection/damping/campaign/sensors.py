"""Sensors of a campaign with wrong readings, and the reason for each: dead, reversed, wrong gain."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from damping.arrays import BoolArray, FloatArray
from damping.campaign.modal_fit import LEAST_T, Level
from damping.campaign.runs import CampaignRun, Channel
from damping.errors import InputError
from damping.formats.quantity import unit
from damping.formats.series import Samples

DEAD = 0.02  #: a sensor is dead if it reads less than this share of the median sensor
FOLLOWS = 0.9  #: least share of the mode in a sensor's motion at the mode's frequency, for the sensor to count
#: A sensor that reads more of the base than this below resonance, where 1 is right, has a wrong unit or gain: half way
#: between 2, of peak-to-peak values, and the third by which a fast sweep may be off.
MISREAD = 1.6
#: A share of the base this near to 1 or 0 is that of an absolute motion, or of one relative to the base or across it.
#: Mounting, calibration and the flank of a resonance cause half of it; rms values for peak are 0.29 off.
NEAR = 0.25
ACROSS = 0.1  #: largest share of the base that a sensor across it reads by transverse sensitivity and tilt
EXPLAINED = 0.05  #: largest relative deviation of a share from that of a wrong unit or scaling
ALIKE = 0.1  #: largest relative deviation of shares with a common factor from the median of the sensors
LEAST_SHARE = 0.3  #: share of the base below which a sensor does not follow it, if most do
LOWEST = 1.1  #: rows up to this many times the lowest frequency show the motion of the base
#: Share of the base by the mistake in scaling of amplitudes.
SCALINGS = {
    0.5: "peak-to-peak of the drive?",
    0.5**0.5: "rms for peak?",
    2.0**0.5: "rms of the drive for peak?",
    2.0: "peak-to-peak for peak?",
}
#: Possible units of motion, by the power of time.
UNITS: dict[int, tuple[str, ...]] = {0: ("m", "mm", "cm", "in", "ft"), -1: ("m/s", "mm/s", "cm/s", "in/s", "ft/s")}
UNITS[-2] = ("g", *(f"{length}/s^2" for length in UNITS[0]))
#: Change of a sensor's gain between levels, relative to the others, from which it is left out: slipping joints change
#: mode shapes by a few per cent.
CHANGED = 0.1
STANDS_OUT = 3.0  #: least ratio of that change to the largest change of the other sensors
#: Largest amplitude of a run over its median from which a drive moves as a sensor, beside one that is ``STEADY``: a
#: drive is held, or falls at resonances, where all that moves rises by 1/(2 z). Of 700 random campaigns (one to five
#: modes, force or base, drives held, falling, notched or stepped) none is named, of 400 exchanged ones 352: the others
#: barely rise. From a ratio of 2 on it would be 1 and 368. A response held on purpose looks alike where its force peaks
#: between two resonances, in 29 of 200 narrow bands: the error says what to state then.
PEAKED = 3.0
STEADY = 1.5  #: the same ratio up to which a sensor is held as a drive is; drives of exchanged campaigns reach 1.3


def find_exchanged(drive: Samples, sensors: Mapping[str, Samples]) -> str:
    """The steadiest of the ``sensors`` (n,) if it is as a drive, and the ``drive`` (n,) as a sensor; else ''."""
    if not sensors or not 2 <= np.argmax(np.abs(drive)) < len(drive) - 2 or _measure_peak(drive) < PEAKED:
        return ""
    name = min(sensors, key=lambda name: _measure_peak(sensors[name]))
    return name if _measure_peak(sensors[name]) < STEADY else ""


def _measure_peak(x: Samples) -> float:
    """Largest amplitude over the median; infinite for a sensor that reads nothing."""
    median = float(np.median(np.abs(x)))
    return float(np.max(np.abs(x))) / median if median > 0.0 else np.inf


def refuse_exchanged(found: Sequence[str]) -> None:
    """Raise InputError if drive and sensor are exchanged in every run; ``found``: of each, as of `find_exchanged`."""
    if found and all(found):
        message = f"the drive peaks as a sensor does, and {found[0]!r} is steady as a drive: they seem to be exchanged"
        roles = f"role = 'drive' of {found[0]!r} and 'sensor' of the other, with their units"
        expected = f"--correct FILE.toml: {roles}; or role = 'sensor' of {found[0]!r} if it was held on purpose"
        raise InputError(message, expected=expected)


def check_drives(runs: Sequence[CampaignRun], trusted: Collection[str]) -> None:
    """Raise InputError if drive and sensor are exchanged in every run; ``trusted``: sensors stated to be right."""
    motions = [{c.name: c.samples for c in run.channels if not c.per_drive and c.name not in trusted} for run in runs]
    pairs = zip(runs, motions, strict=True)
    refuse_exchanged([find_exchanged(run.drive, of) for run, of in pairs if run.drive is not None])


def find_misread(levels: Sequence[Level], trusted: Collection[str]) -> dict[str, str]:
    """Sensors with a wrong unit or gain by their reading of the base, with reasons.

    A sensor that reads ten times too much outweighs all others in the fit: modes must be fitted again without it.
    ``trusted``: sensors stated to be right. InputError: no sensor is left.
    """
    odd = _find_odd_shares(levels, trusted)
    bad = {name: found for name, found in odd.items() if abs(found[0]) > MISREAD or abs(found[0]) < NEAR}
    if len(bad) == len(levels[0].run.names):
        expected = "--correct FILE.toml with their unit or that of the drive, or role = 'sensor' of one that is right"
        raise InputError(f"every sensor is misread: {_join_shares(bad)}", expected=expected)
    why = "of the base below resonance: another unit than stated, or another gain (--correct: unit or scale)"
    return {name: f"misread: it reads {share:.3g}{cause} {why}" for name, (share, cause) in bad.items()}


def describe_shares(levels: Sequence[Level], trusted: Collection[str] = ()) -> list[str]:
    """A caution on the kept sensors that read another share of the base than 1 or 0; empty if there are none."""
    bad = find_bad_sensors(levels)
    odd = {name: share for name, share in _find_odd_shares(levels, trusted).items() if name not in bad}
    right = "below resonance a sensor reads 1 times the base, or 0 across or relative to it"
    other = "another unit, scaling or gain (--correct: unit or scale), a tilted axis, or a sweep from above a mode"
    return [f"caution: {right}; {_join_shares(odd)}: {other}"] if odd else []


def _join_shares(odd: Mapping[str, tuple[float, str]]) -> str:
    """Sensors and their shares of the base, grouped by cause."""
    groups = []
    for cause in dict.fromkeys(cause for _, cause in odd.values()):
        shares = {name: share for name, (share, sensor_cause) in odd.items() if sensor_cause == cause}
        ends = dict.fromkeys(f"{end(shares.values()):.3g}" for end in (min, max))
        verb = "reads" if len(shares) == 1 else "read"
        groups.append(f"{', '.join(map(repr, shares))} {verb} {' to '.join(ends)}{cause}")
    return ", ".join(groups)


def _find_odd_shares(levels: Sequence[Level], trusted: Collection[str]) -> dict[str, tuple[float, str]]:
    """The share of the base of each sensor that reads neither 1 nor 0 of it, with its cause if known.

    If most sensors have a known cause or one common factor, shares near 0 and 1 with a known cause are included. Else,
    if most are odd or fewer than half are close to 1 or 0, the sweep may begin above a mode, whose motion is in all of
    them: then only shares above ``MISREAD`` are included, and only if they are not the majority.
    """
    run = levels[0].run
    if not run.is_base_driven:
        return {}
    share, doubt = _measure_shares(levels)
    causes = [_explain(*of, run.drive_unit) for of in zip(share, doubt, run.channels, strict=True)]
    explained = np.array([bool(cause) for cause in causes])
    off = np.minimum(np.abs(share), np.abs(share - 1.0))
    odd = off > np.maximum(NEAR, doubt)
    common_share = np.abs(share - np.median(share)) < ALIKE * abs(np.median(share))
    common = explained | (odd & common_share & (len(share) > 1))
    if np.mean(common) > 0.5:
        odd |= explained
    elif np.mean(odd) > 0.5 or np.mean(off < ACROSS) < 0.5:
        odd &= (np.abs(share) > MISREAD) & (np.mean(odd) <= 0.5)
    rows = zip(run.names, odd, share, causes, strict=True)
    return {name: (float(part), cause) for name, is_odd, part, cause in rows if is_odd and name not in trusted}


def _explain(share: float, doubt: float, sensor: Channel, drive: str) -> str:
    """The wrong scaling, or unit of the sensor or of the ``drive``, that explains a share of the base; '': none."""
    causes = [*SCALINGS.items(), *((k, f"{other} for {sensor.unit}?") for other, k in _list_factors(sensor.unit))]
    causes += [(1.0 / k, f"the drive in {other} for {drive}?") for other, k in _list_factors(drive)]
    known = (cause for k, cause in causes if abs(share - k) < EXPLAINED * k and doubt < NEAR * k)
    return f" ({cause})" if (cause := next(known, "")) else ""


def _list_factors(text: str) -> list[tuple[str, float]]:
    """Other units of the same quantity, and the number of each in one of this unit."""
    this = unit(text)
    others = (other for other in UNITS.get(this.powers[2], ()) if not unit(other).agrees_with(this))
    return [(other, this.factor / unit(other).factor) for other in others]


def find_bad_sensors(levels: Sequence[Level]) -> dict[str, str]:
    """Sensors that are dead, change their gain, or are reversed against the base or against a force at the sensor."""
    bad, run = {}, levels[0].run
    size = np.median([np.median(np.abs(level.H), axis=1) for level in levels], axis=0)
    # share of the base motion in each sensor: 1 if absolute, 0 if relative or across
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
    return find_changed_gains(levels) | _find_changed_signs(levels) | bad


def find_unfit_sensors(names: Sequence[str], x: FloatArray, follows: FloatArray) -> dict[str, str]:
    """Sensors of a free decay x (sensors, n) that do not show a mode, with reasons; ``follows``: the mode's share."""
    size = np.std(x, axis=1)
    out: dict[str, str] = {}
    for name, motion, part in zip(names, size, follows, strict=True):
        if motion < DEAD * np.median(size):
            out[name] = "dead: it reads almost nothing"
        elif part < FOLLOWS:
            out[name] = f"only {100.0 * part:.0f} % of its motion there follows this mode"
    return out


def _measure_shares(levels: Sequence[Level]) -> tuple[FloatArray, FloatArray]:
    """Share of the base in each sensor (sensors,) and its uncertainty, medians over the levels."""
    share, doubt = np.median([_measure_base(level) for level in levels], axis=0)
    return share, doubt


def _measure_base(level: Level) -> tuple[FloatArray, FloatArray]:
    """Motion of each sensor (sensors,) over that of the base in the lowest rows, without the modes; its uncertainty.

    The constant of the fit in a mode's band is not this share: it includes unresolved neighbouring modes. The motion of
    modes that were not found grows about as f^2: the uncertainty is the change of a line in f^2 down to f = 0.
    """
    rows = level.f <= LOWEST * level.f[0]
    modes = level.fit.residues @ level.fit.columns(level.f[rows])[:, 2:].T
    residual = (level.H[:, rows] - modes).real
    square = level.f[rows] ** 2 / np.mean(level.f[rows] ** 2) - 1.0
    if len(square) < 2:
        return np.median(residual, axis=1), np.full(len(residual), NEAR)
    return np.median(residual, axis=1), np.abs(residual @ square) / (square @ square)


def find_changed_gains(levels: Sequence[Level]) -> dict[str, str]:
    """The sensor whose share of the modes' motion changes at one level, if one of three or more stands out.

    A shape hardly changes with level: ln|r| of a mode minus its median over the levels, minus the median of that over
    the sensors, is a change of gain. The median over the modes that the sensor shows is used.
    """
    names = levels[0].run.names
    if len(levels) < 2 or len(names) < 3:
        return {}
    r, seen = _list_residues(levels)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(seen, np.log(np.abs(r)), np.nan)
    known = np.count_nonzero(seen, axis=0) >= 3
    if not known.any():
        return {}
    size = size[..., known]
    moved = size - np.median(size, axis=0)
    moved -= np.nanmedian(moved, axis=1, keepdims=True)
    gain = np.array([_find_middle(of_sensor) for of_sensor in moved.swapaxes(0, 1)])  # (sensors, levels)
    change = np.ptp(gain, axis=1)
    worst = int(np.argmax(change))
    if change[worst] < CHANGED or change[worst] < STANDS_OUT * np.max(np.delete(change, worst)):
        return {}
    at = int(np.argmax(np.abs(gain[worst])))  # with two levels, either may be wrong
    times = np.exp(gain[worst, at] - np.median(np.delete(gain[worst], at)))
    elsewhere = f"its reading relative to the others in {'the other' if len(levels) == 2 else 'other runs'}"
    in_run = f"in run {levels[at].run.label!r} it reads {times:.3g} times"
    return {names[worst]: f"its gain changes: {in_run} {elsewhere}"}


def _list_residues(levels: Sequence[Level]) -> tuple[FloatArray, BoolArray]:
    """Residues (levels, sensors, modes), and which stand out of the noise at every level (sensors, modes)."""
    r = np.array([level.fit.residues for level in levels])
    sd = np.array([level.fit.residues_sd for level in levels])
    return r, np.all(np.abs(r) > LEAST_T * sd, axis=0)


def _find_changed_signs(levels: Sequence[Level]) -> dict[str, str]:
    """Sensors that move the other way at one level, in every mode that they show at all levels."""
    r, seen = _list_residues(levels)
    against = np.sign(r) * np.sign(np.sum(np.sign(r), axis=0) + 0.5 * np.sign(r[0])) < 0.0
    shown = seen.any(axis=1)
    turned = np.all(against | ~seen, axis=2) & shown  # (levels, sensors)
    reversed_drive = np.all(turned | ~shown, axis=1) & shown.any()
    if reversed_drive.any():
        run = levels[int(np.argmax(reversed_drive))].run
        message = f"in run {run.label!r} every sensor moves the other way than in other runs: its drive is reversed"
        raise InputError(message, expected="one polarity of the drive (--correct: out = true of that run)")
    return {
        name: f"its sign changes: in run {levels[int(np.argmax(of_sensor))].run.label!r} it moves the other way"
        for name, of_sensor in zip(levels[0].run.names, turned.T, strict=True)
        if of_sensor.any()
    }


def _find_middle(moved: FloatArray) -> FloatArray:
    """Medians (levels,) over a sensor's modes (levels, modes) with finite values; 0 if there are none."""
    known = moved[:, np.isfinite(moved).all(axis=0)]
    return np.asarray(np.median(known, axis=1)) if known.size else np.zeros(len(moved))
