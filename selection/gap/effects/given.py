"""Effects that a model file holds already: their tables checked, and added to its terms."""

from __future__ import annotations

from selection.errors import InputError
from selection.gap.effects.catalogue import CATALOGUE
from selection.gap.terms import Terms
from selection.records.mode import Mode
from selection.records.schema import nearest


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
