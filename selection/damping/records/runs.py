"""Runs of a record (rows of one sweep in one direction), peaks and beats of their amplitudes, resonances between rows.

Rows beside a resonance read |Y|^2 = (F/A)^2 = M^2 (omega_r^2 - omega^2)^2 + (C/A)^2. Where C grows as the power p of
amplitude, (C/A)^2 = (C/A)_r^2 (A/A_r)^(2 (p - 1)), and without the change of that term |Y|^2 is a parabola in omega^2
whose least value is (F/A)_r^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import log, sqrt

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray, IntArray
from damping.records.peaks import find_noise, find_peak
from damping.records.record import Record

FEWEST_ROWS = 4  #: fewest rows of a run that can show a resonance
PROMINENCE = 1.4  #: least prominence of a further peak, factor of A/F,
NOISE_BESIDE_PEAK = 5.0  #: and in standard deviations of the noise
FALL = 0.05  #: a maximum of A/F is a resonance if A/F falls on both sides by this share,
NOISE_BESIDE_FALL = 4.0  #: and by this many standard deviations of the noise
#: A run that stops short of its peak by this factor in (F/A)^2 (12 % in amplitude) still shows the resonance.
SHORT_OF_PEAK = 1.3
FAR_FROM_RESONANCE = 0.5  #: a run whose rows all have a larger |cos(lag)| stops more than 30 degrees short of resonance
NO_PARABOLA = 0.1  #: median misfit of |Y|^2 by a parabola, besides its noise, beyond which a resonance is bent
WHITE = 1.3  #: mean squared step over the variance (white noise: 2) above which ln(A/F), or exp(i phase), is no curve


@dataclass(frozen=True)
class Run:
    """Rows of one sweep in one direction, by frequency; ``rows``: their positions in the record.

    Arrays (n,): ``F``, ``omega`` (rad per unit of time), ``A``, ``phase`` (rad; None if not recorded), ``added`` mass.
    """

    sweep: str
    rows: IntArray
    F: FloatArray
    omega: FloatArray
    A: FloatArray
    phase: FloatArray | None
    added: FloatArray

    def __len__(self) -> int:
        return len(self.rows)

    def without(self, left_out: IntArray) -> Run:
        """The run without the rows ``left_out`` of the record."""
        kept = ~np.isin(self.rows, left_out)
        phase = None if self.phase is None else self.phase[kept]
        return Run(self.sweep, self.rows[kept], self.F[kept], self.omega[kept], self.A[kept], phase, self.added[kept])

    @cached_property
    def compliance(self) -> FloatArray:
        """ln(A/F), (n,)."""
        return np.log(self.A / self.F)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of ln(A/F) from row to row."""
        return find_noise(self.compliance)

    @cached_property
    def stiffness(self) -> ComplexArray:
        """Y = F exp(i phase)/A without the added mass, (n,)."""
        phase = np.zeros(len(self)) if self.phase is None else self.phase
        return np.asarray(self.F / self.A * np.exp(1j * phase) + self.added * self.omega**2)


def runs_of(record: Record) -> list[Run]:
    """The runs of a record: the legs of each sweep up or down in frequency; a sweep without legs is one run."""
    frame, runs = record.frame, []
    F, omega, A = record.column("force"), RAD_S_PER_HZ * record.column("frequency"), record.column("amplitude")
    phase, added = record.column("phase") if record.has_phase else None, record.added_masses
    for sweep, table in frame.groupby("sweep", sort=False):
        ordered, legs = order_rows(table)
        for leg in legs:
            rows = ordered.index.to_numpy(dtype=np.int64)[leg]
            rows = rows[np.argsort(omega[rows], kind="stable")]
            lag = None if phase is None else phase[rows]
            runs.append(Run(str(sweep), rows, F[rows], omega[rows], A[rows], lag, added[rows]))
    return runs


def order_rows(table: pd.DataFrame) -> tuple[pd.DataFrame, list[IntArray]]:
    """Rows of one sweep as taken, and the positions of its legs up or down; by frequency if there are no legs."""
    if len(table) == 1:
        return table, [np.arange(1)]
    if "time" in table.columns and table["time"].notna().all():
        table = table.sort_values("time", kind="stable")
    step = np.sign(np.diff(table["frequency"].to_numpy(dtype=np.float64)))
    turns = np.flatnonzero(step[1:] * step[:-1] < 0.0) + 2
    legs = np.split(np.arange(len(table)), turns)
    if len(legs) == 1 or min(map(len, legs)) >= FEWEST_ROWS:
        return table, legs
    return table.sort_values(["frequency", "amplitude"]), [np.arange(len(table))]


