"""Every figure of chapters II, IV, V and VI of the source report, redrawn: name, number, title, words, drawing.

Every printed result beside its recomputation: how far apart, and which differences are known errata.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.plots.style import ALERT, AVERAGE, MUTED, WIDTH, plain_rows, styled
from damping.report.words import joined
from damping_reed1970.chapter_2 import REFERENCE, equal_amplitudes
from damping_reed1970.chapter_2 import figures as chapter_2
from damping_reed1970.chapter_4 import A_LINEAR_PRINTED, A_POWER_PRINTED, F_EXAMPLE
from damping_reed1970.chapter_4 import figures as chapter_4
from damping_reed1970.chapter_4.amplitude_frequency import PRINTED, amplitude_frequency
from damping_reed1970.chapter_5 import figures as chapter_5
from damping_reed1970.chapter_5.circularity import ROUTES
from damping_reed1970.reproduce import Studies


class ChapterFigure(NamedTuple):
    """A figure: ``counterpart`` is its number in the source report (empty: it goes further than the report)."""

    name: str
    counterpart: str
    title: str
    description: str
    draw: Callable[[], Figure]


def chapter_figures(found: Studies, law_errors: pd.DataFrame) -> list[ChapterFigure]:
    """All figures in the order of the chapters.

    Args:
        found: the studies. law_errors: ``section_6_1_errors`` of the rankings.
    """
    return [*_chapter_2(found), *_chapter_4(found), *_chapter_5_and_6(found, law_errors)]


def _chapter_2(found: Studies) -> list[ChapterFigure]:
    slip = found.slip
    return [
        ChapterFigure(
            "hysteresis-loops", "2.4", "Hysteresis loops of every damping force",
            "Force against displacement over one cycle, about a spring of unit stiffness; all but the slip joint lose "
            "the same energy per cycle.",
            lambda: chapter_2.hysteresis_loops(found.loops.loops),
        ),
        ChapterFigure(
            "slip-equivalent", "2.5", "Slip joint and its velocity-squared equivalent",
            f"Left: loops at {REFERENCE:g} times the amplitude at which slip starts, exact, with velocity-squared "
            "damping of equal energy, and with the coefficient as printed. Right: per cent error against amplitude. "
            f"The printed energy is right at {_equal(slip.energies, 'printed')} times that amplitude only, a fixed "
            f"coefficient at {_equal(slip.energies, 'corrected_equivalent')} times.",
            lambda: chapter_2.slip_equivalent(slip.slip, slip.printed, slip.corrected, slip.error, REFERENCE),
        ),
        ChapterFigure(
            "slip-energy", "", "Energy per cycle of a slip joint against amplitude",
            "The exact energy grows like the amplitude, the printed one like its square, velocity-squared damping "
            "like its cube.",
            lambda: chapter_2.slip_energy(slip.energies),
        ),
    ]  # fmt: skip


def _equal(energies: pd.DataFrame, column: str) -> str:
    return joined(f"{A:.2f}" for A in equal_amplitudes(energies, column))


def _by_width(widths: pd.DataFrame) -> str:
    """Cases by the width of their curves at half the resonant amplitude, with that width over the first one's."""
    half = widths[widths["amplitude_over_resonant"] == 0.5].sort_values("width_eta_squared")
    over = half["width_eta_squared"] / half["width_eta_squared"].iloc[0]
    return joined(f"{case.removeprefix('case ')} ({x:.2f})" for case, x in zip(half["case"], over, strict=True))


def _chapter_4(found: Studies) -> list[ChapterFigure]:
    curves = found.curves
    explained = amplitude_frequency(M=1.0, omega_n=1.0, F=0.05, A_m=1.0, alphas=())
    levels = [
        ChapterFigure(
            f"level-variation-mode-{mode}-{held}", "", f"Mode {mode}: variation of the {said} from level to level",
            f"For each damping case the largest variation of the {said} with each sweep as base (Table 4.V) and its "
            "standard deviation over the sweeps; least is best.",
            lambda one=one, said=said: chapter_4.level_variation(one.variations, f"the {said}"),  # type: ignore[misc]  # bound now
        )
        for (mode, held), one in found.levels.items()
        for said in ({"xi": "damping factor", "coefficient": "coefficient"}[held],)
    ]  # fmt: skip
    return [
        ChapterFigure(
            "linear-coefficient", "4.1, 4.2", "Linear coefficient against resonant amplitude",
            "Three sweeps of each mode with the printed line and our two lines with 90 per cent intervals, from one "
            "degree of freedom.",
            lambda: chapter_4.linear_coefficients(found.lines),
        ),
        ChapterFigure(
            "response-explained", "4.3", "Damped and undamped response, δ and ε",
            "Amplitude against frequency ratio squared with the horizontal and the vertical difference of the curves.",
            lambda: chapter_4.response_explained(explained),
        ),
        ChapterFigure(
            "response-curves", "4.4, 4.5", "Amplitude against frequency ratio squared",
            "First mode, sweep C: all cases pass through the one measured resonance. From the narrowest to the widest "
            f"at half of its amplitude: {_by_width(curves.widths)}.",
            lambda: chapter_4.response_curves(curves),
        ),
        ChapterFigure(
            "phase-curves", "4.6", "Phase against frequency ratio squared",
            "Phase lag of the same cases.", lambda: chapter_4.phase_curves(curves),
        ),
        ChapterFigure(
            "response-differences", "4.7, 4.8", "Difference of damped and undamped curves",
            "Horizontal difference δ and vertical difference ε against amplitude, with the printed value at "
            f"{PRINTED['A']:g} in.",
            lambda: chapter_4.differences(curves, (PRINTED["A"], PRINTED["delta"])),
        ),
        ChapterFigure(
            "undamped-error", "4.9", "Error of neglecting damping",
            "Per cent error of the undamped curve against amplitude over resonant amplitude, with the printed "
            f"{PRINTED['percent_at_half']:g} per cent at one half.",
            lambda: chapter_4.undamped_error(curves, (0.5, PRINTED["percent_at_half"])),
        ),
        ChapterFigure(
            "force-amplitude", "4.10", "Resonant force against amplitude",
            "Least squares line with its 90 per cent interval, the printed slope, linear damping, and the printed "
            f"amplitudes at {F_EXAMPLE:g} lb.",
            lambda: chapter_4.force_amplitude(found.force_lines, (F_EXAMPLE, A_LINEAR_PRINTED, A_POWER_PRINTED)),
        ),
        *levels,
    ]  # fmt: skip


