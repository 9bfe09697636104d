"""Posterior of the leading explanation's parameters: importance draws, then emcee ensembles until they have settled.

The deviations of the sweeps are integrated out: the residuals are linear in them, with the robust weights of the fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from selection.arrays import FloatArray
from selection.gap.fit import Fit
from selection.gap.simulation import within_tolerance
from selection.posterior.importance import importance
from selection.posterior.likelihood import by_blocks
from selection.posterior.sampling import Chains, Settings, Start, Target, run

_SETTINGS = Settings(budget=4000)


@dataclass(frozen=True)
class EffectPosterior:
    """Draws of the explanation's parameters.

    Attributes:
        names: parameters as ``effect: parameter`` (``simulation: parameter``: relative to nominal).
        draws: (draws, names).
        log_evidence: with its Monte Carlo standard error, by importance sampling. chains: the run and its convergence.
    """

    names: tuple[str, ...]
    draws: FloatArray
    log_evidence: float
    standard_error: float
    chains: Chains


def sample_effects(leading: Fit, seed: int) -> EffectPosterior:
    """Sample the parameters of an explanation (those of the simulation where there is none)."""
    density = partial(log_density, leading)
    k = leading.model.size
    start = importance(density, leading.y[:k], leading.covariance[:k, :k], seed)
    target = Target(density, k, partial(parameters, leading))
    chains = run(target, Start(start.draws, start.proposal), lambda x: {}, seed, _SETTINGS)
    values = parameters(leading, chains.x.reshape(-1, k))
    table = np.column_stack(list(values.values()))
    return EffectPosterior(tuple(values), table, start.log_z, start.standard_error, chains)


def log_density(leading: Fit, x: FloatArray) -> FloatArray:
    """ln of likelihood times N(x; 0, 1), the deviations of sweeps integrated out; x (points, variables)."""
    return by_blocks(partial(_log_density, leading), x, len(leading.weights))


def parameters(leading: Fit, x: FloatArray) -> dict[str, FloatArray]:
    """Parameters at variables x (points, variables), each (points,)."""
    simulation = leading.model.problem.simulation
    start = len(simulation.names)
    replaced = {part.form.replaces for part in leading.model.parts}
    relative = np.exp(within_tolerance(x[:, :start]) * simulation.tolerance) - 1.0
    found = {f"simulation: {n}": relative[:, i] for i, n in enumerate(simulation.names) if n not in replaced}
    for part in leading.model.parts:
        values = [value[:, 0] for value in part.values(x[:, start : start + part.size])]
        start += part.size
        reported = part.form.report(*values)
        found |= {f"{part.form.effect}: {name}": np.asarray(v) for name, v in reported.items() if np.ndim(v) == 1}
    return found


def _log_density(leading: Fit, x: FloatArray) -> FloatArray:
    model, W = leading.model, leading.weights
    z = np.tile(leading.y[model.size :], (len(x), 1))
    found = model.residuals(np.hstack([x, z]))
    rows = model.problem.rows
    one_hot = (np.tile(rows.sweep, len(W) // len(rows))[:, np.newaxis] == np.arange(model.sweeps)).astype(float)
    gain, frequency = found.by_gain * model.scatter.amplitude, found.by_frequency * model.scatter.frequency
    sweep = np.tile(rows.sweep, len(W) // len(rows))
    t = found.r - gain * z[:, : model.sweeps][:, sweep] - frequency * z[:, model.sweeps :][:, sweep]
    # per sweep: the 2 x 2 matrix 1 + C^T W C and the vector C^T W t
    gg, ff = 1.0 + (W * gain**2) @ one_hot, 1.0 + (W * frequency**2) @ one_hot
    gf, gt, ft = (W * gain * frequency) @ one_hot, (W * gain * t) @ one_hot, (W * frequency * t) @ one_hot
    det = gg * ff - gf**2
    fitted = (ff * gt**2 - 2.0 * gf * gt * ft + gg * ft**2) / det
    value = (
        -0.5 * (t**2 @ W)
        + 0.5 * np.sum(fitted - np.log(det), axis=1)
        - 0.5 * np.sum(x**2 + np.log(2.0 * np.pi), axis=1)
    )
    return np.where(np.isfinite(value), value, -np.inf)