@dataclass(frozen=True)
class Parabola:
    """|Y|^2 of a linear mode: a x^2 + b x + c in x = (omega/middle)^2 - 1, with a > 0."""

    middle: float  #: rad/s
    a: float
    b: float
    c: float

    def place(self, omega: FloatArray) -> FloatArray:
        """x at frequencies in rad/s."""
        return np.asarray((omega / self.middle) ** 2 - 1.0, dtype=np.float64)

    def at(self, omega: FloatArray) -> FloatArray:
        """|Y|^2 at frequencies in rad/s."""
        x = self.place(omega)
        return (self.a * x + self.b) * x + self.c

    def misfit(self, omega: FloatArray, squared: FloatArray) -> float:
        """Median distance from |Y|^2 of rows, ``squared`` (n,), relative to it."""
        return float(np.median(np.abs(self.at(omega) / squared - 1.0)))

    @property
    def least(self) -> float:
        """Smallest |Y|^2; not above 0 where the rows are no mode."""
        return self.c - self.b**2 / (4.0 * self.a)

    @property
    def resonance(self) -> float:
        """Frequency of that, rad/s; 0 where it lies below 0."""
        return self.middle * sqrt(max(1.0 - self.b / (2.0 * self.a), 0.0))


def fit_parabola(omega: FloatArray, size: FloatArray) -> Parabola | None:
    """|Y|^2 = ``size``^2 of rows (n,) at ``omega`` (n,), rad/s, fitted with equal relative weights.

    None with fewer than three frequencies, or if the parabola has no minimum.
    """
    middle = float(np.mean(omega))
    x = (omega / middle) ** 2 - 1.0
    fitted = np.polyfit(x, size**2, 2, w=size**-2.0) if len(np.unique(x)) >= 3 else np.zeros(3)
    return Parabola(middle, *map(float, fitted)) if fitted[0] > 0.0 else None


#: A sweep is coarse if A/F falls by this factor from its largest value to a neighbouring row: between closer rows the
#: resonance is at most 0.7 % higher (an eighth of the rise of |Y|^2 from row to row, halved).
COARSE = 1.05
NEAR = 0.5  #: rows of at least this share of the largest A/F are fitted, and both neighbours of that row
POWERS = (0.0, 3.0)  #: powers p of amplitude: from friction to cubic damping
#: Relative error of A_r over ln of its rise above the largest reading: the power is only the mean of the levels, and
#: the resonance may be bent. Of 448 coarse sweeps of 16 laws, from which it was chosen, 15 % then err by more than 1.64
#: standard deviations (normal: 10 %), mostly joints; the mean error is 0, that of the largest readings -5 %.
ERROR_OF_RISE = 0.25
TELLING = 1.1  #: ratio of forces from which resonances show that power
_TURNS = 12  #: iterations for A_r, each of which leaves about half of the error
POWER_TURNS = 4  #: iterations for the power, which resonances of all sweeps show and by which they change


def find_between(
    force: FloatArray, frequency: FloatArray, amplitude: FloatArray, power: float
) -> tuple[float, float, float] | None:
    """Force, frequency and amplitude of the resonance between the rows (n,) of a sweep, in any order.

    None if the peak (`find_peak`) is not between rows, if the sweep is not coarse, or if its rows are no parabola.
    """
    order = np.argsort(frequency, kind="stable")
    F, f, A = force[order], frequency[order], amplitude[order]
    size, k = F / A, find_peak(F, f, A)
    if k in (0, len(A) - 1) or size[k] > size.min() or max(size[k - 1], size[k + 1]) < COARSE * size[k]:
        return None
    near = size * NEAR <= size[k]
    near[k - 1 : k + 2] = True
    at, squared, least = RAD_S_PER_HZ * f[near], size[near] ** 2, size[k] ** 2
    driven, fitted = F[k], None
    for _ in range(_TURNS):
        straight = squared + least * (1.0 - (A[near] * np.sqrt(least) / driven) ** (2.0 * (power - 1.0)))
        if not straight.min() > 0.0 or (fitted := fit_parabola(at, np.sqrt(straight))) is None:
            return None
        resonance, least = fitted.resonance / RAD_S_PER_HZ, fitted.least
        if not (least > 0.0 and f[k - 1] < resonance < f[k + 1]):
            return None
        driven = float(np.interp(resonance, f, F))
    if fitted is None or fitted.misfit(at, straight) > NO_PARABOLA:
        return None
    return driven, resonance, driven / float(np.sqrt(least))


def estimate_power(force: FloatArray, amplitude: FloatArray) -> float:
    """Power of A that force grows with, by a line through resonances (n,), within ``POWERS``; 1 of one level."""
    x = np.log(force)
    per_force = float(np.polyfit(x, np.log(amplitude), 1)[0]) if np.ptp(x) > np.log(TELLING) else 1.0
    return float(np.clip(1.0 / per_force, *POWERS)) if per_force > 0.0 else POWERS[1]


