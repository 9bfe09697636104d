"""What to test next: of the rows that a record can hold, those that should tell explanations still alive apart best.

Each candidate is simulated with the leading explanation and fitted by each rival to first order: half the squared
distance of the two predictions, in units of all that the rival leaves open, is the log odds D to be expected (Chaloner
and Verdinelli 1995, design for discrimination between models). How probable the leading explanation will then be, if it
is true, follows by the rules of every answer, which trust most what is measured beyond first harmonics of one state
(`damping.gap.weighing.blend_probabilities`). The test that comes first is the mildest of those that settle the case:
one that leaves what was tested also shows what no model of it holds.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from math import sqrt
from pathlib import Path
from shlex import join

import numpy as np
from scipy.special import logsumexp

from damping.arrays import RAD_S_PER_HZ
from damping.effects.contract import Terms
from damping.effects.rig import recorded_third
from damping.effects.terms import cross_motion
from damping.gap.fit import ModelFit
from damping.gap.model import STEP, Problem, residuals, steady
from damping.gap.problem import State
from damping.gap.rows import UNSEEN, Rows
from damping.gap.simulation import Simulate
from damping.gap.unknowns import FURTHER_ERROR
from damping.gap.weighing import COVER, INDISTINCT, Explanation, count_beyond, distance, foresee_probability

#: Rows of a sweep.
_POINTS = 40
#: Masses added for a second state, as shares of the modal mass.
ADDED_MASSES = (0.2, 0.5)
#: Noise of a harmonic analyser over the largest amplitude.
FLOOR = 3e-4
#: Expected log odds D below which a test is not worth its time: what it gives scatters by sqrt(2 D), and of 6 it is
#: above 3, 20 to 1, in four of five.
WORTH = 6.0
#: Standard deviations sqrt(2 D) below D at which a test is still to settle the case: it does so in 39 of 40.
SURELY = 2.0
#: Explanations compared with the leading one.
MOST_RIVALS = 3
#: Log odds beyond which a number is not told: as good as certain by any model, and no model is that good.
CERTAIN = 100.0

_SWEEP = ("force", "frequency", "amplitude")
_THIRD = ("amplitude_3", "phase_3")
#: Columns of a record that further rows have to fill, or say nothing of what the others do.
_KEPT = ("phase", "energy", "amplitude_sd", "phase_sd", "force_sd", "sweep_rate", "time")


@dataclass(frozen=True)
class ProposedTest:
    """A test that could be made next: what it is, why it tells, the columns that it fills beside those of a sweep.

    ``width`` of the sweep over that of the record, 0 for the vicinity of resonance; ``factor`` on the highest force, or
    on the ``lowest``; ``heavier``: added mass over the modal mass. ``channel``: a further one that is measured.
    ``change`` is what it does to the terms of any hypothesis.
    """

    what: str
    why: str
    columns: tuple[str, ...] = ()
    width: float = 1.0
    factor: float = 1.0
    lowest: bool = False
    heavier: float = 0.0
    channel: str = ""
    change: Callable[[Terms], Terms] = lambda terms: terms

    def plan(self, problem: Problem) -> Rows:
        """Its rows, after those of the record, with the amplitudes of the sweep run again as far from its resonance.

        A further channel has the noise that it has in the record; else that of the smallest amplitudes, or of `FLOOR`.
        """
        rows, scales = problem.rows.where(problem.rows.state == 0.0), problem.scales  # the state that is added to
        level = rows.level.min() if self.lowest else rows.level.max()
        reach = self.width * max(scales.reach, 4.0 * scales.bandwidth)
        if not self.width:
            reach = 2.0 * min(scales.bandwidth, scales.reach or scales.bandwidth)
        band = 1.0 + np.maximum(np.linspace(-1.0, 1.0, _POINTS) * reach, -0.8)
        again = rows.where(rows.sweep == np.flatnonzero(rows.level == level)[0])
        planned = again.taken(np.argmin(np.abs(again.omega[:, np.newaxis] - scales.omega_n * band), axis=0))
        u = planned.u + np.log(self.factor)
        F, added = float(np.median(again.bare_force)) * self.factor, self.heavier * scales.M
        shaken = float(np.median(again.shaken))
        sd_amplitude = float(np.median(again.sd_amplitude))
        floor = min(float(np.min(sd_amplitude * np.exp(u))), FLOOR * float(np.max(np.exp(u))))
        sd = {name: np.full(_POINTS, UNSEEN) for name in ("third", "cross")}
        if self.channel:
            known = float(getattr(rows, f"sd_{self.channel}").min())
            sd[self.channel] = np.full(_POINTS, known if known < UNSEEN else floor)
        turn = np.arange(_POINTS)[:: 1 if again.up[0] > 0.0 else -1]
        return replace(
            planned,
            row=np.arange(_POINTS),
            sweep=np.zeros(_POINTS, dtype=np.int64),
            F=np.full(_POINTS, F * (1.0 + added / shaken) if shaken else F),
            omega=scales.omega_n * band / sqrt(1.0 + self.heavier),
            u=u,
            resonant=np.zeros(_POINTS, dtype=bool),
            time=0.5 + (1.0 + turn) / max(len(rows) - 1, 1),
            label=np.zeros(_POINTS),
            rate=planned.rate * ("sweep_rate" not in self.columns),
            added=np.full(_POINTS, added),
            sd_amplitude=np.full(_POINTS, sd_amplitude),
            sd_phase=np.full(_POINTS, float(np.median(again.sd_phase))),
            sd_third=sd["third"],
            sd_cross=sd["cross"],
            channels=(self.channel,) if self.channel else (),
        )


def _with_third(design: ProposedTest) -> ProposedTest:
    """The same with the third harmonic."""
    return replace(
        design,
        what=f"{design.what}, with the third harmonic of the displacement",
        why=f"{design.why}; forces that are not linear in the motion distort it, paths and gains do not",
        columns=(*design.columns, *_THIRD),
        channel="third",
    )


def _add_mass(share: float, factor: float = 1.0) -> ProposedTest:
    """A second state."""
    return ProposedTest(
        f"a second state with a known mass of {share:.0%} of the modal mass added"
        + (f", at {factor:g} times the highest force" if factor > 1.0 else ""),
        "it moves the frequency and fixes the modal mass, and with it every factor on force and amplitude",
        ("added_mass",),
        factor=factor,
        heavier=share,
    )


#: Tests of the displacement along the drive, the mildest first.
_ALONG = (
    ProposedTest("a sweep at the highest force", "what else it holds is measured beside it"),
    ProposedTest(f"{_POINTS} more points near resonance at the highest force", "damping decides there", width=0.0),
    ProposedTest("a sweep at half the lowest force", "effects part with amplitude", factor=0.5, lowest=True),
    ProposedTest(
        "a sweep of twice the band at the highest force",
        "other paths and other powers of frequency show far from resonance",
        width=2.0,
    ),
    *map(_add_mass, ADDED_MASSES),
    ProposedTest("a sweep at twice the highest force", "effects part with amplitude", factor=2.0),
    *(_add_mass(share, 2.0) for share in ADDED_MASSES),
)
#: All tests that a record can hold, the mildest first.
DESIGNS = (
    ProposedTest(
        "the highest sweep again, each frequency held until the motion is steady",
        "what a moving frequency does is gone",
        ("sweep_rate",),
        change=lambda terms: terms._replace(moving=()),
    ),
    ProposedTest(
        "the motion across the measured axis at the highest force",
        "a second principal plane moves across the drive, nothing else does",
        ("amplitude_y", "phase_y"),
        channel="cross",
    ),
    *chain.from_iterable((design, _with_third(design)) for design in _ALONG),
)


@dataclass(frozen=True)
class NextTest:
    """A test with the log odds it is expected to give for the leading explanation, if that is true, against the rest.

    ``probability``: that this explanation then has, where the test gives ``SURELY`` standard deviations less.
    ``columns``: those that the new rows fill. ``rows``: what is to be run, in numbers (force, Hz, added mass).
    ``command`` reads them once they are appended.
    """

    what: str
    why: str
    expected_log_odds: float
    probability: float
    columns: tuple[str, ...]
    rows: tuple[dict[str, float], ...]
    command: str

    @property
    def is_beyond(self) -> bool:
        """Whether it gives more than first harmonics of one state (`damping.gap.weighing.count_beyond`)."""
        return not {"added_mass", *_THIRD}.isdisjoint(self.columns)

    @property
    def told(self) -> float:
        """Expected log odds as they are told, ``CERTAIN`` at most."""
        return min(self.expected_log_odds, CERTAIN)


def name_command(states: Sequence[State], simulate: Simulate | None) -> str:
    """The command that reads records with their modes, and a simulator; what is no file is named in capitals."""
    files = [
        source if Path(source).suffix == ending else f"{what}{ending}"
        for record, mode in states
        for source, what, ending in ((mode.source, "MODEL", ".toml"), (record.source, "RECORD", ".csv"))
    ]
    words = ["damping", "gap", *files[:2]]
    for model, record in zip(files[2::2], files[3::2], strict=True):
        words += ["--with", model, record]
    if simulate is not None:
        module, function = (getattr(simulate, name, "<") for name in ("__module__", "__qualname__"))
        found = module != "__main__" and "<" not in function
        words += ["--simulator", f"{module}:{function}" if found else "MODULE:FUNCTION"]
    return join(words)


def rank_tests(
    alive: Sequence[Explanation],
    fitted: Sequence[Explanation],
    in_library: float,
    command: str,
    unit: float = 1.0,
    columns: Collection[str] = ("phase",),
) -> tuple[NextTest, ...]:
    """Every test worth its time: those that settle the case, the mildest first, then the others, the surest first.

    ``alive``: the explanations that are listed, in order of probability, of all that were ``fitted``. The log odds are
    those against all rivals; none are worth it where nothing rivals the first. ``in_library``: chance that the library
    holds the cause. Where nothing is blamed, effects too small to be seen are none, and first harmonics of one state
    say no more. ``unit``: of mass, in which the rows are counted; what is to be run is told as a record holds it.
    ``columns``: of the record; further rows have some of them too.
    """
    leading, rivals = alive[0].hypothesis.best, alive[1 : 1 + MOST_RIVALS]
    if not (blames := bool(alive[0].effects)):
        rivals = [rival for rival in rivals if distance(leading, rival.hypothesis.best) > INDISTINCT]
    if not rivals:
        return ()
    compared = [alive[0], *rivals]
    named = {explanation.effects for explanation in compared}
    every = [*compared, *(own for own in fitted if own.effects not in named)]
    p = np.array([rival.probability for rival in rivals])
    expected = leading.model.terms(leading.y[np.newaxis, : leading.model.size])  # no sweep deviates by itself
    tests = []
    for design in DESIGNS:
        rows = design.plan(leading.model.problem)
        seen = _simulate(design.change(expected), rows)
        odds = np.array([_odds(seen, rival.hypothesis.best, design.change) for rival in rivals])
        gained = np.zeros(len(every))  # of rivals that are not compared nothing is foreseen
        gained[1 : len(compared)] = odds - SURELY * np.sqrt(2.0 * odds)
        probability = foresee_probability(every, gained, in_library, count_beyond(compared, seen))
        filled = dict.fromkeys((*_SWEEP, *(name for name in _KEPT if name in columns), *design.columns))
        # -ln sum p e^-odds: a test that settles the case against one rival only leaves the others where they are
        total = -float(logsumexp(-odds, b=p / p.sum()))
        tests.append(
            NextTest(design.what, design.why, total, probability, tuple(filled), (_tell_run(rows, unit),), command)
        )
    worth = [test for test in tests if test.expected_log_odds > WORTH and (blames or test.is_beyond)]
    return tuple(sorted(worth, key=lambda test: -min(test.probability, COVER)))


def _tell_run(rows: Rows, unit: float) -> dict[str, float]:
    """What is to be run, in numbers, as a record holds it; ``unit``: see `rank_tests`."""
    shaken = float(rows.shaken[0] + rows.added[0]) if rows.shaken[0] else 0.0
    return {
        "force": float(rows.F[0]) / shaken if shaken else float(rows.F[0]) * unit,
        "frequency_low": float((rows.omega / RAD_S_PER_HZ).min()),
        "frequency_high": float((rows.omega / RAD_S_PER_HZ).max()),
        "points": len(rows),
        "added_mass": float(rows.added[0]) * unit,
    }


def _odds(seen: Rows, rival: ModelFit, change: Callable[[Terms], Terms]) -> float:
    """Half the squared distance of a rival's prediction to what is ``seen``, in units of all that it leaves open.

    These are noise, repeatability, and the rival's parameters as far as the record has fixed them.
    """
    k, sweeps = rival.model.size, len(seen.sweeps)
    steps = np.vstack([np.zeros(k), STEP * np.eye(k)])
    terms = change(rival.model.terms(rival.y[:k] + steps))
    scatter = rival.model.scatter
    left = residuals(terms, seen, np.zeros((k + 1, 2 * sweeps)), scatter)
    J = (left.r[1:] - left.r[0]) / STEP
    by_gain, by_frequency = left.by_sweep()
    C = np.vstack([by_gain[0] * scatter.amplitude, by_frequency[0] * scatter.frequency])
    V = np.eye(J.shape[1]) + C.T @ C + J.T @ rival.covariance[:k, :k] @ J
    return 0.5 * float(left.r[0] @ np.linalg.solve(V, left.r[0]))


def _simulate(terms: Terms, rows: Rows) -> Rows:
    """The rows as terms, values (1, 1), predict them."""
    motion = steady(terms, rows, rows.u)
    seen = replace(rows, u=motion.u, phase=motion.phase)
    if not rows.channels:
        return seen
    third = recorded_third(terms, motion.u, motion.phase, rows.drive).reshape(-1)
    cross = cross_motion(terms, np.exp(motion.u - np.ravel(terms.gain)), rows.drive).reshape(-1)
    sd_third = np.hypot(rows.sd_third, FURTHER_ERROR * np.abs(third))
    sd_cross = np.hypot(rows.sd_cross, FURTHER_ERROR * np.abs(cross))
    return replace(seen, third=third, cross=cross, sd_third=sd_third, sd_cross=sd_cross)
