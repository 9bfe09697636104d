"""Model discrepancy: no law of a few terms is exact; the local exponent departs from it as a random process.

With z = ln F, a law's resonant amplitude has the slope q(z) = d ln A/d ln F = 1/p, the inverse of the local exponent
p = d ln F/d ln A. The structure's slope is q + delta, where delta is an Ornstein-Uhlenbeck process of standard
deviation ``sigma`` and correlation length ``LENGTH`` in z, so that ln A departs by

    g(z) = int_(z_0)^z delta dz,      cov(g(z), g(z')) = sigma^2 (h(z - z_0) + h(z' - z_0) - h(z - z')),
    h(u) = L^2 (exp(-|u|/L) - 1 + |u|/L).

sigma is a parameter times :func:`measure_nonlinearity`: an amplitude that is proportional to force over a test seldom
ceases to be.

Within the test the discrepancy enters the covariance of the levels, so that laws are weighed and fitted with it (of a
decay, whose forces are noisy, with ln A for z).
Levels of a decay are judged by ln F at their amplitude, which moves by p g: not at all under constant friction. Beyond
the test, paths are drawn given the residuals of the levels, and the slope q + delta is held within ``SLOPES``.

Amplitudes alone do not tell whether damping will stop growing; the resonance does. A joint that slips loses stiffness
as it dissipates: in partial slip C/A is 0.1 to 0.7 of its fall of S/A (a Masing loop of backbone k q - c q^n,
(n - 1) Gamma(n + 1)/(n sqrt(pi) Gamma(n + 1/2)); Rayleigh's 4/(3 pi) for n = 2). A damper, even one that saturates,
does not change the frequency. So the fall of M omega^2 over the loss F/A tells how probable a joint is, and how near to
full slip; by both, :func:`extend` widens or narrows the discrepancy. Where all levels have one frequency, a nonlinear
law may be that of a joint.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, logsumexp

from damping.arrays import FloatArray

LENGTH = 1.5  #: correlation length of the slope in ln F: about a factor of four in force
DISCREPANCY_MEDIAN = 0.04  #: prior median of sigma per unit of nonlinearity; tested as the next
#: Log standard deviation of that prior, so that 5 % lie below 0.0035 and 5 % above 0.5. Tested on structures of the
#: kinds of ``damping calibrate``, in and out of the library.
DISCREPANCY_LOG_SD = 1.5
LINEAR = 0.04  #: nonlinearity |q - 1| of a law that seems linear: over a narrow test many are
#: Nonlinearity of damping that grows slower than amplitude (q > 1), over that of damping that grows faster: friction
#: and slip tend to linear damping, while growing damping may stop growing or grow faster still. Tested as above.
SLOWER = 0.3
STEEPER = 2.5  #: factor on upward discrepancy beyond the test: joints let go sooner than they take hold
#: Prior probability of a joint, without the frequency: its share of the kinds of ``damping calibrate``.
JOINTS = 1.0 / 3.0
LIKELY = 0.5  #: probability of a joint from which a slipping joint is reported
#: Standard deviation of a joint's fall f >= 0 (half-normal): the fall of a Masing loop, 1.5 to 9 times its loss, times
#: the joint's share of the loss and the share of its fall within the test.
JOINT_FALL = 1.0
#: Standard deviations of f by other causes, with or without a joint: geometric springs may have any size, up or down.
OTHER_FALLS = np.array([0.03, 0.3, 3.0, 30.0])
OTHER_SHARES = np.array([0.7, 0.1, 0.1, 0.1])  #: their probabilities: mostly such causes do next to nothing
#: Prior median of the relative scatter of a measured resonance frequency, with the weight of one level.
FREQUENCY_SCATTER = 3e-4
#: Factor by which upward discrepancy is smaller where a joint is excluded: above 1.4 a damper that saturates exceeds
#: the band in a fifth of trials.
WITHOUT_JOINT = 1.3
#: Least standard deviation of ln slope, far beyond the test, for a joint about to slip fully, times posterior over
#: prior probability of a joint less 1. The discrepancy is widened where the levels give less.
LETS_GO = 0.45
#: Range of fall over loss of such a joint. Below it slip has only begun and the deviation is smaller in proportion;
#: above it most of the joint slips already. From the slopes of joints of ``damping calibrate`` from one to four times
#: the tested force.
FALLS_AT_GO = (0.5, 1.0)
#: The same deviation where no resonance tells a joint from a damper. Iwan joints of ``damping calibrate`` tested at one
#: frequency exceed the band in 6 of 20 trials with 0.35, in 5 with 0.6.
UNTOLD = 0.6
BENT = 0.5  #: least |q - 1| of a law for which that holds; for others it is smaller in proportion
#: Standard deviation of ln slope, upwards, where damping but no joint fails at the top of the test, for a linear law;
#: for others less in proportion. An eddy-current damper tested to 77 % of its critical speed has slopes of 2.2 from 1
#: to 2 times the tested force, twice those of the levels.
FAILS = 1.0
#: First step in ln F beyond the test between places at which paths are drawn. They do not depend on the forces asked
#: for, so that a prediction at one force does not change with another. Steps a third as long move the upper end of the
#: Saturn V's band at three times the tested force by 1.6 %.
FIRST_STEP = 0.15
STEP_GROWTH = 1.1  #: ratio of successive steps
#: Range of slopes that damping can have: p from 4 (a Bouc-Wen joint of exponent 3 that begins to slip, C/A of A^3,
#: steeper than any force measured on structures) down to 1/3 (full slip).
SLOPES = (0.25, 3.0)
#: Largest slope d ln A/d ln F of a law of a decay, where force follows from amplitude and hardly changes with friction.
#: Beyond it laws would differ only at amplitudes that no test reaches.
OF_FRICTION = 20.0


class JointEvidence(NamedTuple):
    """Evidence of the resonances for a joint."""

    probability: float = JOINTS  #: of a joint
    fall: float = 0.0  #: of stiffness over the loss F/A
    informative: bool = False  #: whether the resonances tell anything; if all levels have one frequency they do not
    #: certainty, 0 to 1, that damping fails at the top of the test without a slipping joint, as of an eddy-current
    #: damper beyond its critical speed
    failing: float = 0.0


ANY_JOINT = JointEvidence()  #: without information from the resonances


def place_steps(farthest: float) -> FloatArray:
    """Places of paths in ln(F/largest tested force), (steps,): from 0 to ``farthest`` or just beyond."""
    number = np.log1p(max(farthest, 0.0) * (STEP_GROWTH - 1.0) / FIRST_STEP) / np.log(STEP_GROWTH)
    return np.asarray(FIRST_STEP * (STEP_GROWTH ** np.arange(np.ceil(number) + 1.0) - 1.0) / (STEP_GROWTH - 1.0))


def covary_discrepancy(z: FloatArray, other: FloatArray, origin: float) -> FloatArray:
    """cov(g(z), g(other)) for sigma = 1, (z, other)."""

    def h(u: FloatArray) -> FloatArray:
        u = np.abs(u) / LENGTH
        return LENGTH**2 * (np.expm1(-u) + u)

    return np.asarray(h(z - origin)[:, None] + h(other - origin)[None, :] - h(z[:, None] - other[None, :]))


def measure_nonlinearity(p: FloatArray) -> FloatArray:
    """Nonlinearity (...) of a law, from exponents at both ends of the test (..., 2): sigma is proportional to it.

    ``LINEAR`` plus the mean of 1 - q, or of ``SLOWER`` (q - 1) where q > 1.
    """
    with np.errstate(divide="ignore"):
        q = np.clip(np.where(np.isnan(p), 0.0, 1.0 / p), *SLOPES)
    return np.asarray(LINEAR + np.mean(np.maximum(1.0 - q, SLOWER * (q - 1.0)), axis=-1))


def find_joint(
    amplitude: FloatArray, force: FloatArray, omega: FloatArray, mass: FloatArray, tolerance: float, apart: float = 0.0
) -> JointEvidence:
    """Evidence for a slipping joint, from the resonances of the levels and their masses, (levels,) each.

    f is the fall of M omega^2 over the range of amplitudes, by a straight line, in units of F/A at the largest force.
    s is its error: scatter about the line, ``FREQUENCY_SCATTER``, the relative ``tolerance`` of a mass common to all
    levels, and ``apart``, that of each level's mass separately. For a joint f = |N(0, a^2)| + N(0, b^2 + s^2), for all
    else f = N(0, b^2 + s^2), with a = ``JOINT_FALL`` and b of ``OTHER_FALLS``. Nothing is known where every level has
    the same frequency or amplitude.
    """
    x = amplitude - amplitude.mean()
    spread = float(x @ x)
    if not np.ptp(omega) > 0.0 or not spread > 0.0:
        return ANY_JOINT
    top = int(np.argmax(force))
    per_loss = amplitude[top] / force[top]
    stiffness = (mass * omega**2 - mass[top] * omega[top] ** 2) * per_loss
    slope, of_mass = np.array([stiffness, tolerance * mass * (omega**2 - omega[top] ** 2) * per_loss]) @ x / spread
    residual = stiffness - stiffness.mean() - slope * x
    of_level = mass[top] * omega[top] ** 2 * per_loss * np.hypot(2.0 * FREQUENCY_SCATTER, apart)
    variance = (of_level**2 + residual @ residual) / max(len(x) - 1, 1)
    fall, error = -slope * np.ptp(x), np.hypot(np.sqrt(variance / spread), of_mass) * np.ptp(x)
    other = np.hypot(OTHER_FALLS, error)
    joint = np.hypot(JOINT_FALL, other)
    log_other = -0.5 * (fall / other) ** 2 - np.log(other)
    log_joint = -0.5 * (fall / joint) ** 2 - np.log(joint) + np.log(2.0) + log_ndtr(fall * JOINT_FALL / other / joint)
    odds = logsumexp(log_joint, b=OTHER_SHARES) - logsumexp(log_other, b=OTHER_SHARES)
    return JointEvidence(float(1.0 / (1.0 + np.exp(-odds) * (1.0 - JOINTS) / JOINTS)), float(fall), informative=True)


def extend(
    log_A: FloatArray,
    discrepancy: FloatArray,
    z: FloatArray,
    joint: JointEvidence,
    *,
    lets_go: bool = True,
    of_decay: bool = False,
) -> FloatArray:
    """ln A (draws, places) beyond the test, from a law's ln A and g: slopes q exp(delta/q) within ``SLOPES``.

    To first order q + delta, or q + ``STEEPER`` delta where delta > 0: an amplitude never falls with force, and may
    grow far where damping stops growing. NaN counts as steep. ``lets_go``: whether a joint may slip fully.
    ``of_decay``: whether a law's slope q may reach ``OF_FRICTION``.
    """
    lean = joint.probability / JOINTS - 1.0  # above 0 if the levels speak for a joint
    step, steepest = np.diff(z), OF_FRICTION if of_decay else SLOPES[1]
    with np.errstate(invalid="ignore"):
        q = np.clip(np.nan_to_num(np.diff(log_A, axis=1) / step, nan=np.inf), SLOPES[0], steepest)
    delta = np.diff(discrepancy, axis=1) / step
    grown = np.where(delta > 0.0, STEEPER * WITHOUT_JOINT ** min(lean, 0.0), 1.0) * delta / q  # change of ln slope
    if lets_go:
        near = np.interp(joint.fall, [0.0, *FALLS_AT_GO], [0.0, 1.0, 1.0]) / max(joint.fall / FALLS_AT_GO[1], 1.0)
        untold = UNTOLD * np.minimum(np.abs(q[:, :1] - 1.0) / BENT, 1.0)
        least = (LETS_GO * max(lean, 0.0) * near if joint.informative else untold) * -np.expm1((z[0] - z[:-1]) / LENGTH)
        spread = np.sqrt(np.mean(np.minimum(np.abs(grown), 1.0) ** 2, axis=0))  # of the change by the discrepancy alone
        grown *= np.hypot(1.0, least / np.maximum(spread, 1e-6))
        known = np.clip((q[:, :1] - 1.0) / BENT, 0.0, 1.0)  # a law whose damping grows slower tells of the failing
        fails = FAILS * joint.failing * (1.0 - known) / np.maximum(spread, 1e-6)
        grown *= np.where(grown > 0.0, np.hypot(1.0, fails), 1.0)
    # slopes end at ``SLOPES``, or at the law's slope; 10 only prevents overflow
    slope = np.clip(q * np.exp(np.minimum(grown, 10.0)), SLOPES[0], np.maximum(q, SLOPES[1]))
    start = log_A[:, :1] + discrepancy[:, :1]
    return np.concatenate([start, start + np.cumsum(slope * step, axis=1)], axis=1)


def read_path(
    path: FloatArray, on_steps: FloatArray, of_law: FloatArray, asked: FloatArray, steps: FloatArray
) -> FloatArray:
    """ln A (draws, asked) of paths (draws, steps), interpolated between steps as the law's ln A where that is finite.

    ``on_steps``, ``of_law``: ln A of the law at the steps and at the forces ``asked``; ``asked``, ``steps``: ln F.
    """
    after = np.minimum(np.searchsorted(steps, asked), len(steps) - 1)  # rounding may leave the last step short
    even = (asked - steps[after - 1]) / np.diff(steps)[after - 1]
    with np.errstate(all="ignore"):
        share = (of_law - on_steps[:, after - 1]) / (on_steps[:, after] - on_steps[:, after - 1])
        share = np.where(np.isfinite(share), share, even)
        return np.asarray(path[:, after - 1] + share * (path[:, after] - path[:, after - 1]))
