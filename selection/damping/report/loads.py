"""Design loads: resonant amplitude beyond the test, with bands, the linear prediction, and every model's own.

Force against resonant amplitude on logarithmic axes: the exponent of a power law.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from damping.extrapolation.prediction import Loads
from damping.report.answer import build_bands_figure, describe_bands_caption
from damping.report.page import Block, Format, Heading, List, Section, Table, Text
from damping.report.results import RecordResult, StudyResult, Svgs, build_figure, describe_file_stem
from damping.report.tables import INTERVAL, tabulate_loads, tabulate_power_laws
from damping.report.words import format_between, format_force_text, format_percent, format_share, format_signed, number


def build_loads(study: StudyResult, svgs: Svgs) -> list[Section]:
    """The section; none where the study asks for no design loads."""
    asked = [result for result in study.records if result.design is not None]
    if not asked:
        return []
    blocks: list[Block] = [
        Text(
            "Resonant amplitude is the amplitude at phase resonance under the force given. Median and bands are "
            "averaged over the models; linear takes the viscous coefficient of the sweep with the largest tested "
            "force. The weights here are not those of the ranking: they come from how well each law, fitted to the "
            "levels below, predicts a level that it has not seen, and are drawn towards equal weights while fewer than "
            "four levels can be held out."
        )
    ]
    first = next((r for r in asked if describe_file_stem(r, "design_loads") in svgs), None)
    for result in asked:
        assert result.design is not None  # chosen so above
        blocks.append(Heading(result.title))
        if result is first:
            blocks.append(Text("The figure stands with the answer, at the top."))
        else:
            blocks += build_bands_figure(result, svgs, describe_bands_caption(result))
        blocks += [
            _build_predictions(result, result.design),
            _build_by_model(result, result.design),
            _build_parts(result, result.design),
            *_build_cautions(result.design),
        ]
    return [Section("loads", "Design loads", blocks)]


def _build_predictions(result: RecordResult, design: Loads) -> Table:
    table, shared = tabulate_loads(design), _list_shared(design)
    spoken = pd.DataFrame(
        {
            "force": table["force"],
            "times tested": table["extrapolation_ratio"],
            "median": table["median"],
            "predictive": [format_between(a, b) for a, b in zip(table["low"], table["high"], strict=True)],
            "credible": [
                format_between(a, b) for a, b in zip(table["credible_low"], table["credible_high"], strict=True)
            ],
            "linear": table["linear"],
            "over": table["overprediction"],
            "over_interval": [
                f"{format_signed(a)} to {format_signed(b)}"
                for a, b in zip(table["overprediction_low"], table["overprediction_high"], strict=True)
            ],
            "caution": ["; ".join(c for c in said if c not in shared) for said in design.cautions],
        }
    )
    level = f"{100 * design.level:g} %"
    headings = {
        "force": _describe_headed("force", result.mode.units.force),
        "median": _describe_headed("median", result.mode.units.length),
        "predictive": f"{level} predictive",
        "credible": f"{level} credible",
        "linear": _describe_headed("linear", result.mode.units.length),
        "over": "linear over median",
        "over_interval": f"its {level} interval",
    }
    formats: dict[str, Format] = dict.fromkeys(("times tested", "median", "linear"), number)
    formats |= {"force": lambda force: f"{force:.6g}", "over": format_signed}
    caption = (
        "Resonant amplitude at the design forces; the last columns say by how much the linear prediction exceeds it."
    )
    return Table(spoken, caption, formats, headings, key=describe_file_stem(result, "design_loads"))


def _describe_headed(what: str, unit: str) -> str:
    return f"{what} ({unit})" if unit else what


def _build_by_model(result: RecordResult, design: Loads) -> Table:
    """A row a model, a column a force: median and predictive interval."""
    unit = result.mode.units.force
    columns: dict[str, list[str]] = {
        "model": [band.name for band in design.by_model],
        "weight": [format_share(band.weight) for band in design.by_model],
    }
    for i, force in enumerate(design.force):
        columns[f"at {format_force_text(force, unit)}"] = [
            f"{number(band.median[i])} ({format_between(band.low[i], band.high[i])})" for band in design.by_model
        ]
    caption = f"Each model's own median, and its {100 * design.level:g} % predictive interval in parentheses."
    return Table(pd.DataFrame(columns), caption, key=describe_file_stem(result, "design_loads_by_model"))


def _build_parts(result: RecordResult, design: Loads) -> Table:
    """What the predictive band is made of, in per cent of amplitude."""
    table = pd.DataFrame({"force": design.force, **design.parts})
    table["together"] = np.sqrt(np.sum([values**2 for values in design.parts.values()], axis=0))
    headings = {"force": _describe_headed("force", result.mode.units.force)}
    formats: dict[str, Format] = dict.fromkeys((*design.parts, "together"), format_percent)
    caption = (
        "What the predictive band is made of: standard deviation of each part, per cent of amplitude; squares add. "
        "With one row a level, noise and scatter from level to level cannot be told apart and stand under noise."
    )
    return Table(table, caption, formats | {"force": lambda force: f"{force:.6g}"}, headings)


def _list_shared(design: Loads) -> list[str]:
    """Cautions that hold at every design force."""
    return [c for c in design.cautions[0] if all(c in others for others in design.cautions)] if design.cautions else []


def _build_cautions(design: Loads) -> list[Block]:
    """What to know before using any of the predictions."""
    shared = [f"{_describe_capital(caution)}." for caution in _list_shared(design)]
    dash = [] if np.isfinite(design.average.median).all() else ["A dash stands where no prediction is given."]
    return [List([*shared, *dash])] if shared or dash else []


def _describe_capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def build_power_law_section(study: StudyResult, svgs: Svgs) -> list[Section]:
    """The section; none where no record has two levels."""
    fitted = [result for result in study.records if result.power_laws]
    if not fitted:
        return []
    blocks: list[Block] = [
        Text(
            "If damping is a power law, force and resonant amplitude lie on a straight line on logarithmic axes, "
            "and its slope is the exponent of velocity p for α|q̇|ᵖ sgn q̇, or p + 1 for α|q||q̇|ᵖ sgn q̇. Slope 1 "
            "is linear damping."
        ),
        *build_figure(
            svgs,
            "force-amplitude",
            "Modal force against resonant amplitude with the fitted line, its t interval, and linear damping "
            "through the largest level. With three points there is one degree of freedom and the interval is wide.",
        ),
        *(_build_table(result) for result in fitted),
    ]
    return [Section("power-laws", "Force against amplitude", blocks)]


def _build_table(result: RecordResult) -> Table:
    rows = tabulate_power_laws(result)
    alphas = [column for column in rows.columns if str(column).startswith("alpha_")]
    units = result.mode.units
    spoken = pd.DataFrame(
        {
            "form": rows["form"],
            "p": rows["p"],
            "std_error": rows["std_error"],
            "freedom": rows["degrees_of_freedom"],
            "interval": [format_between(a, b) for a, b in zip(rows["p_low"], rows["p_high"], strict=True)],
            "posterior": [
                f"{number(m)} ({format_between(a, b)})"
                for m, a, b in rows[["posterior_p", "posterior_p_low", "posterior_p_high"]].itertuples(index=False)
            ],
            "factor": rows["factor"],
            "alpha": rows["alpha"],
            **{name: rows[name] for name in alphas},
        }
    )
    headings = {
        "freedom": "degrees of freedom",
        "interval": f"{100 * result.power_laws[0].level:g} % t interval",
        "posterior": f"posterior p ({100 * INTERVAL:g} %)",
        "factor": "β or B",
        "alpha": "α",
        **{name: f"α, sweep {str(name).removeprefix('alpha_')}" for name in alphas},
    }
    caption = (
        f"{result.title}: exponent and coefficient of both power laws ({units}). α = β F/(ω A)ᵖ or B F/(ωᵖ Aᵖ⁺¹), a "
        "constant over the sweeps where the law holds."
    )
    formats = dict.fromkeys(("p", "std_error", "factor", "alpha", *alphas), number)
    return Table(spoken, caption, formats, headings, key=describe_file_stem(result, "power_laws"))
