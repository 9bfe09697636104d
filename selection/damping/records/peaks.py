"""The row of a sweep that is taken for its resonance where no phase shows it, and its damping force beside it."""

from math import log, pi

import numpy as np
import pandas as pd

from damping.arrays import FloatArray

FEWEST_FOR_NOISE = 5  #: fewest rows of a sweep whose second differences tell noise from a falling force
#: A/F of another row exceeds that of the largest amplitude by this factor,
FORCE_FALLS = 1.05
#: and by this many standard deviations of the noise of ln A/F, where the force falls at the resonance: a shaker that
#: the motion unloads, or a controller that holds the response. Of 600 such sweeps (damping ratio 0.3 to 5 %, linear or
#: with velocity squared, 7 to 120 rows, noise 0.2 to 3 %) the middle error of the damping force falls from 7 % (a
#: shaker unloaded in phase), a factor of 2.1 (out of phase) and 2.9 (response held) to 2 %; one gets worse. 200 at a
#: constant force stay as they are, and 197 of 200 with one wrong reading of the force.
BEYOND_NOISE = 5.0
#: Share of the force, by its energy, from which the largest row of a sweep is at resonance: energies are read to some
#: per cent, and the force better.
AT_RESONANCE = 0.95


def find_peak(force: FloatArray, frequency: FloatArray, amplitude: FloatArray) -> int:
    """The row (n rows in any order) of largest amplitude, or of largest A/F where the force falls at the resonance.

    F/A = |Z|, and Z = K - M omega^2 + (S + i C)/A is least at phase resonance whatever the force does, but the
    amplitude is not largest there if the force falls with it: with a held response the largest is a matter of noise.
    The row of largest A/F needs a neighbour in frequency that also exceeds: a single reading is no resonance.
    """
    peak = int(np.argmax(amplitude))
    if len(amplitude) < FEWEST_FOR_NOISE:
        return peak
    order = np.argsort(frequency, kind="stable")
    compliance = np.log(amplitude / force)
    g, least = compliance[order], float(compliance[peak])
    top = int(np.argmax(g))
    if not 0 < top < len(g) - 1 or max(g[top - 1], g[top + 1]) <= least:
        return peak
    return int(order[top]) if g[top] - least > max(log(FORCE_FALLS), BEYOND_NOISE * find_noise(g)) else peak


def find_noise(compliance: FloatArray) -> float:
    """Standard deviation of ln A/F (n,) from row to row, by the median second difference, which ignores a peak."""
    if len(compliance) < FEWEST_FOR_NOISE:
        return 0.0
    return float(np.median(np.abs(np.diff(compliance, 2))) / (0.6745 * 6.0**0.5))


def share_in_quadrature(row: pd.Series) -> float:
    """Share of the force of a row that balances the damping, by its energy, else by its phase; 1 without either.

    Beside resonance the damping force at its amplitude is E/(pi A), or F sin(phase). Where noise leaves nothing, the
    whole force is taken.
    """
    share = 1.0
    if "energy" in row.index:
        share = float(row["energy"]) / (pi * float(row["force"]) * float(row["amplitude"]))
    elif "phase" in row.index:
        share = float(np.sin(row["phase"]))
    return share if share > 0.0 else 1.0
