"""Forces that the simulation lacks or has too large: damping forces, slipping joints, springs that bend the resonance.

Damping forces II, III, IV, q^2 q' and Coulomb friction each have one coefficient. A simulated force that is too large
is the same effect with a negative share of that force. Each may also replace the simulated viscous force.

An elastic joint slips beyond an amplitude (bilinear hysteresis, Fig. 2.4c).

A restoring force with a cubic term, or another power such as q |q|, bends the resonance to higher or lower frequencies.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from damping.arrays import ComplexArray, FloatArray, Floats, drop_repeats
from damping.effects.contract import Effect, Form, FormVariable, Scales, Terms
from damping.effects.simulated import instead_form, less_forms
from damping.forces.contract import Force, Joint, spread
from damping.forces.joints import Coulomb, CubicStiffness, PowerStiffness, Slip, SlippingForce, lose_stiffness
from damping.forces.powers import (
    Displacement,
    DisplacementVelocity,
    DisplacementVelocityPower,
    QuadraticDisplacement,
    VelocityPower,
    VelocitySquared,
)
from damping.forces.shapes import FORCE, LENGTH, Shape
from damping.forces.smooth import LARGEST_RELIEF, LEAST_RELIEF, SmoothSlip

#: Quadrature over the share of slipping joints: nodes and weights of Gauss and Legendre in the root of the remaining
#: share, which puts most nodes at large limits.
_GAUSS = np.polynomial.legendre.leggauss(8)
_LEFT = 0.5 + 0.5 * _GAUSS[0]
_SLIPPING = 1.0 - _LEFT**2
_WEIGHTS = _LEFT * _GAUSS[1]
#: Ends of the shares of all joints that one joint represents in time integration, finer for those that slip first.
_ENDS = np.linspace(0.0, 1.0, 33) ** 2
#: Exponent of a spring other than cubic, 1.5 to 8; one below 1, as of a preload that rocks or of play (both near 0).
_EXPONENT = FormVariable.between(1.5, 8.0, starts=(-1.0, 0.8))
_LOW_EXPONENT = FormVariable.between(0.1, 0.9, starts=(-1.0, 0.8))


def adds_force(force: Callable[[Mapping[str, Floats]], Force]) -> Callable[[Terms, Mapping[str, Floats]], Terms]:
    """The ``simulate`` of an effect that adds the ``force`` of its table to the terms."""
    return lambda terms, table: terms.plus(forces=force(table))


def _coefficient_effect(name: str, kind: Callable[[Floats], Force], sentence: str) -> Effect:
    """The effect of a force of one coefficient: added, less than simulated, or in the place of the viscous one."""
    unit = kind(1.0)

    def forms(scales: Scales) -> tuple[Form, ...]:
        per_coefficient = float(unit.quadrature(scales.A_high, scales.omega_n)) / scales.A_high
        simulated = scales.simulated.get(unit.name, {}).get("coefficient", 0.0)

        def report(coefficient: Floats) -> dict[str, Floats]:
            return {"coefficient": coefficient} | ({"relative": coefficient / simulated} if simulated else {})

        instead = [instead_form(effect, kind, scales)] if scales.viscous else []
        return effect.form(report, scales.loss / per_coefficient), *less_forms(effect, scales), *instead

    def force(table: Mapping[str, Floats]) -> Force:
        return kind(table["coefficient"])

    effect = Effect(name, "force", sentence, forms, adds_force(force), unit.shapes, force, damping=unit.name)
    return effect


#: Forces of one coefficient.
OF_ONE_COEFFICIENT = (
    _coefficient_effect("displacement", Displacement, "damping in proportion to displacement (case II) is missing"),
    _coefficient_effect(
        "velocity-squared", VelocitySquared, "damping with the square of velocity (case III) is missing"
    ),
    _coefficient_effect("displacement-velocity", DisplacementVelocity, "damping as |q| q' (case IV) is missing"),
    _coefficient_effect("quadratic-displacement", QuadraticDisplacement, "damping as q^2 q' (case V) is missing"),
    _coefficient_effect("coulomb-friction", Coulomb, "constant friction against velocity is missing"),
)


def _simulated_effect(kind: type[VelocityPower | DisplacementVelocityPower], sentence: str) -> Effect:
    """The effect of a power law that is tried only where it is simulated: less of it."""

    def force(table: Mapping[str, Floats]) -> Force:
        return kind(table["coefficient"], table["exponent"])

    def forms(scales: Scales) -> tuple[Form, ...]:
        return less_forms(effect, scales)

    effect = Effect(kind.name, "force", sentence, forms, adds_force(force), kind.shapes, force, damping=kind.name)
    return effect


#: Forces that are never added to the simulated ones: with a free exponent they would imitate others.
ONLY_SIMULATED = (
    _simulated_effect(VelocityPower, "damping with a power of velocity (4.3.3)"),
    _simulated_effect(DisplacementVelocityPower, "damping with powers of displacement and velocity (4.3.4)"),
)


@dataclass(frozen=True)
class ManyJoints(SlippingForce):
    """Joints of total ``stiffness`` that slip one after the other; a share P(a) of them has limits up to a.

    P = 1 - exp(-(a/limit)^kappa), after Weibull, or, if ``bounded``, (a/limit)^kappa up to 1. The averages are
    integrals of those of one joint over P from 0 to P(A). In time, one joint stands for each range of ``_ENDS``.
    """

    kappa: Floats
    bounded: bool

    def averages(self, A: Floats, omega: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """C, dC/d ln A, S and dS/d ln A; dP/d ln A adds nothing, since a joint about to slip has C = 0 and S = 0."""
        slipping, lost, grown, S, turned = self._average_unit(A, omega)
        size = self.stiffness * A * slipping
        saturation = spread(4.0 / np.pi * size, omega)
        return saturation * (lost - grown), saturation * grown, size * S, size * (S + turned)

    def _average_unit(self, A: Floats, omega: Floats) -> tuple[FloatArray, ...]:
        """The share of all joints that slips, and of these A1/A, its square and `lose_stiffness` on average.

        Models that differ in other parameters are neighbours in a batch: each is averaged once.
        """
        rows = np.broadcast_arrays(A, self.limit, self.kappa)
        if rows[0].ndim == 2 and len(rows[0]) > 1:
            new, which = drop_repeats(np.hstack(rows))
            once, limit, kappa = (part[new] for part in rows)
            if len(once) < len(which):
                own = replace(self, limit=limit, kappa=kappa)._average_unit(once, omega)
                return tuple(part[which] for part in own)
        slipping, limit = self._find_slipping(A, omega)
        held = np.minimum(limit / A, 1.0)
        parts = (held, held * held, *lose_stiffness(held))  # per stiffness and amplitude, as `Slip.averages`
        return np.asarray(slipping), *(np.tensordot(_WEIGHTS, part, 1) for part in parts)

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """The integral of their third harmonics: those of the slipping ones, along an axis before that of A."""
        slipping, limit = self._find_slipping(A, omega)
        joints = Slip(self.stiffness * (_WEIGHTS.reshape(-1, *[1] * (limit.ndim - 1)) * slipping), limit)
        return np.asarray(np.sum(joints.third(A, omega), axis=0))

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """One for each range of P."""
        ranges = [(0.5 * (start + end), end - start) for start, end in pairwise(_ENDS)]
        return tuple(Joint(self.stiffness * share, self._find_limit(P)) for P, share in ranges)

    def _find_slipping(self, A: Floats, omega: Floats) -> tuple[Floats, FloatArray]:
        """The share of all joints that slips at amplitudes A, and limits of representative ones along a first axis."""
        with np.errstate(over="ignore"):  # far beyond the limit all of them slip
            reached = np.power(A / self.limit, self.kappa)
        slipping = np.minimum(reached, 1.0) if self.bounded else -np.expm1(-reached)
        share = _SLIPPING.reshape(-1, *[1] * max(np.ndim(slipping), np.ndim(omega)))
        if self.bounded:  # limits of slipping joints scale with the largest of them
            return slipping, np.asarray(share ** (1.0 / self.kappa) * np.minimum(A, self.limit))
        return slipping, np.asarray(self._find_limit(share * slipping))

    def _find_limit(self, P: Floats) -> Floats:
        """The limit that a share P of the joints does not exceed."""
        return self.limit * (P if self.bounded else -np.log1p(-P)) ** (1.0 / self.kappa)


def joint_force(table: Mapping[str, Floats]) -> Force:
    """One joint, whose ``stiffness`` is lost beyond ``limit``; with ``kappa`` many joints with distributed limits.

    Unbounded limits make a smooth backbone (Iwan 1966). With ``bounded`` no limit exceeds ``limit`` (Segalman 2005).
    See `ManyJoints`. ``smooth``: one joint that yields gradually, see `SmoothSlip`; it has no ``kappa``.
    """
    stiffness, limit, kappa = table["stiffness"], table["limit"], table.get("kappa", 0.0)
    if np.any(table.get("smooth", 0.0)):
        return SmoothSlip(stiffness, limit, table.get("relief", 1.0))
    if not np.any(kappa):
        return Slip(stiffness, limit)
    return ManyJoints(stiffness, limit, kappa, bool(table.get("bounded", 0.0)))


def joint_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the total stiffness lost. Shapes: the amplitude at which slip starts, about the measured ones; kappa.

    One joint, many with unbounded or bounded limits, or one that yields gradually; less of a simulated one.
    """
    limit = FormVariable.between(0.3 * scales.A_low, scales.A_high, starts=(-1.6, -0.8, 0.0, 0.6, 1.2, 1.7))
    limits = FormVariable.between(0.1 * scales.A_low, 4.0 * scales.A_high, starts=(-1.0, 0.0, 1.0))
    kappa = FormVariable(centre=1.0, width=0.4, starts=(0.0,))
    relief = FormVariable.between(0.7, 2.8, starts=(0.0,))
    return (
        _joint_form((limit,), scales),
        _joint_form((limits, kappa), scales),
        _joint_form((limits, kappa), scales, "bounded"),
        _joint_form((limits, relief), scales, "smooth"),
        *less_forms(SLIP, scales),
    )


