"""Checks of a mode file: by itself, and against a record whose mass, frequency or damping may be of another mode."""

from math import hypot, inf, log

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.forces import component, damping_ratio, from_damping
from damping.records.check_edges import list_at_edge
from damping.records.check_levels import FAR_MASS, FAR_MASS_WITHOUT_PHASE, compare_masses, list_medians
from damping.records.check_units import (
    LARGEST_RATIO,
    LARGEST_TOLERANCE,
    LEAST_RATIO,
    SMALL_RATIO,
    name_factor,
    name_unit,
)
from damping.records.mode import Mode, Units
from damping.records.view import Finding, View, take_median


def check_tolerances(view: View) -> Finding | None:
    """Relative uncertainties in a mode file that are larger than the values, as per cents taken for shares are."""
    tables = (("mode.tolerance", view.mode.tolerance), ("repeatability", view.mode.repeatability)) if view.mode else ()
    stated = [(f"{key} in [{name}]", value) for name, table in tables for key, value in vars(table).items() if value]
    large = [f"{100.0 * value:g} % of {key}" for key, value in stated if value > LARGEST_TOLERANCE]
    if not large:
        return None
    what = f"the mode file states an uncertainty of {' and of '.join(large)}"
    return Finding("units", "caution", what, "are they per cents? give shares: 0.02 for 2 %", view.record.sweeps)


def check_base_unit(view: View) -> Finding | None:
    """A base acceleration named in g beside a length: answers, and design levels, are in length/time^2."""
    units = view.mode.units if view.mode and view.mode.drive == "base" else Units()
    of_base = units.of_base_drive.force
    if units.force != "g" or not of_base:
        return None
    what = f"the mode file names g for the base's acceleration, which is taken in {of_base}, as its length and time say"
    advice = f"give the column force, and design levels, in {of_base}"
    return Finding("units", "caution", what, advice, view.record.sweeps)


_OTHER_TIMES = ("ns", "us", "µs", "ms", "min", "minute", "minutes", "h", "hour", "hours")  #: named, and not seconds


def check_time_unit(view: View) -> Finding | None:
    """A unit of time other than the second, while frequencies are in Hz: coefficients and masses are per second."""
    text = view.mode.units.time if view.mode else ""
    if text.lower() not in _OTHER_TIMES:
        return None
    what = f"the mode file names {text} as the unit of time, while frequencies are in Hz"
    advice = 'coefficients are found in seconds: give time = "s", and the mass in the unit of force times s^2/length'
    return Finding("units", "caution", what, advice, view.record.sweeps)


#: Damping ratios of assembled structures that have a resonance to test: bolted and welded ones have 0.001 and more,
#: soils, sloshing and dampers up to 0.15. Only where no row implies a mass, which shows a wrong unit better.
USUAL_RATIOS = (5e-4, 0.2)
FAR_FREQUENCY = 1.1  #: factor from which the frequency of the lowest level, bent least, is far from the mode file's
FAR_DAMPING = 5.0  #: the same for the damping ratio, the least known input of a simulation
NEAR_NAMED = 0.4  #: distance (ln) from a factor between units within which such a ratio is called by it
#: Without phases, masses agree if three levels or more, with forces that differ by this factor, scatter by less than
#: the share ``AGREE`` of their distance (ln) from the mode file's mass: bending changes with amplitude, gains do not.
AGREE_OVER = 2.0
FEWEST_AGREE = 3
AGREE = 0.1
OTHER_MODE = 1.25  #: a mode farther than this factor outside the range of the rows is not in the record


