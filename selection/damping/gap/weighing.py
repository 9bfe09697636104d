"""How probable each explanation is, whether the library holds the cause at all, and what cannot be told apart.

Log odds are tempered (Guo, Pleiss, Sun and Weinberger 2017) as far as the cause may be in no library: those of
imitations differ by chance. The chance that the library holds the cause is logistic (as of Platt 1999) in what an
answer leaves; its constants are those of ``python -m damping_validation.guard doubts``, a regression on answers to
generated cases whose cause is in the library or in none; ``damping blind`` says how well the chance is kept.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from scipy.special import expit, logit, logsumexp, softmax

from damping.arrays import FloatArray
from damping.effects import CATALOGUE
from damping.effects.contract import Effect
from damping.gap.corrected import list_ends
from damping.gap.directed import Test, smallest_p
from damping.gap.fit import ModelFit
from damping.gap.hypotheses import Hypothesis
from damping.gap.model import residuals
from damping.gap.rows import Rows
from damping.gap.wild import log_likelihood

#: Probability that the list of explanations reaches.
COVER = 0.95
#: Temperature of the log odds between explanations where the cause is not in the library and all of them imitate it, by
#: what the record holds beyond first harmonics of one state: nothing, third ones or another state, both.
TEMPERATURES = (5.0, 6.0, 2.0)
#: Largest share of what causes outside the library leave to explanations that the best one has where there is nothing
#: beyond: first harmonics of one state are imitated to within their noise by effects that are not there. Of 1936 cases
#: of 66 kinds (600 of them foreign causes) .7 % were named wrongly beyond .95, 1.6 % without these.
LARGEST_IMITATION = 0.65
#: Log odds that the library holds the cause, where it holds three in five: of an effect that leaves noise only; other
#: odds where nothing is blamed; less for each of the `describe_doubts`.
IN_LIBRARY = 1.71
NOTHING_BLAMED = 0.40
PER_DECADE = 0.51
PER_MAKESHIFT = 2.42
PER_END = 1.01
PER_RIVAL = 0.91
#: ... more where something is measured beyond first harmonics of one state (`count_beyond`), which imitations seldom
#: get right: 420 cases of a blind run (seed 26112801) and 141 tests proposed of them say 0.8, with an error of 0.3.
PER_BEYOND = 0.7
#: ... and less for each e-fold of dispersion: by hand, since hardly a case of the regression has one.
PER_DISPERSION = 3.0
_MOST_DECADES = 6.0
#: ln of 1 + the odds of a foreign cause beyond which they say no more: 20 to 1 is as good as certain.
MOST_RIVAL = 3.0
#: Gain in ln p of the last effect of several at which it counts as half a makeshift: e^10 is as good as certain.
_PAYS = 10.0
#: Largest chance of a cause in the library where an effect of one sweep takes up all that a state of a single sweep
#: says: below ``KNOWN``, so that nothing is claimed of it.
UNCONFIRMED = 0.4
#: The chance that the library holds the cause from which an explanation counts as one.
KNOWN = 0.5
#: Distance below which two predictions are told apart only by chance: expected log odds d^2/2 = 3, one in twenty.
INDISTINCT = 2.45
#: Log odds of as much, from which a rival is told apart.
TOLD = 0.5 * INDISTINCT**2
#: Odds below which an effect is no candidate for the place of another, however near its prediction.
LEAST_ODDS = 0.02
_MOST_SWAPPED = 2


@dataclass(frozen=True)
class Explanation:
    """A hypothesis with its probability among all that were fitted, and that of those which add nothing to be seen."""

    effects: tuple[str, ...]
    probability: float
    hypothesis: Hypothesis


def weigh_hypotheses(ranked: Sequence[Hypothesis]) -> tuple[Explanation, ...]:
    """Probabilities among all hypotheses that were fitted, the most probable of which comes first.

    One that predicts as a more probable one does, but with a further effect, is no explanation of its own: that effect
    cannot be seen, and what it has of the probability is the other's. A small effect stays a rival of none.
    """
    told = dict[frozenset[str], list[Hypothesis]]()
    for hypothesis in ranked:
        same = (key for key, (first, *_) in told.items() if _adds_nothing(hypothesis, first))
        told.setdefault(next(same, hypothesis.key), []).append(hypothesis)
    probabilities = softmax([logsumexp([own.log_posterior for own in alike]) for alike in told.values()])
    weighed = [
        Explanation(first.effects, float(p), first) for (first, *_), p in zip(told.values(), probabilities, strict=True)
    ]
    return order_by_probability(weighed)


def order_by_probability(explanations: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """The most probable first; those that are as probable stay in their order."""
    return tuple(sorted(explanations, key=lambda explanation: -explanation.probability))


def _adds_nothing(further: Hypothesis, simpler: Hypothesis) -> bool:
    """Whether further effects beside those of a simpler explanation change its prediction by no more than chance."""
    return set() < simpler.key < further.key and distance(simpler.best, further.best) < INDISTINCT


def count_beyond(hypotheses: Sequence[Explanation], *further: Rows) -> int:
    """How much is measured beyond first harmonics of one state that tells the first explanation from imitations.

    Third harmonics do where they tell it from having none, or from an explanation of the same first harmonics, by log
    odds of ``INDISTINCT``^2/2. So do another state and added mass, but of a stiffness only beside third harmonics: one
    that follows the mean square of the motion, as of a spring that warms up, has the same first harmonics at any mass.
    ``further``: rows to come, as the first explanation predicts them.
    """
    fit = hypotheses[0].hypothesis.best
    every = (fit.model.problem.rows, *further)
    third = False
    if any("third" in rows.channels for rows in every):
        own, first = _miss_thirds(fit, every), len(every[0]) * (1 + every[0].has_phase)
        alike = (rival.hypothesis.best for rival in hypotheses[1:])
        others = (_miss_thirds(rival, every) for rival in alike if distance(fit, rival, first) < INDISTINCT)
        third = max([_miss_thirds(fit, every, predicts=False), *others]) - own >= INDISTINCT**2
    states = any(np.ptp(np.hstack([getattr(rows, name) for rows in every])) > 0.0 for name in ("added", "state"))
    stiff = any(CATALOGUE[name].force is not None and not CATALOGUE[name].damping for name in fit.effects)
    return third + (states and (third or not stiff))


def _miss_thirds(fit: ModelFit, every: Sequence[Rows], *, predicts: bool = True) -> float:
    """-2 ln p of what a fit misses of third harmonics, or of those themselves where it ``predicts`` none."""
    measured = [rows for rows in every if "third" in rows.channels]
    left = [_list_residuals(fit, own)[own.places("third")] if predicts else _list_thirds(fit, own) for own in measured]
    return -2.0 * sum(float(log_likelihood(own)) for own in left)


def _list_residuals(fit: ModelFit, rows: Rows) -> FloatArray:
    """Residuals (m,) of a fit: of the record as fitted, of other ``rows`` where no sweep deviates."""
    model = fit.model
    if rows is model.problem.rows:
        return fit.r
    terms = model.terms(fit.y[np.newaxis, : model.size])
    return np.asarray(residuals(terms, rows, np.zeros((1, 2 * len(rows.sweeps))), model.scatter).r[0])


def _list_thirds(fit: ModelFit, rows: Rows) -> FloatArray:
    """Measured third harmonics (2 n,), real parts first, in units of their noise as a fit takes it."""
    noise = fit.model.scatter.factor * rows.sd_third
    return np.concatenate([rows.third.real / noise, rows.third.imag / noise])


def blend_probabilities(hypotheses: tuple[Explanation, ...], in_library: float, beyond: int) -> tuple[Explanation, ...]:
    """Probabilities that can be staked on: blended with those of imitations, as likely as the cause is unknown.

    ``beyond``: see `count_beyond`. Where there is something, or nothing is blamed, explanations with the effects of the
    leading one and more are no imitations: they name what it names. Where there is nothing, or nothing is blamed, the
    leading one leaves a rest, which is that of causes nobody fitted. The most probable one stays so, since both parts
    grow with its log odds; others may change places, and are in the order in which they came.
    """
    named = hypotheses[0].hypothesis.key
    with np.errstate(divide="ignore"):  # what has no chance at all
        log_odds = np.log([explanation.probability for explanation in hypotheses])
    if beyond or not named:
        log_odds[[named < explanation.hypothesis.key for explanation in hypotheses]] = -np.inf
    outside = softmax(log_odds / TEMPERATURES[beyond])
    outside[0] = outside[0] if beyond and named else min(outside[0], LARGEST_IMITATION)
    return tuple(
        replace(explanation, probability=float(in_library * explanation.probability + (1.0 - in_library) * own))
        for explanation, own in zip(hypotheses, outside, strict=True)
    )


def foresee_probability(
    hypotheses: Sequence[Explanation], gained: FloatArray, in_library: float, now: int, beyond: int
) -> float:
    """Probability that the first of the hypotheses has once data gave log odds ``gained`` (n,) for it against each.

    ``in_library`` as it is now, with what is measured beyond first harmonics ``now``; ``beyond``: with these data.
    """
    in_library = float(expit(logit(in_library) + PER_BEYOND * (bool(beyond) - bool(now))))
    log_odds = np.array([own.hypothesis.log_posterior for own in hypotheses]) - gained
    after = tuple(replace(own, probability=float(p)) for own, p in zip(hypotheses, softmax(log_odds), strict=True))
    return blend_probabilities(after, in_library, beyond)[0].probability


def describe_doubts(tests: Sequence[Test], hypotheses: Sequence[Explanation], outside: Collection[float]) -> FloatArray:
    """What speaks against the first of ``hypotheses``, (4,).

    Decades of the smallest p-value (at most six), how much of a makeshift the effects beyond one are, best fits at the
    end of their range, ln of 1 + the odds against it of the most probable cause ``outside`` the library, from the log
    odds of each (at most three). A cause that is not known is patched up with what is: each patch pays little beside
    the others.
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
    """The chance that the cause is in the library at all: logistic, with the constants above.

    Where nothing is blamed and yet more than noise is left (``unexplained``) there is a cause, and the library holds it
    with no more than the probability that its effects have together (of 110 generated cases four were so, all foreign).
    """
    log_odds = IN_LIBRARY + PER_BEYOND * bool(beyond) - PER_DISPERSION * float(np.log(dispersion))
    log_odds -= float(doubts @ (PER_DECADE, PER_MAKESHIFT, PER_END, PER_RIVAL))
    if leading.effects:
        return float(expit(log_odds))
    return float(expit(log_odds) * (1.0 - leading.probability) if unexplained else expit(log_odds + NOTHING_BLAMED))


