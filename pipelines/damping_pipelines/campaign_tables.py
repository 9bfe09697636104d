"""Tables of the page of a campaign: modes, damping and peaks by level, notches, outcomes and cautions."""

from functools import partial

import pandas as pd

from damping.campaign.answer import Campaign, ModeAnswer
from damping.campaign.values import At
from damping_pipelines.terminal import number_whole, number_with_error


def tabulate_damping(mode: ModeAnswer, unit: str) -> pd.DataFrame:
    """Frequency and damping ratio at every tested and design level, with standard errors where they are known."""
    return pd.DataFrame(
        {
            "level": describe_level(at, unit),
            "frequency, Hz": describe_frequency(at),
            "damping ratio, %": number_with_error(100.0 * at.ratio[0], 100.0 * (at.ratio_error or 0.0))
            if at.ratio
            else "no answer",
        }
        for at in mode.places
    )


def tabulate_peaks(mode: ModeAnswer, unit: str) -> pd.DataFrame:
    """The peak of every sensor at every tested and design level, with the input at the mode if it differs."""
    return pd.DataFrame(
        {
            "level": describe_level(at, unit),
            "kind": "measured" if at.tested else "predicted",
            "sensor": peak.sensor,
            **dict(zip(("median", "low", "high"), peak.band, strict=True)),
            "unit": peak.unit,
        }
        for at in mode.places
        for peak in at.response
    )


def group_cautions(mode: ModeAnswer, unit: str) -> list[str]:
    """Each caution of a mode once, with its levels unless it applies to all."""
    levels: dict[str, list[str]] = {}
    for at in mode.places:
        for caution in dict.fromkeys(at.cautions):
            levels.setdefault(caution, []).append(f"{at.level:.4g} {unit}".rstrip())
    everywhere = len(mode.places)
    return [caution if len(at) == everywhere else f"at {', '.join(at)}: {caution}" for caution, at in levels.items()]


def tabulate_notches(answer: Campaign) -> pd.DataFrame:
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
    """Every mode with its damping at the lowest and at the last level."""
    return pd.DataFrame(
        {
            "mode": mode.name,
            "frequency, Hz": mode.frequency,
            "damping ratio at the lowest level, %": describe_ratio(mode.places[0], answer.unit),
            "damping ratio at the last design level, %": describe_ratio(mode.places[-1], answer.unit),
            "law": mode.law,
            "sensors left out": ", ".join(mode.left_out) or "none",
        }
        for mode in answer.modes
    )


def tabulate_outcomes(answer: Campaign) -> pd.DataFrame:
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


def describe_ratio(at: At, unit: str) -> str:
    """A damping ratio in per cent with its level, which may differ between modes, and with the notched input."""
    ratio = [number_whole(100.0 * part, 3, "#") for part in at.ratio or ()]
    band = "{} ({} to {})".format(*ratio) if ratio else "no answer"
    return f"{band} at {describe_level(at, unit)}"


#: A frequency in five digits: a resonance moves little from level to level.
format_hertz = partial(number_whole, digits=5, mark="#")


def describe_frequency(at: At) -> str:
    """A frequency in Hz with its standard error where that is known, the same on the page and on the terminal."""
    return number_with_error(at.frequency, at.frequency_error) if at.frequency_error else format_hertz(at.frequency)


def describe_level(at: At, unit: str) -> str:
    """A level with its unit, and the notched input at the mode if that differs."""
    notched = "" if at.reached is None else f", notched: {at.reached:.3g} {unit} at the mode"
    return f"{at.level:.4g} {unit}{notched}"