def _joint_form(shapes: tuple[FormVariable, ...], scales: Scales, switch: str = "") -> Form:
    further = "relief" if switch == "smooth" else "kappa"

    def report(stiffness: Floats, limit: Floats, *shape: Floats) -> dict[str, Floats]:
        switches = ({further: shape[0]} if shape else {}) | ({switch: 1.0} if switch else {})
        return {"stiffness": stiffness, "limit": limit} | switches

    return SLIP.form(report, scales.loss, shapes=shapes, largest=scales.stiffness)


_KAPPA = Shape("kappa", least=0.0, default=0.0, label="kappa (large: all joints slip at one limit)")
_BOUNDED = Shape("bounded", default=0.0, switch=True, needs="kappa", label="many joints, none with a larger limit")
_SMOOTH = Shape("smooth", default=0.0, switch=True, excludes="kappa", label="yields gradually (Bouc and Wen)")
_TURN = "stiffness after a turn over stuck one (2: Dahl)"
_RELIEF = Shape("relief", least=LEAST_RELIEF, below=LARGEST_RELIEF, default=1.0, needs="smooth", label=_TURN)
SLIP = Effect(
    name="slip",
    kind="force",
    sentence="an elastic joint slips",
    forms=joint_forms,
    simulate=adds_force(joint_force),
    shapes=(*Slip.shapes, _KAPPA, _BOUNDED, _SMOOTH, _RELIEF),
    force=joint_force,
    damping=Slip.name,
)


