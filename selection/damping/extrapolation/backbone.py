"""Resonance frequency and mass of a mode against amplitude: the backbone omega(A) as the sweeps show it.

The restoring force beyond the linear spring moves the resonance, omega^2 = omega_n^2 + S/(M A)
(:func:`damping.predict.steady.backbone`). Its law is not among the damping laws, so that it is learnt from the
frequencies of the tested resonances.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from scipy.special import logsumexp, ndtr, ndtri

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.forces.contract import Force
from damping.infer.doubt import FREQUENCY_SCATTER
from damping.infer.observations import Observations
from damping.predict.steady import bisect, resonant_amplitude
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.resonance import tabulate_resonances


@dataclass(frozen=True)
class Interval:
    """Median and central interval, arrays (rows,); NaN where there is none."""

    median: FloatArray
    low: FloatArray
    high: FloatArray

    @staticmethod
    def known(values: FloatArray) -> Interval:
        """Values without doubt."""
        return Interval(values, values, values)

    def form(self, row: int) -> dict[str, float]:
        """One row as ``{"median", "low", "high"}``."""
        return {name: float(getattr(self, name)[row]) for name in ("median", "low", "high")}


#: Change of frequency with amplitude is tried in these powers of amplitude: of a joint that slips in full (S/A in
#: A^-1/2 and below) or in part, of a quadratic and of a cubic spring (A, A^2), and between ...
POWERS = (-0.5, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
#: ... and as joints lose stiffness, never more than they have: of one limit, over the largest tested amplitude, and of
#: limits spread evenly from none to a largest one.
LIMITS = tuple(np.geomspace(0.04, 0.96, 96).tolist())
LARGEST_LIMITS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
#: Prior standard deviations of the relative change of frequency from half the largest tested amplitude to it, or since
#: joints were stuck, alike probable: bolted structures lose a fraction of a per cent to some per cent (Kerschen et al.
#: 2006, section 2).
CHANGES = (3e-4, 3e-3, 3e-2)
#: Prior probability that frequency does not change at all: hardly any structure that is driven harder; and how probable
#: powers, joints of one limit and of many are beside each other: joints of one limit are hardly any that is bolted.
CONSTANT = 0.1
OF_KINDS = (6.0, 1.0, 2.0)
#: Share of the stiffness that joints may lose: from there on ln omega^2 falls in proportion.
MOST_LOST = 0.5
#: Components of the average below this share of the largest are left out.
NEGLIGIBLE = 1e-6
#: Log standard deviation of the relative scatter of a measured frequency: 5 % lie below 2.5e-5, 5 % above 3.5e-3.
FREQUENCY_SCATTER_LOG_SD = 1.5
#: Quantiles of that prior which stand for it.
_SCATTERS = FREQUENCY_SCATTER * np.exp(FREQUENCY_SCATTER_LOG_SD * ndtri((np.arange(16) + 0.5) / 16))
#: A frequency this many times a tested one, or as many times below, is another mode's: none is predicted.
FARTHEST = 2.0
#: Change of the resonance, relative, from which on amplitudes are solved along the backbone: what less of it does is
#: below what a reading errs.
MOVED = 0.02
#: Turns of solving for amplitude and frequency, each going half the way: what is left is 2^-8 of the change at first.
_TURNS = 8
#: Farthest from the tested frequencies, in ln omega, that an amplitude is solved at: beyond is no number.
_FAR = 2.0
#: Step of points that fill the unit interval evenly, however many they are: the golden ratio.
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
#: ln of the amplitude over the largest tested one at which the backbone is tabulated.
_TABLE = np.linspace(-5.0, 5.0, 201)
#: Largest amplitude over the largest tested one that is told from any beyond it: its powers are finite numbers.
_LARGEST = 1e20
#: Prior standard deviation of ln omega at the middle of the test about its mean there: nothing is known before.
_ANYWHERE = 1.0


@dataclass(frozen=True)
class Backbone:
    """Resonance frequency and mass of a mode against amplitude.

    A straight line in a power of amplitude or in what joints lose, or constant, is omega^2, as springs and joints make
    it, but ln omega^2 where it falls in a power, so that not everything lets go: Bayesian linear regression for each of
    `_list_shapes`, ``CHANGES`` and scatters, averaged by evidence.

    Attributes:
        amplitude, omega, mass: of the tested resonances, (sweeps,), rad/s. mass_sd: relative standard uncertainty.
        scatter: of a frequency from sweep to sweep, relative, that the mode states; 0 where it does not.
    """

    amplitude: FloatArray
    omega: FloatArray
    mass: FloatArray
    mass_sd: float
    scatter: float = 0.0

    def frequency_at(self, amplitude: FloatArray, level: float) -> Interval:
        """Frequency in Hz that the next test would read at each amplitude (rows,); NaN beyond ``FARTHEST``."""
        top = float(self.amplitude.max())
        weight, mean, sd = self._mix(np.minimum(np.where(np.isfinite(amplitude), amplitude, top), _LARGEST * top))
        low, high = (mean - 8.0 * sd).min(axis=0), (mean + 8.0 * sd).max(axis=0)

        def quantile(p: float) -> FloatArray:
            return np.exp(bisect(lambda x: weight @ ndtr((x - mean) / sd) - p, low, high)) / RAD_S_PER_HZ

        tail = 0.5 * (1.0 - level)
        median = quantile(0.5)
        tested = RAD_S_PER_HZ * median / np.array([[self.omega.min()], [self.omega.max()]])
        near = np.isfinite(amplitude) & (tested[0] > 1.0 / FARTHEST) & (tested[1] < FARTHEST)
        return Interval(*(np.where(near, f, np.nan) for f in (median, quantile(tail), quantile(1.0 - tail))))

    def solve(self, force: Force, F: FloatArray, omega: float) -> FloatArray:
        """Amplitude (draws, forces) where C(A, omega(A)) = F: of a ``force`` with draws (draws, 1), F (forces,).

        At the frequency ``omega``, rad/s, of the largest tested force, where half of the draws end within ``MOVED`` of
        it. At other forces each draw has a backbone of its own, a fixed number of standard deviations from the mean,
        and its ln omega goes half the way there in each of ``_TURNS``: viscous amplitudes fall as 1/omega, so that this
        converges for any omega in a power of A below the third.
        """
        A = resonant_amplitude(force, F[np.newaxis, :], omega, self.amplitude.max())
        moved = np.nan_to_num(self._log_omega_at(A) - np.log(omega))  # draws without a resonance do not move
        far = np.abs(np.median(moved, axis=0)) > MOVED
        if not far.any():
            return A
        own, F, at = ndtri((np.arange(len(A)) * _GOLDEN + 0.5) % 1.0)[:, np.newaxis], F[np.newaxis, far], A[:, far]
        log_omega = np.full(at.shape, np.log(omega))
        for _ in range(_TURNS):
            log_omega += 0.5 * np.nan_to_num(self._log_omega_at(at, own) - log_omega)
            at = resonant_amplitude(force, F, np.exp(log_omega), at)
        A[:, far] = at
        return A

    def _log_omega_at(self, amplitude: FloatArray, deviation: FloatArray | float = 0.0) -> FloatArray:
        """ln omega at amplitudes of any shape: its mean plus ``deviation`` standard deviations, within ``_FAR``."""
        with np.errstate(over="ignore"):  # an amplitude beyond all numbers is as the largest of the table
            at = np.log(amplitude / self.amplitude.max())
        mean, sd = (np.interp(at, _TABLE, values) for values in self._tabulated)
        tested = np.log(self.omega)
        return np.asarray(np.clip(mean + deviation * sd, tested.max() - _FAR, tested.min() + _FAR))

    @cached_property
    def _tabulated(self) -> tuple[FloatArray, FloatArray]:
        weight, mean, sd = self._mix(self.amplitude.max() * np.exp(_TABLE))
        middle = weight @ mean
        return middle, np.sqrt(weight @ (sd**2 + (mean - middle) ** 2))

    def mass_at(self, amplitude: FloatArray) -> FloatArray:
        """Mass at each amplitude: straight in the logarithms between tested ones, constant beyond."""
        order = np.argsort(self.amplitude, kind="stable")
        return np.exp(np.interp(np.log(amplitude), np.log(self.amplitude[order]), np.log(self.mass[order])))

    def stiffness_at(self, amplitude: FloatArray) -> FloatArray:
        """M omega^2 at each amplitude, as `mass_at`."""
        return replace(self, mass=self.mass * self.omega**2).mass_at(amplitude)

    def _mix(self, amplitude: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Normal components of ln omega at amplitudes (rows,): weights (k,), means and deviations (k, rows)."""
        top, lowest = float(self.amplitude.max()), np.log(self.omega[np.argmin(self.amplitude)])
        risen = 2.0 * (np.log(self.omega) - lowest)
        log_z, means, variances, s = [], [], [], np.hypot(_SCATTERS, self.scatter)
        for shape, mass in _list_shapes():
            X, at = _design(self.amplitude / top, shape), _design(amplitude / top, shape)
            least = -MOST_LOST if isinstance(shape, Loosening) else 0.0  # y is omega^2 from here on, ln omega^2 below
            edge = np.log1p(least)
            y = np.expm1(np.maximum(risen, edge)) + (1.0 + least) * np.minimum(risen - edge, 0.0)
            per_scatter = 2.0 * np.exp(np.maximum(risen, edge))  # dy/d ln omega
            for size in CHANGES if shape else (0.0,):
                V = np.array([_ANYWHERE, 2.0 * size][: X.shape[1]]) ** 2
                z, b, covariance = _regress(X / per_scatter[:, None], y / per_scatter, V, s)
                if isinstance(shape, Loosening):  # half a normal prior: joints do not stiffen
                    z = np.where(b[:, 1] < 0.0, z + np.log(2.0), -np.inf)
                mean, variance = b @ at.T, np.einsum("ij,kjl,il->ki", at, covariance, at)
                log_z.append(np.log(mass / (len(CHANGES) if shape else 1)) + z)
                below = np.minimum(mean - least, 0.0) / (1.0 + least)
                means.append(lowest + 0.5 * (np.log1p(np.maximum(mean, least)) + below))
                variances.append(s[:, None] ** 2 + variance / (2.0 + 2.0 * np.maximum(mean, least)) ** 2)
        evidences = np.concatenate(log_z)
        kept = evidences > evidences.max() + np.log(NEGLIGIBLE)
        weight = np.exp(evidences[kept] - logsumexp(evidences[kept]))
        return weight, np.concatenate(means)[kept], np.sqrt(np.concatenate(variances)[kept])


