"""Diagnoses with a part of the library, where its other effects are not what is tested."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import pytest

from damping.effects import CATALOGUE
from damping.effects.contract import Effect

T = TypeVar("T")
#: One or two effects of every kind: parameters, damping forces, a spring, a second plane and readings.
KINDS = (
    *("viscous-coefficient", "natural-frequency", "velocity-squared", "displacement", "stiffness-hardening"),
    *("planar-coupling", "amplitude-scale", "phase-lag"),
)


def limited(library: Mapping[str, Effect] | Iterable[str], ask: Callable[..., T], *given: Any, **options: Any) -> T:
    """The answer of ``ask`` (`damping.gap.diagnose.explain` or ``diagnose``) while ``library`` is all that is known."""
    known = library if isinstance(library, Mapping) else {name: CATALOGUE[name] for name in library}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("damping.gap.diagnose.CATALOGUE", known)
        return ask(*given, **options)
