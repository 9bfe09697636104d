"""How cost grows with points, rows, laws, levels, terms and draws: exponents b of processor
time ~ size^b, at the larger sizes.

Run ``python -m benchmarks cost``. For terms the size is the number of subsets, 2^terms - 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks._rows import middle, timed
from benchmarks._structures import CANDIDATES, simulated_levels, structures
from damping.extrapolation.plan import plan_loads
from damping.infer.balanced import Balanced
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.infer.proposal import Proposal
from damping.ranking import rank_laws
from damping.ranking.candidates import candidate_laws
from damping.regression.design import design_of_arrays
from damping.regression.subsets import all_subsets
from damping_validation.truths import peaks

LAW = Law(("viscous", "displacement-velocity"))
REPEATS = 3
LEAST_S = 0.05


@dataclass(frozen=True)
class Growth:
    """Processor times (sizes,) of ``work`` against ``sizes`` of what is called ``against``."""

    work: str
    against: str
    sizes: np.ndarray
    seconds: np.ndarray

    @property
    def exponent(self) -> float:
        """Slope of ln time against ln size over the upper half of the sizes."""
        half = len(self.sizes) // 2
        return float(np.polyfit(np.log(self.sizes[half:]), np.log(self.seconds[half:]), 1)[0])


def growth(work: str, against: str, sizes: list[int], make: Callable[[int], Callable[[], object]]) -> Growth:
    """Time ``make(size)()`` for each size: median of three, each repeated until it can be timed."""
    times = []
    for size in sizes:
        call = make(size)
        once = timed(call).processor
        repeats = int(np.clip(LEAST_S / max(once, 1e-9), 1, 1000))
        times.append(middle([timed(call, repeats) for _ in range(REPEATS if once < 0.3 else 1)]).processor)
    return Growth(work, against, np.array(sizes), np.array(times))


def points(rows: int) -> Callable[[], object]:
    """The work of a posterior density of 256 parameter points on ``rows`` rows."""
    A = np.geomspace(0.5, 2.0, rows)
    data = peaks(A**1.5, A)
    coordinates = replace(Coordinates.of(LAW, data), with_discrepancy=False)
    x = np.random.default_rng(0).standard_normal((256, coordinates.dimension))
    return partial(Balanced(coordinates, data).log_density, x)


def levels(number: int) -> Callable[[], object]:
    """The work of weighing eight laws for a band, from ``number`` levels."""
    data = simulated_levels(structures()[1], number, 4.0, 0.01, np.random.default_rng(number))
    return partial(plan_loads, data, CANDIDATES)


def terms(k: int) -> Callable[[], object]:
    """The work of all subsets of ``k`` terms on 200 rows, with statistics."""
    rng = np.random.default_rng(k)
    design = design_of_arrays(rng.normal(size=(200, k)), rng.normal(size=200))

    def work() -> object:
        models = all_subsets(design)
        return models.t_ratios, models.criteria

    return work


def ranked_rows(number: int) -> Callable[[], object]:
    """The work of ranking eight laws on one sweep of ``number`` rows."""
    return partial(rank_laws, sweep_of(number), laws=CANDIDATES[:8], hold_out=False)


def sweep_of(number: int) -> Observations:
    """One sweep through a resonance of a law of two terms, read to one per cent."""
    rng = np.random.default_rng(number)
    A = 1.0 - 0.5 * np.abs(np.linspace(-1.0, 1.0, number))
    D = (0.5 * A + 0.5 * A**2) * np.exp(0.01 * rng.standard_normal(number))
    one, zero = np.ones(1), np.zeros(number)
    return Observations(
        A=A,
        omega=np.ones(number),
        D=D,
        R=np.sqrt(np.maximum(A**2 - D**2, 0.0)),
        sweep=np.zeros(number, dtype=np.int64),
        sd_amplitude=zero,
        sd_force=zero,
        sd_phase=zero,
        sweeps=("up",),
        tested_force=one,
        tested_amplitude=one,
        tested_omega=one,
    )


def ranked_laws(number: int) -> Callable[[], object]:
    """The work of ranking ``number`` laws on five levels."""
    data = simulated_levels(structures()[1], 5, 4.0, 0.01, np.random.default_rng(5))
    return partial(rank_laws, data, laws=candidate_laws()[:number], hold_out=False)


def draws(number: int) -> Callable[[], object]:
    """The work of ``number`` importance draws and their density under the proposal, four variables."""
    rng = np.random.RandomState(0)
    proposal = Proposal.through(rng.standard_normal((4096, 4)), worth=4096.0)
    return lambda: proposal.log_density(proposal.draw_random(number, rng))


def measure() -> list[Growth]:
    """All six."""
    subsets = growth("all subsets with statistics", "terms", list(range(6, 14)), terms)
    return [
        growth("posterior density of 256 points", "points", [10 * 4**i for i in range(6)], points),
        growth("eight laws ranked", "rows of a sweep", [10 * 4**i for i in range(5)], ranked_rows),
        growth("laws ranked on five levels", "laws", [4, 8, 16, 32, 64], ranked_laws),
        growth("laws weighed for a band", "levels", [3, 4, 6, 8, 12], levels),
        Growth(subsets.work, "subsets, 2^terms - 1", 2**subsets.sizes - 1, subsets.seconds),
        growth("draws of a proposal with their density", "draws", [256 * 4**i for i in range(5)], draws),
    ]
