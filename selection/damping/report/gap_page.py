"""The page of a gap diagnosis: its tables and figures, and their data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.special import ndtri

from damping import report as words
from damping.arrays import RAD_S_PER_HZ, FloatArray, IntArray, wrap_lag
from damping.effects.contract import Terms
from damping.gap.corrected import EffectPosterior, describe_effects, refitted_values
from damping.gap.diagnose import Diagnosis
from damping.gap.directed import free_form
from damping.gap.fit import ModelFit
from damping.gap.model import Model, deviated, steady
from damping.gap.rows import PhasorRows
from damping.gap.size import HeldOutFold, fitted_terms, nominal_residuals, refitted, regular_values
from damping.gap.where import by_quantity, footprint, trace_local
from damping.records.mode import Units
from damping.records.text import Disagreement
from damping.report.gap import (
    MOST_BARS,
    count_digits,
    describe_diagnosis,
    list_sentences,
    name_parameter,
    order_cautions,
    tabulate_hypotheses,
)
from damping.report.page import FigureBlock, Footer, Table, render_page, write_sections

if TYPE_CHECKING:
    from damping.plots import Drawn

_MOST_CELLS = 12  #: cells of a table
_POINTS = 160  #: points of a curve between the ends of a sweep
_FOLDED = 3  #: crossings of the resonance, along the rows of a sweep up and down, from which they are two branches


def render_gap_page(
    diagnosis: Diagnosis, posterior: EffectPosterior | None, against: Disagreement, footer: Footer
) -> str:
    """The page as HTML; ``against``: where the ranked laws disagree. Equal arguments give equal text."""
    model = diagnosis.leading.best.model
    rows = model.problem.rows
    first, cautions = order_cautions(against, diagnosis.cautions)
    values = {
        **vars(diagnosis),
        "first": first,
        "effects": model.parts,
        "disputed": against.on_loads,
        "cautions": cautions,
        "sentences": describe_diagnosis(diagnosis),
        "failure": posterior.chains.failure if posterior and not posterior.chains.converged else "",
        "rows": rows,
        "sd_amplitude": np.median(rows.sd_amplitude),
        "sd_phase": np.median(rows.sd_phase),
        "scatter": model.scatter,
    }
    drawn = gap_figures(diagnosis).items()
    figures = {name: FigureBlock(figure.to_svg(f"gap-{name}"), figure.caption) for name, figure in drawn}
    parts = {**figures, **_build_tables(diagnosis, posterior)}
    sections = write_sections(Path(__file__).with_name("gap_page.txt"), values, parts)
    return render_page(f"Gap diagnosis: {diagnosis.mode.name}", sections, footer)


def _build_tables(diagnosis: Diagnosis, posterior: EffectPosterior | None) -> dict[str, Table]:
    """Tables by name; their captions are in the text."""
    explanations = tabulate_hypotheses(diagnosis).drop(columns="listed")
    tables = {
        "cells": _tabulate_cells(diagnosis.where),
        "explanations": Table(explanations, {"probability": words.format_share}),
        "parameters": Table(_tabulate_parameters(diagnosis)),
        "tests": replace(_tabulate(diagnosis.tests), headings={"gain": "chi-square", "freedom": "degrees of freedom"}),
    }
    if diagnosis.footprint:
        tables["marks"] = _tabulate_cells(diagnosis.footprint)
    if posterior is not None:
        tables["posterior"] = Table(tabulate_posterior(posterior, diagnosis.units))
    if diagnosis.held_out is not None:
        tables["levels"] = Table(_tabulate_folds(diagnosis.held_out.folds))
    if diagnosis.next_tests:
        candidates = _tabulate(diagnosis.next_tests).frame  # the text above says how to run the first
        tables["candidates"] = Table(candidates[["what", "why", "expected_log_odds", "probability"]])
    return tables


def _tabulate(rows: Sequence[Any]) -> Table:
    return Table(pd.DataFrame([asdict(row) for row in rows]))


def _tabulate_cells(cells: Sequence[Any]) -> Table:
    """The first cells, their frequencies in the five digits of the sentences."""
    headings = {"frequency_low": "from, Hz", "frequency_high": "to, Hz", "size": "size, sigma"}
    formats = dict.fromkeys(("frequency_low", "frequency_high"), partial(words.number, digits=5))
    return replace(_tabulate(cells[:_MOST_CELLS]), headings=headings, formats=formats)


def _tabulate_parameters(diagnosis: Diagnosis) -> pd.DataFrame:
    leading = diagnosis.leading.best
    rows = [
        (effect, label, value, unit)
        for effect, values in {**describe_effects(leading)[0], "simulation": refitted_values(leading)}.items()
        for name, value in values.items()
        if name != "instead"  # the verdict names the replaced force
        for label, unit in [name_parameter(effect, name, diagnosis.units)]
    ]
    return pd.DataFrame(rows, columns=["of", "parameter", "value", "unit"])


def tabulate_posterior(posterior: EffectPosterior, units: Units) -> pd.DataFrame:
    """Medians and intervals, each row with enough digits to separate its three numbers."""
    rows = []
    for full, quantiles in zip(
        posterior.names, np.percentile(posterior.draws, (5.0, 50.0, 95.0), axis=0).T, strict=True
    ):
        effect, _, name = full.partition(": ")
        label, unit = name_parameter(effect, name, units)
        low, median, high = map(float, quantiles)
        digits = count_digits(median, low, high)
        rows.append((f"{effect}: {label}", *(words.number(value, digits) for value in (low, median, high)), unit))
    return pd.DataFrame(rows, columns=["parameter", "5 %", "median", "95 %", "unit"])


def _tabulate_folds(folds: Sequence[HeldOutFold]) -> pd.DataFrame:
    return pd.DataFrame(
        {"held out": ", ".join(fold.sweeps), "chosen without it": " + ".join(fold.effects) or "no effect"}
        | {name: (getattr(fold, name) / fold.count) ** 0.5 for name in ("nominal", "before", "after")}
        for fold in folds
    )


def gap_figures(diagnosis: Diagnosis) -> dict[str, Drawn]:
    """Figures by name; maps over frequency only of sweeps, the footprint only where there is an explanation."""
    from damping.plots import Drawn, gap  # noqa: PLC0415 - matplotlib, which the sentences do not need

    leading, units = diagnosis.leading.best, diagnosis.units
    rows = leading.model.problem.rows
    factor, length = words.choose_length(units.length, rows.A.max())
    scale = {"amplitude": lambda table: factor * table["amplitude"]}
    measured = _tabulate_measured(leading).assign(**scale)
    if rows.at_resonance:
        overlay = gap.gap_resonances(measured, _tabulate_resonance(leading).assign(**scale), units.force, length)
    else:
        overlay = gap.gap_overlay(measured, _tabulate_predicted(leading).assign(**scale), length)
    figures = {"overlay": overlay}
    if not rows.at_resonance:  # of resonances alone the tables say more
        residuals = by_quantity(rows, nominal_residuals(leading))
        figures["residuals"] = gap.gap_map(_map(rows, residuals), "residual (sigma)")
    if leading.model.parts and not rows.at_resonance:
        figures["footprint"] = gap.gap_map(_map(rows, footprint(leading)), "change (sigma)")
    if len(diagnosis.hypotheses) > 1:
        figures["probabilities"] = gap.gap_probabilities(tabulate_hypotheses(diagnosis).head(MOST_BARS))
    if diagnosis.local:
        estimates = pd.DataFrame([vars(estimate) for estimate in diagnosis.local]).assign(**scale)
        figures["local"] = gap.gap_local(estimates, _tabulate_local_curves(leading, rows).assign(**scale), length)
    sections = write_sections(Path(__file__).with_name("gap_figures.txt"), {})
    described = {section.id: (section.title, *list_sentences(section.blocks[0])) for section in sections}
    suffix = "-at-resonance" if rows.at_resonance else ""
    return {name: Drawn(figure, *described.get(f"{name}{suffix}", described[name])) for name, figure in figures.items()}


def _list_models(leading: ModelFit, terms_of: Callable[[ModelFit], Terms]) -> dict[str, Terms]:
    """The simulation as given, refitted, and with the explanation where there is one."""
    nominal = Model(leading.model.problem, (), leading.model.scatter)
    given = nominal.terms(np.zeros((1, nominal.size)))
    models = {"nominal": given, "refitted": terms_of(refitted(leading))}
    return models | ({"explained": terms_of(leading)} if leading.model.parts else {})


def _tabulate_resonance(leading: ModelFit) -> pd.DataFrame:
    """Amplitude at phase resonance over force of each model: ``model, force, amplitude``."""
    rows = leading.model.problem.rows
    order = np.argsort(rows.F)
    F = np.linspace(0.9 * rows.F.min(), 1.1 * rows.F.max(), _POINTS)
    filled = {name: np.interp(F, rows.F[order], getattr(rows, name)[order]) for name in ("omega", "u", "mass")}
    nearest = np.argmin(np.abs(rows.F[:, np.newaxis] - F), axis=0)
    dense = rows.take_rows(nearest, F=F, sweep=np.zeros(_POINTS, dtype=np.int64), **filled)
    tables = []
    for name, terms in _list_models(leading, lambda fit: fitted_terms(fit, deviations=False)).items():
        flat = terms._replace(gain=np.ravel(terms.gain)[:1], omega_n=np.ravel(terms.omega_n)[:1])
        A = np.exp(steady(flat, dense, dense.u).u)
        tables.append(pd.DataFrame({"model": name, "force": F, "amplitude": A}))
    return pd.concat(tables, ignore_index=True)


def _locate(rows: PhasorRows) -> dict[str, Any]:
    return {"sweep": [rows.sweeps[k] for k in rows.sweep], "frequency": rows.omega / RAD_S_PER_HZ}


def _tabulate_measured(leading: ModelFit) -> pd.DataFrame:
    """Measured rows: ``sweep, frequency, force, amplitude, sd`` (relative)``, phase, outlier`` (not fitted)."""
    rows = leading.model.problem.rows
    outlier = ~np.all(regular_values(leading).reshape(-1, len(rows)), axis=0)
    phase = rows.phase if rows.has_phase else np.nan
    measured = {"force": rows.F, "amplitude": rows.A, "sd": rows.sd_amplitude, "phase": phase, "outlier": outlier}
    return pd.DataFrame({**_locate(rows), **measured})


def _tabulate_predicted(leading: ModelFit) -> pd.DataFrame:
    """Curves of each model through every sweep: ``sweep, frequency, model, amplitude, phase``."""
    dense = _dense(leading.model.problem.rows)
    ends = np.arange(_POINTS, len(dense), _POINTS) - 1
    ends = ends[dense.sweep[ends] == dense.sweep[ends + 1]]  # no line leads from one branch of a sweep to the other
    tables = []

    def find_terms(fit: ModelFit) -> Terms:  # with each sweep's own deviation
        own = fit.model.terms(fit.y[np.newaxis, : fit.model.size])
        return deviated(own, dense, fit.y[np.newaxis, fit.model.size :], fit.model.scatter)

    for name, terms in _list_models(leading, find_terms).items():
        motion = steady(terms, dense, dense.u)
        motions = {"amplitude": np.exp(motion.u), "phase": wrap_lag(motion.phase)}
        tables.append(pd.DataFrame({**_locate(dense), "model": name, **motions}))
        tables[-1].loc[ends, list(motions)] = np.nan
    return pd.concat(tables, ignore_index=True)


def _dense(rows: PhasorRows) -> PhasorRows:
    """Rows on a fine grid of frequencies in every branch of every sweep, force and amplitude interpolated."""
    parts = []
    for own in (branch for run in rows.runs for branch in split_branches(rows, run)):
        grid = np.linspace(rows.omega[own[0]], rows.omega[own[-1]], _POINTS)
        nearest = own[np.argmin(np.abs(rows.omega[own][:, np.newaxis] - grid), axis=0)]
        filled = {name: np.interp(grid, rows.omega[own], getattr(rows, name)[own]) for name in ("F", "u", "mass")}
        parts.append((nearest, filled | {"omega": grid}))
    joined = {name: np.concatenate([filled[name] for _, filled in parts]) for name in parts[0][1]}
    return rows.take_rows(np.concatenate([nearest for nearest, _ in parts]), **joined)


def split_branches(rows: PhasorRows, run: IntArray) -> list[IntArray]:
    """The rows of a sweep, in two parts where those on either side of its widest gap of phase alternate: a fold."""
    if not rows.has_phase or len(run) < 2 or np.isnan(rows.phase[run]).any():
        return [run]
    ordered = np.sort(rows.phase[run])
    after = rows.phase[run] > ordered[np.argmax(np.diff(ordered))]
    return [run] if np.sum(after[1:] != after[:-1]) < _FOLDED else [run[~after], run[after]]


def _map(rows: PhasorRows, values: dict[str, FloatArray]) -> pd.DataFrame:
    tables = [pd.DataFrame({**_locate(rows), "quantity": name, "value": value}) for name, value in values.items()]
    return pd.concat(tables, ignore_index=True)


def _tabulate_local_curves(leading: ModelFit, rows: PhasorRows) -> pd.DataFrame:
    """Natural frequency and damping ratio of the first plane over amplitude, at resonance."""
    A = np.geomspace(rows.A.min(), rows.A.max(), 80)
    tables = []
    for name, fit in (("refitted", refitted(leading)), ("explained", leading))[: 1 + bool(leading.model.parts)]:
        frequency, damping = trace_local(fit, A)
        tables.append(pd.DataFrame({"model": name, "amplitude": A, "frequency": frequency, "damping": damping}))
    if not rows.at_resonance:
        tables.append(_tabulate_free_curves(leading))
    return pd.concat(tables, ignore_index=True)


def _tabulate_free_curves(leading: ModelFit) -> pd.DataFrame:
    """The curves of free form beside the explanation, with their 90 per cent limits."""
    free = free_form(leading, trace_local)
    curves = {"amplitude": free.A}
    for name in ("frequency", "damping"):
        middle, reach = getattr(free, name), float(ndtri(0.95)) * getattr(free, f"{name}_sd")
        curves |= {name: middle, f"{name}_low": middle - reach, f"{name}_high": middle + reach}
    return pd.DataFrame({"model": "free", **curves})
