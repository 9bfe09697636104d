"""Parameters of an explanation, and the simulation corrected by it, ready to run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from selection.gap.effects.form import Effect
from selection.gap.fit import Fit
from selection.gap.model import Part
from selection.gap.simulation import within_tolerance
from selection.records.mode import Mode


def refitted_values(one: Fit) -> dict[str, float]:
    """Relative corrections of the simulation's parameters at a fit, by name; those an effect replaced left out."""
    simulation = one.model.problem.simulation
    replaced = {part.form.replaces for part in one.model.parts}
    x = one.y[: len(simulation.names)]
    values = np.exp(within_tolerance(x) * simulation.tolerance) - 1.0
    return {name: float(v) for name, v in zip(simulation.names, values, strict=True) if name not in replaced}


def effect_values(one: Fit) -> dict[str, dict[str, float]]:
    """Parameters of every effect of a fit, as a model file holds them."""
    start = len(one.model.problem.simulation.names)
    found = {}
    for part in one.model.parts:
        found[part.form.effect] = reported(part, one.y[start : start + part.size])
        start += part.size
    return found


def reported(part: Part, x: np.ndarray) -> dict[str, float]:
    """Parameters of one part at its variables x (size,)."""
    values = [float(value[0, 0]) for value in part.values(x[np.newaxis])]
    return {name: float(value) for name, value in part.form.report(*values).items()}


def corrected_mode(one: Fit, effects: Mapping[str, Effect]) -> Mode:
    """The simulation with its refitted parameters and the effects of a fit.

    Damping forces go to ``damping`` (beside one of the same name, its coefficients add), corrected parameters take the
    place of the nominal ones, everything else goes to ``effects``.
    """
    mode = one.model.problem.simulation.mode
    refit = refitted_values(one)
    damping = {name: _scaled(table, refit.get(name, 0.0)) for name, table in mode.damping.items()}
    frequency = mode.frequency * (1.0 + refit.get("frequency", 0.0))
    others: dict[str, Mapping[str, Any]] = dict(mode.effects)
    for name, values in effect_values(one).items():
        if name == "natural-frequency":
            frequency = mode.frequency * (1.0 + values["relative"])
        elif name == "viscous-coefficient":
            damping["viscous"] = _scaled(mode.damping["viscous"], values["relative"])
        elif effects[name].force:
            force = effects[name].force
            damping[force] = _together(damping.get(force, {}), values)
        else:
            others[name] = values
    mass = mode.mass * (1.0 + refit.get("mass", 0.0))
    return replace(mode, frequency=frequency, mass=mass, damping=damping, effects=others)


def _scaled(table: Mapping[str, float], relative: float) -> dict[str, float]:
    """A damping force with its leading coefficient changed by a share of itself."""
    leading = next(iter(table))
    return {key: value * (1.0 + relative) if key == leading else value for key, value in table.items()}


def _together(simulated: Mapping[str, float], added: Mapping[str, float]) -> dict[str, float]:
    """Coefficients of one force, simulated and added."""
    leading = next(iter(added))
    return {key: value + (simulated.get(key, 0.0) if key == leading else 0.0) for key, value in added.items()}
