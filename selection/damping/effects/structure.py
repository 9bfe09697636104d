"""Differences of the structure from its simulation: parameters, planes, other modes, a coupled part.

A parameter is off if its error exceeds three tolerances. Planar coupling: the drive excites two close modes in
principal planes at an angle (Eqs 3.1.24-3.1.35). A second mode has its own mass and damping and a frequency within the
rows. Residual modes lie outside and add a nearly in-phase part (section 3.1, Eqs 3.1.13-3.1.20).
"""

from collections.abc import Mapping
from dataclasses import replace
from math import inf, tan
from typing import Any

import numpy as np

from damping.arrays import Floats
from damping.effects.contract import Drive, Effect, Form, FormVariable, Plane, Scales, Terms
from damping.effects.simulated import RELATIVE, factor_forms
from damping.forces.powers import Viscous
from damping.forces.shapes import FORCE, LENGTH, TURN, Shape

#: Damping of the second plane over that of the first: equal in the report; a quarter more or less is usual.
DAMPING = FormVariable(centre=1.0, width=0.25, starts=(0.0,))
#: Table of a further mode in a model file; rigid-body motion has the frequency ratio 0, modes far above have none.
PATH = (
    Shape("compliance", LENGTH / FORCE),
    Shape("frequency_ratio", least=0.0, default=inf),
    Shape("loss", least=0.0, default=0.0),
    Shape("slope", default=0.0),
)
#: Damping ratio of modes outside the rows, 0.2 to 10 %, of little influence.
_LOSS = FormVariable.between(0.002, 0.1, starts=(0.0,))
#: Modal mass of one of two close modes over that of the other.
_SHARE = FormVariable.between(0.2, 5.0, starts=(0.0,))
#: Prior odds of a second mode against planar coupling, the usual cause of two close modes: 1 to 4; of two, the square.
_OWN_MASS = 0.25


