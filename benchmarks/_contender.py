"""One sampler of the two-term posterior, in a process of its own: ``python -m benchmarks._contender NAME NUMBER``.

The model: resonances of Configuration II, first mode, by viscous + displacement-velocity damping. With x ~ N(0, 1)^3,

    total  T = F exp(x1),    share  s = Phi(x2),    scatter  S = .011 exp(.8 x3),
    C_i = T (s A_i omega_i/(A omega) + (1 - s) A_i^2 omega_i/(A^2 omega)),     (F_i - C_i)/g_i ~ N(0, S^2),

g = dC/d ln A min(1, F/C), and F, A, omega without index the geometric means: the prior and the likelihood of
``damping.infer``, written here in plain Python, for PyMC and nutpie, and for NumPyro. Ours draw until they
are worth NUMBER, and once more in the same process; the others twice NUMBER draws a chain. Each tells how many
effective draws it gives in a second once it has started.
Effective size: the least bulk one (arviz) of x1, x2, x3; importance draws are worth (sum w)^2/sum w^2.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from statistics import geometric_mean
from time import process_time
from typing import Any

import numpy as np

#: Table 4.II: force (lb), frequency (Hz), amplitude (in).
FORCE = [19.37, 24.95, 28.98]
HZ = [1.66882, 1.66577, 1.66401]
AMPLITUDE = [1.229, 1.439, 1.567]
OMEGA = [2.0 * math.pi * f for f in HZ]
CHAINS = 4
SEED = 1970


REFERENCE = tuple(map(geometric_mean, (FORCE, OMEGA, AMPLITUDE)))
#: Both terms at each resonance over their value at the reference.
VISCOUS = [a * w / (REFERENCE[2] * REFERENCE[1]) for a, w in zip(AMPLITUDE, OMEGA, strict=True)]
CASE_IV = [a * a * w / (REFERENCE[2] ** 2 * REFERENCE[1]) for a, w in zip(AMPLITUDE, OMEGA, strict=True)]


def plain(x: Any) -> float:
    """Log posterior density at one point, up to a constant: arithmetic alone, which for three rows beats arrays."""
    x1, x2, x3 = x
    share = 0.5 * math.erfc(-x2 / math.sqrt(2.0))
    scatter = 0.011 * math.exp(0.8 * x3)
    total, value = REFERENCE[0] * math.exp(x1), -0.5 * (x1 * x1 + x2 * x2 + x3 * x3)
    for F, viscous, case_iv in zip(FORCE, VISCOUS, CASE_IV, strict=True):
        linear, square = total * share * viscous, total * (1.0 - share) * case_iv
        C = linear + square
        n = (F - C) / ((linear + 2.0 * square) * min(1.0, F / C))
        value -= 0.5 * (n / scatter) ** 2 + math.log(scatter)
    result: float = value
    return result


@dataclass(frozen=True)
class Sampled:
    """Draws x (n, 3) worth ``size`` independent ones. ``rate``: effective draws for a second of processor after
    start-up. ``beside``: seconds that went into measuring the rate alone."""

    x: np.ndarray
    size: float
    how: str
    rate: float
    beside: float = 0.0


def effective(x: np.ndarray) -> float:
    """Least bulk effective size of x (chains, draws, 3)."""
    import arviz  # noqa: PLC0415 - start-up is part of what is measured, so each process imports what it needs

    return min(float(arviz.ess(x[..., i])) for i in range(3))


def in_part(x: np.ndarray, used: float, how: str) -> Sampled:
    """Chains (chains, draws, 3), of which the second half took ``used`` seconds of processor."""
    size = effective(x)
    return Sampled(x.reshape(-1, 3), size, f"{how}, {x.shape[0]} x {x.shape[1]} draws", 0.5 * size / used)


def draw_twice(draw: Callable[[], tuple[np.ndarray, float, str]]) -> Sampled:
    """All draws that are wanted, as ``draw`` gives them: x, their worth and how; the rate is that of a second time."""
    draw()
    start = process_time()
    x, size, how = draw()
    again = process_time() - start
    return Sampled(x, size, how, size / again, again)


def ours(wanted: int) -> tuple[np.ndarray, float, str]:
    """Importance draws of the library: the proposal adapted on 8192 draws, then as many as are wanted."""
    from damping.infer.balanced import Balanced  # noqa: PLC0415 - as above
    from damping.infer.evidence import evidence  # noqa: PLC0415 - as above
    from damping.infer.importance import draw_again  # noqa: PLC0415 - as above

    coordinates, data = target()
    start = evidence(coordinates, data, SEED)
    posterior = Balanced(coordinates, data)
    begin = replace(start, draws=posterior.find_variables(start.draws))
    found, number = start, int(1.1 * wanted * len(start.draws) / start.effective_draws)
    while found.effective_draws < wanted:
        found = draw_again(posterior.log_density, begin.proposal, number, SEED)
        number = int(1.1 * wanted * number / found.effective_draws)
    return posterior.find_points(found.draws), found.effective_draws, f"{len(found.draws)} importance draws"


def chains(wanted: int) -> tuple[np.ndarray, float, str]:
    """Chains of the library, run to its own criteria: many walkers moved all at once."""
    from damping.infer.chains import Settings, sample  # noqa: PLC0415 - as above
    from damping.infer.evidence import evidence  # noqa: PLC0415 - as above

    coordinates, data = target()
    start = evidence(coordinates, data, SEED)
    settings = Settings(walkers=256, tries=4, first=82, effective_size=wanted, draws_kept=5000)
    found = sample(coordinates, data, start, lambda x: {}, SEED, settings)
    size = min(d.effective_size for d in found.diagnoses)
    return found.draws, size, f"{4 * settings.walkers} walkers, {found.steps} steps, {settings.tries} tries each"


def target() -> Any:
    """Coordinates and observations of the library."""
    from damping.infer.law import Coordinates, Law  # noqa: PLC0415 - as above
    from damping.infer.observations import Observations  # noqa: PLC0415 - as above

    F, omega, A = map(np.array, (FORCE, OMEGA, AMPLITUDE))
    zero, number = np.zeros(len(F)), np.arange(len(F))
    data = Observations(omega, number, ("A", "B", "C"), zero, zero, zero, A, F, zero, F, A, omega)
    return replace(Coordinates.of(Law(("viscous", "displacement-velocity")), data), with_discrepancy=False), data


def emcee(part: int) -> Sampled:
    """Plain emcee: 32 walkers, its own default move, one point at a time."""
    import emcee  # noqa: PLC0415 - as above

    sampler = emcee.EnsembleSampler(32, 3, plain)
    rng = np.random.default_rng(SEED)
    state = sampler.run_mcmc(rng.standard_normal((32, 3)) * [0.1, 1.0, 1.0], 300)
    sampler.reset()
    state = sampler.run_mcmc(state, part)
    start = process_time()
    sampler.run_mcmc(state, part)
    return in_part(np.moveaxis(sampler.get_chain(), 1, 0), process_time() - start, "32 walkers")


def describe_in_pymc() -> Any:
    """The model of PyMC, which nutpie compiles too."""
    import pymc as pm  # noqa: PLC0415 - as above
    import pytensor.tensor as pt  # noqa: PLC0415 - as above

    with pm.Model() as model:
        x = pm.Normal("x", 0.0, 1.0, shape=3)
        share, total = 0.5 * pt.erfc(-x[1] / math.sqrt(2.0)), REFERENCE[0] * pt.exp(x[0])
        linear, square = total * share * np.array(VISCOUS), total * (1.0 - share) * np.array(CASE_IV)
        C = linear + square
        n = (np.array(FORCE) - C) / ((linear + 2.0 * square) * pt.minimum(1.0, np.array(FORCE) / C))
        pm.Potential("rows", pm.logp(pm.Normal.dist(0.0, 0.011 * pt.exp(0.8 * x[2])), n).sum())
    return model


def pymc(part: int) -> Sampled:
    """PyMC's own NUTS, four chains one after the other."""
    import pymc as pm  # noqa: PLC0415 - as above

    clock: list[float] = []

    def note(trace: Any, draw: Any) -> None:
        if not draw.tuning and draw.chain == CHAINS - 1:
            clock.append(process_time())

    found = pm.sample(
        2 * part, tune=1000, chains=CHAINS, cores=1, random_seed=SEED, progressbar=False, callback=note,
        compute_convergence_checks=False, return_inferencedata=False, model=describe_in_pymc(),
    )  # fmt: skip
    drawn = np.stack([found.get_values("x", chains=[chain]) for chain in found.chains])
    # the last chain's time stands for half of it, times the number of chains
    return in_part(drawn, CHAINS * 0.5 * (clock[-1] - clock[0]), "four chains")


