"""Chapter III as a whole: conditioning, planar coupling, damping factors. Tables, and what the figures draw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, Floats
from damping.records.keys import read_toml
from damping.records.reading import read_table
from damping.signals import PrincipalPlanes, input_energy, nearest_root, plane_motion
from damping.signals.chain import ConditioningStep, condition
from damping.signals.description import Description
from damping_reed1970 import columns, data_folder, load_table
from damping_reed1970.chapter_3 import (
    PLANES,
    find_roots,
    pitch_response,
    tabulate_branch,
    tabulate_mean,
    tabulate_points,
)
from damping_reed1970.chapter_3.implications import (
    Fits,
    fit_table,
    planar_fits,
    tabulate_energy_split,
    tabulate_implications,
    tabulate_yaw,
)
from damping_reed1970.chapter_3.planar_fit import PlanarFit, phasors
from damping_reed1970.chapter_3.planar_posterior import (
    SAMPLED,
    PlanarBand,
    Posteriors,
    fit_band,
    planar_posteriors,
    prior_draws,
    tabulate_evidence,
    tabulate_posterior,
)

SEED = 1970
#: Mean damping factor of the second mode (section 3.2).
MEAN_XI = 0.005


@dataclass(frozen=True)
class Chapter3:
    """Results of chapter III.

    Attributes:
        steps: conditioning of the test of Configuration I, in order.
        tables: for people, by name: ``conditioned`` (Tables 3.I and 3.III, printed and computed), ``removed`` (by
            point), ``planar_fits``, ``planar_posteriors``, ``planar_evidence``, ``implications``, ``yaw``,
            ``energy_split``, ``branches``, ``branches_fitted`` (Eq. 3.2.15 with the planes of the free fit),
            ``branch_means``.
        measured: by point, what figures draw beside the computed: see ``measured_table``.
        corrected: rows 6+ and 9+ of Table 3.IV: ``point, omega, energy, pitch, yaw``.
        effect: amplitude and phase after each step from the mode factor on: ``step, omega, amplitude, phase``.
        curves: over frequency with one damping for all points: see ``fitted_curves``.
        fits, posteriors: of the planar oscillator, as in ``chapter_3_planar`` and ``chapter_3_posterior``.
        bands: of the sampled posteriors by data. draws, prior: of the posterior of A2 and its prior, by parameter.
    """

    steps: tuple[ConditioningStep, ...]
    tables: Mapping[str, pd.DataFrame]
    measured: pd.DataFrame
    corrected: pd.DataFrame
    effect: pd.DataFrame
    curves: pd.DataFrame
    fits: Fits
    posteriors: Posteriors
    bands: Mapping[str, PlanarBand]
    draws: Mapping[str, FloatArray]
    prior: Mapping[str, FloatArray]


def chapter_3_results(seed: int = SEED) -> Chapter3:
    """Everything of chapter III, posteriors included; some seconds."""
    steps = saturn_steps()
    fits, posteriors = planar_fits(), planar_posteriors(seed)
    free = fits["A2", "constant", "free"]
    main = posteriors[SAMPLED[0]]
    tables = {
        "conditioned": tabulate_conditioned(steps),
        "removed": tabulate_removed(steps),
        "planar_fits": fit_table(fits),
        "planar_posteriors": tabulate_posterior(posteriors),
        "planar_evidence": tabulate_evidence(posteriors),
        "yaw": tabulate_yaw(fits),
        "energy_split": tabulate_energy_split(fits),
        "branches": tabulate_branch(),
        "branches_fitted": tabulate_branch(fitted_planes(free)),
        "branch_means": tabulate_mean(),
        "implications": tabulate_implications(fits, posteriors),
    }
    bands = {name: fit_band(phasors(name), posteriors[name, variant]) for name, variant in SAMPLED}
    return Chapter3(
        steps=steps,
        tables=tables,
        measured=tabulate_measured(steps),
        corrected=tabulate_corrected_rows(),
        effect=tabulate_effect(steps),
        curves=tabulate_fitted_curves(fits),
        fits=fits,
        posteriors=posteriors,
        bands=bands,
        draws=main.parameters,
        prior=prior_draws(main),
    )


def saturn_steps() -> tuple[ConditioningStep, ...]:
    """The chain on the raw table of Configuration I, as ``damping condition`` runs it."""
    place = data_folder() / "saturn-v"
    description = Description.model_validate(read_toml(place / "condition.toml").values)
    raw = read_table(
        place / "raw" / "config-1-mode-2.csv", required=description.columns, text_columns=description.raw.keep
    )
    return condition(raw, description)


def tabulate_conditioned(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """Tables 3.I and 3.III by point: ``NAME_printed`` (corrected where an erratum is known) and ``NAME``, computed.

    Displacements of the tip in pitch and yaw, tail yaw, total correction C_t2, modal phase and amplitude.
    """
    by_name = {step.name: step.after for step in steps}
    table_i, table_iii = load_table("3_I", "corrected"), load_table("3_III", "corrected")
    moved, modal = by_name["yaw from pitch"], by_name["record"]
    correction = -tabulate_removed(steps)[["rigid body", "mode 1", "mode 3", "mode 4"]].sum(axis=1)
    return pd.DataFrame(
        {
            "point": table_i["point"],
            "tip_pitch_printed": table_i["tip_pitch_disp_in"],
            "tip_pitch": moved["tip pitch"],
            "tip_yaw_printed": table_i["tip_yaw_disp_in"],
            "tip_yaw": moved["tip yaw"],
            "tail_yaw_e2_printed": table_i["tail_yaw_disp_in_e2"],
            "tail_yaw_e2": 100.0 * moved["tail yaw"],
            "C_t2_printed": table_iii["correction_Ct2_in"],
            "C_t2": correction,
            "phi_2_printed": table_iii["modal_phase_rad"],
            "phi_2": modal["phase"],
            "A_2_printed": table_iii["modal_amplitude_A2_in"],
            "A_2": modal["amplitude"],
        }
    )


def tabulate_removed(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """In-phase motion that each step removed, modal inches by point (positive: with the force)."""
    parts = [step.removed for step in steps if step.name in ("rigid body", "adjacent modes")]
    first = steps[0].before
    return pd.concat([first[["point", "omega"]], *parts], axis=1)


def tabulate_measured(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """What the figures of the chapter show, by point.

    ``point, omega``; ``tail`` (in), ``tail_phase`` (rad), ``A_2_printed, phi_2_printed`` and computed ``A_2, phi_2``;
    ``energy_printed`` and ``energy`` = pi X_t F sin(phi_t) (in-lb); ``pitch_printed, yaw_printed`` of Table 3.IV and
    ``pitch, yaw`` with the root of Eq. 3.2.15 nearest to the printed xi (NaN where there is none).
    """
    table, motion, rows = load_table("3_III", "corrected"), load_table("3_I", "corrected"), tabulate_points()
    X, phase = columns(table, "tail_amplitude_in", "tail_phase_rad")
    F, omega = columns(motion, "force_lb", "omega_rad_s")
    roots = find_roots(rows)
    xi = np.array([nearest_root(point.roots, near) for point, near in zip(roots, rows["xi"], strict=True)])
    planes = plane_motion(PLANES, F, omega, xi)
    record = steps[-1].after
    return pd.DataFrame(
        {
            "point": motion["point"],
            "omega": omega,
            "tail": X,
            "tail_phase": phase,
            "A_2_printed": table["modal_amplitude_A2_in"],
            "phi_2_printed": table["modal_phase_rad"],
            "A_2": record["amplitude"],
            "phi_2": record["phase"],
            "energy_printed": rows["energy_input_in_lb"],
            "energy": input_energy(X, F, phase),
            "pitch_printed": rows["A2p_in"],
            "yaw_printed": rows["A2y_in"],
            "pitch": planes.A_p,
            "yaw": planes.A_y,
        }
    )


def tabulate_corrected_rows() -> pd.DataFrame:
    """Rows that Table 3.IV marks as corrected for experimental error: no measurement stands behind them (E3IV-9)."""
    rows = load_table("3_IV").query("corrected_row == 1").reset_index(drop=True)
    omega, energy, pitch, yaw = columns(rows, "omega_rad_s", "energy_input_in_lb", "A2p_in", "A2y_in")
    return pd.DataFrame({"point": rows["point"], "omega": omega, "energy": energy, "pitch": pitch, "yaw": yaw})


def tabulate_effect(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """Amplitude and phase after each step from the mode factor to the last removal, rows of a step together."""
    shown = [step for step in steps if step.name in ("mode factor", "rigid body", "adjacent modes")]
    return pd.concat([s.after[["omega", "amplitude", "phase"]].assign(step=s.name) for s in shown], ignore_index=True)


def tabulate_fitted_curves(fits: Fits) -> pd.DataFrame:
    """Curves over frequency with one xi for all points; the force is interpolated between the points.

    ``pitch, yaw, energy``: amplitudes in the principal planes (Eq. 3.2.12) and energy per cycle of the free fit;
    ``pitch_report, yaw_report, energy_report``: of the report's planes with its mean xi of .005. Along the force,
    ``amplitude_held, phase_held``: of the fit with the report's angle and mass; ``amplitude_more, phase_more``: with
    motion in phase and a lag fitted too.
    """
    data, free = phasors("A2"), fits["A2", "constant", "free"]
    omega = np.linspace(data.omega[0], data.omega[-1], 221)
    F = np.interp(omega, data.omega, data.F)
    curves: dict[str, Floats] = {"omega": omega}
    for suffix, planes, xi in (("", fitted_planes(free), free.xi), ("_report", PLANES, MEAN_XI)):
        motion = plane_motion(planes, F / PLANES.phi, omega, xi)
        curves |= {f"pitch{suffix}": motion.A_p, f"yaw{suffix}": motion.A_y, f"energy{suffix}": motion.E_p + motion.E_y}
    for suffix, variant in (("_held", "theta = 28, M = 21"), ("_more", "free + in phase + lag")):
        response = pitch_response(fits["A2", "constant", variant].model, F, omega)
        curves |= {f"amplitude{suffix}": np.abs(response), f"phase{suffix}": -np.angle(response)}
    return pd.DataFrame(curves)


def fitted_planes(fit: PlanarFit) -> PrincipalPlanes:
    """The principal planes of a planar fit, for Eq. 3.2.15."""
    M, _, omega_p, omega_y, theta = (float(value) for value in fit.model[:5])
    return PrincipalPlanes(PLANES.phi, M, omega_p, omega_y, theta)
