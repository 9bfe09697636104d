"""The scorer of the blind run: each answer beside the label of its case, then every figure of the table of goals.

An answer is good if it is right or states its limits: the true effects lead or are in the set of 0.95, or the answer
reports that something is unexplained or that the cause is probably outside the library. A null case is good if nothing
is blamed. Shares have exact binomial intervals (Clopper and Pearson), means and percentiles bootstrap ones, at 95 %.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import permutations
from typing import Any, TypeAlias

import numpy as np

#: Gap, sigma, from which on a diagnosis is asked to see an effect.
DETECTABLE = 1.0
CONFIDENT = 0.95
#: Chance that the cause is in the library at all below which an answer has flagged itself.
DOUBTED = 0.5
_CLOSE = 1e-6  # of a frequency: rounding in an answer


@dataclass(frozen=True)
class Verdict:
    """A case and its answer."""

    name: str
    family: str
    kind: str
    field: bool
    gap: float
    rows: int
    true: frozenset[str]
    leading: frozenset[str] | None  #: explanation, None where the diagnosis failed
    probability: float  #: of it
    flagged: bool  #: whether the answer doubts itself
    listed: tuple[frozenset[str], ...]  #: the explanations that reach 0.95
    equivalents: tuple[frozenset[str], ...]
    held_out: float | None  #: held-out shrinkage, None where there is none
    iou: float | None  #: overlap of the footprint with the cells truly altered, None where there is none
    cpu_seconds: float | None
    of_rig: bool  #: nothing but the rig is at fault, or nothing at all
    accuses: bool  #: a part of the structure is blamed

    @property
    def right(self) -> bool:
        """The leading explanation is the true one, name by name."""
        return self.leading == self.true

    @property
    def right_or_equivalent(self) -> bool:
        """Right, or wrong only by effects that the answer states as equivalent to the true ones."""
        if self.leading is None or len(self.leading) != len(self.true):
            return False
        missed, added = sorted(self.true - self.leading), sorted(self.leading - self.true)
        return any(
            all(any({a, b} <= group for group in self.equivalents) for a, b in zip(missed, order, strict=True))
            for order in permutations(added)
        )

    @property
    def blames(self) -> bool:
        """The answer blames something, named or not."""
        return bool(self.leading) or self.flagged

    @property
    def good(self) -> bool:
        """Right or with its limits stated: see the module."""
        if self.leading is None:
            return False
        if self.family == "null":
            return not self.blames
        if self.gap < DETECTABLE and not self.blames:
            return True
        return self.flagged or self.right_or_equivalent or self.true in self.listed

    @property
    def confidently_wrong(self) -> bool:
        """Wrong at a probability beyond ``CONFIDENT`` without a flag; an effect too small to see is not counted."""
        if self.leading is None or self.flagged or self.right_or_equivalent or self.probability <= CONFIDENT:
            return False
        return bool(self.leading) or self.gap >= DETECTABLE

    @property
    def wrongs_structure(self) -> bool:
        """The structure is blamed, without a flag, for what the rig or nothing did."""
        return self.of_rig and self.accuses and not self.flagged


Cases: TypeAlias = Sequence[Verdict]


def judge(name: str, label: Mapping[str, Any], answer: Mapping[str, Any], rig: frozenset[str] = frozenset()) -> Verdict:
    """The label and the answer (``gap/1``, or ``{"format", "error"}``) of one case; ``rig``: effects of the rig."""
    failed = "error" in answer
    explanations = [] if failed else answer["explanations"]
    leading = None if failed else frozenset(answer["effects"])
    known = answer.get("in_library")
    return Verdict(
        name=name,
        family=label["family"],
        kind=label["kind"],
        field=label["conditions"] == "field",
        gap=label["gap"],
        rows=label["rows"],
        true=frozenset(label["effects"]),
        leading=leading,
        probability=float(explanations[0]["probability"]) if explanations else 0.0,
        flagged=bool(answer.get("unexplained", False)) or (known is not None and known < DOUBTED),
        listed=tuple(frozenset(explanation["effects"]) for explanation in explanations),
        equivalents=tuple(frozenset(group) for group in answer.get("equivalents", ())),
        held_out=((answer.get("gap") or {}).get("held_out") or {}).get("shrinkage"),
        iou=None if failed else overlap_footprint(label, answer["footprint"]),
        cpu_seconds=answer.get("cpu_seconds"),
        of_rig=set(label["effects"]) <= set(label.get("rig", ())),
        accuses=bool((leading or frozenset()) - rig),
    )


def overlap_footprint(label: Mapping[str, Any], footprint: list[Mapping[str, Any]]) -> float | None:
    """Cells in both over cells in either (a cell is a row and a quantity); None where both are empty."""
    altered = {(row, quantity) for quantity, rows in label["altered"].items() for row in rows}
    places = list(enumerate(zip(label["sweep"], label["frequency"], strict=True)))
    blamed = {
        (row, cell["quantity"])
        for cell in footprint
        for row, (sweep, frequency) in places
        if str(cell["sweep"]) == sweep
        and cell["frequency_low"] * (1 - _CLOSE) <= frequency <= cell["frequency_high"] * (1 + _CLOSE)
    }
    either = len(altered | blamed)
    return len(altered & blamed) / either if either else None


#: Gap, sigma, from which on the explanation is asked to close it.
CLEAR = 2.0
_BINS = 10
_TYPICAL_ROWS = (120, 180)


@dataclass(frozen=True)
class Goal:
    """A goal of a figure; none where both are None."""

    low: float | None = None  #: at least
    high: float | None = None  #: at most


@dataclass(frozen=True)
class Figure:
    """One row of the table."""

    name: str
    goal: Goal
    measured: float | None = None  #: None without cases
    low: float | None = None  #: end of its 95 % interval
    high: float | None = None  #: the other end
    cases: int = 0
    share: bool = True  #: whether the value is a share of 1

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None without a goal or a value."""
        low, high = self.goal.low, self.goal.high
        if self.measured is None or (low is None and high is None):
            return None
        return (low is None or self.measured >= low) and (high is None or self.measured <= high)


