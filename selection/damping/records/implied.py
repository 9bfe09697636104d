"""Mass and phase offset that the rows of each run imply, without the mode file.

Each row with a phase measures the dynamic stiffness Y = F exp(i phase)/A = K - M omega^2 + (S + i C)/A. Re Y falls with
omega^2 at the rate M, and Im Y > 0, since a passive structure absorbs energy: otherwise the phase is not the lag of the
displacement. Without phases |Y|^2 is a parabola in omega^2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from damping.arrays import ComplexArray, FloatArray
from damping.records.pairs import ROWS_ASIDE, like_pairs, weighted_median
from damping.records.runs import FALL, FEWEST_ROWS, NO_PARABOLA, NOISE_BESIDE_FALL, Run, fit_parabola, has_resonance


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


#: Median distance of Y from a straight line, over |Y|, above which phases are unrelated to amplitudes.
INCOHERENT = 0.5
SMOOTH = 0.75  #: mean cosine of the steps of phase from row to row below which phases are not a smooth curve
MOST_RADIANS = 6.0 * pi  #: largest range of a phase over a few modes; phases in degrees pass 180
CERTAIN = 4.0  #: standard errors from 0 beyond which the sign of a mean sine of the phase is certain


def is_in_turns(run: Run) -> bool:
    """Whether the phases pass a resonance within one radian, and fit a line in Y better if read as turns."""
    assert run.phase is not None
    if np.abs(run.phase).max() > 1.0 or not has_resonance(run, None):
        return False
    return measure_miss(replace(run, phase=2.0 * pi * run.phase)) < measure_miss(run)


def is_incoherent(run: Run, turn: Implied) -> bool:
    """Whether the phases of a run are unrelated to its amplitudes, turn more than any mode can, or are in turns."""
    assert run.phase is not None
    in_turns = is_in_turns(run)
    if in_turns or len(run) < 6:
        return in_turns
    jumps = float(np.mean(np.cos(np.diff(run.phase)))) < SMOOTH
    return bool(np.ptp(np.unwrap(run.phase)) > MOST_RADIANS) or (turn.miss > INCOHERENT and jumps)


#: Conversion of each kind of phase to the lag of the displacement.
AS_LAG: dict[str, Callable[[FloatArray], FloatArray]] = {
    "": lambda phase: phase,
    "negated": lambda phase: -phase,
    "minus pi": lambda phase: phase + pi,
    "acceleration": lambda phase: pi - phase,
    "folded": lambda phase: np.mod(phase, pi),
}
#: Least cosine of a phase between -pi/2 and pi/2, with noise; its largest where A/F is largest: that of pi/4.
_WITHIN = -0.1
_TURNED = 0.7


def classify_phase(run: Run, turn: Implied) -> str:
    """Kind of a phase that is not a lag, of ``AS_LAG``; empty if it may be a lag.

    A lag between 0 and pi has a negative sine once negated or reduced by pi: a phase whose sine is positive at every
    row is neither, whatever line its rows follow beside the resonance.
    """
    assert run.phase is not None
    if is_folded(run.phase, int(np.argmax(run.compliance))):
        return "folded"
    half = abs(round(turn.offset / (0.5 * pi))) == 2  # the offset is nearest to half a turn
    kind = ("acceleration" if half else "negated") if turn.energy_sign < -CERTAIN else ""
    if half and turn.energy_sign > CERTAIN:
        kind = "minus pi"
    return "" if kind != "acceleration" and bool(np.all(np.sin(run.phase) > 0.0)) else kind


def is_folded(phase: FloatArray, peak: int) -> bool:
    """Whether a phase is a lag modulo pi, as an arc tangent gives: positive before resonance and negative after it.

    The lead of a velocity is so too, but passes 0 at resonance (row ``peak``).
    """
    if not 0 < peak < len(phase) - 1 or np.cos(phase).min() < _WITHIN or np.cos(phase[peak]) > _TURNED:
        return False
    return bool(np.median(phase[:peak]) > 0.0 > np.median(phase[peak + 1 :]))


def has_antiresonance(run: Run) -> bool:
    """Whether the phase, between 0 and pi, falls through pi/2 where A/F is least, as with a vibration absorber.

    The lead of an acceleration also falls through pi/2, but where A/F is largest.
    """
    if run.phase is None or np.mean(np.sin(run.phase)) <= 0.0:
        return False
    cos, g = np.cos(run.phase), run.compliance
    fallen = np.flatnonzero((cos[:-1] <= 0.0) & (cos[1:] > 0.0))
    if len(fallen) == 0:
        return False
    first, last = int(fallen[0]), int(fallen[-1]) + 1  # the rows about all falls, which resonances may surround
    if first == 0 or last == len(run) - 1:
        return False
    rise = min(g[:first].max(), g[last + 1 :].max()) - g[first : last + 1].max()
    return bool(rise > max(FALL, NOISE_BESIDE_FALL * run.noise))


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
