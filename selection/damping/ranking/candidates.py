"""Candidate laws, groups of them with the same predictions, their errors as fitted and held out, their coefficients."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import ndtri

from damping.arrays import FloatArray, IntArray
from damping.errors import AnalysisError
from damping.forces import CATALOGUE
from damping.forces.contract import Force
from damping.infer.best_fit import BestFit, build_force, fit_laws
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude

#: Most terms of a law: a fourth is never needed to describe a few levels, and cannot be told from three.
MAX_TERMS = 3
#: Two laws are equivalent if their best predictions differ by less than this share of the noise ...
INDISTINCT = 0.1
#: ... at every row and at this multiple of the largest tested force.
BEYOND = 1.5
#: Range of relative noise where the record does not state it: that of repeat tests of large structures.
NOISE_RANGE = (0.003, 0.07)
#: Prior relative noise of a row, that of repeat tests of large structures: laws whose difference no further test of
#: that kind would show count as equal.
NOISE = 0.02


def candidate_laws(named: Iterable[Law] = ()) -> list[Law]:
    """Every sum of up to ``MAX_TERMS`` forces of the library, and those that are no terms of sums, for any record.

    Of these each power law is alone, and the joint of Dahl beside viscous damping (`Force.beside`).

    ``named``: further laws, added unless they are among these.
    """
    terms = [name for name, kind in CATALOGUE.items() if kind.sums]
    sums = [Law(names) for size in range(1, MAX_TERMS + 1) for names in combinations(terms, size)]
    laws = [*sums, *(Law((*kind.beside, name)) for name, kind in CATALOGUE.items() if not kind.sums)]
    known = {frozenset(law.components) for law in laws}
    return [*laws, *(law for law in named if frozenset(law.components) not in known)]


def resonant_laws() -> list[Law]:
    """The candidates that set a resonant amplitude: constant friction alone does not."""
    return [law for law in candidate_laws() if law.has_resonance]


def _learn_noise(fits: Sequence[BestFit], data: Observations) -> FloatArray:
    """Relative noise of each row (rows,): as stated by the record, else from the fit of smallest scatter s.

    s^2 = (s_0^2 + n^T n)/(1 + rows - parameters), with one prior observation s_0 = ``NOISE``, within ``NOISE_RANGE``.
    """
    scatter = min(np.sqrt((NOISE**2 + f.n @ f.n) / (1.0 + max(len(f.n) - f.parameters, 0))) for f in fits)
    learnt = np.full(len(data.A), float(np.clip(scatter, *NOISE_RANGE)))
    stated = np.hypot(data.sd_amplitude, np.hypot(data.sd_phase, data.sd_force))
    return np.where(stated > 0.0, stated, learnt)


def group_equivalents(fits: Sequence[BestFit], data: Observations) -> list[list[BestFit]]:
    """Groups of laws with the same predictions, each led by the one with fewest terms (then first).

    A law joins a group if its best predictions differ from the leader's by less than ``INDISTINCT`` of the noise at
    every row and at ``BEYOND`` times the largest tested force: a further term without effect makes no other law.
    """
    noise, omega, force = _learn_noise(fits, data), data.tested_omega[data.top], BEYOND * data.tested_force[data.top]
    order = sorted(fits, key=lambda fit: len(fit.law.parts))
    n = np.array([fit.n for fit in order])
    beyond = np.log([float(resonant_amplitude(fit.force, force, omega)) for fit in order])
    groups: dict[int, list[BestFit]] = {}
    for i, fit in enumerate(order):
        leaders = np.array([*groups], int)
        on_rows = leaders[np.all(np.abs(n[leaders] - n[i]) < INDISTINCT * noise, axis=1)]
        for leader in on_rows.tolist():
            ends = beyond[[i, leader]]
            if abs(ends[0] - ends[1]) < INDISTINCT * noise.max() or bool(np.isnan(ends).all()):
                groups[leader].append(fit)
                break
        else:
            groups[i] = [fit]
    return list(groups.values())


MOST_FOLDS = 20  #: most fits of a law without some of the sweeps


def percent_errors(force: Force, data: Observations) -> FloatArray:
    """100 (predicted/measured - 1) of the resonant amplitude of each sweep at its tested force, (sweeps,).

    The error is NaN where the law has no resonance at a tested force. For a free decay, where amplitude is the input,
    it is the error of the force at the tested amplitude.
    """
    if data.amplitude_is_input:
        tested = force.quadrature(data.tested_amplitude, data.tested_omega)
        return 100.0 * (np.asarray(tested) / data.tested_force - 1.0)
    amplitude = resonant_amplitude(force, data.tested_force, data.tested_omega)
    return 100.0 * (amplitude / data.tested_amplitude - 1.0)


def held_out_errors(laws: Sequence[Law], data: Observations) -> list[FloatArray | None]:
    """Percent errors of each sweep predicted by each law fitted to all other sweeps, (sweeps,).

    None for a law that cannot carry the forces of the other sweeps. More than ``MOST_FOLDS`` sweeps are left out in
    ``MOST_FOLDS`` groups, with neighbours in the record in different groups.
    """
    folds = min(len(data.sweeps), MOST_FOLDS)
    fold = np.arange(len(data.sweeps)) % folds
    fits = fit_laws(laws, *(data.take_sweeps(fold != out) for out in range(folds)))
    return [_predict_left_out(law, fits[i :: len(laws)], fold, data) for i, law in enumerate(laws)]


def _predict_left_out(
    law: Law, fits: Sequence[BestFit | AnalysisError], fold: IntArray, data: Observations
) -> FloatArray | None:
    """Percent errors of all sweeps at once, (sweeps,): each by the fit without its ``fold`` (sweeps,)."""
    fitted = [fit for fit in fits if isinstance(fit, BestFit)]
    if len(fitted) < len(fits):
        return None
    coefficients = np.array([fit.coefficients for fit in fitted])[fold].T
    shapes = [
        {name: np.array([values[name] for values in part])[fold] for name in part[0]}
        for part in zip(*(fit.shapes for fit in fitted), strict=True)
    ]
    return percent_errors(build_force(law, coefficients, shapes), data)


INTERVAL = 0.90  #: content of the credible interval of a coefficient in the table
#: Standard deviation of a coefficient, over that of a normal posterior with its interval, from which a few extreme
#: draws dominate it (that of a power law was 20 or 140 by the seed).
LONG_TAIL = 2.0


@dataclass(frozen=True)
class Coefficient:
    """One parameter of a law: posterior median, standard deviation, their ratio, and the ``INTERVAL`` interval."""

    force: str
    shape: str  #: empty for the coefficient of a force, else the name of the parameter (``exponent``, ``limit``)
    value: float
    std_error: float
    t_ratio: float
    low: float
    high: float

    @property
    def parameter(self) -> str:
        """The parameter as :meth:`Coordinates.parameters` names it."""
        return f"{self.force} {self.shape}".strip()


def tabulate_coefficients(coordinates: Coordinates, x: FloatArray) -> tuple[Coefficient, ...]:
    """Posterior median, standard deviation and interval of each parameter but discrepancy and scatters, of draws x."""
    tail, values = 50.0 * (1.0 - INTERVAL), coordinates.force_parameters(x)
    drawn = np.array([*values.values()])
    quantiles = np.percentile(drawn, [tail, 50.0, 100.0 - tail], axis=1)
    rows = []
    for name, (low, value, high), error in zip(values, quantiles.T.tolist(), drawn.std(axis=1).tolist(), strict=True):
        force, _, shape = name.partition(" ")
        rows.append(Coefficient(force, shape, value, error, value / error if error > 0.0 else np.nan, low, high))
    # coefficients first, then shapes
    return tuple(sorted(rows, key=lambda c: bool(c.shape)))


def describe_tails(coefficients: Sequence[Coefficient]) -> list[str]:
    """Cautions about coefficients whose standard deviation is far above that of their interval."""
    width = 2.0 * float(ndtri(0.5 * (1.0 + INTERVAL)))
    long = [c.parameter for c in coefficients if width * c.std_error > LONG_TAIL * (c.high - c.low)]
    return [f"a few extreme draws dominate the standard error of {name}: use its interval" for name in long]
