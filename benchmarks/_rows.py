"""What benchmarks measure: processor and wall time of ours and of a named peer in one run, beside the goal."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from time import perf_counter, process_time


@dataclass(frozen=True)
class Time:
    """Seconds of processors (all threads and child processes together) and on the wall."""

    processor: float
    wall: float

    def times(self, factor: float) -> Time:
        return Time(factor * self.processor, factor * self.wall)


@dataclass(frozen=True)
class Row:
    """A piece of work and what it took.

    ``at_least``: ratio peer/ours wanted. ``at_most``: seconds of processor wanted of ours. ``right``: whether the
    results agree as ``remark`` says.
    """

    work: str
    ours: Time
    peer: str = ""
    theirs: Time | None = None
    at_least: float | None = None
    at_most: float | None = None
    right: bool = True
    remark: str = ""

    @property
    def ratio(self) -> float | None:
        """Processor time of the peer over ours."""
        return self.theirs.processor / self.ours.processor if self.theirs else None

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None where there is none."""
        if self.at_least is None and self.at_most is None:
            return None
        fast = self.at_least is None or (self.ratio is not None and self.ratio >= self.at_least)
        return self.right and fast and (self.at_most is None or self.ours.processor <= self.at_most)

    @property
    def goal(self) -> str:
        """The goal in words."""
        parts = [f"ratio >= {self.at_least:g}"] if self.at_least is not None else []
        return ", ".join(parts + ([f"ours <= {self.at_most:g} s"] if self.at_most is not None else []))


@dataclass(frozen=True)
class Process:
    """What a process took, its children's time included; its largest memory, MB; and what it printed."""

    time: Time
    largest_mb: float
    printed: str


#: Runs a command and says what it took: largest memory counts from the fork on, and this process is small.
_MEASURE = """
import resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.call(sys.argv[1:], stderr=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, time.perf_counter() - start, used.ru_maxrss, file=sys.stderr)
sys.exit(code)
"""


def run_process(command: Sequence[str], changes: Mapping[str, str] = {}) -> Process:
    """Run a command to its end with one thread of linear algebra. RuntimeError if it fails."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **changes}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # nobody compiles everything at every start
    ended = subprocess.run(
        [sys.executable, "-c", _MEASURE, *command], capture_output=True, text=True, env=environment, check=False
    )
    if ended.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {ended.returncode}")
    processor, wall, largest = (float(value) for value in ended.stderr.split()[-3:])
    return Process(Time(processor, wall), largest / (1024.0 if sys.platform == "linux" else 1e6), ended.stdout)


def timed(work: Callable[[], object], repeats: int = 1) -> Time:
    """Time of one run, averaged over ``repeats``; all in this process."""
    processor, wall = process_time(), perf_counter()
    for _ in range(repeats):
        work()
    return Time((process_time() - processor) / repeats, (perf_counter() - wall) / repeats)


def middle(times: Sequence[Time]) -> Time:
    """Median of each."""
    return Time(median(t.processor for t in times), median(t.wall for t in times))


def seconds(value: float) -> str:
    """A time to three digits with a unit that fits."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if value >= size:
            return f"{value / size:#.3g}".rstrip(".") + f" {unit}"
    return f"{value / 1e-9:#.3g} ns"
