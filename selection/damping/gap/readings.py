"""Readings that a fit leaves far off, and rows that scatter by more, or by less, than is stated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from damping.arrays import RAD_S_PER_HZ, BoolArray, FloatArray
from damping.effects.contract import Effect
from damping.gap.directed import ALARM, FREE, Test, smallest_p, unexplained
from damping.gap.fit import ModelFit
from damping.gap.problem import Setting
from damping.gap.size import measure_gap, regular_values, root_mean_square
from damping.gap.unknowns import FIRST_GUESS, roughness, spread
from damping.gap.where import by_quantity
from damping.records.check_ceiling import find_resolution
from damping.records.record import Record

#: The noise is plainly too large where the residuals, plus two standard errors, are below this share of it.
_QUIET = 0.8
#: Roughness over spread of residuals from which they count as white: half of their mean square is independent from row
#: to row. Errors of correlation .8 from row to row have .4 to .5.
_WHITE = 0.7
_COMBINED = 4  #: neighbours combined to cancel what is smooth: with fewer a resonance would count as scatter
_SEEN = 0.5  #: share of the gap that effects must close to be visible beside scatter larger than stated
_MOST_NAMED = 3  #: most readings that a caution names
#: Fewest different readings that show a step, and how near multiples of it they are: a file has six digits or more.
_STEPS = 6
_ON_STEP = 1e-3
#: What each directed test finds, by its name.
_FOUND = {
    "stiffness with amplitude": "a stiffness free to change with amplitude improves the fit",
    "damping with amplitude": "damping free to change with amplitude improves the fit",
    FREE: "stiffness and damping free to change with amplitude improve the fit",
    "second path": "a second path of the force, free over frequency, improves the fit",
    "gain with amplitude": "a gain free to change with amplitude improves the fit",
    "instrument with amplitude": "a gain and a phase free to change with amplitude improve the fit",
    "instrument with frequency": "a gain and a phase free to change with frequency improve the fit",
    "drift": "a drift of frequency and gain with time improves the fit",
    "local disturbance": "residuals are larger in one band of frequency",
    "neighbours alike": "residuals of neighbouring rows are correlated",
}


@dataclass(frozen=True)
class FarReading:
    """A reading that lies ``sigma`` units of noise above a fit; frequency in Hz."""

    sweep: str
    frequency: float
    quantity: str
    sigma: float

    def __str__(self) -> str:
        return f"{self.quantity} of sweep {self.sweep} at {self.frequency:.5g} Hz ({self.sigma:+.3g} sigma)"


def list_far_readings(fit: ModelFit) -> tuple[FarReading, ...]:
    """Readings that a fit treats as outliers, the farthest first."""
    rows = fit.model.problem.rows
    r = fit.r * np.where(fit.outliers, fit.model.scatter.dispersion, 0.0)
    quantities = by_quantity(rows, r)
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
    """The caution that names outliers, and says whether the numbers of the gap include them."""
    readings = list_far_readings(fit)
    if not readings:
        return []
    which = f"{'the largest: ' if len(readings) > _MOST_NAMED else ''}{', '.join(map(str, readings[:_MOST_NAMED]))}"
    count = "1 reading" if len(readings) == 1 else f"{len(readings)} readings"
    if fit.has_outlier_pattern:
        return [
            f"{count} far off {fit.outlier_pattern}: {which}; no fit explains this, the numbers of the gap include it"
        ]
    return [f"{count} excluded as stray from the numbers of the gap: {which}"]


def describe_rest(fit: ModelFit, tests: Sequence[Test]) -> str:
    """Evidence, other than its size, that a fit leaves more than noise, in words; empty where there is none."""
    if fit.has_outlier_pattern:
        readings = list_far_readings(fit)
        count, most = ("1 reading", "") if len(readings) == 1 else (f"{len(readings)} readings", "most of all ")
        return f"{count} far off {fit.outlier_pattern}, {most}the {readings[0]}"
    if (p := smallest_p(tests)) >= ALARM:
        return ""
    name = min(tests, key=lambda test: test.p_value).name
    chance = f"p = {p:.1g}" if p >= 0.5e-3 else "p < 0.001"
    return f"{_FOUND[name]} ({chance})"


@dataclass(frozen=True)
class RowScatter:
    """Standard deviations of white residuals over the stated ones; ``phase`` is None without phases."""

    amplitude: float
    phase: float | None

    def __str__(self) -> str:
        phases = "" if self.phase is None else f" and phases {self.phase:.2g} times"
        return f"amplitudes scatter {self.amplitude:.2g} times{phases} the stated noise, white along every sweep"


def measure_scatter(
    setting: Setting, fit: ModelFit, tests: Sequence[Test], effects: Mapping[str, Effect]
) -> RowScatter | None:
    """The scatter of rows whose stated noise is too small, where a fit leaves only that scatter; else None.

    The residuals must be white by `damping.gap.unknowns.roughness`, the measure that estimates unstated noise, and
    `damping.gap.directed` must see nothing else in the rows.
    """
    rows = fit.model.problem.rows
    if not setting.noise_known or setting.dispersion == 1.0 or unexplained(fit, tests, effects):
        return None
    kept = (rows.measured & ~fit.outliers).reshape(-1, len(rows))[: 1 + rows.has_phase]
    compared = [_compare_roughness(fit, r, keep) for r, keep in zip(fit.r.reshape(-1, len(rows)), kept, strict=False)]
    rough, total = np.array(compared).T
    if not np.sqrt(np.mean((rough / total) ** 2)) > _WHITE:
        return None
    return RowScatter(*(float(value) for value in total), *([] if rows.has_phase else [None]))


def stands_above(scatter: RowScatter | None, fit: ModelFit) -> bool:
    """Whether a fit is judged by the actual scatter of its rows instead of the smaller stated noise.

    Effects can fit errors that are no noise, such as rounding, a little; these are judged by the stated noise.
    """
    return scatter is not None and (not fit.effects or (measure_gap(fit).shrinkage or 0.0) > _SEEN)


def _compare_roughness(fit: ModelFit, r: FloatArray, keep: BoolArray) -> tuple[float, float]:
    """Roughness and spread of residuals (n,) in units of stated noise; NaN for too few rows."""
    rows = fit.model.problem.rows.where(keep)
    if max(map(len, rows.runs), default=0) < _COMBINED:
        return np.nan, np.nan
    factor = fit.model.scatter.factor
    return factor * float(roughness(rows, r[keep], (0.0,))[0]), factor * spread(r[keep])


def describe_noise(setting: Setting, fit: ModelFit, scatter: RowScatter | None = None) -> list[str]:
    """The caution where rows scatter more than stated, or where a fit leaves less than noise."""
    if scatter is not None:
        return [f"the {scatter}: is the stated noise right?"]
    rows = setting.problem.rows
    # further channels leave less than their noise by design, see `damping.gap.unknowns.FURTHER_ERROR`
    regular = regular_values(fit) & (np.arange(len(fit.r)) < rows.values_of_mode)
    rms = root_mean_square(fit, regular) * np.sqrt(fit.measured.size / fit.freedom)
    if rows.at_resonance or rms * (1.0 + np.sqrt(2.0 / fit.freedom)) > _QUIET:
        return []
    how = "stated" if setting.noise_known else "estimated"
    return [f"the {how} noise is too large: rows scatter by {rms:.2g} of it, and effects below it are hidden"]


def describe_rounding(record: Record) -> list[str]:
    """Cautions for readings that are multiples of a step with an error, step/sqrt(12), beyond usual noise."""
    cautions = []
    for name, unit in (("amplitude", float(record.column("amplitude").min())), ("phase", 1.0)):
        values = np.abs(record.column(name, 0.0))
        if len(np.unique(values)) < _STEPS:
            continue
        step = find_resolution(values)
        rounding = 0.5 * step / unit
        if np.all(np.abs(values / step - np.round(values / step)) < _ON_STEP) and rounding > np.sqrt(3.0) * FIRST_GUESS:
            most = f"{rounding:.2g} rad" if name == "phase" else f"{100.0 * rounding:.2g} % of the smallest"
            cautions.append(
                f"every {name} is a multiple of {step:.3g}: rounded by up to {most}. This counts as noise, and hides "
                "smaller effects; record more digits, or use a finer range"
            )
    return cautions
