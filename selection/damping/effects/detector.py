"""A slow detector: its reading follows the motion with a time constant, low and late while a mode is swept."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from damping.arrays import BoolArray, ComplexArray, FloatArray, Floats, join_complex, of_every
from damping.effects.contract import Drive, Effect, Form, Scales, Terms
from damping.effects.moving import accumulate, find_rate, order_swept

#: Usual time constant, those from which fits start, and the largest one, over the time in which the frequency passes
#: half of the half-power width: from a shift that is hardly seen to one by a whole sweep.
_USUAL = 0.3
_TIMES = (0.2, 0.6, 1.5, 4.0)
_SLOWEST = 20.0
#: Ages in time constants, and shares, of what a reading is the mean of: as of exp(-age), exact for powers up to 11.
_AGES = tuple(zip(*np.polynomial.laguerre.laggauss(6), strict=True))
_STEP = 1e-6  #: of ln omega_n, for the derivative of a reading by it


def averaged(x: ComplexArray, time: Floats, rate: Floats, drive: Drive, begun: Floats = 0.0) -> ComplexArray:
    """y of y' = (x - y)/``time`` along each sweep of phasors x (batch, n); x itself where no ``rate`` moves omega.

    Between rows x is a cubic with the slopes of 1/x, which beside a resonance is almost a line. For a cubic
    p = x - T x' + T^2 x'' - T^3 x''' is a solution, and y - p decays. Long before its first row a sweep has 1/x on a
    line, of which y is the mean; where it begins there (``begun`` 1, see `Terms`), y is x.
    """
    rate = np.broadcast_to(rate, x.shape)
    order, parted = order_swept(np.sign(rate.reshape(-1, rate.shape[-1])[0]), drive)
    x, rate = x[..., order], rate[..., order]
    moved, mean = np.diff(drive.omega[order]), 0.5 * (rate[..., 1:] + rate[..., :-1])
    parted = parted | (mean == 0.0) | (moved == 0.0)
    h = np.where(parted, 1.0, np.abs(moved / np.where(parted, 1.0, mean)))
    by_time = _list_slopes(x, h, parted)
    T, a, b = np.asarray(time), by_time[..., :-1], by_time[..., 1:]
    secant = np.diff(x) / h
    third = 6.0 * (a + b - 2.0 * secant) / h**2
    before = x[..., :-1] - T * (a - T * ((6.0 * secant - 4.0 * a - 2.0 * b) / h - T * third))
    after = x[..., 1:] - T * (b - T * ((2.0 * a + 4.0 * b - 6.0 * secant) / h - T * third))
    long = sum(share * x * x / (x + age * T * by_time) for age, share in _AGES)
    start = np.asarray(long + begun * (x - long))
    decay = np.where(parted, 0.0, np.exp(-h / T))
    further = np.where(parted, start[..., 1:], after - decay * before)
    return accumulate(start[..., :1], further, decay)[..., np.argsort(order)]


def _list_slopes(x: ComplexArray, h: FloatArray, parted: BoolArray) -> ComplexArray:
    """Slopes of x by time at each row, from those of the parabola through 1/x there and at its neighbours.

    ``h``: times between rows; ``parted``: those of no one sweep. At the ends of a sweep: those of the line.
    """
    inverse = np.reciprocal(x)
    weight = np.where(parted, 0.0, 1.0 / h)
    ends = [(0, 0)] * (x.ndim - 1)
    slopes = np.pad(np.diff(inverse) / h * weight, [*ends, (1, 1)])
    weights = np.pad(weight, [*[(0, 0)] * (weight.ndim - 1), (1, 1)])
    total = weights[..., 1:] + weights[..., :-1]
    slope = (slopes[..., 1:] + slopes[..., :-1]) / np.where(total == 0.0, 1.0, total)
    return np.asarray(-slope * x * x)


def detect(
    P: ComplexArray, by_frequency: ComplexArray, terms: Terms, drive: Drive, every: int = 1
) -> tuple[ComplexArray, ComplexArray]:
    """ln of the reading of a slow detector from that of its input P, (batch, n), and its derivative by ln omega_n.

    ``every``: see `damping.effects.terms.predict`. ``terms.averaging`` says of what.
    """

    time, rectified = terms.averaging or (0.0, False)
    parts = (time, find_rate(terms, drive), terms.begun)

    def read(P: ComplexArray, every: int) -> ComplexArray:
        time, rate, begun = (of_every(part, every) for part in parts)
        x = np.exp(P.real if rectified else P).astype(np.complex128)
        y = np.log(averaged(x, time, rate, drive, begun))
        return join_complex(y.real, P.imag) if rectified else y

    y = read(P, 1)
    moved = read(of_every(P, every) + _STEP * by_frequency, every) - of_every(y, every)
    return y, join_complex(moved.real, np.arctan2(np.sin(moved.imag), np.cos(moved.imag))) / _STEP


def detector_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the time constant. An averaged phasor, or an averaged amplitude; none where no sweep rate is known."""
    if not scales.rate:
        return ()
    # small ones shift the resonance, as its frequency does: only whole steps lower and skew it
    natural = scales.bandwidth * scales.omega_n / scales.rate
    sizes = tuple(natural * size for size in _TIMES)

    def form(rectified: float) -> Form:
        def report(time: Floats) -> dict[str, Floats]:
            return {"time": time, "rectified": rectified}

        return SLOW_DETECTOR.form(report, _USUAL * natural, largest=_SLOWEST * natural, sizes=sizes, whole=True)

    return form(0.0), form(1.0)


def simulate_detector(terms: Terms, table: Mapping[str, Any]) -> Terms:
    """The reading averaged over ``time``, in s, with its phase or, ``rectified``, without."""
    return terms._replace(averaging=(table["time"], table["rectified"] == 1.0))


SLOW_DETECTOR = Effect(
    name="slow-detector",
    kind="instrument",
    sentence="a detector or filter that averages the reading while the frequency moves",
    forms=detector_forms,
    simulate=simulate_detector,
    need="sweep",
)