def check_beyond_model(view: View) -> Finding | None:
    """Mass, frequency or damping far from the mode file's."""
    if view.mode is None or view.implied.empty:
        return None
    differences = []
    table = view.implied.sort_values("force", kind="stable")
    added = list_medians(view, view.record.added_masses, table)
    hertz = table["frequency"].to_numpy(dtype=np.float64) * np.sqrt(1.0 + added / view.mode.mass)  # without added mass
    frequency = float(hertz[0])
    if abs(log(frequency / view.mode.frequency)) > log(FAR_FREQUENCY):
        differences.append(f"resonance at {frequency:.4g} Hz, {view.mode.frequency:.4g} Hz in the mode file")
    sure = view.paired or _agree(view)
    far_mass = FAR_MASS if sure else FAR_MASS_WITHOUT_PHASE
    base = view.mode.drive == "base"
    if not base and view.straight and view.mass_ratio > 0.0 and abs(log(view.mass_ratio)) > log(far_mass):
        name = name_factor(view.mass_ratio)
        differences.append(f"the rows imply {view.mass_ratio:.3g} times its mass" + (f" ({name}?)" if name else ""))
    simulated, zeta = view.mode.viscous_ratio, float(table["damping_ratio"].iloc[0])
    if str(table["sweep"].iloc[0]) in list_at_edge(view) and _is_beside(view.mode, frequency, zeta):
        zeta = float("nan")  # not known; the finding on that edge says so
    advice = "check the gain of the sensor, that it reads displacement, and the mode file"
    of_all = _total_ratio(view.mode, frequency, float(table["amplitude"].iloc[0]))
    if simulated and zeta > 0.0 and (zeta > FAR_DAMPING * of_all or FAR_DAMPING * zeta < simulated):
        stated = max(of_all, simulated) if zeta > simulated else simulated
        name = name_unit((zeta - stated) / simulated + 1.0, view.mode.units, within=NEAR_NAMED)
        beside = f", {stated:.3g} in the mode file{f' ({name}?)' if name else ''}"
        differences.append(f"a damping ratio of {zeta:.3g}{beside}")
    elif not simulated and (unusual := _describe_unusual_ratio(view, zeta)):
        name = f" ({name_unit(zeta / 0.01, view.mode.units)}?)" if zeta < SMALL_RATIO else ""
        differences.append(f"a damping ratio of {zeta:.3g}, {unusual} than assembled structures have{name}")
        advice = "check the units of force and response, that their columns are not exchanged, and the mass"
    if not differences:
        return _compare_structures(view, view.mode, hertz) or _compare_frequencies(view, view.mode, hertz)
    swept = view.record.column("frequency")
    other = not swept.min() / OTHER_MODE < view.mode.frequency < swept.max() * OTHER_MODE
    advice = "model and record are of different modes" if other else advice
    return Finding("beyond-model", "refuse" if other else "caution", "; ".join(differences), advice, view.record.sweeps)


def _total_ratio(mode: Mode, frequency: float, amplitude: float) -> float:
    """Damping ratio of all simulated forces at a frequency (Hz) and amplitude; infinite if effects add to several."""
    if len(mode.damping) == 1 or mode.effects:
        return mode.viscous_ratio if len(mode.damping) == 1 else inf
    omega = RAD_S_PER_HZ * frequency
    held = float(np.asarray(from_damping(mode.damping).quadrature(amplitude, omega)))
    return float(damping_ratio(held, amplitude, mode.mass * omega**2))


def _describe_unusual_ratio(view: View, zeta: float) -> str:
    """``less`` or ``more`` for a damping ratio that assembled structures do not have; else empty.

    That of a free decay is known without units.
    """
    low, high = USUAL_RATIOS if np.isnan(view.mass_ratio) and not view.record.is_decay else (SMALL_RATIO, LARGEST_RATIO)
    return "less" if LEAST_RATIO < zeta < low else "more" if high < zeta < LARGEST_RATIO else ""


def _is_beside(mode: Mode, frequency: float, zeta: float) -> bool:
    """Whether the response of the mode file at a ``frequency`` beside its resonance shows this ratio as if at it."""
    r = frequency / mode.frequency
    shown = hypot(1.0 - r**2, 2.0 * mode.viscous_ratio * r) / (2.0 * r**2)
    return shown > 0.0 and zeta > 0.0 and abs(log(zeta / shown)) < log(FAR_DAMPING)


def _agree(view: View) -> bool:
    """Whether the masses of all levels are far from the stated masses, and agree with each other."""
    table = view.implied[view.implied["mass"].notna()]
    if len(table) < FEWEST_AGREE or table["force"].max() < AGREE_OVER * table["force"].min():
        return False
    x = compare_masses(view, table)
    return bool(np.ptp(x) < AGREE * abs(np.median(x)))


