"""Actions on the main coordinate of a true structure: forces, joints with memory, and coupled coordinates.

Forces without memory are functions of displacement q and velocity v. ``sign`` is the sign of the velocity, smoothed or
not: the integration in time passes one that is smoothed over a few of its steps, the averages pass the true one.

Joints are elastic until they slip; their state moves with the displacement alone, not with time. A joint of stiffness k
carries k * sum_i w_i z_i, where z_i is the stretch of its part i; without any slip z = q, so the force beside the stuck
structure is k (sum_i w_i z_i - q).

- ``jenkins``: the stretch stops at the limit (one part is a Jenkins element, many are an Iwan joint).
- ``bouc-wen``: dz/dq = 1 - (z/limit) where the motion stretches the joint further, 1 where it relieves it
  (Bouc and Wen's law with n = 1 and beta = gamma), solved exactly for a monotonic step of q.

Coordinates coupled with the main one: an absorber, a gyroscopic partner, an electric circuit, a fluid, a heated spring.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class LawForm:
    """A force by name: its ``function`` of q, v, the sign of v and a parameter p.

    ``degree`` in amplitude, where it is homogeneous. ``power`` of the velocity: at frequency omega its averages are
    omega**power times those at omega = 1; None: they change otherwise, and are taken at the natural frequency.
    """

    function: Callable[[Array, Array, Array, float], Array]
    degree: int | None = None
    power: int | None = 0
    jumps: bool = False  #: when the velocity changes sign
    elastic: bool = False  #: two steady states may exist at one frequency


#: Square of the largest displacement over the film's thickness that a squeeze film lets come about.
_CLOSEST = 0.9
_BUILD_UP = 0.3  #: way over which a rubbing contact builds up, of the place where it begins

LAW_FORMS: Mapping[str, LawForm] = {
    "displacement": LawForm(lambda q, v, sign, p: np.abs(q) * sign, 1, jumps=True),
    "velocity-squared": LawForm(lambda q, v, sign, p: v * np.abs(v), 2, power=2),
    "displacement-velocity": LawForm(lambda q, v, sign, p: np.abs(q) * v, 2, power=1),
    "quadratic-displacement": LawForm(lambda q, v, sign, p: q * q * v, 3, power=1),
    "coulomb": LawForm(lambda q, v, sign, p: sign, 0, jumps=True),
    "cubic": LawForm(lambda q, v, sign, p: q * q * q, 3, elastic=True),
    "quadratic": LawForm(lambda q, v, sign, p: q * q, 2, elastic=True),
    "odd-square": LawForm(lambda q, v, sign, p: q * np.abs(q), 2, elastic=True),
    "quintic": LawForm(lambda q, v, sign, p: q * q * q * q * q, 5, elastic=True),
    "clearance": LawForm(lambda q, v, sign, p: np.asarray(q - np.clip(q, -p, p)), elastic=True),
    "power-spring": LawForm(lambda q, v, sign, p: np.sign(q) * np.abs(q) ** p, elastic=True),
    "stop": LawForm(lambda q, v, sign, p: np.maximum(q - p, 0.0), elastic=True),
    "slap": LawForm(lambda q, v, sign, p: np.maximum(q - p, 0.0) * (0.75 + 0.25 * sign), jumps=True, elastic=True),
    "velocity-cubed": LawForm(lambda q, v, sign, p: v * v * v, 3, power=3),
    "hysteretic-square": LawForm(lambda q, v, sign, p: q * q * sign, 2, jumps=True),
    "rub": LawForm(lambda q, v, sign, p: sign * np.clip((np.abs(q) / p - 1.0) / _BUILD_UP, 0.0, 1.0), jumps=True),
    "dithered-friction": LawForm(lambda q, v, sign, p: 2 / np.pi * np.arcsin(np.clip(v / p, -1.0, 1.0)), power=None),
    "stribeck": LawForm(lambda q, v, sign, p: sign * np.exp(-np.abs(v) / p), power=None, jumps=True),
    "eddy-current": LawForm(lambda q, v, sign, p: v / (1.0 + (v / p) ** 2), power=None),
    "squeeze-film": LawForm(lambda q, v, sign, p: v / (1.0 - np.minimum((q / p) ** 2, _CLOSEST)) ** 1.5, power=1),
}


@dataclass(frozen=True)
class TrueLaw:
    """A force ``coefficient * function(q, v, sign, parameter)`` on the main coordinate, its form that of its kind."""

    kind: str
    coefficient: float
    parameter: float = 0.0

    @property
    def form(self) -> LawForm:
        """The function and its properties."""
        return LAW_FORMS[self.kind]

    def force(self, q: Array, v: Array, sign: Array) -> Array:
        """The force, in the shape of ``q`` and ``v``."""
        return self.coefficient * self.form.function(q, v, sign, self.parameter)


@dataclass(frozen=True)
class TrueJoint:
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
        return np.asarray(np.where(along < 0.0, along, rest) * way + np.where(way == 0.0, z, 0.0))

    def force(self, z: Array, q: Array) -> Array:
        """The joint's force less that of the same joint stuck."""
        carried = z[0] if len(self.limits) == 1 else np.tensordot(np.array(self.weights), z, axes=1)
        return self.stiffness * (carried - q)