def _stiffness_effect(name: str, sign: float, sentence: str, denied: str) -> Effect:
    """The effect of a spring whose stiffness changes with amplitude in the sense of ``sign``.

    Its force is ``sign`` times coefficient |q|^p sgn q for p > 1, and minus that for p < 1, where A^(p - 1) falls.
    Its strength is the force at the largest amplitude over that amplitude. The effect of the other sign is ``denied``:
    together they would imitate a stiffness of another shape.
    """

    def forms(scales: Scales) -> tuple[Form, ...]:
        def report(stiffness: Floats, *exponent: Floats) -> dict[str, Floats]:
            stated = {"exponent": exponent[0]} if exponent else {}
            return {"coefficient": stiffness * scales.A_high ** (1.0 - stated.get("exponent", 3.0))} | stated

        cubic = effect.form(report, scales.loss, largest=scales.stiffness)
        return cubic, *(replace(cubic, shapes=(exponent,)) for exponent in (_EXPONENT, _LOW_EXPONENT))

    def force(table: Mapping[str, Floats]) -> Force:
        exponent = table["exponent"]
        coefficient = np.where(np.less(exponent, 1.0), -sign, sign) * table["coefficient"]
        return CubicStiffness(coefficient) if np.all(np.equal(exponent, 3.0)) else PowerStiffness(coefficient, exponent)

    effect = Effect(
        name=name,
        kind="force",
        sentence=sentence,
        forms=forms,
        simulate=adds_force(force),
        shapes=(
            Shape("coefficient", FORCE / LENGTH ** "exponent", least=0.0),
            Shape("exponent", above=0.0, default=3.0),
        ),
        force=force,
        need="sweep",
        denies=frozenset({denied}),
    )
    return effect


#: Springs that bend the resonance, to higher or to lower frequencies.
SPRINGS = (
    _stiffness_effect("stiffness-hardening", 1.0, "the stiffness grows with amplitude", "stiffness-softening"),
    _stiffness_effect("stiffness-softening", -1.0, "the stiffness falls with amplitude", "stiffness-hardening"),
)
