"""Chapter II in the report: hysteresis loops of every force (2.4), slip and its velocity-squared equivalent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.linalg import LinAlgError, eigh

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.report.words import format_joined, number
from damping_reed1970.chapter_2 import REFERENCE, equal_amplitudes
from damping_reed1970.chapter_2.figures import list_chapter_2_figures
from damping_reed1970.common import Chapter, ReportPart, chapter_table, write_chapter
from damping_reed1970.studies import ReportResults


@dataclass(frozen=True)
class NormalModes:
    """Modes of [m] x'' + [k] x = F in order of frequency.

    Attributes:
        omega: natural frequencies, rad/s, (modes,); zero for rigid-body modes.
        shapes: mode shapes phi, (nodes, modes), each 1 at the reference node.
        masses: generalized masses phi^T m phi, (modes,); omega^2 times these are the stiffnesses (Eq 2.2.2).
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

    Raises:
        InputError: matrices of the wrong shape, not symmetric, or a mass matrix that is not positive definite.
        AnalysisError: a mode does not move the reference node, so that its shape cannot be scaled there.
    """
    m = np.diag(mass) if np.ndim(mass) == 1 else np.asarray(mass, dtype=float)
    k = np.asarray(stiffness, dtype=float)
    _check(m, k, reference)
    try:
        squared, vectors = eigh(k, m)
    except LinAlgError as error:
        raise InputError("mass matrix is not positive definite", expected="positive masses") from error
    omega = np.sqrt(np.maximum(squared, 0.0))  # rounding leaves rigid-body modes slightly negative
    at_reference = vectors[reference]
    still = np.flatnonzero(np.abs(at_reference) < 1e-10 * np.max(np.abs(vectors), axis=0))
    if still.size:
        raise AnalysisError(f"mode {still[0] + 1} does not move node {reference}: choose another reference node")
    return NormalModes(omega=omega, shapes=vectors / at_reference, masses=1.0 / at_reference**2)


def modal_force(modes: NormalModes, node: int, force: float) -> FloatArray:
    """F_e,j = phi_rj F of a load at node r (Eq 2.2.3), (modes,)."""
    return modes.shapes[node] * force


def subsystem_damping(modes: NormalModes, dampers: Sequence[Damper]) -> dict[str, FloatArray]:
    """What each sub-system adds to the modal coefficients C_j, (modes,) each; they add to diag(phi^T c phi)."""
    shares: dict[str, FloatArray] = {}
    for damper in dampers:
        stroke = _direction(damper, modes.shapes.shape[0]) @ modes.shapes
        shares[damper.subsystem] = shares.get(damper.subsystem, np.zeros(modes.omega.size)) + (
            damper.coefficient * stroke**2
        )
    return shares


def _direction(damper: Damper, nodes: int) -> FloatArray:
    """Relative motion that the damper sees: +1 at its node, -1 at the other."""
    direction = np.zeros(nodes)
    direction[damper.node] = 1.0
    if damper.other is not None:
        direction[damper.other] -= 1.0
    return direction


def _check(m: FloatArray, k: FloatArray, reference: int) -> None:
    if m.ndim != 2 or m.shape[0] != m.shape[1] or m.shape != k.shape:
        raise InputError(f"mass {m.shape} and stiffness {k.shape} do not match", expected="two n by n matrices")
    for name, matrix in (("mass", m), ("stiffness", k)):
        if not np.all(np.isfinite(matrix)) or not np.allclose(
            matrix, matrix.T, rtol=0.0, atol=1e-10 * np.abs(matrix).max()
        ):
            raise InputError(f"{name} matrix is not symmetric and finite")
    if not 0 <= reference < m.shape[0]:
        raise InputError(f"reference node {reference} is not among {m.shape[0]} nodes")


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
    at, last = tabulate_energies_at(energies), modes.iloc[-1]
    most = max(JOINTS, key=lambda name: float(last[name]))
    values = {
        "loops": len(loops),
        "loop_difference": 100.0 * loops["relative_difference"].abs().max(),
        "low": at.iloc[1],
        "high": at.iloc[-1],
        "right": _describe_times(equal_amplitudes(energies, "printed")),
        "equal": _describe_times(equal_amplitudes(energies, "corrected_equivalent")),
        "reference": REFERENCE,
        "masses": len(modes),
        "mode_difference": (modes["omega"] - modes["omega_closed_form"]).abs().max(),
        "xi": last["xi"],
        "largest_share": 100.0 * last[most] / last["C"],
        "largest_joint": most,
    }
    symbols = {"omega": "ω", "omega_closed_form": "ω in closed form", "xi": "ξ", "force": "modal force"}
    energy_headings = {"amplitude": "A / A₁", "printed_over_exact": "printed / exact",
                       "corrected_equivalent": "C₃q̇², equal energy", "equivalent_percent": "its error, %"}  # fmt: skip
    shown = {
        "slip_equivalent": chapter_table(2, "slip_equivalent", at, energy_headings),
        "hysteresis_loops": chapter_table(2, "hysteresis_loops", loops),
        "lumped_masses": chapter_table(2, "lumped_masses", modes, symbols),
    }
    tables = {"lumped_masses": modes, "hysteresis_loops": loops, "slip_equivalent": energies}
    figures = list_chapter_2_figures(studies.loops, studies.slip)
    chapter = Chapter(2, "Chapter II: hysteresis and slip", values, figures, shown, tables, results.tables)
    return write_chapter(chapter, Path(__file__).with_suffix(".txt"))


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


def _describe_times(amplitudes: FloatArray) -> str:
    """``1.24 and 2.00 A₁``."""
    return f"{format_joined(number(A) for A in amplitudes)} A₁"
