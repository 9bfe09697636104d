"""Damping ratio, Q and frequency against amplitude and force, with predictive bands.

At phase resonance the damping force carries the drive, C(A, omega) = F. Viscous damping c = C/(omega A) loses as much
energy per cycle, pi C A (:mod:`damping.forces.contract`), and its ratio to the critical 2 M omega is

    zeta = C/(2 M omega^2 A) = F/(2 M omega^2 A),    Q = 1/(2 zeta),    loss factor 2 zeta,

with omega(A) on the backbone, M omega^2 A = K A + S (:mod:`damping.extrapolation.backbone`). For C = c omega A this
is c/(2 M omega); for C = b A^m omega^n it is b A^(m-1) omega^(n-2)/(2 M). Amplitudes at forces are the predictions of
:mod:`damping.extrapolation`. The force for an amplitude needs no further draws: amplitude grows with force, so that

    P(force for A < F) = P(amplitude at F > A),

and the quantiles of force lie where those of amplitude cross A. Uncertainties of mass and frequency are independent of
that of amplitude; their squares are added in ln zeta.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from scipy.special import ndtri

from damping.arrays import RAD_S_PER_HZ, BoolArray, FloatArray, join_rows
from damping.extrapolation import Extrapolation
from damping.extrapolation.backbone import Backbone, Interval
from damping.extrapolation.cautions import REFUSAL, UNKNOWN, list_cautions
from damping.extrapolation.levels import OF_PREDICTED, describe_bistability
from damping.extrapolation.plan import NEAREST, ROUNDING
from damping.extrapolation.prediction import Band, Loads
from damping.forces import damping_ratio
from damping.infer.discrepancy import SLOPES
from damping.infer.observations import Observations
from damping.records.keys import LARGEST, SMALLEST

#: Steepest local exponent d ln F/d ln A that damping can have: it sets the range of the grid of forces.
STEEPEST = 1.0 / SLOPES[0]
GRID = 20  #: fewest forces of that grid; ln A is interpolated linearly in ln F
STEP = 0.5  #: largest step of ln F: so fine that the force for one amplitude is independent of the others requested
#: Grid forces from one that moves no draw to one that moves nearly all: where friction holds the mode, A falls to 0
#: linearly and not as a power.
FRICTION = 16
LEAP = 2.0  #: largest ratio of amplitudes over a step of forces in a decay, whose force may hardly change
MOST_PARTS = 8  #: most parts that a step of larger ratio is split into
TURNS = 2  #: rounds of splitting: a force is then known to a sixtieth of the step
_MARGIN = 2.5  #: factor of the grid beyond the force of the steepest law, for the ends of a band
WITHIN = 9  #: amplitudes within the test of a default curve, beside those of the levels
SAME = 0.02  #: distance in ln from one of them within which a level gets no further row
#: Caution on a predicted amplitude without a damping ratio.
NO_RATIO = "no damping ratio: the frequency of the resonance is not known at this amplitude"
#: Amplitudes of a plot: over two decades they lie 1.12 times apart; the damping peak of a joint is 1.4 times wide.
DRAWN = 40
BEYOND = 7  #: amplitudes beyond the test of a default curve
#: End of a default curve over the largest tested force; the first if there are too few levels for the second.
FARTHEST = (NEAREST, 2.0)


@dataclass(frozen=True)
class Curve:
    """Resonances at rising amplitudes, or at the requested points."""

    level: float  #: content of the bands
    amplitude: Interval  #: without a band where it was given
    force: Interval  #: without a band where it was given
    frequency: Interval  #: Hz
    damping_ratio: Interval  #: of critical damping
    tested: BoolArray  #: whether the amplitude, or the given force, lies within the range of the fitted rows
    cautions: tuple[tuple[str, ...], ...]  #: a tuple for each row

    @property
    def q(self) -> Interval:
        """Quality factor 1/(2 zeta)."""
        zeta = self.damping_ratio
        return Interval(0.5 / zeta.median, 0.5 / zeta.high, 0.5 / zeta.low)

    @property
    def table(self) -> pd.DataFrame:
        """One row for each resonance: medians under the name of the quantity, bands as ``NAME_low, NAME_high``."""
        columns: dict[str, FloatArray | BoolArray | list[str]] = {}
        for name in ("amplitude", "force", "frequency", "damping_ratio", "q"):
            interval = getattr(self, name)
            columns |= {name: interval.median, f"{name}_low": interval.low, f"{name}_high": interval.high}
        joined = ["; ".join(caution) for caution in self.cautions]
        return pd.DataFrame({**columns, "tested": self.tested, "cautions": joined})


def list_default_amplitudes(predicted: Extrapolation) -> FloatArray:
    """Amplitudes of a default curve: over the test, at its levels, and beyond up to the largest predicted one."""
    data = predicted.plan.data
    beyond = float(np.nan_to_num(predicted.loads.average.median).max())
    low, high = float(data.A.min()), float(data.A.max())
    within = np.geomspace(low, high, WITHIN) if high > low * (1.0 + ROUNDING) else np.array([high])
    levels = np.exp(np.bincount(data.levels, np.log(data.tested_amplitude)) / np.bincount(data.levels))
    apart = np.abs(np.log(levels[:, np.newaxis] / within)).min(axis=1) > SAME
    within = np.sort(np.append(within, levels[apart]))
    if not beyond > high * (1.0 + ROUNDING):
        return within
    return np.concatenate([within, np.geomspace(high, beyond, BEYOND + 1)[1:]])


def list_drawn_amplitudes(amplitudes: FloatArray, data: Observations) -> FloatArray:
    """Amplitudes for a plot of the curve at ``amplitudes`` (rows,), NaN ignored: these, tested ones, and others."""
    known = amplitudes[np.isfinite(amplitudes)]
    if not known.size:
        return known
    low, high, tested = known.min(), known.max(), data.tested_amplitude
    within = tested[(tested > low) & (tested < high)]
    return np.unique(np.concatenate([known, within, np.geomspace(low, high, DRAWN)[1:-1]]))


def predict_forces(predicted: Extrapolation, amplitudes: Sequence[float] | FloatArray, *, each: bool = True) -> Loads:
    """The force for each amplitude: :class:`Loads` with the given ``amplitude`` and bands of force.

    ``each``: whether to make the band of each law too. ``linear`` is the force by the viscous coefficient of the sweep
    with the largest tested force. A force beyond the plan's limit is refused as in predictions of amplitude.
    """
    asked, plan, data = np.asarray(amplitudes, dtype=float), predicted.plan, predicted.plan.data
    grid, loads = _search_forces(predicted, asked, each)
    average = _invert_band(loads.average, grid, asked, plan.limit)
    average, unknown = average.leave_out(asked, data)
    top = data.top
    predicted_there = np.isfinite(average.median)
    linear = np.where(predicted_there, data.tested_force[top] * asked / data.tested_amplitude[top], np.nan)
    weights = [member.weight for member in predicted.members]
    refusal = f"{REFUSAL}: no force is known that reaches this amplitude"
    if np.isfinite(plan.limit):
        refusal = f"{REFUSAL}: too few levels to predict damping beyond the {plan.described_limit}"
    return Loads(
        force=average.median,
        level=loads.level,
        average=average,
        by_model=tuple(
            _invert_band(band, grid, asked, plan.limit).keep(~unknown).leave_out(asked, data)[0]
            for band in loads.by_model
        ),
        parts=_convert_parts(loads, average.median),
        linear=linear,
        ratio=average.median / data.tested_force[top],
        cautions=tuple(
            (list_cautions(f, A, data, weights, plan) if p else (UNKNOWN if far else refusal,))
            for f, A, p, far in zip(average.median, asked, predicted_there, unknown, strict=True)
        ),
        limit=plan.limit,
        amplitude=asked,
    )


@np.errstate(divide="ignore", invalid="ignore")  # amplitudes may be infinite
def _convert_parts(loads: Loads, force: FloatArray) -> dict[str, FloatArray]:
    """Parts of the band of force at each ``force`` (rows,), by the slope of ln F(ln A) over a grid of ``loads``."""
    moves = loads.average.median > 0.0
    if moves.sum() < 2:
        return dict.fromkeys(loads.parts, np.full(len(force), np.nan))
    log_F = np.log(loads.force[moves])
    steep = np.gradient(log_F) / np.gradient(np.log(loads.average.median[moves]))
    return {name: np.interp(np.log(force), log_F, part[moves] * steep) for name, part in loads.parts.items()}


def _search_forces(predicted: Extrapolation, asked: FloatArray, each: bool) -> tuple[FloatArray, Loads]:
    """Forces from ``SMALLEST`` to ``LARGEST`` that reach the amplitudes ``asked``, and predictions there, unlimited."""
    data = predicted.plan.data
    down = STEEPEST * min(0.0, math.log(asked.min() / data.tested_amplitude.min())) - math.log(_MARGIN)
    up = STEEPEST * max(0.0, math.log(asked.max() / data.tested_amplitude.max())) + math.log(_MARGIN)
    unlimited = replace(predicted, plan=replace(predicted.plan, limit=np.inf))
    predict_at = partial(unlimited.predict_at, each=each, to_invert=True)
    low = math.exp(max(math.log(data.tested_force.min()) + down, math.log(SMALLEST)))
    high = math.exp(min(math.log(data.tested_force.max()) + up, math.log(LARGEST)))
    points = np.geomspace(low, high, max(GRID, 1 + int(np.ceil(np.log(high / low) / STEP))))
    grid = np.unique(np.concatenate([points, data.tested_force]))
    loads = predict_at(grid)
    if data.amplitude_is_input:
        return _refine(predict_at, grid, loads, asked)
    held = grid[~(loads.average.low > 0.0) & (grid < data.tested_force.min())]
    if held.size and asked.min() < data.tested_amplitude.min():
        still = held[~(loads.average.high[: held.size] > 0.0)].max(initial=grid[0])
        beyond = grid[grid > held[-1]]
        grid = np.concatenate([np.linspace(still, beyond[0], FRICTION), beyond[1:]])
        loads = predict_at(grid)
    return grid, loads


def _refine(
    predict_at: Callable[[FloatArray], Loads], grid: FloatArray, loads: Loads, asked: FloatArray
) -> tuple[FloatArray, Loads]:
    """The grid of forces for a decay, refined where an end of the band leaps over the amplitudes ``asked``."""
    within = np.log([asked.min() / LEAP, asked.max() * LEAP])
    for _ in range(TURNS):
        ends = (loads.average.low, loads.average.median, loads.average.high)
        with np.errstate(divide="ignore"):
            log_A = np.clip(np.log(ends), *within)
        leaps = np.nan_to_num(np.abs(np.diff(log_A, axis=1)).max(axis=0)) / np.log(LEAP)
        parts = np.clip(np.ceil(leaps), 1, MOST_PARTS).astype(np.int64)
        if parts.max() == 1:
            break
        steps = zip(grid[:-1], grid[1:], parts, strict=True)
        added = np.concatenate([np.linspace(a, b, n, endpoint=False)[1:] for a, b, n in steps])
        loads = join_rows([loads, predict_at(added)])
        loads = loads.at(np.argsort(loads.force))
        grid = loads.force
    return grid, loads


def _invert_band(band: Band, grid: FloatArray, asked: FloatArray, limit: float) -> Band:
    """The band of force for each amplitude, from the band of amplitude over a grid of forces."""
    median = find_crossing(grid, band.median, asked)
    median = np.where(median <= limit * (1.0 + ROUNDING), median, np.nan)

    def cross(curve: FloatArray) -> FloatArray:
        return np.where(np.isfinite(median), find_crossing(grid, curve, asked), np.nan)

    ends = (band.high, band.low, band.credible_high, band.credible_low)  # the high amplitude gives the low force
    return Band(band.name, band.weight, median, *map(cross, ends))


def find_crossing(force: FloatArray, amplitude: FloatArray, asked: FloatArray) -> FloatArray:
    """Force at which a curve of amplitude first reaches each amplitude ``asked``; NaN outside the curve.

    Arguments (grid,), (grid,) and (rows,), forces rising. The curve is linear in the logarithms between points, and
    linear in force and amplitude from the last force at which friction holds the mode to the first that moves it.
    """
    known = np.isfinite(amplitude) & (amplitude > 0.0)
    if known.sum() < 2:
        return np.full(len(asked), np.nan)
    first = int(np.argmax(known))
    held = force[first - 1] if first and amplitude[first - 1] == 0.0 else np.nan
    grown = np.maximum.accumulate(np.log(amplitude[known])) + 1e-12 * np.arange(int(known.sum()))
    reached = np.exp(np.interp(np.log(asked), grown, np.log(force[known]), left=np.nan, right=np.nan))
    below = held + (force[first] - held) * np.minimum(asked, amplitude[first]) / amplitude[first]
    return np.where(asked < amplitude[first], below, reached)


def trace_loads(loads: Loads, backbone: Backbone, data: Observations) -> Curve:
    """The curve through predictions of amplitudes or of forces; ``data``: the fitted rows."""
    predicted, of_force = Interval(loads.average.median, loads.average.low, loads.average.high), loads.amplitude is None
    asked = loads.force if loads.amplitude is None else loads.amplitude
    known = Interval.known(np.where(np.isfinite(predicted.median), asked, np.nan))
    force, amplitude = (known, predicted) if of_force else (predicted, known)
    f, widened = _find_frequency(backbone, amplitude, loads.level)
    z = float(ndtri(0.5 * (1.0 + loads.level)))
    stiffness = backbone.mass_at(amplitude.median) * (RAD_S_PER_HZ * f.median) ** 2
    zeta = damping_ratio(force.median, amplitude.median, stiffness)
    spread = np.hypot(z * backbone.mass_sd, np.log(f.high / f.low))  # twice half the band of ln omega
    down = np.hypot(np.log(force.median / force.low) + np.log(amplitude.high / amplitude.median), spread)
    up = np.hypot(np.log(force.high / force.median) + np.log(amplitude.median / amplitude.low), spread)
    cautions, lowest = loads.cautions, float(backbone.omega[np.argmin(backbone.amplitude)])
    if data.tested_mass is None:  # masses of single levels would move their resonances too
        rows = zip(cautions, RAD_S_PER_HZ * f.median, zeta, strict=True)
        cautions = tuple(_add_jump(so_far, lowest, omega, ratio) for so_far, omega, ratio in rows)
    unknown = np.isfinite(predicted.median) & ~np.isfinite(zeta)
    cautions = tuple((NO_RATIO, *so_far) if no else so_far for so_far, no in zip(cautions, unknown, strict=True))
    reached = data.tested_force if of_force else data.A
    low, high = reached.min() * (1.0 - ROUNDING), reached.max() * (1.0 + ROUNDING)
    return Curve(
        level=loads.level,
        amplitude=amplitude if of_force else Interval.known(asked),
        force=Interval.known(asked) if of_force else force,
        frequency=widened,
        damping_ratio=Interval(zeta, zeta * np.exp(-down), zeta * np.exp(up)),
        tested=(asked >= low) & (asked <= high),
        cautions=cautions,
    )


def _find_frequency(backbone: Backbone, amplitude: Interval, level: float) -> tuple[Interval, Interval]:
    """The band of frequency at the median amplitude, and that widened by the uncertainty of the amplitude.

    The shift of the backbone from the median to each end of the amplitude band is added in squares of ln omega. NaN
    where the widened band leaves the mode (``backbone.ANOTHER_MODE``).
    """
    points = backbone.frequency_at(np.concatenate([amplitude.median, amplitude.low, amplitude.high]), level)
    rows = len(amplitude.median)
    f = Interval(points.median[:rows], points.low[:rows], points.high[:rows])
    moved = np.log(points.median[rows:].reshape(2, rows) / f.median)
    down, up = (np.fmax.reduce(sign * moved, initial=0.0) for sign in (-1.0, 1.0))
    below, above = np.hypot(np.log(f.median / f.low), down), np.hypot(np.log(f.high / f.median), up)
    with np.errstate(over="ignore"):
        low, high = f.median * np.exp(-below), f.median * np.exp(above)
    known = np.where(backbone.is_near(low) & backbone.is_near(high), 1.0, np.nan)
    f = Interval(known * f.median, f.low, f.high)
    return f, Interval(f.median, known * low, known * high)


def _add_jump(cautions: tuple[str, ...], lowest: float, omega: float, zeta: float) -> tuple[str, ...]:
    """Add the caution, if the tested levels gave none, that the mode is bistable at ``omega``, rad/s.

    ``lowest``: resonance of the lowest level.
    """
    jump = describe_bistability(np.array([lowest, omega]), 2.0 * zeta * omega, OF_PREDICTED)
    return cautions if not jump or any("bistable" in caution for caution in cautions) else (*cautions, jump)
