"""Tables 4.IV and 4.V in the report: which case keeps its coefficient from level to level, with any sweep as base."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
import pandas as pd

from selection.report.chapters.common import Figures, figure, folded, table
from selection.report.page import Block, Heading, List, Text
from selection.report.words import number
from selection.reproduction.studies import Studies

LEVEL_TABLES = ("level_coefficients", "level_variations", "level_predictions")
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
