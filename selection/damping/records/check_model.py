"""Check of the mode file beside the record: mass, frequency or damping far from what the rows imply."""

from math import log

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.records.check_units import LEAST_RATIO, SMALL_RATIO, name_factor, name_unit
from damping.records.mode import Mode
from damping.records.view import Finding, View, take_median

FAR_MASS = 1.27  #: a mass farther than this factor from the mode file's is far
FAR_FREQUENCY = 1.1  #: the same of the frequency of the lowest level, where a resonance is bent least
FAR_DAMPING = 5.0  #: the same of the damping ratio, which simulations know least
FAR_MASS_WITHOUT_PHASE = 1.8  #: without phases the mass is that of a parabola, which a bent resonance is not
OTHER_MODE = 1.25  #: farther than this outside the rows no mode of the record is the one described


def check_beyond_model(view: View) -> Finding | None:
    """Mass, frequency or damping far from the mode file's."""
    if view.mode is None or view.implied.empty:
        return None
    differences = []
    table, hertz = view.implied.sort_values("force", kind="stable"), _free_of_added_mass(view, view.mode)
    frequency = float(hertz[0])
    if abs(log(frequency / view.mode.frequency)) > log(FAR_FREQUENCY):
        differences.append(f"resonance at {frequency:.4g} Hz, {view.mode.frequency:.4g} Hz in the mode file")
    far_mass = FAR_MASS if all(leg.lag is not None for leg in view.legs) else FAR_MASS_WITHOUT_PHASE
    base = view.mode.drive == "base"
    if not base and view.straight and view.mass_ratio > 0.0 and abs(log(view.mass_ratio)) > log(far_mass):
        name = name_factor(view.mass_ratio)
        differences.append(f"the rows imply {view.mass_ratio:.3g} times its mass" + (f" ({name}?)" if name else ""))
    simulated, zeta = view.mode.viscous_ratio, float(table["damping_ratio"].iloc[0])
    if simulated and zeta > 0.0 and len(view.mode.damping) == 1 and abs(log(zeta / simulated)) > log(FAR_DAMPING):
        differences.append(f"a damping ratio of {zeta:.3g}, {simulated:.3g} in the mode file")
    elif not simulated and LEAST_RATIO < zeta < SMALL_RATIO:
        name = name_unit(zeta / 0.01, view.mode.units)
        differences.append(f"a damping ratio of {zeta:.3g}, less than assembled structures have ({name}?)")
    if not differences:
        return _compare_structures(view, view.mode, hertz)
    hertz = view.record.column("frequency")
    other = not hertz.min() / OTHER_MODE < view.mode.frequency < hertz.max() * OTHER_MODE
    advice = "check the gain of the sensor, that it reads displacement, and the mode file"
    advice = "model and record are of different modes" if other else advice
    return Finding("beyond-model", "refuse" if other else "caution", "; ".join(differences), advice, view.record.sweeps)


#: Stated tolerances that frequency and mass must both be off by for the mode file to be of another structure or state:
#: three are within what is stated and five beyond any doubt of it; a joint or spring moves the frequency alone.
OTHER_STRUCTURE = 5.0
LEAST_SHIFT = 0.01  #: and the frequency by this, ln: a structure set up anew shifts by less, whatever is stated
SCATTERS = 3.0  #: and the mass is off by this many times its own scatter


def _compare_structures(view: View, mode: Mode, hertz: FloatArray) -> Finding | None:
    """A mode file whose frequency and mass are both many of its tolerances from those of every level.

    ``hertz``: of every level without what is added. Masses by phases alone are known well enough.
    """
    stated, ratio = mode.tolerance, view.mass_ratio
    phased = [leg.turn.scatter for leg in view.legs if leg.turn and leg.lag is not None and np.isfinite(leg.mass[0])]
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
    advice = "is the mode file of this structure in this state? correct it, or state tolerances that it keeps"
    return Finding("beyond-model", "caution", what, advice, view.record.sweeps)


def _free_of_added_mass(view: View, mode: Mode) -> FloatArray:
    """Frequencies of the levels, by force, Hz, as they would be without the mass that is added to them."""
    table = view.implied.sort_values("force", kind="stable")
    added = pd.Series(view.record.added_masses).groupby(view.record.table["sweep"].astype(str)).first()
    own = added.loc[table["sweep"].astype(str)].to_numpy(dtype=np.float64)
    return np.asarray(table["frequency"].to_numpy(dtype=np.float64) * np.sqrt(1.0 + own / mode.mass))
