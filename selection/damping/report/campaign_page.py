"""The page of a campaign: modes, their damping against level, and the response of every sensor at the design level."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from damping.campaign.answer import Campaign, ModeAnswer
from damping.plots import to_svg
from damping.plots.curves import mode_over_level
from damping.report.page import Block, FigureBlock, Footer, List, Section, Table, Text, render_page


def render_campaign_page(
    campaign: Campaign, title: str, seed: int, versions: Mapping[str, str], inputs: Mapping[str, str]
) -> str:
    """The page as HTML."""
    sections = [
        _build_overview(campaign),
        *_build_outcomes(campaign),
        *(_build_mode(mode, campaign) for mode in campaign.modes),
        _build_understood(campaign),
    ]
    return render_page(title, sections, Footer(seed, versions, inputs))


def _build_overview(campaign: Campaign) -> Section:
    rows = []
    for mode in campaign.modes:
        lowest, top = mode.places[0], mode.places[-1]
        rows.append(
            {
                "mode": mode.name,
                "frequency, Hz": mode.frequency,
                "damping ratio at the lowest level, %": _describe_percent(lowest.ratio),
                f"at {top.level:.4g} {campaign.unit}, %": _describe_percent(top.ratio),
                "law": mode.law,
                "sensors left out": ", ".join(mode.left_out) or "none",
            }
        )
    summary = f"{len(campaign.modes)} modes at {len(campaign.levels)} levels."
    return Section("modes", "Modes", [Text(summary, lead=True), Table(pd.DataFrame(rows), "Modes of the campaign.")])


def _build_outcomes(campaign: Campaign) -> list[Section]:
    """What was predicted before the last runs, beside what they gave."""
    if not campaign.outcomes:
        return []
    rows = [
        {
            "mode": outcome.mode,
            "sensor": outcome.sensor,
            f"input, {campaign.unit}": outcome.level,
            "measured": outcome.measured,
        }
        | dict(zip(("predicted", "low", "high"), outcome.predicted, strict=True))
        | {
            "unit": outcome.unit,
            "above, dB": f"{outcome.above_db:+.1f}",
            "in the band": "yes" if outcome.held else "no",
        }
        for outcome in campaign.outcomes
    ]
    held = sum(outcome.held for outcome in campaign.outcomes)
    summary = f"{held} of {len(rows)} peaks lie in the 90 % band that was predicted before the run."
    table = Table(pd.DataFrame(rows), "Peaks measured beside those predicted before the run.")
    return [Section("outcomes", "Predicted and measured", [Text(summary, lead=True), table])]


def _describe_percent(band: tuple[float, float, float] | None) -> str:
    return f"{100 * band[0]:.3g} ({100 * band[1]:.3g} to {100 * band[2]:.3g})" if band else "no answer"


def _build_mode(mode: ModeAnswer, campaign: Campaign) -> Section:
    levels = pd.DataFrame(
        [
            {"level": at.level, "tested": at.tested, "frequency": at.frequency}
            | dict(zip(("median", "low", "high"), at.ratio, strict=True))
            for at in sorted(mode.places, key=lambda at: at.level)
            if at.ratio
        ]
    )
    blocks: list[Block] = [Text(f"{mode.frequency:.4g} Hz. Law with the largest weight: {mode.law}.", lead=True)]
    if len(levels) > 1:
        words = f"Damping ratio and frequency of {mode.name} against the level in {campaign.unit}."
        svg = to_svg(mode_over_level(levels, campaign.unit), f"{mode.name}-levels", mode.name, words)
        blocks.append(FigureBlock(svg, words))
    for at in (at for at in mode.places if not at.tested):
        rows = [(peak.sensor, *peak.band, peak.unit) for peak in at.response]
        peaks = pd.DataFrame(rows, columns=["sensor", "median", "low", "high", "unit"])
        caption = f"Peak of {mode.name} at each sensor at {at.level:.4g} {campaign.unit}; 90 % bands."
        blocks.append(Table(peaks, caption))
        blocks.append(List([*at.cautions, *(f"{name}: {why}" for name, why in mode.left_out.items())]))
    return Section(mode.name, mode.name, blocks)


def _build_understood(campaign: Campaign) -> Section:
    table = campaign.summary.table
    blocks: list[Block] = [Table(table, "What was understood of the files.")]
    if campaign.summary.notes:
        blocks.append(List(campaign.summary.notes))
    return Section("files", "Files", blocks)
