"""The page of a gap diagnosis: what an engineer would say of it, sentence by sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np
import pandas as pd

from damping.effects import CATALOGUE
from damping.gap.corrected import EffectPosterior, effect_values, refitted_values
from damping.gap.diagnose import Diagnosis
from damping.report import NOTHING, format_joined, format_percent, format_share, number
from damping.report.gap_figures import gap_figures
from damping.report.page import (
    Block,
    Callout,
    Facts,
    FigureBlock,
    Fold,
    Footer,
    List,
    Section,
    Table,
    Text,
    render_page,
)


def describe_verdict(diagnosis: Diagnosis) -> str:
    """One sentence: what it is, how sure, and whether it is all."""
    gap, leading = diagnosis.gap, diagnosis.hypotheses[0]
    if not leading.effects:
        if diagnosis.unexplained:
            return (
                f"The test differs from the refitted simulation by more than noise ({number(gap.before)} sigma), and "
                "nothing in the library explains it."
            )
        return (
            "The simulation, with its parameters free within their tolerance, already fits the test to its noise "
            f"({number(gap.before)} sigma)."
        )
    size = f"{number(gap.before)} sigma" if gap.shrinkage is not None else "hardly more than noise"
    effects = format_joined(_describe_sentence(name) for name in leading.effects)
    among = " of what is known here" if diagnosis.unexplained else ""
    sentence = (
        f"The test differs from the refitted simulation by {size}: {effects} (probability "
        f"{format_share(leading.probability)}{among})"
    )
    sentence += ", but that is not all." if diagnosis.unexplained else "."
    return f"{sentence} The chance that the cause is in the library at all is {format_share(diagnosis.in_library)}."


def describe_place(diagnosis: Diagnosis) -> str:
    """Where most of the gap lies."""
    top = diagnosis.where[0]
    return (
        f"Most of it lies in the {top.quantity} of sweep {top.sweep} between {number(top.frequency_low, 4)} and "
        f"{number(top.frequency_high, 4)} Hz ({format_percent(100.0 * top.share)} % of the squared residual)."
    )


def describe_doubts(diagnosis: Diagnosis) -> list[str]:
    """What cannot be told apart."""
    doubts = []
    for group in diagnosis.groups:
        sentence = (
            f"This record cannot tell {format_joined(group.effects)} apart: their best-fitting predictions differ by "
            f"{number(group.distance, 2)} sigma in all."
        )
        rig = [name for name in group.effects if CATALOGUE[name].kind == "instrument"]
        if rig and len(rig) < len(group.effects):
            sentence += f" Look at the rig first: {format_joined(rig)} needs no change of the structure."
        doubts.append(sentence)
    return doubts


def describe_reach(diagnosis: Diagnosis) -> str:
    """How far the gap shrinks where it did not choose the explanation."""
    held = diagnosis.held_out
    if held is None:
        return "Nothing could be held out: the record has one force level."
    if held.shrinkage is None or held.low is None or held.high is None:
        return (
            f"Held out ({held.scheme}), the refitted simulation predicts to {number(held.before)} sigma: there is "
            "nothing to shrink."
        )
    return (
        f"{format_percent(100.0 * held.shrinkage)} % of the gap ({format_percent(100.0 * held.low)} to "
        f"{format_percent(100.0 * held.high)} %) vanishes on data that neither chose nor fitted the explanation "
        f"({held.scheme}): {number(held.before)} sigma before, {number(held.after)} after."
    )


def describe_following(diagnosis: Diagnosis) -> str:
    """What to test next."""
    if diagnosis.next_test is None:
        return "No further test that a record can hold is worth its time to choose between explanations."
    test = diagnosis.next_test
    runs = "; ".join(
        f"{row['points']:g} points from {number(row['frequency_low'], 4)} to {number(row['frequency_high'], 4)} Hz at "
        f"force {number(row['force'], 3)}"
        + (f", added mass {number(row['added_mass'], 3)}" if row["added_mass"] else "")
        for row in test.rows
    )
    return (
        f"Next, measure {test.what}: {test.why} (expected log odds {number(test.expected_log_odds, 2)} for the leading "
        f"explanation against its rivals). Run {runs}; append the rows with the columns {format_joined(test.columns)} "
        f"and read them with: {test.command}"
    )


def describe_trends(diagnosis: Diagnosis) -> list[str]:
    """How local damping and frequency go with amplitude."""
    trends = []
    for what, trend in (("Damping", diagnosis.damping_trend), ("Natural frequency", diagnosis.frequency_trend)):
        if trend is not None and trend.gain > TREND_SEEN:
            kind = "grows" if trend.change > 0.0 else "falls"
            trends.append(
                f"{what} {kind} with amplitude: of single powers A^{trend.power:g} fits best beside a constant "
                f"(chi-square {number(trend.gain)} over none)."
            )
        elif trend is not None:
            trends.append(f"{what} does not depend on amplitude beyond noise.")
    return trends


#: Chi-square (2 degrees of freedom: power and size) above which a trend is spoken of: one in a thousand by chance.
TREND_SEEN = 13.8


def _describe_sentence(name: str) -> str:
    return f"{CATALOGUE[name].sentence} ({name})" if name in CATALOGUE else name


_MOST_CELLS = 12


def render_gap_page(
    diagnosis: Diagnosis,
    posterior: EffectPosterior | None,
    seed: int,
    versions: Mapping[str, str],
    inputs: Mapping[str, str],
) -> str:
    """The page as HTML. Equal arguments give equal text."""
    drawn = gap_figures(diagnosis)
    figures = {name: FigureBlock(figure.to_svg(f"gap-{name}"), figure.caption) for name, figure in drawn.items()}
    sections = [
        Section("verdict", "What is found", _build_verdict(diagnosis)),
        Section("sweeps", "The gap in every sweep", [figures["overlay"]]),
        Section("where", "Where it lies", _build_where(diagnosis, figures)),
        Section("which", "Which effect", _build_which(diagnosis, posterior, figures)),
        Section("how-far", "How far it shrinks", _build_how_far(diagnosis)),
        Section("next", "What to test next", _build_next(diagnosis)),
        Section("basis", "What this rests on", _build_basis(diagnosis)),
    ]
    return render_page(f"Gap diagnosis: {diagnosis.mode.name}", sections, Footer(seed, versions, inputs))


def _build_verdict(diagnosis: Diagnosis) -> list[Block]:
    gap, held = diagnosis.gap, diagnosis.held_out
    facts = [
        (number(gap.nominal), "gap as given (sigma; 1 is noise)"),
        (number(gap.before), "refitted within tolerance"),
        (number(gap.after), "with the explanation"),
        (_describe_percent(held.shrinkage if held else None), "of the gap vanishes on held-out levels"),
    ]
    blocks: list[Block] = [Text(describe_verdict(diagnosis), lead=True), Facts(facts)]
    points = [describe_place(diagnosis), *describe_doubts(diagnosis)]
    points += describe_trends(diagnosis)
    blocks.append(List([*points, describe_reach(diagnosis), describe_following(diagnosis)]))
    if diagnosis.cautions:
        blocks.append(Callout("Cautions", diagnosis.cautions))
    return blocks


def _build_where(diagnosis: Diagnosis, figures: Mapping[str, FigureBlock]) -> list[Block]:
    blocks: list[Block] = [figures[name] for name in ("residuals", "footprint", "local") if name in figures]
    cells = pd.DataFrame([asdict(cell) for cell in diagnosis.where[:_MOST_CELLS]])
    blocks.append(Table(cells, "Cells with the largest share of the squared residual of the simulation as given"))
    if diagnosis.footprint:
        marks = pd.DataFrame([asdict(cell) for cell in diagnosis.footprint[:_MOST_CELLS]])
        blocks.append(Table(marks, "Where the explanation changes the prediction by more than one sigma"))
    return blocks


def _build_which(
    diagnosis: Diagnosis, posterior: EffectPosterior | None, figures: Mapping[str, FigureBlock]
) -> list[Block]:
    blocks: list[Block] = [figures["probabilities"]] if "probabilities" in figures else []
    rows = [
        {"explanation": " + ".join(hypothesis.effects) or "no effect", "probability": hypothesis.probability}
        | {"log_evidence": hypothesis.hypothesis.log_evidence}
        for hypothesis in diagnosis.hypotheses
    ]
    blocks.append(
        Fold(
            "Every explanation that was fitted",
            [Table(pd.DataFrame(rows), "Most probable first", {"probability": format_share})],
        )
    )
    blocks.append(
        Table(_tabulate_parameters(diagnosis), "Parameters of the leading explanation at their most probable values")
    )
    if posterior is not None:
        blocks.append(Table(_tabulate_posterior(posterior), "Posterior of these parameters (emcee)"))
        if not posterior.chains.converged:
            blocks.append(Callout("The chains have not settled", [posterior.chains.failure]))
    tests = pd.DataFrame([asdict(test) for test in diagnosis.tests])
    blocks.append(
        Table(tests, "Is more than noise left? Directed tests of the residuals", headings={"gain": "chi-square"})
    )
    return blocks


def _tabulate_parameters(diagnosis: Diagnosis) -> pd.DataFrame:
    leading = diagnosis.leading.best
    rows = [
        {"of": effect, "parameter": name, "value": value}
        for effect, values in effect_values(leading).items()
        for name, value in values.items()
    ]
    corrections = refitted_values(leading).items()
    rows += [{"of": "simulation", "parameter": f"{name}, relative", "value": value} for name, value in corrections]
    return pd.DataFrame(rows, columns=["of", "parameter", "value"])


def _tabulate_posterior(posterior: EffectPosterior) -> pd.DataFrame:
    low, median, high = pd.DataFrame(posterior.draws).quantile([0.05, 0.5, 0.95]).to_numpy()
    return pd.DataFrame({"parameter": posterior.names, "5 %": low, "median": median, "95 %": high})


def _build_how_far(diagnosis: Diagnosis) -> list[Block]:
    held = diagnosis.held_out
    blocks: list[Block] = [Text(describe_reach(diagnosis))]
    if held is not None:
        rows = [
            {
                "held out": ", ".join(fold.sweeps),
                "chosen without it": " + ".join(fold.effects) or "no effect",
                "nominal": (fold.nominal / fold.count) ** 0.5,
                "before": (fold.before / fold.count) ** 0.5,
                "after": (fold.after / fold.count) ** 0.5,
            }
            for fold in held.folds
        ]
        blocks.append(Table(pd.DataFrame(rows), "Root mean square residual of each level held out, in sigma"))
    inside = (
        f"On the data that fitted it, the explanation closes {_describe_percent(diagnosis.gap.shrinkage)} of the gap."
    )
    return [*blocks, Text(inside)]


def _build_next(diagnosis: Diagnosis) -> list[Block]:
    blocks: list[Block] = [Text(describe_following(diagnosis))]
    if diagnosis.next_tests:
        table = pd.DataFrame([asdict(test) for test in diagnosis.next_tests])
        blocks.append(Table(table, "Candidate tests, simulated for the explanations that are alive"))
    return blocks


def _build_basis(diagnosis: Diagnosis) -> list[Block]:
    scatter = diagnosis.leading.best.model.scatter
    rows = diagnosis.leading.best.model.problem.rows
    stated = "stated" if diagnosis.setting.scatter is not None else "estimated"
    sd_amplitude, sd_phase = float(np.median(rows.sd_amplitude)), float(np.median(rows.sd_phase))
    noise = "stated" if diagnosis.setting.noise_known else "estimated from the roughness along the sweeps"
    return [
        List(
            [
                f"Record {diagnosis.record.source}, model {diagnosis.mode.source}; {diagnosis.mode.units}.",
                f"{len(rows)} rows in {len(rows.sweeps)} sweeps on {rows.levels} force levels, "
                + ("with phase." if rows.has_phase else "without phase."),
                f"Noise ({noise}): median {format_percent(100.0 * sd_amplitude)} % of amplitude"
                + (f", {number(sd_phase, 2)} rad of phase." if rows.has_phase else "."),
                f"Repeatability from sweep to sweep ({stated}): gain {format_percent(100.0 * scatter.amplitude)} %, "
                f"frequency {format_percent(100.0 * scatter.frequency)} %.",
            ]
        )
    ]


def _describe_percent(value: float | None) -> str:
    return NOTHING if value is None else f"{format_percent(100.0 * value)} %"
