"""Characteristic sizes of a problem, from which the priors of effects are set."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Scales:
    """Characteristic sizes of the problem, from which every prior is set."""

    A_low: float  #: 10 % quantile of the measured amplitudes
    A_high: float  #: largest of them
    omega_n: float  #: of the simulation, rad/s
    M: float  #: its mass
    viscous: float  #: its viscous coefficient, 0 where it has none
    bandwidth: float  #: its damping ratio at ``A_high``: half the half-power width over ``omega_n``
    reach: float  #: largest |omega/omega_n - 1| measured
    frequency: float  #: tolerance of the simulation's frequency
    damping: float  #: that of its damping
    sweeps: int = 1  #: of the record
    states: int = 1  #: of the record
    simulated: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  #: parameters of its forces, by name
    rate: float = 0.0  #: largest known |d omega/dt|, rad/s^2; 0 where none is known

    @property
    def stiffness(self) -> float:
        """K = M omega_n^2."""
        return self.M * self.omega_n**2

    @property
    def loss(self) -> float:
        """C/A of the simulation at the largest amplitude: its damping as a loss stiffness."""
        return 2.0 * self.bandwidth * self.stiffness
