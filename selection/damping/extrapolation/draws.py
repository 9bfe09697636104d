"""Draws of what the next test would read at any force: law, straying of its exponent, noise; pooled over laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from damping.arrays import BoolArray, FloatArray, IntArray
from damping.forces.contract import Sum
from damping.infer.doubt import JOINTS, extend, stray
from damping.infer.law import Coordinates
from damping.infer.likelihood import by_sweep, residuals, scatter_covariance
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude

#: Draws of the average over models: the 5 % and 95 % points are then known to 1 % of the band's width.
AVERAGE_DRAWS = 20_000
#: Draws of a law of little weight, at least: its own band is then known to 5 % of its width.
FEWEST_DRAWS = 1000
#: Points from the largest tested force to the largest one asked for, at which slopes are held to what damping can do.
_POINTS = 7


@dataclass(frozen=True)
class Member:
    """A law that takes part: its weight and posterior draws x, (draws, dimension).

    ``cautions``: what to know of the draws.
    """

    name: str
    weight: float
    coordinates: Coordinates
    draws: FloatArray
    cautions: tuple[str, ...] = ()

    def thin(self) -> Member:
        """Every k-th draw, so many as its share in ``AVERAGE_DRAWS`` asks for."""
        wanted = max(FEWEST_DRAWS, int(AVERAGE_DRAWS * self.weight))
        return replace(self, draws=self.draws[:: max(1, len(self.draws) // wanted)])


@dataclass(frozen=True)
class Spread:
    """Draws in ln A, (draws, forces): the law's amplitude as the levels correct it, its straying, the noise.

    ``resonates``: whether the law itself reaches the force at any amplitude.
    """

    law: FloatArray
    stray: FloatArray
    noise: FloatArray
    resonates: BoolArray

    @property
    def total(self) -> FloatArray:
        """ln A of the next test."""
        return self.law + self.stray + self.noise

    def at(self, columns: IntArray | slice) -> Spread:
        """The same at some of the forces."""
        return Spread(*(getattr(self, part.name)[:, columns] for part in fields(self)))


def pool(
    spreads: Sequence[Spread], weights: FloatArray, rng: np.random.Generator, odds: Sequence[FloatArray] | None = None
) -> Spread:
    """Draws of the average over models, ``AVERAGE_DRAWS`` by ``weights``; of each law's own by ``odds`` where given."""
    counts = rng.multinomial(AVERAGE_DRAWS, weights)
    rows = [
        rng.choice(len(s.law), count, p=None if odds is None else odds[i] / odds[i].sum())
        for i, (s, count) in enumerate(zip(spreads, counts, strict=True))
    ]
    return Spread(
        *(
            np.concatenate([getattr(s, part.name)[r] for s, r in zip(spreads, rows, strict=True)])
            for part in fields(Spread)
        )
    )


def draw_spreads(
    members: Sequence[Member],
    force: FloatArray,
    data: Observations,
    repeatability: float,
    seed: int,
    joint: float = JOINTS,
) -> list[Spread]:
    """Draws of every law's parts at ``force`` (forces,)."""
    rng = np.random.default_rng(seed)
    return [draw_spread(member, force, data, repeatability, rng, joint) for member in members]


def draw_spread(
    member: Member,
    force: FloatArray,
    data: Observations,
    repeatability: float,
    rng: np.random.Generator,
    joint: float = JOINTS,
) -> Spread:
    """Draws of one law's parts; NaN where a draw has no resonance. ``joint``: as of `extend`."""
    tested, asked = np.log(data.tested_force), np.log(force)
    z = np.unique(np.concatenate([asked, np.linspace(tested.max(), max(asked.max(), tested.max()), _POINTS)]))
    of_law = np.log(amplitude_draws(member, np.exp(z), data))
    row, level = member.coordinates.scatter(member.draws)
    if member.coordinates.with_level_scatter:
        level = np.maximum(level, repeatability)
    else:
        row = np.maximum(row, repeatability)
    damping = member.coordinates.force(member.draws)
    left, errors, known = _levels(damping, row, level, data)
    mean, drawn = stray(member.coordinates.doubt(member.draws, damping), left, errors, tested, z, rng)
    beyond = z >= tested.max()
    columns = np.searchsorted(z, asked)

    def at_forces(strays: FloatArray) -> FloatArray:
        log_A = of_law + strays
        log_A[:, beyond] = extend(of_law[:, beyond], strays[:, beyond], z[beyond], joint)
        return log_A[:, columns]

    law = at_forces(mean)
    # one draw for all forces: a band is then smooth, and does not depend on which other forces are asked for
    noise = np.sqrt(row**2 + level**2 + known) * rng.standard_normal(len(row))
    noise = np.broadcast_to(noise[:, None], law.shape)
    return Spread(law, at_forces(drawn) - law, noise, np.isfinite(of_law[:, columns]))


def _levels(
    damping: Sum, row: FloatArray, level: FloatArray, data: Observations
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """ln A of each level less the law's, (draws, sweeps); covariance of its errors, (draws, sweeps, sweeps); mean known
    variance of a row, (draws,)."""
    n, h, known = residuals(damping, data)
    weight = h / (row[:, None] ** 2 + known)
    hh, hn = (by_sweep(weight * value, data) for value in (h, n))
    hh = np.maximum(hh, 1e-6)  # a level whose rows say nothing of its amplitude
    errors = scatter_covariance(row, level, data) + np.eye(hh.shape[1]) / hh[:, None, :]
    # n > 0 where more force was needed than the law's: its amplitude at that force is larger than the measured one
    return -hn / hh, errors, known.mean(axis=1)


def amplitude_draws(member: Member, force: FloatArray, data: Observations) -> FloatArray:
    """Amplitude of each draw at each force, (draws, forces); NaN where a draw has no resonance."""
    damping = member.coordinates.force(member.draws)
    return np.asarray(resonant_amplitude(damping, force[None, :], data.tested_omega[data.top]))
