"""What to know before using a prediction, in words.

Resonant amplitude at design forces beyond the test, as credible and predictive distributions.

For a law the amplitude at phase resonance solves C(A, omega) = F, at the frequency of the resonance at the largest
tested force. What the next test would read is made of four parts, added in ln A draw by draw:

- parameters: posterior draws of the law's own;
- between-model: which law, by weights from held-out levels;
- level-to-level: a test does not repeat itself from level to level (scatter of the likelihood), and no law holds
  beyond its data (kappa, growing with the distance from the test: :mod:`damping.extrapolation.near`);
- measurement noise: scatter of a reading, and the uncertainties that the record states.

With one row a level, noise and scatter from level to level cannot be told apart; both are then in the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damping.arrays import FloatArray
from damping.extrapolation import near as discrepancy
from damping.extrapolation.plan import Plan
from damping.infer.law import Coordinates, by_blocks, residuals
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude
from damping.ranking.weights import ENOUGH
from damping.records.resonance import number_levels

_WORDS = {2: "two", 3: "three", 4: "four"}


def cautions(
    force: float, predicted: bool, data: Observations, weights: Sequence[float], plan: Plan | None
) -> tuple[str, ...]:
    """Cautions on the prediction at one force, the gravest first.

    Args:
        predicted: whether there is one. weights: of the laws that take part.
    """
    largest = data.tested_force[data.top]
    said = _of_plan(force, plan) if plan else []
    if not predicted and not (plan and force > plan.limit):
        said.append("no prediction: the damping force does not reach this force at any amplitude")
    if force > largest:
        said.append(f"beyond the test: {force / largest:.2f} times the largest tested force")
    return tuple(said + _of_test(force, data) + _of_weights(weights, plan))


def _of_plan(force: float, plan: Plan) -> list[str]:
    """What the trend of p says, and how far the resonance moved."""
    return [*_of_trend(force, plan), *([plan.bistable] if plan.bistable else [])]


def _of_trend(force: float, plan: Plan) -> list[str]:
    p, change = plan.trend, plan.change
    if change:
        foreseen = f"the laws of the lower levels gave the highest one a probability of {100.0 * change.foreseen:.0f} %"
        if force > change.limit:
            return [f"no prediction beyond {change.limit:.4g}: p is rising ({p.words}), and {foreseen}"]
        return [f"p is rising ({p.words}), and {foreseen}: no prediction beyond {change.limit:.4g}"]
    if p.falling:
        return [f"p is falling at the top of the test ({p.words}): amplitudes may grow faster than any law here says"]
    return [f"p is rising with level ({p.words}), as the laws here foresee"] if p.rising else []


def _of_test(force: float, data: Observations) -> list[str]:
    """What the tested levels cannot say."""
    said = []
    levels = int(number_levels(data.tested_force).max()) + 1
    if levels == 1:
        said.append("one force level: how damping changes with amplitude rests on the candidates, not on data")
    elif levels < 5:
        said.append(f"{_WORDS[levels]} points: p from {levels - 2} degree{'s' * (levels != 3)} of freedom")
    span = data.tested_force.max() / data.tested_force.min()
    if levels > 1 and force / data.tested_force.max() > span:
        said.append(f"farther beyond the test than the test is wide (largest over smallest tested force {span:.2f})")
    return said


def _of_weights(weights: Sequence[float], plan: Plan | None) -> list[str]:
    """How well the laws are told apart."""
    said = []
    if weights and max(weights) < 0.5 * sum(weights):
        said.append("no law has more than half of the weight")
    if plan and plan.held_out < ENOUGH and len(plan.laws) > 1:
        levels = f"{plan.held_out} level{'s' * (plan.held_out != 1)} held out"
        said.append(f"{levels}: weights drawn towards equal ones over {len(plan.laws)} plausible laws")
    return said


#: Draws of the average over models: the 5 % and 95 % points are then known to 1 % of the band's width.
AVERAGE_DRAWS = 20_000
#: Share of draws without a resonance above which no prediction is given.
REFUSED_SHARE = 0.05
#: Names of the parts of a predictive distribution.
PARTS = ("measurement_noise", "parameters", "between_model", "level_to_level")


@dataclass(frozen=True)
class Member:
    """A law that takes part: its weight and posterior draws x, (draws, dimension).

    ``kappa``: posterior probability of each of ``discrepancy.KAPPA``; the prior where None. ``cautions``: what to know
    of the draws.
    """

    name: str
    weight: float
    coordinates: Coordinates
    draws: FloatArray
    kappa: FloatArray | None = None
    cautions: tuple[str, ...] = ()


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
        parts: standard deviation of each of ``PARTS``, per cent of amplitude; their squares add to that of the whole.
        linear: amplitude by the viscous coefficient of the sweep with the largest tested force.
        overprediction, overprediction_low, overprediction_high: 100 (linear/A - 1) of the median and of the predictive
            interval's ends. ratio: force over the largest tested force. cautions: one tuple a force.
        limit: force beyond which predictions are refused because the law is changing; infinite where it is not.
    """

    force: FloatArray
    level: float
    average: Band
    by_model: tuple[Band, ...]
    parts: dict[str, FloatArray]
    linear: FloatArray
    overprediction: FloatArray
    overprediction_low: FloatArray
    overprediction_high: FloatArray
    ratio: FloatArray
    cautions: tuple[tuple[str, ...], ...]
    limit: float = np.inf


def linear_amplitude(force: FloatArray, data: Observations) -> FloatArray:
    """A = F/(c omega) with c of the sweep with the largest tested force (Eq. 4.1.7): proportional to the force."""
    return data.tested_amplitude[data.top] * force / data.tested_force[data.top]


