"""How much each doubt speaks against the library: a regression on answers whose cause is known to be in it, or not.

``python -m damping_validation.doubt`` prints the constants of `damping.gap.weighing`.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from damping.arrays import FloatArray
from damping.effects import CATALOGUE
from damping.gap.diagnose import diagnose
from damping.gap.weighing import describe_doubts
from damping.records.mode import read_mode
from damping.records.reading import read_record
from damping_validation.blind import make_cases

#: Cases and their seed, which is neither that of the blind cases nor that of the tests.
CASES = 130
SEED = 3117
#: Causes of a gap in the library for each that is not: one in five cases of a blind run is of none, two of it are.
ODDS = 1.5
#: Precision of the prior N(0, 1/precision) of each constant but the first: a doubt that no case has weighs nothing.
PRECISION = 0.1

Answer = tuple[FloatArray, bool]


def list_answers(folder: Path) -> Iterator[Answer]:
    """Of every answer what speaks for the library, (5,), and whether it holds the cause."""
    labels = json.loads((folder / "labels.json").read_text(encoding="utf-8"))["cases"]
    for name, label in labels.items():
        case = folder / "cases" / name
        answer = diagnose(read_record(case / "data.csv"), read_mode(case / "model.toml"))
        doubts = describe_doubts(answer.tests, answer.hypotheses)
        yield np.array([1.0, not answer.leading.effects, *-doubts]), set(label["effects"]) <= set(CATALOGUE)


def regress(answers: list[Answer]) -> FloatArray:
    """The log odds (5,) that are most probable: of an effect, of nothing blamed, and what each doubt takes."""
    X, held = np.array([x for x, _ in answers]), np.array([held for _, held in answers])
    blamed = X[:, 1] == 0.0
    weights = np.where(held, 1.0, np.sum(held & blamed) / (ODDS * max(np.sum(~held & blamed), 1)))

    def cost(b: FloatArray) -> float:
        return float(weights @ (np.logaddexp(0.0, X @ b) - held * (X @ b)) + 0.5 * PRECISION * b[1:] @ b[1:])

    return np.asarray(minimize(cost, np.zeros(X.shape[1])).x)


def main() -> None:
    """Print the constants."""
    with tempfile.TemporaryDirectory() as name:
        make_cases(Path(name) / "cases", Path(name) / "labels.json", CASES, SEED)
        log_odds = regress(list(list_answers(Path(name))))
    names = ("IN_LIBRARY", "NOTHING_BLAMED", "PER_DECADE", "PER_MAKESHIFT", "PER_END")
    for constant, value in zip(names, log_odds, strict=True):
        print(f"{constant} = {value:.2f}")


if __name__ == "__main__":
    main()
