"""Errors of a law at the tested resonances, in per cent of resonant amplitude: fitted, and with the level held out."""

from __future__ import annotations

import numpy as np

from selection.arrays import FloatArray
from selection.compare.fit import Fit, fit, natural_force
from selection.forces.contract import Force
from selection.posterior.law import Coordinates, Law
from selection.posterior.mode import find_mode
from selection.posterior.observations import Observations
from selection.response.ritz import resonant_amplitude

#: Times that a law is fitted without some of the sweeps, at most.
MOST_FOLDS = 20


def percent_errors(force: Force, data: Observations) -> FloatArray:
    """100 (predicted/measured - 1) of the resonant amplitude of each sweep at its tested force, (sweeps,).

    Where the force has no resonance at a tested force the error is NaN.
    """
    amplitude = resonant_amplitude(force, data.tested_force, data.tested_omega)
    return 100.0 * (amplitude / data.tested_amplitude - 1.0)


def fitted_force(coordinates: Coordinates, least_squares: Fit, mode: FloatArray) -> Force:
    """The law as least squares gives it, or at its posterior mode where that would have a negative coefficient."""
    if least_squares.physical:
        return natural_force(coordinates.law, least_squares.values)
    return coordinates.force(mode)


def held_out_errors(law: Law, data: Observations) -> FloatArray:
    """Percent errors of each sweep predicted by the law fitted to all other sweeps, (sweeps,).

    More than ``MOST_FOLDS`` sweeps are left out in as many groups, neighbours in the record in different ones.

    Raises:
        AnalysisError: the law cannot carry the forces of the other sweeps.
    """
    errors = np.full(len(data.sweeps), np.nan)
    folds = min(len(data.sweeps), MOST_FOLDS)
    for fold in range(folds):
        keep = np.arange(len(data.sweeps)) % folds != fold
        others = data.keep_sweeps(keep)
        coordinates = Coordinates.of(law, others)
        mode = find_mode(coordinates, others)
        force = fitted_force(coordinates, fit(coordinates, others, mode), mode)
        errors[~keep] = percent_errors(force, data.keep_sweeps(~keep))
    return errors


def root_mean_square(errors: FloatArray) -> float:
    """Root mean square; NaN when any error is."""
    return float(np.sqrt(np.mean(errors**2)))
