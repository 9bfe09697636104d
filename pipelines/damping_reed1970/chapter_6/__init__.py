"""Section 6.1 complete: every printed damping force beside ours, and whether each reproduces the tests.

Three versions of each law: ``printed``; ``recomputed``, the report's own method on the corrected tables; ``ours``, the
fit of the ranking with its 90 % credible intervals.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import cast

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.forces import component, energy_per_cycle, make
from damping.forces.contract import Sum
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.plots import AVERAGE, INK, LINEAR, MUTED, build_panel, draw_plain_rows, styled
from damping.predict.steady import resonant_amplitude
from damping.ranking import Candidate, Ranking, rank_laws
from damping.regression.fit import Form
from damping.report import format_between, number
from damping.report.page import Table
from damping_reed1970 import LABELS, ReportPart, chapter_3, chapter_4, load_force_laws, load_table, write_chapter
from damping_reed1970.chapter_4.lines import IV, coefficients_against_amplitude, fit_mode, report_method
from damping_reed1970.chapter_5 import E_1, E_2, E_3, E_4, TERM_CASES, EnergyFit, table_5_i
from damping_reed1970.studies import ReportResults

VERSIONS = ("printed", "recomputed", "ours")
#: Largest error of amplitude, per cent, with which a law is said to reproduce the tests: repeat tests of one level
#: differ by several per cent.
REPRODUCES = 5.0


@dataclass(frozen=True)
class PrintedLaw:
    """One law of section 6.1: ``forces`` in order with ``parameters`` by (force, parameter)."""

    configuration: str
    mode: int
    equation: str
    erratum: str
    forces: tuple[str, ...]
    parameters: Mapping[tuple[str, str], float]

    @property
    def head(self) -> dict[str, str | int]:
        """Which law it is, as columns."""
        return {"configuration": self.configuration, "mode": self.mode, "equation": self.equation}

    @property
    def record(self) -> str:
        """The record that the law is of; section 5.3 uses the rough data in 5.3.10 and 5.3.11 only."""
        if self.configuration == "II":
            return f"config-2-mode-{self.mode}"
        return "config-1-mode-2-" + ("rough" if self.equation in ("5.3.10", "5.3.11") else "pitch")

    @property
    def force(self) -> Sum:
        """The damping force."""
        parts = [{name: v for (f, name), v in self.parameters.items() if f == force} for force in self.forces]
        return Sum(tuple(make(force, **part) for force, part in zip(self.forces, parts, strict=True)))


def printed_laws() -> list[PrintedLaw]:
    """The laws of section 6.1 in its order."""
    laws = []
    for _, rows in load_force_laws().groupby(["configuration", "mode", "equation"], sort=False):
        configuration, mode, equation, erratum = rows[["configuration", "mode", "equation", "erratum"]].iloc[0]
        parameters = {
            (str(row["force"]), name): float(row[name])
            for row in rows.to_dict("records")
            for name in ("coefficient", "exponent")
            if np.isfinite(row[name])
        }
        laws.append(PrintedLaw(configuration, int(mode), equation, erratum, tuple(rows["force"]), parameters))
    return laws


def recompute(law: PrintedLaw) -> PrintedLaw:
    """The law by the report's own method from the corrected tables."""
    parameters = [float(value) for value in _recompute_parameters(law)]
    return replace(law, parameters=dict(zip(law.parameters, parameters, strict=True)))


def build_median_force(candidate: Candidate) -> Sum:
    """The force of a ranked law at the posterior medians that the table shows."""
    shapes: dict[str, dict[str, float]] = {}
    for c in candidate.coefficients:
        shapes.setdefault(c.force, {})[c.shape] = c.value
    parts = [(component(name), values) for name, values in shapes.items()]
    return Sum(tuple(part.build(values[""], **{k: v for k, v in values.items() if k}) for part, values in parts))


def section_6_1(rankings: Mapping[str, Ranking]) -> pd.DataFrame:
    """One row per law and parameter: printed, recomputed, ours with 90 % interval, and how each does in the test.

    ``*_percent_A`` and so on: error of resonant amplitude at each sweep of Configuration II, 100 (law/test - 1).
    ``*_percent_energy``: mean absolute error of energy per cycle over the points of Configuration I.
    ``*_reproduces``: all amplitudes within ``REPRODUCES`` per cent; of Configuration I the resonant one.
    """
    errors = section_6_1_errors(rankings)
    return pd.concat([_tabulate_rows(law, rankings, errors) for law in printed_laws()], ignore_index=True)


