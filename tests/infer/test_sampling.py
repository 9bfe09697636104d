"""Chains: reproducible, honest about failure, and right."""

import numpy as np
import pandas as pd
import pytest

from damping.arrays import STANDARD_GRAVITY_M_S2
from damping.infer.chains import Settings, assess_convergence, sample
from damping.infer.evidence import evidence
from damping.infer.law import Coordinates, Law
from damping.infer.observations import observe
from damping.records.record import Record

pytestmark = pytest.mark.sampling


@pytest.fixture(scope="module")
def problem(saturn):
    data = saturn("config-2-mode-1")
    c = Coordinates.of(Law(("viscous", "displacement-velocity")), data)
    return c, data, evidence(c, data)


def nothing(x):
    return {}


def test_seed_reproduces_whatever_the_global_state(problem):
    c, data, start = problem
    np.random.seed(1)  # noqa: NPY002 - the point of the test: emcee copies this state unless told otherwise
    first = sample(c, data, start, nothing, seed=5, settings=Settings(budget=80))
    np.random.seed(2)  # noqa: NPY002 - as above
    second = sample(c, data, start, nothing, seed=5, settings=Settings(budget=80))
    np.testing.assert_array_equal(first.x, second.x)
    assert not np.array_equal(first.x, sample(c, data, start, nothing, seed=6, settings=Settings(budget=80)).x)


def test_converged_chain_agrees_with_importance_sampling(problem):
    c, data, start = problem
    posterior = sample(c, data, start, nothing, seed=1)
    assert posterior.converged, posterior.failure
    for d in posterior.diagnoses:
        assert d.r_hat <= 1.01
        assert d.effective_size >= 1000
        assert d.lengths >= 50
        independent = c.parameters(start.draws)[d.name]
        error = np.hypot(d.monte_carlo_error, independent.std() / np.sqrt(start.effective_draws))
        assert abs(d.mean - independent.mean()) < 5.0 * error  # two independent estimates, five standard errors


def test_wrong_target_is_noticed(problem, saturn):
    """The comparison above has teeth: the posterior of another record does not pass it."""
    c, data, start = problem
    posterior = sample(c, data, start, nothing, seed=1)
    other = saturn("config-2-mode-2")
    c2 = Coordinates.of(c.law, other)
    wrong = c2.parameters(evidence(c2, other).draws)["viscous"]
    d = posterior.diagnoses[0]
    assert abs(d.mean - wrong.mean()) > 5.0 * np.hypot(d.monte_carlo_error, wrong.std() / np.sqrt(1000))


def test_a_chain_that_does_not_get_there_is_failed(problem):
    c, data, start = problem
    posterior = sample(c, data, start, nothing, seed=1, settings=Settings(budget=50))
    assert not posterior.converged
    assert posterior.failure
    assert posterior.steps == 50


@pytest.mark.slow
def test_a_proposal_that_is_too_thin_somewhere_is_fitted_to_the_chains():
    """On the first tutorial's record few draws of the evidence have a stiff joint that slips early; walkers rest there.

    At seed 1970 the effective sample size was 380 after all 4000 steps. The means are those of importance sampling.
    """
    frequency = np.array([25.0, 25.01, 24.99, 25.0, 25.01])
    amplitude = np.array([0.527, 0.933, 1.268, 1.699, 2.145]) * STANDARD_GRAVITY_M_S2 / (2.0 * np.pi * frequency) ** 2
    columns = {"sweep": [*"abcde"], "force": [4.0, 8.0, 12.0, 18.0, 25.0], "frequency": frequency}
    data = observe(Record(pd.DataFrame(columns).assign(amplitude=amplitude)))
    c = Coordinates.of(Law(("viscous", "velocity-squared", "slip")), data)
    posterior = sample(c, data, evidence(c, data, 1970), nothing, seed=1970, settings=Settings(budget=1000))
    assert posterior.converged, posterior.failure
    independent = evidence(c, data, seed=7, wanted=5000.0)
    values = c.parameters(independent.draws)
    for d in posterior.diagnoses:
        error = np.hypot(d.monte_carlo_error, values[d.name].std() / np.sqrt(independent.effective_draws))
        assert abs(d.mean - values[d.name].mean()) < 5.0 * error  # as above


def test_a_quantity_that_never_moves_has_not_converged():
    still = assess_convergence("still", np.ones((100, 8)), ensembles=4)
    assert not still.r_hat <= 1.01
    assert not still.effective_size >= 1000.0


def test_a_quantity_that_is_held_does_not_prolong_a_run(problem):
    """The mode's frequency beside a user's simulator is the same at every draw: runs took all their budget."""
    c, data, start = problem
    held = sample(c, data, start, lambda x: {"held": np.full(len(x), 0.1)}, seed=1)
    assert (held.failure, held.steps) == ("", sample(c, data, start, nothing, seed=1).steps)
    assert sample(c, data, start, lambda x: {"lost": np.full(len(x), np.nan)}, 1, Settings(budget=80)).failure


@pytest.mark.parametrize("rows", [60, 1000, 5000])
def test_work_of_a_run_is_bounded_on_any_number_of_rows(rows):
    own = Settings().within(6e7, rows)
    assert (own.tries == Settings().tries) == (rows <= 1000)  # ordinary records as ever
    assert own.budget * own.tries * own.walkers * own.ensembles * rows <= 6e7
