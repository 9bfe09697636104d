"""Readings that a fit leaves far off, and rows that scatter by more, or by less, than is stated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from damping.arrays import RAD_S_PER_HZ, BoolArray, FloatArray
from damping.effects.contract import Effect
from damping.gap.directed import ALARM, Test, smallest_p, unexplained
from damping.gap.fit import ModelFit
from damping.gap.problem import Setting
from damping.gap.size import measure_gap, regular_values, root_mean_square
from damping.gap.unknowns import roughness, spread

#: What an explanation leaves, with two standard errors of it, over a noise that is plainly too large.
_QUIET = 0.8
#: Scatter from neighbour to neighbour over all that is left, from which that is white: half of its mean square is new
#: at every row. Errors that go together by .8 from row to row have .4 to .5.
_WHITE = 0.7
#: Neighbours that annul what is smooth: with fewer a resonance is taken for scatter.
_COMBINED = 4
#: Share of the gap that effects close beside scatter that is larger than stated from which they are seen beside it.
_SEEN = 0.5
#: Readings that a caution names.
_MOST_NAMED = 3
#: What a directed test found, where its name does not say it.
_FOUND = {
    "neighbours alike": "neighbouring rows deviate alike",
    "local disturbance": "rows side by side deviate more than others",
}


@dataclass(frozen=True)
class FarReading:
    """A reading that lies ``sigma`` units of noise above what a fit says; frequency in Hz."""

    sweep: str
    frequency: float
    quantity: str
    sigma: float

    def __str__(self) -> str:
        return f"{self.quantity} of sweep {self.sweep} at {self.frequency:.5g} Hz ({self.sigma:+.3g} sigma)"


def list_far_readings(fit: ModelFit) -> tuple[FarReading, ...]:
    """Readings that a fit takes for wild, the farthest first."""
    rows = fit.model.problem.rows
    r = fit.r * np.where(fit.wild, fit.model.scatter.dispersion, 0.0)
    quantities = {"amplitude": r[: len(rows)]}
    if rows.has_phase:
        quantities["phase"] = r[len(rows) : 2 * len(rows)]
    for channel, name in (("third", "third harmonic"), ("cross", "motion across")):
        if channel in rows.channels:
            quantities[name] = np.hypot(*r[rows.places(channel)].reshape(2, -1))
    hertz = rows.omega / RAD_S_PER_HZ
    readings = [
        FarReading(rows.sweeps[rows.sweep[k]], float(hertz[k]), name, float(values[k]))
        for name, values in quantities.items()
        for k in np.flatnonzero(values)
    ]
    return tuple(sorted(readings, key=lambda reading: -abs(reading.sigma)))


def describe_far_readings(fit: ModelFit) -> list[str]:
    """The caution that names readings that a fit does not follow, and whether the numbers of the gap hold them."""
    readings = list_far_readings(fit)
    if not readings:
        return []
    which = f"{'the largest: ' if len(readings) > _MOST_NAMED else ''}{', '.join(map(str, readings[:_MOST_NAMED]))}"
    count = "1 reading" if len(readings) == 1 else f"{len(readings)} readings"
    if fit.many_wild:
        return [f"{count} far off {fit.wild_pattern}: {which}; no fit follows that, the numbers of the gap hold it"]
    return [f"{count} set aside as stray, and in no number of the gap: {which}"]


def describe_rest(fit: ModelFit, tests: Sequence[Test]) -> str:
    """What shows that a fit leaves more than noise, beside its size; empty where nothing does."""
    if fit.many_wild:
        readings = list_far_readings(fit)
        count, most = ("1 reading", "") if len(readings) == 1 else (f"{len(readings)} readings", "most of all ")
        return f"{count} far off {fit.wild_pattern}, {most}the {readings[0]}"
    if (p := smallest_p(tests)) >= ALARM:
        return ""
    name = min(tests, key=lambda test: test.p_value).name
    chance = f"p = {p:.1g}" if p >= 0.5e-3 else "p < 0.001"
    return f"{_FOUND.get(name, f'{name} in free form improves the fit')} ({chance})"


@dataclass(frozen=True)
class RowScatter:
    """Standard deviations of what rows leave, new at every row, over the stated ones; None: no phases."""

    amplitude: float
    phase: float | None

    def __str__(self) -> str:
        phases = "" if self.phase is None else f" and phases {self.phase:.2g} times"
        return f"amplitudes scatter {self.amplitude:.2g} times{phases} the stated noise, white along every sweep"


def measure_scatter(
    setting: Setting, fit: ModelFit, tests: Sequence[Test], effects: Mapping[str, Effect]
) -> RowScatter | None:
    """The scatter of rows whose stated noise is too small, where that scatter is all that a fit leaves; else None.

    It is so where it is as rough as what noise is taken from that is not stated (`damping.gap.unknowns.roughness`), and
    where nothing else is seen in the rows (`damping.gap.directed`).
    """
    rows = fit.model.problem.rows
    if not setting.noise_known or setting.dispersion == 1.0 or unexplained(fit, tests, effects):
        return None
    kept = (rows.seen & ~fit.wild).reshape(-1, len(rows))[: 1 + rows.has_phase]
    compared = [_compare_roughness(fit, r, own) for r, own in zip(fit.r.reshape(-1, len(rows)), kept, strict=False)]
    rough, left = np.array(compared).T
    if not np.sqrt(np.mean((rough / left) ** 2)) > _WHITE:
        return None
    return RowScatter(*(float(value) for value in left), *([] if rows.has_phase else [None]))


def stands_above(scatter: RowScatter | None, fit: ModelFit) -> bool:
    """Whether a fit is judged by the scatter that its rows have and not by the noise that is stated, which is smaller.

    Errors that are no noise, as of rounding, have effects that fit them a little; those are judged by what is stated.
    """
    return scatter is not None and (not fit.effects or (measure_gap(fit).shrinkage or 0.0) > _SEEN)


def _compare_roughness(fit: ModelFit, r: FloatArray, keep: BoolArray) -> tuple[float, float]:
    """Scatter of residuals (n,) from neighbour to neighbour, and in all, in units of noise; NaN for too few rows."""
    own = fit.model.problem.rows.where(keep)
    if max(map(len, own.runs), default=0) < _COMBINED:
        return np.nan, np.nan
    factor = fit.model.scatter.factor
    return factor * float(roughness(own, r[keep], (0.0,))[0]), factor * spread(r[keep])


def describe_noise(setting: Setting, fit: ModelFit, scatter: RowScatter | None = None) -> list[str]:
    """The caution where rows scatter more than is stated, or where a fit leaves less than noise."""
    if scatter is not None:
        return [f"the {scatter}: is the stated noise right?"]
    left = root_mean_square(fit, regular_values(fit)) * np.sqrt(fit.measured.size / fit.freedom)
    if setting.problem.rows.at_resonance or left * (1.0 + np.sqrt(2.0 / fit.freedom)) > _QUIET:
        return []
    how = "stated" if setting.noise_known else "estimated"
    return [f"the noise is {how} too large: rows scatter {left:.2g} of it, and effects as small as the rest are hidden"]
