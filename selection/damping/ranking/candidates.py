"""The laws that compete, and their errors at the tested resonances: as fitted, and with the level held out."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from damping.arrays import FloatArray
from damping.forces import CATALOGUE
from damping.forces.contract import Force
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude
from damping.ranking.fitting import fit_law

#: Terms of a law, at most: a fourth is never needed to describe a few levels, and never told from three.
MAX_TERMS = 3
#: Shape parameters by which a force takes any power of amplitude: beside another it would imitate that one.
POWER = "exponent"


def candidate_laws() -> list[Law]:
    """Every sum of up to ``MAX_TERMS`` forces of the library, and each power law alone; the same for every record."""
    alone = [name for name in CATALOGUE if POWER in (shape for part in Law((name,)).parts for shape in part.shapes)]
    terms = [name for name in CATALOGUE if name not in alone]
    sums = [Law(names) for size in range(1, MAX_TERMS + 1) for names in combinations(terms, size)]
    return [*sums, *(Law((name,)) for name in alone)]


#: Times that a law is fitted without some of the sweeps, at most.
MOST_FOLDS = 20


def percent_errors(force: Force, data: Observations) -> FloatArray:
    """100 (predicted/measured - 1) of the resonant amplitude of each sweep at its tested force, (sweeps,).

    Where the force has no resonance at a tested force the error is NaN. Of a free decay, where amplitude is the input,
    it is the error of the force at the tested amplitude.
    """
    if data.amplitude_is_input:  # a decay: its force is what a law predicts
        tested = force.quadrature(data.tested_amplitude, data.tested_omega)
        return 100.0 * (np.asarray(tested) / data.tested_force - 1.0)
    amplitude = resonant_amplitude(force, data.tested_force, data.tested_omega)
    return 100.0 * (amplitude / data.tested_amplitude - 1.0)


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
        errors[~keep] = percent_errors(fit_law(law, others).force, data.keep_sweeps(~keep))
    return errors


def root_mean_square(errors: FloatArray) -> float:
    """Root mean square; NaN when any error is."""
    return float(np.sqrt(np.mean(errors**2)))
