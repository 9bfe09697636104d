"""The figures of a record, each with title and description; the figure of design loads has a slider."""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from damping import report as words
from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.extrapolation.backbone import Backbone
from damping.extrapolation.prediction import Loads
from damping.forces import damping_ratio
from damping.forces.contract import Force
from damping.infer.observations import Observations
from damping.plots import Drawn
from damping.plots.curves import damping_curve, design_loads, fitted_sweeps
from damping.plots.fits import corner, predictive_check, ranking
from damping.predict.steady import resonant_amplitude
from damping.records.mode import Units
from damping.report import forms, tables
from damping.report.page import Block, FigureBlock
from damping.report.results import LawPosterior, RecordResult, Svgs, posterior_draws, prior_draws

MOST_SWEEPS = 8  #: sweeps whose predictive check is drawn, evenly from the smallest to the largest force
#: Laws drawn as bars; the rest weigh next to nothing.
MOST_BARS = 12
POINTS = 120  #: points of a fitted curve between the ends of a sweep
#: Relative change of the force in the last turn from which a fitted curve is drawn from row to row.
SETTLED = 0.02
REACH = 8.0  #: factor about a measured amplitude within which a fitted one is sought
_MEASURED = ("force", "frequency", "amplitude")
ROUNDING = 1e-9  #: share of a squared force that rounding may take from the one that holds the resonance


def record_figures(result: RecordResult, level: float) -> dict[str, Drawn]:
    """Figures of a record by name, without those that have no data. ``level``: of predictive checks."""
    drawn = {
        "damping_curve": _draw_curve(result),
        "fitted": _draw_fitted(result),
        "design_loads": draw_design_loads(result.title, result.data, result.mode.units, result.design, result.bands),
        "ranking": _draw_ranking(result),
        "corner": _draw_corner(result),
        "predictive_check": _draw_predictive_check(result, level),
    }
    return {name: figure for name, figure in drawn.items() if figure is not None}


def leading(result: RecordResult) -> LawPosterior | None:
    """The sampled law of largest weight whose chain converged, if any."""
    converged = [sampled for sampled in result.posteriors if sampled.posterior.converged]
    return max(converged, key=lambda sampled: sampled.weight) if converged else None


def _draw_curve(result: RecordResult) -> Drawn | None:
    curve = result.drawn_curve or result.curve
    if curve is None or not np.isfinite(curve.damping_ratio.median).any():
        return None
    table, data = curve.table, result.data
    factor, unit = words.choose_length(result.mode.units.length, table["amplitude"].max())
    table["amplitude"] *= factor
    tested = None
    if result.backbone is not None:
        stiffness = result.backbone.stiffness_at(data.tested_amplitude)
        ratio = damping_ratio(data.tested_force, data.tested_amplitude, stiffness)
        tested = pd.DataFrame({"amplitude": factor * data.tested_amplitude, "damping_ratio": ratio})
    columns = ["amplitude", "damping_ratio", "damping_ratio_low", "damping_ratio_high"]
    rows = table.loc[np.isfinite(table["damping_ratio"]), columns]
    ends = words.format_joined(
        f"{words.number(100.0 * z)} per cent at {words.format_quantity(A, unit)} "
        f"({words.number(100.0 * low)} to {words.number(100.0 * high)})"
        for A, z, low, high in rows.iloc[[0, -1]].itertuples(index=False)
    )
    description = (
        f"Damping ratio against resonant amplitude, with its {100 * curve.level:g} per cent predictive band: {ends}."
    )
    return Drawn(damping_curve(table, curve.level, unit, tested), f"{result.title}: damping ratio", description)


