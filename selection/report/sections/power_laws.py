"""Force against resonant amplitude on logarithmic axes: the exponent of a power law."""

from __future__ import annotations

import pandas as pd

from selection.report.page import Block, Section, Table, Text
from selection.report.results import RecordResult, StudyResult
from selection.report.sections.common import Svgs, figure, file_stem
from selection.report.tables import INTERVAL, power_laws_table
from selection.report.words import between, number


def power_law_section(study: StudyResult, svgs: Svgs) -> list[Section]:
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
        *figure(
            svgs,
            "force-amplitude",
            "Modal force against resonant amplitude with the fitted line, its t interval, and linear damping "
            "through the largest level. With three points there is one degree of freedom and the interval is wide.",
        ),
        *(_table(result) for result in fitted),
    ]
    return [Section("power-laws", "Force against amplitude", blocks)]


def _table(result: RecordResult) -> Table:
    rows = power_laws_table(result)
    alphas = [column for column in rows.columns if str(column).startswith("alpha_")]
    units = result.mode.units
    spoken = pd.DataFrame(
        {
            "form": rows["form"],
            "p": rows["p"],
            "std_error": rows["std_error"],
            "freedom": rows["degrees_of_freedom"],
            "interval": [between(a, b) for a, b in zip(rows["p_low"], rows["p_high"], strict=True)],
            "posterior": [
                f"{number(m)} ({between(a, b)})"
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
    return Table(spoken, caption, formats, headings, key=file_stem(result, "power_laws"))
