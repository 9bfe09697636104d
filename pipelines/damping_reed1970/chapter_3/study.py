"""Chapter III as a whole: conditioning, planar coupling, damping factors. Tables, and what the figures draw."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.infer import SEED
from damping.report.page import fill_text, join_lines
from damping.signals import input_energy, nearest_roots, plane_motion, viscous_energy
from damping.signals.chain import ConditioningStep, condition
from damping.signals.reading import read_description, read_raw
from damping_reed1970 import chapter_3, columns, data_folder, load_table
from damping_reed1970.chapter_3 import MOST, PLANES, REPORT, VARIANTS, PlanarOscillator, planar_posterior, yaw_response
from damping_reed1970.chapter_3.figures import tabulate_fitted_curves
from damping_reed1970.chapter_3.planar_fit import Fits, Phasors, comparison, fit_table, phasors, planar_fits
from damping_reed1970.chapter_3.planar_posterior import LEVEL, SAMPLED, TAILS, PlanarBand, PlanarPosterior, Posteriors

#: Where the report's second frequency (Eq. 3.1.37) may lie when it is read off a plot to .01 or two: asked of omega_y.
SECOND_PLANE = (11.48, 11.51)


@dataclass(frozen=True)
class Chapter3:
    """Results of chapter III; after the tables for people, those for the figures."""

    steps: tuple[ConditioningStep, ...]  #: conditioning of the test of Configuration I
    tables: Mapping[str, pd.DataFrame]  #: for people, by name
    measured: pd.DataFrame  #: by point (:func:`tabulate_measured`)
    corrected: pd.DataFrame  #: rows 6+ and 9+ of Table 3.IV
    effect: pd.DataFrame  #: amplitude and phase after each step
    curves: pd.DataFrame  #: with one damping for all points (:func:`tabulate_fitted_curves`)
    fits: Fits  #: of the planar oscillator
    posteriors: Posteriors  #: of the planar oscillator
    bands: Mapping[str, PlanarBand]  #: of the sampled posteriors by data


def chapter_3_results(seed: int = SEED) -> Chapter3:
    """Everything of chapter III, posteriors included; some seconds."""
    steps = saturn_steps()
    fits, posteriors = planar_fits(), planar_posterior.planar_posteriors(seed)
    free = fits["A2", "constant", "free"]
    tables = {
        "conditioned": tabulate_conditioned(steps),
        "removed": tabulate_removed(steps),
        "planar_fits": fit_table(fits),
        "planar_posteriors": planar_posterior.tabulate_posterior(posteriors),
        "planar_evidence": planar_posterior.tabulate_evidence(posteriors),
        "yaw": tabulate_yaw(fits),
        "energy_split": tabulate_energy_split(fits),
        "branches": chapter_3.tabulate_branch(),
        "branches_fitted": chapter_3.tabulate_branch(free.planes),
        "branch_means": chapter_3.tabulate_mean(),
        "implications": tabulate_implications(fits, posteriors),
    }
    # rows 6+ and 9+: no measurement stands behind them (E3IV-9)
    rows = load_table("3_IV").query("corrected_row == 1").reset_index(drop=True)
    bands = {name: planar_posterior.fit_band(posteriors[name, variant]) for name, variant in SAMPLED}
    return Chapter3(
        steps=steps,
        tables=tables,
        measured=tabulate_measured(steps),
        corrected=rows.rename(columns=MARKED)[["point", *MARKED.values()]],
        effect=tabulate_effect(steps),
        curves=tabulate_fitted_curves(fits),
        fits=fits,
        posteriors=posteriors,
        bands=bands,
    )


#: Columns of Table 3.IV as figures know them.
MARKED = {"omega_rad_s": "omega", "energy_input_in_lb": "energy", "A2p_in": "pitch", "A2y_in": "yaw"}


def saturn_steps() -> tuple[ConditioningStep, ...]:
    """The chain on the raw table of Configuration I, as ``damping condition`` runs it."""
    place = data_folder() / "saturn-v"
    description = read_description(place / "condition.toml")
    return condition(read_raw(place / "raw" / "config-1-mode-2.csv", description), description)


def tabulate_conditioned(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """Tables 3.I and 3.III by point: ``NAME_printed`` (corrected where an erratum is known) and ``NAME``, computed.

    Displacements of the tip in pitch and yaw, tail yaw, total correction C_t2, modal phase and amplitude.
    """
    by_name = {step.name: step.after for step in steps}
    table_i, table_iii = load_table("3_I", "corrected"), load_table("3_III", "corrected")
    moved, modal = by_name["yaw from pitch"], by_name["record"]
    correction = -tabulate_removed(steps)[["rigid body", "mode 1", "mode 3", "mode 4"]].sum(axis=1)
    pairs = {
        "tip_pitch": (table_i["tip_pitch_disp_in"], moved["tip pitch"]),
        "tip_yaw": (table_i["tip_yaw_disp_in"], moved["tip yaw"]),
        "tail_yaw_e2": (table_i["tail_yaw_disp_in_e2"], 100.0 * moved["tail yaw"]),
        "C_t2": (table_iii["correction_Ct2_in"], correction),
        "phi_2": (table_iii["modal_phase_rad"], modal["phase"]),
        "A_2": (table_iii["modal_amplitude_A2_in"], modal["amplitude"]),
    }
    table = pd.DataFrame({"point": table_i["point"]})
    for name, (printed, computed) in pairs.items():
        table[f"{name}_printed"], table[name] = printed, computed
    return table


def tabulate_removed(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """In-phase motion that each step removed, modal inches by point (positive: with the force)."""
    parts = [step.removed for step in steps if step.name in ("rigid body", "adjacent modes")]
    return pd.concat([steps[0].before[["point", "omega"]], *parts], axis=1)


def tabulate_measured(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """Data of the figures of the chapter, by point.

    ``point, omega``; ``tail`` (in), ``tail_phase`` (rad), ``A_2_printed, phi_2_printed`` and computed ``A_2, phi_2``;
    ``energy_printed`` and ``energy`` = pi X_t F sin(phi_t) (in-lb); ``pitch_printed, yaw_printed`` of Table 3.IV and
    ``pitch, yaw`` with the root of Eq. 3.2.15 nearest to the printed xi (NaN where there is none).
    """
    table, motion, rows = load_table("3_III", "corrected"), load_table("3_I", "corrected"), chapter_3.tabulate_points()
    X, phase = columns(table, "tail_amplitude_in", "tail_phase_rad")
    F, omega = columns(motion, "force_lb", "omega_rad_s")
    xi = nearest_roots(chapter_3.find_roots(rows), rows["xi"].to_numpy(float))
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


def tabulate_effect(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """Amplitude and phase after each step from the mode factor to the last removal, rows of a step together."""
    shown = [step for step in steps if step.name in ("mode factor", "rigid body", "adjacent modes")]
    return pd.concat([s.after[["omega", "amplitude", "phase"]].assign(step=s.name) for s in shown], ignore_index=True)


def tabulate_yaw(fits: Fits) -> pd.DataFrame:
    """Yaw amplitude by point: measured (Table 3.I, tail yaw over the mode factor), and predicted by fits to pitch."""
    motion = load_table("3_I", "corrected")
    omega, yaw = columns(motion, "omega_rad_s", "tail_yaw_disp_in_e2")
    data = phasors("A2")
    predicted = {
        variant: np.abs(yaw_response(fits["A2", "constant", variant].model, data.F, data.omega))
        for variant in ("free", REPORT, MOST)
    }
    return pd.DataFrame({"point": motion["point"], "omega": omega, "measured": yaw / 100 / PLANES.phi, **predicted})


def tabulate_energy_split(fits: Fits) -> pd.DataFrame:
    """Share of the energy that the yaw plane takes, in per cent by point: Table 3.IV as printed, and two fits."""
    table = load_table("3_IV").query("corrected_row == 0")
    pitch, yaw = columns(table, "energy_pitch_in_lb", "energy_yaw_in_lb")
    data = phasors("A2")
    shares = {v: _yaw_share(fits["A2", "constant", v].model, data) for v in ("free", REPORT)}
    printed = 100.0 * yaw / (pitch + yaw)
    return pd.DataFrame({"point": table["point"].to_numpy(), "omega": data.omega, "printed": printed, **shares})


def _yaw_share(model: PlanarOscillator, data: Phasors) -> FloatArray:
    """Per cent of the energy lost that is lost in the yaw plane, (n,)."""
    M, C, omega_p, omega_y, theta = (float(value) for value in model[:5])
    energies = []
    for omega_j, part in ((omega_p, np.cos(theta)), (omega_y, np.sin(theta))):
        A = np.abs(part * data.F / (M * (omega_j**2 - data.omega**2) + 1j * C * data.omega))
        energies.append(viscous_energy(A, M, omega_j, C / (2.0 * M * omega_j), data.omega))
    return np.asarray(100.0 * energies[1] / (energies[0] + energies[1]))


def tabulate_implications(fits: Fits, posteriors: Posteriors) -> pd.DataFrame:
    """Each assumption of the report is a question with its answer, a row each, in the order of ``implications.txt``.

    Columns ``question, value, low, high`` (interval where there is one, else NaN) and ``says``.
    """
    modal = {variant: fits["A2", "constant", variant] for variant in VARIANTS}
    free, some, more = (modal[variant] for variant in ("free", "free + in phase", MOST))
    restrictions = (("theta = 28", "free"), (REPORT, "free"), ("theta = 28 + in phase", "free + in phase"))
    compared = [comparison(modal[held], modal[larger]) for held, larger in restrictions]
    tests = [(*pair, modal[pair[1]], test) for pair, test in zip(restrictions, compared, strict=True)]
    log_z = posteriors["A2", "free"].evidence.log_z
    variants = ("theta = 28", REPORT, "one plane")
    odds = [float(np.exp(log_z - posteriors["A2", variant].evidence.log_z)) for variant in variants]
    theta, planes = _interval(posteriors["A2", "free"], "theta"), (("A2", "free"), ("tail", "free + in phase"))
    second = [posteriors[key].parameters["omega_y"] for key in planes]
    lag, error = float(more.model.lag), 1.645 * more.standard_errors["lag"]
    yaw, split = tabulate_yaw(fits), tabulate_energy_split(fits)
    energy = load_table("3_IV").query("corrected_row == 0")["energy_input_in_lb"].to_numpy(float)
    shares = {name: float(np.average(split[name], weights=energy)) for name in ("printed", "free", REPORT)}
    answers: list[tuple[float, ...]] = [
        theta,
        *((test["chi_square"],) for test in compared),
        *((factor,) for factor in odds),
        *((float(np.mean((draws >= SECOND_PLANE[0]) & (draws <= SECOND_PLANE[1]))),) for draws in second),
        *(_interval(posteriors[data, "free + in phase"], "R") for data in ("A2", "tail")),
        (lag, lag - error, lag + error),
        *((float(np.sqrt(np.mean((yaw[fit] - yaw["measured"]) ** 2))),) for fit in ("free", REPORT, MOST)),
        (shares["free"],),
        (free.correlation,),
    ]
    values = {
        **{"level": f"{100 * LEVEL:g}", "theta": theta, "tests": tests, "odds": odds, "second": SECOND_PLANE},
        **{"planes": [_interval(posteriors[key], "omega_y") for key in planes], "yaw": yaw, "shares": shares},
        **{"free": free, "some": some, "in_phase": comparison(some, free), "lag": comparison(more, some)},
        "lag_theta": np.degrees(more.model.theta),
        "C_t": load_table("3_III", "corrected")["correction_Ct2_in"].mean(),
        "peak": np.abs(phasors("A2").q).max(),
    }
    texts = fill_text(Path(__file__).with_name("implications.txt"), values).strip().split("\n\n")
    table = pd.DataFrame([text.split("\n", 1) for text in texts], columns=["question", "says"])
    numbers = pd.DataFrame([(*answer, np.nan, np.nan)[:3] for answer in answers], columns=["value", "low", "high"])
    return pd.concat([table["question"], numbers, table["says"].map(join_lines)], axis=1)


def _interval(posterior: PlanarPosterior, name: str) -> tuple[float, float, float]:
    """Median, low and high end."""
    low, median, high = np.quantile(posterior.parameters[name], TAILS).tolist()
    return median, low, high
