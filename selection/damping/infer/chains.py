"""Posteriors by emcee: independent walkers that choose among several draws of a proposal close to the posterior.

At each step every walker at x weighs N draws y_1 .. y_N of the adapted proposal q, w = p/q, takes one of them, y_j, in
proportion to w and goes there with the probability

    min(1, sum_i w_i / (sum_i w_i - w_j + w(x)))

(independent multiple-try Metropolis: Liu, Liang and Wong 2000; one try is the independence sampler). That leaves p as
it is whatever q, and moves at least as often as a choice among all N + 1 points; steps of one walker are nearly
independent where N draws of q are worth more than one of p.

A run grows until, by arviz and for every quantity, the effective sample size reaches 1000, the chains are 50
autocorrelation times long and R-hat between four groups of walkers is at most 1.01, or until the budget of steps is
spent; then the result says so (``converged`` is False) and nothing uses it silently.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damping.arrays import FloatArray
from damping.infer.balanced import Balanced
from damping.infer.importance import Evidence
from damping.infer.law import Coordinates
from damping.infer.observations import Observations
from damping.infer.proposal import Proposal

if TYPE_CHECKING:
    from emcee.model import Model
    from emcee.state import State

#: Named functions of x (points, dimension) -> (points,): what the reader is told, so what must have converged.
Quantities = Callable[[FloatArray], Mapping[str, FloatArray]]
#: Share of a run that is left out at its beginning: walkers start on draws of the posterior, so little is needed.
BURN_IN = 0.1
#: Quantiles that stand for the tails of a quantity.
TAILS = (0.05, 0.95)
#: A run that has not said enough is made longer by this factor before the next look.
GROWTH = 1.5


@dataclass(frozen=True)
class Settings:
    """Sizes of a run and what it must reach.

    Attributes:
        ensembles, walkers: groups of walkers, and walkers in each. tries: draws that a walker chooses among at a step.
        first, budget: steps before the first look at convergence, and at most.
        effective_size, lengths, r_hat: the criteria (at least, at least, at most).
        draws_kept: draws kept of each ensemble.
    """

    ensembles: int = 4
    walkers: int = 8
    tries: int = 16
    first: int = 80
    budget: int = 4_000
    effective_size: float = 1000.0
    lengths: float = 50.0
    r_hat: float = 1.01
    draws_kept: int = 400


@dataclass(frozen=True)
class Target:
    """What is sampled.

    Attributes:
        log_density: unnormalised log posterior at x (points, dimension) -> (points,).
        dimension: number of variables. parameters: named physical parameters at x, which must have converged.
    """

    log_density: Callable[[FloatArray], FloatArray]
    dimension: int
    parameters: Quantities


def load_arviz() -> Any:
    """ArviZ, loaded when asked for (60 MB), without the announcement of its next version at every import."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz  # noqa: PLC0415 - 60 MB that only files of posteriors and leaving out need
    return arviz


@dataclass(frozen=True)
class Convergence:
    """Convergence of one reported quantity.

    Attributes:
        r_hat: rank-normalised split R-hat between the ensembles.
        effective_size: the least of the sizes for the bulk, the tails and the mean.
        autocorrelation: integrated autocorrelation time in steps: draws over their effective size for the mean.
        lengths: steps after burn-in over that time. monte_carlo_error: standard error of the mean.
    """

    name: str
    mean: float
    sd: float
    r_hat: float
    effective_size: float
    autocorrelation: float
    lengths: float
    monte_carlo_error: float


def assess_convergence(name: str, values: FloatArray, ensembles: int) -> Convergence:
    """Diagnose a quantity.

    Args:
        values: (steps, walkers) after burn-in, walkers of one ensemble beside each other.
    """
    steps, walkers = values.shape
    by_walker = values.T
    # in order of steps, so that the halves of split R-hat are early and late
    by_ensemble = by_walker.reshape(ensembles, -1, steps).swapaxes(1, 2).reshape(ensembles, -1)
    from arviz_stats.base.array import array_stats  # noqa: PLC0415 - only chains are diagnosed

    with np.errstate(invalid="ignore", divide="ignore"):  # of a quantity that stays where it is
        sizes = {method: float(array_stats.ess(by_walker, method=method)) for method in ("mean", "bulk")}
        sizes["tail"] = float(array_stats.ess(by_walker, method="tail", prob=TAILS))
        r_hat = float(array_stats.rhat(by_ensemble))
    moves = bool(np.ptp(values) > 0.0)
    size = min(sizes.values()) if moves else np.nan
    sd = float(values.std())
    tau = max(steps * walkers / sizes["mean"], 1.0) if moves else np.nan
    return Convergence(
        name=name,
        mean=float(values.mean()),
        sd=sd,
        r_hat=r_hat,
        effective_size=size,
        autocorrelation=tau,
        lengths=steps / tau,
        monte_carlo_error=sd / float(np.sqrt(size)),
    )


@dataclass(frozen=True, kw_only=True)
class Chains:
    """A finished run.

    Attributes:
        x: kept draws, (ensembles, kept, dimension). diagnoses: one for each reported quantity. failure: why not
        all criteria are met, empty when they are. steps, acceptance: length of each ensemble, mean acceptance fraction.
    """

    x: FloatArray
    diagnoses: tuple[Convergence, ...]
    failure: str
    steps: int
    acceptance: float

    @property
    def converged(self) -> bool:
        """Whether all criteria are met."""
        return not self.failure


