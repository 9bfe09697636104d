"""Whether ranking and diagnosis agree: on the load at the requested force, and on the rows.

The ranked laws predict a band of amplitude. Every explanation that the diagnosis keeps gives a corrected
simulation with a resonant amplitude. If that lies outside the band, both commands report it before their results. If
only one of the two finds the rows explained, both report it after their results.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.effects import CATALOGUE, find_effect, list_lasting
from damping.errors import AnalysisError
from damping.extrapolation import Extrapolation, predict_record
from damping.extrapolation.prediction import Loads
from damping.extrapolation.prepared import PreparedRecord, prepare_record
from damping.forces import CATALOGUE as FORCES
from damping.forces.contract import Force
from damping.gap.corrected import corrected_mode
from damping.gap.diagnose import HYPOTHESES, Diagnosis, Explained, explain
from damping.gap.problem import MOST_ROWS
from damping.gap.sweeping import read_resonance, simulated_force
from damping.gap.weighing import KNOWN
from damping.infer.discrepancy import LIKELY, JointEvidence
from damping.predict.steady import phase_resonance
from damping.progress import Progress, silent, unknown_length
from damping.ranking.along_sweeps import FEWEST_ROWS
from damping.ranking.verdict import FitVerdict
from damping.records import Audit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.text import AGREED, Disagreement, describe_p

#: Probability from which the diagnosis keeps an explanation, if the library probably holds the cause: as much as a band
#: of 90 % leaves above it.
KEPT = 0.05
#: Effects whose damping force is hysteretic, such as a joint that softens as it slips.
WITH_MEMORY = {
    name for name, effect in CATALOGUE.items() if effect.damping and FORCES[effect.damping].joints is not Force.joints
}
#: Force over the largest tested force at which a diagnosis, for which no load is given, is compared with the laws.
BEYOND = 2.0
LEVEL = 0.9  #: content of the predictive band at that force


def compare_with_diagnosis(
    prepared: PreparedRecord, predicted: Extrapolation, progress: Progress = silent
) -> Disagreement:
    """Describe where the diagnosis of the simulation in the mode file contradicts predicted loads; empty if nowhere."""
    # where a law fits poorly, `describe_fall` may quote probabilities, which unnamed causes change
    explained = _explain(prepared, brief=predicted.plan.fit.verdict != "poor", progress=progress)
    return compare(predicted, explained) if explained else _say_not_compared(prepared)


def compare_with_ranking(
    record: Record, diagnosis: Diagnosis, findings: Audit, seed: int, progress: Progress = silent
) -> Disagreement:
    """Describe where the ranked laws contradict a diagnosis at ``BEYOND`` times the tested force; empty if they agree.

    ``findings``: of the audit of the record.
    """
    try:
        prepared = prepare_record(record, diagnosis.mode, findings)
        predicted = predict_record(prepared, np.empty(0), (BEYOND,), LEVEL, seed, fresh=False, progress=progress)
    except AnalysisError:  # a record without rows that laws can be ranked on
        return AGREED
    return compare(predicted, diagnosis)


def doubt_misfit(prepared: PreparedRecord, fit: FitVerdict, progress: Progress = silent) -> Disagreement:
    """Describe where the diagnosis contradicts a ranking in which no law fits; empty if they agree."""
    explained = _explain(prepared, brief=True, progress=progress)
    return Disagreement(on_rows=describe_misfit(fit, explained)) if explained else _say_not_compared(prepared)


def _say_not_compared(prepared: PreparedRecord) -> Disagreement:
    """A sentence where a record that has a simulation is too long to be diagnosed; else empty."""
    if not prepared.mode.damping or len(prepared.measured.driven) <= MOST_ROWS:
        return AGREED
    return Disagreement(on_rows=(f"not compared with a diagnosis, which is of at most {MOST_ROWS} rows",))


def _explain(prepared: PreparedRecord, *, brief: bool, progress: Progress) -> Explained | None:
    """The explanations; None for a model without damping, or a record that no simulation can be compared with.

    They are of the rows under a modal force, as swept.
    """
    if not prepared.mode.damping:
        return None
    with suppress(AnalysisError), unknown_length(progress, "comparing", HYPOTHESES) as report:
        return explain(prepared.measured.driven, prepared.mode, brief=brief, done=report)
    return None


def compare(predicted: Extrapolation, explained: Explained) -> Disagreement:
    """Describe where amplitudes disagree, else where verdicts do; empty if they agree.

    Where ``predicted`` holds forces for given amplitudes, amplitudes are compared at those forces.
    """
    loads = predicted.loads
    if loads.amplitude is not None:
        known = loads.force[np.isfinite(loads.force)]
        loads = predicted.predict_at(known) if known.size else loads
    amplitudes = describe_disagreement(loads, explained)
    data, fit, joint = predicted.plan.data, predicted.plan.fit, predicted.plan.joint
    one_each = len(data.A) == len(data.sweeps) < len(explained.setting.problem.rows)
    resonances = len(data.A) if one_each else None
    if amplitudes:
        return Disagreement(on_loads=amplitudes)
    return Disagreement(on_rows=describe_misfit(fit, explained, resonances) or describe_fall(joint, explained))


def describe_misfit(fit: FitVerdict, explained: Explained, resonances: int | None = None) -> tuple[str, ...]:
    """Describe where only one of ranking and diagnosis explains the rows down to the noise; empty if they agree.

    No law can represent effects that the simulation already has: if no law fits beside them, that is no conflict.
    ``resonances``: number of resonances behind the p-value of a law that fits; None if it is of all rows.
    """
    effects, p = " and ".join(explained.leading.effects), f"({describe_p(fit.p_value)})"
    beside = f" beside {effects}" if effects else ""
    if fit.verdict == "none fits" and explained.unexplained:
        does = f"more than noise is left{beside}" if effects else "no effect does"
        return (f"neither ranking nor diagnosis explains the rows: no law fits them {p}, and {does}",)
    if fit.verdict == "none fits" and not effects and not explained.mode.effects:
        verdict_text = f"no law fits them {p}, while the diagnosis adds no effect and treats the rest as noise"
    elif fit.verdict == "fits" and explained.unexplained:
        weak = ", so few that they have little power" if resonances is not None and resonances < FEWEST_ROWS else ""
        subject, rows = (
            ("them", "") if resonances is None else (f"their {resonances} resonances alone{weak}", " in all rows")
        )
        verdict_text = f"a law fits {subject} {p}, while the diagnosis finds more than noise left{rows}{beside}"
    else:
        return ()
    return (f"ranking and diagnosis disagree on whether the rows are explained: {verdict_text}",)


def describe_fall(joint: JointEvidence, explained: Explained) -> tuple[str, ...]:
    """Describe where the resonance falls as with a slipping joint but the diagnosis names another cause; else empty.

    Rows at resonance alone cannot tell what moves it and are not compared.
    """
    effects, p = explained.leading.effects, explained.hypotheses[0].probability
    of_joint = sum(each.probability for each in explained.hypotheses if WITH_MEMORY & set(each.effects))
    comparable = joint.informative and not explained.setting.problem.rows.at_resonance
    if not comparable or joint.probability < LIKELY or of_joint > 1.0 - LIKELY or not effects:
        return ()
    surer = "rely on the diagnosis, which leaves only noise in all rows"
    unsure = "rely on neither, because the diagnosis leaves more than noise in the rows"
    return (
        "ranking and diagnosis disagree on why the resonance falls from level to level: a slipping joint"
        f" (probability {joint.probability:.2f}), while the diagnosis finds {' and '.join(effects)} ({p:.2f}), and a"
        f" joint with {of_joint:.2f}: {unsure if explained.unexplained else surer}",
    )


def describe_disagreement(loads: Loads, explained: Explained) -> tuple[str, ...]:
    """Describe the most probable kept explanation whose corrected simulation leaves the band; empty if there is none.

    Also empty where the diagnosis doubts that the cause is in the library: an effect that merely imitates the test
    proves nothing beyond it.
    """
    units, band = explained.units, loads.average
    for explanation in explained.hypotheses if explained.in_library >= KNOWN else ():
        if explanation.probability < KEPT:
            break
        rows = explanation.hypothesis.best.model.problem.rows
        corrected = corrected_mode(explanation.hypothesis.best)
        amplitude = simulate_resonance(corrected, loads.force, rows.omega, rows.has_phase)
        outside = (amplitude < band.low) | (amplitude > band.high)
        if outside.any():
            at = int(np.argmax(np.where(outside, loads.force, 0.0)))
            first = explained.hypotheses[0]
            cause, leading = (" and ".join(each.effects) or "no effect" for each in (explanation, first))
            stays = f"; {leading}, which leads ({first.probability:.2f}), stays within the band"
            ends = {f"{end[at]:.3g}" for end in (band.low, band.high)}
            digits = 3 + (f"{amplitude[at]:.3g}" in ends)  # as bands are printed, or one more where these would agree
            median, low, high, corrects = (f"{x[at]:.{digits}g}" for x in (band.median, band.low, band.high, amplitude))
            ranked = f"{median} {units.length}".rstrip()
            return (
                f"ranking and diagnosis disagree at the {units.drive} {loads.force[at]:.4g} {units.force}".rstrip()
                + f": the ranked laws predict {ranked} ({low} to {high}), the simulation"
                f" corrected by {cause}, which the diagnosis does not exclude (probability"
                f" {explanation.probability:.2f}), {corrects} {units.length}".rstrip()
                + ("" if explanation is first else stays),
            )
    return ()


def simulate_resonance(mode: Mode, force: FloatArray, omega: FloatArray, has_phase: bool = True) -> FloatArray:
    """Resonant amplitude of a model at each force (forces,), NaN where it has none.

    Effects of the rig and of one test are left out: they are not part of the structure. If only force effects remain,
    the amplitude is that of phase resonance. Further planes and modes need a sweep, read as the record's sweeps are:
    at the tested frequencies ``omega`` (n,), rad/s, shifted with the resonance.
    """
    kept = list_lasting(mode.effects)
    forces = {name: table for name, table in kept.items() if find_effect(name).force is not None}
    damped = simulated_force(replace(mode, effects=forces))
    amplitude, resonance = phase_resonance(damped, force, mode.mass, RAD_S_PER_HZ * mode.frequency)
    if forces == kept:
        return amplitude
    places = np.unique(omega) / mode.omega_n
    model = replace(mode, effects=kept)
    return np.array(
        [
            read_resonance(model, F, moved * places, has_phase) if np.isfinite(moved) else np.nan
            for F, moved in zip(force, resonance, strict=True)
        ]
    )
