"""Whether other modes bend the phases of a run, or a sweep faster than its mode can follow."""

from dataclasses import replace

import numpy as np

from damping.records.implied import fit_ratio, measure_miss
from damping.records.runs import Run

_RESIDUALS = np.linspace(-0.9, 0.9, 37)  #: trial compliances of other modes, over the largest of the run
#: If modes far off cause the misfit of Y by a straight line, allowing for them leaves at most this share of it; of a
#: fast sweep's misfit it leaves three fifths.
OF_FAR_MODES = 0.3
#: The same for one close mode. Of 155 runs of one mode swept fast, each integrated, allowing for a second mode leaves
#: .08 or more; of 47 and 28 runs of two close modes, in closed form, at least three quarters and a quarter are below.
OF_CLOSE_MODE = 0.075


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
    assert run.phase is not None
    x = run.omega**2 / np.mean(run.omega**2) - 1.0
    return fit_ratio(x / np.abs(x).max(), run.A / run.F * np.exp(-1j * run.phase))[1]
