"""Has a chain said enough? Effective sample size, length in autocorrelation times, R-hat between ensembles (arviz)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from damping.arrays import FloatArray


def load_arviz() -> Any:
    """ArviZ, loaded when asked for (60 MB), without the announcement of its next version at every import."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz  # noqa: PLC0415 - 60 MB that only chains need
    return arviz


@dataclass(frozen=True)
class Convergence:
    """Convergence of one reported quantity.

    Attributes:
        r_hat: rank-normalised split R-hat between the independent ensembles.
        effective_size: the least of arviz's bulk and tail sizes and of emcee's (draws over autocorrelation time).
        autocorrelation: integrated autocorrelation time in steps, the longest over the ensembles.
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


def assess_convergence(name: str, values: FloatArray, thin: int = 1) -> Convergence:
    """Diagnose a quantity.

    Args:
        values: (ensembles, steps, walkers), every ``thin``-th step after burn-in.
        thin: steps between two entries, so that times are in steps.
    """
    from emcee.autocorr import integrated_time  # noqa: PLC0415 - chains alone need it

    arviz = load_arviz()
    ensembles, steps, walkers = values.shape
    # in order of steps, so that the halves of split R-hat are early and late
    r_hat = float(arviz.rhat(values.reshape(ensembles, steps * walkers)))
    with np.errstate(invalid="ignore", divide="ignore"):  # of a quantity that stays where it is
        tau = float(np.max([integrated_time(v, tol=0, quiet=True) for v in values]))
    by_walker = np.moveaxis(values, 1, 2).reshape(ensembles * walkers, steps)
    sizes = [ensembles * steps * walkers / max(tau, 1.0)]
    sizes += [float(arviz.ess(by_walker, method=method)) for method in ("bulk", "tail")]
    size = float(np.min(sizes))
    sd = float(values.std())
    return Convergence(
        name=name,
        mean=float(values.mean()),
        sd=sd,
        r_hat=r_hat,
        effective_size=size,
        autocorrelation=tau * thin,
        lengths=steps / tau,
        monte_carlo_error=sd / float(np.sqrt(size)),
    )
