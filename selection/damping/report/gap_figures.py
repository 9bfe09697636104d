"""The figures of a gap diagnosis, each with its title and its description in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.special import ndtri

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.effects.contract import Drive, Terms
from damping.effects.terms import complex_stiffness
from damping.gap.diagnose import Diagnosis
from damping.gap.directed import free_form
from damping.gap.fit import ModelFit
from damping.gap.model import Model, deviated, steady
from damping.gap.rows import Rows
from damping.gap.size import fitted_terms, nominal_residuals, refitted, regular_values
from damping.gap.where import LocalEstimate, by_quantity, footprint
from damping.plots import Drawn
from damping.plots.gap import gap_local, gap_map, gap_overlay, gap_probabilities, gap_resonances

#: Points of a curve between the ends of a sweep.
_POINTS = 160
#: Explanations drawn.
_MOST_BARS = 8
NO_EFFECT = "no effect"


def gap_figures(diagnosis: Diagnosis) -> dict[str, Drawn]:
    """Figures by name; the footprint only where there is an explanation, local estimates only with phases."""
    leading = diagnosis.leading.best
    rows = leading.model.problem.rows
    figures = {
        "overlay": _resonances(diagnosis) if rows.at_resonance else _sweeps(diagnosis),
        "residuals": Drawn(
            gap_map(_map(rows, by_quantity(rows, nominal_residuals(leading))), "residual (sigma)"),
            "Where the simulation as given misses the test",
            "Residual of amplitude and phase in units of noise, by sweep and frequency.",
        ),
    }
    if leading.model.parts:
        figures["footprint"] = Drawn(
            gap_map(_map(rows, footprint(leading)), "change (sigma)"),
            "Footprint of the explanation",
            "Change of predicted amplitude and phase by the explanation, in units of noise, by sweep and frequency.",
        )
    if len(diagnosis.hypotheses) > 1:
        figures["probabilities"] = Drawn(
            gap_probabilities(tabulate_probability(diagnosis)),
            "Probabilities of the explanations",
            "Bars of the most probable explanations; those that together reach 0.95 stand out.",
        )
    if diagnosis.local:
        figures["local"] = Drawn(
            gap_local(
                tabulate_local(diagnosis.local), _tabulate_local_curves(leading, rows), diagnosis.mode.units.length
            ),
            "Local natural frequency and damping",
            "Natural frequency and damping ratio that each band of amplitude of each sweep gives by itself (bars of "
            "one standard error), with the refitted simulation, the explanation, and what a curve of free form would "
            "add to the explanation (90 per cent band).",
        )
    return figures


def _sweeps(diagnosis: Diagnosis) -> Drawn:
    leading = diagnosis.leading.best
    return Drawn(
        gap_overlay(tabulate_measured(leading), tabulate_predicted(leading), diagnosis.mode.units.length),
        "Measured and simulated sweeps",
        "Amplitude and phase of every sweep over frequency: measured points; curves of the simulation as given, "
        "refitted within its tolerance, and with the leading explanation.",
    )


def _resonances(diagnosis: Diagnosis) -> Drawn:
    leading, units = diagnosis.leading.best, diagnosis.mode.units
    rows = leading.model.problem.rows
    measured = pd.DataFrame(
        {"sweep": [rows.sweeps[k] for k in rows.sweep], "force": rows.F, "amplitude": rows.A, "sd": rows.sd_amplitude}
    )
    return Drawn(
        gap_resonances(measured, tabulate_resonance(leading), units.force, units.length),
        "Measured and simulated resonances",
        "Amplitude at phase resonance over force: measured points with their standard uncertainty; curves of the "
        "simulation as given, refitted within its tolerance, and with the leading explanation.",
    )


def tabulate_resonance(leading: ModelFit) -> pd.DataFrame:
    """Amplitude at phase resonance over force, simulated as given, refitted and explained: ``model, force, ...``."""
    rows = leading.model.problem.rows
    order = np.argsort(rows.F)
    F = np.linspace(0.9 * rows.F.min(), 1.1 * rows.F.max(), _POINTS)
    filled = {name: np.interp(F, rows.F[order], getattr(rows, name)[order]) for name in ("omega", "u", "mass")}
    nearest = np.argmin(np.abs(rows.F[:, np.newaxis] - F), axis=0)
    dense = rows.taken(nearest, F=F, sweep=np.zeros(_POINTS, dtype=np.int64), **filled)
    nominal = Model(leading.model.problem, (), leading.model.scatter)
    models = {
        "nominal": nominal.terms(np.zeros((1, nominal.size))),
        "refitted": fitted_terms(refitted(leading), deviations=False),
        "explained": fitted_terms(leading, deviations=False),
    }
    tables = []
    for name, terms in models.items():
        flat = replace(terms, gain=np.ravel(terms.gain)[:1], omega_n=np.ravel(terms.omega_n)[:1])
        A = np.exp(steady(flat, dense, dense.u).u)
        tables.append(pd.DataFrame({"model": name, "force": F, "amplitude": A}))
    return pd.concat(tables, ignore_index=True)


def tabulate_measured(leading: ModelFit) -> pd.DataFrame:
    """Measured rows: ``sweep, frequency, amplitude, phase, wild``."""
    rows = leading.model.problem.rows
    wild = ~np.all(regular_values(leading).reshape(-1, len(rows)), axis=0)
    return pd.DataFrame(
        {
            "sweep": [rows.sweeps[k] for k in rows.sweep],
            "frequency": rows.omega / RAD_S_PER_HZ,
            "amplitude": rows.A,
            "phase": rows.phase if rows.has_phase else np.nan,
            "wild": wild,
        }
    )


def tabulate_predicted(leading: ModelFit) -> pd.DataFrame:
    """Curves of the simulation as given, refitted, and with the explanation: ``sweep, model, frequency, ...``."""
    problem = leading.model.problem
    dense = _dense(problem.rows)
    again = refitted(leading)
    x = np.zeros((1, len(problem.simulation.names)))
    nominal = Model(problem, (), leading.model.scatter).terms(x)
    models = {
        "nominal": nominal,
        "refitted": _on(again, dense),
        "explained": _on(leading, dense),
    }
    tables = []
    for name, terms in models.items():
        motion = steady(terms, dense, dense.u)
        phase = motion.phase + 2.0 * np.pi * np.round((np.pi / 2.0 - motion.phase) / (2.0 * np.pi))
        tables.append(
            pd.DataFrame(
                {
                    "sweep": [dense.sweeps[k] for k in dense.sweep],
                    "model": name,
                    "frequency": dense.omega / RAD_S_PER_HZ,
                    "amplitude": np.exp(motion.u),
                    "phase": phase,
                }
            )
        )
    return pd.concat(tables, ignore_index=True)


def tabulate_probability(diagnosis: Diagnosis) -> pd.DataFrame:
    """The most probable explanations: ``explanation, probability, listed``."""
    shown = diagnosis.hypotheses[:_MOST_BARS]
    return pd.DataFrame(
        {
            "explanation": [" + ".join(hypothesis.effects) or NO_EFFECT for hypothesis in shown],
            "probability": [hypothesis.probability for hypothesis in shown],
            "listed": [hypothesis in diagnosis.explanations for hypothesis in shown],
        }
    )


def tabulate_local(estimates: tuple[LocalEstimate, ...]) -> pd.DataFrame:
    """Local estimates as a table."""
    return pd.DataFrame([vars(estimate) for estimate in estimates])


def _on(fit: ModelFit, rows: Rows) -> Terms:
    """Terms of a fit on other rows of the same sweeps, with each sweep's own deviation."""
    k = fit.model.size
    return deviated(fit.model.terms(fit.y[np.newaxis, :k]), rows, fit.y[np.newaxis, k:], fit.model.scatter)


