"""The page of a gap diagnosis, and what an engineer would say of it, sentence by sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping.effects import CATALOGUE
from damping.gap.corrected import EffectPosterior, effect_values, refitted_values
from damping.gap.diagnose import Diagnosis
from damping.gap.size import HeldOutFold
from damping.report import NOTHING, format_percent, format_share, number
from damping.report.gap_figures import NO_EFFECT, gap_figures
from damping.report.page import Block, Facts, FigureBlock, Footer, List, Table, Text, render_page, write_sections

#: Chi-square (2 degrees of freedom: power and size) above which a trend is spoken of: one in a thousand by chance.
TREND_SEEN = 13.8
_MOST_CELLS = 12


def describe_diagnosis(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """Sentences by what they are about.

    ``verdict`` (one: what it is, how sure, whether it is all), ``place`` (where most of the gap lies), ``doubts`` (what
    cannot be told apart), ``trends`` (of local damping and frequency with amplitude), ``reach`` (how far the gap
    shrinks where it did not choose the explanation), ``following`` (what to test next).
    """
    leading = diagnosis.hypotheses[0]
    trends = (("Damping", diagnosis.damping_trend), ("Natural frequency", diagnosis.frequency_trend))
    values = {
        "leading": leading,
        "effects": [f"{CATALOGUE[name].sentence} ({name})" if name in CATALOGUE else name for name in leading.effects],
        "gap": diagnosis.gap,
        "unexplained": diagnosis.unexplained,
        "in_library": diagnosis.in_library,
        "top": diagnosis.where[0],
        "groups": [(group, _list_of_rig(group.effects)) for group in diagnosis.groups],
        "trends": [(what, trend) for what, trend in trends if trend is not None],
        "trend_seen": TREND_SEEN,
        "held": diagnosis.held_out,
        "test": diagnosis.next_test,
    }
    sections = write_sections(Path(__file__).with_name("gap_words.txt"), values)
    return {section.id: [text for block in section.blocks for text in _list_sentences(block)] for section in sections}


def _list_of_rig(effects: tuple[str, ...]) -> list[str]:
    """Effects of the rig, where some of these are none."""
    rig = [name for name in effects if CATALOGUE[name].kind == "instrument"]
    return rig if len(rig) < len(effects) else []


def _list_sentences(block: Block) -> list[str]:
    return list(block.items) if isinstance(block, List) else [block.text] if isinstance(block, Text) else []


def render_gap_page(
    diagnosis: Diagnosis,
    posterior: EffectPosterior | None,
    seed: int,
    versions: Mapping[str, str],
    inputs: Mapping[str, str],
) -> str:
    """The page as HTML. Equal arguments give equal text."""
    model = diagnosis.leading.best.model
    rows = model.problem.rows
    values = {
        "told": describe_diagnosis(diagnosis),
        "cautions": diagnosis.cautions,
        "failure": posterior.chains.failure if posterior and not posterior.chains.converged else "",
        "closed": _describe_percent(diagnosis.gap.shrinkage),
        "record": diagnosis.record.source,
        "mode": diagnosis.mode,
        "rows": rows,
        "setting": diagnosis.setting,
        "sd_amplitude": np.median(rows.sd_amplitude),
        "sd_phase": np.median(rows.sd_phase),
        "scatter": model.scatter,
    }
    figures = {
        name: FigureBlock(figure.to_svg(f"gap-{name}"), figure.caption)
        for name, figure in gap_figures(diagnosis).items()
    }
    parts = {"facts": _collect_facts(diagnosis), **figures, **_build_tables(diagnosis, posterior)}
    sections = write_sections(Path(__file__).with_suffix(".txt"), values, parts)
    return render_page(f"Gap diagnosis: {diagnosis.mode.name}", sections, Footer(seed, versions, inputs))


def _collect_facts(diagnosis: Diagnosis) -> Facts:
    gap, held = diagnosis.gap, diagnosis.held_out
    return Facts(
        [
            (number(gap.nominal), "gap as given (sigma; 1 is noise)"),
            (number(gap.before), "refitted within tolerance"),
            (number(gap.after), "with the explanation"),
            (_describe_percent(held.shrinkage if held else None), "of the gap vanishes on held-out levels"),
        ]
    )


def _build_tables(diagnosis: Diagnosis, posterior: EffectPosterior | None) -> dict[str, Table]:
    """Tables by name; the text has their captions."""
    explanations = [
        {"explanation": " + ".join(h.effects) or NO_EFFECT, "probability": h.probability}
        | {"log_evidence": h.hypothesis.log_evidence}
        for h in diagnosis.hypotheses
    ]
    tables = {
        "cells": _tabulate(diagnosis.where[:_MOST_CELLS]),
        "explanations": Table(pd.DataFrame(explanations), "", {"probability": format_share}),
        "parameters": Table(_tabulate_parameters(diagnosis), ""),
        "tests": replace(_tabulate(diagnosis.tests), headings={"gain": "chi-square"}),
    }
    if diagnosis.footprint:
        tables["marks"] = _tabulate(diagnosis.footprint[:_MOST_CELLS])
    if posterior is not None:
        low, median, high = pd.DataFrame(posterior.draws).quantile([0.05, 0.5, 0.95]).to_numpy()
        interval = pd.DataFrame({"parameter": posterior.names, "5 %": low, "median": median, "95 %": high})
        tables["posterior"] = Table(interval, "")
    if diagnosis.held_out is not None:
        tables["levels"] = Table(_tabulate_folds(diagnosis.held_out.folds), "")
    if diagnosis.next_tests:
        tables["candidates"] = _tabulate(diagnosis.next_tests)
    return tables


def _tabulate(rows: Sequence[Any]) -> Table:
    return Table(pd.DataFrame([asdict(row) for row in rows]), "")


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


def _tabulate_folds(folds: Sequence[HeldOutFold]) -> pd.DataFrame:
    return pd.DataFrame(
        {"held out": ", ".join(fold.sweeps), "chosen without it": " + ".join(fold.effects) or NO_EFFECT}
        | {name: (getattr(fold, name) / fold.count) ** 0.5 for name in ("nominal", "before", "after")}
        for fold in folds
    )


def _describe_percent(value: float | None) -> str:
    return NOTHING if value is None else f"{format_percent(100.0 * value)} %"
