"""Processor time of a gap diagnosis, posterior and start-up left out: ``python -m benchmarks gap_cases``.

Cases as ``damping blind`` draws them, of every kind in its share, half of them clean and half in field conditions.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks._rows import Row, Time, timed
from damping_pipelines.gap import diagnose_case
from damping_validation.blind import make_cases

CASES = 24
SEED = 7
GOAL_S = 1.5


def measure() -> list[Row]:
    """Mean over the cases; the first one is done before and not counted, for what is done once in a process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_cases(folder / "cases", folder / "labels.json", CASES, SEED, jobs=1)
        cases = sorted((folder / "cases").iterdir())
        diagnose_case(cases[0])
        times = [timed(lambda case=case: diagnose_case(case)) for case in cases]  # type: ignore[misc]  # bound now
    mean = Time(*(float(np.mean([getattr(t, part) for t in times])) for part in ("processor", "wall")))
    worst = max(t.processor for t in times)
    remark = f"mean of {CASES} cases, next test included; the slowest {worst:.2f} s"
    return [Row("gap diagnosis of a case", mean, at_most=GOAL_S, remark=remark)]