def score(cases: Cases, processor_seconds: float | None = None, followed: Cases | None = None) -> list[Figure]:
    """Every figure of the table.

    ``processor_seconds``: of the whole diagnosis, where answers do not tell their own. ``followed``: cases whose
    proposed test was made, with the answer after it; None where none was asked for.
    """
    null, outside = select_cases(cases, "null"), select_cases(cases, "outside")
    named = select_cases(cases, "single", "pair", gap=DETECTABLE)
    single = select_cases(cases, "single", gap=DETECTABLE)
    detectable = select_cases(cases, "single", "pair", "outside", gap=DETECTABLE)
    rig = [case for case in cases if case.of_rig]
    shares: list[tuple[str, Cases, Callable[[Verdict], bool], Goal]] = [
        ("good: right or honestly short", cases, lambda c: c.good, Goal(low=0.97)),
        ("good, cause in no library", outside, lambda c: c.good, Goal(low=0.92)),
        ("right by effects alone, gap >= 1 sigma", named, lambda c: c.right, Goal(low=0.88)),
        ("… or a stated equivalent", named, lambda c: c.right_or_equivalent, Goal()),
        ("… clean noise", [c for c in single if not c.field], lambda c: c.right, Goal()),
        ("… field conditions", [c for c in single if c.field], lambda c: c.right, Goal()),
        ("true effect in the 0.95 set, gap >= 1 sigma", single, lambda c: c.true in c.listed, Goal(0.94, 0.98)),
        ("confidently wrong", cases, lambda c: c.confidently_wrong, Goal(high=0.01)),
        ("confidently wrong, cause in no library", outside, lambda c: c.confidently_wrong, Goal(high=0.02)),
        ("rig fault or none put on the structure", rig, lambda c: c.wrongs_structure, Goal(high=0.0)),
        ("null cases wrongly accused", null, lambda c: c.blames, Goal(high=0.01)),
        ("gap >= 1 sigma detected", detectable, lambda c: c.blames, Goal(low=0.99)),
        ("flagged though the effect is in the library, gap >= 1 sigma", named, lambda c: c.flagged, Goal()),
        ("both of a pair named", select_cases(cases, "pair"), lambda c: c.true <= (c.leading or frozenset()), Goal()),
    ]
    if followed is not None:
        known = [case for case in followed if case.family != "outside"]
        shares.append(("settled by the test proposed, cause in the library", known, is_settled, Goal(low=0.8)))
    return [
        *(measure_share(name, some, hit, goal) for name, some, hit, goal in shares),
        *_list_extents(cases, named, single),
        _measure_calibration(cases),
        *_list_work(cases, processor_seconds),
    ]


