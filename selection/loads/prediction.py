"""Resonant amplitude at design forces beyond the test, as credible and predictive distributions.

For a law the amplitude at phase resonance solves C(A, omega) = F. Posterior draws of its parameters give the credible
band (of the law's own amplitude); the scatter that tests show about a law, added to each draw, gives the predictive
band (of the amplitude the next test would read). Models are averaged by drawing from each in proportion to its weight.
The frequency is that of the resonance at the largest tested force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray
from selection.posterior.law import Coordinates
from selection.posterior.observations import Observations
from selection.response.ritz import resonant_amplitude

#: Draws of the average over models: the 5 % and 95 % points are then known to 1 % of the band's width.
AVERAGE_DRAWS = 20_000
#: Share of draws without a resonance above which no prediction is given.
REFUSED_SHARE = 0.05


@dataclass(frozen=True)
class Member:
    """A law that takes part: its weight and posterior draws x, (draws, dimension)."""

    name: str
    weight: float
    coordinates: Coordinates
    draws: FloatArray


@dataclass(frozen=True)
class Band:
    """Median and central interval over forces, arrays (forces,); NaN where no prediction exists.

    ``low`` and ``high`` are predictive, ``credible_low`` and ``credible_high`` those of the law's own amplitude.
    """

    name: str
    weight: float
    median: FloatArray
    low: FloatArray
    high: FloatArray
    credible_low: FloatArray
    credible_high: FloatArray


@dataclass(frozen=True)
class Loads:
    """Predictions over forces, arrays (forces,).

    Attributes:
        level: content of the intervals. average: over models by weight. by_model: each law's own.
        linear: amplitude by the viscous coefficient of the sweep with the largest tested force.
        overprediction, overprediction_low, overprediction_high: 100 (linear/A - 1) of the median and of the predictive
            interval's ends. ratio: force over the largest tested force. cautions: one tuple a force.
    """

    force: FloatArray
    level: float
    average: Band
    by_model: tuple[Band, ...]
    linear: FloatArray
    overprediction: FloatArray
    overprediction_low: FloatArray
    overprediction_high: FloatArray
    ratio: FloatArray
    cautions: tuple[tuple[str, ...], ...]


def linear_amplitude(force: FloatArray, data: Observations) -> FloatArray:
    """A = F/(c omega) with c of the sweep with the largest tested force (Eq. 4.1.7): proportional to the force."""
    return data.tested_amplitude[data.top] * force / data.tested_force[data.top]


def amplitude_draws(member: Member, force: FloatArray, data: Observations) -> FloatArray:
    """Amplitude of each draw at each force, (draws, forces); NaN where a draw has no resonance."""
    damping = member.coordinates.force(member.draws)
    return np.asarray(resonant_amplitude(damping, force[None, :], data.tested_omega[data.top]))


def predict(members: Sequence[Member], force: FloatArray, data: Observations, level: float, seed: int) -> Loads:
    """Predict resonant amplitudes at ``force`` (forces,), averaged over ``members`` by weight."""
    rng = np.random.default_rng(seed)
    credible = [amplitude_draws(member, force, data) for member in members]
    predictive = [
        draws * np.exp(_scatter(member)[:, None] * rng.standard_normal(draws.shape))
        for member, draws in zip(members, credible, strict=True)
    ]
    bands = [
        _band(member.name, member.weight, c, p, level)
        for member, c, p in zip(members, credible, predictive, strict=True)
    ]
    weights = np.array([member.weight for member in members]) / sum(member.weight for member in members)
    counts = rng.multinomial(AVERAGE_DRAWS, weights)
    chosen = [rng.integers(len(draws), size=count) for draws, count in zip(credible, counts, strict=True)]
    pooled_credible = np.concatenate([draws[rows] for draws, rows in zip(credible, chosen, strict=True)])
    pooled_predictive = np.concatenate([draws[rows] for draws, rows in zip(predictive, chosen, strict=True)])
    average = _band("average over models", 1.0, pooled_credible, pooled_predictive, level)
    linear = np.where(np.isfinite(average.median), linear_amplitude(force, data), np.nan)
    ratio = force / data.tested_force[data.top]
    return Loads(
        force=force,
        level=level,
        average=average,
        by_model=tuple(bands),
        linear=linear,
        overprediction=100.0 * (linear / average.median - 1.0),
        overprediction_low=100.0 * (linear / average.high - 1.0),
        overprediction_high=100.0 * (linear / average.low - 1.0),
        ratio=ratio,
        cautions=tuple(_cautions(r, m, members, data) for r, m in zip(ratio, average.median, strict=True)),
    )


def _scatter(member: Member) -> FloatArray:
    """Relative scatter of a level's measured resonance for each draw, (draws,)."""
    row, level = member.coordinates.scatter(member.draws)
    return np.hypot(row, level)


def _band(name: str, weight: float, credible: FloatArray, predictive: FloatArray, level: float) -> Band:
    """Quantiles over draws (draws, forces); NaN at forces where too many draws have no resonance."""
    refused = np.mean(~np.isfinite(credible), axis=0) > REFUSED_SHARE
    tail = 50.0 * (1.0 - level)

    def quantiles(draws: FloatArray, q: list[float]) -> FloatArray:
        filled = np.where(refused, 0.0, draws)
        return np.where(refused, np.nan, np.nanpercentile(filled, q, axis=0))

    low, median, high = quantiles(predictive, [tail, 50.0, 100.0 - tail])
    credible_low, credible_high = quantiles(credible, [tail, 100.0 - tail])
    return Band(name, weight, median, low, high, credible_low, credible_high)


def _cautions(ratio: float, median: float, members: Sequence[Member], data: Observations) -> tuple[str, ...]:
    """What to know before using the prediction at one force, in words."""
    said = []
    levels = len(data.sweeps)
    if not np.isfinite(median):
        said.append("no prediction: the damping force does not reach this force at any amplitude")
    if ratio > 1.0:
        said.append(f"beyond the test: {ratio:.2f} times the largest tested force")
    if levels == 1:
        said.append("one force level: how damping changes with amplitude rests on the candidates, not on data")
    elif levels < 5:
        said.append(f"{_WORDS[levels]} points: p from {levels - 2} degree{'s' * (levels != 3)} of freedom")
    if members and max(member.weight for member in members) < 0.5:
        said.append("no law has more than half of the weight")
    return tuple(said)


_WORDS = {2: "two", 3: "three", 4: "four"}
