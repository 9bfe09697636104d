"""Lists of points and counts in words, for captions."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

_SMALL = ("no", "one", "two", "three", "four", "five", "six")


def joined(parts: Iterable[str]) -> str:
    """``a, b and c``; items that hold commas are joined by semicolons."""
    items = list(parts)
    comma = "; " if any("," in item for item in items) else ", "
    if len(items) < 2:
        return "".join(items)
    return comma.join(items[:-1]) + " and " + items[-1]


def points_text(points: Iterable[int]) -> str:
    """``points 1 to 6, 14 and 15``."""
    numbers = sorted(int(p) for p in points)
    if not numbers:
        return "no point"
    cuts = [0, *(i + 1 for i, (a, b) in enumerate(pairwise(numbers)) if b != a + 1), len(numbers)]
    runs = [numbers[a:b] for a, b in pairwise(cuts)]
    parts = [text for run in runs for text in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(n) for n in run])]
    return f"point{'s' * (len(numbers) > 1)} {joined(parts)}"


def counted(n: int, what: str) -> str:
    """``no peak``, ``one peak``, ``two peaks``, ``15 peaks``."""
    return f"{_SMALL[n] if n < len(_SMALL) else n} {what}{'s' * (n > 1)}"
