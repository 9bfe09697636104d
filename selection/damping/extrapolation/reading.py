"""Draws of the next test's reading at any force: what does not depend on the force is computed once for each law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damping.arrays import FloatArray, IntArray, drop_repeats
from damping.extrapolation.draws import Draws, Member
from damping.forces.contract import Sum
from damping.infer.discrepancy import extend, place_steps, read_path
from damping.infer.law import EACH_WITH_ROWS
from damping.infer.likelihood import by_blocks, covary_scatter, find_level_exponents, residuals, sum_by_sweep
from damping.infer.observations import Observations
from damping.infer.paths import Paths

_DIGITS = 12  #: digits of ln F: forces that differ by rounding alone count as one point, in any units


def _round_log(force: FloatArray) -> FloatArray:
    return np.asarray(np.round(np.log(force), _DIGITS), float)


@dataclass(frozen=True)
class NextReading:
    """The next test's reading by one law, at any force."""

    member: Member
    data: Observations  #: of the tested levels
    damping: Sum  #: force of each distinct draw of the member
    which: IntArray  #: the distinct draw of each draw, (draws,)
    paths: Paths  #: of the discrepancy
    noise: FloatArray  #: of each draw, the same at all forces so that bands are smooth, (draws,)

    @classmethod
    @np.errstate(divide="ignore", invalid="ignore")  # a law without a slope
    def of(cls, member: Member, data: Observations, repeatability: float, rng: np.random.Generator) -> NextReading:
        """All that does not depend on the force; arguments as of `read_members`."""
        new, which = drop_repeats(member.draws)  # resampling repeats draws
        draws = member.draws[new]
        parts = member.coordinates.find_parts(draws)
        damping = member.coordinates.join(parts, EACH_WITH_ROWS)
        row, level = member.coordinates.scatter(draws)
        if member.coordinates.with_level_scatter:
            level = np.maximum(level, repeatability)
        else:
            row = np.maximum(row, repeatability)
        sigma = member.coordinates.discrepancy(draws, parts)
        of_noise, of_paths = rng.spawn(2)

        def join(distinct: slice) -> Sum:
            return member.coordinates.join(parts, (distinct, np.newaxis))

        def compare(some: slice) -> tuple[FloatArray, FloatArray]:  # of all draws it would not fit in memory
            own = slice(which[some][0], which[some][-1] + 1)
            deviations, errors = _compare_levels(join(own), row[own], level[own], data)
            return deviations[which[some] - own.start], errors[which[some] - own.start]

        paths = Paths.draw(sigma[which], compare, _round_log(data.tested_force), of_paths)
        known = by_blocks(lambda some: residuals(join(some), data)[2].mean(axis=1), len(draws), len(data.A))
        noise = np.sqrt((row**2 + level**2 + known)[which]) * of_noise.standard_normal(len(which))
        return cls(member, data, damping, which, paths, noise)

    @np.errstate(divide="ignore", invalid="ignore")  # ln of an amplitude of 0, and discrepancy of an infinite one
    def at(self, force: FloatArray) -> Draws:
        """Draws of the law's parts at ``force`` (forces,); NaN where a draw has no resonance."""
        data, which, asked = self.data, self.which, _round_log(force)
        top = self.paths.at.max()
        within, steps = asked[asked <= top], top + place_steps(asked.max() - top)
        of_law = np.log(self.member.solve(self.damping, np.exp(np.concatenate([asked, steps])), data))[which]
        of_law, on_steps = of_law[:, : len(asked)], of_law[:, len(asked) :]
        mean, drawn = self.paths.follow(np.append(within, top), steps[1:])

        def follow(discrepancy: FloatArray, *, lets_go: bool) -> FloatArray:
            log_A = np.empty(of_law.shape)
            log_A[:, asked <= top] = of_law[:, asked <= top] + discrepancy[:, : len(within)]
            options = {"lets_go": lets_go, "of_decay": data.amplitude_is_input}
            path = extend(on_steps, discrepancy[:, len(within) :], steps, self.member.joint, **options)
            log_A[:, asked > top] = read_path(path, on_steps, of_law[:, asked > top], asked[asked > top], steps)
            return log_A

        law = follow(mean, lets_go=False)  # a joint that lets go is part of the discrepancy
        discrepancy = follow(drawn, lets_go=True) - law
        largest = data.tested_amplitude[data.top], data.tested_omega[data.top]
        short = self.damping.quadrature(*largest) < np.exp(asked)
        noise = np.broadcast_to(self.noise[:, None], law.shape)
        return Draws(law, discrepancy, noise, np.isfinite(of_law), short[which])


def read_members(
    members: Sequence[Member], data: Observations, repeatability: float, seed: int
) -> tuple[NextReading, ...]:
    """The next reading by every law; draws at one force do not depend on the other forces.

    ``repeatability``: stated of a level's amplitude, a lower bound of its scatter.
    """
    rngs = np.random.default_rng(seed).spawn(len(members))
    return tuple(NextReading.of(member, data, repeatability, rng) for member, rng in zip(members, rngs, strict=True))


def _compare_levels(
    damping: Sum, row: FloatArray, level: FloatArray, data: Observations
) -> tuple[FloatArray, FloatArray]:
    """ln A of each level minus that of the law, (draws, sweeps); covariance of its errors, (draws, sweeps, sweeps)."""
    n, h, known = residuals(damping, data)
    weight = h / (row[:, None] ** 2 + known)
    hh, hn = (sum_by_sweep(weight * value, data) for value in (h, n))
    hh = np.maximum(hh, 1e-6)  # a level whose rows do not determine its amplitude
    covariance = covary_scatter(row, level, data) + np.eye(hh.shape[1]) / hh[:, None, :]
    # n > 0 if more force was needed than the law predicts: the law's amplitude exceeds the measured one
    if not data.amplitude_is_input:
        return -hn / hh, covariance
    p = find_level_exponents(damping, data)  # n of decays is of force: ln A is off by 1/p times as much
    return -hn / p / hh, covariance / (p[:, :, None] * p[:, None, :])
