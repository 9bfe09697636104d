"""Diagnoses with a part of the library, where its other effects are not what is tested."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import pytest

from damping.effects.contract import Effect

T = TypeVar("T")


def limited(library: Mapping[str, Effect], ask: Callable[..., T], *given: Any, **options: Any) -> T:
    """The answer of ``ask`` (`damping.gap.diagnose.explain` or ``diagnose``) while ``library`` is the catalogue."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("damping.gap.diagnose.CATALOGUE", library)
        return ask(*given, **options)
