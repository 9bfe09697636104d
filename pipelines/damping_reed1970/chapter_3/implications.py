"""The damping factor of Eq. 3.2.15 at each point with all its roots: what Table 3.IV took, and what else it might have.

The energy lost, as a function of xi, rises to a maximum and falls again, so an energy below the maximum is lost at two
values of xi and one above it at none. "Trial and error" finds one of them.

The fits of both planes imply more: each assumption of the report is a question with its answer in numbers, a row each.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from damping.signals import (
    DampingRoots,
    PrincipalPlanes,
    branch,
    damping_roots,
    energy_loss,
    mean_coefficient,
    nearest_root,
    plane_motion,
)
from damping_reed1970 import columns, load_table
from damping_reed1970.chapter_3 import PLANES
from damping_reed1970.chapter_3.planar_fit import PlanarFit
from damping_reed1970.chapter_3.planar_fits import (
    LEVEL,
    TAILS,
    Fits,
    Posteriors,
    comparison,
    phasors,
    tabulate_energy_split,
    tabulate_yaw,
)
from damping_reed1970.chapter_3.planar_posterior import PlanarPosterior

#: Where the report's second frequency (Eq. 3.1.37) may lie when it is read off a plot to .01 or two: asked of omega_y.
SECOND_PLANE = (11.48, 11.51)
#: A damping factor above this is none of a structure (erratum E3IV-1).
LARGEST_XI = 0.05


def tabulate_points() -> pd.DataFrame:
    """Table 3.IV, the 15 rows that are not marked as corrected, with the force of Table 3.I."""
    table = load_table("3_IV").query("corrected_row == 0").reset_index(drop=True)
    return table.assign(force_lb=load_table("3_I")["force_lb"])


def roots_at(planes: PrincipalPlanes, table: pd.DataFrame) -> list[DampingRoots]:
    """All solutions of Eq. 3.2.15 at each row of ``points``."""
    F, omega, energy = columns(table, "force_lb", "omega_rad_s", "energy_input_in_lb")
    return [damping_roots(planes, *row) for row in zip(F.tolist(), omega.tolist(), energy.tolist(), strict=True)]


def tabulate_branch(planes: PrincipalPlanes = PLANES) -> pd.DataFrame:
    """By point: both roots, the printed xi, the branch it is on, and the energy in each plane on each branch.

    Columns: ``point, omega, energy`` (put in), ``largest_energy`` (that can be lost, at ``xi_of_largest``), ``roots``
    (number), ``xi_low, xi_high`` (NaN where none), ``xi_printed, taken`` (``low``, ``high`` or ``none``),
    ``energy_printed`` (lost at the printed xi), and ``pitch_low, yaw_low, pitch_high, yaw_high``: energies lost in the
    planes, and ``A_pitch_low, A_pitch_high``: amplitudes.
    """
    table = tabulate_points()
    roots = roots_at(planes, table)
    F, omega, energy, printed = columns(table, "force_lb", "omega_rad_s", "energy_input_in_lb", "xi")
    low, high = branch(roots, 0), branch(roots, -1)
    nearer = np.where(np.abs(low - printed) < np.abs(high - printed), "low", "high")
    motion = {name: plane_motion(planes, F, omega, xi) for name, xi in (("low", low), ("high", high))}
    return pd.DataFrame(
        {
            "point": table["point"],
            "omega": omega,
            "energy": energy,
            "largest_energy": [point.energy_peak for point in roots],
            "xi_of_largest": [point.xi_peak for point in roots],
            "roots": [point.roots.size for point in roots],
            "xi_low": low,
            "xi_high": high,
            "xi_printed": printed,
            "taken": np.where(np.isnan(low), "none", nearer),
            "energy_printed": energy_loss(planes, F, omega, printed),
            **{
                f"{name}_{key}": value
                for key, m in motion.items()
                for name, value in (("pitch", m.E_p), ("yaw", m.E_y))
            },
            **{f"A_pitch_{key}": m.A_p for key, m in motion.items()},
        }
    )


def tabulate_mean(planes: PrincipalPlanes = PLANES) -> pd.DataFrame:
    """What the mean coefficient C_1 (Eq. 3.2.18) and the mean xi become on each branch.

    ``points`` counts the points that have a value; "xi of the largest energy" fills points 10 and 13, which have no
    root, with the xi at which the most is lost.
    """
    table = tabulate_points()
    roots = roots_at(planes, table)
    omega, printed = columns(table, "omega_rad_s", "xi")
    none = np.array([point.roots.size == 0 for point in roots])
    peak = np.array([point.xi_peak for point in roots])
    low, high = branch(roots, 0), branch(roots, -1, LARGEST_XI)
    high_or_low = np.where(np.isnan(high), low, high)
    near = np.array([nearest_root(point.roots, xi) for point, xi in zip(roots, printed, strict=True)])
    choices = {
        "as printed": printed,
        "as printed, points with a root": np.where(none, np.nan, printed),
        "the root nearest to each printed xi": near,
        "every low root": low,
        "every high root (below .05, else low)": high_or_low,
        "every low root, points 10 and 13 at the xi of the largest energy": np.where(none, peak, low),
        "every high root, points 10 and 13 at the xi of the largest energy": np.where(none, peak, high_or_low),
    }
    rows = [
        {
            "choice": choice,
            "points": int(np.isfinite(xi).sum()),
            "mean_xi": float(np.nanmean(xi)),
            "C_1": mean_coefficient(planes.mass, omega, xi),
        }
        for choice, xi in choices.items()
    ]
    return pd.DataFrame(rows)


def fitted_planes(fit: PlanarFit) -> PrincipalPlanes:
    """The principal planes of a planar fit, for Eq. 3.2.15."""
    M, _, omega_p, omega_y, theta = (float(value) for value in fit.model[:5])
    return PrincipalPlanes(PLANES.phi, M, omega_p, omega_y, theta)


REPORT = "theta = 28, M = 21"
#: A question with its answer: ``question, value, says`` and, where there is an interval, ``low, high``.
Answer = dict[str, str | float]


def tabulate_implications(fits: Fits, posteriors: Posteriors) -> pd.DataFrame:
    """Columns ``question, value, low, high`` (interval where there is one, else NaN) and ``says``."""
    answers = [
        *_assess_angle(fits, posteriors),
        *_assess_planes(posteriors),
        *_assess_in_phase(fits, posteriors),
        *_assess_yaw(fits),
        _assess_noise(fits),
    ]
    return pd.DataFrame(answers, columns=["question", "value", "low", "high", "says"])


def _assess_angle(fits: Fits, posteriors: Posteriors) -> list[Answer]:
    """The angle of 28 degrees and the mass of 21 against both free."""
    interval = _interval(posteriors["A2", "free"], "theta")
    inside = "inside" if interval["low"] <= 28.0 <= interval["high"] else "outside"
    question = f"theta, degrees: median and {100 * LEVEL:g} % interval"
    says = f"28 degrees, from a stiffness analysis (section 3.1), is {inside} the interval"
    answers: list[Answer] = [{"question": question, "says": says, **interval}]
    for held, free in (("theta = 28", "free"), (REPORT, "free"), ("theta = 28 + in phase", "free + in phase")):
        larger = fits["A2", "constant", free]
        compared = comparison(fits["A2", "constant", held], larger)
        says = (
            f"p = {compared['p_value']:.2g} if the residuals were independent; "
            f"p = {compared['p_value_correlated']:.2g} with the correlation of neighbours, {larger.correlation:.2f}"
        )
        question = f"chi-square of {held} over {free}"
        answers.append({"question": question, "value": compared["chi_square"], "says": says})
    for variant, name in (("theta = 28", "28 degrees"), (REPORT, "28 degrees and a mass of 21")):
        odds = _bayes_factor(posteriors, variant)
        says = f"{name} favoured {1.0 / odds:.1f} to 1: the wide priors of what is free cost more than the fit gains"
        says = says if odds < 1.0 else f"all free favoured {odds:.1f} to 1: next to nothing, the prior of theta pays"
        answers.append({"question": f"Bayes factor of all free over {name}", "value": odds, "says": says})
    return answers


def _assess_planes(posteriors: Posteriors) -> list[Answer]:
    """One plane or two, and where the second is."""
    odds = _bayes_factor(posteriors, "one plane")
    says = "planar coupling is needed"
    answers: list[Answer] = [{"question": "Bayes factor of two planes over one", "value": odds, "says": says}]
    low, high = SECOND_PLANE
    for key, what in ((("A2", "free"), "modal motion"), (("tail", "free + in phase"), "tail, motion in phase free")):
        omega_y, interval = posteriors[key].parameters["omega_y"], _interval(posteriors[key], "omega_y")
        says = "omega_y {value:.3f}, {low:.3f} to {high:.3f} rad/s; 11.50 in Eq. 3.1.37".format_map(interval)
        question = f"probability that omega_y lies in {low} to {high} rad/s ({what})"
        share = float(np.mean((omega_y >= low) & (omega_y <= high)))
        answers.append({"question": question, "value": share, "says": says})
    return answers


def _assess_in_phase(fits: Fits, posteriors: Posteriors) -> list[Answer]:
    """Motion in phase with the force that is left in the modal motion, and all of it in the tail."""
    C_t = load_table("3_III", "corrected")["correction_Ct2_in"].mean()
    free, some, more = (fits["A2", "constant", f"free{added}"] for added in ("", " + in phase", " + in phase + lag"))
    says = {
        "A2": f"chi-square {-comparison(some, free)['chi_square']:.1f} for one parameter: Table 3.III's correction, "
        f"{C_t:.4f} in on average, removes about half of what the phasors ask for",
        "tail": f"minus C_t of Table 3.III is {-C_t:.4f} in on average",
    }
    answers: list[Answer] = [
        {"question": f"motion in phase with the force in {data}, in", "says": text}
        | _interval(posteriors[data, "free + in phase"], "R")
        for data, text in says.items()
    ]
    lag, error = float(more.model.lag), 1.645 * more.standard_errors["lag"]
    lag_says = (
        f"chi-square {-comparison(more, some)['chi_square']:.1f} for one parameter more; theta then is "
        f"{np.degrees(more.model.theta):.1f}"
    )
    interval = {"value": lag, "low": lag - error, "high": lag + error}
    question = "lag common to all readings of A2, rad (least squares)"
    return [*answers, {"question": question, "says": lag_says, **interval}]


def _assess_yaw(fits: Fits) -> list[Answer]:
    """The yaw motion, which was measured and not fitted, and the energy it takes."""
    yaw, split = tabulate_yaw(fits), tabulate_energy_split(fits)
    answers: list[Answer] = []
    for variant in ("free", REPORT, "free + in phase + lag"):
        error = float(np.sqrt(np.mean((yaw[variant] - yaw["measured"]) ** 2)))
        says = f"largest predicted {yaw[variant].max():.3f} in, measured {yaw['measured'].max():.3f} in; not fitted"
        question = f"yaw amplitude predicted by {variant}: RMS error, in"
        answers.append({"question": question, "value": error, "says": says})
    energy = load_table("3_IV").query("corrected_row == 0")["energy_input_in_lb"].to_numpy(float)
    shares = {name: float(np.average(split[name], weights=energy)) for name in ("printed", "free", REPORT)}
    says = f"Table 3.IV {shares['printed']:.0f} per cent, the planes of the report fitted {shares[REPORT]:.0f} per cent"
    question = "energy lost in the yaw plane over all points, per cent (free)"
    return [*answers, {"question": question, "value": shares["free"], "says": says}]


def _assess_noise(fits: Fits) -> Answer:
    """How far the residuals are from independent noise."""
    free, more = fits["A2", "constant", "free"], fits["A2", "constant", "free + in phase"]
    peak = float(np.abs(phasors("A2").q).max())
    says = (
        f"residuals of {100.0 * free.sigma / peak:.0f} per cent of the largest amplitude run together: standard errors "
        f"are too small; with motion in phase {more.correlation:.2f} and {100.0 * more.sigma / peak:.0f} per cent"
    )
    return {"question": "correlation of neighbouring residuals (free)", "value": free.correlation, "says": says}


def _bayes_factor(posteriors: Posteriors, variant: str) -> float:
    """Of all free over a variant."""
    return float(np.exp(posteriors["A2", "free"].evidence.log_z - posteriors["A2", variant].evidence.log_z))


def _interval(posterior: PlanarPosterior, name: str) -> Answer:
    low, median, high = np.quantile(posterior.parameters[name], TAILS).tolist()
    return {"value": median, "low": low, "high": high}
