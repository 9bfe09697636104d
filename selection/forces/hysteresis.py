"""Hysteresis loops: force against displacement over one steady cycle (Figs 2.4 and 2.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray
from selection.forces.contract import Force


@dataclass(frozen=True)
class Loop:
    """One closed loop: displacement ``q`` and ``force``, both of shape (points,), the last point equal to the first."""

    q: FloatArray
    force: FloatArray

    @property
    def area(self) -> float:
        """Enclosed area, the energy loss per cycle, by the trapezoidal rule (exact for polygons with their corners)."""
        return float(np.sum(0.5 * (self.force[1:] + self.force[:-1]) * np.diff(self.q)))


def loop(force: Force, A: float, omega: float, stiffness: float = 0.0, points: int = 1441) -> Loop:
    """The loop of ``force`` plus a spring ``stiffness`` q over the cycle q = A sin(theta).

    A slip joint is given relative to its stuck state, so the stiffness of that state, K, draws Fig. 2.4c.
    """
    theta = np.linspace(0.0, 2.0 * np.pi, points)
    q = A * np.sin(theta)
    return Loop(q=q, force=stiffness * q + np.asarray(force.cycle(theta, A, omega)))
