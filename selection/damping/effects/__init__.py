"""Effects: possible causes of a gap between simulation and test. A contract, modules by kind, and the catalogue."""

import copyreg
from collections.abc import Mapping
from dataclasses import replace
from typing import cast

from damping.effects import contact, course, detector, forces, foreign, masses, received, rig, structure
from damping.effects.contract import Effect, Form, Scales, Terms
from damping.errors import InputError, list_nearest

#: The library: named causes of a gap, in the order in which hypotheses are tried.
CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        structure.VISCOUS_COEFFICIENT,
        *forces.OF_ONE_COEFFICIENT,
        *forces.ONLY_SIMULATED,
        forces.SLIP,
        *forces.SPRINGS,
        structure.NATURAL_FREQUENCY,
        structure.PLANAR_COUPLING,
        structure.SECOND_MODE,
        structure.RESIDUAL_MODES,
        course.DRIFT,
        rig.AMPLITUDE_SCALE,
        rig.PHASE_LAG,
        rig.TIME_DELAY,
        received.FORCE_DROPOUT,
        course.LEVEL_OFFSET,
        rig.SENSOR_SATURATION,
        rig.BACKGROUND,
        course.SWEEP_RATE,
    )
}

#: Prior of causes of ``FOREIGN`` that stand for several: contact is a clearance, a stop or a slap, or with the other
#: sign a joint or a support that opens; a partner is an absorber, a tank or a circuit; another power a film or a
#: stream; a reading drifts in gain or phase. Others are one.
_STANDS_FOR = 3.0
#: Signs of contact, each with that prior. Of 220 generated springs, joints and contacts 7 more are doubted than if both
#: share the prior of one: 4 contacts that imitate a hardening spring, and 3 springs.
_SIGNS = 2.0
#: Causes outside the library: if one of them explains more than the library can, the cause is not in it.
FOREIGN: dict[str, Effect] = {
    effect.name: replace(effect, prior=_STANDS_FOR)
    for effect in (foreign.ANY_POWER, structure.PARTNER, course.READING_DRIFT)
} | {
    effect.name: effect
    for effect in (
        replace(contact.CONTACT, prior=_SIGNS * _STANDS_FOR),
        foreign.SLOW_SPRING,
        foreign.SQUEEZED_FILM,
        foreign.FALLING_FRICTION,
        foreign.MEMORY,
        contact.RUB,
        contact.LOOSE_DASHPOT,
        structure.NEIGHBOURS,
        received.FORCE_CELL,
        rig.SENSOR_MOUNT,
        detector.SLOW_DETECTOR,
        rig.GAIN_SLOPE,
        masses.VARYING_MASS,
        masses.OTHER_MASS,
        masses.OTHER_ADDED_MASS,
        course.OTHER_STATE,
    )
}


def find_effect(name: str) -> Effect:
    """The effect called ``name``. InputError: no such effect; the message names the nearest one."""
    if name not in CATALOGUE:
        raise InputError(f"unknown effect {name!r}", expected=list_nearest(name, CATALOGUE))
    return CATALOGUE[name]


def list_lasting(effects: Mapping[str, Mapping[str, float]], *, of_rig: bool = False) -> dict[str, Mapping[str, float]]:
    """The effects of a model file that persist in a further test: those of the structure; ``of_rig``: of the rig too.

    Those that are ``passing`` (`Effect`), or of one state, are left out.
    """
    known = {name: find_effect(name) for name, table in effects.items() if not table.get("state")}
    return {
        name: effects[name]
        for name, effect in known.items()
        if not effect.passing and (of_rig or effect.kind != "instrument")
    }


def with_effects(terms: Terms, effects: Mapping[str, Mapping[str, float]]) -> Terms:
    """The terms with the effects of a model file, in the order of the file.

    Raises:
        InputError: an unknown effect, or a key of one that is unknown or missing.
    """
    for name, table in effects.items():
        effect = find_effect(name)
        terms = effect.simulate(terms, effect.complete(table))
    return terms


def list_forms(effect: Effect, scales: Scales) -> tuple[Form, ...]:
    """The forms of an effect for a problem, and their twins, each with its origin, by which it is unpickled."""

    def stamp(form: Form, *origin: object) -> Form:
        return replace(form, origin=(effect, scales, *origin))

    forms = enumerate(effect.forms(scales))
    return tuple(stamp(replace(form, twin=form.twin and stamp(form.twin, n, True)), n, False) for n, form in forms)


def _make_form(effect: Effect, scales: Scales, number: int, of_twin: bool) -> Form:
    form = list_forms(effect, scales)[number]
    return cast(Form, form.twin) if of_twin else form


def _find_any(name: str) -> Effect:
    return CATALOGUE.get(name) or FOREIGN[name]


# closures cannot be pickled: an effect is pickled by its name, a form by its origin
copyreg.pickle(Effect, lambda effect: (_find_any, (effect.name,)))
copyreg.pickle(Form, lambda form: (_make_form, form.origin))