@dataclass(frozen=True, kw_only=True)
class Posterior(Chains):
    """Draws of a law's posterior; ``coordinates``: the law and the meaning of ``x``, ``log_z``: its log evidence."""

    coordinates: Coordinates
    log_z: float

    @property
    def draws(self) -> FloatArray:
        """All kept draws, (ensembles * kept, dimension)."""
        return self.x.reshape(-1, self.x.shape[-1])

    def parameters(self) -> dict[str, FloatArray]:
        """Physical parameters, arrays (ensembles, kept)."""
        return self.coordinates.parameters(self.x)


@dataclass(frozen=True)
class ManyTries:
    """A move of emcee: every walker chooses among ``tries`` draws of the proposal (see the module).

    ``weigh``: ln w at x (points, dimension) -> (points,), which emcee is told instead of ln p.
    """

    weigh: Callable[[FloatArray], FloatArray]
    proposal: Proposal
    tries: int

    def propose(self, model: Model, state: State) -> tuple[State, FloatArray]:
        """The state after one step, and which walkers moved (walkers,)."""
        walkers = len(state.coords)
        tried = self.proposal.draw_random(walkers * self.tries, model.random)
        log_w, here = self.weigh(tried).reshape(walkers, -1), state.log_prob
        top = np.maximum(log_w.max(axis=1), here)
        w, own = np.exp(log_w - top[:, None]), np.exp(here - top)
        total = w.sum(axis=1)
        every = np.arange(walkers)
        # the largest of ln w + Gumbel noise is one in proportion to w
        chosen = np.argmax(log_w + model.random.gumbel(size=log_w.shape), axis=1)
        moved = model.random.random_sample(walkers) * (total - w[every, chosen] + own) < total
        state.coords[moved] = tried[(every * self.tries + chosen)[moved]]
        state.log_prob[moved] = log_w[every, chosen][moved]
        return state, moved


def sample(
    coordinates: Coordinates,
    data: Observations,
    start: Evidence,
    quantities: Quantities,
    seed: int,
    settings: Settings | None = None,
) -> Posterior:
    """Sample a damping law. Arguments as in ``run``.

    Args:
        start: draws of the posterior, on which the walkers begin and which the proposal is fitted to.
        quantities: what must have converged beside the law's parameters.
    """
    posterior = Balanced(coordinates.scaled(data.reference), data.scaled())

    def inform(z: FloatArray) -> Mapping[str, FloatArray]:
        x = posterior.find_points(z)
        return {**coordinates.parameters(x), **quantities(x)}

    target = Target(posterior.log_density, coordinates.dimension, inform)
    begin = replace(start, draws=posterior.find_variables(start.draws))
    chains = run(target, begin, seed, settings)
    x = posterior.find_points(chains.x.reshape(-1, coordinates.dimension)).reshape(chains.x.shape)
    return Posterior(coordinates=coordinates, log_z=start.log_z, **vars(replace(chains, x=x)))


def run(target: Target, start: Evidence, seed: int, settings: Settings | None = None) -> Chains:
    """Run the walkers. The result depends on the arguments only: on one machine a seed gives the same digits.

    Args:
        start: draws of the density, on which the walkers begin and which the proposal is fitted to.
        seed: of the moves and of the choice of starting points.
    """
    import emcee  # noqa: PLC0415 - bands of importance draws need no chains

    settings = settings or Settings()
    walkers = settings.ensembles * settings.walkers
    # emcee copies numpy's global random state unless it is given one: give it one
    random = np.random.RandomState(np.random.SeedSequence(seed).generate_state(4))
    chosen = random.choice(len(start.draws), walkers, replace=False)
    state = emcee.State(start.draws[chosen], random_state=random.get_state())

    proposal = start.proposal  # fitted anew each time that it is asked for

    def weigh(x: FloatArray) -> FloatArray:
        return target.log_density(x) - proposal.log_density(x)

    move = ManyTries(weigh, proposal, settings.tries)
    sampler = emcee.EnsembleSampler(walkers, target.dimension, weigh, vectorize=True, moves=move)
    steps = min(settings.first, settings.budget)
    while True:
        # walkers do not depend on each other, so that equal ones do no harm
        state = sampler.run_mcmc(state, steps - sampler.iteration, skip_initial_state_check=True)
        x = sampler.get_chain(discard=int(BURN_IN * steps))
        flat = x.reshape(-1, target.dimension)
        diagnoses = tuple(
            assess_convergence(name, value.reshape(x.shape[:-1]), settings.ensembles)
            for name, value in target.parameters(flat).items()
        )
        failure = _describe_failure(diagnoses, settings)
        if not failure or steps == settings.budget:
            break
        steps = min(int(GROWTH * steps), settings.budget)
    parts = x.reshape(len(x), settings.ensembles, -1, target.dimension).swapaxes(0, 1)
    parts = parts.reshape(settings.ensembles, -1, target.dimension)
    kept = parts[:, np.linspace(0, parts.shape[1] - 1, settings.draws_kept).astype(int)]
    acceptance = float(np.mean(sampler.acceptance_fraction))
    return Chains(x=kept, diagnoses=diagnoses, failure=failure, steps=steps, acceptance=acceptance)


def _describe_failure(diagnoses: tuple[Convergence, ...], settings: Settings) -> str:
    """The first criterion that is missed, in words; empty when all are met."""
    for d in diagnoses:
        if not d.r_hat <= settings.r_hat:
            return f"{d.name}: R-hat {d.r_hat:.4f} above {settings.r_hat}"
        if not d.effective_size >= settings.effective_size:
            return f"{d.name}: effective sample size {d.effective_size:.0f} below {settings.effective_size:.0f}"
        if not d.lengths >= settings.lengths:
            return f"{d.name}: chain of {d.lengths:.0f} autocorrelation times, {settings.lengths:.0f} wanted"
    return ""
