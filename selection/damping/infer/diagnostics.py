"""Have chains said enough? Effective sample size, length in autocorrelation times, R-hat between ensembles.

Rank-normalised, on split chains, after Vehtari, Gelman, Simpson, Carpenter and Buerkner (2021), as arviz computes them:
written here because loading arviz takes twice as long as sampling.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri

from damping.arrays import FloatArray

#: Tails of which the effective size is taken, too.
TAILS = (0.05, 0.95)


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
    for_mean = measure_effective_size(by_walker)
    tails = [measure_effective_size((by_walker <= np.quantile(values, tail)).astype(float)) for tail in TAILS]
    size = float(np.min([for_mean, measure_effective_size(rank_normalise(by_walker)), *tails]))
    sd = float(values.std())
    tau = max(steps * walkers / for_mean, 1.0) if for_mean > 0.0 else np.nan
    return Convergence(
        name=name,
        mean=float(values.mean()),
        sd=sd,
        r_hat=measure_r_hat(by_ensemble),
        effective_size=size,
        autocorrelation=tau,
        lengths=steps / tau,
        monte_carlo_error=sd / float(np.sqrt(size)),
    )


def measure_r_hat(chains: FloatArray) -> float:
    """The larger R-hat of location and of scale, of chains (chains, draws); NaN of what never moves."""
    halves = _split(chains)
    folded = np.abs(halves - np.median(halves))
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.max([_compare_variances(rank_normalise(values)) for values in (halves, folded)]))


def _compare_variances(chains: FloatArray) -> float:
    """sqrt((between/within + n - 1)/n)."""
    n = chains.shape[1]
    between, within = n * chains.mean(axis=1).var(ddof=1), chains.var(axis=1, ddof=1).mean()
    return float(np.sqrt((between / within + n - 1.0) / n))


def measure_effective_size(chains: FloatArray) -> float:
    """Number of independent draws whose mean is known as well, of chains (chains, draws); NaN of what never moves.

    Draws over tau = -1 + 2 sum of Geyer's (1992) initial monotone sequence of autocorrelations, of split chains.
    """
    halves = _split(chains)
    n = halves.shape[1]
    centred = halves - halves.mean(axis=1, keepdims=True)
    power = np.mean(np.abs(np.fft.rfft(centred, 2 * n)) ** 2, axis=0)
    covariance = np.fft.irfft(power)[:n] / n
    within = covariance[0] * n / (n - 1.0)
    total = covariance[0] + halves.mean(axis=1).var(ddof=1)
    if not total > 0.0:
        return np.nan
    rho = 1.0 - (within - covariance) / total
    rho[0] = 1.0
    pairs = rho[: n - n % 2].reshape(-1, 2).sum(axis=1)
    end = int(np.argmax(pairs < 0.0)) if np.any(pairs < 0.0) else len(pairs) - 1
    tau = -1.0 + 2.0 * np.minimum.accumulate(pairs)[:end].sum() + max(float(rho[2 * end]), 0.0)
    return float(halves.size / max(tau, 1.0 / np.log10(halves.size)))


def rank_normalise(values: FloatArray) -> FloatArray:
    """Normal scores of the ranks of all values (chains, draws) together (Blom 1958), equal values alike."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    rank = (np.cumsum(counts) - 0.5 * (counts - 1))[inverse].reshape(values.shape)
    return np.asarray(ndtri((rank - 0.375) / (values.size + 0.25)))


def _split(chains: FloatArray) -> FloatArray:
    """First and last halves as chains of their own."""
    half = chains.shape[1] // 2
    return np.concatenate([chains[:, :half], chains[:, -half:]])
