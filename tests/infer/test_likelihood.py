"""The likelihood against dense algebra, closed forms and a change of units."""

import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from damping.infer.balanced import Balanced
from damping.infer.checks import predictive_check
from damping.infer.law import Coordinates, Law
from damping.infer.likelihood import (
    BLOCK,
    REACH,
    by_blocks,
    log_likelihood,
    log_prior,
    pointwise_log_likelihood,
    residuals,
)
from damping.infer.observations import Observations


def without_discrepancy(law: Law, data: Observations) -> Coordinates:
    """Coordinates without a discrepancy of the exponent, which has tests of its own (test_discrepancy.py)."""
    return replace(Coordinates.of(law, data), with_discrepancy=False)


def swept(peaks, rows=5, levels=3):
    """Several rows a sweep, with forces in phase as well, so that every part of the likelihood is at work."""
    rng = np.random.default_rng(3)
    n = rows * levels
    A = rng.uniform(0.5, 1.5, n)
    data = peaks(A, 2.0 * A * 10.0 * rng.uniform(0.97, 1.03, n), 10.0)
    top = np.arange(levels) * rows
    return replace(
        data,
        R=rng.uniform(0.0, 30.0, n),
        sweep=np.repeat(np.arange(levels), rows),
        sd_amplitude=np.full(n, 0.01),
        sd_phase=np.full(n, 0.02),
        sweeps=tuple(f"L{i}" for i in range(levels)),
        tested_force=data.D[top],
        tested_amplitude=A[top],
        tested_omega=data.omega[top],
    )


def dense(x, c, data):
    """Log likelihood by the covariance written out: rows' own scatter, and a level's common to its rows."""
    n, h, known = residuals(c.force(x), data)
    row, level = c.scatter(x)
    same_sweep = data.sweep[:, None] == data.sweep[None, :]
    covariances = (
        np.diag(row[i] ** 2 + known[i]) + level[i] ** 2 * np.outer(h[i], h[i]) * same_sweep for i in range(len(x))
    )
    return [multivariate_normal(np.zeros(len(one)), cov).logpdf(one) for one, cov in zip(n, covariances, strict=True)]


def test_against_a_dense_multivariate_normal(peaks):
    data = swept(peaks)
    c = without_discrepancy(Law(("viscous", "displacement")), data)
    assert c.with_level_scatter
    x = np.random.default_rng(4).standard_normal((6, c.dimension))
    np.testing.assert_allclose(log_likelihood(x, c, data), dense(x, c, data), rtol=1e-9)  # two routes, 15 x 15 algebra


@pytest.mark.parametrize("forces", ["equal", "three", "all differ"])
def test_many_levels_weigh_as_the_dense_covariance_says(peaks, monkeypatch, forces):
    """Single rows, each a sweep of its own label, took minutes: every density cost the cube of their number."""
    rng, n = np.random.default_rng(8), 60
    A = {"equal": np.ones(n), "three": np.tile([0.5, 1.0, 2.0], 20), "all differ": rng.uniform(0.5, 2.0, n)}[forces]
    data = peaks(A, 2.0 * A**1.3 * 10.0 * rng.normal(1.0, 0.02, n), 10.0)
    data = replace(data, tested_force=np.round(20.0 * A, 12))
    law = Balanced.of(Coordinates.of(Law(("viscous", "velocity-squared")), data), data)
    z, used = 0.5 * rng.standard_normal((2000, law.coordinates.dimension)), []
    z[:, 0] *= 0.1
    monkeypatch.setattr("damping.infer.likelihood.integrate_levels", lambda *given: used.append(given))
    by_curves = law.log_density(z)
    assert not used  # no matrix of all levels is factorised
    monkeypatch.undo()
    monkeypatch.setattr("damping.infer.likelihood._FEW", n)
    whole = law.log_density(z)
    near = whole > whole.max() - 20.0  # the others have no weight
    assert near.sum() > 10
    # laws are told apart by differences of 1
    np.testing.assert_allclose(by_curves[near], whole[near], rtol=0.0, atol=0.05)


def test_residual_at_resonance_is_the_relative_amplitude_error(peaks):
    # C = (8/3 pi) c (A omega)^2: a 1 % amplitude error reads 1 % to first order, the next term being 1 % of that
    A, omega, c = np.array([1.0, 1.4]), 10.0, 0.13
    from damping.forces import make

    n, h, _ = residuals(
        make("velocity-squared", coefficient=c), peaks(1.01 * A, 8.0 / (3.0 * np.pi) * c * (A * omega) ** 2, omega)
    )
    np.testing.assert_allclose(n, -0.01, rtol=0.02)
    np.testing.assert_allclose(h, 1.0, rtol=1e-12)