@dataclass(frozen=True)
class Power:
    """How a resonance changes with the amplitude over the largest tested one, x: as x^p, by one from x = 1/2 to 1."""

    exponent: float

    def __call__(self, x: FloatArray) -> FloatArray:
        """The change since x = 1."""
        return np.asarray((x**self.exponent - 1.0) / (1.0 - 0.5**self.exponent))


@dataclass(frozen=True)
class Loosening:
    """The same by the share of stiffness that joints have ``lost`` at x over their ``limit``, by one up to x = 1."""

    limit: float
    lost: Callable[[FloatArray], FloatArray]

    def __call__(self, x: FloatArray) -> FloatArray:
        """The change since x = 1."""
        return np.asarray(self.lost(x / self.limit) / self.lost(np.array(1.0 / self.limit)) - 1.0)


def _lose_of_one(x: FloatArray) -> FloatArray:
    """1 - (psi - sin psi cos psi)/pi, cos psi = 1 - 2/x, beyond the limit (`damping.forces.joints.Slip`); else 0."""
    cosine = 1.0 - 2.0 / np.maximum(x, 1.0)
    return 1.0 - (np.arccos(cosine) - cosine * np.sqrt(1.0 - cosine**2)) / np.pi


def _lose_of_many(x: FloatArray) -> FloatArray:
    """The mean of `_lose_of_one` over limits from 0 to 1: x/2 up to the largest, then x times its integral over 1/x."""
    cosine = 1.0 - 2.0 / np.maximum(x, 1.0)
    psi, sine = np.arccos(cosine), np.sqrt(1.0 - cosine**2)
    return x * (0.5 * (1.0 - cosine) - (sine - psi * cosine) / (2.0 * np.pi) + sine**3 / (6.0 * np.pi))


