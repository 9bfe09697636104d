"""Chapter III in the report: conditioning (3.1), the mode in two planes, damping factors with all their roots (3.2)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping.report.words import NOTHING, format_between
from damping_reed1970.chapter_3 import PLANES
from damping_reed1970.chapter_3.captions import change_by_conditioning, list_chapter_3_figures
from damping_reed1970.chapter_3.planar_fits import LEVEL, SAMPLED
from damping_reed1970.chapter_3.study import Chapter3
from damping_reed1970.common import Chapter, ReportPart, chapter_table, row, write_chapter
from damping_reed1970.studies import ReportResults

#: Parameters of a fit as the page shows them, with the digits after the point.
SHOWN = {
    "omega_p": ("ω_p, rad/s", 3),
    "omega_y": ("ω_y, rad/s", 3),
    "theta_degrees": ("θ, degrees", 1),
    "M": ("M, lb s²/in", 2),
    "C": ("C, lb s/in", 2),
    "xi": ("ξ", 5),
    "in_phase_in": ("in phase, in", 3),
    "lag_rad": ("lag, rad", 3),
}
#: The same of a posterior.
POSTERIOR = {"theta": "theta_degrees", "R": "in_phase_in"}
#: The fit with the report's angle and mass held.
HELD = "theta = 28, M = 21"
#: The fit with all parameters free.
FREE = "free"
#: Columns of the roots that the page shows, and what they are called.
ROOTS = {
    "point": "point",
    "omega": "ω, rad/s",
    "energy": "energy in, in-lb",
    "largest_energy": "largest that can be lost",
    "roots": "roots",
    "xi_low": "low root ξ",
    "xi_high": "high root ξ",
    "xi_printed": "printed ξ",
    "taken": "taken",
}


def write_chapter_3(results: ReportResults) -> ReportPart:
    """The page: accelerometers to modal motion, planar coupling fitted, and every damping factor that balances."""
    computed = results.chapter_3
    tables, headings = computed.tables, {"C_1": "C₁", "mean_xi": "mean ξ", "says": "in words"}
    fits, branches = tables["planar_fits"], tables["branches"]
    main = fits[(fits["data"] == "A2") & (fits["noise"] == "constant")]
    of_planes = [name for name in map(str, branches) if name.startswith(("pitch", "yaw", "A_"))]
    shown = {name: chapter_table(3, name, frame, headings) for name, frame in tables.items()} | {
        "fits": chapter_table(3, "planar_fits", fit_rows(main)),
        "planar_fits": chapter_table(3, "planar_fits", fit_rows(fits, ["data", "noise"])),
        "posteriors": chapter_table(3, "planar_posteriors", tabulate_posterior_rows(tables["planar_posteriors"])),
        "branches": chapter_table(3, "branches", branches[list(ROOTS)], ROOTS),
        "branches_fitted": chapter_table(3, "branches_fitted", tables["branches_fitted"][list(ROOTS)], ROOTS),
        "branch_energies": chapter_table(3, "branches", branches[["point", "energy_printed", *of_planes]]),
    }
    values = {
        **_collect_conditioning_values(computed),
        **_collect_plane_values(computed),
        **_collect_root_values(computed),
    }
    title = "Chapter III: one mode in two planes"
    chapter = Chapter(3, title, values, list_chapter_3_figures(computed), shown, tables, results.tables)
    return write_chapter(chapter, Path(__file__).with_suffix(".txt"))


def _collect_conditioning_values(computed: Chapter3) -> dict[str, Any]:
    """What the chain gives and takes away."""
    chain = computed.tables["conditioned"]
    largest, at_peak = change_by_conditioning(computed.effect)
    return {
        "steps": len(computed.steps),
        "amplitude_off": 100.0 * (chain["A_2"] / chain["A_2_printed"] - 1.0).abs().max(),
        "phase_off": (chain["phi_2"] - chain["phi_2_printed"]).abs().max(),
        "removed": computed.tables["removed"].drop(columns=["point", "omega"]).sum(axis=1).abs(),
        "largest": largest,
        "at_peak": at_peak,
    }


def _collect_plane_values(computed: Chapter3) -> dict[str, Any]:
    """The report's planes and ours, and what the data say for and against each assumption."""
    fits, posteriors = computed.tables["planar_fits"], computed.tables["planar_posteriors"]
    free, held = (row(fits, data="A2", noise="constant", fit=fit) for fit in (FREE, HELD))
    read = {"omega_p": PLANES.omega_p, "omega_y": PLANES.omega_y}
    factors = computed.tables["planar_evidence"].set_index("fit")["bayes_factor_over_free"]
    angles = [row(posteriors, data=data, fit="free + in phase", parameter="theta") for data in ("A2", "tail")]
    return {
        "planes": PLANES,
        "angle": float(np.degrees(PLANES.theta)),
        "level": f"{100 * LEVEL:g}",
        "pair": _pair,
        "free": free,
        "held": held,
        "errors_off": max(abs(held[name] - value) / held[f"{name}_se"] for name, value in read.items()),
        "theta": row(posteriors, data="A2", fit=FREE, parameter="theta"),
        "factors": factors,
        "held_factor": factors[HELD],
        "phase": row(posteriors, data="A2", fit="free + in phase", parameter="R"),
        "angles": [f"θ {format_between(one['low'], one['high'])}" for one in angles],
    }


