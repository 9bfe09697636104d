"""Sweeps that were run too fast: the envelope of the swept motion, and the equivalent steady states of its rows.

With q = Re(a exp(i theta)), theta' = omega and a slowly changing complex a, neglecting a'' against omega a',

    (omega_n^2 - omega^2 + i omega c/m) a = F/m - 2 i omega a' - i omega' a,        c = C(|a|, omega)/(omega |a|).

The right side follows from the rows of a sweep alone: each swept row is a steady state under the force
F_e = F - m (2 i omega a' + i omega' a). No law is assumed, and a corrected record is a record like any other. If the
rate was not recorded, it is fitted by the envelope integrated with the damping ratio z1 (1 + b |a|), from the shift and
skew of the peaks. Hok (1948), Lewis (1932): peaks move unless (df/dt)/(2 zeta f)^2 is small.
"""

from cmath import exp
from collections.abc import Callable
from dataclasses import dataclass
from math import log
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, BoolArray, ComplexArray, FloatArray, wrap_lag
from damping.errors import AnalysisError
from damping.forces import damping_ratio
from damping.records.check_sweeps import FAST
from damping.records.implied import NEAR, detect_rate
from damping.records.record import Record
from damping.records.rows import list_rates
from damping.records.runs import runs_of

#: (df/dt)/(2 zeta f)^2 below which peaks are not corrected: their error, 0.1 % in amplitude, is below the noise that a
#: correction adds.
SLOW = 0.05
_STEP = 0.15  # change of the transient's phase between two points of the integration, rad
_KNOWN = 5.0  # least rate, in standard errors, that is accepted
_BETTER = 0.6  # largest misfit of an accepted rate, over that of steady states whose stiffness changes with amplitude
_FEWEST = 5  # fewest rows of a sweep
_MOST_ROWS = 3000  # most rows in which an unknown rate is estimated: a matter of seconds
_LARGEST_STEPS = 20_000
_DECAYS = 4.0  # time constants of sweep before the first row, limited in ln f to _LARGEST_LEAD
_LARGEST_LEAD = 0.3


@dataclass(frozen=True)
class Rate:
    """A sweep rate in octaves per minute (negative: downwards) and its standard error."""

    octaves_a_minute: float
    standard_error: float
    severity: float  #: largest (df/dt)/(2 zeta f)^2 of the record
    misfit: float  #: root mean square residual of ln a
    steady_misfit: float  #: that of steady states whose stiffness and damping change with amplitude


def envelope(
    frequency: FloatArray, rate: float, force: float, mass: float, natural: float, ratio: float, growth: float = 0.0
) -> ComplexArray:
    """Complex amplitude a (n,) while the frequency changes at ``rate`` octaves per minute.

    Each step is integrated exactly with frozen coefficients, from a steady state some decay times before the first
    frequency.

    Args:
        frequency: Hz (n,), in the order swept.
        force, mass: modal.
        natural: f_n in Hz.
        ratio, growth: damping ratio ratio (1 + growth |a|).
    """
    per_second = rate * log(2.0) / 60.0 * (1.0 if frequency[-1] >= frequency[0] else -1.0)
    w_n = RAD_S_PER_HZ * natural
    before = min(_DECAYS * abs(per_second) / (ratio * w_n), _LARGEST_LEAD)
    start = frequency[0] * float(np.exp(-before if per_second > 0.0 else before))
    span = abs(log(frequency[-1] / start))
    duration = span / max(abs(per_second), 1e-12)
    widest = RAD_S_PER_HZ * float(np.max(np.abs(frequency - natural)))
    steps = int(min(max(duration * widest / _STEP, 20 * len(frequency)), _LARGEST_STEPS))
    x = np.linspace(0.0, log(frequency[-1] / start), steps + 1)
    w = RAD_S_PER_HZ * start * np.exp(x)
    dt = duration / steps
    a = np.empty(steps + 1, dtype=complex)
    amplitude = 0j
    for _ in range(50):  # the steady amplitude, by fixed-point iteration far from resonance
        amplitude = force / mass / (w_n**2 - w[0] ** 2 + 2j * ratio * (1.0 + growth * abs(amplitude)) * w_n * w[0])
    a[0] = amplitude = complex(amplitude)  # plain numbers: arithmetic of numpy scalars takes several times as long
    for k, now in enumerate((0.5 * (w[1:] + w[:-1])).tolist(), 1):
        z = ratio * (1.0 + growth * abs(amplitude))
        lead = 2j * now + 2.0 * z * w_n
        decay = -(w_n**2 - now**2 + 2j * z * w_n * now + 1j * per_second * now) / lead
        rest = -(force / mass) / lead / decay
        amplitude = rest + (amplitude - rest) * exp(decay * dt)
        a[k] = amplitude
    order = np.argsort(x)
    return np.asarray(np.interp(np.log(frequency / start), x[order], a[order]))


