"""Accelerations to displacements, and the yaw motion of nodes that were measured in pitch only (section 3.1)."""

from __future__ import annotations

from selection.arrays import Floats
from selection.units import STANDARD_GRAVITY_REPORT_IN_S2


def displacement(
    acceleration: Floats, omega: Floats, force: Floats = 1.0, unit: float = STANDARD_GRAVITY_REPORT_IN_S2
) -> Floats:
    """Amplitude of displacement, x = unit a F/omega^2 (section 3.1, Table 3.I).

    Args:
        acceleration: amplitude a of acceleration, per unit of force where ``force`` is given.
        omega: frequency, rad/s.
        force: force amplitude F that a reading per unit of force is multiplied by (the report's text leaves it out,
            its table does not: erratum E3I-5).
        unit: length/s^2 of one unit of acceleration; the report's g of 386 in/s^2 by default.
    """
    return unit * acceleration * force / omega**2


def yaw_displacement(yaw_acceleration: Floats, pitch_acceleration: Floats, pitch_displacement: Floats) -> Floats:
    """Yaw displacement of a node = (tip yaw acceleration/tip pitch acceleration) pitch displacement (Eq. 3.1.1).

    Holds where the yaw mode shape is that of pitch. Accelerations in one unit; the result in that of the displacement.
    """
    return yaw_acceleration / pitch_acceleration * pitch_displacement
