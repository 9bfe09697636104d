"""Priors, likelihood, importance sampling and posterior of the planar oscillator."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import radians

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import kstest, multivariate_normal, norm

from damping.infer.chains import Settings
from damping.infer.importance import importance
from damping.infer.likelihood import log_prior
from damping_reed1970.chapter_3 import PlanarOscillator, pitch_response
from damping_reed1970.chapter_3.planar_fit import Phasors, fit_planar
from damping_reed1970.chapter_3.planar_posterior import (
    PlanarPrior,
    log_likelihood,
    log_posterior,
    planar_evidence,
    planar_posterior,
)

OMEGA = np.linspace(11.1, 11.7, 25)
F = np.full(25, 38.5)
TRUE = PlanarOscillator(M=21.0, C=2.3, omega_p=11.39, omega_y=11.48, theta=radians(36.0))


def data(noise: float = 0.03, seed: int = 0) -> Phasors:
    rng = np.random.default_rng(seed)
    scatter = noise * (rng.standard_normal(25) + 1j * rng.standard_normal(25))
    return Phasors(pitch_response(TRUE, F, OMEGA) + scatter, F, OMEGA)


@pytest.fixture(scope="module")
def prior() -> PlanarPrior:
    return PlanarPrior(data(), mass=21.0, extras=("lag", "R"))


def test_the_prior_is_the_one_that_is_stated(prior: PlanarPrior) -> None:
    x = np.random.default_rng(1).standard_normal((4000, prior.dimension))
    p = prior.parameters(x)
    low, high = OMEGA[0], OMEGA[-1]
    assert np.all(p["omega_p"] <= p["omega_y"])
    share = {name: (p[name] - low) / (high - low) for name in ("omega_p", "omega_y")}
    largest = np.abs(data().q).max()
    uniforms = {
        "omega_y": share["omega_y"] ** 2,  # the larger of two uniforms has distribution u^2, the smaller 1 - (1 - u)^2
        "omega_p": 1.0 - (1.0 - share["omega_p"]) ** 2,
        "theta": p["theta"] / (0.5 * np.pi),
        "M": norm.cdf(np.log(p["M"] / 21.0) / 0.5),
        "xi": norm.cdf(np.log(p["xi"] / 0.01)),
        "sigma": norm.cdf(np.log(p["sigma"] / (0.05 * largest))),
        "R": norm.cdf(p["R"] * 38.5 / (0.2 * largest)),
        "lag": norm.cdf(p["lag"] / 0.1),
    }
    for name, uniform in uniforms.items():
        assert kstest(uniform, "uniform").pvalue > 1e-4, name  # eight tests at a fixed seed
    assert_allclose(p["C"], 2.0 * p["xi"] * p["M"] * p["omega_p"], rtol=1e-14)


def test_what_is_held_is_held() -> None:
    prior = PlanarPrior(data(), 21.0, {"theta": 0.5, "M": 22.0})
    x = np.zeros((1, prior.dimension))
    assert prior.names == ("omega_p", "omega_y", "xi", "sigma")
    assert (prior.values(x)["theta"], prior.values(x)["M"]) == (0.5, 22.0)
    assert set(prior.parameters(x)) == {"omega_p", "omega_y", "C", "xi", "sigma"}


@pytest.mark.parametrize("noise", ["constant", "proportional"])
def test_the_likelihood_is_a_circular_normal(noise: str, prior: PlanarPrior) -> None:
    phasors = Phasors(data().q, F, OMEGA, noise)  # type: ignore[arg-type]  # parametrised
    prior = replace(prior, data=phasors)
    x = np.random.default_rng(2).standard_normal((3, prior.dimension)) * 0.3
    values = prior.values(x)
    for i, found in enumerate(log_likelihood(x, prior)):
        model = pitch_response(
            PlanarOscillator(*(float(values[name][i]) for name in PlanarOscillator._fields)), F, OMEGA
        )
        sd = values["sigma"][i] * phasors.shape
        parts = [np.column_stack([z.real, z.imag]) for z in (phasors.q, model)]
        expected = sum(multivariate_normal.logpdf(q, m, s**2 * np.eye(2)) for q, m, s in zip(*parts, sd, strict=True))
        assert_allclose(found, expected, rtol=1e-12)
    assert_allclose(log_posterior(x, prior), log_likelihood(x, prior) + log_prior(x), rtol=1e-14)
    assert log_posterior(np.full((1, prior.dimension), 9.0), prior) == -np.inf


def test_importance_of_a_known_density() -> None:
    """Two normal parts of known weight, one far from where it begins: the integral, and where the draws are."""

    def density(x: np.ndarray) -> np.ndarray:
        parts = [(1.0, np.array([0.0, 0.0]), 0.2), (3.0, np.array([1.5, -1.0]), 0.3)]
        return np.logaddexp.reduce(
            [np.log(a) - 0.5 * np.sum((x - m) ** 2, axis=1) / s**2 - np.log(2 * np.pi * s**2) for a, m, s in parts]
        )

    found = importance(density, np.zeros(2), 0.04 * np.eye(2), seed=3, wanted=2500.0)
    assert abs(found.log_z - np.log(4.0)) < 5.0 * found.standard_error
    assert found.standard_error < 0.02
    share = np.mean(found.draws[:, 0] > 0.75)
    assert abs(share - 0.75) < 5.0 * np.sqrt(0.75 * 0.25 / found.effective_draws)


def test_evidence_of_held_angles_adds_up_to_that_of_a_free_one() -> None:
    phasors = data()
    free = planar_evidence(PlanarPrior(phasors, 21.0))
    # theta is uniform over 0 to 90 degrees; its posterior is normal about 35.8 with .7 degrees: steps of .7 integrate
    # that to 1e-8, and four standard deviations either way leave out 6e-5
    angles = np.arange(33.0, 38.8, 0.7)
    held = [planar_evidence(PlanarPrior(phasors, 21.0, {"theta": radians(a)})) for a in angles]
    log_z = np.logaddexp.reduce([one.log_z for one in held]) + np.log(0.7 / 90.0)
    assert abs(log_z - free.log_z) < 5.0 * np.hypot(free.standard_error, max(one.standard_error for one in held))


@pytest.mark.sampling
def test_posterior_converges_and_agrees_with_least_squares() -> None:
    phasors = data(noise=0.01)  # well determined: the posterior is close to normal
    prior = PlanarPrior(phasors, 21.0)
    posterior = planar_posterior(prior, seed=4)
    assert posterior.chains
    assert posterior.chains.converged, posterior.chains.failure
    for d in posterior.chains.diagnoses:
        assert d.r_hat <= 1.01
        assert d.effective_size >= 1000
        assert d.lengths >= 50
    fit = fit_planar(phasors)
    for name, values in posterior.prior.parameters(posterior.draws).items():
        if name != "sigma":
            estimate = fit.xi if name == "xi" else getattr(fit.model, name)
            error = fit.standard_errors[name]
            # priors move it by little, nothing is exactly linear: a fifth of the standard error
            assert abs(values.mean() - estimate) < 0.2 * error, name
            assert_allclose(values.std(), error, rtol=0.15)  # 1000 draws: 2 per cent; 2 n against 2 n - 5: 5 per cent
    weighted = prior.parameters(posterior.evidence.draws)
    for d in posterior.chains.diagnoses:
        error = np.hypot(d.monte_carlo_error, d.sd / np.sqrt(posterior.evidence.effective_draws))
        assert abs(d.mean - weighted[d.name].mean()) < 5.0 * error  # two independent estimates


@pytest.mark.sampling
def test_a_seed_gives_the_same_digits() -> None:
    sample = partial(planar_posterior, PlanarPrior(data(), 21.0), settings=Settings(budget=50))
    first, second = sample(seed=5), sample(seed=5)
    np.testing.assert_array_equal(first.draws, second.draws)
    assert not np.array_equal(first.draws, sample(seed=6).draws)
