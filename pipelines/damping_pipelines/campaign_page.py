"""The page of a campaign: the answer, its modes, damping and peaks by level, notches, outcomes, and the files."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from damping import report as words
from damping.campaign.answer import Campaign, ModeAnswer
from damping.campaign.values import At, Response
from damping.extrapolation.cautions import REFUSAL
from damping.plots import describe_with_unit, to_svg
from damping.plots.curves import mode_over_level
from damping.report.page import Block, FigureBlock, Section, Table, write_sections
from damping.report.results import collect_holders, keep_gravest
from damping_pipelines.terminal import number_whole, number_with_error

_CAUTION = "caution: "  #: beginning of a note that casts doubt
_LOST = "the mode near "  #: beginning of a note on a mode without an answer
_CHANGES = {1: "grows in", -1: "falls in", 0: "stays within its band in"}  #: how damping changes with the level


def write_page(answer: Campaign) -> list[Section]:
    """Write the page: the answer, damping of modes against level, and the response of every sensor at all levels."""
    parts: dict[str, Block] = {
        "modes": Table(tabulate_modes(answer), {"frequency, Hz": _format_hertz}),
        "limits": Table(_tabulate_notches(answer)),
        "outcomes": Table(_tabulate_outcomes(answer)),
        "files": Table(answer.summary.table),
    }
    for mode in answer.modes:
        parts |= _draw_levels(mode, answer.input_name, answer.unit)
        parts[f"{mode.name} damping"] = Table(tabulate_damping(mode, answer.unit))
        parts[f"{mode.name} peaks"] = Table(_tabulate_peaks(mode, answer.unit))
    cautions = {mode.name: _group_cautions(mode, answer.unit) for mode in answer.modes}
    values = vars(answer) | {
        **describe_answer(answer),
        "cautions": cautions,
        "tested": answer.tested,
        "hertz": _format_hertz,
    }
    return write_sections(Path(__file__).with_suffix(".txt"), values, parts)


def _draw_levels(mode: ModeAnswer, input_name: str, unit: str) -> dict[str, Block]:
    """The figure of a mode by its name; none if only one level has a result."""
    levels = pd.DataFrame(
        {"level": at.input, "tested": at.tested, "frequency": at.frequency} | at.ratio._asdict()
        for at in sorted(mode.places, key=lambda at: at.input)
        if at.ratio
    )
    if len(levels) < 2:
        return {}
    caption = f"Damping ratio and frequency of {mode.name} against the {input_name} in {unit}."
    figure = mode_over_level(levels, describe_with_unit(input_name, unit))
    return {mode.name: FigureBlock(to_svg(figure, f"{mode.name}-levels", mode.name, caption), caption)}


def describe_answer(answer: Campaign) -> dict[str, Any]:
    """Values of the sentences that open the page, by name.

    ``largest``: the largest response in each unit at the design levels, or at the tested ones if none is predicted.
    ``least``: the least damping there instead, for free decays, whose level is the response. ``beyond``: largest
    design level over the largest tested one. ``doubts``: cautions on the files; ``gravest``: on modes, with names.
    """
    modes = answer.modes
    known = [(mode, at) for mode in modes for at in mode.places if at.ratio]
    asked = [(mode, at) for mode, at in known if not at.tested]
    shown = asked or known
    peaks = [(*own, peak) for own in shown for peak in own[1].response] if answer.is_driven else []
    units = dict.fromkeys(peak.unit for _, _, peak in peaks)
    largest = [max((own for own in peaks if own[2].unit == unit), key=lambda own: own[2].band.median) for unit in units]
    least = min(shown, key=lambda own: own[1].ratio or (), default=None)
    tops = {mode.name: max((at.input for at in mode.places if at.tested), default=math.nan) for mode in modes}
    return {
        "predicted": bool(asked),
        "largest": [_describe_place(mode, at, answer.unit) | _describe_peak(peak) for mode, at, peak in largest],
        "least": _describe_place(*least, answer.unit) if least and not largest else None,
        "trends": _list_trends(modes),
        "beyond": max((at.input / tops[mode.name] for mode, at in asked), default=math.nan),
        "doubts": _list_doubts(answer),
        "gravest": collect_holders((mode.name, keep_gravest(_list_cautions(mode))) for mode in modes),
    }


def _describe_place(mode: ModeAnswer, at: At, unit: str) -> dict[str, str]:
    ratio, low, high = at.ratio or (math.nan,) * 3
    return {
        "mode": mode.name,
        "level": describe_level(at, unit),
        "frequency": words.format_quantity(at.frequency, "Hz"),
        "ratio": words.format_percent_ratio(ratio),
        "low": words.format_percent_ratio(low),
        "between": words.format_between(100.0 * low, 100.0 * high, "%"),
    }


def _describe_peak(peak: Response) -> dict[str, str]:
    median, low, high = peak.band
    band = words.format_between(low, high, peak.unit)
    return {"sensor": peak.sensor, "peak": words.format_quantity(median, peak.unit), "band": band}


def _list_trends(modes: Sequence[ModeAnswer]) -> list[str]:
    """In which modes damping grows or falls from the lowest to the highest tested level: their bands are apart."""
    named: dict[int, list[str]] = {}
    for mode in modes:
        places = sorted((at for at in mode.places if at.tested), key=lambda at: at.input)
        tested = [at.ratio for at in places if at.ratio]
        if len(tested) < 2:
            continue
        first, last = tested[0], tested[-1]
        change = int(last.low > first.high) - int(last.high < first.low)
        by = f" (by {words.format_percent(100.0 * abs(last.median / first.median - 1.0))} %)" if change else ""
        named.setdefault(change, []).append(f"{mode.name}{by}")
    return [f"{verb} {words.format_joined(named[change])}" for change, verb in _CHANGES.items() if change in named]


def _list_doubts(answer: Campaign) -> list[str]:
    """Cautions on the files, without those on one mode."""
    cautions = [note.removeprefix(_CAUTION) for note in answer.summary.notes if note.startswith((_CAUTION, _LOST))]
    return [text for text in cautions if not text.startswith(tuple(f"{mode.name}: " for mode in answer.modes))]


def _list_cautions(mode: ModeAnswer) -> list[str]:
    """Cautions of a mode, the gravest first.

    No prediction, sensors left out, the test, its shape, the prediction, single runs.
    """
    tested, asked = ([at for at in mode.places if at.tested is which][-1:] for which in (True, False))
    of_test, of_prediction = ([text for at in places for text in at.cautions] for places in (tested, asked))
    left_out = [f"{name} is left out: {why}" for name, why in mode.left_out.items()]
    texts = [*left_out, *map(str, mode.findings), *of_test, *filter(None, [mode.shape_caution]), *of_prediction]
    whole = [text for text in texts if not any(text in other and text != other for other in texts)]
    sweeps = map(str, mode.record.frame["sweep"].unique())  # of a decay: its run and a number
    runs = tuple(f"{name.rpartition(' ')[0] or name}: " for name in sweeps)
    return sorted(whole, key=lambda text: text.startswith(runs) - text.startswith(REFUSAL))


def tabulate_damping(mode: ModeAnswer, unit: str) -> pd.DataFrame:
    """Frequency and damping ratio at every tested and design level, with standard errors where they are known."""
    return pd.DataFrame(
        {
            "level": describe_level(at, unit),
            "kind": _describe_kind(at),
            "frequency, Hz": describe_frequency(at),
            "damping ratio, %": number_with_error(100.0 * at.ratio.median, 100.0 * (at.ratio_error or 0.0))
            if at.ratio
            else "no answer",
        }
        for at in mode.places
    )


def _tabulate_peaks(mode: ModeAnswer, unit: str) -> pd.DataFrame:
    """The peak of every sensor at every tested and design level, with the input at the mode if it differs."""
    return pd.DataFrame(
        {
            "level": describe_level(at, unit),
            "kind": _describe_kind(at),
            "sensor": peak.sensor,
            **peak.band._asdict(),
            "unit": peak.unit,
        }
        for at in mode.places
        for peak in at.response
    )


def _group_cautions(mode: ModeAnswer, unit: str) -> list[str]:
    """Each caution of a mode once, with its levels unless it applies to all."""
    held = collect_holders((f"{at.level:.4g} {unit}".rstrip(), at.cautions) for at in mode.places)
    everywhere = len(mode.places)
    return [caution if len(at) == everywhere else f"at {', '.join(at)}: {caution}" for caution, at in held]


def _tabulate_notches(answer: Campaign) -> pd.DataFrame:
    """Notches that the limits of sensors require at each mode."""
    unit = answer.unit
    return pd.DataFrame(
        {
            "mode": notch.mode,
            "sensor": notch.sensor,
            "limit": f"{notch.limit:g} {notch.unit}",
            f"design level, {unit}": notch.design,
            f"largest input, {unit}": notch.level,
            "notch, dB": f"{notch.depth_db:.1f}" if notch.low else "none",
            "from, Hz": notch.low,
            "to, Hz": notch.high,
            f"top level tested at the mode, {unit}": notch.tested,
            "next level, dB above it at most": f"{notch.more_db:+z.1f}",
        }
        for mode in answer.modes
        for notch in mode.notches
    )


def tabulate_modes(answer: Campaign) -> pd.DataFrame:
    """Every mode with its damping at the lowest and at the last level, and the largest peak there."""
    left_out = any(mode.left_out for mode in answer.modes)
    return pd.DataFrame(
        {
            "mode": mode.name,
            "frequency, Hz": mode.frequency,
            "damping ratio at the lowest level, %": _describe_ratio(mode.places[0], answer.unit),
            "damping ratio at the last design level, %": _describe_ratio(mode.places[-1], answer.unit),
            **({"largest peak there": _describe_largest(mode.places[-1])} if answer.is_driven else {}),
            "law": mode.law,
            **({"sensors left out": ", ".join(mode.left_out) or "none"} if left_out else {}),
        }
        for mode in answer.modes
    )


def _tabulate_outcomes(answer: Campaign) -> pd.DataFrame:
    """Predictions made before the last runs, beside the measurements."""
    return pd.DataFrame(
        {
            "mode": outcome.mode,
            "sensor": outcome.sensor,
            f"input, {answer.unit}": outcome.level,
            "measured": outcome.measured,
            **dict(zip(("predicted", "low", "high"), outcome.predicted, strict=True)),
            "unit": outcome.unit,
            "above, dB": f"{outcome.above_db:+z.1f}",
            "in the band": "yes" if outcome.held else "no",
        }
        for outcome in answer.outcomes
    )


def _describe_kind(at: At) -> str:
    """Whether the numbers at a level are its own or those of the laws."""
    return "measured" if at.tested else "predicted"


def _describe_ratio(at: At, unit: str) -> str:
    """A damping ratio in per cent with its level, which may differ between modes, and with the notched input."""
    ratio = [number_whole(100.0 * part, 3, "#") for part in at.ratio or ()]
    band = "{} ({} to {})".format(*ratio) if ratio else "no answer"
    return f"{band} at {describe_level(at, unit)}"


def _describe_largest(at: At) -> str:
    """The largest peak at a place with its sensor."""
    return "{peak} ({band}) at {sensor}".format(**_describe_peak(at.largest)) if at.largest else "no answer"


#: A frequency in five digits: a resonance moves little from level to level.
_format_hertz = partial(number_whole, digits=5, mark="#")


def describe_frequency(at: At) -> str:
    """A frequency in Hz with its standard error where that is known, the same on the page and on the terminal."""
    return number_with_error(at.frequency, at.frequency_error) if at.frequency_error else _format_hertz(at.frequency)


def describe_level(at: At, unit: str) -> str:
    """A level with its unit, and the notched input at the mode if that differs."""
    notched = "" if at.reached is None else f", notched: {at.reached:.3g} {unit} at the mode"
    return f"{at.level:.4g} {unit}{notched}"
