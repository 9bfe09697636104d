"""Resonance frequency and mass of a mode against amplitude: the backbone omega(A) that the sweeps show.

The restoring force beyond the linear spring moves the resonance, omega^2 = omega_n^2 + S/(M A)
(:func:`damping.predict.steady.backbone`). The damping laws do not contain it: it is estimated from the frequencies of
the tested resonances.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.special import logsumexp, ndtr, ndtri

from damping.arrays import RAD_S_PER_HZ, BoolArray, FloatArray, interpolate_logs
from damping.extrapolation.loosening import NO_CHANGE, Change, Loosening, list_kinds
from damping.forces.contract import Force
from damping.infer.discrepancy import FREQUENCY_SCATTER
from damping.infer.observations import Observations
from damping.predict.steady import bracketed_newton, resonant_amplitude
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.resonance import tabulate_resonances


@dataclass(frozen=True)
class Interval:
    """Median and central interval, arrays (rows,); NaN where undefined."""

    median: FloatArray
    low: FloatArray
    high: FloatArray

    @staticmethod
    def known(values: FloatArray) -> Interval:
        """The interval of values without uncertainty."""
        return Interval(values, values, values)

    def form(self, row: int) -> dict[str, float]:
        """One row as ``{"median", "low", "high"}``."""
        return {name: float(getattr(self, name)[row]) for name in ("median", "low", "high")}


#: Prior standard deviations, equally probable, of the relative change of frequency from half the largest tested
#: amplitude to the largest, or since joints were stuck: bolted structures lose a fraction of a per cent to some per
#: cent (Kerschen et al. 2006, section 2).
CHANGES = (3e-4, 3e-3, 3e-2)
MOST_LOST = 0.5  #: share of the stiffness that joints may lose: beyond it ln omega^2 falls in proportion
#: Components of the average with a weight below this share of the largest are left out.
NEGLIGIBLE = 1e-6
#: Log standard deviation of the relative scatter of a measured frequency: 5 % lie below 2.5e-5, 5 % above 3.5e-3.
FREQUENCY_SCATTER_LOG_SD = 1.5
#: Quantiles that represent that prior.
_SCATTERS = FREQUENCY_SCATTER * np.exp(FREQUENCY_SCATTER_LOG_SD * ndtri((np.arange(16) + 0.5) / 16))
#: Factor from every tested frequency beyond which a frequency belongs to another mode. No frequency is predicted
#: where it or an end of its band lies beyond.
ANOTHER_MODE = 2.0
#: Relative change of the resonance above which amplitudes are solved along the backbone: the effect of a smaller
#: change is below the error of a reading.
MOVED = 0.02
#: Iterations for amplitude and frequency, each going half the way: the remaining change is 2^-8 of the first.
_TURNS = 8
#: Largest distance from the tested frequencies, in ln omega, at which an amplitude is solved: beyond it is clipped.
_FAR = 2.0
#: Step of points that fill the unit interval evenly, whatever their number: the golden ratio.
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
#: ln of the amplitudes, over the largest tested one, at which the backbone is tabulated.
_TABLE = np.linspace(-5.0, 5.0, 201)
_STEP = _TABLE[1] - _TABLE[0]
#: Amplitudes, over the largest tested one, are clipped here and at its inverse so that their powers are finite numbers.
_LARGEST = 1e20
_AT_ONCE = 20  #: amplitudes computed at once: the components of each, up to four thousand, take 300 kB
_ANYWHERE = 1.0  #: prior standard deviation of the intercept of a regression: practically no prior knowledge


@dataclass(frozen=True)
class Backbone:
    """Resonance frequency and mass of a mode against amplitude.

    omega^2 is constant, or linear in a power of amplitude or in the stiffness that joints have lost, as springs and
    joints make it. Where it falls with a power, ln omega^2 is linear instead, so that stiffness stays positive. A
    Bayesian linear regression for each change (`list_kinds`), size (``CHANGES``) and scatter is averaged by evidence.
    """

    amplitude: FloatArray  #: of the tested resonances, (sweeps,)
    omega: FloatArray  #: of the tested resonances, rad/s, (sweeps,)
    mass: FloatArray  #: of the tested resonances, (sweeps,)
    mass_sd: float  #: relative standard uncertainty
    scatter: float = 0.0  #: relative, of a frequency from sweep to sweep, as the mode states it; 0 if it does not

    def frequency_at(self, amplitude: FloatArray, level: float) -> Interval:
        """Frequency in Hz that the next test would read at each amplitude (rows,); NaN beyond ``ANOTHER_MODE``."""
        top = float(self.amplitude.max())
        within = top * np.clip(np.where(np.isfinite(amplitude), amplitude / top, 1.0), 1.0 / _LARGEST, _LARGEST)
        tail = 0.5 * (1.0 - level)
        log_omega = self._by_blocks(partial(_find_quantiles, np.array([0.5, tail, 1.0 - tail])), within)
        with np.errstate(over="ignore", under="ignore"):  # ends that the uncertainty of the readings leaves open
            median, low, high = np.exp(log_omega) / RAD_S_PER_HZ
        near = np.isfinite(amplitude) & (low > 0.0) & np.isfinite(high) & self.is_near(median)
        return Interval(*(np.where(near, f, np.nan) for f in (median, low, high)))

    def is_near(self, frequency: FloatArray) -> BoolArray:
        """Whether frequencies in Hz lie within ``ANOTHER_MODE`` of the tested ones; False for NaN."""
        omega = RAD_S_PER_HZ * frequency
        return np.asarray((omega > self.omega.min() / ANOTHER_MODE) & (omega < self.omega.max() * ANOTHER_MODE))

    def solve(self, force: Force, F: FloatArray, omega: float) -> FloatArray:
        """Amplitude (draws, forces) where C(A, omega(A)) = F, for a ``force`` with draws (draws, 1) and F (forces,).

        It is solved at the frequency ``omega``, rad/s, of the largest tested force. At forces where the median draw
        moves by more than ``MOVED``, each draw has a backbone a fixed number of standard deviations from the mean,
        and ln omega goes half the way there in each of ``_TURNS`` iterations. Viscous amplitudes fall as 1/omega, so
        this converges if omega is a power of A below the third.
        """
        A = resonant_amplitude(force, F[np.newaxis, :], omega, self.amplitude.max())
        moved = np.nan_to_num(self._log_omega_at(A) - np.log(omega))  # draws without a resonance do not move
        far = np.abs(np.median(moved, axis=0)) > MOVED
        if not far.any():
            return A
        sds, F, A_far = ndtri((np.arange(len(A)) * _GOLDEN + 0.5) % 1.0)[:, np.newaxis], F[np.newaxis, far], A[:, far]
        log_omega = np.full(A_far.shape, np.log(omega))
        for _ in range(_TURNS):
            log_omega += 0.5 * np.nan_to_num(self._log_omega_at(A_far, sds) - log_omega)
            A_far = resonant_amplitude(force, F, np.exp(log_omega), A_far)
        A[:, far] = A_far
        return A

    def _log_omega_at(self, amplitude: FloatArray, deviation: FloatArray | float = 0.0) -> FloatArray:
        """ln omega at amplitudes of any shape: mean plus ``deviation`` standard deviations, clipped by ``_FAR``."""
        mean, sd = self._tabulated
        with np.errstate(over="ignore"):  # an infinite amplitude counts as the largest of the table
            at_largest = np.log(amplitude / self.amplitude.max())
        place = np.clip((at_largest - _TABLE[0]) / _STEP, 0.0, len(_TABLE) - 1.0)
        before = np.minimum(np.nan_to_num(place).astype(np.int64), len(_TABLE) - 2)
        share, tested = place - before, np.log(self.omega)
        at = mean[before] + share * np.diff(mean)[before]
        if np.any(deviation):
            at = at + deviation * (sd[before] + share * np.diff(sd)[before])
        return np.asarray(np.clip(at, tested.max() - _FAR, tested.min() + _FAR))

    @cached_property
    def _tabulated(self) -> FloatArray:
        """Mean and standard deviation of ln omega over the table, (2, points)."""
        return self._by_blocks(_find_moments, self.amplitude.max() * np.exp(_TABLE))

    def _by_blocks(self, work: Callable[..., FloatArray], amplitude: FloatArray) -> FloatArray:
        """``work`` on the components of `_mix` at amplitudes (rows,), results (..., rows) of ``_AT_ONCE`` at a time."""
        blocks = np.array_split(amplitude, max(1, -(-amplitude.size // _AT_ONCE)))
        return np.concatenate([work(*self._mix(block)) for block in blocks], axis=1)

    def mass_at(self, amplitude: FloatArray) -> FloatArray:
        """Mass at each amplitude: linear in the logarithms between tested amplitudes, constant beyond."""
        order = np.argsort(self.amplitude, kind="stable")
        return interpolate_logs(amplitude, self.amplitude[order], self.mass[order])

    def stiffness_at(self, amplitude: FloatArray) -> FloatArray:
        """M omega^2 at each amplitude, interpolated as in `mass_at`."""
        return replace(self, mass=self.mass * self.omega**2).mass_at(amplitude)

    @cached_property
    def _regressions(self) -> list[tuple[Sequence[Change], float, FloatArray, FloatArray, FloatArray]]:
        """Of each kind: the changes, the knee of y, and from `_regress` log evidence (with prior), b, covariance."""
        top, lowest = float(self.amplitude.max()), np.log(self.omega[np.argmin(self.amplitude)])
        risen = 2.0 * (np.log(self.omega) - lowest)
        regressions = []
        for changes, priors in list_kinds():
            at_levels = np.array([change(self.amplitude / top) for change in changes])
            of_joints = isinstance(changes[0], Loosening)
            knee = -MOST_LOST if of_joints else 0.0  # y is omega^2 from here on, ln omega^2 below
            edge = np.log1p(knee)
            y = np.expm1(np.maximum(risen, edge)) + (1.0 + knee) * np.minimum(risen - edge, 0.0)
            per_scatter = 2.0 * np.exp(np.maximum(risen, edge))  # dy/d ln omega
            sizes = np.array([0.0] if changes[0] is NO_CHANGE else CHANGES)
            scaled = at_levels / per_scatter, 1.0 / per_scatter, y / per_scatter
            z, b, covariance = _regress(*scaled, sizes, self._scatters)
            if of_joints:  # half a normal prior: joints do not stiffen
                z = np.where(b[..., 1] < 0.0, z + np.log(2.0), -np.inf)
            z = z + np.log(priors / len(sizes))[:, None, None]
            regressions.append((changes, knee, z, b, covariance))
        return regressions

    @property
    def _scatters(self) -> FloatArray:
        """Relative scatters of a frequency that are averaged over, (scatters,)."""
        return np.hypot(_SCATTERS, self.scatter)

    def _mix(self, amplitude: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Normal components of ln omega at amplitudes (rows,): weights (k,), means and deviations (k, rows)."""
        top, lowest = float(self.amplitude.max()), np.log(self.omega[np.argmin(self.amplitude)])
        cutoff = max(float(z.max()) for _, _, z, _, _ in self._regressions) + np.log(NEGLIGIBLE)
        log_z, means, variances = [], [], []
        for changes, knee, z, b, covariance in self._regressions:
            which, size, scatter = np.nonzero(z > cutoff)
            b, (var_0, cov, var_1) = b[which, size, scatter], covariance[:, which, size, scatter, None]
            x = np.array([change(amplitude / top) for change in changes])[which]
            mean, variance = b[:, :1] + b[:, 1:] * x, var_0 + x * (2.0 * cov + x * var_1)
            log_z.append(z[which, size, scatter])
            below = np.minimum(mean - knee, 0.0) / (1.0 + knee)
            means.append(lowest + 0.5 * (np.log1p(np.maximum(mean, knee)) + below))
            variances.append(self._scatters[scatter, None] ** 2 + variance / (2.0 + 2.0 * np.maximum(mean, knee)) ** 2)
        evidences = np.concatenate(log_z)
        weight = np.exp(evidences - logsumexp(evidences))
        return weight, np.concatenate(means), np.sqrt(np.concatenate(variances))