def _draw_fitted(result: RecordResult) -> Drawn:
    """Measured rows and the leading law: sweeps over frequency, or resonances as amplitude over force."""
    best, data, units = result.ranking.weighted()[0], result.data, result.mode.units
    force, record, frame = best.fitted.force, result.record, result.record.frame
    factor, length = words.choose_length(units.length, data.tested_amplitude.max())
    swept = [s for s in record.sweeps if (frame["sweep"].astype(str) == s).sum() > 2]
    if swept and result.backbone:
        measured = frame.assign(sweep=frame["sweep"].astype(str), x=frame["frequency"], y=factor * frame["amplitude"])
        measured = measured[measured["sweep"].isin(swept)][["sweep", "x", "y"]]
        curves = []
        for sweep in swept:
            rows = frame[frame["sweep"].astype(str) == sweep].sort_values("frequency")
            mass = float(record.masses(result.mode.mass)[rows.index[0]])
            curve = trace_sweep(force, result.backbone, mass, rows)
            curves.append(pd.DataFrame({"sweep": sweep, "x": curve[0], "y": factor * curve[1]}))
        figure = fitted_sweeps(measured, pd.concat(curves, ignore_index=True), best.name, length)
        what = f"Amplitude against frequency of {len(swept)} sweeps"
    else:
        measured = pd.DataFrame({"sweep": data.sweeps, "x": data.tested_force, "y": factor * data.tested_amplitude})
        F = np.linspace(0.85 * data.tested_force.min(), 1.1 * data.tested_force.max(), POINTS)
        y = factor * resonant_amplitude(force, F, data.tested_omega[data.top])
        line = pd.DataFrame({"sweep": "", "x": F, "y": y})
        figure = fitted_sweeps(measured, line, best.name, length, force_unit=units.force)
        what = f"Resonant amplitude against force of {len(data.sweeps)} sweeps"
    description = f"{what}, measured and by {best.name}, which misses {describe_misfit(result)}."
    return Drawn(figure, f"{result.title}: measured and fitted", description)


def describe_misfit(result: RecordResult) -> str:
    """By how much the leading law misses what its figure shows: rows of sweeps, or resonances."""
    ranking = result.ranking
    if result.data.has_repeats and np.isfinite(ranking.fit.misfit):
        return f"the measured rows by {words.format_percent(ranking.fit.misfit)} % (root mean square)"
    mean = words.format_percent(ranking.weighted()[0].average_absolute_percent)
    return f"the resonant amplitudes by {mean} % on average"


