"""emcee against independent methods: closed forms, importance sampling, nested sampling; and a wrong target noticed."""

from dataclasses import dataclass, replace
from functools import partial

import arviz
import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import kurtosis, norm

from damping.infer.balanced import Balanced
from damping.infer.chains import Target, run, sample
from damping.infer.evidence import evidence
from damping.infer.importance import draw_again, importance
from damping.infer.law import Coordinates, Law
from damping.infer.likelihood import log_likelihood, log_prior
from damping_validation.truths import draw_truth, sweeps

pytestmark = pytest.mark.sampling

#: Differences allowed, in standard errors of the two estimates: some fifty are looked at, of which one beyond 4 would
#: come by chance in 300 sets of seeds.
LARGEST = 4.0
LIMITS = (0.05, 0.95)
#: Effective importance draws beside the chains: the tails of a slip joint's posterior are heavier than 10 000 show
#: (their own errors come out a third too small).
MANY = 60_000


@dataclass(frozen=True)
class Estimate:
    """Mean, standard deviation, 5 % and 95 % points, (4,), and their Monte Carlo standard errors."""

    value: np.ndarray
    error: np.ndarray


def estimate(draws: np.ndarray, size: float, shape: np.ndarray | None = None) -> Estimate:
    """From draws worth ``size`` independent ones; ``shape``: more draws of the same distribution, where there are.

    Errors: sd/sqrt(n); sd sqrt((kurtosis - 1)/(4 n)); half the distance of the quantiles at q -+ sqrt(q (1 - q)/n).
    Those of few draws of a long tail, most of which lack its end, come out too small.
    """
    many = draws if shape is None else shape
    quantiles = [np.quantile(draws, q) for q in LIMITS]
    steps = [np.sqrt(q * (1.0 - q) / size) for q in LIMITS]
    around = [np.quantile(many, [q - s, q + s]) for q, s in zip(LIMITS, steps, strict=True)]
    tails = [(high - low) / 2.0 for low, high in around]
    spread = many.std() * np.sqrt((kurtosis(many, fisher=False) - 1.0) / (4.0 * size))
    errors = np.array([many.std() / np.sqrt(size), spread, *tails])
    return Estimate(np.array([draws.mean(), draws.std(), *quantiles]), errors)


def of_chains(values: np.ndarray, shape: np.ndarray | None = None) -> Estimate:
    """From chains (ensembles, draws), worth the least of arviz's effective sizes."""
    sizes = [float(arviz.ess(values, method=method)) for method in ("mean", "sd", "bulk", "tail")]
    return estimate(values.ravel(), min(*sizes, values.size), shape)


def exact(mean: float, sd: float) -> Estimate:
    """Of a normal distribution."""
    return Estimate(np.array([mean, sd, *norm.ppf(LIMITS, mean, sd)]), np.zeros(4))


def largest_difference(a: dict[str, Estimate], b: dict[str, Estimate]) -> float:
    """In standard errors, over all quantities and their four numbers."""
    assert set(a) == set(b)
    return float(max(np.max(np.abs(a[n].value - b[n].value) / np.hypot(a[n].error, b[n].error)) for n in a))


def chains_of(log_density, dimension, start, names, seed):
    """Run a target in plain variables and estimate them."""
    target = Target(log_density, dimension, lambda x: dict(zip(names, x.T, strict=True)))
    found = run(target, start, seed)
    assert found.converged, found.failure
    return {name: of_chains(found.x[..., i]) for i, name in enumerate(names)}


def conjugate(columns: np.ndarray, log_A: np.ndarray, scatter: float):
    """Posterior of linear coefficients with N(0, 1) priors and known scatter: mean, covariance, log density."""
    precision = np.eye(columns.shape[1]) + columns.T @ columns / scatter**2
    covariance = np.linalg.inv(precision)
    mean = covariance @ columns.T @ log_A / scatter**2

    def log_density(x):
        residual = log_A - x @ columns.T
        return -0.5 * np.sum(residual**2, axis=1) / scatter**2 - 0.5 * np.sum(x**2, axis=1)

    return mean, covariance, log_density


@pytest.mark.parametrize("law", ["viscous", "power law"])
def test_closed_form(law, saturn):
    """Resonances in log space with a known scatter of 2 %: ln A = ln F - ln(c omega), or a line in ln F."""
    data = saturn("config-2-mode-1")
    log_F, log_A = np.log(data.tested_force / data.tested_force.mean()), np.log(data.tested_amplitude)
    one = np.ones((len(log_F), 1))
    columns, known = (one, log_F) if law == "viscous" else (np.column_stack([one, log_F]), 0.0)
    mean, covariance, log_density = conjugate(columns, log_A - known, 0.02)
    names = ["-ln c omega", "1/p"][: len(mean)]
    start = importance(log_density, np.zeros(len(mean)), np.eye(len(mean)))
    found = chains_of(log_density, len(mean), start, names, seed=1)
    truth = {n: exact(m, s) for n, m, s in zip(names, mean, np.sqrt(np.diag(covariance)), strict=True)}
    assert largest_difference(found, truth) < LARGEST


