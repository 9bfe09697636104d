"""No law of a few terms is the structure's own: how far the local exponent may stray from it, as a random process.

With z = ln F, a law's resonant amplitude has the slope q(z) = d ln A/d ln F = 1/p, the inverse of the local exponent
p = d ln F/d ln A. The structure's own slope is q + delta, delta an Ornstein-Uhlenbeck process of standard deviation
``sigma`` that forgets itself over ``LENGTH`` in z, so that the amplitude strays by

    g(z) = int_(z_0)^z delta dz,      cov(g(z), g(z')) = sigma^2 (h(z - z_0) + h(z' - z_0) - h(z - z')),
    h(u) = L^2 (exp(-|u|/L) - 1 + |u|/L).

A law strays in proportion to how nonlinear it is: sigma is a parameter times :func:`nonlinearity`. What is proportional
to force over a test seldom ceases to be.

Within the test the straying enters the covariance of the levels, so that laws are weighed and fitted with it. Beyond it
paths are drawn given what the levels leave over, and the slope q + delta is held within what damping can do.
"""

from __future__ import annotations

import numpy as np

from damping.arrays import FloatArray

#: How far in ln F a strayed slope is remembered: about a factor of four in force.
LENGTH = 1.5
#: Prior of the straying slope per unit of nonlinearity: median and log standard deviation, so that 5 % lie below 0.0035
#: and 5 % above 0.5. Tried on structures of the kinds of ``damping calibrate``, in and out of the library.
DOUBT_MEDIAN = 0.04
DOUBT_LOG_SD = 1.5
#: Nonlinearity |q - 1| of a law that seems linear: over a narrow test many are.
LINEAR = 0.04
#: Nonlinearity of damping that grows slower than amplitude (q > 1), over that of damping that grows faster: friction
#: and slip tend to a straight line, where growing damping may stop growing or grow faster still. Tried as above.
SLOWER = 0.3
#: A slope that strays upwards beyond the test strays by this factor more: joints let go sooner than they take hold.
STEEPER = 2.5
#: Slopes that damping can have: p from 3 (steeper than any force known of structures) down to 1/3 (slip in full).
SLOPES = (1.0 / 3.0, 3.0)


def stray_covariance(z: FloatArray, other: FloatArray, origin: float) -> FloatArray:
    """cov(g(z), g(other)) for sigma = 1, (z, other)."""

    def h(u: FloatArray) -> FloatArray:
        u = np.abs(u) / LENGTH
        return LENGTH**2 * (np.expm1(-u) + u)

    return np.asarray(h(z - origin)[:, None] + h(other - origin)[None, :] - h(z[:, None] - other[None, :]))


def stray(
    sigma: FloatArray,
    left: FloatArray,
    noise: FloatArray,
    at: FloatArray,
    grid: FloatArray,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """g on ``grid`` given what levels leave over: its mean, and one draw of it (Matheron's rule), each (draws, grid).

    Args:
        sigma: of each draw, (draws,). left: ln A of the levels less the law's, (draws, levels). noise: covariance of
            its errors, (draws, levels, levels). at, grid: ln F of the levels and of the grid.
    """
    origin = float(np.mean(at))
    n = len(at)
    both = np.concatenate([at, grid])
    prior = stray_covariance(both, both, origin)
    root = np.linalg.cholesky(prior + 1e-9 * np.eye(len(both)))
    drawn = sigma[:, None] * (rng.standard_normal((len(sigma), len(both))) @ root.T)
    errors = (np.linalg.cholesky(noise) @ rng.standard_normal((len(sigma), n, 1)))[..., 0]
    square = (sigma**2)[:, None, None] * prior[:n, :n] + noise
    wanted = np.stack([left, left - drawn[:, :n] - errors], axis=-1)
    gained = (sigma**2)[:, None, None] * (prior[n:, :n] @ np.linalg.solve(square, wanted))
    return gained[..., 0], drawn[:, n:] + gained[..., 1]


def nonlinearity(p: FloatArray) -> FloatArray:
    """By how much a law strays in proportion, from its exponents at both ends of the test (..., 2): (...).

    ``LINEAR`` and the mean of 1 - q, or of ``SLOWER`` (q - 1) where q > 1.
    """
    with np.errstate(divide="ignore"):
        q = np.clip(np.nan_to_num(1.0 / p, nan=0.0), *SLOPES)
    return np.asarray(LINEAR + np.mean(np.maximum(1.0 - q, SLOWER * (q - 1.0)), axis=-1))


def extend(log_A: FloatArray, strays: FloatArray, z: FloatArray) -> FloatArray:
    """ln A (draws, grid) beyond the test, from a law's and its straying g: slopes q exp(delta/q), held in ``SLOPES``.

    To first order q + delta, or q + ``STEEPER`` delta where delta > 0: an amplitude never falls with force, and may
    grow far where damping stops growing. NaN counts as steep.
    """
    step = np.diff(z)
    with np.errstate(invalid="ignore"):
        q = np.clip(np.nan_to_num(np.diff(log_A, axis=1) / step, nan=np.inf), *SLOPES)
    delta = np.diff(strays, axis=1) / step
    grown = np.minimum(np.where(delta > 0.0, STEEPER, 1.0) * delta / q, 10.0)  # far beyond ``SLOPES``
    slope = np.clip(q * np.exp(grown), *SLOPES)
    start = log_A[:, :1] + strays[:, :1]
    return np.concatenate([start, start + np.cumsum(slope * step, axis=1)], axis=1)
