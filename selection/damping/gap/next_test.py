"""What to test next: of the tests that a record can hold, those that discriminate best between the listed explanations.

Each candidate is simulated with the leading explanation and fitted by each rival to first order. Half the squared
distance of the two predictions, in units of all that the rival leaves open, is the expected log odds D (Chaloner and
Verdinelli 1995, design for discrimination between models). The probability that the leading explanation then has, if
it is true, follows by the rules of every answer, which trust most what is measured beyond first harmonics of one state
(`damping.gap.weighing.blend_probabilities`). The first test listed is the mildest of those that settle the case: a test
outside the tested range also shows effects that no model of the record holds.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import chain, compress
from pathlib import Path
from shlex import join

import numpy as np
from scipy.linalg import block_diag
from scipy.special import logsumexp

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.effects.contract import Terms
from damping.effects.rig import recorded_third
from damping.effects.terms import complex_stiffness, cross_motion
from damping.gap.designs import DESIGNS, THIRD, ProposedTest
from damping.gap.fit import ModelFit
from damping.gap.hypotheses import Hypothesis
from damping.gap.model import STEP, residuals, steady
from damping.gap.problem import State
from damping.gap.rows import PhasorRows
from damping.gap.simulator import Simulate
from damping.gap.unknowns import FURTHER_ERROR
from damping.gap.weighing import COVER, EXCLUDED, INDISTINCT, Explanation, count_beyond, distance, foresee_probability

#: Least expected log odds D of a test worth its time: the outcome scatters by sqrt(2 D), so for D = 6 it exceeds 3,
#: 20 to 1, in four of five.
WORTH = 6.0
SURELY = 2.0  #: a test must settle the case this many standard deviations sqrt(2 D) below D: it then does in 39 of 40
#: Least force of a proposed test over 4/pi times friction, the damping force at the smallest motion: below 1 there is
#: no resonance, and close above 1 its amplitude is all but infinitely sensitive to the friction.
LEAST_FORCE = 1.5
STILL = 1e-6  #: the smallest motion at which damping is asked for, over the smallest that was measured
MOST_RIVALS = 6  #: explanations compared with the leading one; for others no log odds are predicted
CERTAIN = 100.0  #: largest log odds reported: beyond it any model is as good as certain, and no model is that good

_SWEEP = ("force", "frequency", "amplitude")
#: Columns of a record that further rows must fill too, to say as much as the others.
_KEPT = ("phase", "energy", "amplitude_sd", "phase_sd", "force_sd", "sweep_rate", "time")


@dataclass(frozen=True)
class NextTest:
    """A test with its expected log odds for the leading explanation, if that is true, against the rest.

    ``probability``: of this explanation after the test, if it gives ``SURELY`` standard deviations less than expected.
    ``columns``: those that the new rows fill. ``rows``: what to run, in numbers (force, Hz, added mass). ``command``
    reads the record once the rows are appended.
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
        """Whether it measures more than first harmonics of one state (`damping.gap.weighing.count_beyond`)."""
        return not {"added_mass", *THIRD}.isdisjoint(self.columns)

    @property
    def reported_log_odds(self) -> float:
        """Expected log odds, ``CERTAIN`` at most."""
        return min(self.expected_log_odds, CERTAIN)


def name_command(states: Sequence[State], simulate: Simulate | None) -> str:
    """The command that reads records with their modes, and a simulator; capitals stand for what is not in a file."""
    files = [
        source if Path(source).suffix == ending else f"{placeholder}{ending}"
        for record, mode in states
        for source, placeholder, ending in ((mode.source, "MODEL", ".toml"), (record.source, "RECORD", ".csv"))
    ]
    words = ["damping", "gap", *files[:2]]
    for model, record in zip(files[2::2], files[3::2], strict=True):
        words += ["--with", model, record]
    if simulate is not None:
        module, function = (getattr(simulate, name, "<") for name in ("__module__", "__qualname__"))
        importable = module != "__main__" and "<" not in function
        words += ["--simulator", f"{module}:{function}" if importable else "MODULE:FUNCTION"]
    return join(words)


@dataclass(frozen=True)
class _Run:
    """A test with its rows as the leading explanation predicts them, and each rival's misfit to them."""

    design: ProposedTest
    predicted: PhasorRows
    misfits: tuple["_Misfit", ...]


@dataclass(frozen=True)
class _Misfit:
    """Misfit of a rival to m values in units of their noise, at its k fitted parameters."""

    r: FloatArray  #: misfit (m,)
    J: FloatArray  #: its derivatives (k, m)
    noise: FloatArray  #: covariance (m, m), with the run's repeatability