#: The mode file is of another structure or state if frequency and mass are both off by this many stated tolerances,
#: well beyond the usual three; a joint or spring moves the frequency alone;
OTHER_STRUCTURE = 5.0
LEAST_SHIFT = 0.01  #: and the frequency by this, ln: a structure set up again shifts by less, whatever is stated;
SCATTERS = 3.0  #: and the mass by this many times its scatter.
_WHICH_STATE = "is the mode file of this structure in this state? correct"


def _compare_structures(view: View, mode: Mode, hertz: FloatArray) -> Finding | None:
    """A mode file whose frequency and mass are both many tolerances away from those of every level.

    ``hertz``: frequency of every level without added mass. Only masses from phases are accurate enough.
    """
    stated, ratio = mode.tolerance, view.mass_ratio
    phased = [leg.turn.scatter for leg in view.legs if leg.turn and leg.paired and np.isfinite(leg.mass[0])]
    if stated.from_record or mode.drive == "base" or not phased or not ratio > 0.0:
        return None
    nearest = float(hertz[np.argmin(np.abs(np.log(hertz / mode.frequency)))])
    shift, heavier = abs(log(nearest / mode.frequency)), abs(log(ratio))
    moved = shift > max(OTHER_STRUCTURE * stated.frequency, LEAST_SHIFT)
    if not moved or heavier < max(OTHER_STRUCTURE * stated.mass, SCATTERS * take_median(phased)):
        return None
    what = f"resonance at {nearest:.4g} Hz, {mode.frequency:.4g} Hz in the mode file, and a mass of "
    what += f"{ratio * mode.mass:.4g}, {mode.mass:.4g} there, where it states tolerances of "
    what += f"{100.0 * stated.frequency:.2g} % and {100.0 * stated.mass:.2g} %"
    advice = f"{_WHICH_STATE} it, or state tolerances that it meets"
    return Finding("beyond-model", "caution", what, advice, view.record.sweeps)


BANDWIDTHS = 1.0  #: half-power bandwidths between two resonances from which they share no row near resonance
#: Distance of the lowest level from the mode file's frequency, over the further shift of the other levels, that one
#: cause can explain: a joint fourfold beyond its limit has lost 4.7 times what it loses from there to sixteenfold.
MOVED_BEFORE = 5.0
#: Least shift, ln, that is doubted if there is one level, which cannot show that a joint or spring moves the frequency:
#: these seldom move it by 5 %.
LEAST_SHIFT_ALONE = 0.05


def _compare_frequencies(view: View, mode: Mode, hertz: FloatArray) -> Finding | None:
    """A mode file whose frequency no level is near, nor would be at a smaller amplitude.

    ``hertz``: frequency of every level without added mass. Modes simulated with a cause that moves the resonance pass.
    """
    far = np.log(mode.frequency / hertz)
    shift = float(np.abs(far).min())
    width = float(2.0 * np.nan_to_num(view.implied["damping_ratio"]).max())
    least = LEAST_SHIFT if len(hertz) > 1 else LEAST_SHIFT_ALONE
    away = float(np.max(np.sign(far[0]) * (far - far[0])))
    moves = mode.tolerance.from_record or mode.effects or any(component(name).example.restores for name in mode.damping)
    apart = max(OTHER_STRUCTURE * mode.tolerance.frequency, BANDWIDTHS * width, least)
    if moves or not width > 0.0 or shift < apart or abs(far[0]) < MOVED_BEFORE * away:
        return None
    nearest = float(hertz[np.argmin(np.abs(far))])
    what = f"resonance at {nearest:.4g} Hz, {mode.frequency:.4g} Hz in the mode file: {shift / width:.2g} half-power "
    what += f"bandwidths away, where it states a tolerance of {100.0 * mode.tolerance.frequency:.2g} %"
    what += ", and no level comes nearer" if len(hertz) > 1 else ""
    advice = f"{_WHICH_STATE} its frequency, or state a tolerance that it meets"
    return Finding("beyond-model", "caution", what, advice, view.record.sweeps)
