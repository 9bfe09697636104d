"""Checks of what record and mode file state of themselves: uncertainties, and units of time and base acceleration."""

import numpy as np

from damping.records.mode import Units
from damping.records.view import Finding, View

LARGEST_TOLERANCE = 1.0  #: largest relative uncertainty that is believed: such a value is known to a factor of e


def check_tolerances(view: View) -> Finding | None:
    """Relative uncertainties in a mode file that are larger than the values, as per cents taken for shares are."""
    tables = (("mode.tolerance", view.mode.tolerance), ("repeatability", view.mode.repeatability)) if view.mode else ()
    stated = [(f"{key} in [{name}]", value) for name, table in tables for key, value in vars(table).items() if value]
    large = [f"{100.0 * value:g} % of {key}" for key, value in stated if value > LARGEST_TOLERANCE]
    if not large:
        return None
    what = f"the mode file states an uncertainty of {' and of '.join(large)}"
    return Finding("units", "caution", what, "are they per cents? give shares: 0.02 for 2 %", view.record.sweeps)


def check_uncertainties(view: View) -> Finding | None:
    """Columns of standard uncertainties that exceed the values, as per cents do, or another unit."""
    record, large = view.record, []
    for name in ("amplitude_sd", "force_sd", "phase_sd"):
        if name in record.frame:
            value = 1.0 if name == "phase_sd" else record.column(name.removesuffix("_sd"))
            share = float(np.nanmedian(record.frame[name] / value))
            if share > LARGEST_TOLERANCE:
                large.append(f"{name} is {share:.3g} " + ("rad" if name == "phase_sd" else "times the value beside it"))
    if not large:
        return None
    advice = "is it in per cent, in degrees, or in another unit? give it in the unit of its column"
    return Finding("units", "caution", " and ".join(large), advice, record.sweeps)


def check_base_unit(view: View) -> Finding | None:
    """A base acceleration named in g beside a length: answers, and design levels, are in length/time^2."""
    units = view.mode.units if view.mode and view.mode.drive == "base" else Units()
    of_base = units.of_base_drive.force
    if units.force != "g" or not of_base:
        return None
    what = f"the mode file names g for the base's acceleration, which is taken in {of_base}, as its length and time say"
    advice = f"give the column force, and design levels, in {of_base}"
    return Finding("units", "caution", what, advice, view.record.sweeps)


def check_time_unit(view: View) -> Finding | None:
    """A unit of time that is not the second: frequencies are in Hz, so coefficients and masses are per second."""
    text = view.mode.units.time if view.mode else ""
    if text.lower() in ("", "s", "sec", "second", "seconds"):
        return None
    what = f"the mode file names {text} as the unit of time, while frequencies are in Hz"
    advice = 'coefficients are found in seconds: give time = "s", and the mass in the unit of force times s^2/length'
    return Finding("units", "caution", what, advice, view.record.sweeps)
