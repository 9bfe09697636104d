"""The scorer of the blind run: opens the labels beside the answers and computes every figure of the table of goals.

Shares have exact binomial intervals (Clopper and Pearson), means and percentiles bootstrap ones, all at 95 %.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import binomtest, bootstrap

from damping.errors import InputError
from damping_validation.verdicts import Verdict, read_verdicts

#: Gap, sigma, from which on a diagnosis is asked to see an effect.
DETECTABLE = 1.0
#: Gap, sigma, from which on the explanation is asked to close it.
CLEAR = 2.0
#: Gap, sigma, from which on nothing may be missed.
LARGE = 4.0
CONFIDENT = 0.95
#: Root sum of squares by which the nearest other effect must miss a record for the record to tell them apart.
APART = 5.0
_BINS = 10
_TYPICAL_ROWS = (120, 180)


@dataclass(frozen=True)
class Goal:
    """At least ``low`` and at most ``high``; None where the figure has no goal."""

    low: float | None = None
    high: float | None = None

    def met(self, value: float) -> bool | None:
        """Whether the value is within; None without a goal."""
        if self.low is None and self.high is None:
            return None
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)


@dataclass(frozen=True)
class Figure:
    """One row of the table: measured value (None without cases), its 95 % interval, cases, goal. ``share``: of 1."""

    name: str
    goal: Goal
    measured: float | None
    low: float | None
    high: float | None
    cases: int
    share: bool = True

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None without a goal or a value."""
        return None if self.measured is None else self.goal.met(self.measured)


Cases = Sequence[Verdict]


def read_sealed(labels: Path, answers: Path, sealed: str) -> list[Verdict]:
    """The verdicts, from labels that are still those whose SHA-256 was recorded before the diagnosis.

    Raises:
        InputError: labels that were changed since, or an answer of another form.
    """
    content = labels.read_bytes()
    if hashlib.sha256(content).hexdigest() != sealed:
        raise InputError("the labels are not those that were sealed", file=labels, expected=f"SHA-256 {sealed}")
    return read_verdicts(json.loads(content), answers)


def score(cases: Cases, processor_seconds: float | None = None) -> list[Figure]:
    """Every figure of the table; ``processor_seconds`` of the whole diagnosis where answers do not tell their own."""
    return [
        *_list_nulls(cases),
        *_list_classes(cases),
        *_list_sets(cases),
        *_list_confidence(cases),
        *_list_foreign(cases),
        *_list_pairs(cases),
        *_list_extents(cases),
        *_list_calibration(cases),
        *_list_work(cases, processor_seconds),
    ]


def _draw_share(name: str, cases: Cases, hit: Callable[[Verdict], bool], goal: Goal | None = None) -> Figure:
    """The share of cases that are hit."""
    n, k = len(cases), sum(hit(case) for case in cases)
    if n == 0:
        return Figure(name, goal or Goal(), None, None, None, 0)
    interval = binomtest(k, n).proportion_ci(0.95, method="exact")
    return Figure(name, goal or Goal(), k / n, float(interval.low), float(interval.high), n)


def _draw_statistic(
    name: str, values: Sequence[float], of: Callable[..., np.floating | float], goal: Goal, share: bool = True
) -> Figure:
    """A mean or percentile of values, with its bootstrap interval (none for fewer than two values)."""
    if not values:
        return Figure(name, goal, None, None, None, 0, share)
    data, measured = np.asarray(values, float), float(of(np.asarray(values, float)))
    if data.size < 2 or np.ptp(data) == 0.0:
        return Figure(name, goal, measured, None, None, data.size, share)
    rng = np.random.default_rng(0)  # the interval of equal answers is equal
    found = bootstrap((data,), of, method="percentile", n_resamples=2000, rng=rng, vectorized=False)
    low, high = found.confidence_interval
    return Figure(name, goal, measured, float(low), float(high), data.size, share)


def _list_only(cases: Cases, *families: str, gap: float = 0.0, below: float = np.inf) -> list[Verdict]:
    return [case for case in cases if case.family in families and gap <= case.gap < below]


