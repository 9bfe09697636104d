"""Poles of a level with amplitude-dependent damping (see `damping.campaign.modal_fit`), and the receptance G of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from damping.arrays import ComplexArray, FloatArray, Floats, IntArray, differs

CLUSTER = 0.15  #: modes closer than this share of their frequency are fitted together
BAND = 0.12  #: rows within this relative distance of a cluster belong to its band
_HALVINGS = 10  # bisections of the interval of rho, to 1e-3; Newton steps then reach 1e-12
_NEWTON_STEPS = 3
_STILL = 1e-9  #: amplitude, over that at the peak, of a row that friction holds
_FEWEST_ROWS = 6
_LEAST_FRICTION = 1e-3  #: smaller shares of friction are set to 0


@dataclass(frozen=True)
class Poles:
    """Modes of one level, rising in frequency: ``frequency`` f_k in Hz, ``ratio`` z_p, ``slope`` s, ``friction`` t.

    Each (modes,). ``drive`` (2, n): frequencies in Hz and the drive there, in any unit, which scales the amplitude.
    """

    frequency: FloatArray
    ratio: FloatArray
    slope: FloatArray
    friction: FloatArray
    sign: float
    drive: FloatArray

    def columns(self, f: FloatArray) -> ComplexArray:
        """Columns (n, 2 + modes) at frequencies f (n,); H of a sensor is their sum with real coefficients."""
        motions = self.motions(f, range(len(self.frequency)))
        return np.concatenate([np.array([np.ones_like(f), f**2]), motions]).T

    def motions(self, f: FloatArray, modes: Sequence[int]) -> ComplexArray:
        """sign w^2 G (modes, n) of some modes at frequencies f (n,): their columns."""
        of_modes = (self.frequency, self.ratio, self.slope, self.friction)
        frequency, ratio, slope, friction = (values[modes, np.newaxis] for values in of_modes)
        drive = np.interp(f, *self.drive) / np.interp(frequency, *self.drive)
        return self.sign * (2.0 * pi * f) ** 2 * receptance(f, frequency, ratio, slope, friction, drive)

    def with_cluster(
        self,
        cluster: Sequence[int],
        shift: FloatArray,
        log_ratio: FloatArray,
        slope: FloatArray,
        friction: FloatArray | float = 0.0,
    ) -> Poles:
        """The poles with a cluster changed: frequencies by relative shifts, ratios given by their logarithms.

        ``friction`` is a share of the largest t at which every row has a single amplitude, 1 + s or 1.
        """
        friction = np.minimum(1.0, 1.0 + slope) * friction
        friction = np.where(friction < _LEAST_FRICTION, 0.0, friction)
        parameters = self.frequency.copy(), self.ratio.copy(), self.slope.copy(), self.friction.copy()
        parameters[0][cluster] = self.frequency[cluster] * (1.0 + shift)
        parameters[1][cluster], parameters[2][cluster], parameters[3][cluster] = np.exp(log_ratio), slope, friction
        return Poles(*parameters, self.sign, self.drive)

    def repeat(self, modes: Sequence[int], times: int) -> Poles:
        """Some of the modes, all of them ``times`` times, as if they were as many."""
        frequency, ratio, slope, friction = (
            np.tile(values[modes], times) for values in (self.frequency, self.ratio, self.slope, self.friction)
        )
        return Poles(frequency, ratio, slope, friction, self.sign, self.drive)

    @property
    def clusters(self) -> list[list[int]]:
        """Groups of modes that are fitted together."""
        gaps = np.flatnonzero(self.frequency[1:] / self.frequency[:-1] - 1.0 >= CLUSTER)
        return [part.tolist() for part in np.split(np.arange(len(self.frequency)), gaps + 1)]

    def rows_about(self, f: FloatArray, cluster: Sequence[int]) -> IntArray:
        """Rows about a cluster, at most half the way to its neighbours."""
        frequency, first, last = self.frequency, cluster[0], cluster[-1]
        low, high = frequency[first] * (1.0 - BAND), frequency[last] * (1.0 + BAND)
        if first > 0:
            low = max(low, 0.5 * (frequency[first] + frequency[first - 1]))
        if last + 1 < len(frequency):
            high = min(high, 0.5 * (frequency[last] + frequency[last + 1]))
        rows = np.flatnonzero((f >= low) & (f <= high))
        return rows if len(rows) >= _FEWEST_ROWS else np.sort(np.argsort(np.abs(f - frequency[first]))[:_FEWEST_ROWS])


def receptance(
    f: FloatArray,
    frequency: Floats,
    ratio: Floats,
    slope: Floats = 0.0,
    friction: Floats = 0.0,
    drive: Floats = 1.0,
) -> ComplexArray:
    """G (n,) of a mode, or (modes, n) for parameters (modes, 1).

    The damping ratio is z = ratio (1 + slope (rho - 1) + friction (1/rho - 1)).
    rho = |G| ``drive`` over |G| at the peak is the amplitude over that at the peak; ``drive`` (n,) or (modes, n):
    drive of each row over that at the peak.
    """
    w, w_k = 2.0 * pi * f, 2.0 * pi * frequency
    elastic = w_k**2 - w**2
    peak = 1.0 / (2.0 * ratio * w_k**2)
    z: Floats = ratio
    if differs(slope, 0.0) or differs(friction, 0.0):
        # loss rho z = ratio (friction + linear rho + slope rho^2)
        linear, per_ratio = 1.0 - slope - friction, 2.0 * ratio * w_k * w
        squared, target = elastic**2, (drive / peak) ** 2
        low, high = np.zeros_like(f), 1.5 * np.maximum(drive, np.ones_like(f))
        for _ in range(_HALVINGS):
            rho = 0.5 * (low + high)
            loss = per_ratio * np.maximum(friction + (linear + slope * rho) * rho, 0.0)
            above = squared * (rho * rho) + loss * loss > target
            low, high = np.where(above, low, rho), np.where(above, rho, high)
        for _ in range(_NEWTON_STEPS):  # on rho^2 |1/G|^2 = (drive/peak)^2, from a close bracket
            loss = per_ratio * (friction + (linear + slope * rho) * rho)
            excess = (elastic * rho) ** 2 + loss**2 - target
            rate = 2.0 * rho * squared + 2.0 * loss * per_ratio * (linear + 2.0 * slope * rho)
            rho = np.minimum(np.maximum(rho - excess / rate, low), high)  # np.clip takes twice the time
        rho = np.maximum(rho, _STILL)
        z = np.maximum(ratio * (friction / rho + linear + slope * rho), 0.0)
    return np.asarray(1.0 / (elastic + 2j * z * w_k * w))
