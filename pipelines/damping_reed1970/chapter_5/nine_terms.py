"""Section 5.3: the nine-term polynomial (5.3.6), free and with coefficients >= 0, and how few terms the data carry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.plots import LINEAR, MUTED, WIDTH, plain_log, styled
from damping.regression import parse_term
from damping.regression.design import Columns, Design, design_of
from damping.regression.fit import Fit, fit, one_term_fits
from damping.regression.selecting import fit_nonnegative, stepwise
from damping.regression.subsets import Subsets, all_subsets
from damping_reed1970 import Run, Version, columns, load_table

#: Eq. 5.3.6, in its order.
NINE_TERMS = (
    "A^2*omega", "A^2", "A^3*omega^2", "A^3*omega", "A^4*omega", "A", "A^3", "A^4", "A^2*omega^2",
)  # fmt: skip
#: Models listed of each kind.
BEST = 5
_T_ALWAYS = 1e300  # T-ratio to stop at that drops terms down to the last one


@dataclass(frozen=True)
class Inputs:
    """Data of one study of the nine terms."""

    name: str
    table: str
    amplitude: str
    version: Version
    run: Run = "E4"

    def data(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A, omega, E."""
        A, omega, E = columns(load_table(self.table, self.version, self.run), self.amplitude, "omega_rad_s", "E_in_lb")
        return A, omega, E


#: The rough data (Table 5.III) and the principal pitch data (5.IV), as printed and as the report's runs used them.
INPUTS = (
    Inputs("5.III printed", "5_III", "A2bar_in", "printed"),
    Inputs("5.III recovered", "5_III", "A2bar_in", "used"),
    Inputs("5.IV printed", "5_IV", "A2p_in", "printed"),
    Inputs("5.IV recovered", "5_IV", "A2p_in", "used", "E3"),
)


@dataclass(frozen=True)
class NineTerms:
    """The study on all inputs.

    Attributes:
        full: all nine terms at once, free and >= 0: ``inputs, term, one_term_rank`` (1 most significant alone),
            coefficient, standard error and T-ratio of the free fit, ``nonnegative`` coefficient.
        summary: one row per input: scaled condition number, negative coefficients of the free fit, largest term over
            largest energy (cancellation), R^2 and RMS error of both fits, terms that >= 0 leaves, subsets of 511 with
            all coefficients > 0.
        elimination: terms dropped one after the other by least |T|, down to one, free and >= 0.
        best: the ``BEST`` subsets by BIC, free and with all coefficients > 0.
        by_size: least RMS error of each number of terms, free and > 0 (NaN where none is).
    """

    full: pd.DataFrame
    summary: pd.DataFrame
    elimination: pd.DataFrame
    best: pd.DataFrame
    by_size: pd.DataFrame


def nine_terms(inputs: tuple[Inputs, ...] = INPUTS) -> NineTerms:
    """The nine-term study on each of the inputs."""
    parts: dict[str, list[pd.DataFrame]] = {"full": [], "summary": [], "elimination": [], "best": [], "by_size": []}
    for source in inputs:
        design = nine_term_design(*source.data())
        free, held, subsets = fit(design), fit_nonnegative(design), all_subsets(design)
        positive = subsets.take(((subsets.coefficients > 0.0) == subsets.members).all(axis=1))
        tables = {
            "full": _tabulate_full(design, free, held),
            "summary": _tabulate_summary(design, free, held, len(positive)),
            "elimination": _tabulate_elimination(design),
            "best": pd.concat([_tabulate_best(subsets, "free"), _tabulate_best(positive, "> 0")]),
            "by_size": pd.concat([_tabulate_by_size(subsets, "free"), _tabulate_by_size(positive, "> 0")]),
        }
        for name, table in tables.items():
            table.insert(0, "inputs", source.name)
            parts[name].append(table)
    return NineTerms(**{name: pd.concat(tables, ignore_index=True) for name, tables in parts.items()})


def nine_term_design(A: FloatArray, omega: FloatArray, E: FloatArray) -> Design:
    """The design of Eq. 5.3.6."""
    data = Columns({"A": A, "omega": omega, "E": E}, np.arange(len(E)), ())
    return design_of(data, "E", [parse_term(term) for term in NINE_TERMS])


def _tabulate_full(design: Design, free: Fit, held: Fit) -> pd.DataFrame:
    order = [single.names[0] for single in one_term_fits(design)]
    return pd.DataFrame(
        {
            "term": free.names,
            "one_term_rank": [order.index(name) + 1 for name in free.names],
            "coefficient": free.coefficients,
            "std_error": free.std_errors,
            "t_ratio": free.t_ratios,
            "nonnegative": held.coefficients,
        }
    )


