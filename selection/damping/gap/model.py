"""A hypothesis as a model of the record: standard normal variables in, whitened residuals and their Jacobian out.

Variables y = (x, z): x are the simulation's parameters in units of tolerance and the effects' strengths and shapes,
z the deviations of gain and frequency of every sweep in units of repeatability. All have the prior N(0, 1).

Residuals are those of ln amplitude and of phase in units of noise. The prediction P is taken at an ln amplitude u0: the
measured one, or the noise-free one of an earlier fit (``at``). The steady amplitude u* = Re P(u*) is, to first order,

    u0 - u* = (u0 - Re P(u0))/d,   d = 1 - Re P'(u0),      phase* = -Im P(u0) + Im P'(u0) (u0 - u*).

Where a branch folds, d = 0 and the amplitude is infinitely sensitive; ``FOLD`` bounds the sensitivity there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi
from typing import NamedTuple

import numpy as np

from damping.arrays import ComplexArray, FloatArray, wrap_lag
from damping.effects import with_effects
from damping.effects.contract import Form, Scales, Terms
from damping.effects.rig import recorded_third
from damping.effects.terms import Prediction, cross_motion, predict
from damping.gap.rows import PhasorRows
from damping.gap.simulation import Simulation

FOLD = 0.05  #: regularisation of |d|: noise of force and frequency hides a sharper fold
NEAR = 5.0  #: farthest from the measured amplitude, in units of noise, at which a prediction is taken
#: Step of difference quotients in standard normal variables: a relative 1e-4 of a parameter or less.
STEP = 1e-4
#: Prior of the strength of an effect: ln of the gap it opens, in units of noise, is N(ln 3, 1.5^2); 2 sigma: .15 to 60.
TYPICAL_GAP = 3.0
SPREAD = 1.5
_SKEW = 0.1  #: largest share of the motion that a cross-axis channel picks up by misalignment
_MOST_STEPS = 40  #: most steps of Newton's method for a steady state
_LONGEST = 0.5  #: its longest step in ln A
_CONVERGED = 1e-10  #: its misfit in ln A at convergence


@dataclass(frozen=True)
class Scatter:
    """Repeatability: relative standard deviations of gain and frequency from sweep to sweep; and factors on noise."""

    amplitude: float
    frequency: float
    noise: float = 1.0  #: actual over estimated noise of amplitudes and phases
    dispersion: float = 1.0  #: residuals of even the best explanation over noise
    correlation: float = 0.0  #: of the errors of neighbouring rows, of amplitudes and phases likewise

    @property
    def factor(self) -> float:
        """Product of both factors on noise."""
        return self.noise * self.dispersion


@dataclass(frozen=True)
class Problem:
    """A record, the simulation it is compared with, and the scales of both."""

    rows: PhasorRows
    simulation: Simulation
    scales: Scales


@dataclass(frozen=True)
class Part:
    """A form of an effect; strength ``unit`` opens a gap of one unit of noise."""

    form: Form
    unit: float

    @property
    def size(self) -> int:
        """Number of variables."""
        return 1 + len(self.form.shapes)

    def values(self, x: FloatArray) -> list[FloatArray]:
        """Strength and shapes at variables x (batch, size), each (batch, 1)."""
        strength = self.unit * TYPICAL_GAP * np.exp(SPREAD * x[:, :1])
        if np.isfinite(self.form.largest):
            strength = strength / (1.0 + strength / self.form.largest)
        shapes = [shape.value(x[:, k + 1 : k + 2]) for k, shape in enumerate(self.form.shapes)]
        return [strength, *(np.asarray(value) for value in shapes)]


class Sensitivity(NamedTuple):
    """Sensitivity of residuals to small changes of ln(prediction), at each row, (batch, n) each.

    A change T of P moves the residual of ln amplitude by -Re T ``per_sd`` and the phase by Im T + ``follow`` Re T. The
    ``further`` residuals of each row, those of other channels, are taken not to change.
    """

    per_sd: FloatArray
    follow: FloatArray
    sd_phase: FloatArray | None
    further: int = 0

    def columns(self, T: ComplexArray) -> FloatArray:
        """Changes of the residuals, (.., m), by changes T (.., n) of ln(prediction)."""
        changes = [-T.real * self.per_sd]
        if self.sd_phase is not None:
            changes.append((T.imag + self.follow * T.real) / self.sd_phase)
        return np.concatenate(changes + [np.zeros_like(changes[0])] * self.further, axis=-1)


@dataclass(frozen=True)
class Residuals:
    """Residuals r (batch, m) in units of noise, amplitudes first."""

    r: FloatArray
    sensitivity: Sensitivity  #: to changes of the ``prediction``, whose steady ln amplitude u* is ``motion``
    prediction: Prediction
    motion: FloatArray
    stride: int = 1  #: of the models in the batch that have a derivative by ln omega_n

    def by_sweep(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives by ln of the gain and of omega_n, (batch/k, m) each, of models 0, k, 2k ..., k = ``stride``."""
        strided, step = self.sensitivity, self.stride
        strided = strided._replace(per_sd=strided.per_sd[::step], follow=strided.follow[::step])
        by_gain = np.zeros_like(self.r[::step])
        by_gain[:, : self.motion.shape[1]] = (self.prediction.by_u[::step].real - 1.0) * strided.per_sd
        return by_gain, strided.columns(self.prediction.by_frequency)


