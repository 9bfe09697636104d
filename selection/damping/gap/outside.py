"""Causes outside the library, weighed against the leading explanation.

These are the effects of `damping.effects.FOREIGN`, and quantities of the files that are not as stated: amplitudes of
another quantity than displacement, another sweep rate, a parameter of a simulator beyond its tolerance.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from damping.arrays import FloatArray
from damping.effects import FOREIGN
from damping.effects.course import SWEEP_RATE
from damping.effects.foreign import SLOW_SPRING
from damping.effects.masses import OTHER_MASS, VARYING_MASS
from damping.errors import InputError
from damping.gap.corrected import effect_values
from damping.gap.directed import Test
from damping.gap.hypotheses import Hypothesis, leaves_noise
from damping.gap.search import Search
from damping.gap.simulation import MOST_TOLERANCES, within_tolerance
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

MOST_FOREIGN = 4  #: causes outside the library that are fitted in the place of each of several effects
#: Causes that at one mass have the first harmonics of a spring, whatever their size: such rows cannot exclude them.
IMITATIONS = {SLOW_SPRING.name, VARYING_MASS.name}
_EVEN = 0.05  #: log odds above minus this are reported as even
#: Wrongly entered quantity, by the power of frequency by which its amplitudes exceed those of displacement.
QUANTITIES = {
    1: "velocity entered as displacement",
    2: "acceleration entered as displacement, or the force of a rotating mass entered as constant",
}
#: Most fits of a parameter of a simulator, and the last change of its departure over itself: a fraction of its error.
_MOST_TURNS = 12
_SAME = 0.005


def weigh_outside(search: Search, leading: Hypothesis) -> tuple[dict[str, float], tuple[Hypothesis, ...]]:
    """Log odds, against the leading explanation, of causes outside the library, by description.

    Also the explanations by ``IMITATIONS`` that the record does not exclude.
    """
    odds, foreign = _weigh_quantities(search, leading), fit_foreign(search, leading)
    if foreign:
        first = foreign[0]
        cause = " with ".join(_describe(first, name) for name in first.effects if name in FOREIGN)
        beside = " and ".join(name for name in first.effects if name not in FOREIGN)
        odds[f"{cause} beside {beside}" if beside else cause] = first.log_posterior - leading.log_posterior
    imitations = (other for other in foreign if other.key & IMITATIONS)
    return odds, tuple(other for other in imitations if other.log_posterior > leading.log_posterior - EXCLUDED)


def _describe(hypothesis: Hypothesis, name: str) -> str:
    """The sentence of an effect outside the library, with its sizes where it is a parameter of the simulation."""
    sizes = effect_values(hypothesis.best)[name].items()
    texts = [f"{key} {value:g}" if key == "state" else f"{key} {value:+.3g}" for key, value in sizes]
    of_simulation = FOREIGN[name].kind == "parameter"
    return FOREIGN[name].sentence + (f" ({', '.join(texts)})" if of_simulation else "")


def _weigh_quantities(search: Search, leading: Hypothesis) -> dict[str, float]:
    """Log odds, against the leading effects, of a quantity of the files that is not as stated, by the quantity.

    Only where the simulation with that quantity alone fits to the noise, with the prior of one effect.
    """
    if not leading.effects or search.problem.rows.at_resonance:
        return {}
    fits = chain(_convert_amplitudes(search), _free_rate(search), _free_parameters(search))
    return {what: fit.log_evidence - leading.log_posterior for what, fit in fits if leaves_noise(fit)}


def _convert_amplitudes(search: Search) -> Iterator[tuple[str, Hypothesis]]:
    """Fits to amplitudes that are A (omega/omega_n)^k, by the quantity entered.

    k = 1 of a velocity, 2 of an acceleration (over omega_n^k) or of a force of that power entered as constant.
    """
    rows = search.problem.rows
    for k, what in QUANTITIES.items():
        freed = replace(rows, u=rows.u - k * np.log(rows.omega / search.problem.simulation.mode.omega_n))
        times = "(f0/f)" + ("^2" if k > 1 else "")
        alone = Search(replace(search.problem, rows=freed), {}, search.unknown).run().ranked()[0]
        yield f"{what} (amplitudes times {times} fit)", alone


def _free_rate(search: Search) -> Iterator[tuple[str, Hypothesis]]:
    """The fit without a stated sweep rate: to dwells, or to a frequency that moves at any rate in either direction."""
    if SWEEP_RATE.name in search.effects:
        return
    problem = search.problem
    still = replace(problem.rows, rate=np.zeros(len(problem.rows)))
    freed = replace(problem, rows=still, simulation=replace(problem.simulation, swept=()))
    first = Search(freed, {SWEEP_RATE.name: SWEEP_RATE}, search.unknown).run().ranked()[0]
    if not first.effects:
        yield "a test that dwelt, against the stated sweep rate,", first
        return
    rate = effect_values(first.best)[SWEEP_RATE.name]["rate"] * problem.rows.up[0]
    yield f"a sweep rate of {rate:.3g} Hz/s in sweep {problem.rows.sweeps[0]}, in place of the stated one,", first


def _free_parameters(search: Search) -> Iterator[tuple[str, Hypothesis]]:
    """The fits with each parameter of a simulator at any value, where that is beyond its tolerance.

    Z is linear in ln of the parameter between the stated value and the last fitted one, and so exact at that. The prior
    is as wide as the two are apart, like that of a strength.
    """
    problem, simulator = search.problem, search.problem.simulation.simulator
    if simulator is None:
        return
    for place, (name, tolerance) in enumerate(simulator.tolerances.items(), -len(simulator.values)):
        by = least = MOST_TOLERANCES * tolerance
        for _ in range(_MOST_TURNS if least else 0):
            own = replace(problem.simulation, simulator=simulator.freed(name, by))
            try:
                alone = Search(replace(problem, simulation=own), {}, search.unknown).run().ranked()[0]
            except InputError:  # it need not answer there
                break
            fitted = alone.best.y[: alone.best.model.size][place]
            change = float(within_tolerance(fitted)) - 1.0
            by *= 1.0 + change / (1.0 + 0.5 * abs(by))  # the slope of exp turns a change by about -by/2
            if abs(change) < _SAME:
                if abs(by) > least:
                    value = f"{simulator.values[name] * np.exp(by):.4g} ({np.expm1(by):+.1%})"
                    yield f"a {name} of {value} in the simulator", alone
                break


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
    foreign.singles()
    for replaced in leading.effects if len(leading.effects) > 1 else ():
        foreign.extend_by_gain(foreign.drop(leading, replaced), FOREIGN.keys(), MOST_FOREIGN)
    if parameters:
        foreign.extend(parameters[0], OTHER_MASS.name)
    return [hypothesis for hypothesis in foreign.ranked() if hypothesis.key & FOREIGN.keys()]


@dataclass(frozen=True)
class LibraryVerdict:
    """Whether the library holds the cause of a gap."""

    #: log odds, against the leading explanation, of causes outside the library, by description
    outside: Mapping[str, float]
    imitations: tuple[Hypothesis, ...]  #: explanations by causes outside the library that the record does not exclude
    doubts: FloatArray  #: see `damping.gap.weighing.describe_doubts`
    beyond: int  #: see `damping.gap.weighing.count_beyond`; 0 where more than noise is left or an imitation remains
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
