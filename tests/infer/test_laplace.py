"""The Laplace approximation beside importance sampling and the mode that quasi-Newton descents find."""

from dataclasses import replace

import numpy as np
import pytest

from damping.infer.evidence import evidence, find_mode, laplace
from damping.infer.law import Coordinates, Law, log_posterior
from damping.infer.observations import Observations
from damping_validation.calibration import simulated_levels, structures


def undoubted(law: Law, data: Observations) -> Coordinates:
    """Coordinates without a straying exponent, which has tests of its own (test_doubt.py)."""
    return replace(Coordinates.of(law, data), with_doubt=False)


SMOOTH = [
    Law(("viscous",)),
    Law(("velocity-squared",)),
    Law(("velocity-power",)),
    Law(("viscous", "velocity-squared")),
    Law(("viscous", "coulomb")),
]


def levels(seed: int = 3, number: int = 5):
    structure = next(s for s in structures() if s.name == "viscous + velocity-squared")
    return simulated_levels(structure, number, 4.0, 0.02, np.random.default_rng(seed))


@pytest.mark.parametrize("law", SMOOTH, ids=lambda law: law.name)
def test_marginal_likelihood_is_near_that_of_importance_sampling(law):
    """Second-order terms of a posterior from five points are of order 1/5 in ln Z; twice that is granted."""
    data = levels()
    coordinates = undoubted(law, data)
    found, reference = laplace(coordinates, data), evidence(coordinates, data)
    assert found.log_z == pytest.approx(reference.log_z, rel=0.0, abs=0.5)
    assert np.isnan(found.standard_error)


@pytest.mark.parametrize("law", SMOOTH, ids=lambda law: law.name)
def test_mode_is_that_of_the_descents(law):
    """Both stop where a Newton step gains less than 1e-6 in log density."""
    data = levels()
    coordinates = undoubted(law, data)
    own, other = laplace(coordinates, data).mode, find_mode(coordinates, data)
    density = log_posterior(np.vstack([own, other]), coordinates, data)
    assert density[0] >= density[1] - 1e-6


def test_many_levels_leave_the_shift_of_the_scatter_alone():
    """With n = 40 levels and k = 2 coefficients all is normal but ln(scatter).

    Its joint mode is ln sqrt(S/n), its mean ln sqrt(S/(n - k)) + 1/(2n): (k + 1)/(2n) more, in standard deviations
    1/sqrt(2n) that is (k + 1)/sqrt(2n). Terms of the next order are 1/n of that and the prior's pull is smaller still.
    """
    data = levels(number=40)
    coordinates = undoubted(Law(("viscous", "velocity-squared")), data)
    found, reference = laplace(coordinates, data), evidence(coordinates, data)
    sd = reference.draws.std(axis=0)
    shift = (reference.draws.mean(axis=0) - found.draws.mean(axis=0)) / sd
    # 1/sqrt(n) = 0.16: skewness of the shares, which are no linear functions of x
    np.testing.assert_allclose(shift, [0.0, 0.0, 3.0 / np.sqrt(80.0)], rtol=0.0, atol=0.16)
    np.testing.assert_allclose(found.draws.std(axis=0), sd, rtol=0.16)


def test_the_same_seed_gives_the_same_draws():
    data = levels()
    coordinates = undoubted(SMOOTH[3], data)
    one, same, other = (laplace(coordinates, data, seed) for seed in (1, 1, 2))
    assert np.array_equal(one.draws, same.draws)
    assert not np.array_equal(one.draws, other.draws)