def _list_nulls(cases: Cases) -> list[Figure]:
    null = _list_only(cases, "null")
    parts = [
        _draw_share(f"null cases wrongly accused: {what}", [c for c in null if c.kind == f"null:{kind}"], _accused)
        for kind, what in (
            ("nothing", "nothing changed"),
            ("parameters", "parameter errors"),
            ("scatter", "sweep-to-sweep scatter"),
        )
    ]
    detected = _list_only(cases, "single", "pair", "outside", gap=DETECTABLE)
    return [
        _draw_share("null cases wrongly accused", null, _accused, Goal(high=0.01)),
        *parts,
        _draw_share("gap >= 1 sigma detected", detected, _accused, Goal(low=0.99)),
    ]


def _accused(case: Verdict) -> bool:
    return case.accused


def _list_classes(cases: Cases) -> list[Figure]:
    """Leading class of single effects: strictly, up to stated equivalents, and where the record can tell."""
    found: list[Figure] = []
    for field, where, goal in ((False, "clean noise", 0.97), (True, "field conditions", 0.92)):
        some = [case for case in _list_only(cases, "single", gap=DETECTABLE) if case.field == field]
        told = [case for case in some if case.apart is not None and case.apart >= APART]
        found += [
            _draw_share(f"leading class right, gap >= 1 sigma, {where}", some, lambda c: c.right, Goal(low=goal)),
            _draw_share(f"… or its stated equivalent, {where}", some, lambda c: c.right_or_equivalent),
            _draw_share(
                f"… where the nearest other class misses by >= {APART:g} sigma, {where}", told, lambda c: c.right
            ),
        ]
    return found


def _list_sets(cases: Cases) -> list[Figure]:
    single = _list_only(cases, "single", gap=DETECTABLE)
    found = [_draw_share("true class in the 0.95 set, gap >= 1 sigma", single, _in_set, Goal(0.94, 0.98))]
    for field, where, most in ((False, "clean noise", 1.5), (True, "field conditions", 2.5)):
        sizes = [float(len(case.listed)) for case in single if case.field == field and case.said is not None]
        found.append(
            _draw_statistic(f"mean size of the 0.95 set, {where}", sizes, np.mean, Goal(high=most), share=False)
        )
    return found


def _in_set(case: Verdict) -> bool:
    return case.true in case.listed


def _list_confidence(cases: Cases) -> list[Figure]:
    known = [*_list_only(cases, "null"), *_list_only(cases, "single", "pair", gap=DETECTABLE)]
    unknown = _list_only(cases, "outside", gap=DETECTABLE)
    return [
        _draw_share("confidently wrong, effect known or none", known, _confidently_wrong, Goal(high=0.005)),
        _draw_share("confidently wrong, effect unknown", unknown, _confidently_wrong, Goal(high=0.10)),
    ]


def _confidently_wrong(case: Verdict) -> bool:
    return case.said is not None and not case.right and case.probability > CONFIDENT and not case.unexplained


def _list_foreign(cases: Cases) -> list[Figure]:
    inimitable = [case for case in _list_only(cases, "outside") if (case.left_by_nearest or 0.0) >= DETECTABLE]
    known = _list_only(cases, "single", "pair", gap=DETECTABLE)
    return [
        _draw_share(
            "unexplained: outside the library, gap >= 2 sigma",
            _list_only(cases, "outside", gap=CLEAR),
            _open,
            Goal(0.85),
        ),
        _draw_share(
            "unexplained: outside the library, gap >= 4 sigma",
            _list_only(cases, "outside", gap=LARGE),
            _open,
            Goal(0.97),
        ),
        _draw_share("… of which no effect of the library leaves < 1 sigma", inimitable, _open),
        _draw_share("unexplained though the effect is in the library, gap >= 1 sigma", known, _open),
    ]


def _open(case: Verdict) -> bool:
    return case.unexplained


