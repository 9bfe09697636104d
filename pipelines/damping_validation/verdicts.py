"""One answer of the diagnosis beside the label of its case: what it says, what is so.

An answer is good where it is right or honestly short: the true effects lead or stand in the set of 0.95, or the answer
says itself that something is unexplained or that the cause is probably in no library; a null case is good where nothing
is blamed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any, TypeAlias

from damping.errors import InputError

#: Gap, sigma, from which on a diagnosis is asked to see an effect.
DETECTABLE = 1.0
CONFIDENT = 0.95
#: Chance that the cause is in the library at all below which an answer has flagged itself.
DOUBTED = 0.5
_CLOSE = 1e-6  # of a frequency: rounding in an answer


@dataclass(frozen=True)
class Verdict:
    """A case and its answer.

    ``leading``: explanation (None where the diagnosis failed), ``probability`` of it, ``listed`` are the
    explanations that reach 0.95, ``flagged`` whether the answer doubts itself. ``held_out`` is the held-out
    shrinkage, ``iou`` the overlap of the footprint with the cells truly altered, both None where there is none.
    ``of_rig``: nothing but the rig is at fault, or nothing at all; ``accuses``: a part of the structure is blamed.
    """

    name: str
    family: str
    kind: str
    field: bool
    gap: float
    rows: int
    true: frozenset[str]
    leading: frozenset[str] | None
    probability: float
    flagged: bool
    listed: tuple[frozenset[str], ...]
    equivalents: tuple[frozenset[str], ...]
    held_out: float | None
    iou: float | None
    cpu_seconds: float | None
    of_rig: bool
    accuses: bool

    @property
    def right(self) -> bool:
        """The leading explanation is the true one, name by name."""
        return self.leading == self.true

    @property
    def right_or_equivalent(self) -> bool:
        """Right, or wrong only by effects that the answer says this record cannot tell from the true ones."""
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
        """Right or honestly short: see the module."""
        if self.leading is None:
            return False
        if self.family == "null":
            return not self.blames
        if self.gap < DETECTABLE and not self.blames:
            return True
        return self.flagged or self.right_or_equivalent or self.true in self.listed

    @property
    def confidently_wrong(self) -> bool:
        """Wrong at a probability beyond ``CONFIDENT`` without a flag; to see nothing where little is, is not wrong."""
        if self.leading is None or self.flagged or self.right_or_equivalent or self.probability <= CONFIDENT:
            return False
        return bool(self.leading) or self.gap >= DETECTABLE

    @property
    def wrongs_structure(self) -> bool:
        """The structure is blamed, without a flag, for what the rig or nothing did."""
        return self.of_rig and self.accuses and not self.flagged


Cases: TypeAlias = Sequence[Verdict]


def read_sealed(labels: Path, answers: Path, sealed: str) -> list[Verdict]:
    """The verdicts, from labels that are still those whose SHA-256 was recorded before the diagnosis.

    Raises:
        InputError: labels that were changed since, or an answer of another form.
    """
    content = labels.read_bytes()
    if hashlib.sha256(content).hexdigest() != sealed:
        raise InputError("the labels are not those that were sealed", file=labels, expected=f"SHA-256 {sealed}")
    return read_verdicts(json.loads(content), answers)


def read_verdicts(labels: Mapping[str, Any], answers: Path) -> list[Verdict]:
    """The verdicts of all labelled cases; a missing answer counts as a failed one.

    Raises:
        InputError: an answer that is neither ``gap/1`` nor an error.
    """
    rig = frozenset(labels.get("rig", ()))
    return [judge(name, label, read_answer(answers / f"{name}.json"), rig) for name, label in labels["cases"].items()]


def read_answer(path: Path) -> Mapping[str, Any]:
    """The answer of a file; an error where there is none. InputError where it is of another form."""
    if not path.exists():
        return {"error": "no answer"}
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"not JSON: {error}", file=path, expected="gap/1") from None
    if not isinstance(answer, dict) or ("error" not in answer and answer.get("format") != "gap/1"):
        raise InputError("not an answer", file=path, expected="gap/1")
    return answer


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
