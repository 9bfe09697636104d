"""Checks of units and energies: columns not exchanged, one system, E <= pi F A, uncertainties as stated.

A wrong unit, scaling or kind of motion shows by the factor by which numbers are off.
"""

import re
from collections.abc import Mapping
from math import inf, log, pi

import numpy as np

from damping.arrays import INCH_M, POUND_FORCE_N, STANDARD_GRAVITY_M_S2, STANDARD_GRAVITY_REPORT_IN_S2, FloatArray
from damping.records.check_levels import falls_with_force
from damping.records.mode import Units
from damping.records.record import energy_per_cycle
from damping.records.runs import Run
from damping.records.view import Finding, View, label_sweeps, name_sweeps, take_median

#: Factors by which a quantity in a wrong unit is off, by the mistake.
UNIT_FACTORS: dict[str, float] = {
    "N for lb": POUND_FORCE_N,
    "kgf for N, or g for m/s^2": STANDARD_GRAVITY_M_S2,
    "g for in/s^2": STANDARD_GRAVITY_REPORT_IN_S2,
    "g for ft/s^2": 32.174,
    "lb for kg": 2.20462,
    "mm for in": 25.4,
    "in for m": 39.3701,
    "in for ft": 12.0,
    "m for ft": 3.28084,
    "mm for m, or another factor of 1000": 1000.0,
    "um for m, or another factor of a million": 1.0e6,
    "g for mm/s^2": 1000.0 * STANDARD_GRAVITY_M_S2,
    "rad/s for Hz squared": (2.0 * pi) ** 2,
}
#: Factors within one system of units.
SCALING_FACTORS = {"rms for peak": 2.0**0.5, "peak-to-peak for peak": 2.0, "peak-to-peak for rms": 2.0 * 2.0**0.5}
#: All factors that a ratio of masses may mean.
FACTORS = UNIT_FACTORS | SCALING_FACTORS | {"degrees for rad": 180.0 / pi}
#: Factors between frequencies.
FREQUENCY_FACTORS = {"rad/s for Hz": 2.0 * pi, "1/min for Hz": 60.0, "kHz for Hz": 1000.0}


def list_motions(frequency: float) -> dict[str, float]:
    """Factors by which a motion of a frequency, Hz, is off as a displacement."""
    omega = 2.0 * pi * frequency
    motions = {"velocity for displacement": omega, "acceleration for displacement": omega**2}
    return motions | {"acceleration in g for displacement in m": omega**2 / STANDARD_GRAVITY_M_S2}


def name_factor(ratio: float, factors: Mapping[str, float] = FACTORS, within: float = 0.1) -> str:
    """Name of the factor nearest to a ratio (or its inverse); empty if none is within ``within`` in the logarithm."""
    size = abs(log(ratio))
    name = min(factors, key=lambda key: abs(size - log(factors[key])))
    return name if abs(size - log(factors[name])) < within else ""


def name_unit(ratio: float, units: Units, within: float = inf) -> str:
    """Name of the unit factor nearest to a ratio, among those of a unit of the mode file; of all if it names none."""
    named = {{"lbf": "lb"}.get(unit, unit) for unit in (units.force, units.length) if unit}
    of_mode = [name for name in UNIT_FACTORS if named & set(re.findall(r"for ([^\s,/]+)", name))]
    kept = {name: by for name, by in UNIT_FACTORS.items() if not of_mode or name in of_mode or "another factor" in name}
    return name_factor(ratio, kept, within=within)


#: A force is the response of a swept mode, by another name, if it falls by this factor towards both ends of the sweep;
LIKE_PEAK = 2.0**0.7
#: if ln of what stands in its place spans less than this share of its own range, as a held force does;
LIKE_LEVEL = 0.3
#: and if it is largest where the force over it, as if exchanged, is among the upper tenth, and in proportion with that:
#: notches, and forces that fall at resonance, are not.
AT_TOP = 0.9
TOGETHER = 0.95  #: least correlation of their logarithms
FEWEST_OF_PEAK = 5  #: fewest rows that show whether a force is such a response


