"""Chapter II in the report: loops of every force (Fig. 2.4), slip and its equivalent (Fig. 2.5), lumped masses."""

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.linalg import eigh

from damping.plots import INK, LINEAR, MUTED, WIDTH, build_panel, build_panels, law_style, styled
from damping_reed1970 import LABELS, ReportPart, chapter_table, write_chapter
from damping_reed1970.chapter_2 import REFERENCE, Loop, SlipEquivalent, equal_amplitudes
from damping_reed1970.studies import ReportResults, Studies

#: Of the 1441 points of a small loop, only every nth is drawn: all corners at multiples of 30 degrees stay.
EVERY = 12
_STYLE_OF = {"case V": "viscous + quadratic-displacement"}


@styled
def draw_hysteresis_loops(loops: Mapping[str, Loop]) -> Figure:
    """Draw a small panel for each loop, by the name of its force, with the spring it is drawn about (dashed)."""
    columns = 3
    rows = -(-len(loops) // columns)
    figure = Figure(figsize=(WIDTH, 1.75 * rows + 0.2))
    for place, (name, loop) in enumerate(loops.items()):
        axes = figure.add_subplot(rows, columns, place + 1)
        colour = law_style(_STYLE_OF.get(name, name)).colour
        q, force = loop.q[::EVERY], loop.force[::EVERY]
        axes.fill(q, force, color=colour, alpha=0.15, linewidth=0)
        axes.plot(q, force, color=colour)
        axes.plot([-1.0, 1.0], [-1.0, 1.0], color=MUTED, linewidth=0.7, linestyle=(0, (4, 3)))
        axes.set_title(LABELS["loops"].get(name, name), fontsize=7.5)
        axes.set(xlim=(-1.25, 1.25), ylim=(-1.9, 1.9), xticks=[-1, 0, 1], yticks=[-1, 0, 1])
        if place % columns:
            axes.set_yticklabels([])
        else:
            axes.set_ylabel("force / K A")
        if place < len(loops) - columns:
            axes.set_xticklabels([])
        else:
            axes.set_xlabel("q / A")
    return figure


@styled
def draw_slip_equivalent(equivalent: SlipEquivalent) -> Figure:
    """Draw the loops of slip and of its equivalents, and the errors against amplitude (in units of A1, stuck K = 1)."""
    figure, (upper, lower) = build_panels(5.8, 2)
    slip_colour, square_colour = law_style("slip").colour, law_style("velocity-squared").colour
    slip, printed, corrected = equivalent.slip, equivalent.printed, equivalent.corrected
    upper.fill(slip.q, slip.force, color=slip_colour, alpha=0.2, linewidth=0)
    upper.plot(slip.q, slip.force, color=slip_colour, label="slip joint (exact)")
    upper.plot(corrected.q, corrected.force, color=square_colour, label="C₃q̇² of equal energy")
    upper.plot(printed.q, printed.force, color=LINEAR, linestyle=(0, (4, 2)), label="C₃ by (2.4.4) as printed")
    upper.set(xlabel="displacement / A₁", ylabel="force / K A₁", ylim=(-2.9, 2.1))
    upper.set_title(f"Loops at A = {REFERENCE:g} A₁")
    upper.legend(loc="lower right", fontsize=7)
    _draw_errors(lower, equivalent.error)
    return figure


def _draw_errors(axes: Axes, error: pd.DataFrame) -> None:
    for name, colour, line, label in (
        ("coefficient", LINEAR, (0, (4, 2)), "printed energy (2.4.3) against exact"),
        ("corrected", law_style("velocity-squared").colour, "-", f"energy, C₃ fixed at {REFERENCE:g} A₁"),
        ("shape", MUTED, (0, (1, 1.2)), "shape of the loop, equal energy (rms)"),
    ):
        axes.plot(error["amplitude"], error[f"{name}_percent"], color=colour, linestyle=line, label=label)
    axes.axhline(0.0, color=INK, linewidth=0.7)
    axes.plot([3.0], [0.0], "o", color=LINEAR, markersize=4)
    axes.annotate("as printed: at 3 A₁", (3.0, 0.0), (8, -13), textcoords="offset points", fontsize=7.5, color=LINEAR)
    axes.set(xlim=(1.0, float(error["amplitude"].iloc[-1])), ylim=(-170.0, 250.0), title="Error of the equivalence")
    axes.set(xlabel="amplitude A / A₁", ylabel="error (per cent)")
    axes.legend(loc="lower right", fontsize=7)


@styled
def draw_slip_energy(energies: pd.DataFrame) -> Figure:
    """Draw the energies of :class:`SlipEquivalent` against amplitude: slip exact and printed, and a fixed C3."""
    figure, axes = build_panel(3.0, "amplitude A / A₁", "energy per cycle / K A₁²")
    lines = {
        "exact": (law_style("slip").colour, "-", "slip joint, exact: grows like A"),
        "printed": (LINEAR, (0, (4, 2)), "(2.4.3) as printed: like A²"),
        "corrected_equivalent": (law_style("velocity-squared").colour, "-", "C₃q̇²: like A³"),
    }
    for name, (colour, line, label) in lines.items():
        axes.plot(energies["amplitude"], energies[name], color=colour, linestyle=line, label=label)
    axes.set(xlim=(1.0, float(energies["amplitude"].iloc[-1])), ylim=(0.0, float(np.max(energies["printed"]))))
    axes.legend(loc="upper left")
    return figure


MASSES = 4
#: Viscous dampers beside the springs: first joint, middle, last.
JOINTS = {"joint 1-2": 0.01, "joint 2-3": 0.02, "joint 3-4": 0.01}


def tabulate_lumped_masses() -> pd.DataFrame:
    """One row per mode of free masses m = 1 between springs k = 1, each shape phi scaled to 1 at mass 1.

    ``omega``, rad/s, of [k] phi = omega^2 [m] phi (Eq. 2.2.1) and ``omega_closed_form``; ``mass`` generalized, phi^T m
    phi (2.2.2); ``force``: phi_4 F, modal force of a unit load at mass 4 (2.2.3); a column a joint: c (stroke)^2, what
    its damper adds to the modal coefficient ``C`` (section 2.5), and ``xi``.
    """
    ends = np.ones(MASSES)
    ends[[0, -1]] = 0.5
    stiffness = 2.0 * np.diag(ends) - np.eye(MASSES, k=1) - np.eye(MASSES, k=-1)
    squared, vectors = eigh(stiffness, np.eye(MASSES))
    shapes, masses = vectors / vectors[0], 1.0 / vectors[0] ** 2
    j = np.arange(MASSES)
    moving = j > 0
    omega = np.sqrt(np.where(moving, squared, 0.0))  # rounding leaves the rigid body a frequency of 1e-8
    shares = {name: c * stroke**2 for (name, c), stroke in zip(JOINTS.items(), np.diff(shapes, axis=0), strict=True)}
    C = np.sum(list(shares.values()), axis=0)
    return pd.DataFrame(
        {
            "mode": j,
            "omega": omega,
            "omega_closed_form": 2.0 * np.sin(j * np.pi / (2 * MASSES)),
            "mass": masses,
            "force": shapes[-1],
            **{name: np.where(moving, share, 0.0).round(12) for name, share in shares.items()},  # 0 but for rounding
            "C": np.where(moving, C, 0.0),
            "xi": C / (2.0 * masses * np.where(moving, omega, np.inf)),
        }
    )


AMPLITUDES = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0)  #: amplitudes over the slip limit at which the energies are tabled