def hides_state(fit: ModelFit) -> bool:
    """Whether some effect is of a sweep that is the only one of its state: it fits whatever that state says."""
    rows = fit.model.problem.rows
    states = [(rows.added[own[0]], rows.state[own[0]]) for own in rows.runs]
    if not 1 < len(set(states)) < len(states):
        return False
    alone = [rows.label[own[0]] for own, state in zip(rows.runs, states, strict=True) if states.count(state) == 1]
    tables = (part.form.report(*part.values(own)) for part, own in fit.model.own_variables(fit.y[np.newaxis]))
    return any(np.any(np.isin(table.get("sweep", 0.0), alone)) for table in tables)


def cover_probability(hypotheses: tuple[Explanation, ...]) -> tuple[Explanation, ...]:
    """The fewest most probable hypotheses that reach ``COVER`` of the probability of all that were fitted."""
    reached = np.cumsum([hypothesis.probability for hypothesis in hypotheses])
    return hypotheses[: int(np.searchsorted(reached / reached[-1], COVER)) + 1]


@dataclass(frozen=True)
class Group:
    """Effects that may take one another's place in the leading explanation, alone or together: ``ways``.

    ``distance``: the largest to the leading one. ``rig``: how many of the ways, the first ones, are of the rig alone.
    """

    ways: tuple[tuple[str, ...], ...]
    distance: float
    rig: int

    @property
    def effects(self) -> tuple[str, ...]:
        """All effects of the ways, each once."""
        return tuple(dict.fromkeys(chain.from_iterable(self.ways)))