def has_resonance(run: Run, lag: FloatArray | None) -> bool:
    """Whether a resonance lies within the rows: the lag passes pi/2, or A/F falls on both sides of its maximum.

    Where A/F rises row by row to its maximum and falls row by row from it, as few rows do across a peak, their second
    differences are not noise alone: a fall by ``PROMINENCE`` is enough then.
    A run that stops just short of the maximum (``SHORT_OF_PEAK``) counts as containing it, unless the lag excludes it.
    """
    if lag is not None and np.cos(lag).max() > 0.0 > np.cos(lag).min():
        return True
    g = run.compliance
    top = int(np.argmax(g))
    noise = NOISE_BESIDE_FALL * run.noise
    if np.all(np.diff(g[: top + 1]) > 0.0) and np.all(np.diff(g[top:]) < 0.0):
        noise = min(noise, log(PROMINENCE))
    fall = max(FALL, noise)
    if g[top] - g[: top + 1].min() > fall and g[top] - g[top:].min() > fall:
        return True
    if lag is not None and np.abs(np.cos(lag)).min() > FAR_FROM_RESONANCE:
        return False
    near = np.argsort(-g)[: max(5, len(run) // 3)]
    fitted = fit_parabola(run.omega[near], (run.F / run.A)[near])
    if fitted is None:
        return False
    return bool(fitted.least > 0.0 and float(np.exp(-2.0 * g[top])) < SHORT_OF_PEAK * fitted.least)


def measure_whiteness(runs: Sequence[FloatArray | ComplexArray]) -> float | None:
    """Mean squared step of values (n,) of runs over their variance, 2 for white noise; None with too few rows."""
    long_runs = [values for values in runs if len(values) >= 2 * FEWEST_ROWS]
    steps = sum(float(np.sum(np.abs(np.diff(values)) ** 2)) for values in long_runs)
    spread = sum(float(np.sum(np.abs(values - values.mean()) ** 2)) for values in long_runs)
    return steps / spread if spread > 0.0 else None


def find_run_peaks(run: Run) -> IntArray:
    """Positions in the run of prominent maxima of A/F, without the ends; single outliers are smoothed away.

    Between two of them A/F falls by as much as each stands out: equal maxima, as rounding makes of one flat top, have
    the prominence of that top each.
    """
    if len(run) < 2 * FEWEST_ROWS:
        return np.empty(0, np.int64)
    smooth = run.compliance.copy()
    smooth[1:-1] = slide_median(run.compliance, 3)
    least = max(log(PROMINENCE), NOISE_BESIDE_PEAK * run.noise)
    peaks = find_prominent(smooth, least)[0]
    falls = [smooth[[a, b]].min() - smooth[a:b].min() >= least for a, b in pairwise(peaks.tolist())]
    return np.asarray(peaks[np.array([True, *falls])[: len(peaks)]])


def slide_median(values: FloatArray, width: int) -> FloatArray:
    """Medians of ``width`` neighbours, (n - width + 1,)."""
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(values, width), axis=1))


def find_prominent(values: FloatArray, least: float) -> tuple[IntArray, FloatArray]:
    """Positions of local maxima (the middle of flat ones) with a prominence of at least ``least``, and prominences.

    A prominence is the height above the higher of the two minima between the maximum and the next higher values on
    either side, as in `scipy.signal.find_peaks`, whose import takes longer than reading a record.
    """
    begin = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    level, end = values[begin], np.append(begin[1:], len(values)) - 1
    tops = 1 + np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:]))
    stand_out = np.array([_measure_prominence(level, int(top)) for top in tops])
    kept = stand_out >= least
    return ((begin + end) // 2)[tops[kept]], stand_out[kept]


def _measure_prominence(level: FloatArray, top: int) -> float:
    higher = np.flatnonzero(level > level[top])
    left, right = higher[higher < top], higher[higher > top]
    first, last = (left[-1] + 1 if len(left) else 0), (right[0] if len(right) else len(level))
    return float(level[top] - max(level[first : top + 1].min(), level[top:last].min()))


#: Least and largest prominence in ln A/F of a beat after a resonance passed fast; these and the next are of a linear
#: mode, integrated at rates of 1 to 10 bandwidths squared per second.
SHALLOW = 0.05
DEEP = 1.2
#: Least and largest distance of the first beat below the peak, ln A/F.
FIRST_BEAT = (0.7, 1.8)


def count_beats(run: Run) -> int:
    """Number of beats on one side of the peak, ever lower and closer together, as after a resonance passed fast."""
    if len(run) < 10 * FEWEST_ROWS:
        return 0
    smooth = slide_median(run.compliance, 5)
    peaks, prominences = find_prominent(smooth, max(SHALLOW, NOISE_BESIDE_PEAK * run.noise))
    if len(peaks) < 2:
        return 0
    top = int(np.argmax(smooth[peaks]))
    if top not in (0, len(peaks) - 1):
        return 0
    humps = (peaks if top == 0 else peaks[::-1])[1:]
    heights, omega = smooth[humps] - smooth[peaks[top]], run.omega[2:-2]
    away = np.abs(omega[humps] - omega[peaks[top]])
    first = FIRST_BEAT[0] < -heights[0] < FIRST_BEAT[1] and np.delete(prominences, top).max() < DEEP
    closer = bool(np.all(np.diff(heights) < 0.0) and np.all(np.diff(away, prepend=0.0)[1:] < away[0]))
    return len(humps) if first and closer else 0
