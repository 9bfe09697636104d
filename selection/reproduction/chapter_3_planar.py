"""Least-squares fits of the planar-coupled oscillator to the test of Configuration I, which the report left out.

Two pictures of one test: the modal motion of Table 3.III (``A2``), from which the report had removed rigid-body
rotation and adjacent modes, and the tail motion over the mode factor (``tail``), from which nothing is removed.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import degrees

import numpy as np
import pandas as pd
from scipy.stats import chi2

from selection.arrays import FloatArray
from selection.conditioning.planar import yaw_response
from selection.conditioning.planar_fit import Noise, Phasors, PlanarFit, PlanarModel, fit_planar
from selection.conditioning.principal import viscous_energy
from selection.records.report_tables import load_table
from selection.reproduction.chapter_3 import PLANES
from selection.reproduction.columns import columns

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
    return Phasors.of(amplitude, phase, PLANES.phi * F, omega, noise)


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
    larger = max(fit, free, key=lambda one: len(one.fitted))
    chi_square, freedom = fit.chi_square_over(free), abs(len(free.fitted) - len(fit.fitted))
    left = (1.0 - larger.correlation) / (1.0 + larger.correlation)
    p = [float(chi2.sf(abs(chi_square) * share, freedom)) if freedom else np.nan for share in (1.0, min(1.0, left))]
    return {"chi_square": chi_square, "p_value": p[0], "p_value_correlated": p[1]}


def yaw_amplitude(model: PlanarModel, data: Phasors) -> FloatArray:
    """Amplitude of the yaw motion that a model predicts at the measured points: nothing of it was fitted."""
    return np.abs(yaw_response(model.oscillator, data.F, data.omega))


def yaw_table(fits: Fits) -> pd.DataFrame:
    """Yaw amplitude by point: measured (Table 3.I, tail yaw over the mode factor), and predicted by fits to pitch."""
    motion = load_table("3_I", "corrected")
    omega, yaw = columns(motion, "omega_rad_s", "tail_yaw_disp_in_e2")
    data = phasors("A2")
    predicted = {
        variant: yaw_amplitude(fits["A2", "constant", variant].model, data)
        for variant in ("free", "theta = 28, M = 21", "free + in phase + lag")
    }
    return pd.DataFrame({"point": motion["point"], "omega": omega, "measured": yaw / 100 / PLANES.phi, **predicted})


def energy_split(fits: Fits) -> pd.DataFrame:
    """Share of the energy that the yaw plane takes, in per cent by point: Table 3.IV as printed, and two fits."""
    table = load_table("3_IV").query("corrected_row == 0")
    pitch, yaw = columns(table, "energy_pitch_in_lb", "energy_yaw_in_lb")
    data = phasors("A2")
    shares = {v: _yaw_share(fits["A2", "constant", v].model, data) for v in ("free", "theta = 28, M = 21")}
    printed = 100.0 * yaw / (pitch + yaw)
    return pd.DataFrame({"point": table["point"].to_numpy(), "omega": data.omega, "printed": printed, **shares})


def _yaw_share(model: PlanarModel, data: Phasors) -> FloatArray:
    """Per cent of the energy lost that is lost in the yaw plane, (n,)."""
    M, C, omega_p, omega_y, theta = (float(value) for value in model.oscillator)
    energies = []
    for omega_j, part in ((omega_p, np.cos(theta)), (omega_y, np.sin(theta))):
        A = np.abs(part * data.F / (M * (omega_j**2 - data.omega**2) + 1j * C * data.omega))
        energies.append(viscous_energy(A, M, omega_j, C / (2.0 * M * omega_j), data.omega))
    return np.asarray(100.0 * energies[1] / (energies[0] + energies[1]))
