"""Posterior of the planar-coupled oscillator (Eqs. 3.1.24-3.1.35): priors, likelihood, evidence, chains.

Every parameter is a known function of a standard normal variable, so that a prior is ``prod N(x_i; 0, 1)``:

- ``omega_p <= omega_y``: the frequencies of the two planes, each uniform over the swept band, in rising order. (A plane
  outside it would only stand for motion in phase with the force, of other modes or of the rigid body.)
- ``theta``: uniform from 0 to 90 degrees (its sign has no effect along the force).
- ``M``: log-normal about the modal mass assumed, log standard deviation 0.5 (a factor of 2.3 either way in 90 %).
- ``xi`` of the pitch plane: log-normal about 0.01, log standard deviation 1.
- ``sigma``: noise of a phasor's components, log-normal about 5 % of the largest amplitude (of each amplitude, where
  noise is proportional), log standard deviation 1.
- where they are asked for: ``R``, normal about 0 with a motion of 20 % of the largest amplitude as standard deviation;
  ``lag``, normal about 0 with 0.1 rad.

The likelihood is that of circular normal noise, independent from point to point.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.optimize import OptimizeResult, minimize
from scipy.special import ndtr

from damping.arrays import FloatArray
from damping.infer.chains import Chains, Settings, Target, run
from damping.infer.importance import Evidence, importance
from damping.infer.likelihood import REACH, log_prior
from damping_reed1970.chapter_3 import PlanarOscillator
from damping_reed1970.chapter_3.planar_fit import EXTRAS, Phasors

#: Log standard deviation of M: a factor of 2.3 either way in 90 %.
MASS_LOG_SD = 0.5
#: Median of xi of the pitch plane: 1 per cent, the order of bolted structures.
XI_MEDIAN = 0.01
#: Log standard deviation of xi: a factor of 5 either way in 90 %.
XI_LOG_SD = 1.0
#: Median of the noise over the largest amplitude: readings of 5 per cent.
SIGMA_SHARE = 0.05
#: Log standard deviation of the noise: hardly known beforehand.
SIGMA_LOG_SD = 1.0
#: Standard deviation of motion in phase with the force, over the largest amplitude: other modes add a part of it.
R_SHARE = 0.2
#: Standard deviation of the lag of all readings, rad: 6 degrees.
LAG_SD = 0.1
#: Variables that are always there, in order.
VARIABLES = ("omega_p", "omega_y", "theta", "M", "xi", "sigma")

#: Prior points looked at, as a power of 2: 2048 leave no peak of the posterior unseen.
_STARTING_POINTS = 2048
#: Prior points followed down to their mode, the best ones.
_STARTS = 4
_STEP = 1e-5  # of a standard normal variable, in difference quotients


@dataclass(frozen=True)
class PlanarPrior:
    """The map from standard normal variables ``x`` (..., dimension) to the parameters.

    Attributes:
        low, high: the swept band, rad/s. mass: median of M. sigma: median of the noise scale. R: standard deviation.
        force: mean modal force.
        fixed: theta (rad) and M where they are held at a value. extras: of ``EXTRAS``, that are free.
    """

    low: float
    high: float
    mass: float
    sigma: float
    R: float
    force: float
    fixed: Mapping[str, float] = field(default_factory=dict)
    extras: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, data: Phasors, mass: float, fixed: Mapping[str, float] | None = None, extras: Collection[str] = ()
    ) -> PlanarPrior:
        """Scales from the data; ``mass`` is the modal mass assumed."""
        largest, force = float(np.max(np.abs(data.q))), float(np.mean(data.F))
        return cls(
            low=float(data.omega.min()),
            high=float(data.omega.max()),
            mass=mass,
            sigma=SIGMA_SHARE * float(np.max(np.abs(data.q) / data.shape)),
            R=R_SHARE * largest / force,
            force=force,
            fixed=dict(fixed or {}),
            extras=tuple(name for name in EXTRAS if name in extras),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The variables, in order."""
        return (*(name for name in VARIABLES if name not in self.fixed), *self.extras)

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return len(self.names)

    def parameters(self, x: FloatArray) -> dict[str, FloatArray]:
        """Parameters that are free, and C and xi: arrays of shape ``x.shape[:-1]`` by name."""
        free = {*self.names, "C"}
        return {name: value for name, value in self.values(x).items() if name in free}

    def model(self, x: FloatArray) -> PlanarOscillator:
        """Models whose fields have shape (..., 1), to broadcast with frequencies."""
        values = self.values(x)
        return PlanarOscillator(*(values[name][..., None] for name in PlanarOscillator._fields))

    def values(self, x: FloatArray) -> dict[str, FloatArray]:
        """Every parameter, free or held, and C and xi."""
        z = dict(zip(self.names, np.moveaxis(x, -1, 0), strict=True))
        # the larger of two uniforms is the root of a uniform, the smaller is uniform below it
        omega_y = self.low + (self.high - self.low) * np.sqrt(ndtr(z["omega_y"]))
        omega_p = self.low + (omega_y - self.low) * ndtr(z["omega_p"])
        values = {name: np.full(x.shape[:-1], self.fixed.get(name, 0.0)) for name in (*self.fixed, *EXTRAS)}
        if "theta" in z:
            values["theta"] = 0.5 * np.pi * ndtr(z["theta"])
        if "M" in z:
            values["M"] = self.mass * np.exp(MASS_LOG_SD * z["M"])
        values |= {name: sd * z[name] for name, sd in (("R", self.R), ("lag", LAG_SD)) if name in z}
        xi = XI_MEDIAN * np.exp(XI_LOG_SD * z["xi"])
        C, sigma = 2.0 * xi * values["M"] * omega_p, self.sigma * np.exp(SIGMA_LOG_SD * z["sigma"])
        return {"omega_p": omega_p, "omega_y": omega_y, **values, "C": C, "xi": xi, "sigma": sigma}


