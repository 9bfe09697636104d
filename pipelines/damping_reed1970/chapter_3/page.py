"""Chapter III in the report: conditioning (3.1), the mode in two planes, damping factors with all their roots (3.2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.records.runs import find_prominent
from damping.report import NOTHING
from damping_reed1970 import LABELS, ReportPart, chapter_table, write_chapter
from damping_reed1970.chapter_3 import PLANES, figures
from damping_reed1970.chapter_3.planar_posterior import LEVEL, SAMPLED, TAILS, PlanarBand, prior_draws
from damping_reed1970.chapter_3.study import Chapter3
from damping_reed1970.studies import ReportResults

#: Rise of a peak above what is around it, over the largest value: that of a median of draws is rough by less.
_RISE = 0.002


def count_peaks(values: FloatArray | pd.Series[float]) -> int:
    """Number of local peaks."""
    return len(find_prominent(np.asarray(values), _RISE * values.max())[0])


def compare_sines(measured: pd.DataFrame, tail: PlanarBand) -> tuple[float, float]:
    """Mean distance of the printed sines from the fit, before and after the frequency at which the fit reaches 1."""
    fitted = np.sin(tail.phase[0])
    off = np.sin(measured["tail_phase"]) - np.interp(measured["omega"], tail.omega, fitted)
    before = measured["omega"] < tail.omega[fitted.argmax()]
    return float(off[before].mean()), float(off[~before].mean())


def root_mean_square(values: FloatArray | pd.Series[float]) -> float:
    """Root mean square of differences from the measurement."""
    return float(np.sqrt(np.mean(np.square(values))))


def change_by_conditioning(effect: pd.DataFrame) -> tuple[float, float]:
    """Per cent by which all steps together change the amplitude after each (``effect``): largest, and at the peak."""
    first, last = (effect.loc[effect["step"] == s, "amplitude"].to_numpy() for s in effect["step"].iloc[[0, -1]])
    change = 100.0 * np.abs(last / first - 1.0)
    return float(change.max()), float(change[first.argmax()])


#: What ``labels.toml`` calls parameters of a posterior.
POSTERIOR = {"theta": "theta_degrees", "R": "in_phase_in"}


def write_chapter_3(results: ReportResults) -> ReportPart:
    """The page: accelerometers to modal motion, planar coupling fitted, and every damping factor that balances."""
    computed = results.chapter_3
    tables = computed.tables
    fits, branches = tables["planar_fits"], tables["branches"]
    main = fits[(fits["data"] == "A2") & (fits["noise"] == "constant")]
    of_planes = [name for name in map(str, branches) if name.startswith(("pitch", "yaw", "A_"))]
    roots = LABELS["roots"]
    shown = {
        "fits": chapter_table(3, "planar_fits", fit_rows(main)),
        "planar_fits": chapter_table(3, "planar_fits", fit_rows(fits, ["data", "noise"])),
        "posteriors": chapter_table(3, "planar_posteriors", tabulate_posterior_rows(tables["planar_posteriors"])),
        "branches": chapter_table(3, "branches", branches[list(roots)], roots),
        "branches_fitted": chapter_table(3, "branches_fitted", tables["branches_fitted"][list(roots)], roots),
        "branch_energies": chapter_table(3, "branches", branches[["point", "energy_printed", *of_planes]]),
    }
    measured, tail, mode = computed.measured, computed.bands["tail"], computed.bands["A2"]
    yaw = tables["yaw"].drop(columns=["point", "omega"])
    values = {
        "steps": len(computed.steps),
        "change": change_by_conditioning(computed.effect),
        "points": len(measured),
        "peaks": [count_peaks(values) for values in (measured["tail"], tail.amplitude[0])],
        "sines": compare_sines(measured, tail),
        "fit_off": root_mean_square(
            measured["A_2_printed"] - np.interp(measured["omega"], mode.omega, mode.amplitude[0])
        ),
        "yaw_off": [
            f"{root_mean_square(values - yaw['measured']):.2g} in ({str(name).replace(',', ' and')})"
            for name, values in yaw.drop(columns="measured").items()
        ],
        "planes": PLANES,
        "angle": float(np.degrees(PLANES.theta)),
        "level": f"{100 * LEVEL:g}",
        "pair": _describe_with_error,
    }
    headings = {"C_1": "C₁", "mean_xi": "mean ξ", "says": "in words"}
    figures = collect_figures(computed)
    return write_chapter(
        3, results.tables, values=values, figures=figures, shown=shown, tables=tables, headings=headings
    )


def collect_figures(computed: Chapter3) -> dict[str, Callable[[], Figure]]:
    """How each figure of the chapter is drawn, by name."""
    measured, corrected, curves = computed.measured, computed.corrected, computed.curves
    tail, mode, branches = computed.bands["tail"], computed.bands["A2"], computed.tables["branches"]
    main = computed.posteriors[SAMPLED[0]]
    xi = np.quantile(main.parameters["xi"], TAILS).tolist()
    return {
        "tail-displacement": lambda: figures.draw_tail_displacement(measured, tail),
        "tail-phase-sine": lambda: figures.draw_tail_phase_sine(measured, tail),
        "phase-angles": lambda: figures.draw_phase_angles(measured, mode),
        "modal-amplitude": lambda: figures.draw_modal_amplitude(measured, mode),
        "input-energy": lambda: figures.draw_input_energy(measured, corrected, curves),
        "principal-amplitudes": lambda: figures.draw_principal_amplitudes(measured, corrected, curves),
        "conditioning-effect": lambda: figures.draw_conditioning_effect(computed.effect, computed.tables["removed"]),
        "planar-fit": lambda: figures.draw_planar_overlay(measured, mode, curves),
        "planar-posterior": lambda: figures.draw_planar_posterior(main.parameters, prior_draws(main)),
        "damping-roots": lambda: figures.draw_damping_roots(branches, xi),
        "yaw-amplitude": lambda: figures.draw_yaw_amplitude(computed.tables["yaw"]),
    }


def fit_rows(fits: pd.DataFrame, head: list[str] | None = None) -> pd.DataFrame:
    """One row per fit: parameters with standard errors as text, those held without."""
    columns: dict[str, object] = {name: fits[name] for name in [*(head or []), "fit"]}
    for name, (label, digits) in LABELS["fitted"].items():
        columns[label] = [_describe_with_error(fit, name, digits) for _, fit in fits.iterrows()]
    columns["residual, in"] = fits["sigma"]
    columns["chi-square"] = fits["chi_square"]
    columns["p-value"] = fits["p_value_correlated"]
    return pd.DataFrame(columns)


def tabulate_posterior_rows(posteriors: pd.DataFrame) -> pd.DataFrame:
    """One row per sampled posterior, each parameter as median and interval."""
    rows = []
    for data, fit in SAMPLED:
        texts = {"data": data, "fit": fit}
        chosen = posteriors[(posteriors["data"] == data) & (posteriors["fit"] == fit)]
        for name, *numbers in chosen[["parameter", "median", "low", "high"]].itertuples(index=False):
            label, digits = LABELS["fitted"].get(POSTERIOR.get(name, name), ("", 0))
            if label:
                median, low, high = (f"{value:.{digits}f}".replace("-", "−") for value in numbers)
                texts[label] = f"{median} ({low} to {high})"
        rows.append(texts)
    return pd.DataFrame(rows).fillna("")[
        ["data", "fit", *(label for label, _ in LABELS["fitted"].values() if label != "lag, rad")]
    ]


def _describe_with_error(fit: pd.Series[Any], name: str, digits: int) -> str:
    """``11.393 ± 0.004``; a value that is held alone, nothing for a part that is not there."""
    value, error = float(fit[name]), float(fit[f"{name}_se"])
    if np.isnan(value) or (value == 0.0 and error == 0.0):
        return NOTHING
    text = f"{value:.{digits}f}".replace("-", "−")
    return text if error == 0.0 else f"{text} ± {error:.{digits}f}"
