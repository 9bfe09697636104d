"""What an engineer would say of a gap: sentences from a diagnosis."""

from __future__ import annotations

from selection.gap.diagnose import Diagnosis
from selection.gap.effects.catalogue import CATALOGUE
from selection.report.words import joined, number, percent, share


def verdict(diagnosis: Diagnosis) -> str:
    """One sentence: what it is, how sure, and whether it is all."""
    gap, leading = diagnosis.gap, diagnosis.hypotheses[0]
    if not leading.effects:
        if outside(diagnosis):
            return f"Nothing in the library explains how the test differs; {_likeliest(diagnosis)} would."
        if diagnosis.unexplained:
            return (
                f"The test differs from the refitted simulation by more than noise ({number(gap.before)} sigma), and "
                "nothing in the library explains it."
            )
        return (
            "The simulation, with its parameters free within their tolerance, already fits the test to its noise "
            f"({number(gap.before)} sigma)."
        )
    size = f"{number(gap.before)} sigma" if gap.shrinkage is not None else "hardly more than noise"
    effects = joined(_sentence(name) for name in leading.effects)
    said = (
        f"The test differs from the refitted simulation by {size}: {effects} (probability {share(leading.probability)})"
    )
    return said + (", but that is not all." if diagnosis.unexplained else ".")


def _likeliest(diagnosis: Diagnosis) -> str:
    return max(diagnosis.strangers, key=lambda one: one.log_odds).name


def place(diagnosis: Diagnosis) -> str:
    """Where most of the gap lies."""
    top = diagnosis.where[0]
    return (
        f"Most of it lies in the {top.quantity} of sweep {top.sweep} between {number(top.frequency_low, 4)} and "
        f"{number(top.frequency_high, 4)} Hz ({percent(100.0 * top.share)} % of the squared residual)."
    )


def doubts(diagnosis: Diagnosis) -> list[str]:
    """What cannot be told apart."""
    return [
        f"This record cannot tell {joined(group.effects)} apart: their best-fitting predictions differ by "
        f"{number(group.distance, 2)} sigma in all."
        for group in diagnosis.groups
    ]


def outside(diagnosis: Diagnosis) -> list[str]:
    """Causes that the library does not name and that are more probable than the leading explanation."""
    likelier = [one for one in diagnosis.strangers if one.log_odds > 0.0]
    return [
        f"More probable than anything the library names: {one.name} (log odds {number(one.log_odds, 2)}). The leading "
        "explanation may only imitate it."
        for one in likelier
    ]


def reach(diagnosis: Diagnosis) -> str:
    """How far the gap shrinks where it did not choose the explanation."""
    held = diagnosis.held_out
    if held is None:
        return "Nothing could be held out: the record has one force level."
    if held.shrinkage is None or held.low is None or held.high is None:
        return (
            f"Held out ({held.scheme}), the refitted simulation predicts to {number(held.before)} sigma: there is "
            "nothing to shrink."
        )
    return (
        f"{percent(100.0 * held.shrinkage)} % of the gap ({percent(100.0 * held.low)} to "
        f"{percent(100.0 * held.high)} %) vanishes on data that neither chose nor fitted the explanation "
        f"({held.scheme}): {number(held.before)} sigma before, {number(held.after)} after."
    )


def following(diagnosis: Diagnosis) -> str:
    """What to test next."""
    if diagnosis.next_test is None:
        return "No further test is needed to choose between explanations."
    test = diagnosis.next_test
    return (
        f"Next, measure {test.what}: {test.why} (expected log odds {number(test.expected_log_odds, 2)} for the leading "
        "explanation against its rivals)."
    )


def trends(diagnosis: Diagnosis) -> list[str]:
    """How local damping and frequency go with amplitude."""
    found = []
    for what, one in (("Damping", diagnosis.damping_trend), ("Natural frequency", diagnosis.frequency_trend)):
        if one is not None and one.gain > TREND_SEEN:
            kind = "grows" if one.change > 0.0 else "falls"
            found.append(
                f"{what} {kind} with amplitude: of single powers A^{one.power:g} fits best beside a constant "
                f"(chi-square {number(one.gain)} over none)."
            )
        elif one is not None:
            found.append(f"{what} does not depend on amplitude beyond noise.")
    return found


#: Chi-square (2 degrees of freedom: power and size) above which a trend is spoken of: one in a thousand by chance.
TREND_SEEN = 13.8


def _sentence(name: str) -> str:
    return f"{CATALOGUE[name].sentence} ({name})" if name in CATALOGUE else name
