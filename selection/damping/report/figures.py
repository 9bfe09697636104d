"""The figures of a record, each with its title and its description in words."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.infer.chains import Settings
from damping.plots.design_loads import design_loads
from damping.plots.fits import energy_surface, fits, percent_deviations, ranking
from damping.plots.posteriors import convergence, corner, predictive_check, prior_posterior, prior_posterior_summary
from damping.plots.style import describe_with_unit
from damping.ranking import Candidate
from damping.report import forms, tables
from damping.report.results import LawPosterior, RecordResult, posterior_draws, prior_draws
from damping.report.words import (
    format_energy_unit,
    format_force_text,
    format_joined,
    format_parameter_label,
    format_share,
    number,
)

#: Laws whose fits are drawn: more curves cannot be told apart.
MOST_LAWS = 5
#: Sweeps whose predictive check is drawn, evenly from the smallest to the largest force.
MOST_SWEEPS = 8


class Drawn(NamedTuple):
    """A figure with its text alternative."""

    figure: Figure
    title: str
    description: str


def record_figures(result: RecordResult, level: float) -> dict[str, Drawn]:
    """Figures of a record by name; those its results cannot fill are left out. ``level``: of predictive checks."""
    drawn = {
        "ranking": _draw_ranking(result),
        "fits": _draw_fits(result),
        "deviations": _draw_deviations(result),
        "energy_surface": _draw_energy_surface(result),
        "corner": _draw_corner(result),
        "prior_posterior": _draw_prior_posterior(result),
        "priors": _draw_priors(result),
        "predictive_check": _draw_predictive_check(result, level),
        "convergence": _draw_convergence(result),
        "design_loads": _draw_design_loads(result),
    }
    return {name: one for name, one in drawn.items() if one is not None}


def leading(result: RecordResult) -> LawPosterior | None:
    """The sampled law of largest weight whose chain converged, if any."""
    converged = [sampled for sampled in result.posteriors if sampled.posterior.converged]
    return max(converged, key=lambda sampled: sampled.weight) if converged else None


def shown_laws(result: RecordResult) -> list[Candidate]:
    """The candidates of largest weight, and viscous damping for comparison."""
    best = [c for c in result.ranking.candidates if c.rank is not None and c.weight > 0.0][:MOST_LAWS]
    viscous = [c for c in result.ranking.candidates if c.law.is_viscous and c.rank is not None and c not in best]
    return best + viscous


def _draw_ranking(result: RecordResult) -> Drawn:
    table = tables.tabulate_ranking(result)
    best = table[table["weight"] > 0.0].head(3)
    said = format_joined(
        f"{law} {format_share(weight)}" for law, weight in zip(best["law"], best["weight"], strict=True)
    )
    description = (
        f"Bars of the weight of {len(table)} candidate laws, beside their error at the tested resonances, fitted and "
        f"with the level held out. Largest weights: {said}."
    )
    return Drawn(ranking(table), f"{result.title}: candidate laws ranked", description)


def _draw_fits(result: RecordResult) -> Drawn:
    one_sweep = len(result.data.sweeps) == 1
    units = result.mode.units
    observed = tables.tabulate_observations(result)
    laws = shown_laws(result)
    x = "frequency" if one_sweep else "amplitude"
    y = "energy" if one_sweep else "damping_force"
    measured = pd.DataFrame({"x": observed[x], "y": observed[y], "label": observed["point"]})
    curves = [_tabulate_curve(result, law, one_sweep) for law in laws]
    deviations = tables.tabulate_deviations(result)
    chosen = deviations[deviations["law"].isin([law.name for law in laws])]
    figure = fits(
        measured,
        pd.concat(curves, ignore_index=True),
        pd.DataFrame({"law": chosen["law"], "x": chosen[x], "percent": chosen["percent"]}),
        describe_with_unit("frequency", "Hz") if one_sweep else describe_with_unit("amplitude", units.length),
        describe_with_unit("energy per cycle", format_energy_unit(units))
        if one_sweep
        else describe_with_unit("damping force", units.force),
    )
    means = chosen.groupby("law", sort=False)["percent"].agg(lambda percent: percent.abs().mean())
    said = format_joined(f"{law} {number(mean)} per cent" for law, mean in means.items())
    what = "Energy per cycle against frequency" if one_sweep else "Damping force against amplitude"
    description = f"{what}, measured and by {len(laws)} laws, with deviations below. Mean absolute deviation: {said}."
    return Drawn(figure, f"{result.title}: fits and residuals", description)


def _tabulate_curve(result: RecordResult, law: Candidate, one_sweep: bool) -> pd.DataFrame:
    """A law's curve: energy at the measured points of one sweep, or damping force over a grid of amplitudes."""
    data = result.data
    if one_sweep:
        order = np.argsort(data.omega)
        A, omega = data.A[order], data.omega[order]
        y = np.pi * A * tables.damping_force(law, A, omega)
        return pd.DataFrame({"law": law.name, "weight": law.weight, "x": omega / (2.0 * np.pi), "y": y})
    grid = np.linspace(0.9 * data.A.min(), 1.05 * data.A.max(), 60)
    y = tables.damping_force(law, grid, data.reference[1])
    return pd.DataFrame({"law": law.name, "weight": law.weight, "x": grid, "y": y})


