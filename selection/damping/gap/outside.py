"""Causes outside the library, weighed against the leading explanation.

These are the effects of `damping.effects.FOREIGN`, and quantities of the files that are not as stated: amplitudes of
another quantity than displacement, another sweep rate, a parameter of a simulator beyond its tolerance.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from damping.arrays import FloatArray
from damping.effects import CATALOGUE, FOREIGN
from damping.effects.course import SWEEP_RATE
from damping.effects.foreign import SLOW_SPRING
from damping.effects.masses import OTHER_MASS, VARYING_MASS
from damping.gap.corrected import effect_values, refitted_values
from damping.gap.directed import Test
from damping.gap.freed import free_parameters
from damping.gap.hypotheses import Hypothesis, leaves_noise
from damping.gap.search import Search
from damping.gap.weighing import (
    EXCLUDED,
    INDISTINCT,
    KNOWN,
    LEAST_ODDS,
    MOST_RIVAL,
    Explanation,
    count_beyond,
    describe_doubts,
    distance,
    estimate_in_library,
)

MOST_FOREIGN = 4  #: causes outside the library that are fitted in the place of each of several effects
#: Causes that at one mass have the first harmonics of a spring, whatever their size: such rows cannot exclude them.
IMITATIONS = {SLOW_SPRING.name, VARYING_MASS.name}
#: Least odds of a cause of the rig that predicts what the leading explanation does; below them its sizes are tuned to
#: it. Of 76 generated cases 15 with a fault of the rig have odds above .004, 9 with one of the structure below 1e-6.
_LEAST_ODDS_OF_RIG = 1e-4
_EVEN = 0.05  #: log odds above minus this are reported as even
#: Wrongly entered quantity, by the power of frequency by which its amplitudes exceed those of displacement.
QUANTITIES = {
    1: "velocity entered as displacement",
    2: "acceleration entered as displacement, or the force of a rotating mass entered as constant",
}


@dataclass(frozen=True)
class Rival:
    """A cause outside the library, compared with the leading explanation."""

    cause: str
    log_odds: float  #: against the leading explanation
    apart: float = np.inf  #: distance of its best-fitting prediction from the leading one, in units of noise
    of_rig: bool = False  #: whether it blames the rig for what the leading explanation blames the structure for
    of_simulator: bool = False  #: whether it is a parameter of the user's own simulation

    @property
    def indistinct(self) -> bool:
        """Whether it is of the rig and predicts what the leading explanation does: only priors favour that."""
        return self.of_rig and self.apart < INDISTINCT and self.log_odds >= np.log(_LEAST_ODDS_OF_RIG)

    @property
    def possible(self) -> bool:
        """Whether the record does not exclude it."""
        return self.indistinct or self.log_odds >= np.log(LEAST_ODDS)


def weigh_outside(search: Search, leading: Hypothesis) -> tuple[tuple[Rival, ...], tuple[Hypothesis, ...]]:
    """Causes outside the library: the most probable one, the most probable one of the rig, and wrong quantities.

    Also the explanations by ``IMITATIONS`` that the record does not exclude.
    """
    foreign = fit_foreign(search, leading)
    least = foreign[0].log_posterior + np.log(LEAST_ODDS) if foreign else np.inf  # else another cause excludes it
    of_rig = [other for other in foreign if other.log_posterior > least and _spares_structure(other, leading)][:1]
    told = {other.key: other for other in (*of_rig, *foreign[:1])}
    rivals = [_compare(other, leading) for other in told.values()]
    near = [other for other in foreign if other.log_posterior > leading.log_posterior - EXCLUDED]
    imitations = tuple(other for other in near if other.key & IMITATIONS)
    return (*rivals, *_weigh_quantities(search, leading)), imitations


def _compare(other: Hypothesis, leading: Hypothesis) -> Rival:
    cause = " with ".join(_describe(other, name) for name in other.effects if name in FOREIGN)
    beside = " and ".join(name for name in other.effects if name not in FOREIGN)
    log_odds, apart = other.log_posterior - leading.log_posterior, distance(leading.best, other.best)
    cause = f"{cause} beside {beside}" if beside else cause
    return Rival(cause, log_odds, apart, _spares_structure(other, leading))


def _spares_structure(other: Hypothesis, leading: Hypothesis) -> bool:
    """Whether an explanation blames a part of what the leading one blames of the structure, and nothing else of it."""
    return _list_structural(other) < _list_structural(leading)


def _list_structural(hypothesis: Hypothesis) -> set[str]:
    """The effects of an explanation that are not of the rig."""
    return {name for name in hypothesis.effects if (CATALOGUE | FOREIGN)[name].kind != "instrument"}


def _describe(hypothesis: Hypothesis, name: str) -> str:
    """The sentence of an effect outside the library, with its sizes where it is a parameter of the simulation.

    A wrong mass is that of the structure over the stated one: the refit within the tolerance holds a part of it.
    """
    sizes = effect_values(hypothesis.best)[name]
    if name == OTHER_MASS.name and hypothesis.best.model.problem.simulation.simulator is None:
        within = refitted_values(hypothesis.best)["mass"]
        sizes = {"relative": (1.0 + sizes["relative"]) * (1.0 + within) - 1.0}
    texts = [f"{key} {value:g}" if key == "state" else f"{key} {value:+.3g}" for key, value in sizes.items()]
    of_simulation = FOREIGN[name].kind == "parameter"
    return FOREIGN[name].sentence + (f" ({', '.join(texts)})" if of_simulation else "")


def _weigh_quantities(search: Search, leading: Hypothesis) -> list[Rival]:
    """Quantities of the files that are not as stated, compared with the leading explanation.

    Only where the simulation with that quantity alone fits to the noise, with the prior of one effect; of parameters of
    a simulator see `damping.gap.freed`. Where nothing is blamed, only these, if more than noise is left.
    """
    is_left = search.unknown.first.dispersion > 1.0 or not leaves_noise(leading)
    if search.problem.rows.at_resonance or not (leading.effects or is_left):
        return []
    freed = [Rival(what, log_odds, of_simulator=True) for what, log_odds in free_parameters(search, leading)]
    least = max([rival.log_odds for rival in freed], default=0.0) - MOST_RIVAL if leading.effects else MOST_RIVAL
    fits = chain(_convert_amplitudes(search), _free_rate(search)) if leading.effects else ()
    others = [Rival(what, fit.log_evidence - leading.log_posterior) for what, fit in fits if leaves_noise(fit)]
    return [*others, *(rival for rival in freed if rival.log_odds > least)]


def _convert_amplitudes(search: Search) -> Iterator[tuple[str, Hypothesis]]:
    """Fits to amplitudes that are A (omega/omega_n)^k, by the quantity entered.

    k = 1 of a velocity, 2 of an acceleration (over omega_n^k) or of a force of that power entered as constant.
    """
    rows = search.problem.rows
    for k, what in QUANTITIES.items():
        freed = replace(rows, u=rows.u - k * np.log(rows.omega / search.problem.simulation.mode.omega_n))
        times = "(f0/f)" + ("^2" if k > 1 else "")
        alone = Search(replace(search.problem, rows=freed), {}, search.unknown).run().leading
        yield f"{what} (amplitudes times {times} fit)", alone


def _free_rate(search: Search) -> Iterator[tuple[str, Hypothesis]]:
    """The fit without a stated sweep rate: to dwells, or to a frequency that moves at any rate in either direction."""
    if SWEEP_RATE.name in search.effects:
        return
    problem = search.problem
    still = replace(problem.rows, rate=np.zeros(len(problem.rows)))
    freed = replace(problem, rows=still, simulation=replace(problem.simulation, swept=()))
    first = Search(freed, {SWEEP_RATE.name: SWEEP_RATE}, search.unknown).run().leading
    if not first.effects:
        yield "a test that dwelt, against the stated sweep rate,", first
        return
    rate = effect_values(first.best)[SWEEP_RATE.name]["rate"] * problem.rows.up[0]
    yield f"a sweep rate of {rate:.3g} Hz/s in sweep {problem.rows.sweeps[0]}, in place of the stated one,", first


def fit_foreign(search: Search, leading: Hypothesis) -> list[Hypothesis]:
    """Explanations by causes outside the library, the most probable first; none where nothing is blamed.

    Each is fitted alone and, those of the largest linear gain, in the place of each of several effects, with the same
    prior. A wrong mass makes parameters derived from it wrong: it is fitted beside the most probable of these too.
    """
    if not leading.effects:
        return []
    masses = np.ptp(search.problem.rows.added)
    of_simulation = {name for name, effect in search.effects.items() if effect.corrects and masses}
    parameters = [hypothesis for hypothesis in search.ranked() if set() < hypothesis.key <= of_simulation]
    fitted = {key: old for key, old in search.hypotheses.items() if key <= leading.key or key <= of_simulation}
    named = {name: search.effects[name] for name in frozenset().union(*fitted)}
    foreign = Search(
        search.problem, {**FOREIGN, **named}, search.unknown, fitted, choices=search.choices, done=search.done
    )
    foreign.fit_single_effects()
    for replaced in leading.effects if len(leading.effects) > 1 else ():
        foreign.extend_by_gain(foreign.drop(leading, replaced), FOREIGN.keys(), MOST_FOREIGN)
    if parameters:
        foreign.extend(parameters[0], OTHER_MASS.name)
    return [hypothesis for hypothesis in foreign.ranked() if hypothesis.key & FOREIGN.keys()]


@dataclass(frozen=True)
class LibraryVerdict:
    """Whether the library holds the cause of a gap."""

    outside: tuple[Rival, ...]  #: causes outside the library, those of the rig first
    imitations: tuple[Hypothesis, ...]  #: explanations by causes outside the library that the record does not exclude
    doubts: FloatArray  #: see `damping.gap.weighing.describe_doubts`
    #: see `damping.gap.weighing.count_beyond`; 0 where more than noise is left, or a cause outside the library that was
    #: not excluded explains what is measured as well
    beyond: int
    probability: float  #: that the library holds the cause


def weigh_library(
    search: Search,
    hypotheses: Sequence[Explanation],
    tests: Sequence[Test],
    dispersion: float,
    *,
    unexplained: bool,
    brief: bool,
) -> LibraryVerdict:
    """Weigh whether the library holds the cause of a gap.

    ``dispersion``: residuals of the best explanation over noise. ``unexplained``: whether more than noise is left.
    ``brief``: skip causes outside the library, which only lower the probability, where it is already below ``KNOWN``.
    """

    def estimate(doubts: FloatArray, beyond: int) -> float:
        return estimate_in_library(doubts, hypotheses[0], dispersion, beyond, unexplained=unexplained)

    beyond = 0 if unexplained else count_beyond(hypotheses)
    doubts = describe_doubts(tests, hypotheses, ())
    if brief and estimate(doubts, beyond) < KNOWN:
        return LibraryVerdict((), (), doubts, beyond, estimate(doubts, beyond))
    outside, imitations = weigh_outside(search, hypotheses[0].hypothesis)
    odds = [rival.log_odds for rival in outside]
    as_well = max(odds, default=-np.inf) >= -_EVEN  # then nothing measured tells the leading explanation from it
    doubts, beyond = describe_doubts(tests, hypotheses, odds), 0 if imitations or as_well else beyond
    return LibraryVerdict(outside, imitations, doubts, beyond, estimate(doubts, beyond))


def name_better(outside: Sequence[Rival]) -> str:
    """The cause ``outside`` the library that explains the record best, if better than any effect does; else empty.

    A parameter of the user's simulation is named from even odds: the library has no effect for it.
    """
    better = [rival for rival in outside if rival.log_odds > (-_EVEN if rival.of_simulator else MOST_RIVAL)]
    if not better:
        return ""
    best = max(better, key=lambda rival: rival.log_odds)
    odds = round(best.log_odds, 1) + 0.0
    return f"{best.cause.rstrip(',')} (log odds {odds:.1f} against the best explanation of the library)"


def describe_outside(outside: Sequence[Rival], leading: Hypothesis) -> list[str]:
    """Cautions for causes ``outside`` the library that the leading explanation does not exclude, the rig's first."""
    return [_describe_rival(rival, leading) for rival in outside if rival.possible]


def _describe_rival(rival: Rival, leading: Hypothesis) -> str:
    named, log_odds = " + ".join(leading.effects) or "no effect", f"log odds {round(rival.log_odds, 1) + 0.0:.1f}"
    if rival.indistinct:
        return (
            f"look at the rig first: {rival.cause} cannot be separated from {named} by this record (their best-fitting "
            f"predictions differ by {rival.apart:.2g} sigma in all; {log_odds}). It is not in the library"
        )
    odds = rival.log_odds
    well = "better" if odds > MOST_RIVAL else "as well" if odds >= -_EVEN else "nearly as well"
    first = "look at the rig first: " if rival.of_rig else ""
    return f"{first}{rival.cause} explains the record {well} ({log_odds} against {named}), but is not in the library"
