"""Trials of bands and posteriors: coverage on known structures, and ranks of true parameters.

Coverage: a structure drawn at random (:mod:`damping_validation.truths`) is tested at a few levels with noise, resonant
amplitudes beyond are predicted, and the next test is made. Simulation-based calibration (Talts et al. 2018): parameters
are drawn from the prior, data from the likelihood; the rank of each true value among posterior draws must then be
uniform.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import binom
from scipy.stats import t as student

from damping.arrays import RAD_S_PER_HZ, BoolArray, FloatArray
from damping.extrapolation import extrapolate_loads
from damping.extrapolation.draws import Member, amplitude_draws
from damping.forces import CATALOGUE, component
from damping.forces.shapes import Tested
from damping.infer.chains import sample
from damping.infer.evidence import brief_evidence, evidence
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations, at_resonance
from damping.predict.steady import resonant_amplitude
from damping.records.mode import Mode
from damping_validation.truths import OMEGA, Truth, draw_truth, log_uniform, peaks, sweeps

RATIOS = (1.5, 2.0, 4.0)  #: forces predicted, relative to the largest tested one
LEVEL = 0.9  #: probability content of the bands
#: Share of next tests that bands are to hold, least and most; largest share above them.
HELD = (0.86, 0.96)
ABOVE = 0.08
#: The same of any one structure at the largest ratio: least share held, largest share above.
WORST = 0.75
WORST_ABOVE = 0.20
#: Predictions of a structure from which on these shares are given: of fewer they err by more than a sixth.
FEWEST_GIVEN = 10
OVER_ORACLE = 2.2  #: largest ln width over that of a fitter who knows the form, at the largest ratio
#: Content of the band of ranks and of the binomial bounds that goals are held against.
SURE = 0.99
BINS = 8  #: bins of a histogram of ranks
LEVELS = (2, 6)  #: levels of a trial, fewest and most
SPANS = (1.3, 4.0)  #: largest over smallest force of a trial, least and most
NOISES = (0.003, 0.04)  #: noise of a trial, standard deviation of ln A, least and most
SWEPT_SHARE = 0.15  #: share of trials tested by whole sweeps
#: Noise of a resonance frequency, relative, least and most: of a phase-locked dwell to that of a coarse sweep.
FREQUENCY_NOISES = (2e-5, 1e-3)
ONE_FREQUENCY = 0.25  #: share of trials with one frequency for all levels: that it moves was not measured
RANKED = 63  #: posterior draws that a true value is ranked among
#: Laws whose posteriors are calibrated: all with a resonance, alone and beside a viscous part.
CALIBRATED = (
    *(Law((name,)) for name in CATALOGUE if component(name).example.resonates),
    *(Law(("viscous", name)) for name, kind in CATALOGUE.items() if (kind.sums or kind.beside) and not kind.viscous),
)
TESTED = Tested(0.5, 2.0, OMEGA)  #: what the calibration data are taken to cover, for the priors of shapes
_FORCES = np.geomspace(0.5, 2.0, 4)  #: forces of calibration data, of the order of one
_RANGE = 100.0  #: amplitudes beyond this factor from 1 either way are not drawn


@dataclass(frozen=True)
class Coverage:
    """One trial of the bands; arrays over ``RATIOS``."""

    levels: int  #: tested
    span: float  #: largest over smallest tested force
    noise: float  #: standard deviation of ln A
    winner: str  #: law of largest weight
    true: bool  #: whether it is the law of the structure
    ratio: FloatArray  #: force over the largest tested one
    refused: BoolArray  #: no prediction
    above: BoolArray  #: whether the next test lies above the band
    below: BoolArray  #: whether it lies below
    width: FloatArray  #: ln(high/low)
    oracle: FloatArray  #: the width with the true form known, NaN if the library does not have it
    error: FloatArray  #: ln(median/true amplitude)


def coverage_trial(name: str, way: str, seed: int, laws: Sequence[Law] | None = None) -> Coverage:
    """Test a structure drawn at random (``truths``), predict, and make the next tests.

    ``way``: ``fast`` (few importance draws) or ``importance``. ``laws``: candidates, by default the program's.
    """
    rng = np.random.default_rng(seed)
    truth = draw_truth(name, rng)
    levels = int(rng.integers(LEVELS[0], LEVELS[1] + 1))
    span, noise = log_uniform(rng, *SPANS), log_uniform(rng, *NOISES)
    tested = np.geomspace(span**-0.5, span**0.5, levels)
    swept = rng.random() < SWEPT_SHARE
    read = truth.amplitude(tested) * np.exp(noise * rng.standard_normal(levels))
    all_rows = sweeps(truth.amplitude, tested, noise, 0.5 * noise, rng) if swept else None
    data = _read_frequencies(at_resonance(all_rows) if all_rows else peaks(tested, read), truth, rng.spawn(1)[0])

    force = tested[-1] * np.array(RATIOS)
    fast = way == "fast"
    estimate = brief_evidence if fast else evidence
    mode = Mode(name=name, frequency=OMEGA / RAD_S_PER_HZ, mass=truth.mass)
    known = (data, force, LEVEL, seed)
    predicted = extrapolate_loads(*known, mode=mode, laws=laws, all_rows=all_rows, estimate=estimate, fresh=not fast)
    band, leading = predicted.loads.average, predicted.plan.laws[0].law
    true = truth.amplitude(force)
    next_test = true * np.exp(noise * rng.standard_normal(len(force)))
    return Coverage(
        levels=levels,
        span=span,
        noise=noise,
        winner=leading.name,
        true=leading == truth.law,
        ratio=np.array(RATIOS),
        refused=np.isnan(band.median),
        above=next_test > band.high,
        below=next_test < band.low,
        width=np.log(band.high / band.low),
        oracle=oracle_width(truth.law, data, force) if truth.law else np.full(len(force), np.nan),
        error=np.log(band.median / true),
    )


def _read_frequencies(data: Observations, truth: Truth, rng: np.random.Generator) -> Observations:
    """The same with the resonance frequency of each level as it is read, or with one for all."""
    noise = log_uniform(rng, *FREQUENCY_NOISES)
    omega = truth.omega(truth.amplitude(data.tested_force)) * np.exp(noise * rng.standard_normal(len(data.A)))
    return data if rng.random() < ONE_FREQUENCY else replace(data, omega=omega, tested_omega=omega)


def oracle_width(law: Law, data: Observations, force: FloatArray) -> FloatArray:
    """ln(high/low) of the prediction interval if only the true form is known, (forces,).

    Least squares of ln A over the parameters, Student's t with the levels' degrees of freedom; NaN without any.
    """
    coordinates = replace(Coordinates.of(law, data), with_level_scatter=False, with_discrepancy=False)
    k = coordinates.dimension - 1  # the last is the scatter, which least squares has no use for
    freedom = len(data.tested_force) - k
    if freedom < 1:
        return np.full(len(force), np.nan)

    def log_amplitude(x: FloatArray, at: FloatArray) -> FloatArray:
        amplitude = resonant_amplitude(coordinates.force(np.append(x, 0.0)[None]), at[None, :], OMEGA)
        return np.asarray(np.log(amplitude)[0])

    def left(x: FloatArray) -> FloatArray:
        value = log_amplitude(x, data.tested_force) - np.log(data.tested_amplitude)
        return np.where(np.isfinite(value), value, 10.0)

    starts = np.random.default_rng(0).standard_normal((4, k))
    fits = [least_squares(left, start, diff_step=np.full(k, 1e-4)) for start in starts]
    best = min(fits, key=lambda fit: float(fit.cost))
    steps = 1e-4 * np.eye(k)
    slopes = np.array([log_amplitude(best.x + d, force) - log_amplitude(best.x - d, force) for d in steps]).T / 2e-4
    jacobian = np.asarray(best.jac)
    leverage = np.einsum("ij,jk,ik->i", slopes, np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-8), slopes)
    scatter = np.sqrt(2.0 * best.cost / freedom)
    return np.asarray(2.0 * student.ppf(0.5 + 0.5 * LEVEL, freedom) * scatter * np.sqrt(1.0 + leverage))


def rank_trial(law: Law, seed: int, chains: bool = False, swept: bool = False) -> dict[str, int]:
    """Rank of each parameter, and of an amplitude beyond the test, among posterior draws: 0 to ``RANKED``.

    Simulated are four resonances or, ``swept``, four whole sweeps of nine rows between the half-power points, with
    scatter of rows and levels. Draws of the prior without a resonance at every force in a wide range are left out, from
    the posterior as well. ``chains``: sample by emcee; by importance draws otherwise.
    """
    rng = np.random.default_rng(seed)
    coordinates = Coordinates(law, (1.0, OMEGA, 1.0), TESTED, swept)
    prior = rng.standard_normal((2000, coordinates.dimension))
    true = prior[_in_range(coordinates, prior)][:1]
    exact = _amplitudes(coordinates, true)[0]
    if swept:
        row, level = (float(value[0]) for value in coordinates.scatter(true))
        data = sweeps(lambda force: _amplitudes(coordinates, true, force)[0], _FORCES, level, row, rng)
        data = replace(data, tested_amplitude=exact)
    else:
        data = peaks(_FORCES, exact * np.exp(coordinates.scatter(true)[0] * rng.standard_normal(len(_FORCES))))
    estimate = evidence(coordinates, data, int(rng.integers(2**31)))
    x = estimate.draws
    if chains:
        x = sample(coordinates, data, estimate, lambda x: {}, int(rng.integers(2**31))).draws
    x = rng.permutation(x[_in_range(coordinates, x)])[:RANKED]
    values, at = _quantities(coordinates, x, data), _quantities(coordinates, true, data)
    # draws by importance may repeat: ties are broken at random
    return {
        name: int(np.sum(v < at[name])) + int(rng.integers(np.sum(v == at[name]) + 1)) for name, v in values.items()
    }


def _quantities(coordinates: Coordinates, x: FloatArray, data: Observations) -> dict[str, FloatArray]:
    """Parameters, and the amplitude at 1.5 times the largest force."""
    member = Member(coordinates.law.name, 1.0, coordinates, x)
    beyond = amplitude_draws(member, np.array([1.5 * _FORCES[-1]]), data)[:, 0]
    return {**coordinates.parameters(x), "amplitude beyond": np.where(np.isfinite(beyond), beyond, np.inf)}


def _in_range(coordinates: Coordinates, x: FloatArray) -> BoolArray:
    """Whether draws (n, dimension) have amplitudes within a factor ``_RANGE`` at every force, (n,)."""
    A = _amplitudes(coordinates, x)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.all(np.abs(np.log(A)) < np.log(_RANGE), axis=1))


def _amplitudes(coordinates: Coordinates, x: FloatArray, force: FloatArray = _FORCES) -> FloatArray:
    """Resonant amplitudes at forces, by default those of the calibration data, (draws, forces)."""
    return resonant_amplitude(coordinates.force(x), force[None, :], OMEGA)


_SIMULATIONS = 4000  #: simulated ECDFs that a band is widened to hold


@lru_cache(maxsize=8)
def ecdf_band(n: int, level: float) -> tuple[FloatArray, FloatArray]:
    """Simultaneous band of the ECDF of ``n`` uniform ranks 0..RANKED, at k/(RANKED + 1), k = 1..RANKED.

    Pointwise binomial intervals, widened until a share ``level`` of simulated ECDFs lies inside throughout
    (Saeilynoja, Buerkner & Vehtari 2022).
    """
    z = np.arange(1, RANKED + 1) / (RANKED + 1)
    ranks = np.random.default_rng(0).integers(0, RANKED + 1, (_SIMULATIONS, n))
    counts = np.stack([np.sum(ranks < k, axis=1) for k in range(1, RANKED + 1)], axis=1)
    tail = 2.0 * np.minimum(binom.cdf(counts, n, z), binom.sf(counts - 1, n, z)).min(axis=1)
    gamma = float(np.quantile(tail, 1.0 - level))
    return np.asarray(binom.ppf(gamma / 2.0, n, z)) / n, np.asarray(binom.isf(gamma / 2.0, n, z)) / n


def ecdf(ranks: FloatArray) -> FloatArray:
    """ECDF of ranks at k/(RANKED + 1), k = 1..RANKED: share of ranks below k."""
    return np.array([np.mean(ranks < k) for k in range(1, RANKED + 1)])


def is_uniform(ranks: FloatArray, level: float) -> bool:
    """Whether the ECDF of ranks stays inside its simultaneous band."""
    low, high = ecdf_band(len(ranks), level)
    shares = ecdf(ranks)
    return bool(np.all((shares >= low) & (shares <= high)))
