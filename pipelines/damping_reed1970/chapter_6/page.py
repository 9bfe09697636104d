"""Chapter VI in the report: every damping force of section 6.1 beside ours, and whether it reproduces the tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from damping.plots.style import AVERAGE, INK, LINEAR, MUTED, WIDTH, draw_plain_rows, styled
from damping.report.page import Table
from damping.report.words import format_between, format_joined, format_percent, number
from damping_reed1970.chapter_6 import REPRODUCES, VERSIONS
from damping_reed1970.common import Chapter, ChapterFigure, ReportPart, write_chapter
from damping_reed1970.studies import ReportResults


def write_chapter_6(results: ReportResults) -> ReportPart:
    """The page: the summary of section 6.1."""
    laws, errors = results.tables["section_6_1"], results.tables["section_6_1_errors"]
    shown = {"laws": Table(tabulate_law_rows(laws), "", key="section_6_1")}
    title = "Chapter VI: the forces of section 6.1"
    chapter = Chapter(6, title, _count_laws(laws), [force_laws_figure(errors)], shown, {}, results.tables)
    return write_chapter(chapter, Path(__file__).with_suffix(".txt"))


def tabulate_law_rows(laws: pd.DataFrame) -> pd.DataFrame:
    """What the page shows of section 6.1: one row per law and parameter."""
    ours = [
        f"{number(value)} ({format_between(low, high)})"
        for value, low, high in laws[["ours", "low", "high"]].to_numpy(float)
    ]
    where = [f"{c}, mode {mode}" for c, mode in zip(laws["configuration"], laws["mode"], strict=True)]
    unit = ["exponent" if name == "exponent" else unit for name, unit in laws[["parameter", "unit"]].to_numpy()]
    reproduces = laws[[f"{version}_reproduces" for version in VERSIONS]].to_numpy(bool)
    return pd.DataFrame(
        {
            "configuration": where,
            "equation": laws["equation"],
            "force": laws["force"],
            "unit": unit,
            "printed": laws["printed"],
            "recomputed": laws["recomputed"],
            "ours": ours,
            "reproduces": [" / ".join("yes" if one else "no" for one in row) for row in reproduces],
            "erratum": laws["erratum"],
        }
    )


def _count_laws(laws: pd.DataFrame) -> dict[str, Any]:
    """How many laws reproduce the tested resonances, which printed ones do not, and which lie in our intervals."""
    each = laws.drop_duplicates(["configuration", "mode", "equation"])
    worst = each[~each["printed_reproduces"]].sort_values("printed_percent_resonance", ascending=False)
    viscous = each[each["law"] == "viscous"]
    levels = viscous[viscous["configuration"] == "II"]
    return {
        "laws": len(each),
        "reproduced": [int(each[f"{version}_reproduces"].sum()) for version in VERSIONS],
        "limit": f"{REPRODUCES:g}",
        "inside": int(laws["printed_in_interval"].sum()),
        "numbers": len(laws),
        "worst": format_joined(
            f"{row['equation']} (configuration {row['configuration']}, mode {row['mode']}: "
            f"{format_percent(row['printed_percent_resonance'])} per cent{_describe_known(row['erratum'])})"
            for row in worst.to_dict("records")
        ),
        "viscous": len(viscous),
        "viscous_failing": int((~viscous["printed_reproduces"]).sum()),
        "viscous_levels": len(levels),
        "viscous_ours": int(levels["ours_reproduces"].sum()),
    }


def _describe_known(erratum: str) -> str:
    return f", erratum {erratum}" if erratum else ""


def force_laws_figure(errors: pd.DataFrame) -> ChapterFigure:
    """The figure of the chapter with its words."""
    return ChapterFigure(
        "section-6-1", "", "Errors of the laws of section 6.1",
        "Per cent error of resonant amplitude at the tested forces of every law: printed, recomputed, ours.",
        lambda: force_laws(errors),
    )  # fmt: skip


@styled
def force_laws(errors: pd.DataFrame) -> Figure:
    """Draw the errors of resonant amplitude of every law of section 6.1: printed, recomputed and ours.

    Args:
        errors: ``configuration, mode, equation, version, quantity, percent_error``, rows of a law together.
    """
    amplitude = errors[errors["quantity"] == "resonant amplitude"]
    laws = list(amplitude[["configuration", "mode", "equation"]].drop_duplicates().itertuples(index=False, name=None))
    figure = Figure(figsize=(WIDTH, 0.9 + 0.25 * len(laws)))
    axes = figure.add_subplot()
    draw_plain_rows(axes, [f"{equation}  (configuration {c}, mode {m})" for c, m, equation in laws])
    styles = {"printed": (LINEAR, "x"), "recomputed": (MUTED, "o"), "ours": (AVERAGE, "D")}
    axes.axvspan(-5.0, 5.0, color="#eef1f4", zorder=0)
    axes.axvline(0.0, color=INK, linewidth=0.7)
    for shift, (version, (colour, marker)) in zip((-0.2, 0.0, 0.2), styles.items(), strict=True):
        for row, (c, m, equation) in enumerate(laws):
            mine = amplitude[
                (amplitude["configuration"] == c) & (amplitude["mode"] == m) & (amplitude["equation"] == equation)
                & (amplitude["version"] == version)
            ]  # fmt: skip
            label = version if row == 0 else None
            axes.plot(
                mine["percent_error"], [row + shift] * len(mine), marker, color=colour, markersize=4.5, label=label
            )
    axes.set_xlabel("error of resonant amplitude\nat the tested forces (per cent)")
    figure.legend(loc="outside upper right", ncols=3)
    return figure
