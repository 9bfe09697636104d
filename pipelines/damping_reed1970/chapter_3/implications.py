"""The damping factor of Eq. 3.2.15 at each point with all its roots: what Table 3.IV took, and what else it might have.

The energy lost, as a function of xi, rises to a maximum and falls again, so an energy below the maximum is lost at two
values of xi and one above it at none. "Trial and error" finds one of them.

The fits of both planes imply more: each assumption of the report is a question with its answer in numbers, a row each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
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
    SECOND_PLANE,
    Fits,
    KnownPosterior,
    comparison,
    phasors,
    second_plane_probability,
    tabulate_energy_split,
    tabulate_yaw,
)

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
    low, high = _low_and_high(roots)
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
            "taken": _find_taken(low, high, printed),
            "energy_printed": energy_loss(planes, F, omega, printed),
            **{
                f"{name}_{key}": value
                for key, m in motion.items()
                for name, value in (("pitch", m.E_p), ("yaw", m.E_y))
            },
            **{f"A_pitch_{key}": m.A_p for key, m in motion.items()},
        }
    )


def _low_and_high(roots: Sequence[DampingRoots]) -> tuple[FloatArray, FloatArray]:
    return branch(roots, 0), branch(roots, -1)


def _find_taken(low: FloatArray, high: FloatArray, printed: FloatArray) -> list[str]:
    """The branch whose root is nearer to the printed xi."""
    nearer = np.where(np.abs(low - printed) < np.abs(high - printed), "low", "high")
    return list(np.where(np.isnan(low), "none", nearer).tolist())


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
    M, _, omega_p, omega_y, theta = (float(value) for value in fit.model.oscillator)
    return PrincipalPlanes(PLANES.phi, M, omega_p, omega_y, theta)


REPORT = "theta = 28, M = 21"


def tabulate_implications(fits: Fits, known: Mapping[tuple[str, str], KnownPosterior]) -> pd.DataFrame:
    """Columns ``question, value, low, high`` (interval where there is one, else NaN) and ``says``."""
    rows = [
        *_assess_angle(fits, known),
        *_assess_planes(known),
        *_assess_in_phase(fits, known),
        *_assess_yaw(fits),
        *_assess_noise(fits),
    ]
    return pd.DataFrame(rows, columns=["question", "value", "low", "high", "says"])


Row = tuple[str, float, float, float, str]


def _row(question: str, value: float, says: str, low: float = np.nan, high: float = np.nan) -> Row:
    return question, float(value), float(low), float(high), says


def _assess_angle(fits: Fits, known: Mapping[tuple[str, str], KnownPosterior]) -> list[Row]:
    """The angle of 28 degrees and the mass of 21 against both free."""
    low, median, high = _interval(known["A2", "free"], "theta")
    inside = "inside" if low <= 28.0 <= high else "outside"
    rows = [
        _row(
            f"theta, degrees: median and {100 * LEVEL:g} % interval",
            median,
            f"28 degrees, from a stiffness analysis (section 3.1), is {inside} the interval",
            low,
            high,
        )
    ]
    pairs = (("theta = 28", "free"), (REPORT, "free"), ("theta = 28 + in phase", "free + in phase"))
    rows += [_chi_square(fits["A2", "constant", held], fits["A2", "constant", two], held, two) for held, two in pairs]
    for variant, name in (("theta = 28", "28 degrees"), (REPORT, "28 degrees and a mass of 21")):
        odds = float(np.exp(known["A2", "free"].evidence.log_z - known["A2", variant].evidence.log_z))
        says = f"{name} favoured {1.0 / odds:.1f} to 1: the wide priors of what is free cost more than the fit gains"
        says = says if odds < 1.0 else f"all free favoured {odds:.1f} to 1: next to nothing, the prior of theta pays"
        rows.append(_row(f"Bayes factor of all free over {name}", odds, says))
    return rows


def _chi_square(held: PlanarFit, free: PlanarFit, text: str, two: str) -> Row:
    compared = comparison(held, free)
    says = (
        f"p = {compared['p_value']:.2g} if the residuals were independent; "
        f"p = {compared['p_value_correlated']:.2g} with the correlation of neighbours, {free.correlation:.2f}"
    )
    return _row(f"chi-square of {text} over {two}", compared["chi_square"], says)


def _assess_planes(known: Mapping[tuple[str, str], KnownPosterior]) -> list[Row]:
    """One plane or two, and where the second is."""
    odds = float(np.exp(known["A2", "free"].evidence.log_z - known["A2", "one plane"].evidence.log_z))
    rows = [_row("Bayes factor of two planes over one", odds, "planar coupling is needed")]
    low, high = SECOND_PLANE
    for key, what in ((("A2", "free"), "modal motion"), (("tail", "free + in phase"), "tail, motion in phase free")):
        interval = _interval(known[key], "omega_y")
        says = f"omega_y {interval[1]:.3f}, {interval[0]:.3f} to {interval[2]:.3f} rad/s; 11.50 in Eq. 3.1.37"
        question = f"probability that omega_y lies in {low} to {high} rad/s ({what})"
        rows.append(_row(question, second_plane_probability(known[key]), says))
    return rows


def _assess_in_phase(fits: Fits, known: Mapping[tuple[str, str], KnownPosterior]) -> list[Row]:
    """Motion in phase with the force that is left in the modal motion, and all of it in the tail."""
    C_t = load_table("3_III", "corrected")["correction_Ct2_in"].mean()
    gain = comparison(fits["A2", "constant", "free + in phase"], fits["A2", "constant", "free"])
    rows = []
    for key, says in (
        (
            ("A2", "free + in phase"),
            f"chi-square {-gain['chi_square']:.1f} for one parameter: Table 3.III's correction, {C_t:.4f} in on "
            "average, removes about half of what the phasors ask for",
        ),
        (("tail", "free + in phase"), f"minus C_t of Table 3.III is {-C_t:.4f} in on average"),
    ):
        low, median, high = _interval(known[key], "R")
        rows.append(_row(f"motion in phase with the force in {key[0]}, in", median, says, low, high))
    more = fits["A2", "constant", "free + in phase + lag"]
    gain = comparison(more, fits["A2", "constant", "free + in phase"])
    error = 1.645 * more.standard_errors["lag"]
    says = (
        f"chi-square {-gain['chi_square']:.1f} for one parameter more; theta then is {np.degrees(more.model.theta):.1f}"
    )
    low, high = float(more.model.lag) - error, float(more.model.lag) + error
    return [
        *rows,
        _row("lag common to all readings of A2, rad (least squares)", float(more.model.lag), says, low, high),
    ]


def _assess_yaw(fits: Fits) -> list[Row]:
    """The yaw motion, which was measured and not fitted, and the energy it takes."""
    yaw, split = tabulate_yaw(fits), tabulate_energy_split(fits)
    rows = []
    for variant in ("free", REPORT, "free + in phase + lag"):
        error = float(np.sqrt(np.mean((yaw[variant] - yaw["measured"]) ** 2)))
        says = f"largest predicted {yaw[variant].max():.3f} in, measured {yaw['measured'].max():.3f} in; not fitted"
        rows.append(_row(f"yaw amplitude predicted by {variant}: RMS error, in", error, says))
    energy = load_table("3_IV").query("corrected_row == 0")["energy_input_in_lb"].to_numpy(float)
    shares = {name: float(np.average(split[name], weights=energy)) for name in ("printed", "free", REPORT)}
    says = f"Table 3.IV {shares['printed']:.0f} per cent, the planes of the report fitted {shares[REPORT]:.0f} per cent"
    return [*rows, _row("energy lost in the yaw plane over all points, per cent (free)", shares["free"], says)]


def _assess_noise(fits: Fits) -> list[Row]:
    """How far the residuals are from independent noise."""
    free, more = fits["A2", "constant", "free"], fits["A2", "constant", "free + in phase"]
    peak = float(np.abs(phasors("A2").q).max())
    shares = [100.0 * fit.sigma / peak for fit in (free, more)]
    says = (
        f"residuals of {shares[0]:.0f} per cent of the largest amplitude run together: standard errors are too small; "
        f"with motion in phase {more.correlation:.2f} and {shares[1]:.0f} per cent"
    )
    return [_row("correlation of neighbouring residuals (free)", free.correlation, says)]


def _interval(known: KnownPosterior, name: str) -> tuple[float, float, float]:
    low, median, high = np.quantile(known.parameters[name], [0.5 * (1.0 - LEVEL), 0.5, 0.5 * (1.0 + LEVEL)])
    return float(low), float(median), float(high)
