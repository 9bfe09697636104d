"""Checks of a sampled law against its data: PSIS-LOO (arviz) and posterior predictive checks."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from damping.arrays import FloatArray
from damping.infer.chains import Posterior, load_arviz
from damping.infer.likelihood import measure_misfit, pointwise_log_likelihood
from damping.infer.observations import Observations

#: Pareto k above which an importance-sampled leave-one-out value is unreliable (Vehtari, Gelman & Gabry 2017).
PARETO_LIMIT = 0.7


@dataclass(frozen=True)
class LeaveOneOut:
    """PSIS-LOO of a law."""

    elpd: float  #: expected log predictive density
    standard_error: float  #: of elpd
    p: float  #: effective number of parameters
    pareto_k: FloatArray  #: of each unit left out (a sweep; a row where there is one sweep only)
    unit: str  #: ``level`` or ``row``
    caution: str  #: arviz's warning in words, empty if none


@dataclass(frozen=True)
class PredictiveCheck:
    """Replicated against measured data by the misfit of :func:`damping.infer.likelihood.measure_misfit`.

    Intervals are of the predictive resonant amplitude of each tested sweep, per cent of the measured, (sweeps,).
    """

    #: share of draws whose replicated misfit exceeds the measured one; near 0 the law fits worse than its scatter
    #: explains, near 1 better
    p_value: float
    median: FloatArray
    low: FloatArray
    high: FloatArray


def inference_data(posterior: Posterior, data: Observations) -> Any:
    """Draws, log likelihood and data as ArviZ groups; chains are the independent ensembles.

    Single precision: seven digits, far beyond the Monte Carlo error.
    """
    chains, kept = posterior.x.shape[:2]
    by_unit = pointwise_log_likelihood(posterior.draws, posterior.coordinates, data)
    values = {name.replace(" ", "_").replace("*", "."): value for name, value in posterior.parameters().items()}
    return load_arviz().from_dict(
        posterior={name: value.astype(np.float32) for name, value in values.items()},
        log_likelihood={"resonance": by_unit.reshape(chains, kept, -1).astype(np.float32)},
        observed_data={"amplitude": data.A, "omega": data.omega, "force_in_quadrature": data.D},
        attrs={"law": posterior.coordinates.law.name, "converged": str(posterior.converged)},
    )


def leave_one_out(groups: Any, data: Observations) -> LeaveOneOut:
    """PSIS-LOO of :func:`inference_data`; arviz's own warnings are kept as the caution."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = load_arviz().loo(groups, pointwise=True)
    k = np.atleast_1d(np.asarray(result.pareto_k))
    unit = "level" if len(data.sweeps) > 1 else "row"
    bad = int(np.sum(k > PARETO_LIMIT))
    caution = (
        f"{bad} of {len(k)} {unit}s with Pareto k > {PARETO_LIMIT}: influential, so the value is rough" if bad else ""
    )
    if not caution and any("Pareto" in str(w.message) for w in caught):
        caution = "arviz warns of large Pareto k"
    return LeaveOneOut(float(result.elpd_loo), float(result.se), float(result.p_loo), k, unit, caution)


def predictive_check(
    posterior: Posterior, data: Observations, amplitude: FloatArray, level: float, seed: int
) -> PredictiveCheck:
    """Compare replicated with measured data.

    Args:
        amplitude: resonant amplitude of each draw at each tested force, (draws, sweeps).
        level: content of the predictive intervals.
    """
    rng = np.random.default_rng(seed)
    measured = measure_misfit(posterior.draws, posterior.coordinates, data)
    replicated = rng.chisquare(len(data.A), size=len(measured))
    scatter = np.hypot(*posterior.coordinates.scatter(posterior.draws))[:, None]
    percent = 100.0 * amplitude / data.tested_amplitude * np.exp(scatter * rng.standard_normal(amplitude.shape))
    tail = 50.0 * (1.0 - level)
    low, median, high = np.nanpercentile(percent, [tail, 50.0, 100.0 - tail], axis=0)
    return PredictiveCheck(float(np.mean(replicated > measured)), median, low, high)