def rank_tests(
    listed: Sequence[Explanation],
    fitted: Sequence[Explanation],
    in_library: float,
    command: str,
    unit: float = 1.0,
    columns: Collection[str] = ("phase",),
    imitations: Sequence[Hypothesis] = (),
    *,
    unexplained: bool = False,
) -> tuple[NextTest, ...]:
    """Every test worth its time: those that settle the case, the mildest first, then the others, the surest first.

    If no single test settles the case, the surest is also joined with each of the others. If no test discriminates
    against all rivals, rivals that none discriminates against are left out. Where no effect is blamed, rivals too small
    to be seen do not count, and first harmonics of one state say no more.

    Args:
        listed: the explanations that are listed, in order of probability; without a rival no test is worth it.
        fitted: all that were fitted.
        in_library: probability that the library holds the cause.
        unit: of mass, for the rows; ``rows`` of a test are reported as a record holds them.
        columns: of the record; further rows fill some of them too.
        imitations: explanations by causes outside the library that the record does not exclude; further measurements
            count once a test excludes them.
        unexplained: whether the leading explanation leaves more than noise. As in an answer, no measurement then counts
            beyond first harmonics of one state: a test leaves the rest as unexplained as it is.
    """
    leading, blames, rivals = listed[0].hypothesis.best, bool(listed[0].effects), listed[1 : 1 + MOST_RIVALS]
    if not blames:
        rivals = [rival for rival in rivals if distance(leading, rival.hypothesis.best) > INDISTINCT]
    if not rivals:
        return ()
    named = {explanation.effects for explanation in (listed[0], *rivals)}
    every = [listed[0], *rivals, *(explanation for explanation in fitted if explanation.effects not in named)]
    compared = [*(rival.hypothesis.best for rival in every[1 : 1 + MOST_RIVALS]), *(own.best for own in imitations)]
    runs = _predict_runs(leading, compared)
    if not runs:  # by the leading explanation friction holds the mode in every one
        return ()
    filled = (*_SWEEP, *(name for name in _KEPT if name in columns))

    def foresee(*joined: _Run) -> NextTest:
        odds, probability = _foresee(joined, compared, len(rivals), every, in_library, imitations, unexplained)
        return _describe_test(joined, odds, probability, filled, unit, command)

    def foresee_pairs(first: _Run) -> list[NextTest]:
        return [foresee(first, run) for run in runs if run is not first and run.design.joins(first.design)]

    def is_worth(test: NextTest) -> bool:
        return test.expected_log_odds > WORTH and (blames or test.is_beyond)

    tests = [foresee(run) for run in runs]
    worth = [test for test in tests if is_worth(test)]
    if worth:
        surest = max(worth, key=lambda test: test.probability)
        if surest.probability < COVER:
            worth += [pair for pair in foresee_pairs(runs[tests.index(surest)]) if pair.probability >= COVER]
    else:  # no test excludes every rival: two may together; else rivals that none excludes are left out
        odds = np.array([[_odds([run.misfits[k]], compared[k]) for run in runs] for k in range(len(rivals))])
        excluded = odds.max(axis=1) > WORTH
        if excluded.all():
            worth = [pair for pair in foresee_pairs(runs[odds[0].argmax()]) if is_worth(pair)]
        elif excluded.any():
            fewer = [listed[0], *compress(rivals, excluded)]
            return rank_tests(fewer, fitted, in_library, command, unit, columns, imitations, unexplained=unexplained)
    return tuple(sorted(worth, key=lambda test: -min(test.probability, COVER)))  # tests that settle it stay in order


def _predict_runs(leading: ModelFit, rivals: Sequence[ModelFit]) -> list[_Run]:
    """Every test that has a resonance, simulated by the leading explanation."""
    expected = leading.model.terms(leading.y[np.newaxis, : leading.model.size])  # without deviations of sweeps
    runs = []
    for design in DESIGNS:
        if not _resonates(expected, design.plan(leading.model.problem)):
            continue
        predicted = _simulate(design.change(expected), design.plan(leading.model.problem))
        runs.append(_Run(design, predicted, tuple(_find_misfit(predicted, rival, design.change) for rival in rivals)))
    return runs


def _resonates(terms: Terms, rows: PhasorRows) -> bool:
    """Whether every force is at least ``LEAST_FORCE`` times 4/pi of friction: a mode that sticks has no resonance."""
    still = np.full(len(rows), STILL * float(np.exp(rows.u.min())))
    friction = complex_stiffness(terms.tuned(rows.drive), still, rows.drive)[0].imag * still
    return bool(np.all(LEAST_FORCE * friction <= rows.F))


