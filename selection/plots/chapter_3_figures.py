"""Every figure of chapter III with its number in the source report, title and words."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from selection.plots import chapter_3, chapter_3_planar
from selection.plots import chapter_3_words as words
from selection.reproduction.chapter_3 import PLANES
from selection.reproduction.chapter_3_study import Chapter3

#: Name, number in the source report (empty: it goes further than the report), title, description, drawing.
Row = tuple[str, str, str, str, Callable[[], Figure]]


def chapter_3_figures(result: Chapter3) -> list[Row]:
    """All figures in the order of the chapter, as the fields of ``chapter_figures.ChapterFigure``."""
    return [*_of_the_report(result), *_beyond(result)]


def _of_the_report(result: Chapter3) -> list[Row]:
    measured, tail, mode = result.measured, result.bands["tail"], result.bands["A2"]
    omega = measured["omega"].to_numpy(float)
    displacement = (PLANES.phi * tail.amplitude[0], PLANES.phi * tail.amplitude[1], PLANES.phi * tail.amplitude[2])
    return [
        (
            "tail-displacement", "3.2", "Tail displacement against frequency",
            words.two_peaks(measured, tail),
            lambda: chapter_3.tail_displacement(omega, measured["tail"].to_numpy(float), tail.omega, displacement),
        ),
        (
            "tail-phase-sine", "3.3", "Sine of the tail phase angle against frequency",
            words.sines_beside_the_fit(measured, tail),
            lambda: chapter_3.tail_phase_sine(omega, measured["tail_phase"].to_numpy(float), tail.omega, tail.phase),
        ),
        (
            "phase-angles", "3.5", "Phase angles of tail and second mode",
            "Printed phase angles of the tail and the mode, those computed by the conditioning chain, and the planar "
            "oscillator fitted to the mode.",
            lambda: chapter_3.phase_angles(measured, mode.omega, mode.phase),
        ),
        (
            "modal-amplitude", "3.6", "Amplitude of the second mode against frequency",
            words.modal_points(measured, mode),
            lambda: chapter_3.modal_amplitude(measured, mode.omega, mode.amplitude),
        ),
        (
            "input-energy", "3.9", "Energy input per cycle against frequency",
            "Printed and computed energies, the two rows that the report adjusted, and what one damping factor for all "
            "points loses.",
            lambda: chapter_3.input_energy(measured, result.corrected, result.curves),
        ),
        (
            "principal-amplitudes", "3.10", "Amplitudes in the principal planes",
            "Printed values, those at the nearest root of the energy balance (none at "
            f"{words.without_a_root(measured)}), and curves with one damping factor: planes fitted, and planes of the "
            "report.",
            lambda: chapter_3.principal_amplitudes(measured, result.corrected, result.curves),
        ),
    ]  # fmt: skip


def _beyond(result: Chapter3) -> list[Row]:
    measured, mode = result.measured, result.bands["A2"]
    return [
        (
            "conditioning-effect", "", "What each step of the conditioning removed",
            words.effect_of_steps(result.effect),
            lambda: chapter_3.conditioning_effect(result.effect, result.tables["removed"]),
        ),
        (
            "planar-fit", "", "Planar oscillator fitted to amplitude and phase",
            "Measured modal amplitude and phase with the fit of all five parameters and its 90 per cent band, the fit "
            "with the report's angle and mass, and the fit with motion in phase and a common lag.",
            lambda: chapter_3_planar.planar_overlay(measured, mode.omega, mode.amplitude, mode.phase, result.curves),
        ),
        (
            "planar-posterior", "", "Posterior of the planar oscillator",
            "Both principal frequencies, damping factor, angle and mass, alone and in pairs, with their priors.",
            lambda: chapter_3_planar.planar_posterior(result.draws, result.prior),
        ),
        (
            "damping-roots", "", "All damping factors that balance the energy",
            words.roots_taken(result.tables["branches"]),
            lambda: chapter_3_planar.damping_roots(
                result.tables["branches"], np.quantile(result.draws["xi"], [0.05, 0.5, 0.95]).tolist()
            ),
        ),
        (
            "yaw-amplitude", "", "Yaw amplitude, measured and predicted",
            words.yaw_predicted(result.tables["yaw"]),
            lambda: chapter_3_planar.yaw_amplitude(result.tables["yaw"]),
        ),
    ]  # fmt: skip
