"""Posteriors by emcee: four independent ensembles, run until every reported quantity is known.

A run grows in blocks until, for every quantity, the effective sample size reaches 1000, the chains are 50
autocorrelation times long and R-hat between the ensembles is at most 1.01, or until the budget of steps is spent; then
the result says so (``converged`` is False) and nothing uses it silently.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from damping.arrays import FloatArray
from damping.infer.diagnostics import Convergence, assess_convergence
from damping.infer.evidence import Evidence
from damping.infer.importance import Proposal
from damping.infer.law import Coordinates
from damping.infer.likelihood import log_posterior
from damping.infer.observations import Observations

if TYPE_CHECKING:
    import emcee

#: Named functions of x (points, dimension) -> (points,): what the reader is told, so what must have converged.
Quantities = Callable[[FloatArray], Mapping[str, FloatArray]]


@dataclass(frozen=True)
class Settings:
    """Sizes of a run and what it must reach.

    Attributes:
        ensembles, walkers: independent ensembles and walkers in each. block: steps between looks at convergence.
        budget: most steps of an ensemble: minutes, where most laws take seconds.
        effective_size, lengths, r_hat: the criteria (at least, at least, at most).
        kept: draws kept of each ensemble.
    """

    ensembles: int = 4
    walkers: int = 32
    block: int = 250
    budget: int = 5_000
    effective_size: float = 1000.0
    lengths: float = 50.0
    r_hat: float = 1.01
    kept: int = 400


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


@dataclass(frozen=True)
class ChainStart:
    """What is known of the posterior before: ``draws`` (n, dimension), n >= walkers, and a ``proposal`` close to it."""

    draws: FloatArray
    proposal: Proposal


@dataclass(frozen=True)
class Chains:
    """A finished run: the fields of ``Posterior`` that say nothing of a law."""

    x: FloatArray
    diagnoses: tuple[Convergence, ...]
    converged: bool
    failure: str
    steps: int
    acceptance: float


@dataclass(frozen=True)
class Posterior:
    """Draws of a law's posterior.

    Attributes:
        coordinates: the law and the meaning of ``x``. x: kept draws, (ensembles, kept, dimension).
        log_z: log marginal likelihood. diagnoses: one for each reported quantity. converged: all criteria met.
        failure: why not, empty when converged. steps, acceptance: length of each ensemble, mean acceptance fraction.
    """

    coordinates: Coordinates
    x: FloatArray
    log_z: float
    diagnoses: tuple[Convergence, ...]
    converged: bool
    failure: str
    steps: int
    acceptance: float

    @property
    def draws(self) -> FloatArray:
        """All kept draws, (ensembles * kept, dimension)."""
        return self.x.reshape(-1, self.x.shape[-1])

    def parameters(self) -> dict[str, FloatArray]:
        """Physical parameters, arrays (ensembles, kept)."""
        return self.coordinates.parameters(self.x)


@dataclass
class Checkpoint:
    """Where a run's chains are kept between blocks; the default keeps nothing.

    ``load(ensemble)`` gives an emcee backend with the steps done so far, or None; ``save(ensemble, backend)`` keeps it.
    """

    load: Callable[[int], Any] = field(default=lambda ensemble: None)
    save: Callable[[int, Any], None] = field(default=lambda ensemble, backend: None)


def sample(
    coordinates: Coordinates,
    data: Observations,
    start: Evidence,
    quantities: Quantities,
    seed: int,
    settings: Settings | None = None,
    checkpoint: Checkpoint | None = None,
) -> Posterior:
    """Run the ensembles on a damping law. Arguments as in ``run``.

    Args:
        start: weighted draws near the posterior; the walkers begin on them.
        quantities: what must have converged beside the law's parameters.
    """
    density = partial(log_posterior, coordinates=coordinates, data=data)
    target = Target(density, coordinates.dimension, coordinates.parameters)
    chains = run(target, ChainStart(start.draws, start.proposal), quantities, seed, settings, checkpoint)
    return Posterior(coordinates, log_z=start.log_z, **vars(chains))


def run(
    target: Target,
    start: ChainStart,
    quantities: Quantities,
    seed: int,
    settings: Settings | None = None,
    checkpoint: Checkpoint | None = None,
) -> Chains:
    """Run the ensembles. The result depends on the arguments only: on one machine a seed gives the same digits.

    Args:
        quantities: what must have converged beside the parameters themselves.
        seed: of the moves and of the choice of starting points.
    """
    settings, checkpoint = settings or Settings(), checkpoint or Checkpoint()
    samplers = [_sampler(target, start, seed, k, settings, checkpoint) for k in range(settings.ensembles)]
    steps = 0
    while True:
        steps = min(steps + settings.block, settings.budget)
        for k, (sampler, state) in enumerate(samplers):
            todo = steps - sampler.backend.iteration
            if todo > 0:
                sampler.run_mcmc(state if sampler.backend.iteration == 0 else sampler.get_last_sample(), todo)
                checkpoint.save(k, sampler.backend)
        chains = [sampler.get_chain()[:steps] for sampler, _ in samplers]  # views: all steps are held once
        diagnoses, burn = _diagnose(chains, target, quantities)
        failure = _describe_failure(diagnoses, settings)
        if not failure or steps == settings.budget:
            break
    acceptance = float(np.mean([sampler.acceptance_fraction for sampler, _ in samplers]))
    x = np.stack([_keep(chain[burn:], settings.kept) for chain in chains])
    return Chains(x, diagnoses, not failure, failure, steps, acceptance)


def _sampler(
    target: Target, start: ChainStart, seed: int, ensemble: int, settings: Settings, checkpoint: Checkpoint
) -> tuple[emcee.EnsembleSampler, emcee.State]:
    """One ensemble, fresh or as its checkpoint left it, and the state to start from."""
    import emcee  # noqa: PLC0415 - bands of importance draws need no chains

    # emcee copies numpy's global random state unless it is given one: give it one
    random = np.random.RandomState(np.random.SeedSequence([seed, ensemble]).generate_state(4))
    # independent proposals make long jumps, the ensemble's own moves explore what they miss
    moves = [(emcee.moves.MHMove(start.proposal), 0.6), (emcee.moves.DEMove(), 0.3), (emcee.moves.StretchMove(), 0.1)]
    shape = (settings.walkers, target.dimension)
    done = checkpoint.load(ensemble)
    if done is not None and done.shape != shape:  # of another run: begin again
        done = None
    sampler = emcee.EnsembleSampler(*shape, target.log_density, vectorize=True, moves=moves, backend=done)
    chosen = random.choice(len(start.draws), settings.walkers, replace=False)
    # resampled draws repeat; a small spread keeps the walkers apart and is forgotten in the burn-in
    coords = start.draws[chosen] + 1e-3 * random.standard_normal(shape)
    return sampler, emcee.State(coords, random_state=random.get_state())


def _diagnose(
    chains: Sequence[FloatArray], target: Target, quantities: Quantities
) -> tuple[tuple[Convergence, ...], int]:
    """Diagnose every quantity on chains (steps, walkers, dimension), one an ensemble; also the burn-in in steps."""
    burn = len(chains[0]) // 5
    thin = max(1, len(chains[0]) // 1000)
    x = np.stack([chain[burn::thin] for chain in chains])
    flat = x.reshape(-1, x.shape[-1])
    values = {**target.parameters(flat), **quantities(flat)}
    return tuple(assess_convergence(name, value.reshape(x.shape[:-1]), thin) for name, value in values.items()), burn


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


def _keep(chain: FloatArray, kept: int) -> FloatArray:
    """Evenly spaced draws of an ensemble, (kept, dimension)."""
    flat = chain.reshape(-1, chain.shape[-1])
    return np.asarray(flat[np.linspace(0, len(flat) - 1, kept).astype(int)])
