"""Every effect by name, written out in full."""

from __future__ import annotations

from selection.gap.effects.amplitude_scale import AMPLITUDE_SCALE
from selection.gap.effects.damping_forces import (
    COULOMB_FRICTION,
    DISPLACEMENT,
    DISPLACEMENT_VELOCITY,
    QUADRATIC_DISPLACEMENT,
    VELOCITY_SQUARED,
)
from selection.gap.effects.force_dropout import FORCE_DROPOUT
from selection.gap.effects.form import Effect
from selection.gap.effects.natural_frequency import NATURAL_FREQUENCY
from selection.gap.effects.phase_lag import PHASE_LAG
from selection.gap.effects.planar_coupling import PLANAR_COUPLING
from selection.gap.effects.residual_modes import RESIDUAL_MODES
from selection.gap.effects.slip import SLIP
from selection.gap.effects.stiffness import STIFFNESS_HARDENING, STIFFNESS_SOFTENING
from selection.gap.effects.viscous_coefficient import VISCOUS_COEFFICIENT

#: The library: what a gap may be called. One line an effect.
CATALOGUE: dict[str, Effect] = {
    "viscous-coefficient": VISCOUS_COEFFICIENT,
    "displacement": DISPLACEMENT,
    "velocity-squared": VELOCITY_SQUARED,
    "displacement-velocity": DISPLACEMENT_VELOCITY,
    "quadratic-displacement": QUADRATIC_DISPLACEMENT,
    "coulomb-friction": COULOMB_FRICTION,
    "slip": SLIP,
    "stiffness-hardening": STIFFNESS_HARDENING,
    "stiffness-softening": STIFFNESS_SOFTENING,
    "natural-frequency": NATURAL_FREQUENCY,
    "planar-coupling": PLANAR_COUPLING,
    "residual-modes": RESIDUAL_MODES,
    "amplitude-scale": AMPLITUDE_SCALE,
    "phase-lag": PHASE_LAG,
    "force-dropout": FORCE_DROPOUT,
}

#: Effects that deny each other: both at once stand for a stiffness of another shape.
CONTRADICTORY = (frozenset({"stiffness-hardening", "stiffness-softening"}),)
