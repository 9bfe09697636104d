"""Chapter II in the report: hysteresis loops of every force (2.4), slip and its velocity-squared equivalent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.report.words import format_joined, number
from damping_reed1970.chapter_2 import REFERENCE, equal_amplitudes
from damping_reed1970.chapter_2.figures import chapter_2_figures
from damping_reed1970.chapter_2.masses import JOINTS, tabulate_lumped_masses
from damping_reed1970.common import ReportPart, chapter_table
from damping_reed1970.prose import Chapter, write_chapter
from damping_reed1970.studies import ReportResults

#: Amplitudes over the slip limit at which the energies are tabled.
AMPLITUDES = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0)


def chapter_2(results: ReportResults) -> ReportPart:
    """The page: loops, the slip joint printed and exact, and what a fixed equivalent coefficient is worth."""
    found = results.studies
    loops, energies, modes = found.loops.areas, found.slip.energies, tabulate_lumped_masses()
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
    figures = chapter_2_figures(found.loops, found.slip)
    chapter = Chapter(2, "Chapter II: hysteresis and slip", values, figures, shown, tables, results.tables)
    return write_chapter(chapter, Path(__file__).with_suffix(".txt"))


def tabulate_energies_at(energies: pd.DataFrame) -> pd.DataFrame:
    """Energies interpolated at ``AMPLITUDES``, with what the printed formula and the equivalent make of the exact."""
    A = np.array(AMPLITUDES)
    names = ("exact", "printed", "corrected_equivalent")
    columns = {name: np.interp(A, energies["amplitude"], energies[name]) for name in names}
    found = pd.DataFrame({"amplitude": A, **columns})
    return found.assign(
        printed_over_exact=found["printed"] / found["exact"],
        equivalent_percent=100.0 * (found["corrected_equivalent"] / found["exact"] - 1.0),
    )[["amplitude", "exact", "printed", "printed_over_exact", "corrected_equivalent", "equivalent_percent"]]


def _describe_times(amplitudes: FloatArray) -> str:
    """``1.24 and 2.00 A₁``."""
    return f"{format_joined(number(A) for A in amplitudes)} A₁"
