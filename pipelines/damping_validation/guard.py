"""A guard of accuracy, in a few minutes: coverage of the bands and the blind diagnosis in small, against floors.

The seeds are fixed, so that a change of the answers is a change of the code. A floor lies three standard errors below
what was measured when it was set, so that redrawn noise does not cross it and a loss of accuracy does.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from damping_pipelines.terminal import end_with_parent
from damping_validation.blind import make_cases, read_sealed
from damping_validation.calibration import RATIOS, Coverage, coverage_trial
from damping_validation.truths import TRUTHS

#: Trials of each truth, and their seed.
TRIALS = 8
SEED = 20261
#: Blind cases, and their seed.
CASES = 24
BLIND_SEED = 20262
#: Processes: two, as every machine has that runs the tests.
JOBS = 2


@dataclass(frozen=True)
class Guarded:
    """A share that was measured and the least, or the most, that is accepted."""

    name: str
    value: float
    limit: float
    least: bool = True

    @property
    def holds(self) -> bool:
        """Whether the limit is kept."""
        return self.value >= self.limit if self.least else self.value <= self.limit

    @property
    def sentence(self) -> str:
        """A line for the log."""
        side = "at least" if self.least else "at most"
        return f"{'held' if self.holds else 'LOST'}  {self.name}: {self.value:.3f} ({side} {self.limit:.3f})"


def guard_coverage() -> Iterator[Guarded]:
    """Share of next tests within the 90 % band, and above it, at each of ``RATIOS``."""
    drawn = [(name, SEED + 1000 * kind + i) for kind, name in enumerate(TRUTHS) for i in range(TRIALS)]
    with ProcessPoolExecutor(JOBS, initializer=end_with_parent) as pool:
        trials = list(pool.map(partial(_try_fast), drawn, chunksize=TRIALS))
    for at, ratio in enumerate(RATIOS):
        told = [trial for trial in trials if not trial.refused[at]]
        above, below = (float(np.mean([getattr(t, side)[at] for t in told])) for side in ("above", "below"))
        yield Guarded(f"within the band at {ratio:g} times the tested force", 1.0 - above - below, LEAST_WITHIN)
        yield Guarded(f"above the band at {ratio:g} times the tested force", above, MOST_ABOVE, least=False)


def _try_fast(drawn: tuple[str, int]) -> Coverage:
    return coverage_trial(drawn[0], "fast", drawn[1])


def guard_diagnosis() -> Iterator[Guarded]:
    """Shares of blind cases of which the answer is good, and confidently wrong."""
    from damping_pipelines.gap import diagnose_folder  # noqa: PLC0415 - not even loaded before the labels are sealed

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        sealed = make_cases(out / "cases", out / "labels.json", CASES, BLIND_SEED, jobs=JOBS)
        diagnose_folder(out / "cases", out / "answers", jobs=JOBS, seed=0)
        verdicts = read_sealed(out / "labels.json", out / "answers", sealed)
    yield Guarded("blind cases with a good answer", float(np.mean([v.good for v in verdicts])), LEAST_GOOD)
    wrong = float(np.mean([v.confidently_wrong for v in verdicts]))
    yield Guarded("blind cases confidently wrong", wrong, MOST_WRONG, least=False)


#: Floors and ceilings; see the head of the module.
LEAST_WITHIN = 0.86
MOST_ABOVE = 0.12
LEAST_GOOD = 0.65
MOST_WRONG = 0.05


def main() -> int:
    """Print what was measured; 1 where a limit is not kept."""
    guarded: Sequence[Guarded] = [*guard_coverage(), *guard_diagnosis()]
    for share in guarded:
        print(share.sentence)
    return 0 if all(share.holds for share in guarded) else 1


if __name__ == "__main__":
    sys.exit(main())