def correct_rate(record: Record, mass: float) -> Record:
    """The equivalent steady states of a swept record with phases; only rows near the peaks are kept.

    ``sweep_rate`` (Hz/s) is taken from the record; the result has rates of 0. Force and phase change, frequency and
    amplitude do not.

    AnalysisError: a sweep has too few frequencies.
    """
    tables = [_tabulate_corrected(rows, mass) for _, rows in record.frame.groupby("sweep", sort=False)]
    return Record(pd.concat(tables, ignore_index=True), record.source)


def _tabulate_corrected(rows: pd.DataFrame, mass: float) -> pd.DataFrame:
    """The rows of one sweep near its peak, with the force F_e of the module and the phase behind it."""
    rows = rows.sort_values("frequency").reset_index(drop=True)
    near = rows["amplitude"].to_numpy() >= NEAR * rows["amplitude"].max()
    if not rows["sweep_rate"].any():
        return rows
    w = RAD_S_PER_HZ * rows["frequency"].to_numpy(dtype=float)
    at, place, count = np.unique(w, return_inverse=True, return_counts=True)
    if len(at) < _FEWEST:
        what = f"sweep {rows['sweep'].iloc[0]!r} has {len(at)} frequencies at its resonance and moves too fast"
        raise AnalysisError(f"{what}: {_FEWEST} are needed to correct it; sweep slower, or dwell")
    size, lag = (rows[name].to_numpy(dtype=float) for name in ("amplitude", "phase"))
    logarithm = np.log(size) - 1j * np.unwrap(lag)  # smoother than a itself about a peak
    a = np.exp(logarithm)
    mean = (np.bincount(place, logarithm.real) + 1j * np.bincount(place, logarithm.imag)) / count
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to import, and needed for swept records alone

    slope = a * CubicSpline(at, mean)(w, 1)  # of repeated frequencies the mean
    w_rate = RAD_S_PER_HZ * rows["sweep_rate"].to_numpy(dtype=float)
    force = rows["force"].to_numpy(dtype=float) - mass * (2j * w * slope * w_rate + 1j * w_rate * a)
    out = rows.assign(force=np.abs(force), phase=wrap_lag(np.angle(force) - np.angle(a)), sweep_rate=0.0)
    return pd.DataFrame(out[near].reset_index(drop=True))


def estimate_rate(record: Record, mass: float, frequency: float, *, upwards: bool = True) -> Rate:
    """The common sweep rate of a record with phases and ``_FEWEST`` rows or more in each sweep.

    f_n, z1, b and the rate are fitted to ln a of the rows near the peaks of every sweep. A rate within two standard
    errors of 0 means that no departure from steady states is found.

    Args:
        frequency: initial frequency of the mode, Hz.
        upwards: direction of the sweeps.
    """
    sweeps = []
    for _, rows in record.frame.groupby("sweep", sort=False):
        ordered = rows.sort_values("frequency", ascending=upwards)
        columns = ("frequency", "amplitude", "phase", "force")
        f, size, lag, force = (ordered[name].to_numpy(dtype=float) for name in columns)
        sweeps.append(_Sweep(f, size * np.exp(-1j * lag), float(np.median(force)), size >= NEAR * size.max()))
    largest = max(float(np.abs(rows.a).max()) for rows in sweeps)

    def swept(x: FloatArray, rows: _Sweep) -> ComplexArray:
        shift, ratio, growth, rate = x.tolist()
        f_n = frequency * (1.0 + shift)
        return envelope(rows.f, rate, rows.force, mass, f_n, float(np.exp(ratio)), growth / largest)[rows.near]

    def steady(x: FloatArray, rows: _Sweep) -> ComplexArray:
        """(omega_n^2 (1 + s |a|) - omega^2 + 2 i z (1 + b |a|) omega_n omega) a = F/m."""
        w_n, w = RAD_S_PER_HZ * frequency * (1.0 + x[0]), RAD_S_PER_HZ * rows.f[rows.near]
        size = np.abs(rows.a[rows.near]) / largest
        stiffness = w_n**2 * (1.0 + x[3] * size) - w**2 + 2j * np.exp(x[1]) * (1.0 + x[2] * size) * w_n * w
        return np.asarray(rows.force / mass / stiffness)

    moved = _fit_near(sweeps, swept, (1.0, 0.0, 60.0, 1.0), diff_step=np.full(4, 1e-4))
    standing = _fit_near(sweeps, steady, (0.0, -0.5, 0.5, 0.01))
    freedom = max(len(moved.fun) - 4, 1)
    covariance = np.linalg.pinv(moved.jac.T @ moved.jac) * float(moved.fun @ moved.fun) / freedom
    smallest = min(float(np.abs(rows.a).max()) for rows in sweeps)
    least = float(np.exp(moved.x[1])) * (1.0 + moved.x[2] * smallest / largest)
    return Rate(
        octaves_a_minute=(1.0 if upwards else -1.0) * float(moved.x[3]),
        standard_error=float(np.sqrt(covariance[3, 3])),
        severity=abs(moved.x[3]) * log(2.0) / 60.0 * frequency / (2.0 * least * frequency) ** 2,
        misfit=float(np.sqrt(np.mean(moved.fun**2))),
        steady_misfit=float(np.sqrt(np.mean(standing.fun**2))),
    )