def _tabulate_summary(design: Design, free: Fit, held: Fit, positive: int) -> pd.DataFrame:
    largest = np.abs(design.columns * free.coefficients).max()
    return pd.DataFrame(
        {
            "condition_number": [free.condition_number],
            "negative_coefficients": int((free.coefficients < 0.0).sum()),
            "largest_term_over_energy": float(largest / np.abs(design.observed).max()),
            "r_squared": free.r_squared,
            "rms_error_in_lb": free.rms_error,
            "nonnegative_terms": held.k,
            "nonnegative_r_squared": held.r_squared,
            "nonnegative_rms_error_in_lb": held.rms_error,
            "subsets_all_positive": positive,
        }
    )


def _tabulate_elimination(design: Design) -> pd.DataFrame:
    rows = []
    for kind, fitter in (("free", fit), (">= 0", fit_nonnegative)):
        for step in stepwise(design, "backward", t_stop=_T_ALWAYS, fitter=fitter).steps:
            if step.action == "drop" and np.isnan(step.t_ratio):  # a term that >= 0 holds at 0: the fit stays the same
                continue
            rows.append(
                {
                    "coefficients": kind,
                    "terms_left": step.fit.k,
                    "dropped": step.term,
                    "t_ratio_dropped": step.t_ratio,
                    "negative": int((step.fit.coefficients < 0.0).sum()),
                    "rms_error_in_lb": step.fit.rms_error,
                    "bic": float(step.fit.criteria.bic),
                    "left": ", ".join(np.array(step.fit.names)[step.fit.active]),
                }
            )
    return pd.DataFrame(rows)


def _tabulate_best(models: Subsets, kind: str) -> pd.DataFrame:
    order = np.argsort(models.scores("bic"), kind="stable")[:BEST]
    return pd.DataFrame(
        {
            "coefficients": kind,
            "rank": np.arange(len(order)) + 1,
            "terms": [", ".join(models.label(i)) for i in order],
            "bic": models.scores("bic")[order],
            "rms_error_in_lb": models.rms_errors[order],
            "least_t_ratio": np.nanmin(np.abs(models.t_ratios[order]), axis=1),
            "negative": (models.coefficients[order] < 0.0).sum(axis=1),
            "values": [", ".join(f"{c:.4g}" for c in models.coefficients[i][models.members[i]]) for i in order],
        }
    )


def _tabulate_by_size(models: Subsets, kind: str) -> pd.DataFrame:
    sizes = np.arange(1, len(NINE_TERMS) + 1)
    least = [float(models.rms_errors[models.sizes == size].min(initial=np.inf)) for size in sizes]
    rms = np.where(np.isfinite(least), least, np.nan)
    counts = [int((models.sizes == size).sum()) for size in sizes]
    return pd.DataFrame({"coefficients": kind, "terms": sizes, "models": counts, "rms_error_in_lb": rms})


@styled
def draw_terms_against_error(by_size: pd.DataFrame, elimination: pd.DataFrame, inputs: Sequence[str]) -> Figure:
    """Draw least RMS error against number of terms, free and with coefficients > 0, and the way of elimination.

    Args:
        by_size: ``inputs, coefficients, terms, rms_error_in_lb``. elimination: ``inputs, coefficients, terms_left,
            negative, rms_error_in_lb``. inputs: those drawn, a panel each.
    """
    figure = Figure(figsize=(WIDTH, 2.7 * len(inputs)))
    panels = np.atleast_1d(figure.subplots(len(inputs), sharex=True, sharey=True))
    for axes, name in zip(panels, inputs, strict=True):
        sizes = by_size[by_size["inputs"] == name]
        steps = elimination[(elimination["inputs"] == name) & (elimination["coefficients"] == "free")]
        axes.set_yscale("log")
        for kind, colour, label in (("free", MUTED, "free"), ("> 0", "#009e73", "all > 0")):
            rows = sizes[sizes["coefficients"] == kind]
            axes.plot(rows["terms"], rows["rms_error_in_lb"], "o-", color=colour, label=f"best of its size, {label}")
        axes.plot(
            steps["terms_left"], steps["rms_error_in_lb"], "x", color=LINEAR, markersize=6, label="backward elimination"
        )
        for terms, error, negative in steps[["terms_left", "rms_error_in_lb", "negative"]].itertuples(index=False):
            if negative:
                axes.annotate(
                    f"{negative} < 0", (terms, error), (3, 5), textcoords="offset points", fontsize=6.5, color=LINEAR
                )
        axes.set_title(name)
        axes.set(xticks=range(1, 10), ylabel="rms error of energy (in-lb)")
        plain_log(axes.yaxis)
    panels[-1].set_xlabel("number of terms")
    panels[0].legend(loc="lower left", fontsize=7)
    return figure
