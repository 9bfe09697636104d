"""Coordinates of a law: the prior is what the module says."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import beta, kstest, lognorm, uniform

from damping.errors import InputError
from damping.forces import CATALOGUE
from damping.forces.contract import Force
from damping.forces.powers import EXPONENT
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape, Uniform
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN, Coordinates, Law
from damping.infer.observations import Observations


def without_discrepancy(law: Law, data: Observations) -> Coordinates:
    """Coordinates without a discrepancy of the exponent, which has tests of its own (test_discrepancy.py)."""
    return replace(Coordinates.of(law, data), with_discrepancy=False)


DRAWS = 20_000
#: Kolmogorov-Smirnov p-value below which a prior is called wrong: one false alarm in ten thousand runs; the seed is
#: fixed, so in fact none.
ALARM = 1e-4


def coordinates(components, saturn):
    return without_discrepancy(Law(components), saturn("config-2-mode-1"))


def prior_draws(c):
    return np.random.default_rng(1).standard_normal((DRAWS, c.dimension))


@pytest.mark.parametrize(
    "components",
    [("viscous", "coulomb"), ("viscous", "displacement", "velocity-squared"), ("viscous", "A^3", "A^4", "coulomb")],
)
def test_shares_are_uniform_over_the_simplex(components, saturn):
    c = coordinates(components, saturn)
    shares = c.shares(prior_draws(c))
    np.testing.assert_allclose(shares.sum(axis=-1), 1.0, rtol=1e-12)  # rounding of a few sums
    for share in shares.T:  # every marginal of a flat Dirichlet over k parts is Beta(1, k - 1)
        assert kstest(share, beta(1, len(components) - 1).cdf).pvalue > ALARM


def test_force_at_the_reference_is_the_total(saturn):
    c = coordinates(("viscous", "velocity-squared"), saturn)
    x = prior_draws(c)
    amplitude, omega, force = c.reference
    total = c.force(x).quadrature(amplitude, omega)[:, 0] / force
    np.testing.assert_allclose(total, np.exp(x[:, 0]), rtol=1e-12)  # rounding
    assert kstest(total, lognorm(1.0).cdf).pvalue > ALARM


def test_shapes_and_scatter_follow_their_priors(saturn):
    c = coordinates(("velocity-power",), saturn)
    values = c.parameters(prior_draws(c))
    low, high = EXPONENT.prior.range
    assert kstest(values["velocity-power exponent"], uniform(low, high - low).cdf).pvalue > ALARM
    assert kstest(values["scatter"], lognorm(SCATTER_LOG_SD, scale=SCATTER_MEDIAN).cdf).pvalue > ALARM


def test_coefficients_are_never_negative_and_named(saturn):
    c = coordinates(("viscous", "slip"), saturn)
    values = c.parameters(prior_draws(c))
    assert set(values) == {"viscous", "slip", "slip limit", "scatter"}
    assert all(np.all(value >= 0.0) for value in values.values())
    limit = values["slip limit"]
    assert np.all((limit >= 0.1 * c.tested.smallest) & (limit <= c.tested.largest))
    # ln(limit) is uniform between the two
    spread = np.log(c.tested.largest / (0.1 * c.tested.smallest))
    assert kstest(np.log(limit / (0.1 * c.tested.smallest)), uniform(0.0, spread).cdf).pvalue > ALARM


@dataclass(frozen=True)
class Braked(Force):
    """Friction that fades with velocity, a shape parameter called ``velocity`` with a prior of its own."""

    coefficient: float
    velocity: float

    name = label = formula = "braked"
    shapes = (
        Shape("coefficient", FORCE, least=0.0),
        Shape("velocity", LENGTH / TIME, above=0.0, prior=Uniform(4.0, 5.0)),
    )

    def quadrature(self, A, omega):
        return self.coefficient / (1.0 + A * omega / self.velocity)

    def grow(self, A, omega):
        slope = -self.coefficient * (A * omega / self.velocity) / (1.0 + A * omega / self.velocity) ** 2
        return self.quadrature(A, omega), slope

    def g(self, q, speed, sign):
        return sign * self.coefficient / (1.0 + speed / self.velocity)


def test_a_shape_of_any_name_has_the_prior_that_it_declares(saturn, monkeypatch):
    monkeypatch.setitem(CATALOGUE, "braked", Braked)
    c = coordinates(("viscous", "braked"), saturn)
    values = c.parameters(prior_draws(c))["braked velocity"]
    assert kstest(values, uniform(4.0, 1.0).cdf).pvalue > ALARM


def test_a_law_of_no_force_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="unknown damping force 'viscos'; expected 'viscous'"):
        Law(("viscos",))
    with pytest.raises(InputError, match=r"unknown damping force 'A\^x'"):
        Law(("viscous", "A^x"))
    assert Law(("A^3*omega^2", "A^-0.5")).parts[1].example.energy_exponents == (-0.5, 0.0)


def test_level_scatter_only_where_sweeps_have_several_rows(saturn):
    assert without_discrepancy(Law(("viscous",)), saturn("config-2-mode-1")).names == ("total", "scatter")
    assert without_discrepancy(Law(("viscous",)), saturn("config-1-mode-2-rough")).names == ("total", "scatter")