def _draw_deviations(result: RecordResult) -> Drawn | None:
    names = [law.name for law in shown_laws(result)]
    table = tables.tabulate_deviations(result)
    table = table[table["law"].isin(names)]
    if len(result.data.A) < 5:
        return None
    worst = table.iloc[int(table["percent"].abs().argmax())]
    description = (
        f"Per cent deviation of the energy per cycle of {len(result.data.A)} points from {len(names)} laws. The "
        f"largest is {number(worst['percent'])} per cent, at point {worst['point']} by {worst['law']}."
    )
    return Drawn(percent_deviations(table), f"{result.title}: per cent deviations", description)


def _draw_energy_surface(result: RecordResult) -> Drawn | None:
    best = next((c for c in result.ranking.candidates if c.weight > 0.0 and c.rank is not None), None)
    data = result.data
    if best is None or len(data.A) < 5:
        return None
    units = result.mode.units
    frequency = data.omega / (2.0 * np.pi)
    spare = 0.06 * np.ptp(frequency) or 0.01 * frequency[0]
    f = np.linspace(frequency.min() - spare, frequency.max() + 2.0 * spare, 60)
    A = np.linspace(0.5 * data.A.min(), 1.08 * data.A.max(), 60)
    grid_A, grid_f = np.meshgrid(A, f, indexing="ij")
    energy = np.pi * grid_A * tables.damping_force(best, grid_A, 2.0 * np.pi * grid_f)
    figure = energy_surface(
        A,
        f,
        energy,
        tables.tabulate_observations(result)[["amplitude", "frequency", "energy"]],
        describe_with_unit("amplitude", units.length),
        describe_with_unit("frequency", "Hz"),
        describe_with_unit("energy per cycle", format_energy_unit(units)),
    )
    description = (
        f"Contours of the energy per cycle by {best.name} over amplitude and frequency, with {len(data.A)} measured "
        "points in the same colours and their measured energies."
    )
    return Drawn(figure, f"{result.title}: energy surface", description)


def _labelled(result: RecordResult, sampled: LawPosterior) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Prior and posterior draws under labels with units."""
    units = result.mode.units
    prior, posterior = prior_draws(sampled.posterior.coordinates), posterior_draws(sampled)
    labels = {name: format_parameter_label(name, units) for name in posterior}
    return {labels[name]: prior[name] for name in posterior}, {labels[name]: posterior[name] for name in posterior}


def _describe_intervals(draws: dict[str, np.ndarray]) -> str:
    quantiles = {name: np.percentile(values, (5.0, 50.0, 95.0)) for name, values in draws.items()}
    return format_joined(f"{name} {number(q[1])} ({number(q[0])} to {number(q[2])})" for name, q in quantiles.items())


def _draw_corner(result: RecordResult) -> Drawn | None:
    best = leading(result)
    if best is None:
        return None
    prior, posterior = _labelled(result, best)
    description = f"Posterior of {best.law.name}; median and 90 per cent interval: {_describe_intervals(posterior)}."
    return Drawn(corner(posterior, prior), f"{result.title}: posterior of {best.law.name}", description)


def _draw_prior_posterior(result: RecordResult) -> Drawn | None:
    best = leading(result)
    if best is None:
        return None
    prior, posterior = _labelled(result, best)
    description = f"{best.law.name}. Prior: {_describe_intervals(prior)}. Posterior: {_describe_intervals(posterior)}."
    figure = prior_posterior(prior, posterior)
    return Drawn(figure, f"{result.title}: prior and posterior of {best.law.name}", description)


def _draw_priors(result: RecordResult) -> Drawn | None:
    table = tables.tabulate_posteriors(result)
    table = table[table["median"].notna()] if not table.empty else table
    if table.empty:
        return None
    description = (
        f"90 per cent intervals of prior and posterior of {len(table)} parameters of {table['law'].nunique()} laws, "
        "each relative to its posterior median; the numbers are in the table of posteriors."
    )
    return Drawn(prior_posterior_summary(table), f"{result.title}: prior and posterior of every law", description)


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


def _draw_convergence(result: RecordResult) -> Drawn | None:
    table = tables.tabulate_convergence(result)
    if table.empty:
        return None
    limits = Settings()
    description = (
        f"R-hat up to {table['r_hat'].max():.4f}, effective sizes from {table['effective_size'].min():.0f}, chains "
        f"from {table['lengths'].min():.0f} autocorrelation times, over {table['law'].nunique()} laws."
    )
    figure = convergence(table, limits.r_hat, limits.effective_size, limits.lengths)
    return Drawn(figure, f"{result.title}: convergence", description)


def _draw_design_loads(result: RecordResult) -> Drawn | None:
    if result.bands is None or result.design is None or not np.isfinite(result.design.average.median).any():
        return None
    data, units = result.data, result.mode.units
    tested = pd.DataFrame({"sweep": data.sweeps, "force": data.tested_force, "amplitude": data.tested_amplitude})
    design = forms.tabulate_loads(result.design)
    figure = design_loads(
        forms.tabulate_loads(result.bands),
        forms.tabulate_loads_by_model(result.bands),
        tested,
        design,
        result.bands.level,
        units.force,
        units.length,
        result.bands.limit,
    )
    said = format_joined(
        f"at {format_force_text(force, units.force)} median {number(median)} {units.length} "
        f"({number(low)} to {number(high)}), linear {number(linear)}"
        for force, median, low, high, linear in design[["force", "median", "low", "high", "linear"]].to_numpy()
    )
    low, high = data.tested_force.min(), data.tested_force.max()
    description = (
        f"Tested from {number(low)} to {number(high)} {units.force}; beyond that extrapolated. "
        f"Resonant amplitude with its {100 * result.bands.level:g} per cent predictive interval: {said}."
    )
    return Drawn(figure, f"{result.title}: resonant amplitude against force", description)
