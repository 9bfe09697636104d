"""Chapter III: every figure with its number, title, drawing, and words whose numbers are those of the results."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from damping.arrays import FloatArray
from damping.report.words import format_counted, format_joined, format_points_text
from damping_reed1970.chapter_3 import PLANES, figures
from damping_reed1970.chapter_3.planar_fits import PlanarBand
from damping_reed1970.chapter_3.study import Chapter3
from damping_reed1970.common import ChapterFigure

#: Rise of a peak above what is around it, over the largest value: that of a median of draws is rough by less.
_RISE = 0.002


def peaks(values: FloatArray) -> int:
    """Number of peaks that rise above what is around them."""
    return len(find_peaks(values, prominence=_RISE * values.max())[0])


def describe_two_peaks(measured: pd.DataFrame, tail: PlanarBand) -> str:
    """Peaks of the tail displacement: of the printed points, and of the fit of two planes."""
    points, curve = (peaks(np.asarray(values)) for values in (measured["tail"], tail.amplitude[0]))
    return (
        f"{len(measured)} printed points with {format_counted(points, 'peak')}, and the planar oscillator fitted to "
        "the tail (motion in phase with the force fitted too) with its 90 per cent band: two planes at an angle give "
        f"{format_counted(curve, 'peak')}."
    )


def describe_sines_beside_the_fit(measured: pd.DataFrame, tail: PlanarBand) -> str:
    """Mean distance of the printed sines from the fit, before and after the frequency at which the fit reaches 1."""
    fitted = np.sin(tail.phase[0])
    off = np.sin(measured["tail_phase"]) - np.interp(measured["omega"], tail.omega, fitted)
    before = measured["omega"] < tail.omega[fitted.argmax()]
    left, right = float(off[before].mean()), float(off[~before].mean())
    text = (
        f"Printed points and the same fit; the printed sines are {_describe_side(left)} on average before "
        f"resonance and {_describe_side(right)} after it"
    )
    # a phase too small: its sine is too small below pi/2 and too large above
    return text + (", as if all phases had been read too small." if left < 0.0 < right else ".")


def describe_modal_points(measured: pd.DataFrame, mode: PlanarBand) -> str:
    """How far computed amplitudes, and those of the fit, are from the printed ones."""
    printed = measured["A_2_printed"].to_numpy(float)
    computed = float(np.abs(measured["A_2"] / printed - 1.0).max())
    fitted = np.interp(measured["omega"], mode.omega, mode.amplitude[0])
    rms = float(np.sqrt(np.mean((fitted - printed) ** 2)))
    return (
        f"Printed and computed amplitudes agree within {100.0 * computed:.2g} per cent; the fitted planar oscillator "
        f"is {rms:.2g} in (rms) from them."
    )


def describe_without_a_root(measured: pd.DataFrame) -> str:
    """Points at which no damping factor balances the energy."""
    return format_points_text(measured.loc[measured["pitch"].isna(), "point"])


def change_by_conditioning(effect: pd.DataFrame) -> tuple[float, float]:
    """Per cent by which all steps together change the amplitude: largest, and at the largest amplitude.

    Args:
        effect: ``step, amplitude`` after each step, rows of a step together and in one order.
    """
    first, last = (effect.loc[effect["step"] == s, "amplitude"].to_numpy() for s in effect["step"].iloc[[0, -1]])
    change = 100.0 * np.abs(last / first - 1.0)
    return float(change.max()), float(change[first.argmax()])


def describe_effect_of_steps(effect: pd.DataFrame) -> str:
    """What the steps change."""
    largest, at_peak = change_by_conditioning(effect)
    return (
        "Amplitude after each step, motion in phase with the force that was removed, and how amplitude and phase "
        f"changed: the amplitude by up to {largest:.0f} per cent, {at_peak:.1g} per cent at its peak."
    )


def describe_roots_taken(branches: pd.DataFrame) -> str:
    """Which root the report took at which points."""
    took = [
        f"the {branch} one at {format_points_text(branches.loc[branches['taken'] == branch, 'point'])}"
        for branch in ("low", "high")
    ]
    none = branches.loc[branches["roots"] == 0, "point"]
    text = (
        "Low and high root of the energy balance at each point with the printed factor: the report took "
        f"{format_joined(took)}"
    )
    return f"{text}; at {format_points_text(none)} there is none." if len(none) else f"{text}."


def describe_yaw_predicted(yaw: pd.DataFrame) -> str:
    """Distance of each prediction from the measured yaw motion."""
    names = [str(name) for name in yaw.columns.drop(["point", "omega", "measured"])]
    rms = [float(np.sqrt(np.mean((yaw[name] - yaw["measured"]) ** 2))) for name in names]
    said = format_joined(
        f"{value:.2g} in ({name.replace(',', ' and')})" for name, value in zip(names, rms, strict=True)
    )
    return (
        "Yaw motion that fits to the pitch motion predict, beside the measured yaw motion, which no fit has seen: rms "
        f"distance {said}."
    )


def _describe_side(off: float) -> str:
    return f"{abs(off):.2f} {'lower' if off < 0.0 else 'higher'}"


def list_chapter_3_figures(result: Chapter3) -> list[ChapterFigure]:
    """Every figure of the chapter with its number, title, words and drawing."""
    return [*_list_of_the_report(result), *_list_beyond(result)]


def _list_of_the_report(result: Chapter3) -> list[ChapterFigure]:
    measured, tail, mode = result.measured, result.bands["tail"], result.bands["A2"]
    omega = measured["omega"].to_numpy(float)
    displacement = (PLANES.phi * tail.amplitude[0], PLANES.phi * tail.amplitude[1], PLANES.phi * tail.amplitude[2])
    return [
        ChapterFigure(
            "tail-displacement", "3.2", "Tail displacement against frequency",
            describe_two_peaks(measured, tail),
            lambda: figures.draw_tail_displacement(omega, measured["tail"].to_numpy(float), tail.omega, displacement),
        ),
        ChapterFigure(
            "tail-phase-sine", "3.3", "Sine of the tail phase angle against frequency",
            describe_sines_beside_the_fit(measured, tail),
            lambda: figures.draw_tail_phase_sine(omega, measured["tail_phase"].to_numpy(float), tail.omega, tail.phase),
        ),
        ChapterFigure(
            "phase-angles", "3.5", "Phase angles of tail and second mode",
            "Printed phase angles of the tail and the mode, those computed by the conditioning chain, and the planar "
            "oscillator fitted to the mode.",
            lambda: figures.draw_phase_angles(measured, mode.omega, mode.phase),
        ),
        ChapterFigure(
            "modal-amplitude", "3.6", "Amplitude of the second mode against frequency",
            describe_modal_points(measured, mode),
            lambda: figures.draw_modal_amplitude(measured, mode.omega, mode.amplitude),
        ),
        ChapterFigure(
            "input-energy", "3.9", "Energy input per cycle against frequency",
            "Printed and computed energies, the two rows that the report adjusted, and what one damping factor for all "
            "points loses.",
            lambda: figures.draw_input_energy(measured, result.corrected, result.curves),
        ),
        ChapterFigure(
            "principal-amplitudes", "3.10", "Amplitudes in the principal planes",
            "Printed values, those at the nearest root of the energy balance (none at "
            f"{describe_without_a_root(measured)}), and curves with one damping factor: planes fitted, and "
            "planes of the report.",
            lambda: figures.draw_principal_amplitudes(measured, result.corrected, result.curves),
        ),
    ]  # fmt: skip


def _list_beyond(result: Chapter3) -> list[ChapterFigure]:
    measured, mode = result.measured, result.bands["A2"]
    return [
        ChapterFigure(
            "conditioning-effect", "", "What each step of the conditioning removed",
            describe_effect_of_steps(result.effect),
            lambda: figures.draw_conditioning_effect(result.effect, result.tables["removed"]),
        ),
        ChapterFigure(
            "planar-fit", "", "Planar oscillator fitted to amplitude and phase",
            "Measured modal amplitude and phase with the fit of all five parameters and its 90 per cent band, the fit "
            "with the report's angle and mass, and the fit with motion in phase and a common lag.",
            lambda: figures.draw_planar_overlay(measured, mode.omega, mode.amplitude, mode.phase, result.curves),
        ),
        ChapterFigure(
            "planar-posterior", "", "Posterior of the planar oscillator",
            "Both principal frequencies, damping factor, angle and mass, alone and in pairs, with their priors.",
            lambda: figures.draw_planar_posterior(result.draws, result.prior),
        ),
        ChapterFigure(
            "damping-roots", "", "All damping factors that balance the energy",
            describe_roots_taken(result.tables["branches"]),
            lambda: figures.draw_damping_roots(
                result.tables["branches"], np.quantile(result.draws["xi"], [0.05, 0.5, 0.95]).tolist()
            ),
        ),
        ChapterFigure(
            "yaw-amplitude", "", "Yaw amplitude, measured and predicted",
            describe_yaw_predicted(result.tables["yaw"]),
            lambda: figures.draw_yaw_amplitude(result.tables["yaw"]),
        ),
    ]  # fmt: skip