@dataclass(frozen=True)
class Model:
    """The simulation with effects, on a record; ``at``: ln amplitudes (n,) at which predictions are taken."""

    problem: Problem
    parts: tuple[Part, ...]
    scatter: Scatter
    at: FloatArray | None = field(default=None, compare=False)

    @cached_property
    def size(self) -> int:
        """Number of variables x."""
        return len(self.problem.simulation.names) + sum(part.size for part in self.parts)

    @property
    def sweeps(self) -> int:
        """Number of sweeps; z has twice as many entries, gains first."""
        return len(self.problem.rows.sweeps)

    def own_variables(self, x: FloatArray) -> Iterator[tuple[Part, FloatArray]]:
        """Each part with its variables (batch, part.size), from those of the model (batch, size or more)."""
        start = len(self.problem.simulation.names)
        for part in self.parts:
            yield part, x[:, start : start + part.size]
            start += part.size

    def terms(self, x: FloatArray) -> Terms:
        """The terms at variables x (batch, size)."""
        simulation = self.problem.simulation
        terms = simulation.terms(x[:, : len(simulation.names)])
        for part, variables in self.own_variables(x):
            terms = part.form.change(terms, *part.values(variables))
        return with_effects(terms, simulation.mode.effects)

    def residuals(self, y: FloatArray, stride: int = 1) -> Residuals:
        """Residuals at variables y (batch, size + 2 sweeps)."""
        z = y[:, self.size :]
        return residuals(self.terms(y[:, : self.size]), self.problem.rows, z, self.scatter, self.at, stride)

    def at_motion(self, y: FloatArray) -> Model:
        """The model with predictions at the motion that it predicts at y (size + 2 sweeps,), at most ``NEAR`` away."""
        rows = self.problem.rows
        predicted = self.residuals(y[np.newaxis])
        near = np.clip(predicted.motion[0], rows.u - NEAR * rows.sd_amplitude, rows.u + NEAR * rows.sd_amplitude)
        return replace(self, at=near)

    def jacobian(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals r (batch, m) and dr/dy (batch, m, size + 2 sweeps): by differences in x, in closed form in z."""
        batch, size = len(y), self.size
        points = y[:, np.newaxis] + STEP * np.eye(size + 1, y.shape[1], -1)
        moved = self.residuals(points.reshape(batch * (size + 1), -1), size + 1)
        r = moved.r.reshape(batch, size + 1, -1)
        J = np.zeros((batch, r.shape[2], y.shape[1]))
        J[:, :, :size] = np.swapaxes((r[:, 1:] - r[:, :1]) * (1.0 / STEP), 1, 2)
        by_gain, by_frequency = moved.by_sweep()
        value, gain = np.arange(r.shape[2]), size + self.problem.rows.sweep_of_values
        J[:, value, gain] = by_gain * self.scatter.amplitude
        J[:, value, gain + self.sweeps] = by_frequency * self.scatter.frequency
        return r[:, 0], J


def residuals(
    terms: Terms, rows: PhasorRows, z: FloatArray, scatter: Scatter, at: FloatArray | None = None, stride: int = 1
) -> Residuals:
    """Residuals of terms (batch, 1) with deviations z (batch, 2 sweeps) of gain and frequency.

    ``at``: ln amplitudes (n,) at which the prediction is taken; the measured ones where not given. ``stride``: of the
    models whose derivatives by sweep are needed.
    """
    u0 = rows.u if at is None else at
    prediction = predict(deviated(terms, rows, z, scatter), u0, rows.drive, stride)
    d = 1.0 - prediction.by_u.real
    squared = d * d + FOLD**2
    misfit = u0 - prediction.u
    motion = u0 - misfit * d / squared
    sd_phase = rows.sd_phase * scatter.factor
    per_sd = 1.0 / (np.sqrt(squared) * rows.sd_amplitude * scatter.factor)
    follow = prediction.by_u.imag * d / squared
    further = 2 * len(rows.channels)
    sensitivity = Sensitivity(per_sd, follow, sd_phase if rows.has_phase else None, further)
    parts = [(misfit if at is None else misfit + (rows.u - u0) * d) * per_sd]
    phase = follow * misfit - prediction.turned
    if rows.has_phase:
        parts.append(wrap_lag(rows.phase - phase, -pi) / sd_phase)
    if rows.channels:
        parts += _further(terms, rows, motion, phase, scatter)
    return Residuals(np.concatenate(parts, axis=1), sensitivity, prediction, motion, stride)


def _further(terms: Terms, rows: PhasorRows, u: FloatArray, phase: FloatArray, scatter: Scatter) -> list[FloatArray]:
    """Residuals of the further channels, (batch, n) each: real parts, then imaginary ones."""
    u = np.clip(u, rows.u - NEAR, rows.u + NEAR)
    parts: list[FloatArray] = []
    for channel in rows.channels:
        if channel == "third":
            misfit = recorded_third(terms, u, phase, rows.drive) - rows.third
        else:
            misfit = _cross(terms, rows, np.exp(u - terms.gain), phase)
        misfit = misfit / (getattr(rows, f"sd_{channel}") * scatter.dispersion)
        parts += [misfit.real, misfit.imag]
    return parts


def _cross(terms: Terms, rows: PhasorRows, A: FloatArray, phase: FloatArray) -> ComplexArray:
    """Measured less predicted cross-axis motion.

    The sense of the planes' rotation and the misalignment of the channel are unknown: both are fitted.
    """
    weight = 1.0 / rows.sd_cross
    across, along = cross_motion(terms, A, rows.drive) * weight, A * np.exp(-1j * phase) * weight
    measured = rows.cross * weight
    sense = np.where(np.sum((across * measured.conj()).real, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    misfit = measured - sense * across
    size = np.maximum(np.sum(np.abs(along) ** 2, axis=-1, keepdims=True), 1e-300)
    skew = np.clip(np.sum((misfit * along.conj()).real, axis=-1, keepdims=True) / size, -_SKEW, _SKEW)
    return np.asarray((misfit - skew * along) * rows.sd_cross)


def deviated(terms: Terms, rows: PhasorRows, z: FloatArray, scatter: Scatter) -> Terms:
    """The terms with each sweep's deviation of gain and frequency, values (batch, n)."""
    sweeps = len(rows.sweeps)
    gain = terms.gain + (scatter.amplitude * z[:, :sweeps]).take(rows.sweep, axis=1)
    factor = np.exp(scatter.frequency * z[:, sweeps:]).take(rows.sweep, axis=1)
    return terms._replace(gain=gain, omega_n=terms.omega_n * factor)


class Motion(NamedTuple):
    """ln of the amplitude and the phase lag (rad) of a steady state, (n,) each."""

    u: FloatArray
    phase: FloatArray


def steady(terms: Terms, rows: PhasorRows, u: FloatArray) -> Motion:
    """The steady states nearest to ln amplitudes u, (n,): Newton's method on u = Re P(u), steps bounded.

    ``terms`` holds values (1, 1) or (1, n). Without convergence: the amplitude of least misfit among the iterates.
    """
    best, least = u.copy(), np.full(len(u), np.inf)
    for _ in range(_MOST_STEPS):
        prediction = predict(terms, u, rows.drive)
        misfit = u - prediction.u[0]
        closer = np.abs(misfit) < least
        best, least = np.where(closer, u, best), np.where(closer, np.abs(misfit), least)
        if np.all(least < _CONVERGED):
            break
        d = 1.0 - prediction.by_u.real[0]
        u = u - np.clip(misfit * d / (d * d + FOLD**4), -_LONGEST, _LONGEST)
    return Motion(best, -predict(terms, best, rows.drive).turned[0])