def simulate_viscous(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The terms with viscous forces times 1 + ``relative``, or with one of ``coefficient`` where none is simulated."""
    if np.any(table["coefficient"]):
        return terms.plus(forces=Viscous(table["coefficient"]))
    factor = 1.0 + table["relative"]
    forces = (replace(f, coefficient=f.coefficient * factor) if isinstance(f, Viscous) else f for f in terms.forces)
    return terms._replace(forces=tuple(forces))


def viscous_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |ln| of the factor beyond 3 tolerances; the coefficient where no viscous force is simulated."""
    if scales.viscous == 0.0:
        return (VISCOUS_COEFFICIENT.form(lambda c: {"coefficient": c}, scales.loss / scales.omega_n),)
    return factor_forms(VISCOUS_COEFFICIENT, {"coefficient": scales.viscous}, scales)


VISCOUS_COEFFICIENT = Effect(
    name="viscous-coefficient",
    kind="parameter",
    sentence="the viscous coefficient is off by more than its tolerance",
    forms=viscous_forms,
    simulate=simulate_viscous,
    shapes=(replace(RELATIVE, default=0.0), replace(Viscous.shapes[0], default=0.0)),
    damping=Viscous.name,
    corrects=Viscous.name,
)


def frequency_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: relative error beyond 3 tolerances, above or below."""
    least = 3.0 * scales.frequency

    def change(terms: Terms, beyond: Floats) -> Terms:
        return terms._replace(omega_n=scales.omega_n * (1.0 + (beyond + np.copysign(least, beyond))))

    def report(beyond: Floats) -> dict[str, Floats]:
        return {"relative": beyond + np.copysign(least, beyond)}

    # neither side mirrors the other: both begin at 3 tolerances
    options: dict[str, Any] = {"largest": 0.3, "replaces": "frequency", "mirror": ""}
    return NATURAL_FREQUENCY.either_sign(report, change=change, natural=scales.bandwidth, **options)


NATURAL_FREQUENCY = Effect(
    name="natural-frequency",
    kind="parameter",
    sentence="the natural frequency is off by more than its tolerance",
    forms=frequency_forms,
    simulate=lambda terms, table: terms._replace(omega_n=terms.omega_n * (1.0 + table["relative"])),
    shapes=(RELATIVE,),
    corrects="frequency",
    need="sweep",
)


def spread_distance(scales: Scales, least: float, starts: tuple[float, ...]) -> FormVariable:
    """Relative distance of a close mode: ``least`` bandwidths to 1.5 reaches, or over a factor of 8 if that is more."""
    low = least * scales.bandwidth
    return FormVariable.between(low, max(1.5 * scales.reach, 8.0 * low), starts)


def planar_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: tan^2(theta). Shapes: |omega_y/omega_p - 1|, a fraction of the bandwidth to beyond the band; damping.

    A force that is missing in the simulation may act in the first plane only, or in both.
    """
    distance = spread_distance(scales, 0.2, (-1.5, -0.75, 0.0, 0.75, 1.5))
    return tuple(_planar_side(distance, sign, False, _planar_side(distance, sign, True)) for sign in (1.0, -1.0))


def _planar_side(distance_prior: FormVariable, sign: float, in_both: bool, twin: Form | None = None) -> Form:
    def change(terms: Terms, weight: Floats, distance: Floats, damping: Floats) -> Terms:
        return terms._replace(plane=Plane(weight, (1.0 + distance) ** sign, in_both, damping))

    def report(weight: Floats, distance: Floats, damping: Floats) -> dict[str, Floats]:
        plane = {"angle": np.arctan(np.sqrt(weight)), "frequency_ratio": (1.0 + distance) ** sign}
        return plane | {"damping_ratio": damping} | ({"alike": 1.0} if in_both else {})

    return Form("planar-coupling", change, report, 0.3, (distance_prior, DAMPING), largest=30.0, twin=twin)


PLANAR_COUPLING = Effect(
    name="planar-coupling",
    kind="structure",
    sentence="the drive excites two close modes in principal planes at an angle",
    forms=planar_forms,
    # with ``alike`` other than 0 all forces act in it too
    simulate=lambda terms, table: terms._replace(
        plane=Plane(tan(table["angle"]) ** 2, table["frequency_ratio"], table["alike"] != 0.0, table["damping_ratio"]),
    ),
    shapes=(
        Shape("angle", above=-TURN, below=TURN, label="angle in rad"),
        Shape("frequency_ratio", above=0.0),
        Shape("damping_ratio", least=0.0, default=1.0),
        Shape("alike", least=0.0, default=0.0),
    ),
    need="sweep",
)


def _paths(effect: Effect, above: bool, distance: FormVariable, loss: FormVariable, size: float) -> tuple[Form, Form]:
    """Forms of a mode ``above`` or below the simulated one. Strength: its compliance at omega_n over ``size``."""

    def report(strength: Floats, separation: Floats, damping: Floats) -> dict[str, Floats]:
        ratio = 1.0 + separation if above else 1.0 / (1.0 + separation)
        loss = 2.0 * damping
        nearest = np.sqrt(np.square(ratio * ratio - 1.0) + np.square(loss * ratio))
        return {"compliance": strength * size * nearest, "frequency_ratio": ratio, "loss": loss}

    return effect.either_sign(report, "above" if above else "below", shapes=(distance, loss), largest=30.0)


def simulate_path(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """A further mode: R = ``compliance``/(r^2 - x^2 + i ``loss`` r x), x = omega/omega_n, r = ``frequency_ratio``.

    Modes far above, without a frequency ratio: R = compliance (1 + ``slope`` (x - 1)).
    """
    compliance, ratio, loss, centre = table["compliance"], table["frequency_ratio"], table["loss"], terms.omega_n

    def part(drive: Drive) -> Floats:
        x = drive.omega / centre
        if not np.isfinite(ratio).all():
            return compliance * (1.0 + table["slope"] * (x - 1.0))
        return np.asarray(compliance / (np.square(ratio) - x * x + 1j * loss * ratio * x))

    return terms.plus(compliance=part)


def residual_forms(scales: Scales) -> tuple[Form, ...]:
    """A mode outside the rows, from 1.5 reaches to a factor of 4 in frequency, or rigid-body motion; either sign."""
    resonance = 1.0 / scales.loss
    beyond = 1.5 * max(scales.reach, scales.bandwidth)  # rows may all lie at the resonance
    separation = FormVariable.between(beyond, 3.0, starts=(-1.0, 0.5))

    def report(strength: Floats) -> dict[str, Floats]:
        return {"compliance": strength * resonance, "frequency_ratio": 0.0 * strength}  # -compliance/x^2

    return (
        *_paths(RESIDUAL_MODES, True, separation, _LOSS, resonance),
        *_paths(RESIDUAL_MODES, False, separation, _LOSS, resonance),
        *RESIDUAL_MODES.either_sign(report, "rigid body", largest=30.0),
    )


RESIDUAL_MODES = Effect(
    name="residual-modes",
    kind="structure",
    sentence="other modes or rigid-body motion add an in-phase part",
    forms=residual_forms,
    simulate=simulate_path,
    shapes=PATH,
    need="sweep",
)


def second_forms(scales: Scales) -> tuple[Form, ...]:
    """A mode within the rows, a fraction of the bandwidth to 1.5 reaches from the first, at any mass of either sign."""
    separation = spread_distance(scales, 0.3, (-1.2, 0.0, 1.2))
    loss = FormVariable.between(0.2 * scales.bandwidth, 5.0 * scales.bandwidth, starts=(-1.0, 0.5))
    higher, lower = (_paths(SECOND_MODE, above, separation, loss, 1.0 / scales.loss) for above in (True, False))
    return *higher, *lower


SECOND_MODE = Effect(
    name="second-mode",
    kind="structure",
    sentence="a close mode with its own mass and damping contributes",
    forms=second_forms,
    simulate=simulate_path,
    shapes=PATH,
    need="sweep",
    denies=frozenset({"planar-coupling"}),
    prior=_OWN_MASS,
)


def partner_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: coupling over the bandwidth. Shapes: distance of the partner's frequency; its damping ratio."""
    separation = spread_distance(scales, 0.2, (-1.0, 0.0, 1.0))
    loss = FormVariable.between(0.2 * scales.bandwidth, 5.0 * scales.bandwidth, starts=(-0.7, 0.5))

    def side(sign: float) -> Form:
        def report(strength: Floats, distance: Floats, damping: Floats) -> dict[str, Floats]:
            return {"coupling": strength * scales.bandwidth, "ratio": 1.0 + sign * distance, "damping": damping}

        return PARTNER.form(report, 0.5, shapes=(separation, loss), largest=100.0, sizes=(0.5, 2.0))

    return side(1.0), side(-1.0)


def simulate_partner(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """Z less M coupling^2 w^4/(w^2 - omega^2 + 2 i damping w omega), w = ratio omega_n: absorber, circuit, rotor."""
    w, M = table["ratio"] * terms.omega_n, terms.M

    def part(drive: Drive) -> Floats:
        stiffness = w * w - drive.omega**2 + 2j * table["damping"] * w * drive.omega
        return np.asarray(-M * (table["coupling"] * w * w) ** 2 / stiffness)

    return terms.plus(beside=part)


PARTNER = Effect(
    name="partner",
    kind="structure",
    sentence="a coupled part with its own resonance (an absorber, a tank, a circuit, a stinger)",
    forms=partner_forms,
    simulate=simulate_partner,
    need="sweep",
)


def pair_forms(scales: Scales) -> tuple[Form, ...]:
    """A close mode on each side of the simulated one, of one damping ratio, each of either sign.

    Strength: its mass over that of the mode above. Shapes: the mass of that over that of the mode below; the distances
    of the two; their damping ratio.
    """
    separation = spread_distance(scales, 0.3, (-0.7, 0.7))
    damping = FormVariable.between(0.4 * scales.bandwidth, 2.5 * scales.bandwidth, starts=(0.0,))

    def pair(alike: float) -> tuple[Form, Form]:
        def report(size: Floats, share: Floats, above: Floats, below: Floats, zeta: Floats) -> dict[str, Floats]:
            compliance = size / scales.stiffness
            upper = {"compliance": compliance, "frequency_ratio": 1.0 + above, "loss": 2.0 * zeta}
            return upper | {"below": alike * share * compliance, "ratio_below": 1.0 / (1.0 + below)}

        shapes = (_SHARE, separation, separation, damping)
        return NEIGHBOURS.either_sign(report, f"alike {alike}", shapes=shapes, largest=30.0)

    return *pair(1.0), *pair(-1.0)


def simulate_pair(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """Two further modes (`simulate_path`) of one loss factor."""
    lower = {"compliance": table["below"], "frequency_ratio": table["ratio_below"], "loss": table["loss"]}
    return simulate_path(simulate_path(terms, table), lower)


NEIGHBOURS = Effect(
    name="neighbours",
    kind="structure",
    sentence="a close mode on each side of the simulated one",
    forms=pair_forms,
    simulate=simulate_pair,
    need="sweep",
    prior=_OWN_MASS**2,
)
