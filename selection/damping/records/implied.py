"""Mass, phase offset and sweep rate that the rows of each run imply, without the mode file.

Each row with a phase measures the dynamic stiffness Y = F exp(i phase)/A = K - M omega^2 + (S + i C)/A. Re Y falls with
omega^2 at the rate M, and Im Y > 0, since a passive structure absorbs energy: otherwise the phase is not the lag of the
displacement. Without phases |Y|^2 is a parabola in omega^2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damping.arrays import ComplexArray, FloatArray
from damping.records.pairs import ROWS_ASIDE, like_pairs, weighted_median
from damping.records.runs import FEWEST_ROWS, NO_PARABOLA, Run, fit_parabola, has_resonance


@dataclass(frozen=True)
class Implied:
    """What a run implies: complex ``mass``, its argument the phase offset."""

    mass: complex
    scatter: float  #: relative sd of the mass
    damping: float  #: median damping ratio of the rows used, by which the damping law may displace the offset
    #: mean sine of the phase without that offset, weighted by closeness to resonance, over its standard error: below 0
    #: the structure would supply energy
    energy_sign: float
    miss: float  #: median misfit of Y by a straight line, relative to Y: 1 if phases and amplitudes are unrelated
    bend: float  #: the same of Re Y without the offset, which no damping law bends
    both_sides: bool  #: whether pairs of rows across resonance were used

    @property
    def offset(self) -> float:
        """Argument of the mass, rad in -pi..pi."""
        return float(np.angle(self.mass))


LEAST_OF_MASS = 0.01  #: least share of the structure in the moving mass; with more added it could not be determined
_LEAST_SCATTER = 0.02  # of the sine of a phase, rad: rows that agree better are not known better, as no chain is


def find_implied(run: Run) -> Implied | None:
    """Mass and phase offset implied by a run; None without phases or with fewer than ``FEWEST_ROWS`` rows."""
    if run.phase is None or len(run) < FEWEST_ROWS or np.ptp(run.omega) == 0.0:
        return None
    # a mass added in every row counts as part of the structure: an offset turns the phasors of both
    added = float(run.added[0]) if np.ptp(run.added) == 0.0 else 0.0
    run = replace(run, added=run.added - added)
    line, line_scatter, rest = fit_line(run)
    pairs = _estimate_mass_of_pairs(run)
    # longer runs without pairs are of one wing, or of a bistable mode: their line is bent, however small its error
    without_pairs = (line, line_scatter if len(run) <= 2 * ROWS_ASIDE else 1.0, 0.0)
    mass, scatter, damping = without_pairs if pairs is None else pairs
    structure_share = max(1.0 - added / max(abs(mass), 1e-300), LEAST_OF_MASS)
    turned = run.stiffness * np.exp(-1j * np.angle(mass))
    sine = turned.imag / np.abs(turned)
    weight = (run.A / run.F) ** 2
    mean = float(weight @ sine / weight.sum())
    error = float(np.sqrt((weight**2) @ ((sine - mean) ** 2 + _LEAST_SCATTER**2)) / weight.sum())
    miss, bend = np.median(np.abs([rest, (rest * np.exp(-1j * np.angle(mass))).real]), axis=1)
    mass, scatter = structure_share * mass, scatter / structure_share
    return Implied(mass, scatter, damping, mean / error, float(miss), float(bend), pairs is not None)


def fit_line(run: Run) -> tuple[complex, float, ComplexArray]:
    """-slope of Y on omega^2 by least squares relative to |Y|, its relative error, and residuals over |Y|, (n,)."""
    x = run.omega**2 / np.mean(run.omega**2)
    weight = run.A / run.F
    design = np.column_stack([np.ones(len(x)), x - 1.0]) * weight[:, np.newaxis]
    values = np.linalg.lstsq(design.astype(complex), run.stiffness * weight)[0]
    rest = run.stiffness * weight - design @ values
    variance = np.sum(np.abs(rest) ** 2) / max(len(rest) - 2, 1) * np.linalg.pinv(design.T @ design)[1, 1]
    error = float(np.sqrt(variance) / max(abs(values[1]), 1e-300))
    return complex(-values[1] / np.mean(run.omega**2)), error, rest


def measure_miss(run: Run) -> float:
    """Median misfit of Y by a straight line, relative to |Y|."""
    return float(np.median(np.abs(fit_line(run)[2])))


def _estimate_mass_of_pairs(run: Run) -> tuple[complex, float, float] | None:
    """Complex mass from pairs of rows of equal amplitude across resonance, its scatter and their damping ratio.

    Within a pair Y/omega differs by a real number times exp(i offset) if damping is viscous. Y without the offset
    differs by M (omega_j^2 - omega_i^2) plus an imaginary number, whatever the stiffness at that amplitude.
    """
    i, j, weight = like_pairs(run.omega, run.A, run.stiffness / run.omega, run.A / run.F)
    if len(weight) == 0:
        return None
    y, weight = run.stiffness / run.omega, weight * (run.omega[j] - run.omega[i])

    def median(values: ComplexArray) -> complex:
        return complex(weighted_median(values.real, weight), weighted_median(values.imag, weight))

    apart_by = (y[i] - y[j]) / (run.omega[j] - run.omega[i])
    freed = run.stiffness * np.exp(-1j * np.angle(median(apart_by)))
    real = (freed[i] - freed[j]).real / (run.omega[j] ** 2 - run.omega[i] ** 2)
    mass = real * np.exp(1j * np.angle(apart_by))
    middle_mass = median(mass)
    apart = weighted_median(np.abs(mass - middle_mass), weight)
    size = max(abs(middle_mass), 1e-300)
    ratio = np.abs((y[i] * np.exp(-1j * np.angle(middle_mass))).imag) / (2.0 * size * run.omega[i])
    independent = min(len(set(i.tolist())), len(set(j.tolist())))
    return middle_mass, apart / size / independent**0.5, weighted_median(ratio, weight)


def estimate_mass_without_phase(run: Run) -> tuple[float, bool] | None:
    """Mass from |Y|^2 = (K - M omega^2)^2 + c^2 omega^2, a parabola in omega^2, and whether the rows follow it.

    If they do not, but follow the mode plus a residual compliance (rigid-body motion or other modes), the mass is from
    that fit. None if neither gives a mass.
    """
    if len(run) < 2 * ROWS_ASIDE or not has_resonance(run, None):
        return None
    fitted = fit_parabola(run.omega, run.F / run.A)
    if fitted is None:
        return None
    size, near = (run.F / run.A) ** 2, NO_PARABOLA + 2.0 * run.noise
    straight = fitted.misfit(run.omega, size) < near
    beside = None if straight else _fit_residual(fitted.place(run.omega), 1.0 / size)
    mass = fitted.a**0.5 if beside is None or beside[1] > near else beside[0]
    return mass / fitted.middle**2, straight


#: Iterations of the weights of a ratio of polynomials (Sanathanan and Koerner 1963); they converge in three or four.
_REWEIGHED = 6


def fit_ratio(x: FloatArray, values: FloatArray | ComplexArray) -> tuple[FloatArray | ComplexArray, float]:
    """Ratio (a x^2 + b x + c)/(x^2 + d x + e) fitted to ``values``: (a, b, c, d, e), and the median relative misfit."""
    weight = 1.0 / np.abs(values)
    columns = np.column_stack([x * x, x, np.ones_like(x), -values * x, -values])
    for _ in range(_REWEIGHED):
        size = np.linalg.norm(columns * weight[:, np.newaxis], axis=0)
        scaled = columns * (weight[:, np.newaxis] / size)
        ratio = np.linalg.lstsq(scaled, values * x * x * weight)[0] / size
        below = x * x + ratio[3] * x + ratio[4]
        weight = 1.0 / np.maximum(np.abs(values * below), 1e-300)
    return ratio, float(np.median(np.abs(np.polyval(ratio[:3], x) / (below * values) - 1.0)))


def _fit_residual(x: FloatArray, squared: FloatArray) -> tuple[float, float] | None:
    """Mass (times omega^2 = 1) from |R + 1/Y|^2 = ``squared``, and the median misfit relative to ``squared``.

    With Y = M (a - x + i b) the square is R^2 ((x - d)^2 + b^2)/((x - a)^2 + b^2): the antiresonance d lies 1/(R M)
    from the resonance a, whatever the damping. None if the rows show no antiresonance.
    """
    (top2, top1, _, low1, _), miss = fit_ratio(x, squared)
    if top2 <= 0.0 or low1 == top1 / top2:
        return None
    return float(2.0 / (np.sqrt(top2) * abs(low1 - top1 / top2))), miss


SURE = 0.2  #: relative scatter beyond which the mass from pairs of rows is unknown
#: The same of a line through a run too short for pairs. Of 683 such runs of six laws, with cubic springs, neighbours or
#: one wing alone, none below it is off by more than a factor of 1.67, none has an offset beyond 0.68 rad.
SURE_OF_LINE = 0.05
#: Misfit of Re Y by a straight line from which a run does not show its mass. Below it are 444 of 470 runs of six laws,
#: all within a factor of 1.27, and 67 of 325 read in steps of a tenth to a third, one of which is off by more.
STRAIGHT = 0.1


@dataclass(frozen=True)
class Leg:
    """A run, what its phases as recorded imply (``turn``), and the corrected ``lag`` (n,).

    ``lag`` is None without phases or if they are incoherent.
    """

    run: Run
    turn: Implied | None
    lag: FloatArray | None

    @cached_property
    def resonant(self) -> bool:
        """Whether the run contains a resonance; a run of few rows is assumed to."""
        return len(self.run) < FEWEST_ROWS or has_resonance(self.run, self.lag)

    @property
    def on_line(self) -> bool:
        """Whether Re Y of its rows lies on a line, as far as phases tell.

        Readings near the resolution of an instrument do not: the smaller they are, the smaller the mass.
        """
        return self.turn is None or self.lag is None or self.turn.bend < STRAIGHT

    @property
    def paired(self) -> bool:
        """Whether phases on both sides of resonance show the mass, whatever the spring."""
        return self.turn is not None and self.lag is not None and self.turn.both_sides

    @cached_property
    def mass(self) -> tuple[float, bool]:
        """Mass that the run implies (NaN: none), and whether from phases or from a resonance that is not bent."""
        if self.turn is None or self.lag is None:
            return estimate_mass_without_phase(self.run) or (float("nan"), False)
        sure = self.turn.scatter < (SURE if self.turn.both_sides else SURE_OF_LINE)
        return abs(self.turn.mass) if sure else float("nan"), True


#: Rows of at least this share of the largest A/F show a sweep rate, and are corrected for it; the others are noise,
#: tails, and beats after the peak.
NEAR = 0.35
#: Slopes of the phase are taken over one row on either side, and one more for each further group of this many rows.
ROWS_A_SIDE = 30
FREE_ROWS = 8  #: fewest degrees of freedom of the fit over all runs
CERTAIN_RATE = 8.0  #: a rate is accepted from this many standard errors, if its residual sum of squares is at most
OF_STEADY = 0.35  #: this share of that without a rate,
OF_SPRING = 0.6  #: and this share of that of a spring whose stiffness changes with amplitude


def detect_rate(runs: Sequence[Run]) -> float | None:
    """Sweep rate r = (d omega/dt)/omega, 1/s, common to all runs; None if they show none.

    For the slow envelope of a swept motion, Re Y = K - M omega^2 + 2 r M omega^2 d phase/d omega, fitted by least
    squares to rows near resonance with a stiffness K for every run. A spring whose stiffness changes with amplitude,
    K + k A + l A^2, must fit worse.
    """
    rows = [part for k, run in enumerate(runs) if (part := _list_terms(run, k, len(runs))) is not None]
    if not rows:
        return None
    linear, slope, spring, real = (np.concatenate([part[n] for part in rows]) for n in range(4))
    count = len(real) - linear.shape[1] - 1
    if count < FREE_ROWS:
        return None
    solution, misfit, spread = _solve(np.column_stack([linear, slope]), real)
    steady, bent = _solve(linear, real)[1], _solve(np.column_stack([linear, spring]), real)[1]
    error = spread * np.sqrt(misfit / count)
    certain = abs(solution[-1]) > CERTAIN_RATE * error and misfit < OF_STEADY * steady and misfit < OF_SPRING * bent
    return float(solution[-1] / solution[-2]) if certain and solution[-2] > 0.0 else None


def _list_terms(run: Run, number: int, count: int) -> tuple[FloatArray, ...] | None:
    """Columns of every K and M (n, count + 1), of the rate (n,), of a spring (n, 2), and Re Y (n,), times A/F."""
    if run.phase is None or len(run) < FEWEST_ROWS or np.any(np.diff(run.omega) <= 0.0):
        return None
    lag, side = np.unwrap(run.phase), 1 + len(run) // ROWS_A_SIDE
    slope = np.empty(len(run))  # of the line through the points up to ``side`` places from each
    for k in range(len(run)):
        part = slice(max(k - side, 0), k + side + 1)
        u = run.omega[part] - np.mean(run.omega[part])
        slope[k] = u @ lag[part] / (u @ u)
    weight = run.A / run.F
    near = weight >= NEAR * weight.max()
    stiffness = np.zeros((len(run), count))
    stiffness[:, number] = 1.0
    columns = (
        np.column_stack([stiffness, -(run.omega**2)]),
        2.0 * run.omega**2 * slope,
        np.column_stack([run.A, run.A**2]),
        run.stiffness.real,
    )
    return tuple((column.T * weight).T[near] for column in columns)


def _solve(design: FloatArray, target: FloatArray) -> tuple[FloatArray, float, float]:
    """Least squares with scaled columns: solution, residual sum of squares, and sd of the last value for unit noise."""
    size = np.linalg.norm(design, axis=0)
    size[size == 0.0] = 1.0
    solution = np.linalg.lstsq(design / size, target)[0] / size
    residual = target - design @ solution
    spread = np.sqrt(np.linalg.pinv((design / size).T @ (design / size))[-1, -1]) / size[-1]
    return solution, float(residual @ residual), float(spread)
