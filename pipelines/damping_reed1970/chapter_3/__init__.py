"""Chapter III: displacements, modal amplitude and phase (Tables 3.I, 3.III), principal planes (3.1.24-3.1.35, 3.IV).

Phasors: a motion A sin(omega t - phi) under F sin(omega t) is the complex number A exp(-i phi).
"""

from math import radians
from typing import NamedTuple

import numpy as np
import pandas as pd

from damping import signals
from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray, Floats
from damping_reed1970 import by_point, columns, load_table


class PlanarOscillator(NamedTuple):
    """A mode in two principal planes as a sensor sees it; fields may be arrays that broadcast with the frequency."""

    M: Floats  #: mass
    C: Floats  #: viscous coefficient, equal in all directions
    omega_p: Floats  #: first principal frequency, rad/s
    omega_y: Floats  #: second principal frequency, rad/s
    theta: Floats  #: angle, rad
    R: Floats = 0.0  #: motion in phase with the force that is not this mode's, per unit of modal force
    lag: Floats = 0.0  #: of all readings, rad


def pitch_response(oscillator: PlanarOscillator, F_p: Floats, omega: Floats) -> ComplexArray:
    """Phasor of the pitch motion under F_p in pitch: the sum over both principal planes, e^(-i lag) of it, and R F_p.

    F_p/M [cos^2 theta/(omega_p^2 - omega^2 + i omega C/M) + sin^2 theta/(omega_y^2 - omega^2 + i omega C/M)],
    identical with Eqs. 3.1.30-3.1.35.
    """
    M, C, omega_p, omega_y, theta, R, lag = oscillator
    pitch, yaw = receptance(M, C, omega_p, omega), receptance(M, C, omega_y, omega)
    return np.asarray(F_p * (np.cos(theta) ** 2 * pitch + np.sin(theta) ** 2 * yaw) * np.exp(-1j * lag) + R * F_p)


def yaw_response(oscillator: PlanarOscillator, F_p: Floats, omega: Floats) -> ComplexArray:
    """Phasor of the yaw motion under F_p in pitch (from Eqs. 3.1.27, 3.1.28): zero for theta = 0."""
    M, C, omega_p, omega_y, theta = oscillator[:5]
    pitch, yaw = receptance(M, C, omega_p, omega), receptance(M, C, omega_y, omega)
    return F_p * np.sin(theta) * np.cos(theta) * (pitch - yaw)


def receptance(M: Floats, C: Floats, omega_j: Floats, omega: Floats) -> ComplexArray:
    """Phasor of the motion in a principal plane of frequency ``omega_j`` over the force in it."""
    return np.asarray(1.0 / (M * (omega_j**2 - omega**2) + 1j * C * omega))


#: Second mode of Configuration I (Eq. 3.2.16): phi_t2, M_2, omega_2p, omega_2y, theta.
PLANES = signals.PrincipalPlanes(phi=0.041, mass=21.0, omega_p=11.40, omega_y=11.50, theta=radians(28.0))
#: The fit with the report's angle and mass, and the one with everything free.
REPORT = "theta = 28, M = 21"
MOST = "free + in phase + lag"
#: What is held, and what is added to the planes, in each fit; in the order of the tables.
VARIANTS: dict[str, tuple[dict[str, float], tuple[str, ...]]] = {
    "free": ({}, ()),
    "theta = 28": ({"theta": PLANES.theta}, ()),
    REPORT: ({"theta": PLANES.theta, "M": PLANES.mass}, ()),
    "one plane": ({"theta": 0.0, "omega_y": PLANES.omega_y}, ()),
    "free + in phase": ({}, ("R",)),
    "theta = 28 + in phase": ({"theta": PLANES.theta}, ("R",)),
    MOST: ({}, ("R", "lag")),
}
LARGEST_XI = 0.05  #: a damping factor above this is none of a structure (erratum E3IV-1)
#: Frequency of rigid-body rotation, rad/s (before Eq. 3.1.16).
OMEGA_R = 1.00


