"""A linear mode under a force in time, exact where the force is straight between samples."""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete, lfilter, ss2tf


def accelerate(force: np.ndarray, step: float, omega_n: float, ratio: float, mass: float) -> np.ndarray:
    """Acceleration (n,) from rest under a ``force`` that begins at zero, given every ``step`` seconds.

    A filter of the exact step: `scipy.signal.lsim` gives the same in a hundred times as long.
    """
    states = np.array([[0.0, 1.0], [-(omega_n**2), -2.0 * ratio * omega_n]])
    push = np.array([[0.0], [1.0 / mass]])
    numerator, denominator = ss2tf(*cont2discrete((states, push, states[1:], push[1:]), step, "foh")[:4])
    return lfilter(numerator[0], denominator, force)
