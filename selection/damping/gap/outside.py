"""Causes outside the library, weighed against the leading explanation.

These are the effects of `damping.effects.FOREIGN`, and amplitudes of another quantity than displacement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import FloatArray
from damping.effects import FOREIGN
from damping.effects.foreign import SLOW_SPRING
from damping.effects.masses import OTHER_MASS, VARYING_MASS
from damping.gap.directed import Test
from damping.gap.hypotheses import Hypothesis, leaves_noise
from damping.gap.search import Search
from damping.gap.weighing import (
    EXCLUDED,
    KNOWN,
    LEAST_ODDS,
    MOST_RIVAL,
    Explanation,
    count_beyond,
    describe_doubts,
    estimate_in_library,
)

#: Causes outside the library that are fitted in the place of each of several effects.
MOST_FOREIGN = 4
#: Causes that at one mass have the first harmonics of a spring, whatever their size: such rows cannot exclude them.
IMITATIONS = {SLOW_SPRING.name, VARYING_MASS.name}
#: Log odds above minus this are reported as even.
_EVEN = 0.05
#: Wrongly entered quantity, by the power of frequency by which its amplitudes exceed those of displacement.
QUANTITIES = {
    1: "velocity entered as displacement",
    2: "acceleration entered as displacement, or the force of a rotating mass entered as constant",
}


def weigh_outside(search: Search, leading: Hypothesis) -> tuple[dict[str, float], tuple[Hypothesis, ...]]:
    """Log odds, against the leading explanation, of causes outside the library, by description.

    Also the explanations by ``IMITATIONS`` that the record does not exclude.
    """
    odds, foreign = _weigh_quantities(search, leading), fit_foreign(search, leading)
    if foreign:
        first = foreign[0]
        cause = " with ".join(FOREIGN[name].sentence for name in first.effects if name in FOREIGN)
        beside = " and ".join(name for name in first.effects if name not in FOREIGN)
        odds[f"{cause} beside {beside}" if beside else cause] = first.log_posterior - leading.log_posterior
    imitations = (other for other in foreign if other.key & IMITATIONS)
    return odds, tuple(other for other in imitations if other.log_posterior > leading.log_posterior - EXCLUDED)


def _weigh_quantities(search: Search, leading: Hypothesis) -> dict[str, float]:
    """Log odds, against the leading effects, of amplitudes that are A (omega/omega_n)^k, by the quantity entered.

    k = 1 of a velocity, 2 of an acceleration (over omega_n^k) or of a force of that power entered as constant. Only
    where the simulation alone fits the converted amplitudes to the noise, with the prior of one effect.
    """
    rows, odds = search.problem.rows, dict[str, float]()
    for k, what in QUANTITIES.items() if leading.effects and not rows.at_resonance else ():
        freed = replace(rows, u=rows.u - k * np.log(rows.omega / search.problem.simulation.mode.omega_n))
        alone = Search(replace(search.problem, rows=freed), {}, search.unknown).run().ranked()[0]
        if leaves_noise(alone):
            times = "(f0/f)" + ("^2" if k > 1 else "")
            odds[f"{what} (amplitudes times {times} fit)"] = alone.log_evidence - leading.log_posterior
    return odds


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
    foreign = Search(search.problem, {**FOREIGN, **named}, search.unknown, fitted, choices=search.choices)
    foreign.singles()
    for replaced in leading.effects if len(leading.effects) > 1 else ():
        foreign.extend_by_gain(foreign.drop(leading, replaced), FOREIGN.keys(), MOST_FOREIGN)
    if parameters:
        foreign.extend(parameters[0], OTHER_MASS.name)
    return [hypothesis for hypothesis in foreign.ranked() if hypothesis.key & FOREIGN.keys()]


@dataclass(frozen=True)
class LibraryVerdict:
    """Whether the library holds the cause of a gap.

    Attributes:
        outside: log odds, against the leading explanation, of causes outside the library, by description.
        imitations: explanations by causes outside the library that the record does not exclude.
        doubts: see `damping.gap.weighing.describe_doubts`.
        beyond: see `damping.gap.weighing.count_beyond`; 0 where more than noise is left or an imitation remains.
        probability: that the library holds the cause.
    """

    outside: Mapping[str, float]
    imitations: tuple[Hypothesis, ...]
    doubts: FloatArray
    beyond: int
    probability: float


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
        return LibraryVerdict({}, (), doubts, beyond, estimate(doubts, beyond))
    outside, imitations = weigh_outside(search, hypotheses[0].hypothesis)
    doubts, beyond = describe_doubts(tests, hypotheses, outside.values()), 0 if imitations else beyond
    return LibraryVerdict(outside, imitations, doubts, beyond, estimate(doubts, beyond))


def describe_outside(outside: Mapping[str, float], leading: Hypothesis) -> list[str]:
    """Cautions for causes ``outside`` the library (log odds by cause) that the leading explanation does not exclude."""
    possible = {cause: odds for cause, odds in outside.items() if odds >= np.log(LEAST_ODDS)}
    return [f"{cause} {_compare_odds(odds, leading)}, but is not in the library" for cause, odds in possible.items()]


def _compare_odds(odds: float, leading: Hypothesis) -> str:
    well = "better" if odds > MOST_RIVAL else "as well" if odds >= -_EVEN else "nearly as well"
    return f"explains the record {well} (log odds {round(odds, 1) + 0.0:.1f} against {' + '.join(leading.effects)})"
