"""The effects: a contract, one small file each, and the catalogue.

Every effect by name: the names are the lines of ``EFFECT_NAMES``, the effects stand in the files of this folder.

Effects that a model file holds already: their tables checked, and added to its terms.
"""

from __future__ import annotations

from damping.errors import InputError
from damping.effects.contract import Effect
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
from damping.effects.rig import AMPLITUDE_SCALE, FORCE_DROPOUT, PHASE_LAG
from damping.effects.structure import NATURAL_FREQUENCY, PLANAR_COUPLING, RESIDUAL_MODES, VISCOUS_COEFFICIENT
from damping.effects.terms import Terms
from damping.records.keys import nearest
from damping.records.mode import Mode

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
        RESIDUAL_MODES,
        AMPLITUDE_SCALE,
        PHASE_LAG,
        FORCE_DROPOUT,
    )
}

#: Effects that deny each other: both at once stand for a stiffness of another shape.
CONTRADICTORY = (frozenset({"stiffness-hardening", "stiffness-softening"}),)


def with_effects(terms: Terms, mode: Mode) -> Terms:
    """The terms of a mode with the effects of its file, in the order of the file."""
    for name, table in mode.effects.items():
        terms = CATALOGUE[name].simulate(terms, table)
    return terms


def check_effects(mode: Mode) -> None:
    """Whether every effect of a model file is known and has the parameters it needs.

    Raises:
        InputError: an unknown effect or key (the nearest known one is named), or a key that is missing.
    """
    for name, table in mode.effects.items():
        if name not in CATALOGUE:
            raise InputError(f"unknown effect {name!r}", file=mode.source, expected=_nearest(name, tuple(CATALOGUE)))
        effect = CATALOGUE[name]
        known = (*effect.keys, *effect.options)
        for key in table:
            if known and key not in known:
                raise InputError(
                    f"unknown key {key!r} in [effects.{name}]", file=mode.source, expected=_nearest(key, known)
                )
        for key in effect.keys:
            if key not in table:
                raise InputError(f"no {key} in [effects.{name}]", file=mode.source, expected=", ".join(effect.keys))


def _nearest(name: str, known: tuple[str, ...]) -> str:
    return f"{nearest(name, known)} (nearest of {', '.join(known)})"
