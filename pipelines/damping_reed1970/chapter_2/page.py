"""Chapter II in the report: loops of every force (Fig. 2.4), slip and its equivalent (Fig. 2.5), lumped masses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.linalg import eigh

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.plots import INK, LINEAR, MUTED, WIDTH, build_panel, law_style, styled
from damping_reed1970.chapter_2 import REFERENCE, Loop, SlipEquivalent, equal_amplitudes
from damping_reed1970.common import LABELS, ReportPart, chapter_table, write_chapter
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
    figure = Figure(figsize=(WIDTH, 5.8))
    left, right = figure.subplots(2, 1)
    slip_colour, square_colour = law_style("slip").colour, law_style("velocity-squared").colour
    slip, printed, corrected = equivalent.slip, equivalent.printed, equivalent.corrected
    left.fill(slip.q, slip.force, color=slip_colour, alpha=0.2, linewidth=0)
    left.plot(slip.q, slip.force, color=slip_colour, label="slip joint (exact)")
    left.plot(corrected.q, corrected.force, color=square_colour, label="C₃q̇² of equal energy")
    left.plot(printed.q, printed.force, color=LINEAR, linestyle=(0, (4, 2)), label="C₃ by (2.4.4) as printed")
    left.set(xlabel="displacement / A₁", ylabel="force / K A₁", ylim=(-2.9, 2.1))
    left.set_title(f"Loops at A = {REFERENCE:g} A₁")
    left.legend(loc="lower right", fontsize=7)
    _draw_errors(right, equivalent.error)
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
    top = float(np.max(energies["printed"]))
    axes.set(xlim=(1.0, float(energies["amplitude"].iloc[-1])), ylim=(0.0, top))
    axes.legend(loc="upper left")
    return figure


@dataclass(frozen=True)
class NormalModes:
    """Modes of [m] x'' + [k] x = F in order of frequency.

    ``omega``: natural frequencies, rad/s, (modes,). ``shapes``: phi, (nodes, modes), each 1 at the reference node.
    ``masses``: phi^T m phi, (modes,); omega^2 times these are the stiffnesses (Eq 2.2.2).
    """

    omega: FloatArray
    shapes: FloatArray
    masses: FloatArray


@dataclass(frozen=True)
class Damper:
    """A viscous damper ``coefficient`` between two nodes, or from a node to ground, belonging to a sub-system."""

    subsystem: str
    coefficient: float
    node: int
    other: int | None = None


def normal_modes(mass: FloatArray, stiffness: FloatArray, reference: int) -> NormalModes:
    """Solve [k] phi = omega^2 [m] phi and scale each shape to 1 at the reference node (Eqs 2.2.1, 2.2.2).

    Args:
        mass: (n, n) symmetric positive definite, or the n lumped masses. stiffness: (n, n) symmetric.
        reference: node whose displacement is the modal coordinate.

    AnalysisError: a mode does not move the reference node, so that its shape cannot be scaled there.
    """
    squared, vectors = eigh(stiffness, np.diag(mass) if np.ndim(mass) == 1 else mass)
    omega = np.sqrt(np.maximum(squared, 0.0))  # rounding leaves rigid-body modes slightly negative
    at_reference = vectors[reference]
    still = np.flatnonzero(np.abs(at_reference) < 1e-10 * np.max(np.abs(vectors), axis=0))
    if still.size:
        raise AnalysisError(f"mode {still[0] + 1} does not move node {reference}: choose another reference node")
    return NormalModes(omega=omega, shapes=vectors / at_reference, masses=1.0 / at_reference**2)


def modal_force(modes: NormalModes, node: int, force: float) -> FloatArray:
    """F_e,j = phi_rj F of a load at node r (Eq 2.2.3), (modes,)."""
    return np.asarray(modes.shapes[node] * force)


def subsystem_damping(modes: NormalModes, dampers: Sequence[Damper]) -> dict[str, FloatArray]:
    """What each sub-system adds to the modal coefficients C_j, (modes,) each; they add to diag(phi^T c phi)."""
    shares = {damper.subsystem: np.zeros(modes.omega.size) for damper in dampers}
    for damper in dampers:
        stroke = modes.shapes[damper.node] - (0.0 if damper.other is None else modes.shapes[damper.other])
        shares[damper.subsystem] += damper.coefficient * stroke**2
    return shares


MASSES = 4
#: Viscous dampers beside the springs: first joint, middle, last.
JOINTS = {"joint 1-2": 0.01, "joint 2-3": 0.02, "joint 3-4": 0.01}


def tabulate_lumped_masses() -> pd.DataFrame:
    """One row per mode, with m = k = 1 and the displacement of mass 1 as modal coordinate.

    ``omega`` computed and ``omega_closed_form``; ``mass`` generalized; ``force``: modal force of a unit load at mass 4
    (Eq. 2.2.3); a column a joint: what its damper adds to the modal coefficient ``C`` (section 2.5), and ``xi``.
    """
    ends = np.ones(MASSES)
    ends[[0, -1]] = 0.5
    stiffness = 2.0 * np.diag(ends) - np.eye(MASSES, k=1) - np.eye(MASSES, k=-1)
    modes = normal_modes(np.ones(MASSES), stiffness, reference=0)
    dampers = [Damper(name, c, node, node + 1) for node, (name, c) in enumerate(JOINTS.items())]
    shares = subsystem_damping(modes, dampers)
    C = np.sum(list(shares.values()), axis=0)
    j = np.arange(MASSES)
    moving = j > 0
    omega = np.where(moving, modes.omega, 0.0)  # rounding leaves the rigid body a frequency of 1e-8
    return pd.DataFrame(
        {
            "mode": j,
            "omega": omega,
            "omega_closed_form": 2.0 * np.sin(j * np.pi / (2 * MASSES)),
            "mass": modes.masses,
            "force": modal_force(modes, MASSES - 1, 1.0),
            **{name: np.where(moving, share, 0.0).round(12) for name, share in shares.items()},  # 0 but for rounding
            "C": np.where(moving, C, 0.0),
            "xi": C / (2.0 * modes.masses * np.where(moving, omega, np.inf)),
        }
    )


#: Amplitudes over the slip limit at which the energies are tabled.
AMPLITUDES = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0)


def write_chapter_2(results: ReportResults) -> ReportPart:
    """The page: loops, the slip joint printed and exact, and what a fixed equivalent coefficient is worth."""
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
    symbols = {"omega": "ω", "omega_closed_form": "ω in closed form", "xi": "ξ", "force": "modal force"}
    energy_headings = {"amplitude": "A / A₁", "printed_over_exact": "printed / exact",
                       "corrected_equivalent": "C₃q̇², equal energy", "equivalent_percent": "its error, %"}  # fmt: skip
    shown = {
        "slip_equivalent": chapter_table(2, "slip_equivalent", at, energy_headings),
        "lumped_masses": chapter_table(2, "lumped_masses", modes, symbols),
    }
    tables = {"lumped_masses": modes, "hysteresis_loops": loops, "slip_equivalent": energies}
    figures = collect_figures(studies)
    return write_chapter(2, results.tables, values=values, figures=figures, shown=shown, tables=tables)


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
