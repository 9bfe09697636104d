"""Many bracketed roots at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from selection.arrays import FloatArray

#: A Newton step below this leaves an error near its square, below rounding, of an unknown of order one (ln A).
SMALL_STEP = 1e-8
#: Newton's method needs about ten steps from a bracket; bisection alone, fifty more.
MOST_STEPS = 200


def bracketed_newton(
    function: Callable[[FloatArray], tuple[FloatArray, FloatArray]], low: FloatArray, high: FloatArray
) -> FloatArray:
    """Roots by Newton's method, bisecting wherever a step would leave the bracket; NaN where a bracket is NaN.

    Args:
        function: value and derivative at an array of the shape of ``low``; each value changes sign in its bracket.
        low, high: ends of the brackets.
    """
    side = function(high)[0] >= 0.0
    u = high
    with np.errstate(all="ignore"):
        for _ in range(MOST_STEPS):
            value, derivative = function(u)
            of_high = (value >= 0.0) == side
            low, high = np.where(of_high, low, u), np.where(of_high, u, high)
            newton = u - value / derivative
            inside = (newton >= low) & (newton <= high)
            previous, u = u, np.where(inside, newton, 0.5 * (low + high))
            moving = (np.abs(u - previous) > SMALL_STEP) & (high - low > 1e-15 * np.abs(u))
            if not np.any(moving):
                break
    return u


def bisect(function: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Where the sign of ``function`` changes, by bisection to rounding."""
    side = function(high) >= 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        of_high = (function(middle) >= 0.0) == side
        low, high = np.where(of_high, low, middle), np.where(of_high, middle, high)
    return 0.5 * (low + high)