def table_3_i(table: pd.DataFrame) -> dict[str, float]:
    """omega = 2 pi f; tip displacements from accelerations (section 3.1); tail yaw by Eq. 3.1.1."""
    f, omega, F = columns(table, "frequency_hz", "omega_rad_s", "force_lb")
    pitch, yaw = columns(table, "tip_pitch_accel_g_per_lb_e4", "tip_yaw_accel_g_per_lb_e4")
    (tail_pitch,) = columns(table, "tail_pitch_disp_in_e2")
    return {
        **by_point("tab3I.omega", RAD_S_PER_HZ * f),
        **by_point("tab3I.tip_pitch", signals.displacement(1e-4 * pitch, omega, F)),
        **by_point("tab3I.tip_yaw", signals.displacement(1e-4 * yaw, omega, F)),
        **by_point("tab3I.tail_yaw", signals.yaw_displacement(yaw, pitch, tail_pitch)),
    }


def second_mode() -> tuple[signals.NodeMode, list[signals.NodeMode]]:
    """The second mode at the tail and the modes beside it (Table 3.II)."""
    modes = [signals.NodeMode(*row[1:]) for row in load_table("3_II").itertuples(index=False, name=None)]
    return modes[1], [modes[0], *modes[2:]]


def rigid_body(table: pd.DataFrame) -> float:
    """R^2/I that fits the corrections C_t2 of Table 3.III (not printed in the report), in/(lb s^2)."""
    F, omega = columns(load_table("3_I"), "force_lb", "omega_rad_s")
    (C_t,) = columns(table, "correction_Ct2_in")
    return signals.identify_r2_over_i(*second_mode(), F, omega, OMEGA_R, C_t)


def table_3_iii(table: pd.DataFrame) -> dict[str, float]:
    """Correction C_t2 (Eq. 3.1.20), modal phase (3.1.22), C_t2 cos phi_2 and modal amplitude (3.1.23).

    Also the energy put in per cycle, pi X_t F sin(phi_t) (Eq. 3.2.9), of Table 3.IV.
    """
    F, omega = columns(load_table("3_I"), "force_lb", "omega_rad_s")
    X, phi_t, C_t = columns(table, "tail_amplitude_in", "tail_phase_rad", "correction_Ct2_in")
    (phi_2,) = columns(table, "modal_phase_rad")
    correction = signals.node_correction(*second_mode(), F, omega, rigid_body(table), OMEGA_R)
    return {
        **by_point("tab3III.Ct2", correction.total),
        **by_point("tab3III.phi2", signals.modal_phase(X, phi_t, C_t, PLANES.phi)),
        **by_point("tab3III.Ccos", C_t * np.cos(phi_2)),
        **by_point("tab3III.A2", signals.modal_amplitude(X, phi_t, C_t, PLANES.phi, phi_2)),
        **by_point("tab3IV.E_input", signals.input_energy(X, F, phi_t)),
    }


def table_3_iv(table: pd.DataFrame) -> dict[str, float]:
    """Principal amplitudes (Eq. 3.2.12) and energies (3.2.13, 3.2.14) with the xi of each row.

    Also the root of Eq. 3.2.15 nearest to that xi, if any.
    """
    motion = signals.plane_motion(PLANES, _forces(table), *columns(table, "omega_rad_s", "xi"))
    points = list(table["point"])
    roots = by_point("tab3IV.xi", signals.nearest_roots(find_roots(table), table["xi"].to_numpy(float)), points)
    return {
        **{key: root for key, root in roots.items() if not np.isnan(root)},
        **by_point("tab3IV.A2p", motion.A_p, points),
        **by_point("tab3IV.A2y", motion.A_y, points),
        **by_point("tab3IV.E_pitch", motion.E_p, points),
        **by_point("tab3IV.E_yaw", motion.E_y, points),
    }


def find_roots(table: pd.DataFrame, planes: signals.PrincipalPlanes = PLANES) -> list[signals.DampingRoots]:
    """All solutions xi of Eq. 3.2.15 at the energy of each row of Table 3.IV.

    The energy lost, as a function of xi, rises to a maximum and falls again: an energy below it is lost at two values
    of xi, one above it, as at points 10 and 13 (E3IV-1), at none. "Trial and error" finds one of them.
    """
    rows = zip(_forces(table), *columns(table, "omega_rad_s", "energy_input_in_lb"), strict=True)
    return [signals.damping_roots(planes, F, omega, energy) for F, omega, energy in rows]


def equation_3_2_18(table: pd.DataFrame) -> dict[str, float]:
    """C_1 = (2 M/m) sum omega_i xi_i over the 15 rows that are not marked as corrected."""
    omega, xi = columns(table[table["corrected_row"] == 0], "omega_rad_s", "xi")
    return {"eq3218.C1": signals.mean_coefficient(PLANES.mass, omega, xi)}