class _Sweep(NamedTuple):
    """A sweep in the order swept: Hz and complex amplitudes (n,), the force, and whether rows are near the peak."""

    f: FloatArray
    a: ComplexArray
    force: float
    near: BoolArray


def _fit_near(
    sweeps: list[_Sweep],
    predict: Callable[[FloatArray, _Sweep], ComplexArray],
    last: tuple[float, float, float, float],
    **options: Any,
) -> Any:
    """Least squares of ln a near the peaks for f_n (relative), ln z1, b, and a ``last`` parameter.

    ``last``: its start, bounds and scale. ``predict``: the amplitudes near the peak of one sweep.
    """

    def residual(x: FloatArray) -> FloatArray:
        rests = [np.log(predict(x, rows) / rows.a[rows.near]) for rows in sweeps]
        return np.concatenate([part for rest in rests for part in (rest.real, rest.imag)])

    from scipy.optimize import least_squares  # noqa: PLC0415 - slow to import, and needed for swept records alone

    first, low, high, scale = last
    limits = ([-0.05, log(1e-4), -0.5, low], [0.05, log(0.3), 20.0, high])
    start = [0.0, log(0.01), 0.5, first]
    return least_squares(residual, start, bounds=limits, x_scale=[0.002, 0.2, 0.5, scale], **options)


def as_steady(record: Record, mass: float, frequency: float) -> tuple[Record, tuple[str, ...]]:
    """The record as steady states, and notes on the correction; unchanged if it is steady.

    A column ``sweep_rate`` is used as given; slow sweeps are not corrected. Without it, a rate is detected in the turn
    of the phases (:func:`damping.records.implied.detect_rate`) and then estimated; it is accepted if it is fast and
    known to a fifth.

    Args:
        mass: generalized mass.
        frequency: of the mode, Hz.
    """
    if not record.has_phase:
        return record, ()
    if "sweep_rate" in record.frame.columns:
        known = record.frame.assign(sweep_rate=list_rates(record, None))
        peaks = known.loc[known.groupby("sweep", sort=False)["amplitude"].idxmax()]
        # 2 zeta f at the peaks, by the balance of forces there
        F, A, f = (peaks[name].to_numpy(dtype=float) for name in ("force", "amplitude", "frequency"))
        width = 2.0 * damping_ratio(F, A, mass * (RAD_S_PER_HZ * f) ** 2) * f
        if (peaks["sweep_rate"].abs() / width**2).max() < SLOW:
            return record, ()
        return correct_rate(Record(known, record.source), mass), (
            "peaks reached at the sweep rate of the record are corrected to steady ones",
        )
    counts = record.frame.groupby("sweep")["force"].size()
    if counts.min() < _FEWEST or len(record) > _MOST_ROWS:
        return record, ()
    detected = detect_rate(runs_of(record))
    if detected is None:
        return record, ()
    rate = estimate_rate(record, mass, frequency, upwards=detected > 0.0)
    octaves = abs(rate.octaves_a_minute)
    accepted = octaves > _KNOWN * rate.standard_error and rate.misfit < _BETTER * rate.steady_misfit
    if not accepted or rate.severity < FAST:
        return record, ()
    hertz = rate.octaves_a_minute * log(2.0) / 60.0 * record.frame["frequency"].to_numpy(dtype=float)
    note = (
        f"peaks are shifted and skewed as by a sweep of {octaves:.2g} ± {rate.standard_error:.1g} octaves a minute "
        f"{'up' if detected > 0.0 else 'down'}, (df/dt)/(2 zeta f)^2 = {rate.severity:.2g}: corrected to steady "
        "states; state sweep_rate (Hz/s) to be sure"
    )
    return correct_rate(Record(record.frame.assign(sweep_rate=hertz), record.source), mass), (note,)
