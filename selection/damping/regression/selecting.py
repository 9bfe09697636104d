"""Selection of terms: all, step by step, or the best of all subsets; free or with every coefficient >= 0.

Damping dissipates energy, so a negative coefficient is no damping. Steps are those of the report: "By repeating the
procedure with the few terms of most significance a new set of improved results occur" (section 5.3). T-ratios propose
a step, to drop the term of least |T| or to add the one that would enter with the largest; the T-ratio to stop at, or
else a criterion, decides whether it is taken. Nested searches fit few of the models; ``subsets`` covers all.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from damping.arrays import BoolArray, IntArray, is_number
from damping.errors import AnalysisError, InputError, check_choice, check_flags
from damping.regression.criteria import NAMES, check_criterion
from damping.regression.design import Basis, Design, decompose, solve_nonnegative
from damping.regression.fit import Fit, fit
from damping.regression.subsets import Subsets, all_subsets, best_subsets, rank_subsets

DIRECTIONS = ("backward", "forward", "stepwise")


@dataclass(frozen=True)
class Step:
    """A step of a selection."""

    action: str  #: "start", "drop" or "add"
    term: str  #: what is dropped or added
    reason: str  #: why
    t_ratio: float  #: the |T| it rests on, NaN where on none
    score: float  #: of the model's criterion, lower is better
    fit: Fit  #: the model after it


@dataclass(frozen=True)
class Selection:
    """The selected terms."""

    chosen: tuple[int, ...]  #: indices into the design
    fit: Fit
    steps: tuple[Step, ...] = ()  #: to them: "start" from all terms, or "add" the first to none
    models: Subsets | None = None  #: the best ones, for the method ``best``


Fitter: TypeAlias = Callable[[Design], Fit]


def stepwise(
    design: Design,
    direction: str = "backward",
    *,
    criterion: str = "bic",
    t_stop: float | None = None,
    fitter: Fitter = fit,
) -> Selection:
    """Select terms step by step; at least one is always kept.

    ``backward`` starts from all terms, ``forward`` and ``stepwise`` from the most significant one; ``stepwise`` drops a
    term where it can before it adds one. ``criterion`` decides where ``t_stop`` does not: a step is taken while it
    improves it. ``t_stop``: drop while the least |T| is below it, add while the entering |T| is not. ``fitter``:
    ``fit``, or ``fit_nonnegative``; a term that it holds at 0 is dropped at once.

    InputError: an unknown direction or criterion.
    AnalysisError: the design of all terms is numerically rank-deficient (the columns are named), or leaves
        backward elimination no degrees of freedom.
    """
    check_choice(direction, DIRECTIONS, f"no direction {direction!r}")
    decompose(design)
    if direction == "backward" and design.n == design.k:
        message = f"backward elimination needs more observations than terms, to judge these by: {design.k} of each here"
        raise AnalysisError(message)
    search = _Search(design, criterion, t_stop, fitter)
    if direction == "backward":
        mask = np.ones(design.k, dtype=np.bool_)
        steps = [search.step("start", None, mask, np.nan, f"all {design.k} terms")]
    else:
        first = int(np.argmin([fitter(design.take([i])).sse for i in range(design.k)]))
        mask = np.arange(design.k) == first
        steps = [search.step("add", first, mask, np.nan, "the most significant when taken by itself")]
    seen: set[bytes] = set()
    while mask.tobytes() not in seen:
        seen.add(mask.tobytes())
        step = search.drop(mask, steps[-1], held_only=direction == "forward")
        if step is None and direction != "backward":
            step = search.add(mask, steps[-1])
        if step is None:
            break
        steps.append(step)
        mask = mask ^ (np.array(design.names) == step.term)
    return Selection(tuple(int(i) for i in np.flatnonzero(mask)), steps[-1].fit, tuple(steps))


@dataclass(frozen=True)
class _Search:
    """The data from which steps are proposed and judged."""

    design: Design
    criterion: str
    t_stop: float | None
    fitter: Fitter

    def step(self, action: str, j: int | None, mask: BoolArray, t_ratio: float, reason: str) -> Step:
        """The step to the terms of ``mask``, fitted."""
        model = self.fitter(self.design.take(np.flatnonzero(mask)))
        term = "" if j is None else self.design.names[j]
        score = float(model.criteria.score(self.criterion))
        return Step(action, term, reason, t_ratio, np.inf if np.isnan(score) else score, model)

    def drop(self, mask: BoolArray, now: Step, held_only: bool) -> Step | None:
        """To the model without the term of least |T| (a term held at 0 first), if that is to be taken."""
        if mask.sum() == 1:
            return None
        terms, ratios = np.flatnonzero(mask), np.abs(now.fit.t_ratios)
        if not now.fit.active.all():
            held = int(terms[np.argmin(now.fit.active)])
            return self.step("drop", held, _flipped(mask, held), np.nan, "held at 0 by coefficients >= 0")
        if held_only:
            return None
        j, least = int(terms[np.argmin(ratios)]), float(ratios.min())
        reason = f"|T| = {least:.4g} is the least"
        if self.t_stop is not None:
            reason = f"{reason} and below {self.t_stop:g}"
            return self.step("drop", j, _flipped(mask, j), least, reason) if least < self.t_stop else None
        return self._if_better(self.step("drop", j, _flipped(mask, j), least, reason), now)

    def add(self, mask: BoolArray, now: Step) -> Step | None:
        """To the model with the term that enters with the largest |T|, if that is to be taken."""
        able = []
        for j in np.flatnonzero(~mask).tolist():
            step = self.step("add", j, _flipped(mask, j), np.nan, "")
            ratio = float(abs(step.fit.t_ratios[step.fit.names.index(step.term)]))
            if not np.isnan(ratio):
                able.append(replace(step, t_ratio=ratio, reason=f"|T| = {ratio:.4g} is the largest on entry"))
        if not able:
            return None
        best = max(able, key=lambda step: step.t_ratio)
        if self.t_stop is not None:
            reason = f"{best.reason} and not below {self.t_stop:g}"
            return replace(best, reason=reason) if best.t_ratio >= self.t_stop else None
        return self._if_better(best, now)

    def _if_better(self, step: Step, now: Step) -> Step | None:
        sign = -1.0 if self.criterion == "adjusted-r2" else 1.0  # a score is lower when it is better; people see this
        shown = f"{NAMES[self.criterion]} {sign * now.score:.6g} -> {sign * step.score:.6g}"
        return replace(step, reason=f"{step.reason}; {shown}") if step.score < now.score else None


def _flipped(mask: BoolArray, j: int) -> BoolArray:
    return np.asarray(mask ^ (np.arange(len(mask)) == j))


def fit_nonnegative(design: Design) -> Fit:
    """Least-squares fit of a design under a_k >= 0 (Lawson and Hanson's active set).

    The solution is the free fit of the terms that the constraint does not hold at 0; statistics are of that fit, so
    they take the set of those terms as given. Terms held at 0 have coefficient 0, no statistics and do not count as
    parameters. ``condition_number`` is of all columns.

    AnalysisError: the design is numerically rank-deficient (the columns are named), or no solution is found.
    """
    basis = decompose(design)
    size = np.abs(design.observed).max() or 1.0
    free = np.flatnonzero(solve_nonnegative(basis.factor, basis.orthonormal.T @ (design.observed / size)) > 0.0)
    while len(free):
        fitted = fit(design.take(free))
        if (fitted.coefficients > 0.0).all():
            return _with_zeros(fitted, free, design, basis)
        free = free[fitted.coefficients > 0.0]  # a coefficient that is 0 but for rounding
    return _with_zeros(None, free, design, basis)


def _with_zeros(fitted: Fit | None, free: IntArray, design: Design, basis: Basis) -> Fit:
    """The fit of the free terms, with the others put in at 0; without any free term every coefficient is held at 0."""
    k = design.k
    active, covariance = np.zeros(k, dtype=np.bool_), np.full((k, k), np.nan)
    statistics = {"coefficients": np.zeros(k)} | {name: np.full(k, np.nan) for name in _STATISTICS}
    deviations, leverages = design.observed.copy(), np.zeros(design.n)
    if fitted is not None:
        active[free] = True
        covariance[np.ix_(free, free)] = fitted.covariance
        for name, values in statistics.items():
            values[free] = getattr(fitted, name)
        deviations, leverages = fitted.deviations, fitted.leverages
    return Fit(
        names=design.names,
        **statistics,
        covariance=covariance,
        active=active,
        observed=design.observed,
        deviations=deviations,
        leverages=leverages,
        condition_number=basis.condition_number,
    )


_STATISTICS = ("std_errors", "t_ratios", "p_values")
#: Most terms of which every subset is listed, best first; of more, the best ones.
_MOST_TERMS_LISTED = 9
_BEST_LISTED = 20
METHODS = ("none", *DIRECTIONS, "best")


@dataclass(frozen=True)
class Choice:
    """How terms are selected.

    Raises InputError for a value that is not allowed.
    """

    method: str = "none"  #: one of ``METHODS``
    criterion: str = "bic"  #: one of ``criteria.NAMES``
    nonnegative: bool = False  #: coefficients >= 0, or free
    t_stop: float | None = None  #: T-ratio at which steps stop; None: the criterion stops them

    def __post_init__(self) -> None:
        check_choice(self.method, METHODS, f"no selection {self.method!r}")
        check_criterion(self.criterion)
        check_flags(nonnegative=self.nonnegative)
        if self.t_stop is None:
            return
        if self.method not in DIRECTIONS:
            raise InputError(
                f"a T-ratio to stop at does not go with selection {self.method!r}",
                expected=f"one of {', '.join(DIRECTIONS)}",
            )
        if not (is_number(self.t_stop) and np.isfinite(self.t_stop) and self.t_stop >= 0.0):
            raise InputError(f"a T-ratio of {self.t_stop} to stop at", expected="a finite number >= 0")


def select(design: Design, choice: Choice) -> Selection:
    """Select among the terms of a design. AnalysisError: it is rank-deficient, or no model qualifies."""
    fitter = fit_nonnegative if choice.nonnegative else fit
    if choice.method == "none":
        return Selection(tuple(range(design.k)), fitter(design))
    if choice.method == "best":
        return _best(design, choice)
    return stepwise(design, choice.method, criterion=choice.criterion, t_stop=choice.t_stop, fitter=fitter)


def _best(design: Design, choice: Choice) -> Selection:
    """The best subset; its steps drop the other terms one after the other, so that they can be followed."""
    if design.k <= _MOST_TERMS_LISTED:
        models = rank_subsets(all_subsets(design), choice.criterion, nonnegative=choice.nonnegative)
    else:
        models = best_subsets(design, choice.criterion, nonnegative=choice.nonnegative, number=_BEST_LISTED)
    chosen = tuple(int(i) for i in np.flatnonzero(models.members[0]))
    reason = f"not in the subset with the best {NAMES[choice.criterion]} of all {2**design.k - 1}"
    best, score = fit(design.take(chosen)), float(models.scores(choice.criterion)[0])
    dropped = [name for i, name in enumerate(design.names) if i not in chosen]
    return Selection(chosen, best, tuple(Step("drop", name, reason, np.nan, score, best) for name in dropped), models)
