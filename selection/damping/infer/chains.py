"""Posteriors by emcee: independent walkers that choose among several draws of a proposal close to the posterior.

At each step a walker at x weighs N draws y_1 .. y_N of the adapted proposal q, w = p/q, selects one of them, y_j, with
probability proportional to w, and moves there with probability

    min(1, sum_i w_i / (sum_i w_i - w_j + w(x)))

(independent multiple-try Metropolis: Liu, Liang and Wong 2000; one try is the independence sampler). This leaves p
invariant for any q, and moves at least as often as a choice among all N + 1 points. Steps of one walker are nearly
independent where N draws of q are worth more than one of p.

A run is extended until, by arviz and for every quantity, the effective sample size reaches 1000, the chains are 50
autocorrelation times long and R-hat between four groups of walkers is at most 1.01. If the budget of steps ends first,
``converged`` is False, and nothing uses such a result silently.
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
from damping.progress import nothing

if TYPE_CHECKING:
    from emcee.model import Model
    from emcee.state import State

#: Named functions of x (points, dimension) -> (points,) that are reported and must have converged.
Quantities = Callable[[FloatArray], Mapping[str, FloatArray]]
BURN_IN = 0.1  #: share of a run discarded at its beginning: walkers start on draws of the posterior
TAILS = (0.05, 0.95)  #: quantiles that represent the tails of a quantity
GROWTH = 1.5  #: factor by which a run that has not converged is extended before the next check
_MOST_TRIED = 16_000  #: most rows times draws that a walker weighs at a step
_FEWEST_TRIES = 4  #: fewest of these draws, however many the rows


@dataclass(frozen=True)
class Settings:
    """Sizes of a run and its convergence criteria."""

    ensembles: int = 4  #: groups of walkers
    walkers: int = 8  #: in each group
    tries: int = 16  #: draws that a walker chooses among at a step
    first: int = 80  #: steps before the first check of convergence
    budget: int = 4_000  #: most steps
    effective_size: float = 1000.0  #: criterion: at least
    lengths: float = 50.0  #: criterion: at least
    r_hat: float = 1.01  #: criterion: at most
    draws_kept: int = 400  #: of each ensemble

    def within(self, work: float, rows: int) -> Settings:
        """These sizes with fewer tries on many rows, and a budget of at most ``work`` densities of one row."""
        tries = min(self.tries, max(_MOST_TRIED // rows, _FEWEST_TRIES))
        steps = int(work / (self.ensembles * self.walkers * tries * rows))
        return replace(self, tries=tries, budget=min(self.budget, max(steps, self.first)))


@dataclass(frozen=True)
class Target:
    """A density to sample."""

    log_density: Callable[[FloatArray], FloatArray]  #: unnormalised log posterior at x (points, dimension) -> (points,)
    dimension: int  #: number of variables
    parameters: Quantities  #: named physical parameters at x, which must have converged


def load_arviz() -> Any:
    """ArviZ, imported on demand (60 MB), without its FutureWarning about the next version."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz  # noqa: PLC0415 - only posterior files and PSIS-LOO need it
    return arviz


@dataclass(frozen=True)
class Convergence:
    """Convergence of one reported quantity."""

    name: str
    mean: float
    sd: float
    r_hat: float  #: rank-normalised split R-hat between the ensembles
    effective_size: float  #: smallest of those for the bulk, the tails and the mean
    autocorrelation: float  #: integrated time in steps: draws over their effective size for the mean
    lengths: float  #: steps after burn-in over that time
    monte_carlo_error: float  #: standard error of the mean


def assess_convergence(name: str, values: FloatArray, ensembles: int) -> Convergence:
    """Diagnose a quantity.

    Args:
        values: (steps, walkers) after burn-in, walkers of one ensemble adjacent.
    """
    steps, walkers = values.shape
    by_walker = values.T
    # in order of steps, so that the halves of split R-hat are early and late
    by_ensemble = by_walker.reshape(ensembles, -1, steps).swapaxes(1, 2).reshape(ensembles, -1)
    from arviz_stats.base.array import array_stats  # noqa: PLC0415 - only chains are diagnosed

    with np.errstate(invalid="ignore", divide="ignore"):  # for a constant quantity
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
    """A finished run."""

    x: FloatArray  #: kept draws, (ensembles, kept, dimension)
    diagnoses: tuple[Convergence, ...]  #: one for each reported quantity
    failure: str  #: the criterion that is missed, empty if none
    steps: int  #: length of each ensemble
    acceptance: float  #: mean fraction

    @property
    def converged(self) -> bool:
        """Whether all criteria are met."""
        return not self.failure