def nutpie(part: int) -> Sampled:
    """nutpie's NUTS in Rust on PyMC's model compiled by Numba, four chains one after the other."""
    import nutpie as sampler  # noqa: PLC0415 - as above

    compiled = sampler.compile_pymc_model(describe_in_pymc())

    def run(draws: int) -> tuple[np.ndarray, float]:
        start = process_time()
        found = sampler.sample(
            compiled, draws=draws, tune=1000, chains=CHAINS, cores=1, seed=SEED, save_warmup=False, progress_bar=False
        )
        return np.asarray(found.posterior["x"]), process_time() - start

    first, short = run(2 * part)
    # each run warms up: the rate is that of the draws by which a second run is longer
    long, whole = run(10 * part)
    how = f"{CHAINS} chains, {CHAINS} x {2 * part} draws"
    return Sampled(first.reshape(-1, 3), effective(first), how, 0.8 * effective(long) / (whole - short), whole)


def numpyro(part: int) -> Sampled:
    """NumPyro's NUTS in double precision, four chains at once in one program."""
    import jax  # noqa: PLC0415 - as above
    import jax.numpy as jnp  # noqa: PLC0415 - as above
    import numpyro  # noqa: PLC0415 - as above
    from jax.scipy.stats import norm  # noqa: PLC0415 - as above
    from numpyro import distributions as dist  # noqa: PLC0415 - as above
    from numpyro.infer import MCMC, NUTS  # noqa: PLC0415 - as above

    numpyro.enable_x64()
    F, viscous, case_iv = map(jnp.array, (FORCE, VISCOUS, CASE_IV))

    def model() -> None:
        x = numpyro.sample("x", dist.Normal(0.0, 1.0).expand([3]))
        share, total = norm.cdf(x[1]), REFERENCE[0] * jnp.exp(x[0])
        linear, square = total * share * viscous, total * (1.0 - share) * case_iv
        C = linear + square
        n = (F - C) / ((linear + 2.0 * square) * jnp.minimum(1.0, F / C))
        numpyro.factor("rows", norm.logpdf(n, 0.0, 0.011 * jnp.exp(0.8 * x[2])).sum())

    def run(draws: int) -> tuple[np.ndarray, float]:
        start = process_time()
        kernel = MCMC(
            NUTS(model), num_warmup=1000, num_samples=draws, num_chains=CHAINS, chain_method=METHOD, progress_bar=False
        )
        kernel.run(jax.random.PRNGKey(SEED))
        return np.asarray(kernel.get_samples(group_by_chain=True)["x"]), process_time() - start

    first, _ = run(part)
    # each run compiles: the rate is that of the draws by which a third run is longer than a second one
    (_, short), (long, whole) = run(part), run(5 * part)
    rate = 0.8 * effective(long) / (whole - short)
    how = f"{CHAINS} chains ({METHOD}), {CHAINS} x {part} draws"
    return Sampled(first.reshape(-1, 3), effective(first), how, rate, short + whole)


METHOD = "vectorized"
OWN = {"ours": ours, "chains": chains}
PEERS = {"emcee": emcee, "pymc": pymc, "nutpie": nutpie, "numpyro": numpyro}


def main() -> None:
    name, number = sys.argv[1], int(sys.argv[2])
    found = draw_twice(partial(OWN[name], number)) if name in OWN else PEERS[name](number)
    told: dict[str, Any] = {"size": found.size, "how": found.how, "rate": found.rate, "beside": found.beside}
    print(json.dumps(told | {"mean": list(found.x.mean(axis=0)), "sd": list(found.x.std(axis=0))}))


if __name__ == "__main__":
    main()
