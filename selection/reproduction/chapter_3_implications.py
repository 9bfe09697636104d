"""What the planar fits imply for the report's assumptions, in numbers: one question a row."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from selection.conditioning.planar_fit import PlanarFit
from selection.records.report_tables import load_table
from selection.reproduction.chapter_3_planar import Fits, comparison, energy_split, phasors, yaw_table
from selection.reproduction.chapter_3_posterior import LEVEL, SECOND_PLANE, Known, second_plane_probability

REPORT = "theta = 28, M = 21"


def implications(fits: Fits, known: Mapping[tuple[str, str], Known]) -> pd.DataFrame:
    """Columns ``question, value, low, high`` (interval where there is one, else NaN) and ``says``."""
    rows = [*_angle(fits, known), *_planes(known), *_in_phase(fits, known), *_yaw(fits), *_noise(fits)]
    return pd.DataFrame(rows, columns=["question", "value", "low", "high", "says"])


Row = tuple[str, float, float, float, str]


def _row(question: str, value: float, says: str, low: float = np.nan, high: float = np.nan) -> Row:
    return question, float(value), float(low), float(high), says


def _angle(fits: Fits, known: Mapping[tuple[str, str], Known]) -> list[Row]:
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
    rows += [_chi_square(fits["A2", "constant", one], fits["A2", "constant", two], one, two) for one, two in pairs]
    for variant, name in (("theta = 28", "28 degrees"), (REPORT, "28 degrees and a mass of 21")):
        odds = float(np.exp(known["A2", "free"].evidence.log_z - known["A2", variant].evidence.log_z))
        says = f"{name} favoured {1.0 / odds:.1f} to 1: the wide priors of what is free cost more than the fit gains"
        says = says if odds < 1.0 else f"all free favoured {odds:.1f} to 1: next to nothing, the prior of theta pays"
        rows.append(_row(f"Bayes factor of all free over {name}", odds, says))
    return rows


def _chi_square(held: PlanarFit, free: PlanarFit, one: str, two: str) -> Row:
    found = comparison(held, free)
    says = (
        f"p = {found['p_value']:.2g} if the residuals were independent; "
        f"p = {found['p_value_correlated']:.2g} with the correlation of neighbours, {free.correlation:.2f}"
    )
    return _row(f"chi-square of {one} over {two}", found["chi_square"], says)


def _planes(known: Mapping[tuple[str, str], Known]) -> list[Row]:
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


def _in_phase(fits: Fits, known: Mapping[tuple[str, str], Known]) -> list[Row]:
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


def _yaw(fits: Fits) -> list[Row]:
    """The yaw motion, which was measured and not fitted, and the energy it takes."""
    yaw, split = yaw_table(fits), energy_split(fits)
    rows = []
    for variant in ("free", REPORT, "free + in phase + lag"):
        error = float(np.sqrt(np.mean((yaw[variant] - yaw["measured"]) ** 2)))
        says = f"largest predicted {yaw[variant].max():.3f} in, measured {yaw['measured'].max():.3f} in; not fitted"
        rows.append(_row(f"yaw amplitude predicted by {variant}: RMS error, in", error, says))
    energy = load_table("3_IV").query("corrected_row == 0")["energy_input_in_lb"].to_numpy(float)
    shares = {name: float(np.average(split[name], weights=energy)) for name in ("printed", "free", REPORT)}
    says = f"Table 3.IV {shares['printed']:.0f} per cent, the planes of the report fitted {shares[REPORT]:.0f} per cent"
    return [*rows, _row("energy lost in the yaw plane over all points, per cent (free)", shares["free"], says)]


def _noise(fits: Fits) -> list[Row]:
    """How far the residuals are from independent noise."""
    free, more = fits["A2", "constant", "free"], fits["A2", "constant", "free + in phase"]
    peak = float(np.abs(phasors("A2").q).max())
    shares = [100.0 * fit.sigma / peak for fit in (free, more)]
    says = (
        f"residuals of {shares[0]:.0f} per cent of the largest amplitude run together: standard errors are too small; "
        f"with motion in phase {more.correlation:.2f} and {shares[1]:.0f} per cent"
    )
    return [_row("correlation of neighbouring residuals (free)", free.correlation, says)]


def _interval(known: Known, name: str) -> tuple[float, float, float]:
    low, median, high = np.quantile(known.parameters[name], [0.5 * (1.0 - LEVEL), 0.5, 0.5 * (1.0 + LEVEL)])
    return float(low), float(median), float(high)
