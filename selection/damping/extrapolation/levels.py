"""What the tested levels tell: how the local exponent changes, bistability, a joint that slips, and the mass."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri, stdtr

from damping.arrays import FloatArray, IntArray
from damping.infer.discrepancy import JointEvidence, find_joint
from damping.infer.observations import Observations
from damping.records.mode import Mode

REPORTED = 1.64  #: standard normal quantile (one-sided 5 %) beyond which a change of p is reported
#: Scatter of resonances before any is seen, and the degrees of freedom it is worth: a median of 1.2 %, as of the prior
#: of laws. At three levels that scatter by 3 % a constant p then seems to fall in 5 % of tests.
EXPECTED = (0.0078, 1.0)
#: Scatter, the upper end of the prior of laws: a change of many times this is real, however much the levels scatter.
LARGEST_SCATTER = 0.04
CERTAIN = 1e9  #: degrees of freedom of a scatter that is known
#: Factor on the probability of a change in more than three sweeps: two for two shapes, two for tests that scatter more
#: than expected. At a scatter of 3 % a constant p then seems to fall in 4 to 5 % of tests, at 1 % in at most 2 %.
LOOKS = 4.0
_TINY = 1e-300  #: least probability, so that its quantile is finite


@dataclass(frozen=True)
class Trend:
    """Local exponents between neighbouring levels, lowest first."""

    force: FloatArray  #: geometric mean of the two forces, (levels - 1,)
    p: FloatArray  #: exponent, (levels - 1,)
    sd: FloatArray  #: its standard deviation by the scatter of resonances, (levels - 1,)
    #: change of p over the test or at its top level, a standard normal deviate; NaN with fewer than three levels
    z: float

    @property
    def rising(self) -> bool:
        """Whether p rises at the top of the test: damping grows faster than below."""
        return bool(self.z > REPORTED)

    @property
    def falling(self) -> bool:
        """Whether p falls at the top of the test: amplitudes grow faster than below."""
        return bool(self.z < -REPORTED)

    @property
    def failing(self) -> float:
        """Confidence, 0 to 1, that p falls: 1 from the change that is reported, 0 up to half of it."""
        return float(np.clip(np.nan_to_num(-self.z) / (0.5 * REPORTED) - 1.0, 0.0, 1.0))


def expect_scatter(stated: float) -> tuple[float, float]:
    """Prior scatter by which a change of p is judged, and the degrees of freedom it is worth; ``stated``: 0 if none."""
    return (stated, CERTAIN) if stated > LARGEST_SCATTER else EXPECTED


def find_trend(data: Observations, scatter: float, expected: tuple[float, float] | None = None) -> Trend:
    """Local exponents of the tested resonances, repeats of a level averaged.

    Args:
        scatter: relative scatter of one sweep's resonant amplitude; for a decay, of its force.
        expected: as of `expect_scatter`; by default ``scatter``, as known. The scatter of a fit of laws may contain the
            change.
    """
    levels, of_decay = data.levels, data.amplitude_is_input
    count = np.bincount(levels)
    each_F, each_A = np.log(data.tested_force), np.log(data.tested_amplitude)
    log_F, log_A = (np.bincount(levels, v) / count for v in (each_F, each_A))
    step_F, step_A = np.diff(log_F), np.diff(log_A)
    with np.errstate(divide="ignore", invalid="ignore"):
        p = np.where(step_A > 0.0, step_F / step_A, np.nan)
        slope = (1.0 if of_decay else p) / step_A  # change of p with the scattering quantity: decay ln F, else ln A
    sd = np.abs(slope) * scatter * np.sqrt(1.0 / count[:-1] + 1.0 / count[1:])
    force = np.exp(0.5 * (log_F[:-1] + log_F[1:]))
    if len(p) < 2 or np.isnan(p).any():
        return Trend(force, p, sd, np.nan)
    known = expected or (scatter, CERTAIN)
    z = find_bend(each_A, each_F, levels, *known) if of_decay else -find_bend(each_F, each_A, levels, *known)
    return Trend(force, p, sd, z)  # p falls where ln A(ln F) bends upwards


def find_bend(x: FloatArray, y: FloatArray, levels: IntArray, scatter: float, freedom: float) -> float:
    """Bend of y(x) as a standard normal deviate; x, y, ``levels`` of each sweep: (sweeps,).

    Two bends are fitted, each beside a straight line: a parabola, and a step at the top level. The squares S that n
    sweeps leave give the variance s^2 = (``freedom`` ``scatter``^2 + S)/(``freedom`` + n - 3), so that a bend over its
    standard deviation follows Student's t; it is at most as probable as at a known scatter of ``LARGEST_SCATTER``. The
    less probable bend counts, its probability times ``LOOKS`` (Bonferroni).
    """
    line, left = np.column_stack([x - x.mean(), np.ones(len(x))]), len(x) - 3
    found = []
    for shape in (line[:, 0] ** 2, levels == levels.max()):  # with three levels both are the same
        design = np.column_stack([shape, line])
        covariance = np.linalg.inv(design.T @ design)
        fitted = covariance @ design.T @ y
        bend, squares = fitted[0] / np.sqrt(covariance[0, 0]), np.sum((y - design @ fitted) ** 2)
        s = np.sqrt((freedom * scatter**2 + squares) / (freedom + left))
        tail = min(stdtr(freedom + left, -abs(bend) / s), ndtr(-abs(bend) / max(LARGEST_SCATTER, scatter)))
        found.append((tail * (LOOKS if left else 1.0), bend))
    tail, bend = min(found)
    return float(np.copysign(ndtri(np.clip(tail, _TINY, 0.5)), bend))


#: Shift of the resonance, in half-power bandwidths, from which a mode counts as bistable: at 0.77, 4/(3 sqrt(3)), a
#: cubic spring makes the response curve vertical; the margin is for the error of the mass.
BISTABLE = 1.0
#: Caution of bistability for measured resonances, with the shift in bandwidths.
OF_LEVELS = (
    "the resonance moved by {:.1f} half-power bandwidths over the levels: the mode is bistable at high drive "
    "and its amplitude depends on how it is driven there"
)
#: The same for a predicted resonance.
OF_PREDICTED = (
    "the resonance is predicted to move by {:.1f} half-power bandwidths from that of the lowest level: the mode is "
    "bistable there, and a sweep may jump before it reaches this amplitude"
)


def read_resonances(data: Observations, mode: Mode) -> tuple[str, JointEvidence]:
    """A caution of bistability, and the evidence for a slipping joint, from the levels' resonance frequencies.

    Added mass is taken as exact. Each mass that the record gives for a sweep has the mode's tolerance as its error. If
    the mode was taken from the record (``from_record``), these masses are estimates of one mass, the mode's.
    """
    error, tested = mode.tolerance.mass, (data.tested_amplitude, data.tested_force, data.tested_omega)
    added, top = 0.0 if data.added_mass is None else data.added_mass, data.top
    state = mode.find_states(data.tested_mass, len(data.sweeps)) + added
    width = data.tested_force[top] / (state[top] * data.tested_omega[top] * data.tested_amplitude[top])
    bistable = describe_bistability(data.tested_omega * np.sqrt(state / state[top]), float(width))
    mass = mode.mass + added * np.ones(len(data.sweeps))
    if data.tested_mass is None or mode.tolerance.from_record:
        return bistable, find_joint(*tested, mass, error)
    swept_mass = np.where(np.isnan(data.tested_mass), mode.mass, data.tested_mass)
    return bistable, find_joint(*tested, mass - mode.mass + swept_mass, error, apart=error)


def describe_state(data: Observations, mode: Mode) -> str:
    """The mass for which predictions hold, if the levels had several; else empty."""
    mass, top = mode.find_states(data.tested_mass, len(data.sweeps)), data.top
    known = f"levels of masses {mass.min():.4g} to {mass.max():.4g}: frequencies and damping ratios hold for"
    return f"{known} {mass[top]:.4g}, that of the largest level" if np.ptp(mass) > 0.0 else ""


def describe_bistability(omega: FloatArray, width: float, caution: str = OF_LEVELS) -> str:
    """The ``caution`` if one force and frequency probably has two stable amplitudes; else empty.

    ``omega``: resonances at one mass, rad/s. ``width``: half-power bandwidth 2 zeta omega = F/(M omega A) of the
    resonance of largest amplitude. A cubic spring that moves the resonance by 4/(3 sqrt(3)) bandwidths makes the
    response curve vertical somewhere.
    """
    moved = float(np.ptp(omega)) / width
    return caution.format(moved) if moved >= BISTABLE else ""
