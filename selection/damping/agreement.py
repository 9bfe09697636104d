"""Do ranking and diagnosis agree? Each is asked what the other holds alive, at the force that a load is wanted for.

The ranked laws predict an amplitude with a band; every explanation that the diagnosis holds alive makes a corrected
simulation, which has a resonant amplitude of its own. Where that lies outside the band the two disagree: both say so.
"""

from collections.abc import Sequence
from dataclasses import replace

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.effects import CATALOGUE, find_effect
from damping.errors import AnalysisError
from damping.extrapolation import extrapolate_loads
from damping.extrapolation.near import near_resonance
from damping.extrapolation.prediction import Loads
from damping.gap.corrected import corrected_mode
from damping.gap.diagnose import Diagnosis, explain
from damping.gap.sweeping import simulated_force
from damping.gap.weighing import Explanation
from damping.predict.steady import phase_resonance
from damping.records.mode import Mode
from damping.records.record import Record

#: Probability from which an explanation counts as alive.
ALIVE = 0.1
#: Force at which a diagnosis is compared with the ranked laws, over the largest tested one: no load was asked for.
BEYOND = 2.0


def compare_with_diagnosis(record: Record, mode: Mode, loads: Loads) -> tuple[str, ...]:
    """What the diagnosis of the simulation in the mode file says against predicted loads; empty where they agree.

    ``record``, ``mode``: of steady states under a modal force.
    """
    if not mode.damping:
        return ()
    try:
        explained = explain(record, mode)
    except AnalysisError:  # a record that no simulation can be compared with
        return ()
    return describe_disagreement(loads, explained.hypotheses, mode)


def compare_with_ranking(record: Record, diagnosis: Diagnosis, seed: int) -> tuple[str, ...]:
    """What the ranked laws say against a diagnosis at ``BEYOND`` times the tested force; empty where they agree."""
    try:
        near = near_resonance(record)
        force = [BEYOND * near.tested_force.max()]
        loads = extrapolate_loads(near, force, seed=seed, mode=diagnosis.mode, fresh=False).loads
    except AnalysisError:  # a record without rows that laws can be ranked on
        return ()
    return describe_disagreement(loads, diagnosis.hypotheses, diagnosis.mode)


def describe_disagreement(loads: Loads, hypotheses: Sequence[Explanation], mode: Mode) -> tuple[str, ...]:
    """The most probable living explanation whose corrected simulation leaves the band, with both numbers; or none."""
    units, band = mode.units, loads.average
    for explanation in hypotheses:
        if explanation.probability < ALIVE:
            break
        amplitude = simulate_resonance(corrected_mode(explanation.hypothesis.best, CATALOGUE), loads)
        outside = (amplitude < band.low) | (amplitude > band.high)
        if outside.any():
            at = int(outside.nonzero()[0][-1])
            cause = " and ".join(explanation.effects) or "no effect"
            ranked = f"{band.median[at]:.4g} {units.length}".rstrip()
            return (
                f"ranking and diagnosis disagree at the force {loads.force[at]:.4g} {units.force}".rstrip()
                + f": the ranked laws say {ranked} ({band.low[at]:.4g} to {band.high[at]:.4g}), the simulation"
                f" corrected by {cause}, which the diagnosis holds alive (probability {explanation.probability:.2f}),"
                f" {amplitude[at]:.4g} {units.length}".rstrip(),
            )
    return ()


def simulate_resonance(mode: Mode, loads: Loads) -> FloatArray:
    """Resonant amplitude of a model at the forces of loads (forces,), NaN where it has none.

    Effects that are no force, such as a gain of the sensor, change what is read and not the structure.
    """
    forces = {name: table for name, table in mode.effects.items() if find_effect(name).force is not None}
    force = simulated_force(replace(mode, effects=forces))
    return phase_resonance(force, loads.force, mode.mass, RAD_S_PER_HZ * mode.frequency)[0]
