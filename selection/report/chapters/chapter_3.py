"""Chapter III in the report: conditioning (3.1), the mode in two planes, damping factors with all their roots (3.2)."""

from __future__ import annotations

import pandas as pd

from selection.plots.chapter_3_words import change_by_conditioning
from selection.plots.words import points_text
from selection.report.chapters.common import Figures, agreement_text, figure, folded, of_chapter, part, row, table
from selection.report.chapters.two_planes import plane_blocks
from selection.report.page import Block, Heading, Text
from selection.report.part import Part
from selection.report.results import ChapterResults
from selection.report.words import between, count, number, percent
from selection.reproduction.chapter_3_study import Chapter3


def chapter_3(results: ChapterResults, figures: Figures) -> Part:
    """The part: accelerometers to modal motion, planar coupling fitted, and every damping factor that balances."""
    found = results.chapter_3
    blocks: list[Block] = [
        Text(
            "Configuration I was swept once, over its second mode. Section 3.1 turns tail and tip accelerations into "
            "modal amplitude and phase and removes rigid-body rotation and adjacent modes. It derives the "
            "planar-coupled oscillator that explains the warped curve left over, and stops there: finding its "
            "parameters is “not within the scope of this study”. Section 3.2 assumes the two planes and finds a "
            "damping factor for each point by trial and error."
        ),
        Text(agreement_text(of_chapter(results.tables["reproduction"], 3))),
        *_conditioning(found, figures),
        *plane_blocks(found, figures),
        *_roots(found, figures),
    ]
    return part(3, "Chapter III: one mode in two planes", blocks, found.tables)


def _conditioning(found: Chapter3, figures: Figures) -> list[Block]:
    chain = found.tables["conditioned"]
    amplitude = 100.0 * (chain["A_2"] / chain["A_2_printed"] - 1.0).abs().max()
    phase = (chain["phi_2"] - chain["phi_2_printed"]).abs().max()
    largest, at_peak = change_by_conditioning(found.effect)
    removed = found.tables["removed"].drop(columns=["point", "omega"])
    total = removed.sum(axis=1).abs()
    return [
        Heading("3.1: from accelerometers to the second mode"),
        Text(
            f"One chain of {count(len(found.steps), 'step')} from the raw table gives every modal amplitude of Table "
            f"3.III within {number(amplitude, 2)} per cent and every phase within {number(phase, 2)} rad. What it "
            f"takes away, {between(total.min(), total.max(), 'inches', 2)} in phase with the force, changes the "
            f"amplitude by up to {percent(largest)} per cent, and by {percent(at_peak)} per cent at its peak"
            + (": conditioning moves the skirts, not the resonance." if at_peak < 0.1 * largest else ".")
        ),
        figure(figures, "tail-displacement", 3),
        figure(figures, "tail-phase-sine", 3),
        figure(figures, "phase-angles", 3),
        figure(figures, "modal-amplitude", 3),
        figure(figures, "conditioning-effect", 3),
        folded(
            "Tables 3.I and 3.III, printed and computed, and what each step removed",
            table(
                3,
                "conditioned",
                chain,
                "Displacements, correction, modal phase (rad) and amplitude (in) by point: printed (corrected where an "
                "erratum is known) and computed from the raw table.",
            ),
            table(
                3, "removed", found.tables["removed"], "Motion in phase with the force that was removed, modal inches."
            ),
        ),
    ]


def _roots(found: Chapter3, figures: Figures) -> list[Block]:
    branches, fitted = found.tables["branches"], found.tables["branches_fitted"]
    shown = ["point", "omega", "energy", "largest_energy", "roots", "xi_low", "xi_high", "xi_printed", "taken"]
    headings = {"omega": "ω, rad/s", "energy": "energy in, in-lb", "largest_energy": "largest that can be lost",
                "xi_low": "low root ξ", "xi_high": "high root ξ", "xi_printed": "printed ξ"}  # fmt: skip
    return [
        Heading("3.2: the damping factor has two values, or none"),
        Text(" ".join(_two_roots(branches, fitted))),
        figure(figures, "damping-roots", 3),
        Text(_means(found.tables["branch_means"], branches)),
        table(
            3,
            "branch_means",
            found.tables["branch_means"],
            "Mean damping factor and mean linear coefficient C₁ (Eq. 3.2.18, lb s/in) on each branch.",
            {"C_1": "C₁", "mean_xi": "mean ξ"},
        ),
        table(3, "branches", branches[shown], "All roots of Eq. 3.2.15, and which the report took.", headings),
        figure(figures, "input-energy", 3),
        figure(figures, "principal-amplitudes", 3),
        folded(
            "The same with the planes that fit, and the energies of both branches",
            table(
                3, "branches_fitted", fitted[shown], "Roots of Eq. 3.2.15 with the planes of the free fit.", headings
            ),
            table(
                3,
                "branches",
                branches[
                    [
                        "point",
                        "energy_printed",
                        *(c for c in map(str, branches) if c.startswith(("pitch", "yaw", "A_"))),
                    ]
                ],
                "Energy lost in each plane, in-lb, and pitch amplitude, in, on each branch.",
            ),
        ),
    ]


def _two_roots(branches: pd.DataFrame, fitted: pd.DataFrame) -> list[str]:
    """How many roots there are, which were taken, and what other planes give."""
    two, none = branches[branches["roots"] == 2], branches[branches["roots"] == 0]
    taken = {name: points_text(branches.loc[branches["taken"] == name, "point"]) for name in ("low", "high")}
    ratio = (two["xi_high"] / two["xi_low"]).max()
    return [
        "The energy lost rises with the damping factor to a maximum and falls again, so an energy below the maximum "
        f"is balanced by two damping factors and one above it by none. Eq. 3.2.15 has two roots at {len(two)} of "
        f"{len(branches)} points, up to {number(ratio, 2)} times apart, and none at {points_text(none['point'])} "
        "(erratum "
        f"E3IV-1). Trial and error took the low root at {taken['low']} and the high one at {taken['high']}.",
        "With the planes that fit amplitude and phase instead of those assumed there is none at "
        f"{points_text(fitted.loc[fitted['roots'] == 0, 'point'])}.",
    ]


def _means(means: pd.DataFrame, branches: pd.DataFrame) -> str:
    """What the mean coefficient is worth."""
    printed = row(means, choice="as printed")
    low, high = row(means, choice="every low root"), row(means, choice="every high root (below .05, else low)")
    near = branches["xi_printed"].min(), branches["xi_printed"].max()
    return (
        f"The mean coefficient {number(printed['C_1'])} lb s/in (3.2.18) and the growth of ξ towards resonance "
        f"(printed {between(*near)}) rest on that choice: every low root gives {number(low['C_1'])}, every high root "
        f"{number(high['C_1'])}."
    )