def check_exchanged_response(view: View) -> Finding | None:
    """Force exchanged with the response: it peaks where the column ratio amplitude over force is least."""
    long_runs = [run for run in view.raw if len(run) >= FEWEST_OF_PEAK]
    tops = [run for run in long_runs if _peaks_as_response(run)]
    if len(tops) < max(1, 0.5 * len(long_runs)):
        return None
    what = f"the force passes through a maximum in {name_sweeps(label_sweeps(tops))} while the response stays the same"
    return Finding("units", "refuse", what, "are the columns force and amplitude exchanged?", label_sweeps(tops))


def _peaks_as_response(run: Run) -> bool:
    """Whether the force of a run is the response, and what stands for the response is the force."""
    F, g = np.log(run.F), -run.compliance
    top = int(np.argmax(F))
    inside = 0 < top < len(run) - 1 and min(F[top] - F[0], F[top] - F[-1]) > log(LIKE_PEAK)
    steady = np.ptp(np.log(run.A)) < LIKE_LEVEL * np.ptp(F)
    return bool(inside and steady and g[top] > np.quantile(g, AT_TOP) and np.corrcoef(F, g)[0, 1] > TOGETHER)


NEAR_THE_MODE = 1.3  #: factor of the mode's frequency within which the resonances of all levels lie


def check_exchanged_frequency(view: View) -> Finding | None:
    """Force exchanged with the frequency: every force is near the mode's frequency, and frequencies are levels.

    There is then one frequency for each sweep, and they are far apart.
    """
    if view.mode is None:
        return None
    apart, frequency = (np.log(view.record.column(name) / view.mode.frequency) for name in ("force", "frequency"))
    levels = view.record.frame.groupby("sweep")["frequency"].nunique().max() == 1
    if not levels or np.abs(apart).max() >= log(NEAR_THE_MODE) or np.ptp(frequency) <= 2.0 * log(NEAR_THE_MODE):
        return None
    what = "every force is near the frequency of the mode file, and the frequencies look like force levels"
    return Finding("units", "refuse", what, "are the columns force and frequency exchanged?", view.record.sweeps)


def check_energy(view: View) -> Finding | None:
    """Energies that contradict force and motion: E = pi F A sin(phase) <= pi F A, with equality at resonance."""
    if "energy" not in view.record.frame.columns:
        return None
    table = view.record.frame
    share = energy_per_cycle(view.record) / (pi * (table["force"] * table["amplitude"]).to_numpy(dtype=np.float64))
    share[list(view.outliers)] = np.nan
    apart, noise = _compare_energies(view, share)
    wrong = (share > ENERGY) | (np.abs(apart) > np.maximum(log(ENERGY), NOISE_OF_ENERGY * noise))
    wrong |= np.isfinite(apart) & (abs(take_median(apart)) > log(ENERGY_OF_ALL))
    resonant = [leg.run.rows for leg in view.legs if leg.resonant]
    small = bool(resonant) and all(np.nanmax(share[rows]) < 1.0 / ENERGY_SHORT for rows in resonant)
    if not wrong.any() and not small:
        return None
    by_phase = wrong & np.isfinite(apart)
    row = int(np.nanargmax(np.abs(np.where(by_phase, apart, 0.0)) if by_phase.any() else share))
    what = f"energy {table['energy'][row]:g} at row {row + 1} is "
    if by_phase.any():
        what += f"{np.exp(apart[row]):.3g} times pi F A sin(phase), the energy from force, amplitude and phase"
    else:
        what += f"{share[row]:.3g} times pi F A, the most that force and motion allow"
        what += "" if wrong.any() else "; at a resonance it is all of it"
    advice = "check the unit of the energy and whether it is per cycle, or leave the column out"
    return Finding("energy", "refuse", what, advice, label_sweeps(run for run in view.runs if wrong[run.rows].any()))