@cache
def _list_shapes() -> list[tuple[Power | Loosening | None, float]]:
    """Every shape, None of a constant, with its prior probability."""
    kinds: tuple[list[Power | Loosening], ...] = (
        [Power(exponent) for exponent in POWERS],
        [Loosening(limit, _lose_of_one) for limit in LIMITS],
        [Loosening(limit, _lose_of_many) for limit in LARGEST_LIMITS],
    )
    shares = (1.0 - CONSTANT) * np.array(OF_KINDS) / sum(OF_KINDS)
    return [
        (None, CONSTANT),
        *((shape, own / len(kind)) for kind, own in zip(kinds, shares, strict=True) for shape in kind),
    ]


def _design(x: FloatArray, shape: Power | Loosening | None) -> FloatArray:
    """Columns 1 and the ``shape``, if any, (rows, 1 or 2)."""
    ones = np.ones((len(x), 1))
    return ones if shape is None else np.column_stack([ones, shape(x)])


def _regress(X: FloatArray, y: FloatArray, V: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Regression y = X b + noise of each deviation s (k,), with b ~ N(0, V).

    Returns:
        Log evidence (k,); b (k, columns) and its covariance.
    """
    over = 1.0 / s[:, None] ** 2
    precision = X.T @ X * over[:, None] + np.diag(1.0 / V)
    b = np.asarray(np.linalg.solve(precision, (X.T @ y * over)[..., None])[..., 0])
    misfit = np.sum((y - b @ X.T) ** 2 * over, axis=1) + np.sum(b**2 / V, axis=1)
    log_z = -0.5 * (misfit + np.linalg.slogdet(precision)[1] + np.sum(np.log(V))) - len(y) * np.log(s)
    return log_z, b, np.asarray(np.linalg.inv(precision))


def find_backbone(record: Record, mode: Mode) -> Backbone:
    """Frequencies and masses at the phase resonances of a record.

    The mass is that of the record's rows, else the mode's, known to its tolerance. Frequencies are those of the
    structure without ``added_mass``, whose stiffness is the same, and of several masses
    (:meth:`damping.records.mode.Mode.find_states`) with that of the largest force.
    """
    resonances = tabulate_resonances(record)
    amplitude, frequency = resonances[["amplitude", "frequency"]].to_numpy(float).T
    rows, top = resonances["row"].to_numpy(), int(np.argmax(resonances["force"]))
    mass = record.masses(mode.mass)[rows]
    omega = RAD_S_PER_HZ * frequency * np.sqrt(1.0 + record.added_masses[rows] / mass)
    if np.ptp(state := mode.find_states(mass, len(rows))) > 0.0:
        omega, mass = omega * np.sqrt(state / state[top]), np.full(len(rows), state[top])
    return Backbone(amplitude, omega, mass, mode.tolerance.mass, mode.repeatability.frequency or 0.0)


def observe_backbone(data: Observations, mode: Mode | None) -> Backbone | None:
    """The backbone of the levels that laws rest on; None where all have one frequency. Its mass is of no account.

    Frequencies are those of the structure without added mass and at one mass, where a mode says what it adds to.
    """
    omega, scatter = data.tested_omega, (mode.repeatability.frequency if mode else None) or 0.0
    if mode:
        state, added = mode.find_states(data.tested_mass, len(omega)), data.added_mass
        omega = omega * np.sqrt(state / state[data.top] * (1.0 if added is None else 1.0 + added / state))
    if not np.ptp(omega) > 0.0:
        return None
    return Backbone(data.tested_amplitude, omega, np.ones_like(omega), 0.0, scatter)
