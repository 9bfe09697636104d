"""Which terms stay: none taken out, step by step, or the best of all subsets; free or with every coefficient >= 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selection.errors import InputError
from selection.regression.criteria import NAMES, check_criterion
from selection.regression.design import Design
from selection.regression.fit import Fit, fit
from selection.regression.nonnegative import fit_nonnegative
from selection.regression.stepwise import DIRECTIONS, Step, stepwise
from selection.regression.subsets import Subsets, best_subsets

_WHOLE, _BEST_OF_SIZE = 9, 20  # up to 2^9 - 1 models are all kept, of more the best of each size
METHODS = ("none", *DIRECTIONS, "best")


@dataclass(frozen=True)
class Choice:
    """How terms are selected: ``method`` of ``METHODS``, ``criterion`` of ``criteria.NAMES``, coefficients >= 0 or
    free, and the T-ratio at which steps stop (None: the criterion stops them).

    Raises InputError for a value that is not allowed.
    """

    method: str = "none"
    criterion: str = "bic"
    nonnegative: bool = False
    t_stop: float | None = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"no selection {self.method!r}", expected=f"one of {', '.join(METHODS)}")
        check_criterion(self.criterion)
        if self.t_stop is None:
            return
        if self.method not in DIRECTIONS:
            raise InputError(
                f"a T-ratio to stop at does not go with selection {self.method!r}",
                expected=f"one of {', '.join(DIRECTIONS)}",
            )
        if not (np.isfinite(self.t_stop) and self.t_stop >= 0.0):
            raise InputError(f"a T-ratio of {self.t_stop} to stop at", expected="a finite number >= 0")


@dataclass(frozen=True)
class Selected:
    """The selected terms (``design``), their ``fit``, the ``steps`` to them, and for ``best`` the best ``models``."""

    design: Design
    fit: Fit
    steps: tuple[Step, ...]
    models: Subsets | None


def select(design: Design, choice: Choice) -> Selected:
    """Select among the terms of a design.

    Raises:
        AnalysisError: a numerically rank-deficient design (the columns are named), or no model qualifies.
    """
    fitter = fit_nonnegative if choice.nonnegative else fit
    if choice.method == "none":
        return Selected(design, fitter(design), (), None)
    if choice.method == "best":
        return _best(design, choice)
    found = stepwise(design, choice.method, criterion=choice.criterion, t_stop=choice.t_stop, fitter=fitter)
    return Selected(design.take(found.chosen), found.fit, found.steps, None)


def _best(design: Design, choice: Choice) -> Selected:
    """The best subset; its steps drop the other terms one after the other, so that they can be followed."""
    per_size = 2**design.k if design.k <= _WHOLE else _BEST_OF_SIZE
    models = best_subsets(design, choice.criterion, nonnegative=choice.nonnegative, per_size=per_size)
    kept = [int(i) for i in np.flatnonzero(models.members[0])]
    chosen = design.take(kept)
    reason = f"not in the subset with the best {NAMES[choice.criterion]} of all {2**design.k - 1}"
    found, score = fit(chosen), float(models.scores(choice.criterion)[0])
    dropped = [name for i, name in enumerate(design.names) if i not in kept]
    return Selected(chosen, found, tuple(Step("drop", name, reason, np.nan, score, found) for name in dropped), models)
