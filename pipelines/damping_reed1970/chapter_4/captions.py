"""Chapter IV: every figure with its number in the report, title, words and drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from damping.report.words import joined
from damping_reed1970.chapter_4 import A_LINEAR_PRINTED, A_POWER_PRINTED, F_EXAMPLE, figures
from damping_reed1970.chapter_4.amplitude_frequency import PRINTED, AmplitudeFrequency, amplitude_frequency
from damping_reed1970.chapter_4.coefficients import CoefficientLines
from damping_reed1970.chapter_4.levels import LevelMethods
from damping_reed1970.chapter_4.power_laws import ForceAmplitudeLines
from damping_reed1970.common import ChapterFigure


def chapter_4_figures(
    lines: Sequence[CoefficientLines],
    curves: AmplitudeFrequency,
    forces: Sequence[ForceAmplitudeLines],
    levels: Mapping[tuple[int, str], LevelMethods],
) -> list[ChapterFigure]:
    """Every figure of the chapter with its words."""
    explained = amplitude_frequency(M=1.0, omega_n=1.0, F=0.05, A_m=1.0, alphas=())
    variations = [
        ChapterFigure(
            f"level-variation-mode-{mode}-{held}", "", f"Mode {mode}: variation of the {said} from level to level",
            f"For each damping case the largest variation of the {said} with each sweep as base (Table 4.V) and its "
            "standard deviation over the sweeps; least is best.",
            lambda one=one, said=said: figures.level_variation(one.variations, f"the {said}"),  # type: ignore[misc]  # bound now
        )
        for (mode, held), one in levels.items()
        for said in ({"xi": "damping factor", "coefficient": "coefficient"}[held],)
    ]  # fmt: skip
    return [
        ChapterFigure(
            "linear-coefficient", "4.1, 4.2", "Linear coefficient against resonant amplitude",
            "Three sweeps of each mode with the printed line and our two lines with 90 per cent intervals, from one "
            "degree of freedom.",
            lambda: figures.linear_coefficients(lines),
        ),
        ChapterFigure(
            "response-explained", "4.3", "Damped and undamped response, δ and ε",
            "Amplitude against frequency ratio squared with the horizontal and the vertical difference of the curves.",
            lambda: figures.response_explained(explained),
        ),
        ChapterFigure(
            "response-curves", "4.4, 4.5", "Amplitude against frequency ratio squared",
            "First mode, sweep C: all cases pass through the one measured resonance. From the narrowest to the widest "
            f"at half of its amplitude: {_by_width(curves.widths)}.",
            lambda: figures.response_curves(curves),
        ),
        ChapterFigure(
            "phase-curves", "4.6", "Phase against frequency ratio squared",
            "Phase lag of the same cases.", lambda: figures.phase_curves(curves),
        ),
        ChapterFigure(
            "response-differences", "4.7, 4.8", "Difference of damped and undamped curves",
            "Horizontal difference δ and vertical difference ε against amplitude, with the printed value at "
            f"{PRINTED['A']:g} in.",
            lambda: figures.differences(curves, (PRINTED["A"], PRINTED["delta"])),
        ),
        ChapterFigure(
            "undamped-error", "4.9", "Error of neglecting damping",
            "Per cent error of the undamped curve against amplitude over resonant amplitude, with the printed "
            f"{PRINTED['percent_at_half']:g} per cent at one half.",
            lambda: figures.undamped_error(curves, (0.5, PRINTED["percent_at_half"])),
        ),
        ChapterFigure(
            "force-amplitude", "4.10", "Resonant force against amplitude",
            "Least squares line with its 90 per cent interval, the printed slope, linear damping, and the printed "
            f"amplitudes at {F_EXAMPLE:g} lb.",
            lambda: figures.force_amplitude(forces, (F_EXAMPLE, A_LINEAR_PRINTED, A_POWER_PRINTED)),
        ),
        *variations,
    ]  # fmt: skip


def _by_width(widths: pd.DataFrame) -> str:
    """Cases by the width of their curves at half the resonant amplitude, with that width over the first one's."""
    half = widths[widths["amplitude_over_resonant"] == 0.5].sort_values("width_eta_squared")
    over = half["width_eta_squared"] / half["width_eta_squared"].iloc[0]
    return joined(f"{case.removeprefix('case ')} ({x:.2f})" for case, x in zip(half["case"], over, strict=True))
