"""Resonant amplitude at design forces beyond the test, as credible and predictive distributions.

For a law the amplitude at phase resonance solves C(A, omega) = F, at the resonance frequency of the largest tested
force, or along the backbone where that moves. The next test's reading has four parts, added in ln A draw by draw:

- parameters: posterior draws of the law's amplitude, corrected by the tested levels;
- between-model: which law, by its posterior probability;
- discrepancy: how far the structure departs from a law's exponent beyond the test (:mod:`damping.infer.discrepancy`);
- measurement noise: scatter of a level and of a reading, and the uncertainties stated in the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import BoolArray, FloatArray, IntArray, join_rows
from damping.extrapolation.cautions import NOTHING_KNOWN, list_cautions
from damping.extrapolation.draws import Draws, Member, find_quantiles, find_shares
from damping.extrapolation.plan import Plan
from damping.extrapolation.reading import read_members
from damping.infer.observations import Observations

REFUSED_SHARE = 0.05  #: share of draws without a resonance above which no prediction is given
#: Names of the parts of a predictive distribution.
PARTS = ("measurement_noise", "parameters", "between_model", "discrepancy")


@dataclass(frozen=True)
class Band:
    """Median and central interval over forces, arrays (forces,); NaN where there is no prediction."""

    name: str
    weight: float
    median: FloatArray
    low: FloatArray  #: predictive
    high: FloatArray  #: predictive
    credible_low: FloatArray  #: of the law's amplitude alone
    credible_high: FloatArray  #: of the law's amplitude alone

    @property
    def _ends(self) -> tuple[FloatArray, ...]:
        return self.median, self.low, self.high, self.credible_low, self.credible_high

    def keep(self, known: BoolArray) -> Band:
        """The band, NaN except where ``known`` (forces,)."""
        return Band(self.name, self.weight, *(np.where(known, end, np.nan) for end in self._ends))

    def at(self, forces: IntArray) -> Band:
        """The band at a selection of the forces."""
        return Band(self.name, self.weight, *(end[forces] for end in self._ends))

    def leave_out(self, amplitude: FloatArray, data: Observations) -> tuple[Band, BoolArray]:
        """The band, and where it was left out, (forces,): it is NaN beyond ``NOTHING_KNOWN``.

        ``amplitude`` (forces,): given, or the median.
        """
        near = amplitude <= NOTHING_KNOWN * data.tested_amplitude.max()
        unknown = ~np.isnan(self.median) & ~(near & (self.high <= NOTHING_KNOWN * self.low))
        return self.keep(~unknown), unknown


@dataclass(frozen=True)
class Loads:
    """Predictions over forces, arrays (forces,)."""

    force: FloatArray
    level: float  #: content of the intervals
    average: Band  #: over models by weight
    by_model: tuple[Band, ...]  #: band of each law
    #: standard deviation of each of ``PARTS``, per cent of amplitude; squares add to the total variance
    parts: dict[str, FloatArray]
    linear: FloatArray  #: amplitude by the viscous coefficient of the sweep with the largest tested force
    ratio: FloatArray  #: force over the largest tested force
    cautions: tuple[tuple[str, ...], ...]  #: a tuple for each force
    limit: float = np.inf  #: force beyond which levels are too few to predict; infinite if there is none
    #: the given ones, if any; ``force`` then holds medians, and the bands are of force
    amplitude: FloatArray | None = None

    def at(self, forces: IntArray) -> Loads:
        """The predictions at a selection of the forces, without requested amplitudes."""
        return replace(
            self,
            force=self.force[forces],
            average=self.average.at(forces),
            by_model=tuple(band.at(forces) for band in self.by_model),
            parts={name: part[forces] for name, part in self.parts.items()},
            linear=self.linear[forces],
            ratio=self.ratio[forces],
            cautions=tuple(self.cautions[force] for force in forces),
        )

    @property
    def overprediction(self) -> FloatArray:
        """Excess of ``linear`` over the median, 100 (linear/median - 1), per cent."""
        return self._exceed(self.average.median)

    @property
    def overprediction_low(self) -> FloatArray:
        """The same over the high end of the predictive interval."""
        return self._exceed(self.average.high)

    @property
    def overprediction_high(self) -> FloatArray:
        """The same over the low end of the predictive interval."""
        return self._exceed(self.average.low)

    @np.errstate(divide="ignore")  # the linear amplitude is divided by 0 where friction holds the mode
    def _exceed(self, predicted: FloatArray) -> FloatArray:
        return np.asarray(100.0 * (self.linear / predicted - 1.0))


def scale_linearly(force: FloatArray, data: Observations) -> FloatArray:
    """A = F/(c omega) with c of the sweep with the largest tested force (Eq. 4.1.7): proportional to the force."""
    return np.asarray(data.tested_amplitude[data.top] * force / data.tested_force[data.top])


def predict(
    members: Sequence[Member],
    force: FloatArray,
    data: Observations,
    level: float,
    seed: int,
    plan: Plan | None = None,
    repeatability: float = 0.0,
    draws: Sequence[Draws] | None = None,
    each: bool = True,
    to_invert: bool = False,
) -> Loads:
    """Predict resonant amplitudes at ``force`` (forces,), averaged over ``members`` by weight.

    Args:
        data: of the tested levels.
        plan: if given, its limit applies and its findings are among the cautions.
        repeatability: stated relative standard uncertainty of a level's amplitude, a lower bound of the scatter.
        draws: at ``force``, if already made.
        each: whether to make the band of each law too.
        to_invert: whether forces for given amplitudes will be read from the bands. Below the tested forces, and at all
            forces of a decay, a draw without a resonance then counts, with amplitude 0 if friction holds the mode, else
            infinite. Elsewhere a prediction is refused if too many draws have no resonance.
    """
    if draws is None:
        draws = [reading.at(force) for reading in read_members(members, data, repeatability, seed)]
    allowed = plan.allows(force) if plan else np.full(len(force), True)
    counted = to_invert & (data.amplitude_is_input | (force < data.tested_force.min()))
    laws = zip(members, draws, strict=True) if each else ()
    bands = [_find_band(m.name, m.weight, [s], np.ones(len(s.law)), allowed, counted, level) for m, s in laws]
    weights = np.array([member.weight for member in members]) / sum(member.weight for member in members)
    average = _find_band("average over models", 1.0, draws, find_shares(members, draws), allowed, counted, level)
    unknown = np.full(len(force), False)
    if not to_invert:
        average, unknown = average.leave_out(average.median, data)
        bands = [band.keep(~unknown).leave_out(band.median, data)[0] for band in bands]
    predicted = np.isfinite(average.median)
    linear = np.where(predicted, scale_linearly(force, data), np.nan)
    ratio = force / data.tested_force[data.top]
    held = sum(w * np.mean(~s.resonates & ~s.short, axis=0) for w, s in zip(weights, draws, strict=True))
    unreached = sum(w * np.mean(~s.resonates & s.short, axis=0) for w, s in zip(weights, draws, strict=True))
    rows = zip(force, average.median, held, unreached, unknown, strict=True)
    return Loads(
        force=force,
        level=level,
        average=average,
        by_model=tuple(bands),
        parts={name: np.where(predicted, part, np.nan) for name, part in _split_variance(draws, weights).items()},
        linear=linear,
        ratio=ratio,
        cautions=tuple(
            list_cautions(f, A, data, [m.weight for m in members], plan, (still, lost), far)
            for f, A, still, lost, far in rows
        ),
        limit=plan.limit if plan else np.inf,
    )


@np.errstate(invalid="ignore")  # laws with infinite amplitudes are infinitely far apart
def _split_variance(draws: Sequence[Draws], weights: FloatArray) -> dict[str, FloatArray]:
    """Standard deviations in per cent by the law of total variance, each (forces,)."""
    mean, within, discrepancy, noise = map(np.array, zip(*map(_find_moments, draws), strict=True))
    variances = {
        "measurement_noise": weights @ noise,
        "parameters": weights @ within,
        "between_model": weights @ (mean - weights @ mean) ** 2,
        "discrepancy": weights @ discrepancy,
    }
    return {name: 100.0 * np.sqrt(variance) for name, variance in variances.items()}


def _find_moments(drawn: Draws) -> tuple[FloatArray, ...]:
    """Mean of a law's ln A, and the variances of ln A, of its discrepancy and of the noise, each (forces,)."""
    known = np.isfinite(drawn.law).any(axis=0)  # if no draw resonates, the law makes no prediction
    law = np.where(known, drawn.law, 0.0)
    discrepancy = np.nanvar(np.where(known, drawn.discrepancy, 0.0), axis=0)
    return np.nanmean(law, axis=0), np.nanvar(law, axis=0), discrepancy, np.mean(drawn.noise**2, axis=0)


