"""A two-term posterior to 50 000 effective samples: ours, plain emcee, PyMC, nutpie, NumPyro.

Run ``python -m benchmarks posterior``. Each sampler runs in a process of its own (``benchmarks._contender``), which
imports, compiles, samples and judges its effective size. The whole process is timed, and what the samples cost in one
that has started (imported, compiled, warmed up) beside. Peers draw a part, with all of start-up, compilation and
warm-up; the rest of the 50 000 is added at the rate of the second half of that part. Ours draw all, twice: importance
draws, and chains, all walkers moved at once, which run to the library's own criteria of convergence beside.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass

import numpy as np

from benchmarks._rows import Row, Time, run_process

WANTED = 50_000
PLAIN = 20.0
BEST = 5.0
PEERS = {
    "emcee": "emcee, one point at a time",
    "pymc": "PyMC (NUTS)",
    "nutpie": "nutpie (NUTS)",
    "numpyro": "NumPyro (NUTS)",
}
#: Half the draws of a chain of each peer.
PARTS = {"emcee": 1500, "pymc": 1000, "nutpie": 2000, "numpyro": 2000}
#: Largest difference of means and standard deviations in Monte Carlo standard errors: of 24 looked at, one in a
#: thousand runs has one beyond 4; chains that just reach the size know their own error roughly.
SAME = 5.0


@dataclass(frozen=True)
class Run:
    """What a process printed and took."""

    time: Time
    size: float
    rate: float
    how: str
    mean: np.ndarray
    sd: np.ndarray

    @property
    def whole(self) -> Time:
        """Time to ``WANTED``, those that are missing added at the rate; wall time in proportion."""
        return self.time.times(1.0 + max(WANTED - self.size, 0.0) / self.rate / self.time.processor)

    @property
    def started(self) -> Time:
        """Time to ``WANTED`` in a process that has started; wall time in proportion."""
        return self.time.times(max(WANTED, self.size) / self.rate / self.time.processor)


def run(name: str) -> Run:
    """One contender in a process of its own."""
    process = run_process([sys.executable, "-m", "benchmarks._contender", name, str(PARTS.get(name, WANTED))])
    told = json.loads(process.printed.splitlines()[-1])
    time = process.time.times(1.0 - told["beside"] / process.time.processor)
    return Run(time, told["size"], told["rate"], told["how"], np.array(told["mean"]), np.array(told["sd"]))


def difference(a: Run, b: Run) -> float:
    """Of means and standard deviations, in Monte Carlo standard errors."""
    error = a.sd * np.sqrt(1.0 / a.size + 1.0 / b.size)
    # sd: error sd/sqrt(2 n) of a normal posterior; these have heavier tails
    return float(max(np.max(np.abs(a.mean - b.mean) / error), np.max(np.abs(a.sd - b.sd) / error)))


def measure() -> list[Row]:
    """Ours by importance and by chains against each peer, with start-up and without."""
    ours, chains = run("ours"), run("chains")
    peers = {name: run(name) for name in PEERS}
    best = min(peers, key=lambda name: peers[name].whole.processor)
    rows = []
    for own, by in ((ours, "importance draws"), (chains, "chains")):
        work = f"two-term posterior to {WANTED} effective samples, by {by}"
        for name, peer in peers.items():
            goal = max(PLAIN if name == "emcee" else 0.0, BEST if name == best else 0.0) or None
            away = difference(own, peer)
            rows.append(
                Row(
                    work, own.whole, PEERS[name], peer.whole, at_least=goal, right=away < SAME,
                    remark=f"{own.how}; {peer.how}, worth {peer.size:.0f} in {peer.time.processor:.1f} s, the rest at "
                    f"{peer.rate:.0f} a second; means and sds within {away:.1f} standard errors",
                )
            )  # fmt: skip
        rows += [
            Row(
                f"{work}, both started", own.started, PEERS[name], peer.started,
                remark=f"{own.rate:.0f} effective draws a second; {peer.rate:.0f}",
            )
            for name, peer in peers.items()
        ]  # fmt: skip
    return rows