def is_settled(case: Verdict) -> bool:
    """The true effects, or stated equivalents, lead beyond ``CONFIDENT``."""
    return case.right_or_equivalent and case.probability >= CONFIDENT


def select_cases(cases: Cases, *families: str, gap: float = 0.0) -> list[Verdict]:
    """The cases of some families with a gap of ``gap`` sigma or more."""
    return [case for case in cases if case.family in families and case.gap >= gap]


def measure_share(name: str, cases: Cases, hit: Callable[[Verdict], bool], goal: Goal) -> Figure:
    """The share of cases that are hit."""
    from scipy.stats import binomtest  # noqa: PLC0415 - 20 MB that a page of scores needs not

    n, k = len(cases), sum(hit(case) for case in cases)
    if n == 0:
        return Figure(name, goal)
    low, high = map(float, binomtest(k, n).proportion_ci(0.95, method="exact"))
    return Figure(name, goal, k / n, low, high, n)


def _measure_statistic(
    name: str, values: Sequence[float], statistic: Callable[..., np.floating | float], goal: Goal, share: bool = True
) -> Figure:
    """A mean or percentile of values, with its bootstrap interval: equal of equal answers, none of fewer than two."""
    from scipy.stats import bootstrap  # noqa: PLC0415 - 20 MB that a page of scores needs not

    if not values:
        return Figure(name, goal, share=share)
    data, measured = np.asarray(values, float), float(statistic(np.asarray(values, float)))
    if data.size < 2 or np.ptp(data) == 0.0:
        return Figure(name, goal, measured, cases=data.size, share=share)
    drawn = bootstrap((data,), statistic, method="percentile", n_resamples=2000, rng=0, vectorized=False)
    low, high = map(float, drawn.confidence_interval)
    return Figure(name, goal, measured, low, high, data.size, share)


def _list_extents(cases: Cases, named: Cases, single: Cases) -> list[Figure]:
    """Length of the set, place of the effect, and shrinkage of the gap on held-out levels."""
    clear = select_cases(cases, "single", "pair", gap=CLEAR)
    held = [case.held_out for case in clear if case.right and case.held_out is not None]
    overlaps = [case.iou if case.iou is not None else 0.0 for case in named]
    sizes = [float(len(case.listed)) for case in single if case.leading is not None]
    tenth = partial(np.percentile, q=10)
    return [
        _measure_statistic("mean size of the 0.95 set", sizes, np.mean, Goal(high=2.5), share=False),
        _measure_statistic("footprint against the cells truly altered, mean IoU", overlaps, np.mean, Goal(low=0.9)),
        _measure_statistic("held-out shrinkage, right, gap >= 2 sigma: median", held, np.median, Goal(low=0.98)),
        _measure_statistic("held-out shrinkage, right, gap >= 2 sigma: 10th percentile", held, tenth, Goal(low=0.9)),
    ]


def _measure_calibration(cases: Cases) -> Figure:
    known = [case for case in select_cases(cases, "null", "single", "pair") if case.leading is not None]
    name, goal = "expected calibration error", Goal(high=0.05)
    if not known:
        return Figure(name, goal)
    pairs = np.array([[case.probability, float(case.right)] for case in known])
    rng = np.random.default_rng(0)
    drawn = [calibration_error(pairs[rng.integers(0, len(pairs), len(pairs))]) for _ in range(1000)]
    low, high = np.percentile(drawn, [2.5, 97.5]).tolist()
    return Figure(name, goal, calibration_error(pairs), low, high, len(known))


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
    name, goal = "processor time per case of 120 to 180 points, s", Goal(high=1.5)
    time = _measure_statistic(name, own, np.mean, goal, share=False)
    if cases and not own and processor_seconds is not None:
        name, mean = "processor time per case, all of it, s", processor_seconds / len(cases)
        time = Figure(name, goal, mean, cases=len(cases), share=False)
    return [time, measure_share("cases without an answer", cases, lambda case: case.leading is None, Goal(high=0.0))]