def amplitude_draws(member: Member, force: FloatArray, data: Observations) -> FloatArray:
    """Amplitude of each draw at each force, (draws, forces); NaN where a draw has no resonance."""
    damping = member.coordinates.force(member.draws)
    return np.asarray(resonant_amplitude(damping, force[None, :], data.tested_omega[data.top]))


def predict(
    members: Sequence[Member],
    force: FloatArray,
    data: Observations,
    level: float,
    seed: int,
    plan: Plan | None = None,
    repeatability: float = 0.0,
) -> Loads:
    """Predict resonant amplitudes at ``force`` (forces,), averaged over ``members`` by weight.

    Args:
        data: of the tested levels. plan: where given, its limit is kept and its findings are among the cautions.
        repeatability: stated relative standard uncertainty of a level's amplitude; scatter is taken as no less.
    """
    rng = np.random.default_rng(seed)
    spreads = [_spread(member, force, data, repeatability, rng) for member in members]
    allowed = force <= (plan.limit if plan else np.inf)
    bands = [_band(m.name, m.weight, s, allowed, level) for m, s in zip(members, spreads, strict=True)]
    weights = np.array([member.weight for member in members]) / sum(member.weight for member in members)
    counts = rng.multinomial(AVERAGE_DRAWS, weights)
    rows = [rng.integers(len(s.law), size=count) for s, count in zip(spreads, counts, strict=True)]
    pooled = _Spread(
        *(np.concatenate([getattr(s, part)[r] for s, r in zip(spreads, rows, strict=True)]) for part in _DRAWN)
    )
    average = _band("average over models", 1.0, pooled, allowed, level)
    predicted = np.isfinite(average.median)
    linear = np.where(predicted, linear_amplitude(force, data), np.nan)
    ratio = force / data.tested_force[data.top]
    of_draws = tuple(dict.fromkeys(caution for member in members for caution in member.cautions))
    return Loads(
        force=force,
        level=level,
        average=average,
        by_model=tuple(bands),
        parts={name: np.where(predicted, part, np.nan) for name, part in _parts(spreads, weights).items()},
        linear=linear,
        overprediction=100.0 * (linear / average.median - 1.0),
        overprediction_low=100.0 * (linear / average.high - 1.0),
        overprediction_high=100.0 * (linear / average.low - 1.0),
        ratio=ratio,
        cautions=tuple(
            cautions(f, bool(p), data, [m.weight for m in members], plan) + of_draws
            for f, p in zip(force, predicted, strict=True)
        ),
        limit=plan.limit if plan else np.inf,
    )


_DRAWN = ("law", "level", "noise")


@dataclass(frozen=True)
class _Spread:
    """Draws in ln A, (draws, forces): of the law's amplitude, of the level's departure from it, of the noise."""

    law: FloatArray
    level: FloatArray
    noise: FloatArray


def _spread(
    member: Member, force: FloatArray, data: Observations, repeatability: float, rng: np.random.Generator
) -> _Spread:
    """Draws of one law's parts; NaN where a draw has no resonance."""
    amplitude = np.log(amplitude_draws(member, force, data))
    row, level = member.coordinates.scatter(member.draws)
    if member.coordinates.with_level_scatter:
        level = np.maximum(level, repeatability)
    else:
        row = np.maximum(row, repeatability)
    known = by_blocks(
        lambda x: np.mean(residuals(member.coordinates.force(x), data)[2], axis=1), member.draws, len(data.A)
    )
    kappa = discrepancy.draw(discrepancy.prior() if member.kappa is None else member.kappa, len(row), rng)
    beyond = kappa[:, None] * discrepancy.distance(force, data.tested_force)
    sd_level, sd_noise = np.hypot(level[:, None], beyond), np.sqrt(row**2 + known)[:, None]
    # one draw for all forces: a band is then smooth, and does not depend on which other forces are asked for
    normal = rng.standard_normal((2, len(row), 1))
    return _Spread(amplitude, sd_level * normal[0], sd_noise * normal[1])


def _parts(spreads: Sequence[_Spread], weights: FloatArray) -> dict[str, FloatArray]:
    """Standard deviations in per cent by the law of total variance, each (forces,)."""
    laws = [np.where(np.isfinite(s.law).any(axis=0), s.law, 0.0) for s in spreads]  # no draw at all: no prediction
    mean = np.array([np.nanmean(law, axis=0) for law in laws])
    within = np.array([np.nanvar(law, axis=0) for law in laws])
    variances = {
        "measurement_noise": weights @ np.array([np.mean(s.noise**2, axis=0) for s in spreads]),
        "parameters": weights @ within,
        "between_model": weights @ (mean - weights @ mean) ** 2,
        "level_to_level": weights @ np.array([np.mean(s.level**2, axis=0) for s in spreads]),
    }
    return {name: 100.0 * np.sqrt(variance) for name, variance in variances.items()}


def _band(name: str, weight: float, spread: _Spread, allowed: np.ndarray, level: float) -> Band:
    """Quantiles over draws; NaN at forces not allowed and where too many draws have no resonance."""
    refused = (np.mean(~np.isfinite(spread.law), axis=0) > REFUSED_SHARE) | ~allowed
    tail = 50.0 * (1.0 - level)

    def quantiles(draws: FloatArray, q: list[float]) -> FloatArray:
        filled = np.where(refused, 0.0, draws)
        return np.where(refused, np.nan, np.exp(np.nanpercentile(filled, q, axis=0)))

    low, median, high = quantiles(spread.law + spread.level + spread.noise, [tail, 50.0, 100.0 - tail])
    credible_low, credible_high = quantiles(spread.law, [tail, 100.0 - tail])
    return Band(name, weight, median, low, high, credible_low, credible_high)