def _dense(rows: Rows) -> Rows:
    """Rows on a fine grid of frequencies in every sweep, force and amplitude interpolated."""
    parts = []
    for number in range(len(rows.sweeps)):
        own = np.flatnonzero(rows.sweep == number)
        grid = np.linspace(rows.omega[own[0]], rows.omega[own[-1]], _POINTS)
        nearest = own[np.argmin(np.abs(rows.omega[own][:, np.newaxis] - grid), axis=0)]
        filled = {name: np.interp(grid, rows.omega[own], getattr(rows, name)[own]) for name in ("F", "u", "mass")}
        parts.append((nearest, filled | {"omega": grid}))
    joined = {name: np.concatenate([filled[name] for _, filled in parts]) for name in parts[0][1]}
    return rows.taken(np.concatenate([nearest for nearest, _ in parts]), **joined)


def _map(rows: Rows, values: dict[str, FloatArray]) -> pd.DataFrame:
    tables = [
        pd.DataFrame(
            {
                "sweep": [rows.sweeps[k] for k in rows.sweep],
                "frequency": rows.omega / RAD_S_PER_HZ,
                "quantity": quantity,
                "value": value,
            }
        )
        for quantity, value in values.items()
    ]
    return pd.concat(tables, ignore_index=True)


def _tabulate_local_curves(leading: ModelFit, rows: Rows) -> pd.DataFrame:
    """Natural frequency and damping ratio of the first plane over amplitude, at resonance."""
    A = np.geomspace(rows.A.min(), rows.A.max(), 80)
    tables = []
    for name, fit in (("refitted", refitted(leading)), ("explained", leading)):
        terms = fitted_terms(fit, deviations=False)
        M, omega_n = float(np.ravel(terms.M)[0]), float(np.ravel(terms.omega_n)[0])
        drive = Drive(np.ones(80), np.full(80, omega_n))
        Z = complex_stiffness(replace(terms, M=M, omega_n=omega_n, beside=(), damped=()), A, drive)[0][0]
        frequency = np.sqrt(np.maximum(Z.real / M + omega_n**2, 0.0)) / RAD_S_PER_HZ
        damping = Z.imag / (2.0 * M * omega_n**2)
        tables.append(pd.DataFrame({"model": name, "amplitude": A, "frequency": frequency, "damping": damping}))
    if not rows.at_resonance:
        tables.append(_tabulate_free_curves(leading, tables[-1]))
    return pd.concat(tables, ignore_index=True)


def _tabulate_free_curves(leading: ModelFit, explained: pd.DataFrame) -> pd.DataFrame:
    """The explanation with the curves of free form that it lacks, and their 90 per cent limits."""
    free = free_form(leading)
    f, xi = (np.interp(free.A, explained["amplitude"], explained[name]) for name in ("frequency", "damping"))
    reach = float(ndtri(0.95))
    return pd.DataFrame(
        {
            "model": "free",
            "amplitude": free.A,
            "frequency": f * (1.0 + free.frequency),
            "frequency_low": f * (1.0 + free.frequency - reach * free.frequency_sd),
            "frequency_high": f * (1.0 + free.frequency + reach * free.frequency_sd),
            "damping": xi + free.damping,
            "damping_low": xi + free.damping - reach * free.damping_sd,
            "damping_high": xi + free.damping + reach * free.damping_sd,
        }
    )