def test_residual_far_from_resonance_is_the_phase_error(peaks):
    from damping.forces import make

    A, omega, c, F, slip = np.array([1.0]), 10.0, 0.05, 100.0, 1e-3
    phase = np.arcsin(c * omega / F) + slip  # tan(phi) = .005: the rest is stiffness
    data = replace(peaks(A, F * np.sin(phase), omega), R=F * np.cos(phase))
    n, h, _ = residuals(make("viscous", coefficient=c), data)
    np.testing.assert_allclose(n, slip, rtol=1e-4)  # cos(phi) = 1 - 2e-5
    assert abs(h[0]) < 0.01


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_residual_grows_without_bound_both_ways(factor, peaks):
    from damping.forces import make

    A = np.array([1.0, 2.0])
    n, _, _ = residuals(make("viscous", coefficient=2.0 * factor), peaks(A, 2.0 * A * 10.0, 10.0))
    np.testing.assert_allclose(np.abs(n), 1e6, rtol=1e-5)  # (1 - 1e-6)/1e-6


def test_known_uncertainties_are_propagated(peaks):
    """The variance of n of a row on the curve, by differences of n itself in ln A, in the phase and in ln F."""
    from damping.forces import make

    law, step = make("displacement-velocity", coefficient=2.0), 1e-6
    data = swept(peaks)
    data = replace(data, D=law.quadrature(data.A, data.omega), sd_force=np.full(len(data.A), 0.03))
    F, phase = np.hypot(data.D, data.R), np.arctan2(data.D, data.R)
    moved = (
        (data.sd_amplitude, replace(data, A=data.A * (1.0 + step))),
        (data.sd_phase, replace(data, D=F * np.sin(phase + step), R=F * np.cos(phase + step))),
        (data.sd_force, replace(data, D=data.D * (1.0 + step), R=data.R * (1.0 + step))),
    )
    n, _, known = residuals(law, data)
    np.testing.assert_allclose(n, 0.0, rtol=0.0, atol=1e-15)
    expected = sum((sd * residuals(law, other)[0] / step) ** 2 for sd, other in moved)
    np.testing.assert_allclose(known, expected, rtol=1e-4, atol=0.0)  # one-sided differences of 1e-6


def test_rows_of_a_single_sweep_have_the_marginals_of_its_covariance(peaks):
    data = swept(peaks)
    c = without_discrepancy(Law(("viscous", "displacement")), data)
    alone = data.take_sweeps(np.array([False, True, False]))
    x = np.random.default_rng(7).standard_normal((4, c.dimension))
    n, h, known = residuals(c.force(x), alone)
    row, level = c.scatter(x)
    assert np.all(level > 0.0)
    sd = [
        np.sqrt(np.diag(np.diag(r**2 + k) + s**2 * np.outer(g, g)))
        for r, k, s, g in zip(row, known, level, h, strict=True)
    ]
    found = pointwise_log_likelihood(x, c, alone)
    np.testing.assert_allclose(found, norm.logpdf(n, scale=sd), rtol=1e-12)  # rounding


def test_units_change_nothing(saturn):
    data = saturn("config-1-mode-2-rough")
    pound, inch = 4.4482216152605, 0.0254
    metric = replace(
        data,
        A=data.A * inch,
        D=data.D * pound,
        R=data.R * pound,
        tested_amplitude=data.tested_amplitude * inch,
        tested_force=data.tested_force * pound,
    )
    law = Law(("viscous", "velocity-squared"))
    x = np.random.default_rng(5).standard_normal((4, 3))
    np.testing.assert_allclose(
        log_likelihood(x, without_discrepancy(law, data), data),
        log_likelihood(x, without_discrepancy(law, metric), metric),
        rtol=1e-9,  # rounding of the factors
    )


def test_prior_is_standard_normal_and_cut_off(peaks):
    x = np.array([[0.3, -1.2], [2.0, 0.0]])
    np.testing.assert_allclose(log_prior(x), norm.logpdf(x).sum(axis=1), rtol=1e-13)
    data = peaks(np.array([1.0, 2.0]), np.array([10.0, 20.0]), 5.0)
    c = without_discrepancy(Law(("viscous",)), data)
    assert Balanced(c, data).log_density(np.array([[0.0, REACH + 1.0]]))[0] == -np.inf


def test_a_law_that_cannot_carry_the_force_is_impossible(peaks):
    data = peaks(np.array([1.0, 2.0]), np.array([10.0, 20.0]), 5.0)
    c = without_discrepancy(Law(("coulomb",)), data)
    assert log_likelihood(np.zeros((1, c.dimension)), c, data)[0] == -np.inf