def _chapter_5_and_6(found: Studies, law_errors: pd.DataFrame) -> list[ChapterFigure]:
    return [
        ChapterFigure(
            "configuration-1-energy", "5.1", "Energy surface of Configuration I",
            "Fifteen measured energies over frequency and amplitude with the best law of coefficients above 0 and "
            "with all nine terms, whose energy is negative in the hatched regions.",
            lambda: chapter_5.energy_surfaces(found.surface),
        ),
        ChapterFigure(
            "nine-terms", "", "Error of energy against number of terms",
            "Best subsets of each size, free and with all coefficients above 0, and backward elimination with its "
            "number of negative coefficients.",
            lambda: chapter_5.terms_against_error(
                found.nine.by_size, found.nine.elimination, ["5.III recovered", "5.IV recovered"]
            ),
        ),
        ChapterFigure(
            "false-terms", "", "Energy losses that do not exist",
            "Data of a known law of two terms with noise: share of runs in which a term is selected that is not "
            "there, and error of the energy at twice the amplitude, for three ways of selection.",
            lambda: chapter_5.false_terms(found.false.selection),
        ),
        ChapterFigure(
            "circularity", "", "Which law comes out when the truth is known",
            "Kinds of law selected from simulated tests of known structures, by the route of Table 5.IV and from "
            "measured energy and amplitude, beside what the measured data give.",
            lambda: chapter_5.circularity(found.circular.laws, ROUTES),
        ),
        ChapterFigure(
            "section-6-1", "", "Errors of the laws of section 6.1",
            "Per cent error of resonant amplitude at the tested forces of every law: printed, recomputed, ours.",
            lambda: chapter_5.force_laws(law_errors),
        ),
    ]  # fmt: skip


#: Differences below this many per cent are drawn on a linear scale.
_LINEAR = 1.0


@styled
def reproduction(table: pd.DataFrame) -> Figure:
    """Draw 100 (computed/printed - 1) by group of ids.

    Args:
        table: ``id, printed`` (text), ``computed, computed_after_correction`` (numbers or missing), ``erratum``
            (empty where there is none). Rows whose printed value is no number other than zero are not drawn.
    """
    rows = percent_differences(table)
    groups = list(rows["group"].unique())
    figure = Figure(figsize=(WIDTH, 1.1 + 0.2 * len(groups)))
    axes = figure.add_subplot()
    counts = rows["group"].value_counts()
    plain_rows(axes, [f"{group} ({counts[group]})" for group in groups])
    axes.axvline(0.0, color=MUTED, linewidth=0.8)
    level = rows["group"].map(groups.index).to_numpy(float) + _spread(rows)
    known = rows["erratum"].astype(str).ne("").to_numpy()
    for chosen, colour, marker, label in (
        (~known, AVERAGE, "o", "no erratum"),
        (known, ALERT, "X", "erratum known"),
    ):
        axes.plot(rows["percent"][chosen], level[chosen], marker, color=colour, markersize=4, alpha=0.75, label=label)
    corrected: dict[str, Any] = {
        "color": "white",
        "markeredgecolor": ALERT,
        "markersize": 3.5,
        "label": "after correction",
    }
    axes.plot(rows["percent_corrected"], level, "D", **corrected)
    axes.set_xscale("symlog", linthresh=_LINEAR)
    axes.xaxis.set_major_formatter(lambda value, position: f"{value:g}")
    axes.set_xlabel("computed against printed (%), linear within ±1 %, logarithmic beyond")
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def percent_differences(table: pd.DataFrame) -> pd.DataFrame:
    """Comparable rows with ``group``, ``percent`` and ``percent_corrected`` = 100 (computed/printed - 1)."""
    printed = pd.to_numeric(table["printed"], errors="coerce")
    rows = table.assign(
        group=table["id"].map(group_of),
        percent=100.0 * (pd.to_numeric(table["computed"], errors="coerce") / printed - 1.0),
        percent_corrected=100.0 * (pd.to_numeric(table["computed_after_correction"], errors="coerce") / printed - 1.0),
    )
    return rows[np.isfinite(rows["percent"]) & (printed != 0.0)].reset_index(drop=True)


def group_of(identity: str) -> str:
    """Group of an id: ``tab2II`` of ``tab2II.energy_factor[I]``."""
    return re.split(r"[.\[]", identity, maxsplit=1)[0]


def _spread(rows: pd.DataFrame) -> FloatArray:
    """Small vertical steps, so that rows of one group do not hide one another."""
    number = rows.groupby("group").cumcount().to_numpy(float)
    return 0.28 * np.sin(2.399963 * number)  # the golden angle: neighbours land apart