def trace_sweep(law: Force, backbone: Backbone, mass: float, rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """Frequency (Hz) and amplitude of a law's response to the force of a sweep, whose ``rows`` rise in frequency.

    M^2 (omega_n^2(A) - omega^2)^2 A^2 + C^2 = F^2 solved for omega, below and above the resonance; omega_n(A) is the
    measured backbone, so that a folded curve is complete. Where the force changes much along the curve (a response
    held at one amplitude), the curve leads from row to row instead (`_trace_rows`).
    """
    force, frequency, amplitude = (rows[name].to_numpy(float) for name in _MEASURED)
    largest = float(amplitude.max())
    for _ in range(3):  # the resonance moves little from where the largest motion was read
        hertz = backbone.frequency_at(np.array([largest]), 0.9).median
        peak = float(resonant_amplitude(law, np.interp(hertz, frequency, force), RAD_S_PER_HZ * float(hertz[0]))[0])
        largest = peak if np.isfinite(peak) else largest
    least = min(0.5 * amplitude.min() / largest, 0.5)
    A = largest * np.sin(np.linspace(np.arcsin(least), 0.5 * np.pi, POINTS))  # dense at the resonance
    omega_n = RAD_S_PER_HZ * backbone.frequency_at(A, 0.9).median
    A, sides = np.concatenate([A, A[::-1]]), np.repeat([-1.0, 1.0], POINTS)
    omega_n = np.concatenate([omega_n, omega_n[::-1]])
    omega, F = omega_n, np.zeros(2 * POINTS)
    for _ in range(3):  # the force of the shaker changes little along the curve
        before, F = F, np.interp(omega / RAD_S_PER_HZ, frequency, force)
        squared = F**2 - law.quadrature(A, omega_n) ** 2  # of the force that detunes; below 0: A is not reached
        omega = np.sqrt(np.maximum(omega_n**2 + sides * np.sqrt(np.maximum(squared, 0.0)) / (mass * A), 0.0))
    f = omega / RAD_S_PER_HZ
    kept = (f >= frequency[0]) & (f <= frequency[-1]) & (squared >= -ROUNDING * F**2)
    if np.any(np.abs(F - before)[kept] > SETTLED * F[kept]):
        return frequency, _trace_rows(law, backbone, mass, rows)
    return f[kept], A[kept]


def _trace_rows(law: Force, backbone: Backbone, mass: float, rows: pd.DataFrame) -> FloatArray:
    """Amplitude at the force and frequency of each row by the same balance, of several the nearest; NaN for none."""
    force, frequency, amplitude = (rows[name].to_numpy(float)[:, np.newaxis] for name in _MEASURED)
    A = amplitude * np.geomspace(1.0 / REACH, REACH, 4 * POINTS)
    omega, over_all = RAD_S_PER_HZ * frequency, np.geomspace(A.min(), A.max(), POINTS)
    hertz = np.interp(np.log(A), np.log(over_all), backbone.frequency_at(over_all, 0.9).median)
    detuned = mass * ((RAD_S_PER_HZ * hertz) ** 2 - omega**2) * A
    over = np.log(np.hypot(detuned, law.quadrature(A, omega)) / force)
    left, right = over[:, :-1], over[:, 1:]
    at = np.log(A[:, :-1]) + np.log(A[:, 1:] / A[:, :-1]) * left / np.where(left == right, np.inf, left - right)
    distance = np.where((left <= 0.0) != (right <= 0.0), np.abs(at - np.log(amplitude)), np.inf)
    nearest = np.argmin(distance, axis=1)[:, np.newaxis]
    found = np.isfinite(np.take_along_axis(distance, nearest, axis=1))
    return np.asarray(np.where(found, np.exp(np.take_along_axis(at, nearest, axis=1)), np.nan)[:, 0])


def _draw_ranking(result: RecordResult) -> Drawn:
    table = forms.tabulate_candidates(result.ranking).head(MOST_BARS)
    best = table[table["weight"] > 0.0].head(3)
    laws = zip(best["law"], best["weight"], strict=True)
    weights = words.format_joined(f"{law} {words.format_share(weight)}" for law, weight in laws)
    description = (
        f"Bars of the weight of the first {len(table)} candidate laws, beside their error at the tested resonances, "
        f"fitted and with the level held out. Largest weights: {weights}."
    )
    return Drawn(ranking(table), f"{result.title}: candidate laws ranked", description)


def _draw_corner(result: RecordResult) -> Drawn | None:
    best = leading(result)
    if best is None:
        return None
    draws, prior_of = posterior_draws(best), prior_draws(best.posterior.coordinates)
    posterior = {words.format_parameter_label(name, result.mode.units): values for name, values in draws.items()}
    prior = dict(zip(posterior, (prior_of[name] for name in draws), strict=True))
    quantiles = {name: np.percentile(values, (5.0, 50.0, 95.0)) for name, values in posterior.items()}
    intervals = words.format_joined(
        f"{name} {words.number(median)} ({words.number(low)} to {words.number(high)})"
        for name, (low, median, high) in quantiles.items()
    )
    description = f"Posterior of {best.law.name}; median and 90 per cent interval: {intervals}."
    return Drawn(corner(posterior, prior), f"{result.title}: posterior of {best.law.name}", description)


def _draw_predictive_check(result: RecordResult, level: float) -> Drawn | None:
    table = tables.tabulate_predictive_check(result)
    if table.empty:
        return None
    by_force = np.argsort(result.data.tested_force, kind="stable")
    chosen = np.unique(np.linspace(0, len(by_force) - 1, MOST_SWEEPS).round().astype(int))
    table = table[table["sweep"].isin([result.data.sweeps[s] for s in by_force[chosen]])]
    inside = ((table["low"] <= 100.0) & (table["high"] >= 100.0)).sum()
    description = (
        f"Predictive intervals of {table['law'].nunique()} laws at {table['sweep'].nunique()} tested sweeps, per "
        f"cent of the measured amplitude; {inside} of {len(table)} hold the measured value."
    )
    return Drawn(predictive_check(table, level), f"{result.title}: predictive check", description)


def draw_design_loads(
    title: str, data: Observations, units: Units, predicted: Loads | None, grid: Loads | None
) -> Drawn | None:
    """Tested resonances, predictions at design forces and bands on a ``grid`` of forces; None where there are none."""
    if grid is None or predicted is None or not np.isfinite(predicted.average.median).any():
        return None
    design, bands = forms.tabulate_loads(predicted), forms.tabulate_loads(grid)
    factor, length = words.choose_length(units.length, bands["median"].max())
    tested = forms.tabulate_tested(data)
    tested["amplitude"] *= factor
    for table in (design, bands):
        table[["median", "low", "high", "linear"]] *= factor
    figure = design_loads(bands, tested, design, grid.level, units.force, length, grid.limit)
    predictions = words.format_joined(
        f"at {words.format_force_text(force, units.force)} median {words.format_quantity(median, length)} "
        f"({words.number(low)} to {words.number(high)}), linear {words.number(linear)}"
        for force, median, low, high, linear in design[["force", "median", "low", "high", "linear"]].to_numpy()
    )
    tested_forces = words.format_between(data.tested_force.min(), data.tested_force.max(), units.force)
    description = (
        f"Tested from {tested_forces}; beyond that extrapolated. "
        f"Resonant amplitude with its {100 * grid.level:g} per cent predictive interval: {predictions}."
    )
    return Drawn(figure, f"{title}: resonant amplitude against force", description)


_DRAWN = ("force", "median", "low", "high", "credible_low", "credible_high", "linear")


@dataclass(frozen=True, kw_only=True)
class Explorer(FigureBlock):
    """A figure of design loads with a slider for the force, from precomputed predictions."""

    name: str  #: an id on the page
    level: str  #: content of the bands, such as ``90 %``
    #: numbers to draw and ``texts`` to show, lists over forces in ascending order; null and a dash where no prediction
    #: is given
    data: dict[str, Any]
    jumps: tuple[tuple[int, str], ...]  #: positions of the design forces with their text, ascending; the last is shown


def build_loads_explorer(result: RecordResult, svgs: Svgs) -> dict[str, Block]:
    """The figure of design loads of a record with its slider, by its file; empty without that figure."""
    stem = result.stem("design_loads")
    if stem not in svgs or result.bands is None or result.design is None:
        return {}
    table = pd.concat(
        [tables.tabulate_study_loads(result.bands), tables.tabulate_study_loads(result.design)], ignore_index=True
    )
    # a design force keeps the numbers of the table of design loads, whatever the grid says there
    table = table.drop_duplicates("force", keep="last").sort_values("force", ignore_index=True)
    factor, length = words.choose_length(result.mode.units.length, table["median"].max())
    table[list(_DRAWN[1:])] *= factor
    force, unit = table["force"].to_numpy(float), result.mode.units.force
    positions = {int(np.flatnonzero(force == f)[0]) for f in result.design.force}
    jumps = tuple((i, words.format_force_text(force[i], unit)) for i in sorted(positions))
    numbers = {name: [float(f"{x:.5g}") if np.isfinite(x) else None for x in table[name]] for name in _DRAWN}
    data = {**numbers, "texts": _write_texts(table, unit, length)}
    level = f"{100 * result.bands.level:g} %"
    return {stem: Explorer(svgs[stem], name=stem, level=level, data=data, jumps=jumps)}


def _write_texts(table: pd.DataFrame, force_unit: str, length_unit: str) -> dict[Hashable, list[str]]:
    """Texts of the page at each force, formatted as in the tables; a dash where no prediction is given."""
    texts = []
    for row in table.to_dict("records"):
        over, low, high = (words.format_signed(row[f"overprediction{end}"]) for end in ("", "_low", "_high"))
        row_texts = {
            "median": words.format_quantity(row["median"], length_unit),
            "predictive": words.format_between(row["low"], row["high"], length_unit),
            "credible": words.format_between(row["credible_low"], row["credible_high"], length_unit),
            "over": f"{over} ({low} to {high})",
        }
        if not np.isfinite(row["median"]):
            row_texts = dict.fromkeys(row_texts, words.NOTHING)
        row_texts["force"] = words.format_quantity(row["force"], force_unit, 4)
        row_texts["ratio"] = words.number(row["extrapolation_ratio"])
        row_texts["linear"] = words.format_quantity(row["linear"], length_unit)
        texts.append(row_texts)
    return pd.DataFrame(texts).to_dict("list")