def write_chapter_2(results: ReportResults) -> ReportPart:
    """The page: loops, the printed and exact slip joint, and the error of a fixed equivalent coefficient."""
    studies = results.studies
    loops, energies, modes = studies.loops.areas, studies.slip.energies, tabulate_lumped_masses()
    at = tabulate_energies_at(energies)
    values = {
        "at": at,
        "right": equal_amplitudes(energies, "printed"),
        "equal": equal_amplitudes(energies, "corrected_equivalent"),
        "reference": REFERENCE,
        "joints": list(JOINTS),
    }
    shown = {
        "slip_equivalent": chapter_table(2, "slip_equivalent", at, LABELS["slip_equivalent"]),
        "lumped_masses": chapter_table(2, "lumped_masses", modes, LABELS["lumped_masses"]),
    }
    tables = {"lumped_masses": modes, "hysteresis_loops": loops, "slip_equivalent": energies}
    return write_chapter(2, results.tables, values=values, figures=collect_figures(studies), shown=shown, tables=tables)


def collect_figures(studies: Studies) -> dict[str, Callable[[], Figure]]:
    """How each figure of the chapter is drawn, by name."""
    return {
        "hysteresis-loops": lambda: draw_hysteresis_loops(studies.loops.loops),
        "slip-equivalent": lambda: draw_slip_equivalent(studies.slip),
        "slip-energy": lambda: draw_slip_energy(studies.slip.energies),
    }


def tabulate_energies_at(energies: pd.DataFrame) -> pd.DataFrame:
    """Energies interpolated at ``AMPLITUDES``, with what the printed formula and the equivalent make of the exact."""
    A = np.array(AMPLITUDES)
    names = ("exact", "printed", "corrected_equivalent")
    columns = {name: np.interp(A, energies["amplitude"], energies[name]) for name in names}
    table = pd.DataFrame({"amplitude": A, **columns})
    return table.assign(
        printed_over_exact=table["printed"] / table["exact"],
        equivalent_percent=100.0 * (table["corrected_equivalent"] / table["exact"] - 1.0),
    )[["amplitude", "exact", "printed", "printed_over_exact", "corrected_equivalent", "equivalent_percent"]]
