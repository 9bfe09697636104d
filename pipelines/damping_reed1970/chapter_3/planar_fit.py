"""Fit of the planar-coupled oscillator to measured amplitude and phase together (Eqs. 3.1.24-3.1.35).

The report leaves the solution out of its scope. Here all phasors A exp(-i phi) are fitted at once, by least squares of
the distance between measured and model phasor: circular noise of unknown size. Motion in phase with the force that is
left (other modes, rigid body) and a lag common to all points may be fitted too.

The response along the force stays what it is when theta changes sign and when the two planes change names (omega_p,
omega_y, theta -> omega_y, omega_p, pi/2 - theta). Results carry 0 <= theta <= pi/2 and, where all three are fitted,
omega_p <= omega_y. A "plane" outside the swept frequencies only stands for motion in phase with the force: such minima
are passed over.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from math import degrees
from typing import Literal, get_args

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from scipy.special import chdtrc

from damping.arrays import ComplexArray, FloatArray
from damping.signals import PrincipalPlanes
from damping_reed1970 import columns, load_table
from damping_reed1970.chapter_3 import PLANES, VARIANTS, PlanarOscillator, pitch_response, receptance

Noise = Literal["constant", "proportional"]

PARAMETERS = ("omega_p", "omega_y", "theta", "M", "C")  #: parameters that are always there
#: Parameters that are 0 unless they are asked for.
EXTRAS = ("R", "lag")
_LOGARITHMIC = ("M", "C")  # the minimiser sees their logarithms, so that they stay positive
_GRID_STEPS = 6  #: frequencies of the grid of starts, for each plane: across the swept band
#: Angles of the grid, rad: no end of the range, where the response knows one plane only.
_GRID_THETA = (0.2, 0.6, 1.0)
#: Damping factors of the grid: of launch vehicles, by factors of 3.
_GRID_XI = (0.002, 0.006, 0.02)
_REFINED = 5  # starts that are followed down: the best of the grid


@dataclass(frozen=True)
class Phasors:
    """What is fitted, each (n,)."""

    q: ComplexArray  #: A exp(-i phi)
    F: FloatArray  #: modal force
    omega: FloatArray  #: rad/s
    #: standard deviation of components: one for all, or in proportion to the measured amplitude
    noise: Noise = "constant"

    @property
    def shape(self) -> FloatArray:
        """Standard deviation of each point over the unknown scale sigma, (n,)."""
        return np.abs(self.q) if self.noise == "proportional" else np.ones(self.omega.size)

    def residuals(self, model: PlanarOscillator) -> ComplexArray:
        """(model - measured)/shape (..., n); fields of the model may have shape (..., 1)."""
        return (pitch_response(model, self.F, self.omega) - self.q) / self.shape


@dataclass(frozen=True)
class PlanarFit:
    """A least-squares fit."""

    model: PlanarOscillator  #: theta in rad
    fitted: tuple[str, ...]  #: which of its parameters
    #: by name (``PARAMETERS``, ``EXTRAS``, and xi of the pitch plane), 0 for what was not fitted
    standard_errors: Mapping[str, float]
    residuals: ComplexArray  #: complex, (model - measured)/shape, (n,)
    SSE: float  #: sum of their squares, 2 n numbers

    @property
    def xi(self) -> float:
        """Damping factor of the pitch plane, C/(2 M omega_p) (Eq. 3.1.10)."""
        return float(self.model.C / (2.0 * self.model.M * self.model.omega_p))

    @property
    def planes(self) -> PrincipalPlanes:
        """The principal planes fitted, for Eq. 3.2.15."""
        M, _, omega_p, omega_y, theta = (float(value) for value in self.model[:5])
        return PrincipalPlanes(PLANES.phi, M, omega_p, omega_y, theta)

    @property
    def sigma(self) -> float:
        """Scale of the noise, sqrt(SSE/(2 n - k)) with k parameters fitted."""
        return float(np.sqrt(self.SSE / (2 * self.residuals.size - len(self.fitted))))

    @property
    def correlation(self) -> float:
        """Correlation of neighbouring residuals: near 0 where they are independent, as the standard errors assume."""
        return float(np.real(self.residuals[:-1] @ self.residuals[1:].conj()) / self.SSE)


def fit_planar(data: Phasors, fixed: Mapping[str, float] | None = None, extras: Collection[str] = ()) -> PlanarFit:
    """Least squares from the best of a grid of starts, the best minimum found; phasors in order of frequency.

    ``fixed``: parameters that are not fitted, by name (theta in rad). ``extras``: those of ``EXTRAS`` that are, too.
    """
    fixed = dict(fixed or {})
    free = tuple(name for name in (*PARAMETERS, *EXTRAS) if name in extras or name in set(PARAMETERS) - set(fixed))
    low, high, planes = data.omega.min(), data.omega.max(), {"omega_p", "omega_y"} & set(free)
    fits = [_minimise(data, fixed, free, start) for start in _choose_starts(data, fixed)]
    inside = [fit for fit in fits if all(low <= getattr(fit[1], name) <= high for name in planes)]
    best = min(inside, key=lambda fit: fit[0])[1]
    model = _canonical(best, may_rename={"omega_p", "omega_y", "theta"} <= set(free))
    residuals = data.residuals(model)
    SSE = float(np.sum(np.abs(residuals) ** 2))
    variance = SSE / (2 * data.omega.size - len(free))
    jacobian = _real(_jacobian(data, model, free))
    length = np.linalg.norm(jacobian, axis=0)
    singular, directions = np.linalg.svd(jacobian / length, full_matrices=False)[1:]
    inverse = (directions.T / singular**2) @ directions / np.outer(length, length)  # of J^T J
    return PlanarFit(model, free, _standard_errors(model, free, variance * inverse), residuals, SSE)


def _choose_starts(data: Phasors, fixed: Mapping[str, float]) -> list[PlanarOscillator]:
    """The best points of a grid: planes across the swept band, angles, damping; the mass that fits the largest peak."""
    band = np.linspace(data.omega.min(), data.omega.max(), _GRID_STEPS)
    rates = 2.0 * np.array(_GRID_XI) * band.mean()  # C/M
    axes = {"omega_p": band, "omega_y": band, "theta": np.array(_GRID_THETA), "rate": rates}
    axes |= {name: np.array([fixed[name]]) for name in axes if name in fixed}
    omega_p, omega_y, theta, rate = (axis.reshape(-1, 1) for axis in np.meshgrid(*axes.values()))
    response = pitch_response(PlanarOscillator(1.0, rate, omega_p, omega_y, theta), data.F, data.omega)
    M = np.abs(response).max(axis=1, keepdims=True) / np.abs(data.q).max()
    M = np.full_like(M, fixed["M"]) if "M" in fixed else M
    C = np.full_like(M, fixed["C"]) if "C" in fixed else rate * M
    misfit = np.sum(np.abs(data.residuals(PlanarOscillator(M, C, omega_p, omega_y, theta))) ** 2, axis=1)
    # two equal planes are one, of any angle: no start
    misfit = np.where((omega_p == omega_y)[:, 0], np.inf, misfit)
    best = np.argsort(misfit, kind="stable")[:_REFINED]
    return [PlanarOscillator(*row) for row in np.hstack([M, C, omega_p, omega_y, theta])[best].tolist()]


def _minimise(
    data: Phasors, fixed: Mapping[str, float], free: tuple[str, ...], start: PlanarOscillator
) -> tuple[float, PlanarOscillator]:
    """Half the sum of squares and the model at the minimum below ``start``."""
    logarithmic = np.array([name in _LOGARITHMIC for name in free])

    def model(x: FloatArray) -> PlanarOscillator:
        values = np.where(logarithmic, np.exp(np.where(logarithmic, x, 0.0)), x)
        return start._replace(**fixed, **dict(zip(free, values.tolist(), strict=True)))

    def residuals(x: FloatArray) -> FloatArray:
        return _real(data.residuals(model(x)))

    def jacobian(x: FloatArray) -> FloatArray:
        at = model(x)
        chain = [getattr(at, name) if name in _LOGARITHMIC else 1.0 for name in free]
        return _real(_jacobian(data, at, free)) * chain

    x = np.array([getattr(start, name) for name in free])
    x = np.where(logarithmic, np.log(np.where(logarithmic, x, 1.0)), x)
    # no test on the gradient: its size depends on the units of the amplitudes
    result = least_squares(residuals, x, jac=jacobian, x_scale="jac", max_nfev=200, ftol=1e-13, xtol=1e-12, gtol=None)
    return float(result.cost), model(result.x)


def _jacobian(data: Phasors, model: PlanarOscillator, free: tuple[str, ...]) -> ComplexArray:
    """Derivatives of the residuals by the parameters ``free``, (n, k)."""
    M, C, omega_p, omega_y, theta, _, lag = model
    omega, along, across, turn = data.omega, np.cos(theta) ** 2, np.sin(theta) ** 2, np.exp(-1j * lag)
    p, y = receptance(M, C, omega_p, omega), receptance(M, C, omega_y, omega)
    by_name = {
        "omega_p": -along * 2.0 * M * omega_p * p**2 * turn,
        "omega_y": -across * 2.0 * M * omega_y * y**2 * turn,
        "theta": np.sin(2.0 * theta) * (y - p) * turn,
        "M": -(along * (omega_p**2 - omega**2) * p**2 + across * (omega_y**2 - omega**2) * y**2) * turn,
        "C": -1j * omega * (along * p**2 + across * y**2) * turn,
        "R": np.ones(omega.size),
        "lag": -1j * (along * p + across * y) * turn,
    }
    return np.stack([data.F * by_name[name] / data.shape for name in free], axis=-1)


def _real(values: ComplexArray) -> FloatArray:
    """Real parts, then imaginary parts, along the first axis."""
    return np.concatenate([values.real, values.imag])


def _standard_errors(model: PlanarOscillator, free: tuple[str, ...], covariance: FloatArray) -> dict[str, float]:
    """Of every parameter and, by its first derivatives, of xi."""
    of_free = dict(zip(free, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    xi, powers = model.C / (2.0 * model.M * model.omega_p), {"C": 1.0, "M": -1.0, "omega_p": -1.0}
    gradient = np.array([powers[name] * xi / getattr(model, name) if name in powers else 0.0 for name in free])
    of_all = {name: of_free.get(name, 0.0) for name in (*PARAMETERS, *EXTRAS)}
    return {**of_all, "xi": float(np.sqrt(gradient @ covariance @ gradient))}


def _canonical(model: PlanarOscillator, may_rename: bool) -> PlanarOscillator:
    """The model of the same response with 0 <= theta <= pi/2 and, where the planes may be renamed, omega_p first."""
    theta = abs(float(np.arcsin(np.sin(model.theta))))
    if may_rename and model.omega_p > model.omega_y:
        return model._replace(omega_p=model.omega_y, omega_y=model.omega_p, theta=0.5 * np.pi - theta)
    return model._replace(theta=theta)


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


Fits = Mapping[tuple[str, str, str], PlanarFit]  #: fits by data, noise and variant


def planar_fits() -> dict[tuple[str, str, str], PlanarFit]:
    """All fits of both pictures with both noises."""
    return {
        (name, noise, variant): fit_planar(phasors(name, noise), *arguments)
        for name in ("A2", "tail")
        for noise in get_args(Noise)
        for variant, arguments in VARIANTS.items()
    }


def fit_table(fits: Fits) -> pd.DataFrame:
    """One row for each fit: parameters with standard errors (``_se``; theta in degrees), quality, :func:`comparison`.

    ``in_phase_in``: motion R F at the mean force.
    """
    rows = []
    for (name, noise, variant), fit in fits.items():
        force = float(phasors(name).F.mean())
        labels = {"theta": ("theta_degrees", degrees(1.0)), "R": ("in_phase_in", force), "lag": ("lag_rad", 1.0)}
        values = {**fit.model._asdict(), "xi": fit.xi}
        row: dict[str, float | str] = {"data": name, "noise": noise, "fit": variant}
        for parameter in ("omega_p", "omega_y", "theta", "M", "C", "xi", "R", "lag"):
            label, scale = labels.get(parameter, (parameter, 1.0))
            row |= {label: scale * float(values[parameter]), f"{label}_se": scale * fit.standard_errors[parameter]}
        if variant == "one plane":
            row["omega_y"] = np.nan
        quality = {"sigma": fit.sigma, "SSE": fit.SSE, "correlation": fit.correlation, "parameters": len(fit.fitted)}
        rows.append({**row, **quality, **comparison(fit, fits[name, noise, "free"])})
    return pd.DataFrame(rows)


def comparison(fit: PlanarFit, free: PlanarFit) -> dict[str, float]:
    """A fit against another that contains it or is contained.

    ``chi_square`` = 2 n ln(SSE/SSE of ``free``), twice the log ratio of likelihoods with sigma of each at its maximum,
    negative where the fit has more parameters; ``p_value`` of its size
    with the difference in parameters as degrees of freedom; ``p_value_correlated`` with chi_square reduced for the
    correlation r of neighbouring residuals, by (1 - r)/(1 + r) of the larger model.
    """
    larger = max(fit, free, key=lambda either: len(either.fitted))
    chi_square = float(2 * fit.residuals.size * np.log(fit.SSE / free.SSE))
    freedom = abs(len(free.fitted) - len(fit.fitted))
    left = (1.0 - larger.correlation) / (1.0 + larger.correlation)
    p = [float(chdtrc(freedom, abs(chi_square) * share)) if freedom else np.nan for share in (1.0, min(1.0, left))]
    return {"chi_square": chi_square, "p_value": p[0], "p_value_correlated": p[1]}
