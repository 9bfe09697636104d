"""Candidate tests: what rows they would measure, and what they change in structure or instruments.

What to test next: the candidate test that should tell the explanations still alive apart best, by simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from scipy.special import logsumexp

from damping.arrays import FloatArray
from damping.effects.terms import ComplexArray, Terms, complex_stiffness
from damping.gap.fit import ModelFit
from damping.gap.model import STEP, Problem, residuals
from damping.gap.rows import Rows
from damping.gap.steady import Motion, steady

#: Rows of a sweep that does not repeat a measured one.
_ROWS = 40
#: Mass added for the second state, as a share of the modal mass.
ADDED_MASS = 0.2


@dataclass(frozen=True)
class ProposedTest:
    """A test that could be made next: what it is, why it tells, its rows (amplitudes yet unknown).

    ``change`` is what it does to the terms of any hypothesis. ``downwards``: rows are met from the top frequency down.
    """

    what: str
    why: str
    rows: Rows
    change: Callable[[Terms], Terms] = lambda terms: terms
    downwards: bool = False


def designs(problem: Problem) -> Iterator[ProposedTest]:
    """All tests that can be simulated row by row."""
    rows, scales = problem.rows, problem.scales
    top = highest_sweep(rows)
    low = rows.where(rows.sweep == np.flatnonzero(rows.level == rows.level.min())[0])
    yield ProposedTest("a sweep at twice the highest force", "effects grow apart with amplitude", _at(top, 2.0))
    yield ProposedTest("a sweep at half the lowest force", "effects part where amplitudes are small", _at(low, 0.5))
    band = np.linspace(-2.0, 2.0, _ROWS) * scales.reach
    yield ProposedTest(
        "a sweep of twice the band at the highest force",
        "other paths and other powers of frequency show far from resonance",
        _over(top, scales.omega_n * (1.0 + np.maximum(band, -0.8))),
    )
    near = scales.omega_n * (1.0 + np.linspace(-2.0, 2.0, _ROWS) * min(scales.bandwidth, scales.reach))
    yield ProposedTest("40 more points near resonance at the highest force", "damping decides there", _over(top, near))
    yield ProposedTest(
        "the highest sweep once more, downwards", "a bent resonance jumps at other places", top, downwards=True
    )
    if not rows.has_phase:
        noise = replace(rows, has_phase=True, sd_phase=rows.sd_amplitude)
        yield ProposedTest("the same sweeps with phase", "phase parts conservative from dissipative", noise)
    yield ProposedTest(
        "the highest sweep with another sensor", "errors of gain and phase stay with the sensor", top, without_sensor
    )
    heavier = _over(top, top.omega / sqrt(1.0 + ADDED_MASS))
    yield ProposedTest(
        f"a second state with a known mass of {ADDED_MASS:.0%} of the modal mass added",
        "it fixes the modal mass, and with it every factor on force and amplitude",
        heavier,
        with_mass(ADDED_MASS * scales.M),
    )


def highest_sweep(rows: Rows) -> Rows:
    """Rows of a sweep of the highest level."""
    return rows.where(rows.sweep == np.flatnonzero(rows.level == rows.level.max())[0])


def without_sensor(terms: Terms) -> Terms:
    """The terms read with a sensor that has neither the gain nor the lag of this one."""
    return replace(terms, gain=0.0 * np.asarray(terms.gain), lag=0.0 * np.asarray(terms.lag))


def with_mass(added: float) -> Callable[[Terms], Terms]:
    """The change of terms by a known mass that is added; the stiffness stays."""

    def change(terms: Terms) -> Terms:
        M = terms.M + added
        return replace(terms, M=M, omega_n=terms.omega_n * np.sqrt(terms.M / M))

    return change


def _at(rows: Rows, factor: float) -> Rows:
    """The rows at another force; amplitudes are a first guess."""
    return replace(rows, F=rows.F * factor, u=rows.u + np.log(factor))


def _over(rows: Rows, omega: FloatArray) -> Rows:
    """A sweep over other frequencies at the median force and with the median noise of rows."""
    n = len(omega)

    def middle(values: FloatArray) -> FloatArray:
        return np.full(n, float(np.median(values)))

    return Rows(
        row=np.arange(n),
        sweep=np.zeros(n, dtype=np.int64),
        sweeps=rows.sweeps[:1],
        level=rows.level[:1],
        F=middle(rows.F),
        omega=omega,
        u=np.interp(omega, rows.omega, rows.u),
        phase=np.zeros(n),
        mass=middle(rows.mass),
        time=np.zeros(n),
        label=np.zeros(n),
        up=np.ones(n),
        rate=np.zeros(n),
        added=np.zeros(n),
        sd_amplitude=middle(rows.sd_amplitude),
        sd_phase=middle(rows.sd_phase),
        has_phase=rows.has_phase,
    )


#: Explanations compared with the leading one, and the probability below which they are not alive.
MOST_RIVALS = 3
ALIVE = 0.01
_CYCLE = 256

#: A further channel: what terms make it read at rows.
Channel = Callable[[Terms, Rows], ComplexArray]


@dataclass(frozen=True)
class NextTest:
    """A test and the log odds it is expected to give for the leading explanation, if that is true, against the rest."""

    what: str
    why: str
    expected_log_odds: float


@dataclass(frozen=True)
class Rival:
    """An explanation that is alive."""

    fit: ModelFit
    probability: float


def ranked_tests(leading: ModelFit, rivals: Sequence[Rival]) -> tuple[NextTest, ...]:
    """Every candidate test with its expected log odds, the best first; none where nothing rivals the leading one.

    The log odds are those against all rivals together.
    """
    if not rivals:
        return ()
    found = []
    for design in designs(leading.model.problem):
        found.append(
            NextTest(design.what, design.why, _against_all([_odds(leading, r.fit, design) for r in rivals], rivals))
        )
    found.append(
        NextTest(
            "the third harmonic of the displacement at the highest force",
            "forces that are not linear in the motion distort it, instruments and paths do not",
            _against_all([_apart(_third_harmonic, leading, r.fit) for r in rivals], rivals),
        )
    )
    found.append(
        NextTest(
            "a cross-axis channel at the highest force",
            "a second principal plane moves across the drive, nothing else does",
            _against_all([_apart(_cross_axis, leading, r.fit) for r in rivals], rivals),
        )
    )
    return tuple(sorted(found, key=lambda test: -test.expected_log_odds))


def _against_all(odds: list[float], rivals: Sequence[Rival]) -> float:
    """ln of the odds against all rivals together, each as probable as it is now: -ln sum p e^-odds.

    A test that settles the case against one rival only leaves the others where they are.
    """
    p = np.array([max(rival.probability, 1e-12) for rival in rivals])
    return -float(logsumexp(-np.array(odds), b=p / p.sum()))


def _odds(leading: ModelFit, rival: ModelFit, design: ProposedTest) -> float:
    """Half the squared distance of the two predictions, in units of all that the rival leaves open.

    These are noise, repeatability, and the rival's parameters as far as the record has fixed them.
    """
    motion = _predicted(design.change(_terms(leading)), design)
    seen = replace(design.rows, u=motion.u, phase=motion.phase)
    k, sweeps = rival.model.size, len(seen.sweeps)
    steps = np.vstack([np.zeros(k), STEP * np.eye(k)])
    terms = design.change(rival.model.terms(rival.y[:k] + steps))
    found = residuals(terms, seen, np.zeros((k + 1, 2 * sweeps)), rival.model.scatter)
    J = (found.r[1:] - found.r[0]) / STEP
    C = _sweep_columns(seen, found.by_gain[0], rival.model.scatter.amplitude)
    C = np.vstack([C, _sweep_columns(seen, found.by_frequency[0], rival.model.scatter.frequency)])
    V = np.eye(J.shape[1]) + C.T @ C + J.T @ rival.covariance[:k, :k] @ J
    return 0.5 * float(found.r[0] @ np.linalg.solve(V, found.r[0]))


def _sweep_columns(rows: Rows, values: FloatArray, scatter: float) -> FloatArray:
    """Changes of the residuals by each sweep's deviation, (sweeps, m)."""
    one_hot = np.arange(len(rows.sweeps))[:, np.newaxis] == np.tile(rows.sweep, len(values) // len(rows))
    result: FloatArray = one_hot * values * scatter
    return result


def _terms(one: ModelFit) -> Terms:
    """The terms of a fit without any sweep's own deviation, values (1, 1)."""
    return one.model.terms(one.y[np.newaxis, : one.model.size])


def _predicted(terms: Terms, design: ProposedTest) -> Motion:
    if not design.downwards:
        return steady(terms, design.rows, design.rows.u)
    u, phase = design.rows.u.copy(), design.rows.phase.copy()
    before = None
    for number in range(len(u) - 1, -1, -1):
        one = design.rows.where(np.arange(len(u)) == number)
        motion = steady(terms, one, one.u if before is None else before)
        u[number], phase[number], before = motion.u[0], motion.phase[0], motion.u
    return Motion(u, phase)


def _apart(channel: Channel, one: ModelFit, other: ModelFit) -> float:
    """Half the squared distance of two hypotheses in a channel that the record does not have.

    Its noise is that of the smallest amplitudes of the record.
    """
    rows = highest_sweep(one.model.problem.rows)
    all_rows = one.model.problem.rows
    floor = float(np.min(all_rows.sd_amplitude * all_rows.A))
    motions = [channel(_terms(fit), rows) for fit in (one, other)]
    return 0.5 * float(np.sum(np.abs(motions[0] - motions[1]) ** 2)) / floor**2


def _third_harmonic(terms: Terms, rows: Rows) -> ComplexArray:
    """Third harmonic of the displacement, (n,): that of the forces over K - M (3 omega)^2."""
    motion = steady(terms, rows, rows.u)
    theta = 2.0 * np.pi * np.arange(_CYCLE)[:, np.newaxis] / _CYCLE
    A = np.exp(motion.u - np.ravel(terms.gain))
    cycle = sum((np.asarray(force.cycle(theta, A, rows.omega)) for force in terms.forces), start=np.zeros(1))
    third = 2.0 * np.mean(cycle * np.exp(-3j * theta), axis=0)
    M, omega_n = np.ravel(terms.M), np.ravel(terms.omega_n)
    return np.asarray(third / (M * rows.mass * (omega_n**2 - 9.0 * rows.omega**2)))


def _cross_axis(terms: Terms, rows: Rows) -> ComplexArray:
    """Motion across the drive, (n,): F sin(theta) cos(theta) (H_1 - H_2)."""
    if terms.plane is None:
        return np.zeros(len(rows), dtype=np.complex128)
    t, ratio = terms.plane.weight, terms.plane.ratio
    Z, _ = complex_stiffness(terms, np.exp(rows.u), rows.drive)
    second = Z + terms.M * rows.mass * np.square(terms.omega_n) * (np.square(ratio) - 1.0)
    return np.asarray((rows.F * np.sqrt(t) / (1.0 + t) * (1.0 / Z - 1.0 / second))[0])
