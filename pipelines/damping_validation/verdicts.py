"""One answer of the diagnosis beside the label of its case: what was said, what was so."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

from damping.errors import InputError

_CLOSE = 1e-6  # of a frequency: rounding in an answer


@dataclass(frozen=True)
class Verdict:
    """A case and its answer.

    ``said`` is the leading explanation (None where the diagnosis failed), ``probability`` its probability, ``listed``
    the explanations that reach 0.95. ``held_out`` is the held-out shrinkage, ``iou`` the overlap of the footprint with
    the cells truly altered, both None where there is none. ``apart`` is the root sum of squares, in sigma, by which
    the nearest other effect of the library misses the noise-free record.
    """

    name: str
    family: str
    kind: str
    field: bool
    gap: float
    rows: int
    true: frozenset[str]
    said: frozenset[str] | None
    probability: float
    unexplained: bool
    listed: tuple[frozenset[str], ...]
    equivalents: tuple[frozenset[str], ...]
    held_out: float | None
    iou: float | None
    left_by_nearest: float | None
    apart: float | None
    cpu_seconds: float | None

    @property
    def right(self) -> bool:
        """The leading explanation is the true one, name by name."""
        return self.said == self.true

    @property
    def right_or_equivalent(self) -> bool:
        """Right, or wrong only by effects that the answer says this record cannot tell from the true ones."""
        if self.said is None or len(self.said) != len(self.true):
            return False
        missed, added = sorted(self.true - self.said), sorted(self.said - self.true)
        return any(
            all(any({a, b} <= group for group in self.equivalents) for a, b in zip(missed, order, strict=True))
            for order in permutations(added)
        )

    @property
    def accused(self) -> bool:
        """The answer blames something, named or not."""
        return bool(self.said) or self.unexplained


def read_verdicts(labels: Mapping[str, Any], answers: Path) -> list[Verdict]:
    """The verdicts of all labelled cases; a missing answer counts as a failed one.

    Raises:
        InputError: an answer that is neither ``gap/1`` nor an error.
    """
    return [verdict(name, label, _answer(answers / f"{name}.json")) for name, label in labels["cases"].items()]


def _answer(path: Path) -> Mapping[str, Any]:
    if not path.exists():
        return {"error": "no answer"}
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"not JSON: {error}", file=path, expected="gap/1") from None
    if not isinstance(answer, dict) or ("error" not in answer and answer.get("format") != "gap/1"):
        raise InputError("not an answer", file=path, expected="gap/1")
    return answer


def verdict(name: str, label: Mapping[str, Any], answer: Mapping[str, Any]) -> Verdict:
    """The label and the answer (``gap/1``, or ``{"format", "error"}``) of one case."""
    failed = "error" in answer
    explanations = [] if failed else answer["explanations"]
    nearest = label.get("nearest")
    cells = label["rows"] * (2 if label["phase"] else 1)
    return Verdict(
        name=name,
        family=label["family"],
        kind=label["kind"],
        field=label["conditions"] == "field",
        gap=label["gap"],
        rows=label["rows"],
        true=frozenset(label["effects"]),
        said=None if failed else frozenset(answer["effects"]),
        probability=float(explanations[0]["probability"]) if explanations else 0.0,
        unexplained=bool(answer.get("unexplained", False)),
        listed=tuple(frozenset(explanation["effects"]) for explanation in explanations),
        equivalents=tuple(frozenset(group) for group in answer.get("equivalents", ())),
        held_out=((answer.get("gap") or {}).get("held_out") or {}).get("shrinkage"),
        iou=None if failed else footprint_overlap(label, answer["footprint"]),
        left_by_nearest=nearest["left"] if nearest else None,
        apart=nearest["left"] * cells**0.5 if nearest else None,
        cpu_seconds=answer.get("cpu_seconds"),
    )


def footprint_overlap(label: Mapping[str, Any], footprint: list[Mapping[str, Any]]) -> float | None:
    """Cells in both over cells in either (a cell is a row and a quantity); None where both are empty."""
    altered = {(row, quantity) for quantity, rows in label["altered"].items() for row in rows}
    places = list(enumerate(zip(label["sweep"], label["frequency"], strict=True)))
    said = {
        (row, cell["quantity"])
        for cell in footprint
        for row, (sweep, frequency) in places
        if str(cell["sweep"]) == sweep
        and cell["frequency_low"] * (1 - _CLOSE) <= frequency <= cell["frequency_high"] * (1 + _CLOSE)
    }
    either = len(altered | said)
    return len(altered & said) / either if either else None
