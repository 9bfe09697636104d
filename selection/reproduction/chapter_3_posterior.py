"""Posteriors of the planar-coupled oscillator on the test of Configuration I, and what they say of each other.

The modal motion (A2), and the tail motion with what is in phase with the force left free, are sampled by emcee; the
others are weighted draws of importance sampling. The tail alone, with nothing removed and nothing in phase left free,
has no posterior here: it falls into parts (two planes; one plane and the other anywhere) between which chains pass too
seldom for the criteria of convergence. Its least-squares fit stands in the table of fits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from selection.arrays import FloatArray
from selection.posterior.evidence import Evidence
from selection.posterior.planar import PlanarPosterior, PlanarPrior, planar_evidence, planar_posterior
from selection.posterior.sampling import Settings
from selection.reproduction.chapter_3 import PLANES
from selection.reproduction.chapter_3_planar import VARIANTS, phasors

#: Data and variant of the posteriors that are sampled, and of those known by importance sampling.
SAMPLED = (("A2", "free"), ("tail", "free + in phase"))
WEIGHTED = (
    ("A2", "theta = 28"),
    ("A2", "theta = 28, M = 21"),
    ("A2", "one plane"),
    ("A2", "free + in phase"),
)
#: Content of every interval and band.
LEVEL = 0.9
#: Where the report's second frequency (Eq. 3.1.37) may lie when it is read off a plot to .01 or two: asked of omega_y.
SECOND_PLANE = (11.48, 11.51)

_SETTINGS = Settings(block=600)  # chains are looked at when they are likely to be long enough
_GRID, _BAND_DRAWS, _PRIOR_DRAWS = 177, 400, 8000


@dataclass(frozen=True)
class Band:
    """Over ``omega``: median, low and high end of amplitude (in) and phase (rad) of the fitted motion, each (n,)."""

    omega: FloatArray
    amplitude: tuple[FloatArray, FloatArray, FloatArray]
    phase: tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Known:
    """What is known of one posterior.

    Attributes:
        data, variant: whose. prior: the meaning of ``x``. draws: of the variables (n, dimension). evidence: of it.
        posterior: the chains, None where it is known by importance sampling.
    """

    data: str
    variant: str
    prior: PlanarPrior
    draws: FloatArray
    evidence: Evidence
    posterior: PlanarPosterior | None

    @property
    def parameters(self) -> dict[str, FloatArray]:
        """Draws of every parameter that is free, and of C; theta in degrees, R as motion in phase at the mean force."""
        values = self.prior.parameters(self.draws)
        if "theta" in values:
            values["theta"] = np.degrees(values["theta"])
        if "R" in values:
            values["R"] = values["R"] * float(phasors(self.data).F.mean())
        return values


def planar_posteriors(seed: int) -> dict[tuple[str, str], Known]:
    """All posteriors by data and variant, constant noise."""
    return {key: _known(*key, seed) for key in (*SAMPLED, *WEIGHTED)}


def _known(name: str, variant: str, seed: int) -> Known:
    data, (fixed, extras) = phasors(name), VARIANTS[variant]
    held = {parameter: value for parameter, value in fixed.items() if parameter != "omega_y"}
    prior = PlanarPrior.of(data, PLANES.mass, held, extras)
    if (name, variant) in SAMPLED:
        posterior = planar_posterior(prior, data, seed, _SETTINGS)
        return Known(name, variant, prior, posterior.draws, posterior.evidence, posterior)
    found = planar_evidence(prior, data, seed)
    return Known(name, variant, prior, found.draws, found, None)


def posterior_table(known: Mapping[tuple[str, str], Known]) -> pd.DataFrame:
    """Median and interval of every parameter (theta in degrees, R F in in), and how well it is known.

    ``method`` is ``emcee`` (with R-hat and effective size of the chains) or ``importance`` (effective draws).
    """
    rows = []
    for one in known.values():
        chains = one.posterior.chains if one.posterior else None
        diagnoses = {d.name: d for d in chains.diagnoses} if chains else {}
        for name, values in one.parameters.items():
            low, median, high = np.quantile(values, _tails())
            about = {
                "method": "emcee" if chains else "importance",
                "r_hat": diagnoses[name].r_hat if chains else np.nan,
                "effective_size": diagnoses[name].effective_size if chains else one.evidence.effective_draws,
                "converged": chains.converged if chains else None,
            }
            where = {"data": one.data, "fit": one.variant, "parameter": name}
            rows.append({**where, "median": median, "low": low, "high": high, **about})
    return pd.DataFrame(rows)


def evidence_table(known: Mapping[tuple[str, str], Known]) -> pd.DataFrame:
    """Log marginal likelihood of each variant on the modal motion A2, and its Bayes factor over ``free``."""
    free = known["A2", "free"].evidence
    rows = [
        {
            "fit": one.variant,
            "log_z": one.evidence.log_z,
            "log_z_error": one.evidence.standard_error,
            "bayes_factor_over_free": float(np.exp(one.evidence.log_z - free.log_z)),
        }
        for one in known.values()
        if one.data == "A2"
    ]
    return pd.DataFrame(rows)


def second_plane_probability(known: Known) -> float:
    """Posterior probability that omega_y lies in ``SECOND_PLANE``."""
    omega_y = known.parameters["omega_y"]
    return float(np.mean((omega_y >= SECOND_PLANE[0]) & (omega_y <= SECOND_PLANE[1])))


def band(known: Known) -> Band:
    """Credible band of the modal motion over the swept frequencies, the force interpolated between the points.

    What is in phase with the force beside the mode (R) is in it where it was fitted, as it is in the data.
    """
    data = phasors(known.data)
    omega = np.linspace(data.omega[0], data.omega[-1], _GRID)
    F = np.interp(omega, data.omega, data.F)
    every = max(1, len(known.draws) // _BAND_DRAWS)
    response = known.prior.model(known.draws[::every]).response(F, omega)
    phase = np.mod(-np.angle(response) + 0.5 * np.pi, 2.0 * np.pi) - 0.5 * np.pi
    low, median, high = np.quantile(np.abs(response), _tails(), axis=0)
    phase_low, phase_median, phase_high = np.quantile(phase, _tails(), axis=0)
    return Band(omega, (median, low, high), (phase_median, phase_low, phase_high))


def prior_draws(known: Known, seed: int = 0) -> dict[str, FloatArray]:
    """Draws of the prior of the parameters that are free, and of C; theta in degrees."""
    x = np.random.default_rng(seed).standard_normal((_PRIOR_DRAWS, known.prior.dimension))
    return Known(known.data, known.variant, known.prior, x, known.evidence, None).parameters


def _tails() -> tuple[float, float, float]:
    return 0.5 * (1.0 - LEVEL), 0.5, 0.5 * (1.0 + LEVEL)
