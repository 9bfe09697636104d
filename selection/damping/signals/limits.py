"""Readings that stand at their limit: a sensor or an amplifier that clips, whose amplitudes are too small.

A signal spends little time near its largest value: of a sine resolved to steps, the last step holds some 2.4 times the
samples of the one before it, whatever the resolution, since the time above 1 - e goes as sqrt(e). One that is clipped
comes back to its largest value again and again and holds it, so that there it has many times the samples of the value
before. A value that is held once, as before a release, is no limit. Not seen: a gain that falls off before a limit, one
that noise comes after, and in fewer than some 1000 steps a decay, whose later peaks pass the value before.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from damping.arrays import FloatArray

FEWEST_SAMPLES = 8  #: samples at a limit
FEWEST_VISITS = 3  #: times that a signal comes to a limit
CROWDED = 8.0  #: samples at a limit over those at the value before it: some 2.4 of a sine in steps


class Limits:
    """The largest and smallest values of some channels, noted block by block, and which of them are limits."""

    def __init__(self) -> None:
        #: (samples, visits) by value, of the two last values: of each channel upwards, then of each downwards
        self._ends: list[dict[float, tuple[int, int]]] = []

    def watch(self, blocks: Iterable[FloatArray]) -> Iterator[FloatArray]:
        """The blocks (channels, n) as they come, their ends noted."""
        for block in blocks:
            self.note(block)
            yield block

    def note(self, block: FloatArray) -> None:
        """Note the ends of samples (channels, n)."""
        both = [sign * row for sign in (1.0, -1.0) for row in block]
        self._ends = self._ends or [{} for _ in both]
        for ends, x in zip(self._ends, both, strict=True):
            for value in _list_largest(x):
                at = x == value
                samples, visits = ends.get(value, (0, 0))
                came = int(at[0]) + int(np.count_nonzero(at[1:] & ~at[:-1]))
                ends[value] = (samples + int(np.count_nonzero(at)), visits + came)
            for value in sorted(ends)[:-2]:
                del ends[value]

    @property
    def found(self) -> list[float | None]:
        """The limit of each channel, its size; None of one that has none."""
        limits, half = [_find_limit(ends) for ends in self._ends], len(self._ends) // 2
        either = zip(limits[:half], limits[half:], strict=True)
        return [upper if upper is not None else lower for upper, lower in either]


def _list_largest(x: FloatArray) -> list[float]:
    """The two largest values of x (n,) that differ, or the one that there is."""
    largest = float(np.max(x, initial=-np.inf))
    below = x[x < largest]
    return [largest, float(np.max(below))] if below.size else [largest] if x.size else []


def _find_limit(ends: dict[float, tuple[int, int]]) -> float | None:
    if len(ends) < 2:
        return None
    before, last = sorted(ends)
    samples, visits = ends[last]
    stands = samples >= FEWEST_SAMPLES and visits >= FEWEST_VISITS and samples > CROWDED * ends[before][0]
    return abs(last) if stands else None


def find_limit(x: FloatArray) -> float | None:
    """Size of the limit at which x (n,) stands again and again; None where there is none."""
    limits = Limits()
    limits.note(x[np.newaxis])
    return limits.found[0]
