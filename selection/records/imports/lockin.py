"""Lock-in amplifiers: in-phase and quadrature readings, or magnitude and angle, to phasors.

An amplifier shows X = R cos(theta), Y = R sin(theta) of a signal R cos(omega t + theta) against its reference
cos(omega t); X + i Y is then the phasor with exp(i omega t), and theta > 0 leads. R is an rms value on most amplifiers
and a peak value on some, which only the user can say.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np
import numpy.typing as npt

from selection.arrays import FloatArray

#: Names that columns of readings have in the files of amplifiers, in lower case and without units, by role.
COLUMNS: dict[str, tuple[str, ...]] = {
    "frequency": ("frequency", "freq", "f", "ref frequency", "reference frequency"),
    "x": ("x", "in-phase", "inphase", "x1", "ch1 x"),
    "y": ("y", "quadrature", "y1", "ch1 y"),
    "amplitude": ("r", "mag", "magnitude", "r1"),
    "lead_deg": ("theta", "phase", "theta1"),
    "force_x": ("x2", "ch2 x", "reference x", "force x"),
    "force_y": ("y2", "ch2 y", "reference y", "force y"),
    "force": ("force", "r2", "force r"),
    "force_lead_deg": ("theta2", "force theta"),
}


def once(columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """The columns without magnitude and angle where in-phase and quadrature readings say the same."""
    twice = set()
    if {"x", "y"} <= set(columns):
        twice |= {"amplitude", "lead_deg"}
    if {"force_x", "force_y"} <= set(columns):
        twice |= {"force", "force_lead_deg"}
    return {role: values for role, values in columns.items() if role not in twice}


def cartesian(x: FloatArray, y: FloatArray) -> npt.NDArray[np.complex128]:
    """X + i Y, both (n, ...) alike."""
    phasor = np.empty(np.shape(x), dtype=np.complex128)
    phasor.real, phasor.imag = x, y  # infinities stay in their part, where i times one would spoil the other
    return phasor


def polar(r: FloatArray, theta_degrees: FloatArray) -> npt.NDArray[np.complex128]:
    """R exp(i theta), theta in degrees of lead."""
    phasor: npt.NDArray[np.complex128] = r * np.exp(1j * pi / 180.0 * theta_degrees)
    return phasor
