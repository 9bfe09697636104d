"""Chapter IV in the report: coefficient against amplitude (4.1), response curves and levels (4.2), power laws (4.3)."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.report import format_between, format_joined, number
from damping.report.page import Table
from damping_reed1970.chapter_4 import A_LINEAR_PRINTED, A_POWER_PRINTED, F_EXAMPLE, figures
from damping_reed1970.chapter_4.amplitude_frequency import PRINTED, AmplitudeFrequency, amplitude_frequency
from damping_reed1970.chapter_4.lines import IV, CoefficientModel, V
from damping_reed1970.common import ReportPart, chapter_table, row, write_chapter
from damping_reed1970.studies import ReportResults, Studies

Tables = Mapping[str, pd.DataFrame]
#: What is kept from level to level, in words.
HELD = {"xi": "damping factor ξ", "coefficient": "coefficient C"}
#: Studies of the chapter that are written whole.
_TABLES = (
    *("response_points", "response_widths", "level_coefficients", "level_variations", "level_predictions"),
    "chance_of_exponent",
)


def write_chapter_4(results: ReportResults) -> ReportPart:
    """The page: three ways from the resonances of three levels to a force, printed and recomputed."""
    studies, every, named = results.studies, results.studies.tables(), results.tables
    lines, variations = named["linear_coefficients"], every["level_variations"]
    symbols = {"parameter": "", "force_coefficient": "its coefficient", "printed_force": "printed"}
    shown = {
        "lines": Table(_tabulate_corrected(lines), "", headings=symbols, key="linear_coefficients"),
        "spreads": chapter_table(4, "level_variations", tabulate_spreads(variations)),
        "by_base": chapter_table(4, "level_variations", _tabulate_by_base(variations)),
        "predictions": chapter_table(4, "level_predictions", _tabulate_errors(every["level_predictions"])),
    }
    values = {
        "lines": [_describe_line(lines, IV, mode) for mode in (1, 2)],
        "line_squared": _describe_line(lines, V, 1),
        **_collect_response_values(every, studies.curves),
        **_collect_level_values(studies, variations),
        **_collect_power_values(named["power_laws"], every["chance_of_exponent"]),
        **_collect_example_values(named["section_4_3_example"]),
    }
    return write_chapter(
        4,
        "Chapter IV: force from level to level",
        Path(__file__).with_suffix(".txt"),
        named,
        values=values,
        figures=collect_figures(studies),
        shown=shown,
        tables={name: every[name] for name in _TABLES},
    )


def _tabulate_corrected(lines: pd.DataFrame) -> pd.DataFrame:
    """What the page shows of the linear coefficients."""
    columns = ["mode", "cases", "parameter", "coefficient", "std_error", "low", "high", "printed", "force"]
    shown = lines[lines["inputs"] == "corrected"][[*columns, "force_coefficient", "printed_force"]]
    return shown.assign(parameter=shown["parameter"].str.replace("C_01", "C₀₁").str.replace("C_11", "C₁₁"))


def _describe_line(lines: pd.DataFrame, model: CoefficientModel, mode: int) -> str:
    """The second coefficient of a model for a mode, with the force it stands for."""
    chosen = lines[(lines["model"] == model.name) & (lines["inputs"] == "corrected") & (lines["mode"] == mode)]
    constant, slope = chosen.iloc[0], chosen.iloc[1]
    power = "A" if model.power == 1 else "A²"
    text = (
        f"C₁ = {number(constant['coefficient'])} + {number(slope['coefficient'])} {power} for mode {mode} (slope "
        f"{format_between(slope['low'], slope['high'])}, 90 per cent)"
    )
    if pd.isna(slope["printed"]):
        return text
    return f"{text} against {number(constant['printed'])} + {number(slope['printed'])} {power} printed"


def _collect_response_values(every: Tables, curves: AmplitudeFrequency) -> dict[str, Any]:
    """What section 4.2 says of the curves."""
    points, widths = every["response_points"], every["response_widths"]
    wide = widths[widths["amplitude_over_resonant"] == 0.5]["width_eta_squared"]
    hertz = curves.omega_n / (2.0 * np.pi)
    return {
        **dict(zip(("delta", "distance", "half", "edge"), (points.iloc[i] for i in range(4)), strict=True)),
        "printed": PRINTED,
        "by_width": _describe_by_width(widths),
        "heavy": widths[widths["amplitude_over_resonant"] == 0.9]["percent_error_undamped"],
        "wide": wide,
        "hertz": hertz,
        "spread": 0.5 * hertz * (wide.max() - wide.min()),  # d(eta^2) = 2 d(eta) at resonance
    }


def _collect_level_values(studies: Studies, variations: pd.DataFrame) -> dict[str, Any]:
    """What the levels say, and what a reader should know of it."""
    cautions = dict.fromkeys(caution for level in studies.levels.values() for caution in level.cautions)
    return {
        "least": _describe_least(variations),
        "kept": list(studies.levels),
        "cautions": "; ".join(cautions).capitalize(),
    }


def _collect_power_values(laws: pd.DataFrame, chance: pd.DataFrame) -> dict[str, Any]:
    """Exponents of both modes, and how likely linear damping is to give them."""
    modes = {mode: row(laws, mode=mode, form="velocity-power", inputs="corrected") for mode in (1, 2)}
    return {
        "powers": [
            f"p = {number(law['p'], 4)} for mode {mode} ({format_between(law['p_low'], law['p_high'])}, 90 per cent, "
            f"1 degree of freedom; printed {law['p_printed']:g})"
            for mode, law in modes.items()
        ],
        "second": row(laws, mode=2, form="displacement-velocity-power", inputs="corrected"),
        "needed": [
            f"{number(percent, 2)} per cent (mode {mode})"
            for mode, percent in chance[["mode", "needed_percent"]].itertuples(index=False)
        ],
    }


def _collect_example_values(example: pd.DataFrame) -> dict[str, Any]:
    """The extrapolation to 90 lb, and what is left of the 67 per cent."""
    quantities = {
        "ratio": "force over largest tested",
        "own": "error of linear, p = 1.859",
        "refitted": "error of linear, p refitted",
        "whole": "error of linear, over all laws",
    }
    rows = {name: row(example, quantity=quantity) for name, quantity in quantities.items()}
    laws = {"refitted": "the refitted power law", "whole": "all laws by weight"}
    printed = rows["own"]["printed"]
    inside = [law for name, law in laws.items() if rows[name]["low"] <= printed <= rows[name]["high"]]
    return {**rows, "example_force": F_EXAMPLE, "inside": inside}


def tabulate_spreads(variations: pd.DataFrame) -> pd.DataFrame:
    """Spread of each case by mode and what is kept, one row per case."""
    once = variations.drop_duplicates(["mode", "kept", "case"])
    wide = once.pivot_table("spread_percent", "case", ["mode", "kept"], aggfunc="first")
    modes, kept = (wide.columns.get_level_values(level) for level in ("mode", "kept"))
    wide.columns = pd.Index([f"mode {mode}, {HELD[held]}" for mode, held in zip(modes, kept, strict=True)])
    return _tabulate_named(wide.sort_values(wide.columns[0]).reset_index())


def _describe_least(variations: pd.DataFrame) -> list[str]:
    """Which case varies least, among those of the report and among all."""
    lines = []
    for mode in (1, 2):
        for held, words in HELD.items():
            rows = variations[(variations["mode"] == mode) & (variations["kept"] == held)].drop_duplicates("case")
            plain = rows[~rows["free"] & (rows["case"] != "V, second term")]
            of_report, of_all = (min(r.to_dict("records"), key=_spread) for r in (plain, rows))
            lines.append(
                f"Mode {mode}, {words}: of the report's cases {_describe_case(of_report['case'])} "
                f"({number(of_report['spread_percent'], 2)} per cent), of all {_describe_case(of_all['case'])} "
                f"({number(of_all['spread_percent'], 2)} per cent)."
            )
    return lines


def _spread(row: dict[Hashable, Any]) -> float:
    """Spread of a row, the largest where there is none."""
    spread = float(row["spread_percent"])
    return spread if np.isfinite(spread) else np.inf


def _tabulate_by_base(variations: pd.DataFrame) -> pd.DataFrame:
    wide = variations.pivot_table("largest_percent", ["mode", "kept", "case"], "base", aggfunc="first")
    wide.columns = pd.Index([f"base {base}" for base in wide.columns])
    return _tabulate_named(wide.reset_index())


def _tabulate_errors(predictions: pd.DataFrame) -> pd.DataFrame:
    labelled = predictions.assign(
        pair=[f"{base} → {sweep}" for base, sweep in predictions[["base", "sweep"]].to_numpy()]
    )
    wide = labelled.pivot_table("percent_error", ["mode", "kept", "case"], "pair", aggfunc="first")
    return _tabulate_named(wide.reset_index().rename_axis(columns=None))


def _tabulate_named(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(case=[_describe_case(case) for case in frame["case"]])


def _describe_case(case: str) -> str:
    return str(case).replace("alpha", "α").replace("I + ", "I and ")


def collect_figures(studies: Studies) -> dict[str, Callable[[], Figure]]:
    """How each figure of the chapter is drawn, by name."""
    curves = studies.curves
    explained = amplitude_frequency(M=1.0, omega_n=1.0, F=0.05, A_m=1.0, alphas=())
    example = (F_EXAMPLE, A_LINEAR_PRINTED, A_POWER_PRINTED)
    return {
        "linear-coefficient": lambda: figures.draw_linear_coefficients(studies.lines),
        "response-explained": lambda: figures.draw_response_explained(explained),
        "response-curves": lambda: figures.draw_response_curves(curves),
        "phase-curves": lambda: figures.draw_phase_curves(curves),
        "response-differences": lambda: figures.draw_differences(curves, (PRINTED["A"], PRINTED["delta"])),
        "undamped-error": lambda: figures.draw_undamped_error(curves, (0.5, PRINTED["percent_at_half"])),
        "force-amplitude": lambda: figures.draw_force_amplitude(studies.force_lines, example),
        **{
            f"level-variation-mode-{mode}-{held}": partial(figures.draw_level_variation, level.variations, held)
            for (mode, held), level in studies.levels.items()
        },
    }


def _describe_by_width(widths: pd.DataFrame) -> str:
    """Cases by the width of their curves at half the resonant amplitude, with that width over the first one's."""
    half = widths[widths["amplitude_over_resonant"] == 0.5].sort_values("width_eta_squared")
    over = half["width_eta_squared"] / half["width_eta_squared"].iloc[0]
    return format_joined(f"{case.removeprefix('case ')} ({x:.2f})" for case, x in zip(half["case"], over, strict=True))