def _foresee(
    runs: Sequence[_Run],
    compared: Sequence[ModelFit],
    rivals: int,
    every: Sequence[Explanation],
    in_library: float,
    imitations: Sequence[Hypothesis],
    unexplained: bool,
) -> tuple[float, float]:
    """Expected log odds of all runs together, and the probability of the first explanation after them.

    ``compared``: fits of the explanations after the first, then of the ``imitations``. ``every``: all that were fitted,
    the first and its ``rivals`` before the others. A test that discriminates against one rival only leaves the others
    as they are: the log odds are -ln sum p e^-D.
    """
    others = len(compared) - len(imitations)
    odds = np.array([_odds([run.misfits[k] for run in runs], rival) for k, rival in enumerate(compared)])
    surely = odds - SURELY * np.sqrt(2.0 * odds)
    gained = np.zeros(len(every))  # nothing is predicted for those not compared
    gained[1 : 1 + others] = surely[:others]
    p = np.array([rival.probability for rival in every[1 : 1 + rivals]])
    listed, first = every[: 1 + rivals], every[0].hypothesis
    behind = [first.log_posterior - imitation.log_posterior for imitation in imitations]
    excluded = bool(np.all(behind + surely[others:] > EXCLUDED))
    now = 0 if imitations or unexplained else count_beyond(listed)
    beyond = count_beyond(listed, *(run.predicted for run in runs)) if excluded and not unexplained else 0
    expected = -float(logsumexp(-odds[:rivals], b=p / p.sum()))
    return expected, foresee_probability(every, gained, in_library, now, beyond)


def _describe_test(
    runs: Sequence[_Run], odds: float, probability: float, filled: Sequence[str], unit: float, command: str
) -> NextTest:
    """The runs as one proposed test; ``filled``: columns that any further row fills."""
    what = "; and ".join(run.design.what for run in runs)
    why = "; ".join(dict.fromkeys(chain.from_iterable(run.design.why.split("; ") for run in runs)))
    columns = dict.fromkeys((*filled, *chain.from_iterable(run.design.columns for run in runs)))
    rows = tuple(_describe_run(run.predicted, unit) for run in runs)
    return NextTest(what, why, odds, probability, tuple(columns), rows, command)


def _describe_run(rows: PhasorRows, unit: float) -> dict[str, float]:
    """What to run, in numbers, as a record holds it; ``unit``: see `rank_tests`."""
    shaken = float(rows.shaken[0] + rows.added[0]) if rows.shaken[0] else 0.0
    return {
        "force": float(rows.F[0]) / shaken if shaken else float(rows.F[0]) * unit,
        "frequency_low": float((rows.omega / RAD_S_PER_HZ).min()),
        "frequency_high": float((rows.omega / RAD_S_PER_HZ).max()),
        "points": len(rows),
        "added_mass": float(rows.added[0]) * unit,
    }


def _find_misfit(predicted: PhasorRows, rival: ModelFit, change: Callable[[Terms], Terms]) -> _Misfit:
    """Misfit of a rival to the rows ``predicted``."""
    k, sweeps = rival.model.size, len(predicted.sweeps)
    steps = np.vstack([np.zeros(k), STEP * np.eye(k)])
    terms = change(rival.model.terms(rival.y[:k] + steps))
    scatter = rival.model.scatter
    misfit = residuals(terms, predicted, np.zeros((k + 1, 2 * sweeps)), scatter)
    by_gain, by_frequency = misfit.by_sweep()
    C = np.vstack([by_gain[0] * scatter.amplitude, by_frequency[0] * scatter.frequency])
    return _Misfit(misfit.r[0], (misfit.r[1:] - misfit.r[0]) / STEP, np.eye(C.shape[1]) + C.T @ C)


def _odds(misfits: Sequence[_Misfit], rival: ModelFit) -> float:
    """Half the squared distance of a rival from the rows ``predicted``, in units of all that it leaves open.

    These are noise, repeatability, and the covariance of the rival's parameters given the record.
    """
    r, J = np.hstack([run.r for run in misfits]), np.hstack([run.J for run in misfits])
    k = rival.model.size
    V = block_diag(*(run.noise for run in misfits)) + J.T @ rival.covariance[:k, :k] @ J
    return 0.5 * float(r @ np.linalg.solve(V, r))


def _simulate(terms: Terms, rows: PhasorRows) -> PhasorRows:
    """The rows as predicted by terms of values (1, 1)."""
    motion = steady(terms, rows, rows.u)
    predicted = replace(rows, u=motion.u, phase=motion.phase)
    if not rows.channels:
        return predicted
    third = recorded_third(terms, motion.u, motion.phase, rows.drive).reshape(-1)
    cross = cross_motion(terms, np.exp(motion.u - np.ravel(terms.gain)), rows.drive).reshape(-1)
    sd_third = np.hypot(rows.sd_third, FURTHER_ERROR * np.abs(third))
    sd_cross = np.hypot(rows.sd_cross, FURTHER_ERROR * np.abs(cross))
    return replace(predicted, third=third, cross=cross, sd_third=sd_third, sd_cross=sd_cross)
