"""Step by step to fewer terms (or from few to more): backward elimination by T-ratio as the report did, forward, both.

"By repeating the procedure with the few terms of most significance a new set of improved results occur" (section 5.3).
T-ratios propose a step: to drop the term of least |T|, to add the one that would enter with the largest. The T-ratio to
stop at, or else a criterion, decides whether it is taken. Nested searches see few of the models; ``subsets`` sees all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from damping.arrays import BoolArray
from damping.errors import AnalysisError, InputError
from damping.regression.decomposition import decompose
from damping.regression.design import Design
from damping.regression.fit import NAMES, Fit, check_criterion, fit

DIRECTIONS = ("backward", "forward", "stepwise")


@dataclass(frozen=True)
class Step:
    """A step: ``action`` is "start", "drop" or "add", ``term`` what is dropped or added, ``reason`` why; ``t_ratio`` is
    the |T| it rests on (NaN where it rests on none), ``fit`` the model after it and ``score`` that model's criterion as
    a score, lower is better."""

    action: str
    term: str
    reason: str
    t_ratio: float
    score: float
    fit: Fit


@dataclass(frozen=True)
class Selection:
    """The selected terms (indices into the design) and the whole way to them: "start" from all terms, or "add" the
    first to none."""

    chosen: tuple[int, ...]
    steps: tuple[Step, ...]

    @property
    def fit(self) -> Fit:
        """The fit of the selected terms."""
        return self.steps[-1].fit


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

    Args:
        design: all terms and the response.
        direction: ``backward`` starts from all terms, ``forward`` and ``stepwise`` from the most significant one;
            ``stepwise`` drops a term where it can before it adds one.
        criterion: decides where ``t_stop`` does not: a step is taken while it improves it.
        t_stop: drop while the least |T| is below it, add while the entering |T| is not.
        fitter: ``fit``, or ``fit_nonnegative``; a term that it holds at 0 is dropped at once.

    Raises:
        InputError: an unknown direction or criterion.
        AnalysisError: the design of all terms is numerically rank-deficient (the columns are named), or leaves
            backward elimination no degrees of freedom.
    """
    _check(design, direction, criterion)
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
    return Selection(tuple(int(i) for i in np.flatnonzero(mask)), tuple(steps))


@dataclass(frozen=True)
class _Search:
    """What steps are proposed from and judged by."""

    design: Design
    criterion: str
    t_stop: float | None
    fitter: Fitter

    def step(self, action: str, j: int | None, mask: BoolArray, t_ratio: float, reason: str) -> Step:
        """The step to the terms of ``mask``, fitted."""
        found = self.fitter(self.design.take(np.flatnonzero(mask)))
        term = "" if j is None else self.design.names[j]
        score = float(found.criteria.score(self.criterion))
        return Step(action, term, reason, t_ratio, np.inf if np.isnan(score) else score, found)

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
        said = f"|T| = {least:.4g} is the least"
        if self.t_stop is not None:
            reason = f"{said} and below {self.t_stop:g}"
            return self.step("drop", j, _flipped(mask, j), least, reason) if least < self.t_stop else None
        return self._if_better(self.step("drop", j, _flipped(mask, j), least, said), now)

    def add(self, mask: BoolArray, now: Step) -> Step | None:
        """To the model with the term that enters with the largest |T|, if that is to be taken."""
        entering = [self._entering(mask, int(j)) for j in np.flatnonzero(~mask)]
        able = [step for step in entering if not np.isnan(step.t_ratio)]
        if not able:
            return None
        best = max(able, key=lambda step: step.t_ratio)
        if self.t_stop is not None:
            reason = f"{best.reason} and not below {self.t_stop:g}"
            return replace(best, reason=reason) if best.t_ratio >= self.t_stop else None
        return self._if_better(best, now)

    def _entering(self, mask: BoolArray, j: int) -> Step:
        step = self.step("add", j, _flipped(mask, j), np.nan, "")
        ratio = float(abs(step.fit.t_ratios[step.fit.names.index(self.design.names[j])]))
        return replace(step, t_ratio=ratio, reason=f"|T| = {ratio:.4g} is the largest on entry")

    def _if_better(self, step: Step, now: Step) -> Step | None:
        reason = f"{step.reason}; {NAMES[self.criterion]} {_describe_shown(self.criterion, now.score, step.score)}"
        return replace(step, reason=reason) if step.score < now.score else None


def _flipped(mask: BoolArray, j: int) -> BoolArray:
    changed = mask.copy()
    changed[j] = not changed[j]
    return changed


def _describe_shown(criterion: str, before: float, after: float) -> str:
    sign = -1.0 if criterion == "adjusted-r2" else 1.0  # a score is lower when it is better; people see the criterion
    return f"{sign * before:.6g} -> {sign * after:.6g}"


def _check(design: Design, direction: str, criterion: str) -> None:
    check_criterion(criterion)
    if direction not in DIRECTIONS:
        raise InputError(f"no direction {direction!r}", expected=f"one of {', '.join(DIRECTIONS)}")
    decompose(design)
    if direction == "backward" and design.n == design.k:
        raise AnalysisError(
            f"backward elimination needs more than {design.k} observations to judge {design.k} terms by"
        )