def computed() -> dict[str, float]:
    """Every result of the chapter from the tables as printed.

    With them xi of the example after Eq. 3.2.16: omega = 11.39, F = 922, E = 114.5, the upper of two roots.
    """
    example = float(signals.damping_roots(PLANES, F=922.0, omega=11.39, energy=114.5).roots[-1])
    return {**_tables(load_table("3_I"), load_table("3_III"), load_table("3_IV")), "sec32.example_xi": example}


def after_correction() -> dict[str, float]:
    """The same from the corrected tables (Table 3.IV: with the frequency that its row 10 was computed at)."""
    return _tables(load_table("3_I", "corrected"), load_table("3_III", "corrected"), load_table("3_IV", "used"))


def _tables(table_i: pd.DataFrame, table_iii: pd.DataFrame, table_iv: pd.DataFrame) -> dict[str, float]:
    return {**table_3_i(table_i), **table_3_iii(table_iii), **table_3_iv(table_iv), **equation_3_2_18(table_iv)}


def _forces(table_iv: pd.DataFrame) -> FloatArray:
    """Force of each row of Table 3.IV (Table 3.I by point)."""
    points = table_iv[["point_number"]].merge(load_table("3_I"), left_on="point_number", right_on="point", how="left")
    return columns(points, "force_lb")[0]


def tabulate_points() -> pd.DataFrame:
    """Table 3.IV, the 15 rows that are not marked as corrected, with the force of Table 3.I."""
    table = load_table("3_IV").query("corrected_row == 0").reset_index(drop=True)
    return table.assign(force_lb=_forces(table))


def tabulate_branch(planes: signals.PrincipalPlanes = PLANES) -> pd.DataFrame:
    """By point: both roots, the printed xi, the branch it is on, and the energy in each plane on each branch.

    ``energy`` is put in; ``largest_energy`` can be lost, at ``xi_of_largest``; ``xi_low, xi_high``: NaN where there is
    no root; ``taken``: ``low``, ``high`` or ``none``; ``energy_printed``: lost at the printed xi; ``pitch_low`` and so
    on: energies lost in the planes; ``A_pitch_low, A_pitch_high``: amplitudes.
    """
    table = tabulate_points()
    roots = find_roots(table, planes)
    F, omega, energy, printed = columns(table, "force_lb", "omega_rad_s", "energy_input_in_lb", "xi")
    low, high = signals.branch(roots, 0), signals.branch(roots, -1)
    nearer = np.where(np.abs(low - printed) < np.abs(high - printed), "low", "high")
    lowest, highest = (signals.plane_motion(planes, F, omega, xi) for xi in (low, high))
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
            "energy_printed": signals.energy_loss(planes, F, omega, printed),
            "pitch_low": lowest.E_p,
            "yaw_low": lowest.E_y,
            "pitch_high": highest.E_p,
            "yaw_high": highest.E_y,
            "A_pitch_low": lowest.A_p,
            "A_pitch_high": highest.A_p,
        }
    )


def tabulate_mean() -> pd.DataFrame:
    """What the mean coefficient C_1 (Eq. 3.2.18) and the mean xi become on each branch.

    ``points`` counts the points that have a value; "xi of the largest energy" fills points 10 and 13, which have no
    root, with the xi at which the most is lost.
    """
    table = tabulate_points()
    roots = find_roots(table)
    omega, printed = columns(table, "omega_rad_s", "xi")
    none = np.array([point.roots.size == 0 for point in roots])
    peak = np.array([point.xi_peak for point in roots])
    low, high = signals.branch(roots, 0), signals.branch(roots, -1, LARGEST_XI)
    high_or_low = np.where(np.isnan(high), low, high)
    choices = {
        "as printed": printed,
        "as printed, points with a root": np.where(none, np.nan, printed),
        "the root nearest to each printed xi": signals.nearest_roots(roots, printed),
        "every low root": low,
        "every high root (below .05, else low)": high_or_low,
        "every low root, points 10 and 13 at the xi of the largest energy": np.where(none, peak, low),
        "every high root, points 10 and 13 at the xi of the largest energy": np.where(none, peak, high_or_low),
    }
    rows = [
        (choice, int(np.isfinite(xi).sum()), np.nanmean(xi), signals.mean_coefficient(PLANES.mass, omega, xi))
        for choice, xi in choices.items()
    ]
    return pd.DataFrame(rows, columns=["choice", "points", "mean_xi", "C_1"])