def _compare_energies(view: View, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """ln of E/(pi F A sin(phase)), (n,), NaN far from resonance or without phase, and the noise of the run, (n,).

    An energy may have been computed from the phases as recorded, or free of their offset: the nearer of both counts.
    """
    apart, noise = np.full((2, len(share)), np.nan)
    for leg in view.legs:
        if leg.lag is not None and leg.run.phase is not None:
            sine = np.sin([leg.run.phase, leg.lag])
            both = np.log(share[leg.run.rows] / np.where(sine > NEAR_RESONANCE, sine, np.nan))
            apart[leg.run.rows] = np.where(np.abs(both[1]) < np.abs(both[0]), both[1], both[0])
            noise[leg.run.rows] = leg.run.noise
    return apart, noise


ENERGY = 1.25  #: an energy beyond pi F A, or off that of its phase, by this factor is wrong
NOISE_OF_ENERGY = 6.0  #: if it is also off by this many standard deviations of the noise
#: The factor for all rows at once: gains of force, motion and energy channel, each 5 % off in one direction.
ENERGY_OF_ALL = 1.15
NEAR_RESONANCE = 0.7  #: sine of a phase above which phase noise hardly changes the energy
ENERGY_SHORT = 3.0  #: an energy at resonance smaller than pi F A by this factor is wrong: there they are equal


def check_frequency_unit(view: View) -> Finding | None:
    """Sweeps, all or some of them, that resonate at the mode's frequency in another unit."""
    if view.mode is None:
        return None
    ratio = view.implied["frequency"].to_numpy(dtype=np.float64) / view.mode.frequency
    named = [name_factor(value, FREQUENCY_FACTORS, within=0.06) for value in ratio]
    other = [k for k, name in enumerate(named) if name]
    if not other:
        return None
    sweeps = tuple(view.implied["sweep"].astype(str).iloc[other])
    which, advice = "the record resonates", "give both in Hz"
    if len(other) < len(named):
        which = f"{name_sweeps(sweeps)} resonate{'s' * (len(other) == 1)}"
        advice = "give every frequency in Hz, or leave the rows of another mode out"
    factor = float(np.median(ratio[other]))
    what = f"{which} at {factor:.4g} times the frequency of the mode file ({named[other[0]]}?)"
    return Finding("units", "refuse", what, advice, sweeps)


LEAST_RATIO = 1e-6  #: least damping ratio of a structure: single crystals in a vacuum have more
SMALL_RATIO = 1e-4  #: less than assembled structures have in air: a wrong unit is more likely
LARGEST_RATIO = 0.5  #: largest damping ratio of a structure that has a resonance to sweep over
SIMULATED_WITHIN = 1.0  #: ln of the factor within which a simulated damping ratio is right
FAR_BELOW = 0.01  #: share of the simulated damping ratio below which a wrong unit is more likely
OTHER_SYSTEM = 3.0  #: a mass beyond this factor is in another system of units,
NEAR_FACTOR = 0.05  #: or between 2 and that, if it is so near (in the logarithm) to a known factor
#: Range of participation times shape at a sensor: 1.6 at the tip of a beam; smaller ones are not measurable.
LARGEST_PARTICIPATION = 3.0
SMALLEST_PARTICIPATION = 0.003
#: ``OTHER_SYSTEM`` for a bent resonance without phases, whose parabola is off by a factor of 2 to 3.
OTHER_SYSTEM_BENT = 5.0


def check_units(view: View) -> Finding | None:
    """Record and mode in different systems of units, by the implied mass, else by the damping."""
    if view.mode is None or falls_with_force(view):
        return None
    ratio, zeta = view.mass_ratio, take_median(view.implied["damping_ratio"])
    bent = not view.straight and ratio > 0.0 and abs(log(ratio)) < log(OTHER_SYSTEM_BENT)
    base = view.mode.drive == "base"
    participates = base and 1.0 / LARGEST_PARTICIPATION < ratio < 1.0 / SMALLEST_PARTICIPATION
    near = ratio > 0.0 and name_factor(ratio, UNIT_FACTORS, within=NEAR_FACTOR)
    # a factor beyond these on force over amplitude comes from a unit, not from the structure
    wrong = not bent and not participates and ratio > 0.0 and abs(log(ratio)) > log(2.0 if near else OTHER_SYSTEM)
    impossible = zeta <= LEAST_RATIO or zeta >= LARGEST_RATIO  # NaN: no sweep shows it
    if zeta < min(SMALL_RATIO, FAR_BELOW * view.mode.viscous_ratio):  # and a unit factor would give the simulated one
        impossible |= bool(name_unit(zeta / view.mode.viscous_ratio, view.mode.units, within=SIMULATED_WITHIN))
    if not wrong and not (impossible and (np.isnan(ratio) or not 0.5 < ratio < 2.0)):
        return None
    participation = f"a participation of {1.0 / ratio:.4g}, shape included"
    implied = participation if base else f"{ratio:.4g} times the mass of the mode file"
    parts = [] if np.isnan(ratio) else [f"the rows imply {implied}"]
    parts.append(f"a damping ratio of {zeta:.3g} would follow")
    # factor of the mass, else the unit factor that gives the simulated damping ratio, or a typical one; a participation
    # is no mass and near 1 at best: of the units in the mode file, the nearest
    if wrong and not base:
        name = name_factor(ratio, FACTORS | list_motions(view.mode.frequency))
    else:
        name = name_unit(ratio if wrong else zeta / (view.mode.viscous_ratio or 0.01), view.mode.units)
    advice = "state force, amplitude, mass in one system" + (f": {name}?" if name else "")
    return Finding("units", "refuse", "; ".join(parts), advice, view.record.sweeps)


#: Metres in the units of length that a mode file may name.
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": INCH_M, "ft": 12.0 * INCH_M}
#: Largest velocity amplitude of a structure, m/s. A bar strains by about v/c in resonance, whatever its size (F. V.
#: Hunt, J. Acoust. Soc. Am. 32, 1960): 2 % at c = 5000 m/s, which no structure survives.
LARGEST_VELOCITY = 100.0


def check_velocity(view: View) -> Finding | None:
    """Amplitudes too large for the named unit of length, as accelerations taken for displacements are."""
    metre = METRES.get(view.mode.units.length) if view.mode else None
    if metre is None:
        return None
    velocity = metre * 2.0 * pi * view.record.column("frequency") * view.record.column("amplitude")
    velocity[list(view.outliers)] = 0.0
    row = int(np.argmax(velocity))
    if velocity[row] <= LARGEST_VELOCITY:
        return None
    what = f"the amplitude at row {row + 1} moves at {velocity[row]:.3g} m/s, which no structure survives"
    advice = "are accelerations or velocities given as displacements, or is the unit of length another?"
    return Finding("units", "caution", what, advice, view.record.sweeps)


LARGEST_TOLERANCE = 1.0  #: largest relative uncertainty that is believed: such a value is known to a factor of e


def check_uncertainties(view: View) -> Finding | None:
    """Columns of uncertainties, or of a third harmonic, that exceed the values, as per cents do, or another unit."""
    record, large = view.record, []
    for name in ("amplitude_sd", "force_sd", "phase_sd", "amplitude_3"):
        if name in record.frame:
            value = 1.0 if name == "phase_sd" else record.column(name.partition("_")[0])
            share = float((record.frame[name] / value).median())  # NaN where all are blank
            if share > LARGEST_TOLERANCE:
                large.append(f"{name} is {share:.3g} " + ("rad" if name == "phase_sd" else "times the value beside it"))
    if not large:
        return None
    advice = "is it in per cent, in degrees, or in another unit? give it in the unit of its column"
    return Finding("units", "caution", " and ".join(large), advice, record.sweeps)