@dataclass(frozen=True, kw_only=True)
class Posterior(Chains):
    """Draws of a law's posterior."""

    coordinates: Coordinates  #: the law and the meaning of ``x``
    log_z: float  #: log evidence of the law

    @property
    def draws(self) -> FloatArray:
        """All kept draws, (ensembles * kept, dimension)."""
        return self.x.reshape(-1, self.x.shape[-1])

    def parameters(self) -> dict[str, FloatArray]:
        """Physical parameters, arrays (ensembles, kept)."""
        return self.coordinates.parameters(self.x)


@dataclass(frozen=True)
class ManyTries:
    """A move of emcee: every walker chooses among ``tries`` draws of the proposal (see the module)."""

    #: ln w at x (points, dimension) -> (points,), which emcee gets instead of ln p
    weigh: Callable[[FloatArray], FloatArray]
    proposal: Proposal
    tries: int

    def propose(self, model: Model, state: State) -> tuple[State, FloatArray]:
        """The state after one step, and whether each walker moved (walkers,)."""
        walkers = len(state.coords)
        tried = self.proposal.draw_random(walkers * self.tries, model.random)
        log_w, here = self.weigh(tried).reshape(walkers, -1), state.log_prob
        top = np.maximum(log_w.max(axis=1), here)
        w, w_here = np.exp(log_w - top[:, None]), np.exp(here - top)
        total = w.sum(axis=1)
        every = np.arange(walkers)
        # the largest of ln w + Gumbel noise has probability proportional to w
        chosen = np.argmax(log_w + model.random.gumbel(size=log_w.shape), axis=1)
        moved = model.random.random_sample(walkers) * (total - w[every, chosen] + w_here) < total
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
    """Sample a damping law, once more from a proposal fitted to the chains if these have not converged.

    Few draws of the evidence may have reached a part of the posterior, such as stiff joints that slip early; chains
    have. Other arguments as in ``run``.

    Args:
        quantities: further quantities that must have converged, besides the law's parameters.
    """
    posterior = Balanced.of(coordinates, data)

    def inform(z: FloatArray) -> Mapping[str, FloatArray]:
        x = posterior.find_points(z)
        return {**coordinates.parameters(x), **quantities(x)}

    target = Target(posterior.log_density, coordinates.dimension, inform)
    begin = replace(start, draws=posterior.find_variables(start.draws))
    chains = run(target, begin, seed, settings)
    if not chains.converged:  # walkers rest where the proposal is too thin: fitted to them, it is not
        worth = min((d.effective_size for d in chains.diagnoses if np.isfinite(d.effective_size)), default=1.0)
        walked = replace(begin, draws=chains.x.reshape(-1, coordinates.dimension), effective_draws=worth)
        chains = run(target, walked, seed, settings)
    x = posterior.find_points(chains.x.reshape(-1, coordinates.dimension)).reshape(chains.x.shape)
    return Posterior(coordinates=coordinates, log_z=start.log_z, **vars(replace(chains, x=x)))


def run(
    target: Target,
    start: Evidence,
    seed: int,
    settings: Settings | None = None,
    done: Callable[[str], None] = nothing,
) -> Chains:
    """Run the walkers. The result depends on the arguments only: on one machine a seed gives the same digits.

    Args:
        start: draws of the density, from which the walkers start and to which the proposal is fitted.
        seed: of the moves and of the choice of starting points.
        done: reports each weighing of points, one for each step.
    """
    import emcee  # noqa: PLC0415 - bands of importance draws need no chains

    settings = settings or Settings()
    walkers = settings.ensembles * settings.walkers
    # emcee copies numpy's global random state unless given one
    random = np.random.RandomState(np.random.SeedSequence(seed).generate_state(4))
    chosen = random.choice(len(start.draws), walkers, replace=False)
    state = emcee.State(start.draws[chosen], random_state=random.get_state())

    proposal = start.proposal  # a property that fits at each access

    def weigh(x: FloatArray) -> FloatArray:
        done("step")
        return target.log_density(x) - proposal.log_density(x)

    move = ManyTries(weigh, proposal, settings.tries)
    sampler = emcee.EnsembleSampler(walkers, target.dimension, weigh, vectorize=True, moves=move)
    steps = min(settings.first, settings.budget)
    while True:
        # walkers are independent, so equal ones do no harm
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
    """The first criterion that is missed, in words; empty when all are met.

    A quantity that is the same at every draw, such as a parameter that is held, has nothing to converge.
    """
    for d in (d for d in diagnoses if not (np.isnan(d.effective_size) and np.isfinite(d.mean))):
        if not d.r_hat <= settings.r_hat:
            return f"{d.name}: R-hat {d.r_hat:.4f} above {settings.r_hat}"
        if not d.effective_size >= settings.effective_size:
            return f"{d.name}: effective sample size {d.effective_size:.0f} below {settings.effective_size:.0f}"
        if not d.lengths >= settings.lengths:
            return f"{d.name}: chain of {d.lengths:.0f} autocorrelation times, {settings.lengths:.0f} wanted"
    return ""
