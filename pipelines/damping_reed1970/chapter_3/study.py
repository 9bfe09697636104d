"""Chapter III as a whole: conditioning, planar coupling, damping factors. Tables, and what the figures draw."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.records.keys import read_toml
from damping.records.reading import read_table
from damping.signals import input_energy, nearest_root, plane_motion, viscous_energy
from damping.signals.chain import ConditioningStep, condition
from damping.signals.description import Description
from damping_reed1970 import chapter_3, columns, data_folder, load_table
from damping_reed1970.chapter_3 import PLANES, PlanarOscillator, planar_posterior, yaw_response
from damping_reed1970.chapter_3.figures import tabulate_fitted_curves
from damping_reed1970.chapter_3.planar_fit import Fits, Phasors, comparison, fit_table, phasors, planar_fits
from damping_reed1970.chapter_3.planar_posterior import LEVEL, SAMPLED, TAILS, PlanarBand, PlanarPosterior, Posteriors

SEED = 1970


@dataclass(frozen=True)
class Chapter3:
    """Results of chapter III.

    ``steps``: conditioning of the test of Configuration I. ``tables``: for people, by name. For the figures:
    ``measured``, by point (:func:`tabulate_measured`); ``corrected``, rows 6+ and 9+ of Table 3.IV; ``effect``,
    amplitude and phase after each step; ``curves`` with one damping for all points (:func:`tabulate_fitted_curves`).
    ``fits, posteriors``: of the planar oscillator. ``bands``: of the sampled posteriors by data.
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
    first = steps[0].before
    return pd.concat([first[["point", "omega"]], *parts], axis=1)


def tabulate_measured(steps: tuple[ConditioningStep, ...]) -> pd.DataFrame:
    """What the figures of the chapter show, by point.

    ``point, omega``; ``tail`` (in), ``tail_phase`` (rad), ``A_2_printed, phi_2_printed`` and computed ``A_2, phi_2``;
    ``energy_printed`` and ``energy`` = pi X_t F sin(phi_t) (in-lb); ``pitch_printed, yaw_printed`` of Table 3.IV and
    ``pitch, yaw`` with the root of Eq. 3.2.15 nearest to the printed xi (NaN where there is none).
    """
    table, motion, rows = load_table("3_III", "corrected"), load_table("3_I", "corrected"), chapter_3.tabulate_points()
    X, phase = columns(table, "tail_amplitude_in", "tail_phase_rad")
    F, omega = columns(motion, "force_lb", "omega_rad_s")
    roots = chapter_3.find_roots(rows)
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
        for variant in ("free", "theta = 28, M = 21", "free + in phase + lag")
    }
    return pd.DataFrame({"point": motion["point"], "omega": omega, "measured": yaw / 100 / PLANES.phi, **predicted})


def tabulate_energy_split(fits: Fits) -> pd.DataFrame:
    """Share of the energy that the yaw plane takes, in per cent by point: Table 3.IV as printed, and two fits."""
    table = load_table("3_IV").query("corrected_row == 0")
    pitch, yaw = columns(table, "energy_pitch_in_lb", "energy_yaw_in_lb")
    data = phasors("A2")
    shares = {v: _yaw_share(fits["A2", "constant", v].model, data) for v in ("free", "theta = 28, M = 21")}
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


#: Where the report's second frequency (Eq. 3.1.37) may lie when it is read off a plot to .01 or two: asked of omega_y.
SECOND_PLANE = (11.48, 11.51)
REPORT = "theta = 28, M = 21"
#: A question, what its answer says, and the answer: a value, with the low and high end of an interval where it has one.
Answer: TypeAlias = tuple[str, str, float] | tuple[str, str, float, float, float]


def tabulate_implications(fits: Fits, posteriors: Posteriors) -> pd.DataFrame:
    """Each assumption of the report is a question with its answer, a row each.

    Columns ``question, value, low, high`` (interval where there is one, else NaN) and ``says``.
    """
    answers = [*_assess_angle(fits, posteriors), *_assess_planes(posteriors), *_assess_in_phase(fits, posteriors)]
    names = ("question", "says", "value", "low", "high")
    rows = [dict(zip(names, answer, strict=False)) for answer in (*answers, *_assess_yaw(fits))]
    return pd.DataFrame(rows, columns=["question", "value", "low", "high", "says"])


