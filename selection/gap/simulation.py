"""The simulation that is judged: its terms, with omega_n, M and every damping coefficient free within tolerance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray
from selection.forces.catalogue import make, parameter_names
from selection.gap.terms import Terms
from selection.records.mode import Mode

#: Deviations beyond so many tolerances are effects of their own (natural-frequency, viscous-coefficient).
MOST_TOLERANCES = 3.0
_SHARPNESS = 8


def within_tolerance(x: FloatArray) -> FloatArray:
    """x where it is small, and never beyond +-``MOST_TOLERANCES``: x/(1 + |x/3|^8)^(1/8)."""
    return np.asarray(x / (1.0 + np.abs(x / MOST_TOLERANCES) ** _SHARPNESS) ** (1.0 / _SHARPNESS))


@dataclass(frozen=True)
class Simulation:
    """A mode as terms of standard normal variables x; ln(value/nominal) = tolerance times `within_tolerance` (x).

    The variables are those of ``names``: ``frequency``, ``mass`` and the damping forces of the mode by name (their
    leading coefficient; all have the tolerance of ``viscous``, the one that is stated for damping).
    """

    mode: Mode

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables."""
        return ("frequency", "mass", *self.mode.damping)

    @property
    def tolerance(self) -> FloatArray:
        """Relative standard uncertainty of each variable."""
        stated = self.mode.tolerance
        return np.array([stated.frequency, stated.mass] + [stated.viscous] * len(self.mode.damping))

    def terms(self, x: FloatArray) -> Terms:
        """The terms at variables x (batch, k), as arrays (batch, 1)."""
        factor = np.exp(within_tolerance(x) * self.tolerance)[..., np.newaxis]
        forces = []
        for number, (name, parameters) in enumerate(self.mode.damping.items()):
            leading, *others = parameter_names(name)
            values = {leading: parameters[leading] * factor[:, 2 + number]} | {key: parameters[key] for key in others}
            forces.append(make(name, **values))
        return Terms(
            M=self.mode.mass * factor[:, 1],
            omega_n=self.mode.omega_n * factor[:, 0],
            forces=tuple(forces),
            simulated=len(forces),
        )
