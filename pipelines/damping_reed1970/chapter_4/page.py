"""Chapter IV in the report: coefficient against amplitude (4.1), response curves (4.2), power laws (4.3)."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from damping.report.page import Block, Heading, List, Table, Text
from damping.report.words import between, joined, number, percent
from damping_reed1970.chapter_4.amplitude_frequency import PRINTED, AmplitudeFrequency
from damping_reed1970.chapter_4.captions import chapter_4_figures
from damping_reed1970.chapter_4.coefficients import IV, CoefficientModel, V
from damping_reed1970.chapter_4.power_laws import F_EXAMPLE
from damping_reed1970.common import (
    KNOWN,
    Figures,
    ReportPart,
    agreement_text,
    figure,
    folded,
    known_table,
    of_chapter,
    part,
    row,
    table,
)
from damping_reed1970.studies import ReportResults, Studies

Tables = Mapping[str, pd.DataFrame]
LEVEL_TABLES = ("level_coefficients", "level_variations", "level_predictions")
_TABLES = ("response_points", "response_widths", *LEVEL_TABLES, "chance_of_exponent")


def chapter_4(results: ReportResults) -> ReportPart:
    """The part: three ways from the resonances of three levels to a force, printed and recomputed."""
    found, every, tables = results.studies, results.studies.tables(), results.tables
    drawn = chapter_4_figures(found.lines, found.curves, found.force_lines, found.levels)
    figures = {one.name: one for one in drawn}
    blocks: list[Block] = [
        Text(
            "Configuration II was swept at three force levels. Chapter IV draws a nonlinear damping force from the "
            "three resonances in three ways: from the growth of the linear coefficient with amplitude (4.1), from the "
            "shape of the response curve and the coefficient that stays the same from level to level (4.2), and from "
            "the slope of log force against log amplitude (4.3)."
        ),
        Text(agreement_text(of_chapter(tables["reproduction"], 4))),
        *_section_4_1(tables, figures),
        *_section_4_2(every, results.studies.curves, figures),
        *level_blocks(results.studies, figures),
        *_section_4_3(every, tables, figures),
    ]
    own = {name: every[name] for name in _TABLES}
    return part(4, "Chapter IV: force from level to level", blocks, own)


def _section_4_1(tables: Tables, figures: Figures) -> list[Block]:
    lines = tables["linear_coefficients"]
    return [
        Heading("4.1: linear coefficient against amplitude"),
        Text(
            "The report draws a line through C₁ = F/(ω A) of the three sweeps by the mean slope of its two segments "
            "and converts it to cases I and IV. Least squares on the corrected tables gives "
            + joined(_line(lines, IV, mode) for mode in (1, 2))
            + ". The intervals are wide because three points leave one degree of freedom."
        ),
        figure(figures, "linear-coefficient", 4),
        Text(
            f"With the square of amplitude, which is case V, {_line(lines, V, 1)}. The report's 0.5486 for both terms "
            "(4.2.11) is half of that: a factor 2 is lost between ξ and C₁ (erratum E4-1)."
        ),
        Table(_corrected(lines), _LINES, headings=_SYMBOLS, key="linear_coefficients"),
        folded(KNOWN["linear_coefficients"].title + ": everything", *known_table("linear_coefficients", lines)),
    ]


_LINES = (
    "Coefficients from the corrected tables with standard error and 90 per cent t interval, and the forces they stand "
    "for (lb, in, s)."
)
_SYMBOLS = {"parameter": "", "force_coefficient": "its coefficient", "printed_force": "printed"}


def _corrected(lines: pd.DataFrame) -> pd.DataFrame:
    """What the page shows of the linear coefficients."""
    columns = ["mode", "cases", "parameter", "coefficient", "std_error", "low", "high", "printed", "force"]
    shown = lines[lines["inputs"] == "corrected"][[*columns, "force_coefficient", "printed_force"]]
    return shown.assign(parameter=shown["parameter"].str.replace("C_01", "C₀₁").str.replace("C_11", "C₁₁"))


def _line(lines: pd.DataFrame, model: CoefficientModel, mode: int) -> str:
    """The second coefficient of a model for a mode, with the force it stands for."""
    chosen = lines[(lines["model"] == model.name) & (lines["inputs"] == "corrected") & (lines["mode"] == mode)]
    constant, slope = chosen.iloc[0], chosen.iloc[1]
    power = "A" if model.power == 1 else "A²"
    text = (
        f"C₁ = {number(constant['coefficient'])} + {number(slope['coefficient'])} {power} for mode {mode} (slope "
        f"{between(slope['low'], slope['high'])}, 90 per cent)"
    )
    if pd.isna(slope["printed"]):
        return text
    return f"{text} against {number(constant['printed'])} + {number(slope['printed'])} {power} printed"


def _section_4_2(every: Tables, curves: AmplitudeFrequency, figures: Figures) -> list[Block]:
    points, widths = every["response_points"], every["response_widths"]
    wide = widths[widths["amplitude_over_resonant"] == 0.5]["width_eta_squared"]
    hertz = curves.omega_n / (2.0 * np.pi)
    spread = 0.5 * hertz * (wide.max() - wide.min())  # d(eta^2) = 2 d(eta) at resonance
    delta, distance, half, edge = (points.iloc[i] for i in range(4))
    heavy = widths[widths["amplitude_over_resonant"] == 0.9]["percent_error_undamped"]
    return [
        Heading("4.2: response curves"),
        Text(
            "The Ritz-averaged steady state of each case is drawn with the one coefficient that gives the measured "
            f"resonance of sweep C, first mode. At A = {PRINTED['A']:g} inches the horizontal difference of case I "
            f"comes out as {number(delta['computed'], 4)} (printed {number(delta['printed'], 4)}) and the distance of "
            f"the undamped curve as {number(distance['computed'], 4)} (printed {number(distance['printed'], 4)}, "
            f"erratum {distance['erratum']}). Neglecting damping is wrong by {number(half['computed'])} per cent at "
            f"half the resonant amplitude (printed {number(half['printed'], 2)}), by {number(edge['computed'])} per "
            f"cent at η² = {PRINTED['eta_squared']:g}, and by {between(heavy.min(), heavy.max())} per cent, depending "
            "on the case, at nine tenths of it."
        ),
        *(
            figure(figures, name, 4)
            for name in (
                "response-explained",
                "response-curves",
                "phase-curves",
                "response-differences",
                "undamped-error",
            )
        ),
        Text(
            f"At half the resonant amplitude the curves of all cases are {between(wide.min(), wide.max())} wide in η²: "
            f"from the narrowest to the widest is {number(spread, 2)} Hz of {number(hertz)} Hz. So one curve hardly "
            "chooses between them, as the report found, and it turns to the three levels."
        ),
        folded(
            "Printed points of section 4.2, and widths of the curves",
            table(4, "response_points", points, "Section 4.2: printed and computed, G at the curve's own frequency."),
            table(
                4,
                "response_widths",
                widths,
                "Width in η² of each case at half and nine tenths of its resonant amplitude, and per cent error of the "
                "undamped curve there.",
            ),
        ),
    ]


def _section_4_3(every: Tables, tables: Tables, figures: Figures) -> list[Block]:
    return [
        Heading("4.3: power laws, and what becomes of 67 per cent"),
        Text(_powers(tables["power_laws"], every["chance_of_exponent"])),
        figure(figures, "force-amplitude", 4),
        Text(" ".join(_example(tables["section_4_3_example"]))),
        *known_table("section_4_3_example", tables["section_4_3_example"]),
        *known_table("power_laws", tables["power_laws"]),
        folded(
            "Could linear damping have given these exponents?",
            table(
                4,
                "chance_of_exponent",
                every["chance_of_exponent"],
                "Probability that linear damping gives an exponent as large, by scatter of the amplitude from level to "
                "level; needed_percent is the scatter at which it is 1 in 20.",
            ),
        ),
    ]


def _powers(laws: pd.DataFrame, chance: pd.DataFrame) -> str:
    """Exponents of both modes, and how likely linear damping is to give them."""
    said = []
    for mode in (1, 2):
        one = row(laws, mode=mode, form="velocity-power", inputs="corrected")
        said.append(
            f"p = {number(one['p'], 4)} for mode {mode} ({between(one['p_low'], one['p_high'])}, 90 per cent, 1 degree "
            f"of freedom; printed {one['p_printed']:g})"
        )
    second = row(laws, mode=2, form="displacement-velocity-power", inputs="corrected")
    needed = joined(
        f"{number(one['needed_percent'], 2)} per cent (mode {one['mode']})" for one in chance.to_dict("records")
    )
    return (
        f"Least squares of log force on log amplitude gives {joined(said)}. The printed exponent of the first mode was "
        "read off a plot and is the slope between no two of its points (erratum E43-1); the coefficient of the second "
        f"form for mode 2, {second['alpha_printed']:g}, lacks a factor π/2 and becomes {number(second['alpha'])} "
        "(erratum E43-4). Linear damping, p = 1, would give such exponents in 1 case of 20 if amplitudes scattered by "
        f"{needed} from level to level."
    )


def _example(example: pd.DataFrame) -> list[str]:
    """The extrapolation to 90 lb, and what is left of the 67 per cent."""
    ratio, printed, refitted, whole = (
        row(example, quantity=name)
        for name in (
            "force over largest tested",
            "error of linear, p = 1.859",
            "error of linear, p refitted",
            "error of linear, over all laws",
        )
    )
    inside = [
        name
        for name, one in (("the refitted power law", refitted), ("all laws by weight", whole))
        if one["low"] <= printed["printed"] <= one["high"]
    ]
    return [
        f"Extrapolated to {F_EXAMPLE:g} lb, {number(ratio['recomputed'], 2)} times the largest tested force, the "
        f"report finds linear damping {printed['printed']:g} per cent too large. Its own exponent through sweep C "
        f"gives {percent(printed['recomputed'])} per cent; the refitted exponent {percent(refitted['recomputed'])} per "
        f"cent ({between(refitted['low'], refitted['high'], digits=2)}); all laws "
        f"by weight {percent(whole['recomputed'])} per cent ({between(whole['low'], whole['high'], digits=2)}, "
        "predictive).",
        f"So {printed['printed']:g} per cent lies "
        + (f"inside the interval of {joined(inside)}" if inside else "outside both intervals")
        + ", but it is one number out of a wide range, from one exponent with one degree of freedom; and the report's "
        "“actual amplitudes” (6.3) are extrapolations, not measurements (erratum E43-5).",
    ]


#: What is kept from level to level, in words.
HELD = {"xi": "damping factor ξ", "coefficient": "coefficient C"}


def level_blocks(studies: Studies, figures: Figures) -> list[Block]:
    """Figures, the least variation of each case, and the whole tables folded."""
    tables = studies.tables()
    variations = tables["level_variations"]
    drawings = [figure(figures, f"level-variation-mode-{mode}-{held}", 4) for mode, held in studies.levels]
    return [
        Heading("Tables 4.IV and 4.V: which coefficient stays the same"),
        Text(
            "The right case needs the same coefficient at every level. The report keeps the damping factor ξ = C/(2 M "
            "ω), fixes it at one sweep and compares the others. Here every sweep is the base in turn, the coefficient "
            "itself is kept as well (M changes from sweep to sweep, so the two are different questions), and "
            "α of case V and of cases I with II, III or IV may be free. What varies least from level to level:"
        ),
        List(_least(variations)),
        drawings[0],
        table(
            4,
            "level_variations",
            spreads(variations),
            "Standard deviation over the levels of what is kept, per cent; with a free α one degree of freedom less. "
            "Cases in order of the first column.",
        ),
        folded("The other modes and kept quantities", *drawings[1:]),
        folded(
            "Largest variation with each base, and amplitudes predicted from one sweep for the others",
            table(
                4,
                "level_variations",
                _by_base(variations),
                "Largest variation, per cent of the base's value (Table 4.V).",
            ),
            table(4, "level_predictions", _errors(tables["level_predictions"]), _PREDICTED),
        ),
        Text("; ".join(dict.fromkeys(c for one in studies.levels.values() for c in one.cautions)).capitalize() + "."),
    ]


_PREDICTED = (
    "Error of the amplitude predicted from the base for each other sweep, per cent (Table 4.IV); base “others” takes "
    "coefficient and free α from all sweeps but the one predicted."
)


def spreads(variations: pd.DataFrame) -> pd.DataFrame:
    """Spread of each case by mode and what is kept, a row a case."""
    once = variations.drop_duplicates(["mode", "kept", "case"])
    wide = once.pivot_table("spread_percent", "case", ["mode", "kept"], aggfunc="first")
    modes, kept = (wide.columns.get_level_values(level) for level in ("mode", "kept"))
    wide.columns = pd.Index([f"mode {mode}, {HELD[held]}" for mode, held in zip(modes, kept, strict=True)])
    return _named(wide.sort_values(wide.columns[0]).reset_index())


def _least(variations: pd.DataFrame) -> list[str]:
    """Which case varies least, among those of the report and among all."""
    said = []
    for mode in (1, 2):
        for held, words in HELD.items():
            rows = variations[(variations["mode"] == mode) & (variations["kept"] == held)].drop_duplicates("case")
            plain = rows[~rows["free"] & (rows["case"] != "V, second term")]
            of_report, of_all = (min(r.to_dict("records"), key=_spread) for r in (plain, rows))
            said.append(
                f"Mode {mode}, {words}: of the report's cases {_case(of_report['case'])} "
                f"({number(of_report['spread_percent'], 2)} per cent), of all {_case(of_all['case'])} "
                f"({number(of_all['spread_percent'], 2)} per cent)."
            )
    return said


def _spread(one: dict[Hashable, Any]) -> float:
    """Spread of a row, the largest where there is none."""
    spread = float(one["spread_percent"])
    return spread if np.isfinite(spread) else np.inf


def _by_base(variations: pd.DataFrame) -> pd.DataFrame:
    wide = variations.pivot_table("largest_percent", ["mode", "kept", "case"], "base", aggfunc="first")
    wide.columns = pd.Index([f"base {base}" for base in wide.columns])
    return _named(wide.reset_index())


def _errors(predictions: pd.DataFrame) -> pd.DataFrame:
    labelled = predictions.assign(
        pair=[f"{base} → {sweep}" for base, sweep in predictions[["base", "sweep"]].to_numpy()]
    )
    wide = labelled.pivot_table("percent_error", ["mode", "kept", "case"], "pair", aggfunc="first")
    return _named(wide.reset_index().rename_axis(columns=None))


def _named(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(case=[_case(case) for case in frame["case"]])


def _case(case: str) -> str:
    return str(case).replace("alpha", "α").replace("I + ", "I and ")
