"""What the rows of a record imply by themselves: mass, phase offset, resonance, noise, further peaks of every run.

Each row with a phase measures the dynamic stiffness Y = F exp(i phase)/A = K - M omega^2 + (S + i C)/A. Y falls along
the real axis with omega^2, by the mass, and lies above it, since a passive structure takes energy: where it does not,
the phase is not the lag of the displacement. Without phases |Y|^2 is a parabola in omega^2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import log, pi

import numpy as np
import pandas as pd
from scipy.signal import find_peaks, medfilt

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray, IntArray
from damping.records.record import Record
from damping.records.resonance import ROWS_ASIDE, like_pairs, weighted_median

#: Fewest rows of a run that can show a resonance.
FEWEST_ROWS = 4
#: A further peak stands out by this factor of A/F and by so many standard deviations of the noise.
PROMINENCE, NOISE_BESIDE_PEAK = 1.4, 5.0
#: A maximum of A/F is a resonance where A/F falls on either side by this share, or by so many sd of the noise.
FALL, NOISE_BESIDE_FALL = 0.05, 4.0
#: A run may stop short of its largest A/F by this factor in (F/A)^2 (12 % in amplitude) and still show it.
SHORT_OF_PEAK = 1.3
#: Median misfit of |Y|^2 by a parabola, beside its noise, beyond which a resonance is bent.
NO_PARABOLA = 0.1
#: Neighbouring A/F that differ as much as any two rows do (2: white noise) are no curve.
WHITE = 1.3


@dataclass(frozen=True)
class Run:
    """Rows of one sweep in one direction, by frequency; ``rows`` is their place in the record; phase None: none.

    Arrays (n,): ``F``, ``omega`` (rad per unit of time), ``A``, ``phase`` (rad), ``added`` mass.
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
        """The run without some rows of the record."""
        kept = ~np.isin(self.rows, left_out)
        phase = None if self.phase is None else self.phase[kept]
        return Run(self.sweep, self.rows[kept], self.F[kept], self.omega[kept], self.A[kept], phase, self.added[kept])

    @cached_property
    def compliance(self) -> FloatArray:
        """ln(A/F), (n,)."""
        return np.log(self.A / self.F)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of ln A from row to row: median second difference, so that a peak does not count."""
        if len(self) < 5:
            return 0.0
        return float(np.median(np.abs(np.diff(self.compliance, 2)))) / (0.6745 * 6.0**0.5)

    @cached_property
    def stiffness(self) -> ComplexArray:
        """Y = F exp(i phase)/A, freed of the added mass, (n,)."""
        phase = np.zeros(len(self)) if self.phase is None else self.phase
        return np.asarray(self.F / self.A * np.exp(1j * phase) + self.added * self.omega**2)


def runs_of(record: Record) -> list[Run]:
    """The runs of a record: legs of each sweep that go up or down; a sweep without such legs is one run."""
    return [run for _, table in record.table.groupby("sweep", sort=False) for run in _legs(table)]


def _legs(table: pd.DataFrame) -> Iterator[Run]:
    if "time" in table.columns and table["time"].notna().all():
        table = table.sort_values("time", kind="stable")
    step = np.sign(np.diff(table["frequency"].to_numpy(dtype=np.float64)))
    turns = np.flatnonzero(step[1:] * step[:-1] < 0.0) + 2
    parts = np.split(np.arange(len(table)), turns)
    if min(len(part) for part in parts) < FEWEST_ROWS:
        parts = [np.arange(len(table))]
    for part in parts:
        yield _run(table.iloc[part].sort_values("frequency", kind="stable"))


def _run(table: pd.DataFrame) -> Run:
    def column(name: str) -> FloatArray:
        return table[name].to_numpy(dtype=np.float64)

    return Run(
        sweep=str(table["sweep"].iloc[0]),
        rows=table.index.to_numpy(dtype=np.int64),
        F=column("force"),
        omega=RAD_S_PER_HZ * column("frequency"),
        A=column("amplitude"),
        phase=column("phase") if "phase" in table.columns else None,
        added=np.nan_to_num(column("added_mass")) if "added_mass" in table.columns else np.zeros(len(table)),
    )


@dataclass(frozen=True)
class Implied:
    """What a run implies: ``mass`` complex, its argument the offset of the phases; ``scatter`` its relative sd.
    ``damping``: median damping ratio of the rows it rests on, which is what a law may move the offset by.

    ``taken``: mean sine of the phase freed of that offset, weighted by closeness to resonance, over its standard error:
    below 0 the structure would give energy. ``miss``: median misfit of Y by a straight line, relative to Y: 1 where the
    phases have nothing to do with the amplitudes. ``both_sides``: seen from rows on both sides of resonance.
    """

    mass: complex
    scatter: float
    damping: float
    taken: float
    miss: float
    both_sides: bool

    @property
    def offset(self) -> float:
        """Argument of the mass, rad in -pi..pi."""
        return float(np.angle(self.mass))


def implied_by(run: Run) -> Implied | None:
    """Mass and phase offset that a run with phases implies; None with fewer than ``FEWEST_ROWS`` rows or no phase."""
    if run.phase is None or len(run) < FEWEST_ROWS or np.ptp(run.omega) == 0.0:
        return None
    line, miss = _line(run)
    pairs = _mass_of_pairs(run)
    mass, scatter, damping = (line, 1.0, 0.0) if pairs is None else pairs
    turned = run.stiffness * np.exp(-1j * np.angle(mass))
    sine = turned.imag / np.abs(turned)
    weight = (run.A / run.F) ** 2
    mean = float(weight @ sine / weight.sum())
    error = float(np.sqrt((weight**2) @ ((sine - mean) ** 2 + 0.02**2)) / weight.sum())
    return Implied(mass, scatter, damping, mean / error, miss, pairs is not None)


def _line(run: Run) -> tuple[complex, float]:
    """-slope of Y against omega^2, by least squares relative to |Y|, and the median misfit relative to |Y|."""
    x = run.omega**2 / np.mean(run.omega**2)
    weight = run.A / run.F
    design = np.column_stack([np.ones(len(x)), x - 1.0]) * weight[:, np.newaxis]
    values = np.linalg.lstsq(design.astype(complex), run.stiffness * weight)[0]
    miss = float(np.median(np.abs(run.stiffness * weight - design @ values)))
    return complex(-values[1] / np.mean(run.omega**2)), miss


def _mass_of_pairs(run: Run) -> tuple[complex, float, float] | None:
    """Complex mass of pairs of rows of like amplitude beside resonance, its scatter and their damping ratio."""
    i, j, weight = like_pairs(run.omega, run.A, run.stiffness / run.omega, run.A / run.F)
    if len(weight) == 0:
        return None
    middle = run.omega[np.argmax(run.A / run.F)]
    y = run.stiffness / run.omega
    mass = (y[i] - y[j]) / ((run.omega[j] - run.omega[i]) * (1.0 + middle**2 / (run.omega[i] * run.omega[j])))
    weight = weight * (run.omega[j] - run.omega[i])
    found = complex(weighted_median(mass.real, weight), weighted_median(mass.imag, weight))
    apart = weighted_median(np.abs(mass - found), weight)
    size = max(abs(found), 1e-300)
    ratio = np.abs((y[i] * np.exp(-1j * np.angle(found))).imag) / (2.0 * size * run.omega[i])
    independent = min(len(set(i.tolist())), len(set(j.tolist())))
    return found, apart / size / independent**0.5, weighted_median(ratio, weight)


def mass_without_phase(run: Run) -> tuple[float, bool] | None:
    """Mass from |Y|^2 = (K - M omega^2)^2 + c^2 omega^2, a parabola in omega^2, and whether the rows follow one.

    None where the rows allow none.
    """
    if len(run) < 2 * ROWS_ASIDE or not has_resonance(run, None):
        return None
    fitted = _parabola(run.omega, run.F / run.A)
    if fitted is None or fitted[0] <= 0.0:
        return None
    x, size = (run.omega / np.mean(run.omega)) ** 2 - 1.0, (run.F / run.A) ** 2
    straight = float(np.median(np.abs(np.polyval(fitted, x) / size - 1.0))) < NO_PARABOLA + 2.0 * run.noise
    return float(np.sqrt(fitted[0]) / np.mean(run.omega) ** 2), straight


def _parabola(omega: FloatArray, size: FloatArray) -> FloatArray | None:
    """Coefficients of |Y|^2 as a parabola in (omega/mean)^2 - 1, highest power first, rows weighed alike."""
    x = (omega / np.mean(omega)) ** 2 - 1.0
    if len(np.unique(x)) < 3:
        return None
    return np.asarray(np.polyfit(x, size**2, 2, w=size**-2.0))


def has_resonance(run: Run, lag: FloatArray | None) -> bool:
    """Whether a resonance lies within the rows: the lag passes pi/2, or A/F falls on both sides of its maximum.

    A run that stops just short of the maximum (``SHORT_OF_PEAK``) counts as holding it.
    """
    if lag is not None and np.cos(lag).max() > 0.0 > np.cos(lag).min():
        return True
    g = run.compliance
    top = int(np.argmax(g))
    fall = max(FALL, NOISE_BESIDE_FALL * run.noise)
    if g[top] - g[: top + 1].min() > fall and g[top] - g[top:].min() > fall:
        return True
    near = np.argsort(-g)[: max(5, len(run) // 3)]
    fitted = _parabola(run.omega[near], (run.F / run.A)[near])
    if fitted is None or fitted[0] <= 0.0:
        return False
    least = fitted[2] - fitted[1] ** 2 / (4.0 * fitted[0])
    return bool(least > 0.0 and float(np.exp(-2.0 * g[top])) < SHORT_OF_PEAK * least)


def whiteness(runs: list[Run]) -> float | None:
    """Mean squared step of ln(A/F) from row to row over its variance: 2 for white noise; None with too few rows."""
    long = [run for run in runs if len(run) >= 2 * FEWEST_ROWS]
    if not long:
        return None
    steps = sum(float(np.sum(np.diff(run.compliance) ** 2)) for run in long)
    spread = sum(float(np.sum((run.compliance - run.compliance.mean()) ** 2)) for run in long)
    return steps / spread if spread > 0.0 else None


def peaks_of(run: Run) -> IntArray:
    """Places in the run of the maxima of A/F that stand out, the ends not counted; single wild rows do not."""
    if len(run) < 2 * FEWEST_ROWS:
        return np.empty(0, np.int64)
    smooth = medfilt(run.compliance, 3)
    smooth[[0, -1]] = run.compliance[[0, -1]]
    found = find_peaks(smooth, prominence=max(log(PROMINENCE), NOISE_BESIDE_PEAK * run.noise))[0]
    return np.asarray(found, np.int64)


#: Beats after a resonance that was passed fast: how far their humps stand out at least and at most, ln A/F, and how
#: far the first lies below the peak (from integrating a linear mode at 1 to 10 bandwidths squared per second).
SHALLOW, DEEP, FIRST_BEAT = 0.05, 1.2, (0.7, 1.8)


def beats_of(run: Run) -> int:
    """Humps on one side of the peak, lower and lower and closer and closer, as a resonance passed fast leaves them."""
    if len(run) < 10 * FEWEST_ROWS:
        return 0
    smooth = medfilt(run.compliance, 5)[2:-2]
    found, shape = find_peaks(smooth, prominence=max(SHALLOW, NOISE_BESIDE_PEAK * run.noise))
    if len(found) < 2:
        return 0
    top = int(np.argmax(smooth[found]))
    if top not in (0, len(found) - 1):
        return 0
    humps = (found if top == 0 else found[::-1])[1:]
    heights, omega = smooth[humps] - smooth[found[top]], run.omega[2:-2]
    away = np.abs(omega[humps] - omega[found[top]])
    stand_out = np.delete(shape["prominences"], top)
    first = FIRST_BEAT[0] < -heights[0] < FIRST_BEAT[1] and stand_out.max() < DEEP
    closer = bool(np.all(np.diff(heights) < 0.0) and np.all(np.diff(away, prepend=0.0)[1:] < away[0]))
    return len(humps) if first and closer else 0


#: Rows that are off are at most this share of a run: more of them are another branch of the response.
MOST_WILD = 0.05
#: A row within this factor of one of the three rows before or after it, in Y, is on a branch of its own.
SAME_BRANCH = 1.5


def wild_rows(run: Run, factor: float) -> IntArray:
    """Places in the run of amplitudes more than ``factor`` above both rows beside them, or below, that stand alone.

    A resonance between two rows may reach any height: a row that its phase says is at resonance, or to which without
    phases the rows before and after rise, is no wild one.
    """
    n = len(run)
    if n < 2 * FEWEST_ROWS:
        return np.empty(0, np.int64)
    found = [k for k in range(n) if _stands_alone(run, k, factor)]
    return np.array(found if len(found) <= max(1.0, MOST_WILD * n) else [], np.int64)


def _stands_alone(run: Run, k: int, factor: float) -> bool:
    n, g = len(run), run.compliance
    beside = [m for m in (k - 1, k + 1) if 0 <= m < n]
    above, below = g[k] - max(g[beside]), min(g[beside]) - g[k]
    if max(above, below) < log(factor) or (below > 0.0 and np.ptp(g[beside]) > 0.3 * below):
        return False
    near = np.array([m for m in range(max(0, k - 3), min(n, k + 4)) if m != k])
    if np.abs(np.log(run.stiffness[near] / run.stiffness[k])).min() < log(SAME_BRANCH):
        return False
    return above < 0.0 or not _may_resonate(run, k, factor)


#: A sweep of more rows shows its resonance in more than one of them.
MOST_COARSE = 40


def _may_resonate(run: Run, k: int, factor: float) -> bool:
    """Whether row ``k``, above the rows beside it, may be the resonance."""
    if run.phase is not None:  # with like damping beside, |Y| sin(phase) is the same: a reading too large lowers it
        others = np.delete(np.arange(len(run)), k)
        damping = np.abs(run.stiffness.imag)
        near = others[np.argsort(np.abs(others - k), kind="stable")[:6]]
        return bool(damping[k] > np.median(damping[near]) / factor)
    rest = np.delete(np.arange(len(run)), k)
    if abs(int(np.argmax(run.compliance[rest])) - k) > 1 or len(rest) >= MOST_COARSE:
        return False
    size = run.F / run.A
    near = rest[np.argsort(size[rest], kind="stable")[:6]]
    fitted = _parabola(run.omega[near], size[near])
    if fitted is None or fitted[0] <= 0.0:
        return True
    least = fitted[2] - fitted[1] ** 2 / (4.0 * fitted[0])
    x = (run.omega[near] / np.mean(run.omega[near])) ** 2 - 1.0
    follows = np.median(np.abs(np.polyval(fitted, x) / size[near] ** 2 - 1.0)) < NO_PARABOLA + 2.0 * run.noise
    return not (follows and size[k] ** 2 * factor**2 < least)


def quarter_turns(angle: float) -> int:
    """The nearest number of quarter turns to an angle: 0, 1, 2 (half a turn) or -1."""
    turns = round(angle / (0.5 * pi))
    return 2 if abs(turns) == 2 else turns