def _collect_root_values(computed: Chapter3) -> dict[str, Any]:
    """How many roots there are, which were taken, what other planes give, and what the mean coefficient is worth."""
    branches, fitted, means = (computed.tables[name] for name in ("branches", "branches_fitted", "branch_means"))
    return {
        "branches": branches,
        "two": branches[branches["roots"] == 2],
        "no_root": branches.loc[branches["roots"] == 0, "point"],
        "no_root_fitted": fitted.loc[fitted["roots"] == 0, "point"],
        "taken": {name: branches.loc[branches["taken"] == name, "point"] for name in ("low", "high")},
        "mean_printed": row(means, choice="as printed"),
        "mean_low": row(means, choice="every low root"),
        "mean_high": row(means, choice="every high root (below .05, else low)"),
    }


def fit_rows(fits: pd.DataFrame, head: list[str] | None = None) -> pd.DataFrame:
    """One row per fit: parameters with standard errors as text, those held without."""
    columns: dict[str, object] = {name: fits[name] for name in [*(head or []), "fit"]}
    for name, (label, digits) in SHOWN.items():
        pairs = fits[[name, f"{name}_se"]].to_numpy(float)
        columns[label] = [_describe_with_error(value, error, digits) for value, error in pairs]
    columns["residual, in"] = fits["sigma"]
    columns["chi-square"] = fits["chi_square"]
    columns["p-value"] = fits["p_value_correlated"]
    return pd.DataFrame(columns)


def tabulate_posterior_rows(posteriors: pd.DataFrame) -> pd.DataFrame:
    """One row per sampled posterior, each parameter as median and interval."""
    rows = []
    for data, fit in SAMPLED:
        posterior = posteriors[(posteriors["data"] == data) & (posteriors["fit"] == fit)]
        spoken = {"data": data, "fit": fit}
        for one in posterior.to_dict("records"):
            label, digits = SHOWN.get(POSTERIOR.get(one["parameter"], one["parameter"]), ("", 0))
            if label:
                spoken[label] = (
                    f"{one['median']:.{digits}f} ({one['low']:.{digits}f} to {one['high']:.{digits}f})".replace(
                        "-", "−"
                    )
                )
        rows.append(spoken)
    return pd.DataFrame(rows).fillna("")[
        ["data", "fit", *(label for label, _ in SHOWN.values() if label != "lag, rad")]
    ]


def _describe_with_error(value: float, error: float, digits: int) -> str:
    """``11.393 ± 0.004``; a value that is held alone, nothing for a part that is not there."""
    if np.isnan(value) or (value == 0.0 and error == 0.0):
        return NOTHING
    text = f"{value:.{digits}f}".replace("-", "−")
    return text if error == 0.0 else f"{text} ± {error:.{digits}f}"


def _pair(fit: pd.Series[float], name: str, digits: int) -> str:
    return _describe_with_error(float(fit[name]), float(fit[f"{name}_se"]), digits)