def section_6_1_errors(rankings: Mapping[str, Ranking]) -> pd.DataFrame:
    """One row per law, version and test point: percent error of resonant amplitude, or of energy per cycle."""
    parts = []
    for law in printed_laws():
        ranking = rankings[law.record]
        ours = build_median_force(_find(law, ranking))
        forces = {"printed": law.force, "recomputed": recompute(law).force, "ours": ours}
        parts += [_tabulate_errors(law, version, force, ranking.data) for version, force in forces.items()]
    return pd.concat(parts, ignore_index=True)


def _tabulate_errors(law: PrintedLaw, version: str, force: Sum, data: Observations) -> pd.DataFrame:
    """Error of resonant amplitude at each sweep's tested force; in configuration I of energy per cycle at each row."""
    A = resonant_amplitude(force, data.tested_force, data.tested_omega)
    quantities = {"resonant amplitude": (data.sweeps, 100.0 * (A / data.tested_amplitude - 1.0))}
    if law.configuration == "I":
        energy = energy_per_cycle(force, data.A, data.omega) / (np.pi * data.A * data.D)
        points = tuple(str(k + 1) for k in range(len(data.A)))
        quantities["energy per cycle"] = (points, np.asarray(100.0 * (energy - 1.0)))
    head = {**law.head, "version": version, "record": law.record}
    parts = [
        pd.DataFrame({**head, "quantity": quantity, "at": at, "percent_error": errors})
        for quantity, (at, errors) in quantities.items()
    ]
    return pd.concat(parts, ignore_index=True)


def _tabulate_rows(law: PrintedLaw, rankings: Mapping[str, Ranking], errors: pd.DataFrame) -> pd.DataFrame:
    fitted = {(c.force, c.shape or "coefficient"): c for c in _find(law, rankings[law.record]).coefficients}
    again = recompute(law).parameters
    own_errors = errors[(errors["equation"] == law.equation) & (errors["mode"] == law.mode)]
    summary = _summarise_errors(law, own_errors)
    rows = [
        {
            **law.head,
            "law": " + ".join(law.forces),
            "force": force,
            "parameter": parameter,
            "unit": LABELS["units"][force] if parameter == "coefficient" else "",
            "printed": value,
            "recomputed": again[force, parameter],
            "ours": own.value,
            **{name: getattr(own, name) for name in ("std_error", "low", "high")},
            "printed_in_interval": bool(own.low <= value <= own.high),
            "record": law.record,
            "erratum": law.erratum,
            **summary,
        }
        for (force, parameter), value in law.parameters.items()
        for own in [fitted[force, parameter]]
    ]
    return pd.DataFrame(rows)


def _summarise_errors(law: PrintedLaw, errors: pd.DataFrame) -> dict[str, float | bool]:
    """Columns that say how each version does in the test."""
    summary: dict[str, float | bool] = {f"{v}_percent_{sweep}": np.nan for v, sweep in product(VERSIONS, "ABC")}
    for version in VERSIONS:
        own = errors[errors["version"] == version]
        amplitude = own[own["quantity"] == "resonant amplitude"].set_index("at")["percent_error"]
        if law.configuration == "II":
            summary |= {f"{version}_percent_{sweep}": float(amplitude[sweep]) for sweep in "ABC"}
        energy = own.loc[own["quantity"] == "energy per cycle", "percent_error"].abs()
        summary[f"{version}_percent_resonance"] = float(amplitude.abs().max())
        summary[f"{version}_percent_energy"] = float(energy.mean()) if len(energy) else np.nan
        summary[f"{version}_reproduces"] = bool((amplitude.abs() <= REPRODUCES).all())
    return summary


def _find(law: PrintedLaw, ranking: Ranking) -> Candidate:
    """The row of the law in the ranking, or its own where another that predicts the same stands for it."""
    candidate = ranking.find(Law(law.forces))
    if set(candidate.law.components) == set(law.forces):
        return candidate
    return rank_laws(ranking.data, laws=[Law(law.forces)], hold_out=False).candidates[0]