def _assess_angle(fits: Fits, posteriors: Posteriors) -> Iterator[Answer]:
    """The angle of 28 degrees and the mass of 21 against both free."""
    interval = _interval(posteriors["A2", "free"], "theta")
    inside = "inside" if interval[1] <= 28.0 <= interval[2] else "outside"
    says = f"28 degrees, from a stiffness analysis (section 3.1), is {inside} the interval"
    yield f"theta, degrees: median and {100 * LEVEL:g} % interval", says, *interval
    for held, free in (("theta = 28", "free"), (REPORT, "free"), ("theta = 28 + in phase", "free + in phase")):
        larger = fits["A2", "constant", free]
        compared = comparison(fits["A2", "constant", held], larger)
        says = (
            f"p = {compared['p_value']:.2g} if the residuals were independent; "
            f"p = {compared['p_value_correlated']:.2g} with the correlation of neighbours, {larger.correlation:.2f}"
        )
        yield f"chi-square of {held} over {free}", says, compared["chi_square"]
    for variant, name in (("theta = 28", "28 degrees"), (REPORT, "28 degrees and a mass of 21")):
        odds = _bayes_factor(posteriors, variant)
        says = f"{name} favoured {1.0 / odds:.1f} to 1: the wide priors of what is free cost more than the fit gains"
        says = says if odds < 1.0 else f"all free favoured {odds:.1f} to 1: next to nothing, the prior of theta pays"
        yield f"Bayes factor of all free over {name}", says, odds


def _assess_planes(posteriors: Posteriors) -> Iterator[Answer]:
    """One plane or two, and where the second is."""
    yield "Bayes factor of two planes over one", "planar coupling is needed", _bayes_factor(posteriors, "one plane")
    low, high = SECOND_PLANE
    for key, what in ((("A2", "free"), "modal motion"), (("tail", "free + in phase"), "tail, motion in phase free")):
        omega_y, interval = posteriors[key].parameters["omega_y"], _interval(posteriors[key], "omega_y")
        says = "omega_y {:.3f}, {:.3f} to {:.3f} rad/s; 11.50 in Eq. 3.1.37".format(*interval)
        share = float(np.mean((omega_y >= low) & (omega_y <= high)))
        yield f"probability that omega_y lies in {low} to {high} rad/s ({what})", says, share


def _assess_in_phase(fits: Fits, posteriors: Posteriors) -> Iterator[Answer]:
    """Motion in phase with the force that is left in the modal motion, and all of it in the tail."""
    C_t = load_table("3_III", "corrected")["correction_Ct2_in"].mean()
    free, some, more = (fits["A2", "constant", f"free{added}"] for added in ("", " + in phase", " + in phase + lag"))
    says = {
        "A2": f"chi-square {-comparison(some, free)['chi_square']:.1f} for one parameter: Table 3.III's correction, "
        f"{C_t:.4f} in on average, removes about half of what the phasors ask for",
        "tail": f"minus C_t of Table 3.III is {-C_t:.4f} in on average",
    }
    for data, text in says.items():
        interval = _interval(posteriors[data, "free + in phase"], "R")
        yield f"motion in phase with the force in {data}, in", text, *interval
    lag, error = float(more.model.lag), 1.645 * more.standard_errors["lag"]
    chi_square, theta = -comparison(more, some)["chi_square"], np.degrees(more.model.theta)
    lag_says = f"chi-square {chi_square:.1f} for one parameter more; theta then is {theta:.1f}"
    yield "lag common to all readings of A2, rad (least squares)", lag_says, lag, lag - error, lag + error


def _assess_yaw(fits: Fits) -> Iterator[Answer]:
    """The yaw motion, which was measured and not fitted, the energy it takes, and what residuals are left."""
    yaw, split = tabulate_yaw(fits), tabulate_energy_split(fits)
    for variant in ("free", REPORT, "free + in phase + lag"):
        error = float(np.sqrt(np.mean((yaw[variant] - yaw["measured"]) ** 2)))
        says = f"largest predicted {yaw[variant].max():.3f} in, measured {yaw['measured'].max():.3f} in; not fitted"
        yield f"yaw amplitude predicted by {variant}: RMS error, in", says, error
    energy = load_table("3_IV").query("corrected_row == 0")["energy_input_in_lb"].to_numpy(float)
    shares = {name: float(np.average(split[name], weights=energy)) for name in ("printed", "free", REPORT)}
    says = f"Table 3.IV {shares['printed']:.0f} per cent, the planes of the report fitted {shares[REPORT]:.0f} per cent"
    yield "energy lost in the yaw plane over all points, per cent (free)", says, shares["free"]
    free, more = fits["A2", "constant", "free"], fits["A2", "constant", "free + in phase"]
    peak = float(np.abs(phasors("A2").q).max())
    says = (
        f"residuals of {100.0 * free.sigma / peak:.0f} per cent of the largest amplitude run together: standard errors "
        f"are too small; with motion in phase {more.correlation:.2f} and {100.0 * more.sigma / peak:.0f} per cent"
    )
    yield "correlation of neighbouring residuals (free)", says, free.correlation


def _bayes_factor(posteriors: Posteriors, variant: str) -> float:
    """Of all free over a variant."""
    return float(np.exp(posteriors["A2", "free"].evidence.log_z - posteriors["A2", variant].evidence.log_z))


def _interval(posterior: PlanarPosterior, name: str) -> tuple[float, float, float]:
    """Median, low and high end."""
    low, median, high = np.quantile(posterior.parameters[name], TAILS).tolist()
    return median, low, high
