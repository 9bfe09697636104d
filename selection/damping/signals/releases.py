"""Releases in a time history: where free motion begins, begins again, what of it is lost, and what beats with it."""

from math import ceil, log10

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray
from damping.errors import AnalysisError
from damping.signals.windows import Window

LARGEST_LOSS = 1.1  #: ratio of the largest motion to the first level from which the loss of the start is reported
LARGEST_GROWTH = 1.5  #: a single mode does not grow again by more: noise and the window's image cause less growth
_LISTED = 12  # most releases that a message lists
#: A decay ends at a floor if the median amplitudes of the halves of its last eighth differ by less than this, in ln,
#: after a fall by this factor. With a force in A^3, the slowest fall there is, A = t^(-1/2), they differ by 0.03.
_PARTS = 8
_STAYS = 0.01
_FALLEN = 3.0
#: A frequency swings if it turns back by this many standard errors and by this share of the decay rate; a beat if it
#: turns back so often. One mode turns back once at most, where a joint softens it below the level at which it hardens:
#: of 180 decays of one mode none turned back twice, of 133 beats of two that did not grow 48 did.
_SWING = 3.0
_OF_RATE = 0.2
_TURNS = 2
#: Largest factor between the decay that levels have and the fall of amplitude from the first to the last of them, and
#: standard errors by which it must be exceeded. Of 1493 decays of one mode, of four kinds of damping, with noise up to
#: 10 %, none exceeded it; of 407 beats of two 33 did, with damping ratios up to 2.5 times too large.
_ADDS_UP = 1.2
_SURE = 3.0
_LEVEL_OFF = 1e-6  #: change of ln of a decay rate below which it counts as constant: a quotient loses its digits there


def find_release(x: FloatArray, z: ComplexArray, window: Window, cycles: float) -> int:
    """First index of z (n,) whose window contains only free motion; ``cycles``: of x per sample.

    z is largest while its window still reaches into the rest before the release, where it does not fall as the motion
    does. The change of free motion over a quarter of a period stays below half of its largest for a sixth of a period
    at a time: if it takes longer to reach half, there was rest, be it at zero or pulled aside.
    """
    largest, quarter = int(np.argmax(np.abs(z))), round(0.25 / cycles)
    change = x.copy()
    change[quarter:] -= x[:-quarter]
    near = np.abs(change[largest : largest + len(window.offsets)])
    release = largest + int(np.argmax(near >= 0.5 * np.max(near))) - int(1.0 / (6.0 * cycles))
    return min(max(largest, release), len(z) - 1)


def find_releases(size: FloatArray, least: float, block: int) -> list[tuple[int, int]]:
    """First index of each rise of size (n,) to more than ``least``, and that of its smallest value before the next.

    A rise is by more than ``LARGEST_GROWTH``, from one ``block`` of samples to another.
    """
    tops = [float(np.max(size[k : k + block])) for k in range(0, len(size), block)]
    rises, low, is_rising = list[int](), 0.0, False
    for k, top in enumerate(tops):
        was_rising, is_rising = is_rising, top > max(least, LARGEST_GROWTH * low)
        if is_rising and not was_rising:
            rises.append(k)
        low = top if is_rising else min(low, top)
    starts = [k * block for k in rises]
    pairs = zip(starts, [*starts[1:], len(size)], strict=False)
    peaks = [(a, a + int(np.argmax(size[a:b])), b) for a, b in pairs]
    return [(a, peak + int(np.argmin(size[peak:b]))) for a, peak, b in peaks]


def describe_releases(
    times: FloatArray, x: FloatArray, z: ComplexArray, window: Window, cycles: float, least: float
) -> str:
    """Options that take every release of a motion x (n,) as a decay of its own; '' if there is only one.

    ``times``: s, of the middle of the window of z, the windowed x; ``cycles``: of x per sample; ``least``: smallest
    amplitude of a release. A start is rounded up by at most a tenth of a period.
    """
    long = len(window.offsets)
    releases = find_releases(np.abs(z), least, long)
    digits = max(ceil(log10(10.0 * window.omega_0 / RAD_S_PER_HZ)), 0)
    options = []
    for rise, end in releases[:_LISTED]:
        first = rise + find_release(x[rise : end + long], z[rise : end + 1], window, cycles)
        start = ceil((times[first] - 0.5 * window.length) * 10.0**digits) / 10.0**digits
        options.append(f"--start {start:.{digits}f} --end {times[end]:.{digits}f}")
    more = f" and {len(releases) - _LISTED} more" if len(releases) > _LISTED else ""
    return " ".join(options) + more if len(releases) > 1 else ""


def describe_lost(peak: float, since: float, largest: float, size: float) -> list[str]:
    """Note on the loss between the largest reading, at ``peak``, and the first window, of amplitude ``size``."""
    if peak >= since or largest <= LARGEST_LOSS * size:
        return []
    return [
        f"the start is lost to half the window: {since - peak:.3g} s, in which the amplitude falls by at most "
        f"{100.0 * (1.0 - size / largest):.2g} %; fewer --periods (4 or more) lose less"
    ]


