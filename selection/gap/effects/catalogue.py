"""Every effect by name: the names are the lines of ``EFFECT_NAMES``, the effects stand in the files of this folder."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from selection.gap import effects
from selection.gap.effects.form import Effect
from selection.records.schema import EFFECT_NAMES

#: Files of this folder that define no effect.
_OTHERS = ("catalogue", "form", "given")


def _defined() -> dict[str, Effect]:
    """Effects that the files of this folder define, by name."""
    files = [info.name for info in iter_modules(effects.__path__) if info.name not in _OTHERS]
    modules = [import_module(f"{effects.__name__}.{file}") for file in files]
    found = [value for module in modules for value in vars(module).values() if isinstance(value, Effect)]
    return {effect.name: effect for effect in found}


_DEFINED = _defined()
#: The library: what a gap may be called.
CATALOGUE: dict[str, Effect] = {name: _DEFINED[name] for name in EFFECT_NAMES}

#: Effects that deny each other: both at once stand for a stiffness of another shape.
CONTRADICTORY = (frozenset({"stiffness-hardening", "stiffness-softening"}),)
