"""Have chains said enough? Effective sample size, length in autocorrelation times, R-hat between ensembles (arviz)."""

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
    arviz = load_arviz()
    with np.errstate(invalid="ignore", divide="ignore"):  # of a quantity that stays where it is
        sizes = {method: float(arviz.ess(by_walker, method=method)) for method in ("mean", "bulk", "tail")}
        r_hat = float(arviz.rhat(by_ensemble))
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
