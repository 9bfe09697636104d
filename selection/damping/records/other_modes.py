"""Whether other modes bend the phases of a run, or a sweep faster than its mode can follow; whether a mode is split."""

from dataclasses import replace
from math import log

import numpy as np

from damping.arrays import ComplexArray, FloatArray
from damping.records.implied import fit_ratio, measure_miss
from damping.records.runs import Run

_RESIDUALS = np.linspace(-0.9, 0.9, 37)  #: trial compliances of other modes, over the largest of the run
#: If modes far off cause the misfit of Y by a straight line, allowing for them leaves at most this share of it; of a
#: fast sweep's misfit it leaves three fifths.
OF_FAR_MODES = 0.3
#: The same for one close mode. Of 155 runs of one mode swept fast, each integrated, allowing for a second mode leaves
#: .08 or more; of 47 and 28 runs of two close modes, in closed form, at least three quarters and a quarter are below.
OF_CLOSE_MODE = 0.075
#: Largest departures (ln) of mass and frequency of a mode from those that a record implies in which a part splits it: a
#: simulation may hold the part, up to a tenth of the mass, at rest on it. Of 37 split modes in closed form, masses are
#: within .1 and frequencies within .04; of 49 pairs of separate modes, the second with a fifth to three times the
#: compliance of the first and of either sign, the mode file between them, masses are off by .2 or more. Of a fresh
#: draw 72 of 79 split modes and none of 55 pairs pass.
OFF_MASS = 0.15
OFF_FREQUENCY = 0.05


def is_of_other_modes(run: Run, miss: float) -> bool:
    """Whether other modes, far or close, explain the median misfit ``miss`` of Y by a straight line, relative to Y."""
    return measure_miss_beside_modes(run) <= OF_FAR_MODES * miss or measure_miss_of_two(run) <= OF_CLOSE_MODE * miss


def measure_miss_beside_modes(run: Run) -> float:
    """The least median misfit of Y by a straight line if other modes add a compliance R: 1/Y - R in place of 1/Y."""
    assert run.phase is not None
    compliance = run.A / run.F * np.exp(-1j * run.phase)
    of_mode = [compliance - share * np.abs(compliance).max() for share in _RESIDUALS]
    return min(measure_miss(replace(run, A=run.F * np.abs(H), phase=-np.angle(H))) for H in of_mode)


def measure_miss_of_two(run: Run) -> float:
    """Median misfit, relative to it, of the compliance by two modes and a constant: a ratio of squares in omega^2."""
    return _fit_two(run)[2]


def is_split(run: Run, mass: float, omega_n: float) -> bool:
    """Whether the two modes of a run are the mode of that ``mass`` and ``omega_n``, split by a part tuned to it.

    Far above both, the part moves no more and the compliance is -1/(M omega^2); far below, it moves along, and the
    compliance is 1/(M omega_n^2). Two modes of a mass each imply the mass 1/(1/M_1 + 1/M_2).
    """
    if run.phase is None:
        return False
    (far, b, c, d, e), (middle, unit), _ = _fit_two(run)
    own = np.array([b - far * d, c - far * e])  # of the modes alone, without the constant
    below = -middle / unit
    implied = -1.0 / (own[0] * unit).real
    static = ((own[0] * below + own[1]) / (below**2 + d * below + e)).real
    if not (implied > 0.0 and static > 0.0):
        return False
    off_frequency = 0.5 * log(1.0 / (implied * static)) - log(omega_n)
    return abs(log(implied / mass)) < OFF_MASS and abs(off_frequency) < OFF_FREQUENCY


def _fit_two(run: Run) -> tuple[FloatArray | ComplexArray, tuple[float, float], float]:
    """The ratio of `fit_ratio` in x = (omega^2 - middle)/unit fitted to the compliance; middle and unit; the misfit."""
    assert run.phase is not None
    middle = float(np.mean(run.omega**2))
    unit = float(np.abs(run.omega**2 - middle).max())
    ratio, miss = fit_ratio((run.omega**2 - middle) / unit, run.A / run.F * np.exp(-1j * run.phase))
    return ratio, (middle, unit), miss
