"""A check of accuracy in a few minutes: coverage of the bands, and a small blind diagnosis, against lower limits.

``python -m damping_validation.guard``; with ``doubts`` it prints the constants of `damping.gap.weighing` instead: the
weight of each doubt, by regression on answers whose cause is known to be inside or outside the library.

The seeds are fixed, so that a change of the answers is a change of the code. A limit is three standard errors below
the value measured when it was set, so that redrawn noise does not cross it but a loss of accuracy does.
"""

import json
import sys
import tempfile
from collections.abc import Iterator
from itertools import repeat
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from damping.arrays import FloatArray
from damping.effects import CATALOGUE
from damping.gap.diagnose import explain
from damping.records.mode import read_mode
from damping.records.reading import read_record
from damping_pipelines import start_pool
from damping_validation.blind import make_cases, read_sealed
from damping_validation.calibration import RATIOS, coverage_trial
from damping_validation.scorer import Figure, Goal, measure_share
from damping_validation.truths import TRUTHS

#: Trials of each truth, and their seed.
TRIALS = 8
SEED = 20261
#: Blind cases, and their seed.
CASES = 24
BLIND_SEED = 20262
JOBS = 2  #: processes: two, as every machine has that runs the tests


def guard_coverage() -> Iterator[Figure]:
    """Share of next tests within the 90 % band, and above it, at each of ``RATIOS``."""
    names, seeds = zip(
        *((name, SEED + 1000 * kind + i) for kind, name in enumerate(TRUTHS) for i in range(TRIALS)), strict=True
    )
    with start_pool(JOBS) as pool:
        trials = list(pool.map(coverage_trial, names, repeat("fast"), seeds, chunksize=TRIALS))
    for at, ratio in enumerate(RATIOS):
        predicted = [trial for trial in trials if not trial.refused[at]]
        above, below = (float(np.mean([getattr(t, side)[at] for t in predicted])) for side in ("above", "below"))
        at_force = f"the band at {ratio:g} times the tested force"
        yield Figure(f"within {at_force}", Goal(low=LEAST_WITHIN), 1.0 - above - below)
        yield Figure(f"above {at_force}", Goal(high=MOST_ABOVE), above)


def guard_diagnosis() -> Iterator[Figure]:
    """Shares of blind cases with a good, and with a confidently wrong, answer."""
    from damping_pipelines.gap import diagnose_folder  # noqa: PLC0415 - not even loaded before the labels are sealed

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        sealed = make_cases(out / "cases", out / "labels.json", CASES, BLIND_SEED, jobs=JOBS)
        diagnose_folder(out / "cases", out / "answers", JOBS)
        verdicts = read_sealed(out / "labels.json", out / "answers", sealed)
    yield measure_share("blind cases with a good answer", verdicts, lambda v: v.good, Goal(low=LEAST_GOOD))
    wrong = Goal(high=MOST_WRONG)
    yield measure_share("blind cases confidently wrong", verdicts, lambda v: v.confidently_wrong, wrong)


#: Floors and ceilings; see the head of the module.
LEAST_WITHIN = 0.86
MOST_ABOVE = 0.12
LEAST_GOOD = 0.65
MOST_WRONG = 0.05

#: Cases and their seed, which is neither that of the blind cases nor that of the tests.
DOUBT_CASES = 130
DOUBT_SEED = 3117
#: Causes of a gap in the library for each that is not: one in five cases of a blind run is of none, two of it are.
ODDS = 1.5
#: Precision of the prior N(0, 1/precision) of each constant but the first: a doubt that no case has weighs nothing.
PRECISION = 0.1

Answer = tuple[FloatArray, bool]


def list_answers(folder: Path) -> Iterator[Answer]:
    """For every answer the regressors of the library, (6,), and whether it holds the cause."""
    labels = json.loads((folder / "labels.json").read_text(encoding="utf-8"))["cases"]
    for name, label in labels.items():
        case = folder / "cases" / name
        answer = explain(read_record(case / "data.csv"), read_mode(case / "model.toml"))
        yield np.array([1.0, not answer.leading.effects, *-answer.doubts]), set(label["effects"]) <= set(CATALOGUE)


def regress(answers: list[Answer]) -> FloatArray:
    """The most probable log odds (6,): for an effect, for nothing blamed, and per doubt."""
    X, held = np.array([x for x, _ in answers]), np.array([held for _, held in answers])
    blamed = X[:, 1] == 0.0
    weights = np.where(held, 1.0, np.sum(held & blamed) / (ODDS * max(np.sum(~held & blamed), 1)))

    def cost(b: FloatArray) -> float:
        return float(weights @ (np.logaddexp(0.0, X @ b) - held * (X @ b)) + 0.5 * PRECISION * b[1:] @ b[1:])

    return np.asarray(minimize(cost, np.zeros(X.shape[1])).x)


def print_doubts() -> None:
    """Print the constants of the doubts."""
    with tempfile.TemporaryDirectory() as name:
        make_cases(Path(name) / "cases", Path(name) / "labels.json", DOUBT_CASES, DOUBT_SEED)
        log_odds = regress(list(list_answers(Path(name))))
    names = ("IN_LIBRARY", "NOTHING_BLAMED", "PER_DECADE", "PER_MAKESHIFT", "PER_END", "PER_RIVAL")
    for constant, value in zip(names, log_odds, strict=True):
        print(f"{constant} = {value:.2f}")


def main() -> int:
    """Print the measured values; exit code 1 if one is beyond its limit."""
    if sys.argv[1:] == ["doubts"]:
        print_doubts()
        return 0
    guarded = [*guard_coverage(), *guard_diagnosis()]
    for share in guarded:
        limit = f"at most {share.goal.high:.3f}" if share.goal.low is None else f"at least {share.goal.low:.3f}"
        print(f"{'held' if share.met else 'LOST'}  {share.name}: {share.measured:.3f} ({limit})")
    return 0 if all(share.met for share in guarded) else 1


if __name__ == "__main__":
    sys.exit(main())