@dataclass(frozen=True)
class PlanarPosterior:
    """What is known of a planar oscillator.

    Attributes:
        prior: the meaning of ``x``. draws: of the variables (n, dimension). evidence: of the model.
        chains: None where it is known by importance sampling.
    """

    prior: PlanarPrior
    draws: FloatArray
    evidence: Evidence
    chains: Chains | None = None

    @property
    def parameters(self) -> dict[str, FloatArray]:
        """Draws of every parameter that is free, and of C; theta in degrees, R as motion in phase at the mean force."""
        values = self.prior.parameters(self.draws)
        factors = {"theta": 180.0 / np.pi, "R": self.prior.force}
        return {name: factors[name] * draws if name in factors else draws for name, draws in values.items()}


def log_likelihood(x: FloatArray, prior: PlanarPrior, data: Phasors) -> FloatArray:
    """Circular normal log likelihood at points (points, dimension): -ln(2 pi s^2) - |q - model|^2/(2 s^2) a phasor."""
    sigma = prior.values(x)["sigma"]
    square = np.sum(np.abs(data.residuals(prior.model(x))) ** 2, axis=-1)
    norm = data.omega.size * np.log(2.0 * np.pi * sigma**2) + 2.0 * np.sum(np.log(data.shape))
    return np.asarray(-0.5 * square / sigma**2 - norm)


def log_posterior(x: FloatArray, prior: PlanarPrior, data: Phasors) -> FloatArray:
    """Unnormalised log posterior density at points (points, dimension); ``-inf`` beyond ``REACH``."""
    x = np.atleast_2d(x)
    inside = np.all(np.abs(x) < REACH, axis=-1)
    x = np.clip(x, -REACH, REACH)
    return np.where(inside, log_prior(x) + log_likelihood(x, prior, data), -np.inf)


def planar_evidence(prior: PlanarPrior, data: Phasors, seed: int = 0) -> Evidence:
    """Marginal likelihood and weighted draws, by importance sampling from the posterior mode outwards."""
    mode = _mode(prior, data)
    return importance(partial(log_posterior, prior=prior, data=data), mode.x, mode.hess_inv, seed, least_rounds=9)


def _mode(prior: PlanarPrior, data: Phasors) -> OptimizeResult:
    """The best of several quasi-Newton descents from prior points."""
    points = np.clip(np.random.default_rng(0).standard_normal((_STARTING_POINTS, prior.dimension)), -3.0, 3.0)
    best = np.argsort(-log_posterior(points, prior, data), kind="stable")[:_STARTS]

    def value_and_gradient(x: FloatArray) -> tuple[float, FloatArray]:
        steps = _STEP * np.eye(x.size)
        star = np.vstack([x, x + steps, x - steps])
        # without the cut-off at REACH: the minimiser needs numbers
        values = -(log_prior(star) + log_likelihood(star, prior, data))
        return float(values[0]), (values[1 : 1 + x.size] - values[1 + x.size :]) / (2.0 * _STEP)

    descents = [minimize(value_and_gradient, points[i], jac=True, method="BFGS") for i in best]
    return min(descents, key=lambda descent: float(descent.fun))


def planar_posterior(prior: PlanarPrior, data: Phasors, seed: int, settings: Settings | None = None) -> PlanarPosterior:
    """Sample the planar oscillator until every parameter is known (see ``chains.Settings``)."""
    evidence = planar_evidence(prior, data, seed)
    target = Target(partial(log_posterior, prior=prior, data=data), prior.dimension, prior.parameters)
    chains = run(target, evidence, lambda x: {}, seed, settings)
    return PlanarPosterior(prior, chains.x.reshape(-1, chains.x.shape[-1]), evidence, chains)
