"""First-harmonic steady states, with a solver for many bracketed roots at once.

They are the Ritz (Klotter) solutions of M q'' + K q + g(q, q') = F sin(omega t), K = M omega_n^2 (sec. 4.2).

With q = A sin(omega t - phi) the averages S, C of the force (`damping.forces.contract`) give

    (K - M omega^2) A + S = F cos(phi),    C = F sin(phi),

that is, F exp(i phi) = Z A with the complex stiffness Z = K - M omega^2 + (S + i C)/A. For pure damping these are
Eqs 4.2.3 and 4.2.4 with G = C/(M omega_n^2 A); the printed residuals before them and the factor in 4.2.2 do not lead
there (errata E421, E422). Every function takes numbers or arrays that broadcast, parameters of the force included.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from damping.arrays import FloatArray, Floats, take_rows
from damping.forces.contract import Force

#: A Newton step below this ends the search: it leaves an error near its square, below rounding for ln A of order one.
SMALL_STEP = 1e-8
#: Largest value, a logarithm, at such an end: beside a kink a step may be short far from the root.
SMALL_VALUE = 1e-6
#: Largest ratio of a Newton step to the step before; bisection converges faster than a larger one.
SHRINKING = 0.9
MOST_STEPS = 200  #: most steps: Newton's method needs about ten from a bracket; bisection alone, fifty more
_FAR = 1e15  #: amplitude, in any unit, beyond every relevant one; powers up to 20 of it stay finite
_WIDEST = 127.0  #: largest |ln A| searched: 55 decades, the fifth power of which is still finite
_GRID = np.arange(-46.0, 46.25, 0.25)  #: ln A of the scan for forces whose parts do not all grow with amplitude
#: Amplitudes solved at once: the dozen arrays of 100 kB stay in the cache, where those of all draws take 100 MB.
_AT_ONCE = 12_000


def bracketed_newton(
    function: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    low: FloatArray,
    high: FloatArray,
    start: FloatArray | None = None,
    *,
    rising: bool = False,
) -> FloatArray:
    """Roots by Newton's method, with bisection where a step would leave the bracket; NaN where a bracket is NaN.

    Args:
        function: value and derivative at an array of the shape of ``low``; each value changes sign in its bracket.
        low, high: ends of the brackets.
        start: first points, within the brackets; ``high`` by default.
        rising: whether each value is known to rise from below zero to zero or above.
    """
    side = np.True_ if rising else function(high)[0] >= 0.0
    u = high if start is None else start
    with np.errstate(all="ignore"):
        moved = high - low
        for _ in range(MOST_STEPS):
            value, derivative = function(u)
            of_high = (value >= 0.0) == side
            low, high = np.where(of_high, low, u), np.where(of_high, u, high)
            step = value / derivative
            newton, size = u - step, np.abs(step)
            converged = (size <= SMALL_STEP) & (np.abs(value) <= SMALL_VALUE)
            # strictly inside and shrinking, so that no two points lead to each other across a kink
            inside = ((newton > low) & (newton < high) & (size > SMALL_STEP) & (size < SHRINKING * moved)) | converged
            before, u = u, np.where(inside, newton, 0.5 * (low + high))
            moved = np.abs(u - before)
            if np.all(converged | ~(high - low > 1e-15 * np.abs(u))):
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


@dataclass(frozen=True)
class SteadyState:
    """Amplitude of the displacement and its lag behind the force (rad, 0 to pi), arrays of one shape."""

    amplitude: FloatArray
    phase: FloatArray


def balance(force: Force, A: Floats, omega: Floats, M: Floats, omega_n: Floats) -> tuple[Floats, ...]:
    """X = (K - M omega^2) A + S, dX/d ln A, C and dC/d ln A: force in phase with displacement and with velocity.

    The force amplitude that sustains A is F = |Z| A = hypot(X, C) (Eq 4.2.4).
    """
    linear = M * (omega_n**2 - omega**2) * A
    C, slope, S, slope_S = force.averages(A, omega)
    return linear + S, linear + slope_S, C, slope


def phase_lag(force: Force, A: Floats, omega: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """Phi = arg Z, 0 far below resonance and pi far above: Eq 4.2.3 with the quadrant kept."""
    X, _, C, _ = balance(force, A, omega, M, omega_n)
    return np.asarray(np.arctan2(C, X))


def backbone(force: Force, A: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """omega(A) at which the phase is pi/2: sqrt((K + S/A)/M); NaN where the joint stiffness is negative.

    No S of a force here depends on frequency: it is evaluated at ``omega_n``.
    """
    squared = omega_n**2 + force.in_phase(A, omega_n) / (M * A)
    return np.asarray(np.sqrt(np.where(squared > 0.0, squared, np.nan)))


def resonant_amplitude(force: Force, F: Floats, omega: Floats, near: Floats = 1.0) -> FloatArray:
    """Amplitude at phase resonance under the force F: the solution of C(A, omega) = F (Eqs 4.1.7, 4.2.7, 4.3.9).

    NaN where there is no resonance: friction holds (C >= F down to A = 0), or damping saturates and never reaches F
    (friction or slip alone). If a part of the force falls with amplitude (a negative coefficient), the result is the
    smallest A at which C rises through F, on a scan of 40 decades in steps of 0.25 in ln A.

    Args:
        force: damping force; its parameters may be arrays, such as posterior draws of shape (draws, 1).
        F: force amplitude(s) > 0.
        omega: frequency at resonance, rad/s.
        near: amplitude(s) where the search begins, NaN if unknown; the result does not depend on it.
    """
    shape = np.broadcast_shapes(np.shape(force.quadrature(1.0, omega)), np.shape(F), np.shape(omega))
    if len(shape) == 2 and shape[0] > (most := max(1, _AT_ONCE // max(1, shape[1]))):
        blocks = [slice(first, first + most) for first in range(0, shape[0], most)]
        parts = force, np.asarray(F), np.asarray(omega), np.asarray(near)
        return np.concatenate([resonant_amplitude(*take_rows(parts, block)) for block in blocks])
    with np.errstate(all="ignore"):
        exponents = force.energy_exponents
        if exponents is not None:  # in closed form A = (F/C(1, omega))^(1/(m - 1)), none for m <= 1
            ratio, power = np.asarray(F / force.quadrature(1.0, omega)), np.asarray(exponents[0]) - 1.0
            known = (ratio > 0.0) & np.isfinite(ratio) & (power > 0.0)
            return np.broadcast_to(np.where(known, ratio ** (1.0 / power), np.nan), shape).copy()
        target = np.broadcast_to(np.log(np.asarray(F, dtype=float)), shape)
        # whether no part falls with amplitude: each slope keeps its sign from zero to far amplitudes
        grows = all(bool(np.all(np.asarray(part.grow(_FAR, omega)[1]) >= 0.0)) for part in force.parts)
        grid = np.array([-_WIDEST, _WIDEST]) if grows else _GRID

        def excess(u: FloatArray) -> tuple[FloatArray, FloatArray]:
            C, slope = force.grow(np.exp(u), omega)
            return np.log(np.maximum(C, 0.0)) - target, np.broadcast_to(slope / C, shape)

        # ln C of growing powers is convex in ln A and nearly straight: Newton's method converges from any start
        start = np.broadcast_to(np.clip(np.nan_to_num(np.log(near)), -_WIDEST, _WIDEST), shape) if grows else None
        return np.exp(bracketed_newton(excess, *_find_rise(force, target, omega, grid), start, rising=True))


def phase_resonance(force: Force, F: Floats, M: Floats, omega_n: Floats) -> tuple[FloatArray, FloatArray]:
    """Amplitude and frequency (rad/s) with C(A, omega) = F and omega on the backbone; NaN where there is none.

    For pure damping the frequency is omega_n. Otherwise the two equations are solved in turn until the frequency
    converges to rounding, as it does if the restoring force is a small share of K A.
    """
    omega = np.asarray(omega_n * np.ones(np.shape(F)), dtype=float)
    for _ in range(MOST_STEPS):
        amplitude = resonant_amplitude(force, F, omega)
        previous, omega = omega, backbone(force, amplitude, M, omega_n)
        if not np.any(np.abs(omega - previous) > 1e-15 * previous):
            break
    converged = np.abs(omega - previous) <= 1e-12 * previous
    return np.where(converged, amplitude, np.nan), np.where(converged, omega, np.nan)


def steady_state(force: Force, F: Floats, omega: Floats, M: Floats, omega_n: Floats) -> SteadyState:
    """The unique steady state of a linear spring and damping that does not fall with amplitude.

    Newton's method in ln A solves ln(|Z| A) = ln F. It is convex in ln A for sums of powers with coefficients >= 0, so
    that the method converges from any start. NaN where no steady state exists (friction holds, or no damping at
    resonance). With a restoring force (slip, cubic stiffness) there may be several: use `damping.predict.branches`.
    """
    static = np.asarray(F / (M * omega_n**2), dtype=float)
    with np.errstate(all="ignore"):
        A = F / np.hypot(M * (omega_n**2 - omega**2), force.quadrature(static, omega) / static)
        for _ in range(MOST_STEPS):
            X, slope_X, C, slope = balance(force, A, omega, M, omega_n)
            squared = np.square(X) + np.square(C)
            step = 0.5 * np.log(squared / F**2) * squared / (X * slope_X + C * slope)
            A = A * np.exp(-np.clip(step, -3.0, 3.0))
            if not np.any(np.abs(step) > SMALL_STEP):
                break
        X, _, C, _ = balance(force, A, omega, M, omega_n)
        A = np.where(np.abs(np.hypot(X, C) / F - 1.0) < 1e-9, A, np.nan)
        return SteadyState(amplitude=A, phase=phase_lag(force, A, omega, M, omega_n))


def _find_rise(force: Force, target: FloatArray, omega: Floats, grid: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points of a grid in ln A between which C first rises through F; NaN if it does not. ``target``: ln F."""
    low, high = np.full(target.shape, np.nan), np.full(target.shape, np.nan)
    below = np.zeros(target.shape, dtype=bool)
    for before, u in zip(np.roll(grid, 1), grid, strict=True):
        excess = np.log(np.maximum(force.quadrature(np.exp(u), omega), 0.0)) - target
        rises = below & (excess >= 0.0) & np.isnan(low)
        low[rises], high[rises] = before, u
        below = excess < 0.0
    return low, high
