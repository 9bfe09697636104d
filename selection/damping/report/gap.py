"""A gap diagnosis in words, as an engineer would report it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from damping import report as words
from damping.effects import CATALOGUE
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape
from damping.gap.corrected import describe_effects, effect_intervals, is_gone, name_places, refitted_values
from damping.gap.diagnose import Diagnosis
from damping.gap.directed import ALARM, smallest_p
from damping.gap.outside import name_better
from damping.gap.readings import describe_rest
from damping.gap.scatter import describe_repeatability, describe_scatter
from damping.gap.simulation import MOST_TOLERANCES
from damping.gap.simulator_checks import RESEMBLES
from damping.gap.weighing import KNOWN
from damping.records.mode import Units
from damping.records.text import Disagreement, per_cent
from damping.report.page import Block, List, Text, write_sections

#: Probability that the library holds the cause below which no sizes are reported: they are of absent effects.
SIZED = 0.1
_DIGITS = (3, 8)  #: fewest and most significant digits of a size
#: Least move of a parameter that is told, in tolerances, or of its value where a tolerance is wide: smaller ones change
#: no one's opinion of the stated value. One of about a tolerance is told even if its interval holds 0, as where another
#: parameter acts alike.
_MOVED = 0.5
_LARGE = 0.05
_FAR_MOVED = 0.8
_AT_LIMIT = 0.95  #: share of ``MOST_TOLERANCES`` from which a refitted parameter is at the limit, and has no interval
MOST_BARS = 8  #: explanations drawn


def describe_diagnosis(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """Sentences by topic.

    ``verdict`` (one: the cause, its probability, whether it is complete), ``sizes`` (of effects), ``refit`` (parameters
    of the simulation that moved), ``place`` (of most of the gap), ``doubts`` (effects that cannot be separated),
    ``trends`` (of local damping and frequency with amplitude), ``reach`` (how far the gap shrinks on held-out levels),
    ``following`` (what to test next).
    """
    leading, places = diagnosis.hypotheses[0], name_places(diagnosis.leading)
    parameters = describe_effects(diagnosis.leading.best)[0]
    named = {name: f"{name}, {places[name]}" if name in places else name for name in leading.effects}
    apart = [] if diagnosis.unexplained_rows else describe_repeatability(diagnosis.setting, diagnosis.leading.best)
    trends = (("Damping", diagnosis.damping_trend), ("Natural frequency", diagnosis.frequency_trend))
    values = {
        **vars(diagnosis),
        "leading": leading,
        "effects": [
            f"{_say_effect(name, parameters[name])} ({named[name]})" if name in CATALOGUE else name for name in named
        ],
        "sizes": _list_sizes(diagnosis) if diagnosis.in_library >= SIZED else [],
        "moved": _list_moved(diagnosis) if diagnosis.in_library >= SIZED else [],
        "top": diagnosis.where[0],
        "trends": [(what, trend) for what, trend in trends if trend is not None],
        "test": next(iter(diagnosis.next_tests), None),
        "drive": diagnosis.units.drive,
        "force_unit": diagnosis.units.force,
        "mass_unit": words.format_dimension_text(FORCE * TIME**2 / LENGTH, diagnosis.mode.units),
        "settles": diagnosis.next_test is not None,
        "apart": apart,
        "scatter": describe_scatter(diagnosis.setting, diagnosis.leading.best),
        "known": KNOWN,
        "better": name_better(diagnosis.outside),
        "shown": describe_rest(diagnosis.leading.best, diagnosis.tests),
        "far_only": diagnosis.leading.best.has_outlier_pattern and smallest_p(diagnosis.tests) >= ALARM,
    }
    sections = write_sections(Path(__file__).with_name("gap_words.txt"), values)
    return {section.id: [text for block in section.blocks for text in list_sentences(block)] for section in sections}


def order_cautions(against: Disagreement, cautions: Sequence[str]) -> tuple[list[str], list[str]]:
    """Sentences to show before the answer, and cautions to show after it.

    The first are on a simulator that takes frequencies in another unit, and on loads that the ranked laws dispute.
    """
    doubted = [caution for caution in cautions if caution.startswith(RESEMBLES)]
    first = [f"{sentence[0].upper()}{sentence[1:]}." for sentence in (*doubted, *against.on_loads)]
    return first, [*against.on_rows, *(caution for caution in cautions if caution not in doubted)]


def _say_effect(name: str, values: Mapping[str, float]) -> str:
    """The statement of an effect on structure or test, also where it reduces or replaces a simulated force."""
    effect, relative = CATALOGUE[name], values.get("relative", 0.0)
    if "instead" in values:
        return effect.sentence.removesuffix(" is missing") + " replaces the simulated viscous damping"
    if effect.corrects and effect.damping and "relative" not in values:
        return f"{effect.damping} damping is missing"
    if effect.corrects or relative >= 0.0:
        return effect.sentence
    there = "not there" if is_gone(values) else f"too large: {per_cent(100.0 * (1.0 + relative))} % of it is present"
    return f"the simulated {effect.damping} force is {there}"


def _list_sizes(diagnosis: Diagnosis) -> list[str]:
    """Free parameters of the leading effects with intervals, in the digits that these justify; switches that are on."""
    fit, sizes = diagnosis.leading.best, list[str]()
    values = describe_effects(fit)[0]
    for effect, intervals in effect_intervals(fit).items():
        for name, ends in intervals.items() if effect in CATALOGUE else ():
            value = values[effect][name]
            digits = count_digits(value, *ends)
            label, unit = name_parameter(effect, name, diagnosis.units)
            low, high = (words.number(end, digits) for end in ends)
            sizes.append(f"{effect}, {label}: {words.format_quantity(value, unit, digits)} ({low} to {high})")
        switches = [shape for shape in CATALOGUE[effect].shapes if shape.switch] if effect in CATALOGUE else []
        sizes += [f"{effect}: {shape.label}" for shape in switches if values[effect].get(shape.name)]
    return sizes


def _list_moved(diagnosis: Diagnosis) -> list[str]:
    """Parameters of the simulation that the fit surely moved by much, or by about a tolerance, and by how much.

    No tolerances where the record itself gave the values, or a base drive makes mass and damping uncertain.
    """
    fit, moved = diagnosis.leading.best, list[str]()
    simulation, intervals = fit.model.problem.simulation, effect_intervals(fit)["simulation"]
    own = simulation.simulator.tolerances if simulation.simulator else {}
    stated = not simulation.mode.tolerance.from_record and simulation.mode.drive != "base"
    by_name = dict(zip(simulation.names, simulation.tolerance, strict=True))
    for name, value in refitted_values(fit).items():
        tolerances, (low, high) = float(np.log1p(value)) / (by_name[name] or 1.0), intervals.get(name, (value, value))
        is_large = abs(tolerances) > _MOVED or abs(value) > _LARGE
        if abs(tolerances) < _FAR_MOVED and (low < 0.0 < high or not is_large):
            continue
        shown, *ends = (f"{100.0 * x:+#.{count_digits(value, low, high)}g}".rstrip(".") for x in (value, low, high))
        told = [f"{ends[0]} to {ends[1]}"] if name in intervals else []
        is_bound = stated or name in own
        if is_bound and abs(tolerances) > _AT_LIMIT * MOST_TOLERANCES:
            told = [f"at the limit of {MOST_TOLERANCES:g} tolerances"]
        elif is_bound:
            told.append(f"{abs(tolerances):.2g} tolerances")
        moved.append(f"{name} {shown} % ({'; '.join(told)})")
    return moved


def count_digits(value: float, low: float, high: float) -> int:
    """Digits in which a value and the ends of its interval differ; the fewest if the interval has no finite width."""
    width = high - low
    needed = 2 + int(np.log10(abs(value) / width + 1.0)) if 0.0 < width < np.inf else 0
    return int(np.clip(needed, *_DIGITS))


def name_parameter(effect: str, name: str, units: Units) -> tuple[str, str]:
    """A parameter of an effect in words, and its unit; those of the simulation are relative to the given ones."""
    if effect == "simulation":
        return f"{name}, relative", ""
    shapes = CATALOGUE[effect].shapes if effect in CATALOGUE else ()
    shape = next((shape for shape in shapes if shape.name == name), Shape(name))
    label = (shape.label or name.replace("_", " ")).removeprefix(f"{effect} ")
    return label, words.format_dimension_text(shape.unit, units)


def list_sentences(block: Block) -> list[str]:
    """The sentences of a block."""
    return list(block.items) if isinstance(block, List) else [block.text] if isinstance(block, Text) else []


def tabulate_hypotheses(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row for each fitted explanation, most probable first: ``explanation, probability, log_evidence, listed``.

    ``listed``: whether it is one of those that together reach 0.95.
    """
    return pd.DataFrame(
        {
            "explanation": " + ".join(hypothesis.effects) or "no effect",
            "probability": hypothesis.probability,
            "log_evidence": hypothesis.hypothesis.log_evidence,
            "listed": hypothesis in diagnosis.explanations,
        }
        for hypothesis in diagnosis.hypotheses
    )
