"""Posterior of the planar-coupled oscillator (Eqs. 3.1.24-3.1.35): priors, likelihood, evidence, chains.

Every parameter is a known function of a standard normal variable, so that a prior is ``prod N(x_i; 0, 1)``:

- ``omega_p <= omega_y``: the frequencies of the two planes, each uniform over the swept band, in rising order. (A plane
  outside it would only stand for motion in phase with the force, of other modes or of the rigid body.)
- ``theta``: uniform from 0 to 90 degrees (its sign has no effect along the force).
- ``M`` about the modal mass assumed, ``xi`` of the pitch plane, ``sigma``, noise of a phasor's components: log-normal;
  ``R`` and ``lag``, where they are asked for: normal about 0.

The likelihood is that of circular normal noise, independent from point to point.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import pandas as pd
from scipy.optimize import OptimizeResult, minimize
from scipy.special import ndtr

from damping.arrays import FloatArray, wrap_lag
from damping.infer.chains import Chains, Settings, Target, run
from damping.infer.importance import Evidence, importance
from damping.infer.likelihood import REACH, log_prior
from damping_reed1970.chapter_3 import PLANES, REPORT, VARIANTS, PlanarOscillator, pitch_response
from damping_reed1970.chapter_3.planar_fit import EXTRAS, Phasors, phasors

MASS_LOG_SD = 0.5  #: log standard deviation of M: a factor of 2.3 either way in 90 %
XI_MEDIAN = 0.01  #: median of xi of the pitch plane: 1 per cent, the order of bolted structures
XI_LOG_SD = 1.0  #: log standard deviation of xi: a factor of 5 either way in 90 %
SIGMA_SHARE = 0.05  #: median of the noise over the largest amplitude: readings of 5 per cent
SIGMA_LOG_SD = 1.0  #: log standard deviation of the noise: hardly known beforehand
#: Standard deviation of motion in phase with the force, over the largest amplitude: other modes add a part of it.
R_SHARE = 0.2
LAG_SD = 0.1  #: standard deviation of the lag of all readings, rad: 6 degrees
VARIABLES = ("omega_p", "omega_y", "theta", "M", "xi", "sigma")  #: variables that are always there, in order

_STARTING_POINTS = 2048  #: prior points looked at, as a power of 2: 2048 leave no peak of the posterior unseen
#: Prior points followed down to their mode, the best ones.
_STARTS = 4
_STEP = 1e-5  # of a standard normal variable, in difference quotients


@dataclass(frozen=True)
class PlanarPrior:
    """The map from standard normal variables ``x`` (..., dimension) to the parameters, with scales of the ``data``."""

    data: Phasors
    mass: float  #: median of M
    fixed: Mapping[str, float] = field(default_factory=dict)  #: theta (rad) and M where they are held
    extras: Collection[str] = ()  #: of ``EXTRAS``, those free

    @property
    def names(self) -> tuple[str, ...]:
        """The variables, in order."""
        free = (name for name in VARIABLES if name not in self.fixed)
        return (*free, *(name for name in EXTRAS if name in self.extras))

    @property
    def force(self) -> float:
        """Mean modal force."""
        return float(np.mean(self.data.F))

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
        low, high, size = self.data.omega.min(), self.data.omega.max(), np.abs(self.data.q)
        # the larger of two uniforms is the root of a uniform, the smaller is uniform below it
        omega_y = low + (high - low) * np.sqrt(ndtr(z["omega_y"]))
        omega_p = low + (omega_y - low) * ndtr(z["omega_p"])
        values = {name: np.full(x.shape[:-1], self.fixed.get(name, 0.0)) for name in (*self.fixed, *EXTRAS)}
        if "theta" in z:
            values["theta"] = 0.5 * np.pi * ndtr(z["theta"])
        if "M" in z:
            values["M"] = self.mass * np.exp(MASS_LOG_SD * z["M"])
        scales = {"R": R_SHARE * size.max() / self.force, "lag": LAG_SD}
        values |= {name: sd * z[name] for name, sd in scales.items() if name in z}
        xi = XI_MEDIAN * np.exp(XI_LOG_SD * z["xi"])
        C = 2.0 * xi * values["M"] * omega_p
        sigma = SIGMA_SHARE * (size / self.data.shape).max() * np.exp(SIGMA_LOG_SD * z["sigma"])
        return {"omega_p": omega_p, "omega_y": omega_y, **values, "C": C, "xi": xi, "sigma": sigma}


@dataclass(frozen=True)
class PlanarPosterior:
    """What is known of a planar oscillator."""

    prior: PlanarPrior
    draws: FloatArray  #: of its variables (n, dimension), whose meaning the prior gives
    evidence: Evidence
    chains: Chains | None = None  #: None where it is known by importance sampling

    @property
    def parameters(self) -> dict[str, FloatArray]:
        """Draws of every parameter that is free, and of C; theta in degrees, R as motion in phase at the mean force."""
        values = self.prior.parameters(self.draws)
        factors = {"theta": 180.0 / np.pi, "R": self.prior.force}
        return {name: factors[name] * draws if name in factors else draws for name, draws in values.items()}


def log_likelihood(x: FloatArray, prior: PlanarPrior) -> FloatArray:
    """Circular normal log likelihood at points (points, dimension): -ln(2 pi s^2) - |q - model|^2/(2 s^2) a phasor."""
    data = prior.data
    sigma = prior.values(x)["sigma"]
    square = np.sum(np.abs(data.residuals(prior.model(x))) ** 2, axis=-1)
    norm = data.omega.size * np.log(2.0 * np.pi * sigma**2) + 2.0 * np.sum(np.log(data.shape))
    return np.asarray(-0.5 * square / sigma**2 - norm)


def log_posterior(x: FloatArray, prior: PlanarPrior) -> FloatArray:
    """Unnormalised log posterior density at points (points, dimension); ``-inf`` beyond ``REACH``."""
    x = np.atleast_2d(x)
    inside = np.all(np.abs(x) < REACH, axis=-1)
    x = np.clip(x, -REACH, REACH)
    return np.where(inside, log_prior(x) + log_likelihood(x, prior), -np.inf)


def planar_evidence(prior: PlanarPrior, seed: int = 0) -> Evidence:
    """Marginal likelihood and weighted draws, by importance sampling from the posterior mode outwards."""
    mode = _mode(prior)
    return importance(partial(log_posterior, prior=prior), mode.x, mode.hess_inv, seed, least_rounds=9)


def _mode(prior: PlanarPrior) -> OptimizeResult:
    """The best of several quasi-Newton descents from prior points."""
    points = np.clip(np.random.default_rng(0).standard_normal((_STARTING_POINTS, prior.dimension)), -3.0, 3.0)
    best = np.argsort(-log_posterior(points, prior), kind="stable")[:_STARTS]

    def value_and_gradient(x: FloatArray) -> tuple[float, FloatArray]:
        steps = _STEP * np.eye(x.size)
        star = np.vstack([x, x + steps, x - steps])
        # without the cut-off at REACH: the minimiser needs numbers
        values = -(log_prior(star) + log_likelihood(star, prior))
        return float(values[0]), (values[1 : 1 + x.size] - values[1 + x.size :]) / (2.0 * _STEP)

    descents = [minimize(value_and_gradient, points[i], jac=True, method="BFGS") for i in best]
    return min(descents, key=lambda descent: float(descent.fun))


def planar_posterior(prior: PlanarPrior, seed: int, settings: Settings | None = None) -> PlanarPosterior:
    """Sample the planar oscillator until every parameter is known (see ``chains.Settings``)."""
    evidence = planar_evidence(prior, seed)
    target = Target(partial(log_posterior, prior=prior), prior.dimension, prior.parameters)
    chains = run(target, evidence, seed, settings)
    return PlanarPosterior(prior, chains.x.reshape(-1, chains.x.shape[-1]), evidence, chains)


#: Data and variant of the posteriors that are sampled, and of those known by importance sampling.
SAMPLED = (("A2", "free"), ("tail", "free + in phase"))
WEIGHTED = tuple(("A2", fit) for fit in ("theta = 28", REPORT, "one plane", "free + in phase"))
#: Content of every interval and band.
LEVEL = 0.9
TAILS = (0.5 * (1.0 - LEVEL), 0.5, 0.5 * (1.0 + LEVEL))
_GRID = 177  #: frequencies of a band: 16 between two measured ones
_BAND_DRAWS = 400  #: draws behind a band, at least: its ends, quantiles of 5 %, rest on 20
_PRIOR_DRAWS = 8000  #: draws of a prior, for its density

Curve = tuple[FloatArray, FloatArray, FloatArray]  #: median, low and high end of a curve over frequency
Posteriors = Mapping[tuple[str, str], PlanarPosterior]  #: posteriors by data and variant


@dataclass(frozen=True)
class PlanarBand:
    """Over ``omega`` (n,): amplitude (in) and phase (rad) of the fitted motion."""

    omega: FloatArray
    amplitude: Curve
    phase: Curve


def planar_posteriors(seed: int) -> dict[tuple[str, str], PlanarPosterior]:
    """All posteriors, constant noise."""
    posteriors = {}
    for name, variant in (*SAMPLED, *WEIGHTED):
        fixed, extras = VARIANTS[variant]
        held = {parameter: value for parameter, value in fixed.items() if parameter != "omega_y"}
        prior = PlanarPrior(phasors(name), PLANES.mass, held, extras)
        if (name, variant) in SAMPLED:
            posteriors[name, variant] = planar_posterior(prior, seed)
        else:
            evidence = planar_evidence(prior, seed)
            posteriors[name, variant] = PlanarPosterior(prior, evidence.draws, evidence)
    return posteriors


def tabulate_posterior(posteriors: Posteriors) -> pd.DataFrame:
    """Median and interval of every parameter (theta in degrees, R F in in), and how well it is known.

    ``method`` is ``emcee`` (with R-hat and effective size of the chains) or ``importance`` (effective draws).
    """
    rows = []
    for (data, variant), posterior in posteriors.items():
        chains = posterior.chains
        diagnoses = {d.name: d for d in chains.diagnoses} if chains else {}
        for name, values in posterior.parameters.items():
            low, median, high = np.quantile(values, TAILS)
            rows.append(
                {
                    "data": data,
                    "fit": variant,
                    "parameter": name,
                    "median": median,
                    "low": low,
                    "high": high,
                    "method": "emcee" if chains else "importance",
                    "r_hat": diagnoses[name].r_hat if chains else np.nan,
                    "effective_size": diagnoses[name].effective_size if chains else posterior.evidence.effective_draws,
                    "converged": chains.converged if chains else None,
                }
            )
    return pd.DataFrame(rows)


def tabulate_evidence(posteriors: Posteriors) -> pd.DataFrame:
    """Log marginal likelihood of each variant on the modal motion A2, and its Bayes factor over ``free``."""
    evidences = {variant: p.evidence for (data, variant), p in posteriors.items() if data == "A2"}
    rows = [(variant, evidence.log_z, evidence.standard_error) for variant, evidence in evidences.items()]
    table = pd.DataFrame(rows, columns=["fit", "log_z", "log_z_error"])
    return table.assign(bayes_factor_over_free=np.exp(table["log_z"] - evidences["free"].log_z))


def fit_band(posterior: PlanarPosterior) -> PlanarBand:
    """Credible band of the modal motion over the swept frequencies, the force interpolated between the points.

    What is in phase with the force beside the mode (R) is in it where it was fitted, as it is in the data.
    """
    data = posterior.prior.data
    omega = np.linspace(data.omega[0], data.omega[-1], _GRID)
    every = max(1, len(posterior.draws) // _BAND_DRAWS)
    F = np.interp(omega, data.omega, data.F)
    response = pitch_response(posterior.prior.model(posterior.draws[::every]), F, omega)
    low, median, high = np.quantile(np.abs(response), TAILS, axis=0)
    phase_low, phase_median, phase_high = np.quantile(wrap_lag(-np.angle(response)), TAILS, axis=0)
    return PlanarBand(omega, (median, low, high), (phase_median, phase_low, phase_high))


def prior_draws(posterior: PlanarPosterior) -> dict[str, FloatArray]:
    """Draws of the prior of the parameters that are free, and of C; theta in degrees."""
    x = np.random.default_rng(0).standard_normal((_PRIOR_DRAWS, posterior.prior.dimension))
    return replace(posterior, draws=x).parameters
