"""Chapter II in the report: hysteresis loops of every force (2.4), slip and its velocity-squared equivalent."""

from __future__ import annotations

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.report.page import Text
from damping.report.words import count, joined, number, percent, signed
from damping_reed1970.chapter_2 import REFERENCE, equal_amplitudes
from damping_reed1970.chapter_2.figures import chapter_2_figures
from damping_reed1970.chapter_2.masses import JOINTS, lumped_masses
from damping_reed1970.common import ReportPart, agreement_text, figure, folded, of_chapter, part, table
from damping_reed1970.studies import ReportResults

#: Amplitudes over the slip limit at which the energies are tabled.
AMPLITUDES = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0)


def chapter_2(results: ReportResults) -> ReportPart:
    """The part: loops, the slip joint printed and exact, and what a fixed equivalent coefficient is worth."""
    found = results.studies
    loops, energies = found.loops.areas, found.slip.energies
    figures = {one.name: one for one in chapter_2_figures(found.loops, found.slip)}
    at, modes = energies_at(energies), lumped_masses()
    blocks = [
        Text(
            "Section 2.4 gives each damping mechanism a force whose loop against displacement encloses the energy "
            "lost per cycle (Tables 2.I and 2.II), and stands in for a slip joint by a velocity-squared force of equal "
            "energy (Eqs. 2.4.2 to 2.4.4)."
        ),
        Text(
            f"{count(len(loops), 'loop')} are traced here from the forces themselves. The area each one encloses and "
            "the closed form of its energy differ by at most "
            f"{number(100.0 * loops['relative_difference'].abs().max(), 2)} per cent. "
            f"{agreement_text(of_chapter(results.tables['reproduction'], 2))}"
        ),
        figure(figures, "hysteresis-loops", 2),
        Text(" ".join(_slip(energies, at))),
        figure(figures, "slip-equivalent", 2),
        figure(figures, "slip-energy", 2),
        table(
            2,
            "slip_equivalent",
            at,
            "Energy per cycle of a slip joint at amplitudes over the slip limit A₁, in units of K A₁² (K₁ = K/4): "
            "exact, "
            f"as printed (2.4.3), and by velocity-squared damping with its coefficient fixed at {REFERENCE:g} A₁.",
            {
                "amplitude": "A / A₁",
                "printed_over_exact": "printed / exact",
                "corrected_equivalent": "C₃q̇², equal energy",
                "equivalent_percent": "its error, %",
            },
        ),
        folded(
            f"Areas of all {len(loops)} loops",
            table(
                2, "hysteresis_loops", loops, "Area of each loop by its corners and energy per cycle in closed form."
            ),
        ),
        Text(_modes(modes)),
        folded(
            "The example of section 2.2 in numbers",
            table(
                2,
                "lumped_masses",
                modes,
                "Four equal masses between equal springs, free ends, driven at the fourth (m = k = F = 1).",
                {"omega": "ω", "omega_closed_form": "ω in closed form", "xi": "ξ", "force": "modal force"},
            ),
        ),
    ]
    tables = {"lumped_masses": modes, "hysteresis_loops": loops, "slip_equivalent": energies}
    return part(2, "Chapter II: hysteresis and slip", blocks, tables)


def energies_at(energies: pd.DataFrame) -> pd.DataFrame:
    """Energies interpolated at ``AMPLITUDES``, with what the printed formula and the equivalent make of the exact."""
    A = np.array(AMPLITUDES)
    columns = {name: np.interp(A, energies["amplitude"], energies[name]) for name in _COLUMNS}
    found = pd.DataFrame({"amplitude": A, **columns})
    return found.assign(
        printed_over_exact=found["printed"] / found["exact"],
        equivalent_percent=100.0 * (found["corrected_equivalent"] / found["exact"] - 1.0),
    )[["amplitude", "exact", "printed", "printed_over_exact", "corrected_equivalent", "equivalent_percent"]]


_COLUMNS = ("exact", "printed", "corrected_equivalent")


def _modes(modes: pd.DataFrame) -> str:
    """Lumped masses to modes, and modal damping from sub-systems."""
    off = (modes["omega"] - modes["omega_closed_form"]).abs().max()
    last = modes.iloc[-1]
    most = max(JOINTS, key=lambda name: last[name])
    return (
        "Sections 2.2 and 2.5, from masses and springs to modes and from dampers of sub-systems to modal "
        f"coefficients, are given without numbers. With numbers, the report's example of {len(modes)} lumped masses "
        f"has its closed-form frequencies to {number(off, 1)}, and the dampers of its joints add up to ξ = "
        f"{number(last['xi'])} of the highest mode, {percent(100.0 * last[most] / last['C'])} per cent of it from "
        f"{most}."
    )


def _slip(energies: pd.DataFrame, at: pd.DataFrame) -> list[str]:
    """What the slip joint shows."""
    right, equal = (equal_amplitudes(energies, name) for name in ("printed", "corrected_equivalent"))
    low, high = at.iloc[1], at.iloc[-1]
    return [
        "The energy printed for the slip joint grows like the square of amplitude, the area of its loop only in "
        f"proportion (erratum E243): printed over exact is {number(low['printed_over_exact'])} at "
        f"{low['amplitude']:g} A₁, 1 at {_times(right)} and {number(high['printed_over_exact'])} at "
        f"{high['amplitude']:g} A₁.",
        f"The equivalence itself holds at single amplitudes only: with its coefficient fixed at {REFERENCE:g} A₁, "
        f"velocity-squared damping has the energy of the joint at {_times(equal)} and is off by "
        f"{signed(low['equivalent_percent'])} at {low['amplitude']:g} A₁ and by "
        f"{signed(high['equivalent_percent'])} at {high['amplitude']:g} A₁.",
        "So slip is kept here as a force of its own, with its exact bilinear loop, and never extrapolated as "
        "velocity-squared damping.",
    ]


def _times(amplitudes: FloatArray) -> str:
    """``1.24 and 2.00 A₁``."""
    return f"{joined(number(A) for A in amplitudes)} A₁"
