"""Chapter II: hysteresis loops of every force (Fig. 2.4), slip and its velocity-squared equivalent (Fig. 2.5)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from damping.plots.style import INK, LINEAR, MUTED, WIDTH, law_style, styled
from damping.report.words import format_joined
from damping_reed1970.chapter_2 import (
    REFERENCE,
    EquivalenceError,
    HysteresisLoops,
    Loop,
    SlipEquivalent,
    equal_amplitudes,
)
from damping_reed1970.common import ChapterFigure

#: Of the 1441 points of a small loop, only every nth is drawn: all corners at multiples of 30 degrees stay.
EVERY = 12
_STYLE_OF = {"case V": "viscous + quadratic-displacement"}
_TITLES = {
    "viscous": "viscous (I)",
    "displacement": "displacement\n(II)",
    "velocity-squared": "velocity\nsquared (III)",
    "displacement-velocity": "displacement ×\nvelocity (IV)",
    "quadratic-displacement": "q²q′",
    "velocity-power": "velocity\npower 0.5",
    "displacement-velocity-power": "displacement ×\nvelocity power 1.5",
    "coulomb": "Coulomb",
    "slip": "slip joint",
    "case V": "case V, α = 4",
}


@styled
def draw_hysteresis_loops(loops: Mapping[str, Loop]) -> Figure:
    """Draw a small panel for each loop, by the name of its force, with the spring it is drawn about (dashed)."""
    columns = 3
    rows = -(-len(loops) // columns)
    figure = Figure(figsize=(WIDTH, 1.75 * rows + 0.2))
    for number, (name, loop) in enumerate(loops.items()):
        axes = figure.add_subplot(rows, columns, number + 1)
        colour = law_style(_STYLE_OF.get(name, name)).colour
        q, force = loop.q[::EVERY], loop.force[::EVERY]
        axes.fill(q, force, color=colour, alpha=0.15, linewidth=0)
        axes.plot(q, force, color=colour)
        axes.plot([-1.0, 1.0], [-1.0, 1.0], color=MUTED, linewidth=0.7, linestyle=(0, (4, 3)))
        axes.set_title(_TITLES.get(name, name), fontsize=7.5)
        axes.set(xlim=(-1.25, 1.25), ylim=(-1.9, 1.9), xticks=[-1, 0, 1], yticks=[-1, 0, 1])
        if number % columns:
            axes.set_yticklabels([])
        else:
            axes.set_ylabel("force / K A")
        if number < len(loops) - columns:
            axes.set_xticklabels([])
        else:
            axes.set_xlabel("q / A")
    return figure


@styled
def draw_slip_equivalent(
    slip: Loop, printed: Loop, corrected: Loop, error: EquivalenceError, reference: float
) -> Figure:
    """Draw the loops of slip and of its equivalents, and the errors against amplitude (in units of A1, stuck K = 1)."""
    figure = Figure(figsize=(WIDTH, 5.8))
    left, right = figure.subplots(2, 1)
    slip_colour, square_colour = law_style("slip").colour, law_style("velocity-squared").colour
    left.fill(slip.q, slip.force, color=slip_colour, alpha=0.2, linewidth=0)
    left.plot(slip.q, slip.force, color=slip_colour, label="slip joint (exact)")
    left.plot(corrected.q, corrected.force, color=square_colour, label="C₃q̇² of equal energy")
    left.plot(printed.q, printed.force, color=LINEAR, linestyle=(0, (4, 2)), label="C₃ by (2.4.4) as printed")
    left.set_xlabel("displacement / A₁")
    left.set_ylabel("force / K A₁")
    left.set_title(f"Loops at A = {reference:g} A₁")
    left.set_ylim(-2.9, 2.1)
    left.legend(loc="lower right", fontsize=7)
    _draw_errors(right, error, reference)
    return figure


def _draw_errors(axes: Axes, error: EquivalenceError, reference: float) -> None:
    square = law_style("velocity-squared").colour
    lines = (
        (error.coefficient_percent, LINEAR, (0, (4, 2)), "printed energy (2.4.3) against exact"),
        (error.corrected_percent, square, "-", f"energy, C₃ fixed at {reference:g} A₁"),
        (error.shape_percent, MUTED, (0, (1, 1.2)), "shape of the loop, equal energy (rms)"),
    )
    for values, colour, line, label in lines:
        axes.plot(error.amplitude, values, color=colour, linestyle=line, label=label)
    axes.axhline(0.0, color=INK, linewidth=0.7)
    axes.plot([3.0], [0.0], "o", color=LINEAR, markersize=4)
    axes.annotate("as printed: at 3 A₁", (3.0, 0.0), (8, -13), textcoords="offset points", fontsize=7.5, color=LINEAR)
    axes.set(xlim=(1.0, float(error.amplitude[-1])), ylim=(-170.0, 250.0))
    axes.set_xlabel("amplitude A / A₁")
    axes.set_ylabel("error (per cent)")
    axes.set_title("Error of the equivalence")
    axes.legend(loc="lower right", fontsize=7)


@styled
def draw_slip_energy(energies: pd.DataFrame) -> Figure:
    """Draw energy per cycle against amplitude: slip exact and printed, and what a fixed C3 makes of it.

    Args:
        energies: ``amplitude, exact, printed, printed_equivalent, corrected_equivalent`` in units of A1 and K A1^2.
    """
    figure = Figure(figsize=(WIDTH, 3.0))
    axes = figure.add_subplot()
    lines = {
        "exact": (law_style("slip").colour, "-", "slip joint, exact: grows like A"),
        "printed": (LINEAR, (0, (4, 2)), "(2.4.3) as printed: like A²"),
        "corrected_equivalent": (law_style("velocity-squared").colour, "-", "C₃q̇²: like A³"),
    }
    for name, (colour, line, label) in lines.items():
        axes.plot(energies["amplitude"], energies[name], color=colour, linestyle=line, label=label)
    top = float(np.max(energies["printed"]))
    axes.set(xlim=(1.0, float(energies["amplitude"].iloc[-1])), ylim=(0.0, top))
    axes.set_xlabel("amplitude A / A₁")
    axes.set_ylabel("energy per cycle / K A₁²")
    axes.legend(loc="upper left")
    return figure


def list_chapter_2_figures(loops: HysteresisLoops, slip: SlipEquivalent) -> list[ChapterFigure]:
    """Every figure of the chapter with its words."""
    return [
        ChapterFigure(
            "hysteresis-loops", "2.4", "Hysteresis loops of every damping force",
            "Force against displacement over one cycle, about a spring of unit stiffness; all but the slip joint lose "
            "the same energy per cycle.",
            lambda: draw_hysteresis_loops(loops.loops),
        ),
        ChapterFigure(
            "slip-equivalent", "2.5", "Slip joint and its velocity-squared equivalent",
            f"Left: loops at {REFERENCE:g} times the amplitude at which slip starts, exact, with velocity-squared "
            "damping of equal energy, and with the coefficient as printed. Right: per cent error against amplitude. "
            f"The printed energy is right at {_describe_equal(slip.energies, 'printed')} times that amplitude only, "
            f"a fixed coefficient at {_describe_equal(slip.energies, 'corrected_equivalent')} times.",
            lambda: draw_slip_equivalent(slip.slip, slip.printed, slip.corrected, slip.error, REFERENCE),
        ),
        ChapterFigure(
            "slip-energy", "", "Energy per cycle of a slip joint against amplitude",
            "The exact energy grows like the amplitude, the printed one like its square, velocity-squared damping "
            "like its cube.",
            lambda: draw_slip_energy(slip.energies),
        ),
    ]  # fmt: skip


def _describe_equal(energies: pd.DataFrame, column: str) -> str:
    return format_joined(f"{A:.2f}" for A in equal_amplitudes(energies, column))
