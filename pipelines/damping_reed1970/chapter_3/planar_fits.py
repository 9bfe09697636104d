"""The planar-coupled oscillator on the test of Configuration I: least-squares fits and posteriors, side by side.

Two pictures of one test: the modal motion of Table 3.III (``A2``), from which the report had removed rigid-body
rotation and adjacent modes, and the tail motion over the mode factor (``tail``), from which nothing is removed.

The posteriors of the modal motion, and of the tail motion with what is in phase with the force left free, are sampled
by emcee; the others are weighted draws of importance sampling. The tail alone, with nothing removed and nothing in
phase left free, has no posterior here: it falls into parts (two planes; one plane and the other anywhere) between which
chains pass too seldom for the criteria of convergence. Its least-squares fit stands in the table of fits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import degrees

import numpy as np
import pandas as pd
from scipy.stats import chi2

from damping.arrays import FloatArray
from damping.signals import viscous_energy
from damping_reed1970 import columns, load_table
from damping_reed1970.chapter_3 import PLANES, PlanarOscillator, pitch_response, yaw_response
from damping_reed1970.chapter_3.planar_fit import Noise, Phasors, PlanarFit, fit_planar
from damping_reed1970.chapter_3.planar_posterior import PlanarPosterior, PlanarPrior, planar_evidence, planar_posterior

#: What is held, and what is added to the planes, in each fit; in the order of the tables.
VARIANTS: dict[str, tuple[dict[str, float], tuple[str, ...]]] = {
    "free": ({}, ()),
    "theta = 28": ({"theta": PLANES.theta}, ()),
    "theta = 28, M = 21": ({"theta": PLANES.theta, "M": PLANES.mass}, ()),
    "one plane": ({"theta": 0.0, "omega_y": PLANES.omega_y}, ()),
    "free + in phase": ({}, ("R",)),
    "theta = 28 + in phase": ({"theta": PLANES.theta}, ("R",)),
    "free + in phase + lag": ({}, ("R", "lag")),
}
NOISES: tuple[Noise, Noise] = ("constant", "proportional")

#: Fits by data, noise and variant.
Fits = Mapping[tuple[str, str, str], PlanarFit]


@cache
def phasors(name: str, noise: Noise = "constant") -> Phasors:
    """Measured phasors ``A2`` (Table 3.III, modal) or ``tail`` (over the mode factor); phase as E3III-1 corrects it."""
    table, motion = load_table("3_III", "corrected"), load_table("3_I", "corrected")
    omega, F = columns(motion, "omega_rad_s", "force_lb")
    if name == "A2":
        amplitude, phase = columns(table, "modal_amplitude_A2_in", "modal_phase_rad")
    else:
        amplitude, phase = columns(table, "tail_amplitude_in", "tail_phase_rad")
        amplitude = amplitude / PLANES.phi
    return Phasors(amplitude * np.exp(-1j * phase), PLANES.phi * F, omega, noise)


def planar_fits() -> dict[tuple[str, str, str], PlanarFit]:
    """All fits of both pictures with both noises."""
    return {
        (name, noise, variant): fit_planar(phasors(name, noise), *arguments)
        for name in ("A2", "tail")
        for noise in NOISES
        for variant, arguments in VARIANTS.items()
    }


def fit_table(fits: Fits) -> pd.DataFrame:
    """One row a fit: parameters with standard errors (``_se``; theta in degrees), quality, comparison with ``free``.

    ``in_phase_in``: motion R F at the mean force. ``chi_square`` = 2 n ln(SSE/SSE of ``free``), negative where a fit
    has more parameters than that; ``p_value`` of its size with the difference in parameters as degrees of freedom, and
    ``p_value_correlated`` with chi_square reduced for the correlation r of neighbouring residuals, by (1 - r)/(1 + r)
    of the larger model.
    """
    return pd.DataFrame([_fit_row(key, fit, fits[(*key[:2], "free")]) for key, fit in fits.items()])


def _fit_row(key: tuple[str, str, str], fit: PlanarFit, free: PlanarFit) -> dict[str, float | str]:
    name, noise, variant = key
    force = float(phasors(name).F.mean())
    scales = {"theta": degrees(1.0), "R": force}
    labels = {"theta": "theta_degrees", "R": "in_phase_in", "lag": "lag_rad"}
    row: dict[str, float | str] = {"data": name, "noise": noise, "fit": variant}
    values = {**fit.model._asdict(), "xi": fit.xi}
    for parameter in ("omega_p", "omega_y", "theta", "M", "C", "xi", "R", "lag"):
        label, scale = labels.get(parameter, parameter), scales.get(parameter, 1.0)
        row[label] = scale * float(values[parameter])
        row[f"{label}_se"] = scale * fit.standard_errors[parameter]
    if variant == "one plane":
        row["omega_y"] = np.nan
    quality = {"sigma": fit.sigma, "SSE": fit.SSE, "correlation": fit.correlation, "parameters": len(fit.fitted)}
    return {**row, **quality, **comparison(fit, free)}


def comparison(fit: PlanarFit, free: PlanarFit) -> dict[str, float]:
    """Chi-square of a fit against another that contains it or is contained, and what probability it has by chance."""
    larger = max(fit, free, key=lambda either: len(either.fitted))
    chi_square, freedom = fit.chi_square_over(free), abs(len(free.fitted) - len(fit.fitted))
    left = (1.0 - larger.correlation) / (1.0 + larger.correlation)
    p = [float(chi2.sf(abs(chi_square) * share, freedom)) if freedom else np.nan for share in (1.0, min(1.0, left))]
    return {"chi_square": chi_square, "p_value": p[0], "p_value_correlated": p[1]}


def tabulate_yaw(fits: Fits) -> pd.DataFrame:
    """Yaw amplitude by point: measured (Table 3.I, tail yaw over the mode factor), and predicted by fits to pitch."""
    motion = load_table("3_I", "corrected")
    omega, yaw = columns(motion, "omega_rad_s", "tail_yaw_disp_in_e2")
    data = phasors("A2")
    predicted = {
        variant: np.abs(yaw_response(fits["A2", "constant", variant].model, data.F, data.omega))
        for variant in ("free", "theta = 28, M = 21", "free + in phase + lag")
    }
    return pd.DataFrame({"point": motion["point"], "omega": omega, "measured": yaw / 100 / PLANES.phi, **predicted})


def tabulate_energy_split(fits: Fits) -> pd.DataFrame:
    """Share of the energy that the yaw plane takes, in per cent by point: Table 3.IV as printed, and two fits."""
    table = load_table("3_IV").query("corrected_row == 0")
    pitch, yaw = columns(table, "energy_pitch_in_lb", "energy_yaw_in_lb")
    data = phasors("A2")
    shares = {v: _yaw_share(fits["A2", "constant", v].model, data) for v in ("free", "theta = 28, M = 21")}
    printed = 100.0 * yaw / (pitch + yaw)
    return pd.DataFrame({"point": table["point"].to_numpy(), "omega": data.omega, "printed": printed, **shares})


def _yaw_share(model: PlanarOscillator, data: Phasors) -> FloatArray:
    """Per cent of the energy lost that is lost in the yaw plane, (n,)."""
    M, C, omega_p, omega_y, theta = (float(value) for value in model[:5])
    energies = []
    for omega_j, part in ((omega_p, np.cos(theta)), (omega_y, np.sin(theta))):
        A = np.abs(part * data.F / (M * (omega_j**2 - data.omega**2) + 1j * C * data.omega))
        energies.append(viscous_energy(A, M, omega_j, C / (2.0 * M * omega_j), data.omega))
    return np.asarray(100.0 * energies[1] / (energies[0] + energies[1]))


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
TAILS = (0.5 * (1.0 - LEVEL), 0.5, 0.5 * (1.0 + LEVEL))
#: Frequencies of a band: 16 between two measured ones.
_GRID = 177
#: Draws behind a band, at least: its ends, quantiles of 5 %, rest on 20.
_BAND_DRAWS = 400
#: Draws of a prior, for its density.
_PRIOR_DRAWS = 8000


#: Median, low and high end of a curve over frequency.
Curve = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class PlanarBand:
    """Over ``omega`` (n,): amplitude (in) and phase (rad) of the fitted motion."""

    omega: FloatArray
    amplitude: Curve
    phase: Curve


#: Posteriors by data and variant.
Posteriors = Mapping[tuple[str, str], PlanarPosterior]


def planar_posteriors(seed: int) -> dict[tuple[str, str], PlanarPosterior]:
    """All posteriors, constant noise."""
    posteriors = {}
    for name, variant in (*SAMPLED, *WEIGHTED):
        data, (fixed, extras) = phasors(name), VARIANTS[variant]
        held = {parameter: value for parameter, value in fixed.items() if parameter != "omega_y"}
        prior = PlanarPrior.of(data, PLANES.mass, held, extras)
        if (name, variant) in SAMPLED:
            posteriors[name, variant] = planar_posterior(prior, data, seed)
        else:
            evidence = planar_evidence(prior, data, seed)
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


def fit_band(data: Phasors, posterior: PlanarPosterior) -> PlanarBand:
    """Credible band of the modal motion over the swept frequencies, the force interpolated between the points.

    What is in phase with the force beside the mode (R) is in it where it was fitted, as it is in the data.
    """
    omega = np.linspace(data.omega[0], data.omega[-1], _GRID)
    every = max(1, len(posterior.draws) // _BAND_DRAWS)
    F = np.interp(omega, data.omega, data.F)
    response = pitch_response(posterior.prior.model(posterior.draws[::every]), F, omega)
    phase = np.mod(-np.angle(response) + 0.5 * np.pi, 2.0 * np.pi) - 0.5 * np.pi
    low, median, high = np.quantile(np.abs(response), TAILS, axis=0)
    phase_low, phase_median, phase_high = np.quantile(phase, TAILS, axis=0)
    return PlanarBand(omega, (median, low, high), (phase_median, phase_low, phase_high))


def prior_draws(posterior: PlanarPosterior, seed: int = 0) -> dict[str, FloatArray]:
    """Draws of the prior of the parameters that are free, and of C; theta in degrees."""
    x = np.random.default_rng(seed).standard_normal((_PRIOR_DRAWS, posterior.prior.dimension))
    return replace(posterior, draws=x).parameters