def _list_pairs(cases: Cases) -> list[Figure]:
    kinds = (
        ("pair:force-instrument", "force + instrument", Goal(low=0.95)),
        ("pair:two-forces", "two forces", Goal(low=0.80)),
        ("pair:force-structure", "force + structure", Goal()),
    )
    found = []
    for kind, what, goal in kinds:
        some = [c for c in cases if c.kind == kind]
        found.append(_draw_share(f"both of a pair named: {what}", some, _both, goal))
        found.append(
            _draw_share(f"… or a stated equivalent: {what}", some, lambda c: _both(c) or c.right_or_equivalent)
        )
    return found


def _both(case: Verdict) -> bool:
    return case.said is not None and case.true <= case.said


def _list_extents(cases: Cases) -> list[Figure]:
    """Where the effect acts, and how far the gap shrinks on levels that did not choose it."""
    known = _list_only(cases, "single", "pair", gap=DETECTABLE)
    overlaps = [case.iou if case.iou is not None else 0.0 for case in known]
    clear = _held_out(_list_only(cases, "single", "pair", gap=CLEAR))
    small = _held_out(_list_only(cases, "single", "pair", gap=DETECTABLE, below=CLEAR))
    return [
        _draw_statistic("footprint against the cells truly altered, mean IoU", overlaps, np.mean, Goal(low=0.9)),
        _draw_statistic("held-out shrinkage, class right, gap >= 2 sigma: median", clear, np.median, Goal(low=0.98)),
        _draw_statistic(
            "held-out shrinkage, class right, gap >= 2 sigma: 10th percentile", clear, _tenth, Goal(low=0.90)
        ),
        _draw_statistic(
            "held-out shrinkage, class right, gap 1-2 sigma: 10th percentile", small, _tenth, Goal(low=0.80)
        ),
    ]


def _held_out(cases: Cases) -> list[float]:
    return [case.held_out for case in cases if case.right and case.held_out is not None]


def _tenth(values: np.ndarray) -> float:
    return float(np.percentile(values, 10))


def _list_calibration(cases: Cases) -> list[Figure]:
    known = [case for case in _list_only(cases, "null", "single", "pair") if case.said is not None]
    if not known:
        return [Figure("expected calibration error", Goal(high=0.05), None, None, None, 0)]
    pairs = np.array([[case.probability, float(case.right)] for case in known])
    rng = np.random.default_rng(0)
    drawn = [calibration_error(pairs[rng.integers(0, len(pairs), len(pairs))]) for _ in range(1000)]
    low, high = np.percentile(drawn, [2.5, 97.5])
    error = calibration_error(pairs)
    return [Figure("expected calibration error", Goal(high=0.05), error, float(low), float(high), len(known))]


def calibration_error(pairs: np.ndarray) -> float:
    """Mean over cases of |share right - mean probability| in ten equal bins of the leading probability.

    ``pairs`` is (cases, 2): probability, 1 where right.
    """
    place = np.minimum((pairs[:, 0] * _BINS).astype(int), _BINS - 1)
    counts = np.bincount(place, minlength=_BINS)
    misfit = np.abs(np.bincount(place, pairs[:, 0], _BINS) - np.bincount(place, pairs[:, 1], _BINS))
    return float(misfit.sum() / counts.sum())


def _list_work(cases: Cases, processor_seconds: float | None) -> list[Figure]:
    low, high = _TYPICAL_ROWS
    own = [c.cpu_seconds for c in cases if c.cpu_seconds is not None and low <= c.rows <= high]
    name, goal = "processor time per case of 120 to 180 points, s", Goal(high=2.0)
    if own or processor_seconds is None or not cases:
        time = _draw_statistic(name, own, np.mean, goal, share=False)
    else:
        mean = processor_seconds / len(cases)
        time = Figure("processor time per case, all of it, s", goal, mean, None, None, len(cases), share=False)
    failed = _draw_share("cases without an answer", cases, lambda case: case.said is None, Goal(high=0.0))
    return [time, failed]
