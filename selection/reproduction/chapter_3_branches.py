"""The damping factor of Eq. 3.2.15 at each point with all its roots: what Table 3.IV took, and what else it might have.

The energy lost, as a function of xi, rises to a maximum and falls again, so an energy below the maximum is lost at two
values of xi and one above it at none. "Trial and error" finds one of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from selection.arrays import FloatArray
from selection.conditioning.planar_fit import PlanarFit
from selection.conditioning.principal import (
    DampingRoots,
    PrincipalPlanes,
    branch,
    damping_roots,
    energy_loss,
    mean_coefficient,
    nearest_root,
    plane_motion,
)
from selection.records.report_tables import load_table
from selection.reproduction.chapter_3 import PLANES
from selection.reproduction.columns import columns

#: A damping factor above this is none of a structure (erratum E3IV-1).
LARGEST_XI = 0.05


def points() -> pd.DataFrame:
    """Table 3.IV, the 15 rows that are not marked as corrected, with the force of Table 3.I."""
    table = load_table("3_IV").query("corrected_row == 0").reset_index(drop=True)
    return table.assign(force_lb=load_table("3_I")["force_lb"])


def roots_at(planes: PrincipalPlanes, table: pd.DataFrame) -> list[DampingRoots]:
    """All solutions of Eq. 3.2.15 at each row of ``points``."""
    F, omega, energy = columns(table, "force_lb", "omega_rad_s", "energy_input_in_lb")
    return [damping_roots(planes, *row) for row in zip(F.tolist(), omega.tolist(), energy.tolist(), strict=True)]


def branch_table(planes: PrincipalPlanes = PLANES) -> pd.DataFrame:
    """By point: both roots, the printed xi, the branch it is on, and the energy in each plane on each branch.

    Columns: ``point, omega, energy`` (put in), ``largest_energy`` (that can be lost, at ``xi_of_largest``), ``roots``
    (number), ``xi_low, xi_high`` (NaN where none), ``xi_printed, taken`` (``low``, ``high`` or ``none``),
    ``energy_printed`` (lost at the printed xi), and ``pitch_low, yaw_low, pitch_high, yaw_high``: energies lost in the
    planes, and ``A_pitch_low, A_pitch_high``: amplitudes.
    """
    table = points()
    found = roots_at(planes, table)
    F, omega, energy, printed = columns(table, "force_lb", "omega_rad_s", "energy_input_in_lb", "xi")
    low, high = _low_and_high(found)
    motion = {name: plane_motion(planes, F, omega, xi) for name, xi in (("low", low), ("high", high))}
    return pd.DataFrame(
        {
            "point": table["point"],
            "omega": omega,
            "energy": energy,
            "largest_energy": [point.energy_peak for point in found],
            "xi_of_largest": [point.xi_peak for point in found],
            "roots": [point.roots.size for point in found],
            "xi_low": low,
            "xi_high": high,
            "xi_printed": printed,
            "taken": _taken(low, high, printed),
            "energy_printed": energy_loss(planes, F, omega, printed),
            **{
                f"{name}_{key}": value
                for key, m in motion.items()
                for name, value in (("pitch", m.E_p), ("yaw", m.E_y))
            },
            **{f"A_pitch_{key}": m.A_p for key, m in motion.items()},
        }
    )


def _low_and_high(found: Sequence[DampingRoots]) -> tuple[FloatArray, FloatArray]:
    return branch(found, 0), branch(found, -1)


def _taken(low: FloatArray, high: FloatArray, printed: FloatArray) -> list[str]:
    """The branch whose root is nearer to the printed xi."""
    nearer = np.where(np.abs(low - printed) < np.abs(high - printed), "low", "high")
    return np.where(np.isnan(low), "none", nearer).tolist()


def mean_table(planes: PrincipalPlanes = PLANES) -> pd.DataFrame:
    """What the mean coefficient C_1 (Eq. 3.2.18) and the mean xi become on each branch.

    ``points`` counts the points that have a value; "xi of the largest energy" fills points 10 and 13, which have no
    root, with the xi at which the most is lost.
    """
    table = points()
    found = roots_at(planes, table)
    omega, printed = columns(table, "omega_rad_s", "xi")
    none = np.array([point.roots.size == 0 for point in found])
    peak = np.array([point.xi_peak for point in found])
    low, high = branch(found, 0), branch(found, -1, LARGEST_XI)
    high_or_low = np.where(np.isnan(high), low, high)
    near = np.array([nearest_root(point.roots, xi) for point, xi in zip(found, printed, strict=True)])
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