@dataclass(frozen=True)
class Partner:
    """A coordinate x coupled with the main one, q; ``kind`` names its two equations in ``accelerations``."""

    kind: str
    #: ``omega``, ``zeta``: of the partner alone, rad/s and damping ratio
    omega: float
    zeta: float
    strength: float  #: of the coupling, dimensionless (mass ratio of an absorber)
    cubic: float = 0.0  #: of its spring, over omega^2, 1/length^2

    def accelerations(self, q: Array, v: Array, x: Array, w: Array) -> tuple[Array, Array]:
        """x'' and the contribution of the partner to q'' (per unit of the main mass), from q, q', x and x'."""
        loss, omega2 = 2 * self.zeta * self.omega * w, self.omega**2
        match self.kind:
            case "gyroscopic":  # a mass across the axis of a rotor: g w and -g v do no work together
                g = self.strength * self.omega
                return g * v - loss - omega2 * x, -g * w
            case "circuit":  # charge in a coil, a resistor and a piezo patch of energy -strength omega^2 q x
                pull = self.strength * omega2
                return pull * q - loss - omega2 * x, pull * x
            case "memory":  # a spring behind a dashpot, whose far end x follows q with a lag (a fluid's memory)
                return omega2 * (q - x) - loss, -self.strength * omega2 * (q - x)
            case "heated-spring":  # a spring -strength x q whose temperature x follows q^2 slowly
                return omega2 * (q**2 - x) - loss, -self.strength * x * q
        # an absorber: a mass on spring and dashpot upon the main one; strength is its share of the main mass
        spring = omega2 * ((x - q) + self.cubic * (x - q) ** 3) + 2 * self.zeta * self.omega * (w - v)
        return -spring, self.strength * spring

    def follow(self, omega: Array) -> Array:
        """Phasor of x over that of q, of the linear partner: -omega^2 x = f(q, q', 0, 0) + x f(0, 0, 1, i omega)."""
        if self.stand_in:
            return np.zeros(omega.size, complex)
        linear, v = replace(self, cubic=0.0), 1j * omega
        unit, none = np.ones(omega.size, complex), np.zeros(omega.size, complex)
        pulled, own = (linear.accelerations(*at)[0] for at in ((unit, v, none, none), (none, none, unit, v)))
        return np.asarray(pulled / (-(omega**2) - own))

    def push(self, omega: Array) -> Array:
        """Phasor of the contribution of the linear partner to q'', over that of q."""
        x, unit, v = self.follow(omega), np.ones(omega.size, complex), 1j * omega
        return np.zeros_like(x) if self.stand_in else replace(self, cubic=0.0).accelerations(unit, v, x, v * x)[1]

    @property
    def stand_in(self) -> TrueLaw | None:
        """First-order equivalent force of a partner that is not linear, over the main mass."""
        if self.kind == "heated-spring":  # mean square A^2/2 against 3/4 A^2 of a cubic spring
            return TrueLaw("cubic", 2.0 / 3.0 * self.strength)
        return None


@dataclass(frozen=True)
class Side:
    """Another mode between drive and sensor, q'' + 2 zeta omega q' + omega^2 q = drive F/M, seen as ``seen`` q.

    ``across`` of it shows across the measured axis. ``loaded``: mass added to the main mode moves with this one too.
    It acts on nothing, so that its steady motion is known in closed form.
    """

    omega: float
    zeta: float
    drive: float
    seen: float
    across: float = 0.0
    loaded: bool = False


@dataclass(frozen=True)
class Structure:
    """Main mode (mass, undamped omega in rad/s of the stuck state, viscous coefficient), its forces, and other modes.

    The main coordinate takes ``share`` of the force and shows ``share`` of its motion at the sensor (1 but for a drive
    at an angle to the principal planes), ``across`` of it across the measured axis. Other modes are per unit of the
    same mass.
    """

    mass: float
    omega: float
    viscous: float
    laws: tuple[TrueLaw, ...] = ()
    joints: tuple[TrueJoint, ...] = ()
    sides: tuple[Side, ...] = ()
    share: float = 1.0
    across: float = 0.0
    partners: tuple[Partner, ...] = ()

    @property
    def averaged_laws(self) -> tuple[TrueLaw, ...]:
        """The forces whose averages a first-harmonic balance takes, those of partners that are not linear included."""
        laws = [partner.stand_in for partner in self.partners]
        return (*self.laws, *(replace(law, coefficient=law.coefficient * self.mass) for law in laws if law))

    @property
    def bent(self) -> bool:
        """Whether two steady states may exist at one frequency."""
        elastic = any(law.form.elastic for law in self.laws)
        return elastic or any(partner.cubic or partner.stand_in for partner in self.partners)