def _find_moments(weight: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    """Mean and standard deviation, (2, rows), of mixtures of normals as in `_find_quantiles`."""
    middle = weight @ mean
    return np.array([middle, np.sqrt(weight @ (sd**2 + (mean - middle) ** 2))])


def _find_quantiles(p: FloatArray, weight: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    """Quantiles p (quantiles,) of mixtures of normals of weights (k,), means and deviations (k, rows)."""
    z = ndtri(p)[:, None]
    of_each = mean + z[..., None] * sd  # a quantile of the mixture lies between those of its components
    low, high = of_each.min(axis=1), of_each.max(axis=1)
    middle, width = _find_moments(weight, mean, sd)
    start = middle + z * width

    def excess(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        z = (x[:, None, :] - mean) / sd
        density = weight @ (np.exp(-0.5 * z * z) / sd) / np.sqrt(2.0 * np.pi)
        return weight @ ndtr(z) - p[:, None], density

    return bracketed_newton(excess, low, high, np.clip(start, low, high), rising=True)


def _regress(
    x: FloatArray, c: FloatArray, y: FloatArray, sizes: FloatArray, s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Regression y = b_0 c + b_1 x + noise of standard deviation s (scatters,), for every x (shapes, levels) and size.

    b_0 ~ N(0, ``_ANYWHERE``^2), b_1 ~ N(0, (2 size)^2), with ``sizes`` (sizes,). The size is 0 only if x is: b_1 is 0.

    Returns:
        Log evidence (shapes, sizes, scatters); b (.., 2); (3, ..): variance of b_0, covariance, variance of b_1.
    """
    w, V = s**-2.0, np.where(sizes > 0.0, 2.0 * sizes, 1.0)[:, None] ** 2  # if b_1 is 0, any variance will do
    p = c @ c * w + _ANYWHERE**-2.0  # precision, (scatters,) and below (shapes, sizes, scatters)
    q = (x @ c)[:, None, None] * w * np.ones_like(V)
    r = np.sum(x * x, axis=1)[:, None, None] * w + 1.0 / V
    u, v = c @ y * w, (x @ y)[:, None, None] * w
    det = p * r - q * q
    b = np.stack([(r * u - q * v) / det, (p * v - q * u) / det], axis=-1)
    residual = y - b[..., :1] * c - b[..., 1:] * x[:, None, None, :]
    prior = (b[..., 0] / _ANYWHERE) ** 2 + b[..., 1] ** 2 / V
    misfit = np.sum(residual**2, axis=-1) * w + prior
    log_V = 2.0 * np.log(_ANYWHERE) + np.log(V)
    log_z = -0.5 * (misfit + np.log(det) + log_V) - len(y) * np.log(s)
    return log_z, b, np.array([r / det, -q / det, p / det])


def find_backbone(record: Record, mode: Mode) -> Backbone:
    """Frequencies and masses at the phase resonances of a record.

    The mass is that of the record's rows, else the mode's, known to its tolerance. Frequencies are converted to those
    of the structure without ``added_mass`` at the same stiffness. If the levels had several masses
    (:meth:`damping.records.mode.Mode.find_states`), they are converted to the mass at the largest force.
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
    """The backbone of the levels that laws are fitted to, with unit masses; None if all levels have one frequency.

    If the mode is given, frequencies are converted to those of the structure at one mass and without added mass.
    """
    omega, scatter = data.tested_omega, (mode.repeatability.frequency if mode else None) or 0.0
    if mode:
        state, added = mode.find_states(data.tested_mass, len(omega)), data.added_mass
        omega = omega * np.sqrt(state / state[data.top] * (1.0 if added is None else 1.0 + added / state))
    if not np.ptp(omega) > 0.0:
        return None
    return Backbone(data.tested_amplitude, omega, np.ones_like(omega), 0.0, scatter)