def test_units_left_out_add_up(peaks):
    data = swept(peaks)
    c = without_discrepancy(Law(("viscous",)), data)
    x = np.random.default_rng(6).standard_normal((3, c.dimension))
    by_level = pointwise_log_likelihood(x, c, data)
    assert by_level.shape == (3, 3)
    np.testing.assert_allclose(by_level.sum(axis=1), log_likelihood(x, c, data), rtol=1e-12)


def test_many_levels_against_a_dense_multivariate_normal(peaks):
    """Forty sweeps are summed in another way than a few."""
    data = replace(swept(peaks, 2, 40), sweep=np.tile(np.arange(40), 2))
    c = without_discrepancy(Law(("viscous",)), data)
    x = np.random.default_rng(4).standard_normal((3, c.dimension))
    np.testing.assert_allclose(log_likelihood(x, c, data), dense(x, c, data), rtol=1e-9)  # two routes, 80 x 80


def test_memory_does_not_grow_with_points_times_rows(peaks):
    """10^7 of them, 80 MB an array if taken at once; what comes out is what a few points at a time give."""
    data = swept(peaks, 2500, 4)
    c = without_discrepancy(Law(("viscous", "displacement")), data)
    x = np.random.default_rng(4).standard_normal((1000, c.dimension))
    tracemalloc.start()
    found = log_likelihood(x, c, data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(x) * len(data.A) > 10 * BLOCK
    assert peak < 20e6  # some ten arrays of a block, 0.5 MB each, and a few of all rows
    few = np.concatenate([log_likelihood(part, c, data) for part in np.array_split(x, 100)])
    np.testing.assert_allclose(found, few, rtol=1e-12)  # sums in another order


def test_memory_does_not_grow_with_points_times_levels_squared(peaks):
    """4000 covariances of 40 levels, as of a decay, are 51 MB an array if taken at once."""
    data = replace(swept(peaks, 2, 40), sweep=np.tile(np.arange(40), 2))
    c = without_discrepancy(Law(("viscous",)), data)
    x = np.random.default_rng(4).standard_normal((4000, c.dimension))
    tracemalloc.start()
    found = log_likelihood(x, c, data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6
    np.testing.assert_allclose(found[-3:], log_likelihood(x[-3:], c, data), rtol=1e-12)


def test_blocks_hold_every_point_once_in_order():
    x = np.arange(1000.0)[:, None]
    np.testing.assert_array_equal(by_blocks(lambda points: x[points, 0], len(x), 2500), x[:, 0])


@pytest.mark.parametrize("of_decay", [False, True])
def test_a_law_that_holds_is_not_rejected_because_levels_scatter_as_a_whole(peaks, of_decay):
    """Errors common to the rows of a level, or to neighbouring levels of a decay, are one error, not one per row."""
    levels, rows, sd, rng = 3, 1 if of_decay else 20, 0.011, np.random.default_rng(9)  # the median scatter, at x = 0
    phase = np.full(rows, 0.5 * np.pi) if of_decay else np.linspace(0.9, 2.2, rows)
    force = np.geomspace(20.0, 24.0 if of_decay else 80.0, levels)
    F = np.repeat(force, rows)
    exact = replace(
        peaks(force / 20.0, force, 10.0),
        omega=np.full(levels * rows, 10.0),
        sweep=np.repeat(np.arange(levels), rows),
        R=F * np.abs(np.cos(np.tile(phase, levels))),
        **dict.fromkeys(("sd_amplitude", "sd_force", "sd_phase"), np.zeros(levels * rows)),
        amplitude_is_input=of_decay,
    )
    coordinates = Coordinates.of(Law(("viscous",)), exact)
    x = np.zeros((400, coordinates.dimension))
    x[:, 0] = -np.log(coordinates.coefficients(x[:1])[0][0] / 2.0)  # C = 2 A omega, as F = 20 A
    alike = np.exp(-np.abs(np.subtract.outer(*2 * (np.log(force),))) / 0.4) if of_decay else np.eye(levels)
    trials, rejected = 200, 0
    for trial in range(trials):
        of_level = sd * np.linalg.cholesky(alike) @ rng.standard_normal(levels)
        noise = sd * rng.standard_normal((2, levels * rows))
        D = F * np.sin(np.tile(phase, levels))
        if of_decay:
            data = replace(exact, A=force / 20.0, D=D * (1.0 + of_level + noise[0]))
        else:
            A = D / 20.0 * (1.0 + of_level[exact.sweep] + noise[0])
            data = replace(exact, A=A, D=D + F * np.cos(np.tile(phase, levels)) * noise[1])
        posterior = SimpleNamespace(draws=x, coordinates=coordinates)
        rejected += predictive_check(posterior, data, np.ones((400, levels)), 0.9, trial).p_value < 0.05
    assert abs(rejected - 0.05 * trials) < 4.0 * np.sqrt(0.05 * trials)  # standard errors of a binomial count
