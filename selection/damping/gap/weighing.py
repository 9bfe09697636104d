"""How probable each explanation is, whether the library holds the cause at all, and what cannot be told apart.

As far as the cause may be outside the library, log odds are tempered (Guo, Pleiss, Sun and Weinberger 2017): those of
imitations differ by chance. The probability that the library holds the cause is logistic (Platt 1999) in the doubts
about an answer. Its constants are from ``python -m damping_validation.guard doubts``, a regression on answers to
generated cases with causes inside and outside the library; ``damping blind`` measures its calibration.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from scipy.special import expit, logit, logsumexp, softmax

from damping.arrays import FloatArray
from damping.effects import CATALOGUE
from damping.effects.contract import Effect
from damping.gap.corrected import effect_values, list_ends
from damping.gap.directed import Test, smallest_p
from damping.gap.fit import ModelFit
from damping.gap.hypotheses import Hypothesis
from damping.gap.model import residuals
from damping.gap.outliers import log_likelihood
from damping.gap.rows import PhasorRows

COVER = 0.95  #: probability that the list of explanations covers
#: Temperature of the log odds between explanations that all imitate a cause outside the library, by what is measured
#: beyond first harmonics of one state: nothing, third harmonics or another state, both.
TEMPERATURES = (5.0, 6.0, 2.0)
#: Largest share of the best explanation if the cause is outside the library and nothing is measured beyond first
#: harmonics of one state, which effects that are not there imitate to within noise. Of 1936 cases of 66 kinds (600 of
#: them foreign causes) .7 % were named wrongly beyond .95, 1.6 % without these.
LARGEST_IMITATION = 0.65
#: Log odds that the library holds the cause, where it holds three in five, for an effect that leaves only noise.
IN_LIBRARY = 1.71
NOTHING_BLAMED = 0.40  #: log odds added where nothing is blamed
PER_DECADE = 0.51  #: log odds subtracted for each decade of the smallest p-value (`describe_doubts`)
PER_MAKESHIFT = 2.42  #: log odds subtracted for effects beyond one that are a makeshift
PER_END = 1.01  #: log odds subtracted for each best fit at the end of its range
PER_RIVAL = 0.91  #: log odds subtracted for each e-fold of the odds of a cause outside the library
#: Log odds added where something is measured beyond first harmonics of one state (`count_beyond`), which imitations
#: seldom reproduce. Of 105 answers in which it counts (blind runs of seeds 29112901 and 29112902, tests proposed for
#: cases of the first) 101 are of causes in the library, which gives 2.1 (standard errors: 1.6 to 2.7): the lower end.
PER_BEYOND = 1.6
#: Log odds subtracted for each e-fold of dispersion: set by hand, since hardly a case of the regression has any.
PER_DISPERSION = 3.0
_MOST_DECADES = 6.0  #: most decades of the smallest p-value that count
MOST_RIVAL = 3.0  #: largest ln(1 + odds of a foreign cause) that counts: 20 to 1 is as good as certain
#: Gain in ln p of the last effect of several at which it counts as half a makeshift: e^10 is as good as certain.
_PAYS = 10.0
#: Largest probability of a cause in the library where an effect of one sweep absorbs all information of a state of a
#: single sweep: below ``KNOWN``, so that nothing is claimed.
UNCONFIRMED = 0.4
KNOWN = 0.5  #: probability of a cause in the library from which an explanation is claimed
#: Distance below which two predictions are separated only by chance: expected log odds d^2/2 = 3, one in twenty.
INDISTINCT = 2.45
EXCLUDED = 0.5 * INDISTINCT**2  #: log odds from which a rival is excluded: those of that distance
LEAST_ODDS = 0.02  #: least odds of an effect that may replace another, however near its prediction
_MOST_SWAPPED = 2  #: most effects that together may replace one


@dataclass(frozen=True)
class Explanation:
    """A hypothesis with its probability among all fitted ones, that of those adding only invisible effects included."""

    effects: tuple[str, ...]
    probability: float
    hypothesis: Hypothesis


def weigh_hypotheses(ranked: Sequence[Hypothesis]) -> tuple[Explanation, ...]:
    """Explanations with their probabilities among all fitted hypotheses ``ranked``, most probable first.

    A hypothesis with the prediction of a more probable one and a further effect is no separate explanation: that effect
    cannot be seen, and its probability counts for the other. A small effect remains a rival of no effect at all.
    """
    visible = dict[frozenset[str], list[Hypothesis]]()
    for hypothesis in ranked:
        contained = ((key, first) for key, (first, *_) in visible.items() if set() < first.key < hypothesis.key)
        same = (key for key, first in contained if distance(first.best, hypothesis.best) < INDISTINCT)
        visible.setdefault(next(same, hypothesis.key), []).append(hypothesis)
    probabilities = softmax([logsumexp([member.log_posterior for member in group]) for group in visible.values()])
    weighed = [
        Explanation(first.effects, float(p), first)
        for (first, *_), p in zip(visible.values(), probabilities, strict=True)
    ]
    return order_by_probability(weighed)


def order_by_probability(explanations: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """The most probable first; equally probable ones stay in their order."""
    return tuple(sorted(explanations, key=lambda explanation: -explanation.probability))


def count_beyond(hypotheses: Sequence[Explanation], *further: PhasorRows) -> int:
    """Kinds of data (0 to 2) beyond first harmonics of one state that tell the first explanation from imitations.

    Third harmonics count if they tell it, by log odds of ``INDISTINCT``^2/2, from no third harmonics or from an
    explanation with the same first harmonics. Another state or added mass counts too, but for a stiffness only with
    third harmonics: a stiffness that follows the mean square of the motion, as of a spring that warms up, has the same
    first harmonics at any mass. ``further``: rows of future tests, as the first explanation predicts them.
    """
    fit = hypotheses[0].hypothesis.best
    every = (fit.model.problem.rows, *further)
    third = False
    if any("third" in rows.channels for rows in every):
        misfit, first = _miss_thirds(fit, every), len(every[0]) * (1 + every[0].has_phase)
        rivals = (rival.hypothesis.best for rival in hypotheses[1:])
        others = (_miss_thirds(rival, every) for rival in rivals if distance(fit, rival, first) < INDISTINCT)
        third = max([_miss_thirds(fit, every, predicts=False), *others]) - misfit >= INDISTINCT**2
    states = any(np.ptp(np.hstack([getattr(rows, name) for rows in every])) > 0.0 for name in ("added", "state"))
    stiff = any(CATALOGUE[name].force is not None and not CATALOGUE[name].damping for name in fit.effects)
    return sum((third, states and (third or not stiff)))


def _miss_thirds(fit: ModelFit, every: Sequence[PhasorRows], *, predicts: bool = True) -> float:
    """-2 ln p of the residuals of third harmonics, or of these themselves if the fit ``predicts`` none."""
    measured = [rows for rows in every if "third" in rows.channels]
    misfits = [
        _list_residuals(fit, rows)[rows.places("third")] if predicts else _list_thirds(fit, rows) for rows in measured
    ]
    return -2.0 * sum(float(log_likelihood(misfit)) for misfit in misfits)


def _list_residuals(fit: ModelFit, rows: PhasorRows) -> FloatArray:
    """Residuals (m,) of a fit: of the record as fitted, of other ``rows`` without deviations of sweeps."""
    model = fit.model
    if rows is model.problem.rows:
        return fit.r
    terms = model.terms(fit.y[np.newaxis, : model.size])
    return np.asarray(residuals(terms, rows, np.zeros((1, 2 * len(rows.sweeps))), model.scatter).r[0])


def _list_thirds(fit: ModelFit, rows: PhasorRows) -> FloatArray:
    """Measured third harmonics (2 n,), real parts first, in units of their noise as a fit takes it."""
    noise = fit.model.scatter.dispersion * rows.sd_third
    return np.concatenate([rows.third.real / noise, rows.third.imag / noise])


def blend_probabilities(hypotheses: tuple[Explanation, ...], in_library: float, beyond: int) -> tuple[Explanation, ...]:
    """Calibrated probabilities: a mixture of those given and those of imitations, the latter if the cause is unknown.

    ``beyond``: see `count_beyond`. If it is above 0, or nothing is blamed, explanations with all effects of the leading
    one and more are no imitations, since they name the same. If it is 0, or nothing is blamed, the leading one leaves
    a remainder for causes that were not fitted. The most probable one stays so, since both parts grow with its log
    odds. Others may change places; the order is that of ``hypotheses``.
    """
    named = hypotheses[0].hypothesis.key
    with np.errstate(divide="ignore"):  # probabilities of 0
        log_odds = np.log([explanation.probability for explanation in hypotheses])
    if beyond or not named:
        log_odds[[named < explanation.hypothesis.key for explanation in hypotheses]] = -np.inf
    outside = softmax(log_odds / TEMPERATURES[beyond])
    outside[0] = outside[0] if beyond and named else min(outside[0], LARGEST_IMITATION)
    return tuple(
        replace(explanation, probability=float(in_library * explanation.probability + (1.0 - in_library) * p))
        for explanation, p in zip(hypotheses, outside, strict=True)
    )


def foresee_probability(
    hypotheses: Sequence[Explanation], gained: FloatArray, in_library: float, now: int, beyond: int
) -> float:
    """Probability of the first hypothesis once data have given log odds ``gained`` (n,) for it against each.

    ``in_library``: as it is now. ``now``, ``beyond``: `count_beyond` without and with these data.
    """
    in_library = float(expit(logit(in_library) + PER_BEYOND * (bool(beyond) - bool(now))))
    log_odds = np.array([old.hypothesis.log_posterior for old in hypotheses]) - gained
    after = tuple(replace(old, probability=float(p)) for old, p in zip(hypotheses, softmax(log_odds), strict=True))
    return blend_probabilities(after, in_library, beyond)[0].probability


def describe_doubts(tests: Sequence[Test], hypotheses: Sequence[Explanation], outside: Collection[float]) -> FloatArray:
    """Doubts about the first of ``hypotheses``, (4,).

    Decades of the smallest p-value (at most six); the degree to which effects beyond one are a makeshift; the number of
    best fits at the end of their range; ln(1 + odds against it) of the most probable cause ``outside`` the library,
    from the log odds of each (at most three). Fits patch up an unknown cause with known effects, each of which gains
    little beside the others.
    """
    leading = hypotheses[0].hypothesis
    decades = min(-float(np.log10(max(smallest_p(tests), 1e-30))), _MOST_DECADES)
    more = max(len(leading.effects) - 1, 0)
    shorter = [rival.hypothesis.log_posterior for rival in hypotheses if rival.hypothesis.key < leading.key]
    gain = leading.log_posterior - max(shorter, default=leading.log_posterior)
    rival = float(np.logaddexp(0.0, max(outside, default=-np.inf)))
    makeshift = more / (1.0 + gain / _PAYS)
    return np.array([decades, makeshift, len(list_ends(leading.best)), min(rival, MOST_RIVAL)], dtype=float)


def estimate_in_library(
    doubts: FloatArray, leading: Explanation, dispersion: float, beyond: int, *, unexplained: bool
) -> float:
    """The probability that the cause is in the library at all: logistic, with the constants above.

    If nothing is blamed but more than noise is left (``unexplained``), there is a cause, and the library holds it with
    at most the total probability of its effects (of 110 generated cases four were so, all foreign).
    """
    log_odds = IN_LIBRARY + PER_BEYOND * bool(beyond) - PER_DISPERSION * float(np.log(dispersion))
    log_odds -= float(doubts @ (PER_DECADE, PER_MAKESHIFT, PER_END, PER_RIVAL))
    if leading.effects:
        return float(expit(log_odds))
    return float(expit(log_odds) * (1.0 - leading.probability) if unexplained else expit(log_odds + NOTHING_BLAMED))


def hides_state(fit: ModelFit) -> bool:
    """Whether an effect acts on a sweep that is the only one of its state: it then fits any data of that state."""
    rows = fit.model.problem.rows
    states = [(rows.added[run[0]], rows.state[run[0]]) for run in rows.runs]
    if not 1 < len(set(states)) < len(states):
        return False
    alone = [rows.label[run[0]] for run, state in zip(rows.runs, states, strict=True) if states.count(state) == 1]
    return any(table.get("sweep", 0.0) in alone for table in effect_values(fit).values())


def cover_probability(hypotheses: tuple[Explanation, ...]) -> tuple[Explanation, ...]:
    """The most probable hypotheses, as few as reach ``COVER`` of the probability of all fitted ones."""
    reached = np.cumsum([hypothesis.probability for hypothesis in hypotheses])
    return hypotheses[: int(np.searchsorted(reached / reached[-1], COVER)) + 1]


@dataclass(frozen=True)
class Group:
    """Effects that may replace each other in the leading explanation, singly or in combination: ``ways``."""

    ways: tuple[tuple[str, ...], ...]
    distance: float  #: the largest from the leading one
    rig: int  #: number of ways, the first ones, that are of the rig alone

    @property
    def effects(self) -> tuple[str, ...]:
        """All effects of the ways, each once."""
        return tuple(dict.fromkeys(chain.from_iterable(self.ways)))


def distance(fit: ModelFit, other: ModelFit, first: int | None = None) -> float:
    """Norm of the difference of two best-fitting predictions in units of noise, without outliers.

    ``first``: number of leading values compared, such as all first harmonics; every value where None.
    """
    weights = np.sqrt(fit.weights * other.weights)
    return float(np.sqrt(np.sum((weights * (fit.r - other.r) ** 2)[:first])))


def group_equivalent_effects(hypotheses: Sequence[Hypothesis], library: Mapping[str, Effect]) -> tuple[Group, ...]:
    """For each effect of the leading explanation, those that could replace it and not be told from it.

    ``hypotheses`` are in order of probability. Two effects together may replace one: a second plane read with a wrong
    gain is a second mode.
    """
    leading, groups = hypotheses[0], []
    least = leading.log_posterior + float(np.log(LEAST_ODDS))
    possible = [other for other in hypotheses[1:] if other.log_posterior > least]
    for effect in leading.effects:
        rest = leading.key - {effect}
        ways, farthest = list[tuple[str, ...]]([(effect,)]), 0.0
        for other in (other for other in possible if rest <= other.key and effect not in other.key):
            swapped, difference = other.key - rest, distance(leading.best, other.best)
            is_equivalent = 0 < len(swapped) <= _MOST_SWAPPED and difference < INDISTINCT
            if is_equivalent and not any(swapped >= set(way) for way in ways):
                ways.append(tuple(name for name in other.effects if name in swapped))
                farthest = max(farthest, difference)
        if len(ways) > 1:
            ways.sort(key=lambda way: not _is_of_rig(way, library))
            groups.append(Group(tuple(ways), farthest, sum(_is_of_rig(way, library) for way in ways)))
    return tuple(groups)


def _is_of_rig(names: Collection[str], library: Mapping[str, Effect]) -> bool:
    return all(library[name].kind == "instrument" for name in names)