def find_return(size: FloatArray, least: float, pause: int) -> float:
    """Largest amplitude (n,) above ``least`` that has grown from a smaller one before it, or that stays; 0 if none.

    A tone beside the mode beats with its decay as soon as this has come down to it; one at its frequency is a floor at
    the end. What follows more than ``pause`` samples without motion is another blow; ``pause`` is the length of the
    window, whose negative ends make a motion that stops at once, as with friction, grow within it.
    """
    moving = np.flatnonzero(size > least)
    pauses = np.flatnonzero(np.diff(moving) > pause)
    last = int(moving[pauses[0] if len(pauses) else -1]) if len(moving) else 0
    size = size[: max(last - pause, 0) + 1] if last < len(size) - 1 else size
    grown = size[(size > LARGEST_GROWTH * np.minimum.accumulate(size)) & (size > least)]
    return float(np.max(grown, initial=_find_floor(size, least)))


def _find_floor(size: FloatArray, least: float) -> float:
    """The amplitude (n,) at which a decay ends if it stays there, above ``least``; else 0."""
    tail = size[-max(len(size) // _PARTS, 1) :]
    if not (len(tail) > _PARTS and tail.min() > least):
        return 0.0
    halves = [float(np.median(half)) for half in np.array_split(tail, 2)]
    stays = abs(np.log(halves[0] / halves[1])) < _STAYS and size[0] > _FALLEN * halves[0]
    return halves[1] if stays else 0.0


_APART = (
    "choose a part without (--start, --end), or a sensor or a blow that moves one mode alone; of several sensors "
    "damping campaign --modes F1,F2 parts the modes"
)


def report_growth(since: float) -> AnalysisError:
    """The error on a decay that grows from the time ``since`` on."""
    return AnalysisError(f"the decay grows again from {since:.4g} s on: two modes that beat, or another blow; {_APART}")


def refuse_gaps(levels: pd.DataFrame, surely: pd.DataFrame) -> list[str]:
    """Caution on levels that are only those parts of a beat in which the sum of two modes falls fast.

    AnalysisError: they are so among those that no tone beside the mode makes doubtful, ``surely``.
    """
    if (times := _compare_falls(surely)) > 0.0:
        since, end = surely["t"].iloc[0], surely["t"].iloc[-1]
        raise AnalysisError(
            f"the levels whose decay can be read lose {times:.2g} times what the amplitude loses from {since:.4g} to "
            f"{end:.4g} s: two modes that beat, of which only the parts that fall fast are read; {_APART}"
        )
    if (times := _compare_falls(levels)) == 0.0:
        return []
    read = f"all levels lose {times:.2g} times what the amplitude loses between the first and the last of them"
    return [f"caution: {read}, as parts of a beat that fall fast do: every damping ratio may be too large; {_APART}"]


def _compare_falls(levels: pd.DataFrame) -> float:
    """Decay of levels over the fall of their amplitude, if it is surely above ``_ADDS_UP``; else 0.

    ``levels``: one row each, largest first, with the time ``t``, ``A``, ``delta`` and its standard error ``sd_delta``.
    Where one is left out, the decay rate is taken as a power of e in time between its neighbours, whose mean is the
    logarithmic one: that of friction alone grows by large factors.
    """
    t, A, delta, sd = (levels[name].to_numpy(dtype=np.float64) for name in ("t", "A", "delta", "sd_delta"))
    if len(t) < 2:
        return 0.0
    of_each, fall = 0.5 * (np.diff(t, append=t[-1]) + np.diff(t, prepend=t[0])), float(np.log(A[0] / A[-1]))
    steps = np.diff(np.log(np.maximum(delta, np.finfo(np.float64).tiny)))
    means = np.where(np.abs(steps) > _LEVEL_OFF, np.diff(delta) / np.where(steps == 0.0, 1.0, steps), delta[1:])
    found, error = float(np.diff(t) @ means), float(np.linalg.norm(of_each * sd))
    return found / fall if found - _ADDS_UP * fall > _SURE * error else 0.0


def describe_beat(levels: pd.DataFrame) -> list[str]:
    """Caution on a decay whose frequency swings from level to level, as with two modes whose sum never grows.

    ``levels``: one row each, largest first, with ``omega``, ``delta`` and ``sd_delta``, the standard error of both.
    """
    omega, delta, sd = (levels[name].to_numpy(dtype=np.float64) for name in ("omega", "delta", "sd_delta"))
    turns, last, way = 0, 0, 0.0
    for k in range(1, len(omega)):
        moved, least = omega[k] - omega[last], max(_SWING * np.hypot(sd[k], sd[last]), _OF_RATE * min(delta[[k, last]]))
        if moved * way > 0.0:
            last = k
        elif abs(moved) > least:
            turns, last, way = turns + (way != 0.0), k, float(np.sign(moved))
    if turns < _TURNS:
        return []
    ends = f"{omega.min() / RAD_S_PER_HZ:.4g} to {omega.max() / RAD_S_PER_HZ:.4g} Hz"
    advice = "take a sensor or a blow that moves one mode alone, or part the modes with damping campaign --modes F1,F2"
    return [
        f"caution: the frequency swings up and down from level to level ({ends}), as where a second mode or hum beats "
        f"with the decay: frequency and damping of single levels are doubtful; {advice}"
    ]