def distance(fit: ModelFit, other: ModelFit, first: int | None = None) -> float:
    """Norm of the difference of two best-fitting predictions in units of noise, wild points left out.

    ``first``: how many values from the beginning are compared, such as all first harmonics; every value where None.
    """
    weights = np.sqrt(fit.weights * other.weights)
    return float(np.sqrt(np.sum((weights * (fit.r - other.r) ** 2)[:first])))


def group_equivalent_effects(hypotheses: Sequence[Hypothesis], library: Mapping[str, Effect]) -> tuple[Group, ...]:
    """For each effect of the leading explanation, those that could stand in its place without being told from it.

    ``hypotheses`` are in order of probability. Two effects together may take the place of one: a second plane read with
    a wrong gain is a second mode.
    """
    leading = hypotheses[0]
    groups = []
    for effect in leading.effects:
        rest = leading.key - {effect}
        ways, farthest = list[tuple[str, ...]]([(effect,)]), 0.0
        for other in hypotheses[1:]:
            swapped = other.key - rest
            alive = other.log_posterior > leading.log_posterior + float(np.log(LEAST_ODDS))
            if alive and rest <= other.key and effect not in swapped and 0 < len(swapped) <= _MOST_SWAPPED:
                apart = distance(leading.best, other.best)
                if apart < INDISTINCT and not any(swapped >= set(way) for way in ways):
                    ways.append(tuple(name for name in other.effects if name in swapped))
                    farthest = max(farthest, apart)
        if len(ways) > 1:
            ways.sort(key=lambda way: not _is_of_rig(way, library))
            groups.append(Group(tuple(ways), farthest, sum(_is_of_rig(way, library) for way in ways)))
    return tuple(groups)


def _is_of_rig(names: Collection[str], library: Mapping[str, Effect]) -> bool:
    return all(library[name].kind == "instrument" for name in names)
