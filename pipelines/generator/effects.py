"""All effects by name, in groups, and the truth with some of them present."""

from __future__ import annotations

from collections.abc import Mapping

from pipelines.generator.bench import Bench
from pipelines.generator.force_effects import FORCE_KINDS
from pipelines.generator.foreign_effects import FOREIGN_KINDS
from pipelines.generator.kind import Effect, Kind, Truth
from pipelines.generator.path_effects import PATH_KINDS
from pipelines.generator.plan import Generator
from pipelines.generator.rig_effects import RIG_KINDS

KINDS: Mapping[str, Kind] = {**FORCE_KINDS, **PATH_KINDS, **RIG_KINDS, **FOREIGN_KINDS}

LIBRARY = (*FORCE_KINDS, *PATH_KINDS, *RIG_KINDS)
OUTSIDE = tuple(FOREIGN_KINDS)
#: Members of pairs.
FORCES = (
    "displacement",
    "velocity-squared",
    "displacement-velocity",
    "quadratic-displacement",
    "coulomb-friction",
)
INSTRUMENT = tuple(RIG_KINDS)
STRUCTURE = ("slip", "stiffness-hardening", "stiffness-softening", *PATH_KINDS)


def applied(effects: tuple[Effect, ...], bench: Bench) -> Truth:
    """True structure and rig with the effects present."""
    truth = bench.truth(), bench.rows
    for effect in effects:
        truth = KINDS[effect.name].apply(truth, effect.size, effect.shape, bench)
    return truth


def draw_effect(name: str, rng: Generator, bench: Bench) -> Effect:
    """The effect with a drawn shape and its largest size."""
    return Effect(name, KINDS[name].most(bench), KINDS[name].shape(rng, bench))