@pytest.mark.parametrize(
    "components", [("viscous",), ("velocity-power",), ("viscous", "quadratic-displacement"), ("viscous", "slip")]
)
def test_importance_sampling(components, saturn):
    data = saturn("config-2-mode-2")
    c = Coordinates.of(Law(components), data)
    start = evidence(c, data)
    posterior = sample(c, data, start, lambda x: {}, seed=2)
    assert posterior.converged, posterior.failure
    balanced = Balanced.of(c, data)
    begin = replace(start, draws=balanced.find_variables(start.draws))
    fresh = draw_again(balanced.log_density, begin.proposal, int(MANY * len(start.draws) / start.effective_draws), 1)
    assert fresh.effective_draws > 0.5 * MANY
    values = c.parameters(balanced.find_points(fresh.draws))
    other = {n: estimate(v, fresh.effective_draws) for n, v in values.items()}
    found = {name: of_chains(own, values[name]) for name, own in posterior.parameters().items()}
    assert largest_difference(found, other) < LARGEST


@pytest.fixture(scope="module", params=[pytest.param(400, marks=pytest.mark.slow)])
def nested(saturn, request):
    """A two-term law: coordinates, data, nested sampling's estimates and log marginal likelihood with its error."""
    from dynesty import NestedSampler

    data = saturn("config-2-mode-1")
    c = Coordinates.of(Law(("viscous", "displacement-velocity")), data)
    sampler = NestedSampler(
        lambda x: float(log_likelihood(x[None, :], c, data)[0]), ndtri, c.dimension, nlive=request.param,
        rstate=np.random.default_rng(3),
    )  # fmt: skip
    sampler.run_nested(print_progress=False, dlogz=0.01)
    weights = sampler.results.importance_weights()
    chosen = np.random.default_rng(4).choice(len(weights), 20_000, p=weights)
    draws = c.parameters(sampler.results.samples[chosen])
    estimates = {name: estimate(v, 1.0 / np.sum(weights**2)) for name, v in draws.items()}
    return c, data, estimates, sampler.results.logz[-1], sampler.results.logzerr[-1]


def test_nested_sampling(nested):
    c, data, other, _, _ = nested
    posterior = sample(c, data, evidence(c, data), lambda x: {}, seed=5)
    assert posterior.converged, posterior.failure
    assert largest_difference({n: of_chains(v) for n, v in posterior.parameters().items()}, other) < LARGEST


def test_marginal_likelihood(nested):
    c, data, _, log_z, error = nested
    found = evidence(c, data)
    assert abs(found.log_z - log_z) < LARGEST * np.hypot(error, found.standard_error)


@pytest.mark.slow
def test_marginal_likelihood_of_sweeps():
    """45 rows of a slipping joint with 0.1 % noise, and a third force whose share is a thousandth: a search for the
    mode that starts from two per cent ends a hundred below it."""
    from dynesty import NestedSampler

    rng = np.random.default_rng(3)
    truth = draw_truth("viscous + slip", rng)
    data = sweeps(truth.amplitude, np.geomspace(0.5, 2.0, 5), 0.002, 0.001, rng)
    c = Coordinates.of(Law(("viscous", "quadratic-displacement", "slip")), data)
    posterior = Balanced.of(c, data)

    def log_like(x):
        return float(np.maximum(log_likelihood(x[None, :], posterior.coordinates, posterior.data)[0], -1e10))

    rstate = np.random.default_rng(3)
    sampler = NestedSampler(log_like, ndtri, c.dimension, nlive=120, sample="rwalk", rstate=rstate)
    sampler.run_nested(print_progress=False, dlogz=0.05)
    found, other = evidence(c, data), sampler.results
    assert abs(found.log_z - other.logz[-1]) < LARGEST * np.hypot(other.logzerr[-1], found.standard_error)


def tempered(x, c, data):
    """A likelihood that counts every row half."""
    return log_prior(x) + 0.5 * log_likelihood(x, c, data)


def shifted(x, c, data):
    """A posterior half a standard deviation of the prior off in the last variable, the scatter."""
    x = np.array(x)
    x[:, -1] += 0.5
    return log_prior(x) + log_likelihood(x, c, data)


@pytest.mark.parametrize("wrong", [tempered, shifted])
def test_a_wrong_target_fails(wrong, nested):
    """The comparison with nested sampling has teeth."""
    c, data, other, _, _ = nested
    start = evidence(c, data)
    target = Target(partial(wrong, c=c, data=data), c.dimension, c.parameters)
    found = run(target, start, seed=5)
    assert found.converged, found.failure
    values = c.parameters(found.x)
    assert largest_difference({n: of_chains(v) for n, v in values.items()}, other) > 2.0 * LARGEST
