"""Other causes that have the same effect as the ones of an explanation, as cautions."""

import numpy as np

from damping.gap.corrected import effect_values, refitted_values
from damping.gap.fit import ModelFit
from damping.records.text import per_cent

_TIMES = 10.0  # multiple of a coefficient above which per cents are hard to read


def list_ambiguities(fit: ModelFit) -> list[str]:
    """Every caution of this module about a fit."""
    causes = (describe_gain, describe_rig, describe_slope, describe_shortfall, describe_spring)
    return [caution for describe in causes for caution in describe(fit)]


def describe_gain(fit: ModelFit) -> list[str]:
    """Caution: a gain g of the sensor reads as a wrong mass, g F/|Z(M)| = F/|Z(M/g)| where Z is proportional to M.

    None where masses were added, which break the proportion, or where a user's function is the simulation.
    """
    simulation, gain = fit.model.problem.simulation, effect_values(fit).get("amplitude-scale")
    if gain is None or simulation.simulator is not None or np.any(fit.model.problem.rows.added):
        return []
    stated, tolerance, units = simulation.mode.mass, simulation.mode.tolerance.mass, simulation.mode.units
    ratio = (1.0 + refitted_values(fit)["mass"]) / gain["factor"]
    unit = f" {units.force}·{units.time}²/{units.length}" if all(vars(units).values()) else ""
    times = f", {abs(np.log(ratio)) / tolerance:.2g} times its stated tolerance of {100.0 * tolerance:g} %"
    return [
        f"a generalized mass of {stated * ratio:.4g}{unit} in place of {stated:.4g} ({100.0 * (ratio - 1.0):+.2g} %"
        f"{times if tolerance else ''}), with stiffness and damping in the same ratio, has the same effect as this "
        "gain on every steady sweep. A known added mass, or a calibrated shaker and sensor, separates the two"
    ]


def describe_rig(fit: ModelFit) -> list[str]:
    """Cautions: faults of the rig that look like the structure.

    Cross-talk in phase with the force, or against it, is a compliance, as of modes far away; see `describe_slope` for
    another one. A frequency that drifts, or is off by r, may be that of the clock, or of a structure that the rig
    loads:

    M ((1 + r)^2 omega_n^2 - omega^2) is that of a frequency omega recorded as omega (1 + r); also, within the tolerance
    of M, that of a further mass M ((1 + r)^-2 - 1) if r < 0, else of a further spring K ((1 + r)^2 - 1). Neither is
    told where masses were added, which separate them, or where a user's function is the simulation. A damper of the rig
    adds to the viscous coefficient: -M omega^2 + i omega (c + c_rig) + K.
    """
    problem, values, cautions = fit.model.problem, effect_values(fit), list[str]()
    if any(key.startswith("frequency") for key in values.get("drift", ())):
        cautions.append(
            "a clock or frequency readout that drifts as much has the same effect as this drift of the frequency: "
            "check it before the structure is blamed"
        )
    if "residual-modes" in values:
        cautions.append(
            "cross-talk in proportion to the force, in phase with it or against it, looks like these residual modes: "
            "readings while the shaker is driven but detached separate the two"
        )
    added = values.get("viscous-coefficient", {}).get("relative", 0.0)
    if added > 0.0 and problem.simulation.mode.rig.force != "measured":
        size = f"{added:.3g} times" if added > _TIMES else f"{per_cent(100.0 * added)} % of"
        cautions.append(
            f"a damper of {size} the simulated viscous coefficient that acts in this test alone (a shaker's armature, "
            "a stinger, a suspension, cables) has the same effect as this viscous coefficient, unless a force cell at "
            "the structure excludes it: check it before the simulation is changed"
        )
    relative = values.get("natural-frequency", {}).get("relative", 0.0)
    if relative and problem.simulation.simulator is None and not np.any(problem.rows.added):
        mass, spring = (1.0 + relative) ** -2 - 1.0, (1.0 + relative) ** 2 - 1.0
        light = f"a mass of {per_cent(100.0 * mass)} % of the mode's (force cell, sensor, stinger, armature)"
        stiff = f"a spring of {per_cent(100.0 * spring)} % of the mode's stiffness (suspension, stinger, cable)"
        cautions.append(
            f"{light if relative < 0.0 else stiff} that loads the structure in this test alone, or a frequency readout "
            f"that is off by {100.0 * relative:+.2g} %, has the same effect as this natural frequency: check both "
            "before the simulation is changed"
        )
    return cautions


def describe_slope(fit: ModelFit) -> list[str]:
    """Caution: a gain that follows f^p reads as residual modes, beside a lag if phases are measured.

    With x = omega/omega_n - 1 and the damping ratio d, the response Y = F/(2 K (i d - x)) times 1 + p x is
    (1 + i d p) Y - p F/(2 K): a compliance of -p/(2 K), and a turn that amplitudes do not show. A sensor whose mount
    resonates at f_s reads 1/(1 - (f/f_s)^2) of the motion, p = 2/((f_s/f)^2 - 1), with a lag by the mount's damping.
    """
    values, simulation = effect_values(fit), fit.model.problem.simulation
    path = values.get("residual-modes")
    if path is None or (fit.model.problem.rows.has_phase and {"phase-lag", "time-delay"}.isdisjoint(values)):
        return []
    stiffness = simulation.mode.mass * simulation.mode.omega_n**2
    power = -2.0 * stiffness * path["compliance"] / (path["frequency_ratio"] ** 2 - 1.0)
    squared = 1.0 + 2.0 / power  # of f_s over f
    resonance = simulation.mode.frequency * np.sqrt(max(squared, 0.0))
    mount = f", a sensor whose mount resonates at about {resonance:.3g} Hz" if resonance else ""
    beside = "and this lag" if fit.model.problem.rows.has_phase else "where phases are not measured"
    return [
        f"a gain that follows f^{power:.2g} (a filter, a table that tilts{mount}) looks like these residual modes "
        f"{beside}: check the gain over frequency before the structure is blamed"
    ]


def describe_shortfall(fit: ModelFit) -> list[str]:
    """Caution: saturated readings g F/|Z| of a linear mode read as a force g F. None where the force was measured."""
    if "sensor-saturation" not in fit.effects or fit.model.problem.simulation.mode.rig.force == "measured":
        return []
    return [
        "in a linear structure, a force that falls below the recorded one at large motion (a shaker at its limit) has "
        "the same effect as this saturation; a measured force separates the two"
    ]


def describe_spring(fit: ModelFit) -> list[str]:
    """Caution: what moves the resonance as the mean square of the motion does has a spring's first harmonics.

    With a = A^2/2, K + s a - M omega^2 differs from a cubic spring by a factor on s; M omega^2 (1 - s a), of a varying
    mass or of a true frequency omega (1 - s a/2) that is recorded as omega, by the width of the resonance too. None
    with third harmonics, which only the spring has in full.
    """
    springs = {"stiffness-hardening", "stiffness-softening"}
    if springs.isdisjoint(fit.effects) or "third" in fit.model.problem.rows.channels:
        return []
    return [
        "a stiffness or mass that follows the mean square of the motion, or a drive whose frequency departs from the "
        "recorded one as the motion grows, has the first harmonics of this spring; third harmonics separate them"
    ]