@np.errstate(over="ignore", invalid="ignore")  # amplitudes may be infinite, or 0 with ln 0
def _find_band(
    name: str,
    weight: float,
    draws: Sequence[Draws],
    shares: FloatArray,
    allowed: BoolArray,
    counted: BoolArray,
    level: float,
) -> Band:
    """Quantiles over draws of ``shares``; NaN at forces not allowed and where too many draws have no resonance.

    At forces at which such draws are ``counted`` their ln A is -inf or inf. Forces are pooled one by one: pooling all
    at once would double the memory of the draws.
    """
    tail, ends = 0.5 * (1.0 - level), np.full((5, len(allowed)), np.nan)
    for i in np.flatnonzero(allowed):
        pooled = join_rows([drawn.at(slice(i, i + 1)) for drawn in draws])
        total, law = pooled.total, pooled.law
        if counted[i]:
            bound = np.where(pooled.short, np.inf, -np.inf)
            total, law = (np.where(pooled.resonates, part, bound) for part in (total, law))
        elif shares @ ~pooled.resonates[:, 0] > REFUSED_SHARE * shares.sum():
            continue
        ends[:3, i] = find_quantiles(total, shares, np.array([0.5, tail, 1.0 - tail]))[:, 0]
        ends[3:, i] = find_quantiles(law, shares, np.array([tail, 1.0 - tail]))[:, 0]
    return Band(name, weight, *np.exp(ends))
