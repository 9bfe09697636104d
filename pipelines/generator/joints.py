"""Joints with memory: elastic until they slip. Their state moves with the displacement alone, not with time.

A joint of stiffness k carries k * sum_i w_i z_i, where z_i is the stretch of its part i; without any slip z = q, so the
force beside the stuck structure is k (sum_i w_i z_i - q).

- ``jenkins``: the stretch stops at the limit (one part is a Jenkins element, many are an Iwan joint).
- ``bouc-wen``: dz/dq = 1 - (z/limit) where the motion stretches the joint further, 1 where it relieves it
  (Bouc and Wen's law with n = 1 and beta = gamma), solved exactly for a monotonic step of q.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.generator.laws import Array


@dataclass(frozen=True)
class Joint:
    """Stiffness (force/length), limits of the parts' stretch (length) and their weights (sum 1)."""

    kind: str
    stiffness: float
    limits: tuple[float, ...]
    weights: tuple[float, ...]

    @cached_property
    def _limits(self) -> Array:
        return np.array(self.limits)

    def start(self, q: Array) -> Array:
        """Stretch of the parts, shape (parts, *q.shape), after a first loading to ``q``."""
        return self.move(np.zeros((len(self.limits), *q.shape)), q)

    def move(self, z: Array, dq: Array) -> Array:
        """The stretch after a monotonic change ``dq`` of the displacement."""
        limits = self._limits.reshape(-1, *[1] * dq.ndim)
        if self.kind == "jenkins":
            stretched: Array = np.minimum(np.maximum(z + dq, -limits), limits)
            return stretched
        way, distance = np.sign(dq), np.abs(dq)
        along = way * z
        relieved = np.minimum(distance, np.maximum(-along, 0.0))
        along = along + relieved
        rest = limits - (limits - along) * np.exp(-(distance - relieved) / limits)
        return np.where(along < 0.0, along, rest) * way + np.where(way == 0.0, z, 0.0)

    def force(self, z: Array, q: Array) -> Array:
        """The joint's force less that of the same joint stuck."""
        carried = z[0] if len(self.limits) == 1 else np.tensordot(np.array(self.weights), z, axes=1)
        return self.stiffness * (carried - q)