def _recompute_parameters(law: PrintedLaw) -> FloatArray:
    """Parameters by the report's method, in the order of ``law.parameters``."""
    fits: dict[str, EnergyFit] = {"5.3.10": E_1, "5.3.11": E_2, "5.3.16": E_3, "5.3.17": E_4}
    match law.equation:
        case "3.2.19":
            return np.array([chapter_3.equation_3_2_18(load_table("3_IV", "corrected"))["eq3218.C1"]])
        case "4.1.8":
            return np.array([coefficients_against_amplitude(law.mode, "corrected")[1].mean()])
        case "4.1.14" | "4.1.15":
            points = coefficients_against_amplitude(law.mode, "corrected")
            return np.array([1.0, IV.factor]) * report_method(IV, *points)
        case "4.2.11":
            return np.full(2, chapter_4.equation_4_2_11()["eq4211.c1"])
        case "4.3.14" | "4.3.16" | "4.3.23" | "4.3.24":
            line = fit_mode(law.mode, cast(Form, law.forces[0]), "corrected")
            return np.array([line.alpha, line.p])
    refitted = fits[law.equation].coefficients("corrected")
    return np.array([table_5_i(TERM_CASES[term], a) for term, a in refitted.items()])


def write_chapter_6(results: ReportResults) -> ReportPart:
    """The page: the summary of section 6.1."""
    laws, errors = results.tables["section_6_1"], results.tables["section_6_1_errors"]
    shown = {"laws": Table(tabulate_law_rows(laws), key="section_6_1")}
    figures = {"section-6-1": lambda: draw_force_laws(errors)}
    return write_chapter(
        6, results.tables, values={"limit": f"{REPRODUCES:g}"}, figures=figures, shown=shown, tables={}
    )


def tabulate_law_rows(laws: pd.DataFrame) -> pd.DataFrame:
    """What the page shows of section 6.1: one row per law and parameter."""
    reproduces = laws[[f"{version}_reproduces" for version in VERSIONS]].to_numpy(bool)
    columns = ["configuration", "equation", "force", "unit", "printed", "recomputed", "ours", "reproduces", "erratum"]
    ours = laws[["ours", "low", "high"]].to_numpy()
    return laws.assign(
        configuration=laws["configuration"] + ", mode " + laws["mode"].astype(str),
        unit=laws["unit"].mask(laws["parameter"] == "exponent", "exponent"),
        ours=[f"{number(v)} ({format_between(low, high)})" for v, low, high in ours],
        reproduces=[" / ".join(np.where(versions, "yes", "no")) for versions in reproduces],
    )[columns]


@styled
def draw_force_laws(errors: pd.DataFrame) -> Figure:
    """Draw the errors of resonant amplitude of every law of section 6.1: printed, recomputed and ours.

    Args:
        errors: ``configuration, mode, equation, version, quantity, percent_error``, rows of a law together.
    """
    amplitude = errors[errors["quantity"] == "resonant amplitude"]
    laws = list(amplitude[["configuration", "mode", "equation"]].drop_duplicates().itertuples(index=False, name=None))
    figure, axes = build_panel(0.9 + 0.25 * len(laws), "error of resonant amplitude\nat the tested forces (per cent)")
    draw_plain_rows(axes, [f"{equation}  (configuration {c}, mode {m})" for c, m, equation in laws])
    styles = {"printed": (LINEAR, "x"), "recomputed": (MUTED, "o"), "ours": (AVERAGE, "D")}
    axes.axvspan(-REPRODUCES, REPRODUCES, color="#eef1f4", zorder=0, label=f"within {REPRODUCES:g} per cent")
    axes.axvline(0.0, color=INK, linewidth=0.7)
    row = amplitude.groupby(["configuration", "mode", "equation"], sort=False).ngroup()
    for shift, (version, (colour, marker)) in zip((-0.2, 0.0, 0.2), styles.items(), strict=True):
        for place in range(len(laws)):
            errors_of = amplitude.loc[(row == place) & (amplitude["version"] == version), "percent_error"]
            at, label = [place + shift] * len(errors_of), version if place == 0 else None
            axes.plot(errors_of, at, marker, color=colour, markersize=4.5, label=label)
    figure.legend(loc="outside upper right", ncols=4, columnspacing=1.2)
    return figure
