"""Effects: what may part a simulation from a test. A contract, effects of one kind in one file, and the catalogue."""

from __future__ import annotations

from collections.abc import Mapping

from damping.effects.contract import Effect, Terms
from damping.effects.course import DRIFT, LEVEL_OFFSET, SWEEP_RATE
from damping.effects.forces import (
    COULOMB_FRICTION,
    DISPLACEMENT,
    DISPLACEMENT_VELOCITY,
    QUADRATIC_DISPLACEMENT,
    SLIP,
    STIFFNESS_HARDENING,
    STIFFNESS_SOFTENING,
    VELOCITY_SQUARED,
)
from damping.effects.rig import AMPLITUDE_SCALE, BACKGROUND, FORCE_DROPOUT, PHASE_LAG, SENSOR_SATURATION, TIME_DELAY
from damping.effects.structure import (
    NATURAL_FREQUENCY,
    PLANAR_COUPLING,
    RESIDUAL_MODES,
    SECOND_MODE,
    VISCOUS_COEFFICIENT,
)
from damping.errors import InputError
from damping.forces.shapes import describe_nearest_of

#: The library: what a gap may be called, in the order in which hypotheses are tried.
CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        VISCOUS_COEFFICIENT,
        DISPLACEMENT,
        VELOCITY_SQUARED,
        DISPLACEMENT_VELOCITY,
        QUADRATIC_DISPLACEMENT,
        COULOMB_FRICTION,
        SLIP,
        STIFFNESS_HARDENING,
        STIFFNESS_SOFTENING,
        NATURAL_FREQUENCY,
        PLANAR_COUPLING,
        SECOND_MODE,
        RESIDUAL_MODES,
        DRIFT,
        AMPLITUDE_SCALE,
        PHASE_LAG,
        TIME_DELAY,
        FORCE_DROPOUT,
        LEVEL_OFFSET,
        SENSOR_SATURATION,
        BACKGROUND,
        SWEEP_RATE,
    )
}


def find_effect(name: str) -> Effect:
    """The effect called ``name``.

    Raises:
        InputError: no such effect; the nearest one is named.
    """
    if name not in CATALOGUE:
        raise InputError(f"unknown effect {name!r}", expected=describe_nearest_of(name, CATALOGUE))
    return CATALOGUE[name]


def with_effects(terms: Terms, effects: Mapping[str, Mapping[str, float]]) -> Terms:
    """The terms with the effects of a model file, in the order of the file.

    Raises:
        InputError: an unknown effect, or a key of one that is unknown or missing.
    """
    for name, table in effects.items():
        effect = find_effect(name)
        terms = effect.simulate(terms, effect.complete(table))
    return terms
