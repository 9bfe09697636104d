"""Page of design-load bands on real structures: predictions, goals, higher levels left out, figures with citations."""

import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from damping import plots
from damping.errors import InputError
from damping.extrapolation import leave_higher_levels_out, predict_record
from damping.extrapolation.cautions import find_refusal
from damping.extrapolation.plan import Plan
from damping.extrapolation.prediction import Loads
from damping.extrapolation.prepared import prepare_record
from damping.plots import scales
from damping.records.mode import Mode, read_mode
from damping.records.reading import read_record
from damping.records.record import record_to_csv
from damping.records.text import read_bytes
from damping.report import forms
from damping.report.page import fill_text
from damping_pipelines.manifest import digest, publish, sole_writer, versions
from damping_pipelines.options import MAX_SIZE
from damping_pipelines.store import refuse_inputs
from damping_pipelines.terminal import progress, report_findings

LEVEL = 0.9
#: Largest high/low wanted at a ratio of force to the largest tested one.
GOALS = {1.5: 1.35, 4.0: 1.8}
RATIOS = (1.5, 2.0, 4.0)
MEDIANS = 6.0  #: largest error of a median wanted at a level left out, per cent
#: Known records by folder: ``title`` of the structure, ``source``, and whether a warning is wanted.
CITATIONS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
_GRID = 40  #: forces at which a band is drawn


@dataclass(frozen=True)
class BandResult:
    """One structure: predictions on a grid and at ``RATIOS``, the check with levels left out, and the method."""

    name: str
    mode: Mode
    plan: Plan
    grid: Loads
    at: Loads
    left_out: pd.DataFrame
    notes: tuple[str, ...] = ()


def bands_page(records: Path, out: Path, seed: int, despite: Collection[str] = ()) -> None:
    """Predict for every ``NAME/record.csv`` with ``NAME/mode.toml`` under ``records``; write page, tables and figures.

    No record is copied: only predictions, derived resonances and figures are written. InputError: no
    such records, or a bad one; Refused: by the audit of one, and not among ``despite``.
    """
    refuse_inputs("--out", out, records)
    names = sorted(path.parent.name for path in records.glob("*/record.csv"))
    if not names:
        raise InputError("no records", file=records, expected="folders with record.csv and mode.toml")
    outputs = [f"{name}{ending}" for name in names for ending in (".png", ".csv", "-left-out.csv")]
    read = [f"{name}/{file}" for name in names for file in ("record.csv", "mode.toml")]
    inputs = {name: digest(read_bytes(records / name, MAX_SIZE)) for name in read}
    with sole_writer(out, ["README.md", *outputs], [records / name for name in read]):
        files: dict[str, bytes] = {}
        results = [predict_structure(records / name, seed, despite) for name in names]
        for band in results:
            files[f"{band.name}.png"] = plots.to_png(draw_real_bands(band))
            files[f"{band.name}.csv"] = record_to_csv(forms.tabulate_loads(band.at)).encode()
            files[f"{band.name}-left-out.csv"] = record_to_csv(band.left_out).encode()
        files["README.md"] = render_page(results, seed).encode()
        publish(out, files, seed=seed, versions=versions(), inputs=inputs)
    print(f"{out / 'README.md'} written")


def predict_structure(folder: Path, seed: int, despite: Collection[str] = ()) -> BandResult:
    """All results of one structure."""
    record, mode = read_record(folder / "record.csv"), read_mode(folder / "mode.toml")
    findings = report_findings(record, mode, despite)
    prepared = prepare_record(record, mode, findings)
    predicted, data = predict_record(prepared, np.empty(0), RATIOS, LEVEL, seed, progress=progress), prepared.data
    forces = np.geomspace(data.tested_force.min(), 1.1 * predicted.loads.force[-1], _GRID)
    return BandResult(
        name=folder.name,
        mode=prepared.mode,
        plan=predicted.plan,
        grid=predicted.predict_at(forces),
        at=predicted.loads,
        left_out=leave_higher_levels_out(data, LEVEL, seed, prepared.mode, prepared.all_rows),
        notes=prepared.notes,
    )


def render_page(results: list[BandResult], seed: int) -> str:
    """The page in Markdown."""
    checks = pd.concat([band.left_out for band in results], ignore_index=True)
    given = checks[~checks["refused"]]
    values = {
        "seed": seed,
        "goals": {RATIOS.index(ratio): most for ratio, most in GOALS.items()},
        "checks": checks,
        "given": given,
        "errors": _list_errors(given).groupby(given["levels"]),
        "farthest": {band.name: _list_errors(band.left_out).abs().max() for band in results},
        "medians": MEDIANS,
        "bands": [
            (
                band,
                forms.tabulate_loads(band.at).to_dict("records"),
                dict.fromkeys(chain(band.notes, *band.at.cautions)),
            )
            for band in results
        ],
        "citations": CITATIONS,
        "why_refused": find_refusal,
        "titles": title_structures({band.name: band.mode.name for band in results}),
        "parts": {said: forms.PART + name for name, said in forms.PART_NAMES.items()},
    }
    return fill_text(Path(__file__).with_suffix(".txt"), values)


def _list_errors(left_out: pd.DataFrame) -> pd.Series:
    """Errors of medians, per cent; NaN of predictions refused."""
    return 100.0 * (left_out["median"] / left_out["measured"] - 1.0)


def title_structures(modes: Mapping[str, str]) -> dict[str, str]:
    """Title of each folder by its mode's name: that of a known record, else the mode's, else, where modes share a name
    or have that of another folder, the folder's."""
    titles = {name: CITATIONS[name]["title"] if name in CITATIONS else mode for name, mode in modes.items()}
    taken = [*titles.values(), *titles]
    return {name: title if taken.count(title) == 1 + (title == name) else name for name, title in titles.items()}


#: Colours of the parts of a prediction's spread, in order.
_COLOURS = ("#999933", "#56b4e9", "#d55e00", "#0b2545")

#: Where the legend of a panel lies: below it, for the curves may lead anywhere in it.
_BELOW: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.24), "fontsize": 7.5}


@plots.styled
def draw_real_bands(band: BandResult) -> Figure:
    """Draw three panels side by side: beyond the test, higher levels left out, standard deviations of the parts."""
    figure, axes = plots.build_panels(4.2, 1, 3, 1.35 * plots.TEXT_WIDTH, width_ratios=[5, 3.4, 3.4])
    bands = forms.tabulate_loads(band.grid)
    _draw_bands(axes[0], bands, band)
    draw_left_out(axes[1], band.left_out)
    draw_parts(axes[2], bands)
    return figure


def _draw_bands(ax: Axes, bands: pd.DataFrame, band: BandResult) -> None:
    """Draw resonant amplitude against force, both logarithmic."""
    data, force = band.plan.data, bands["force"]
    ax.axvspan(data.tested_force.max(), force.max(), color=plots.BEYOND_TEST, linewidth=0, zorder=0)
    for name, ends, colour in (("predictive", "", plots.PREDICTIVE), ("credible", "credible_", plots.CREDIBLE)):
        low, high = bands[f"{ends}low"], bands[f"{ends}high"]
        ax.fill_between(force, low, high, color=colour, linewidth=0, label=f"{100 * LEVEL:g} % {name}")
    ax.plot(force, bands["median"], color=plots.AVERAGE, label="median")
    ax.plot(force, bands["linear"], color=plots.LINEAR, linestyle=(0, (7, 2)), label="linear")
    points: dict[str, Any] = {"color": plots.MEASURED, "markeredgecolor": "white", "label": "tested"}
    ax.plot(data.tested_force, data.tested_amplitude, "o", **points)
    ax.set(xscale="log", yscale="log")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(lambda value, position: f"{value:g}")
        axis.set_minor_locator(NullLocator())
    ax.set(xlim=(force.min(), force.max()), title="beyond the test")
    ax.set_xlabel(plots.describe_with_unit("force at resonance", band.mode.units.force))
    ax.set_ylabel(plots.describe_with_unit("resonant amplitude", band.mode.units.length))
    ax.legend(**_BELOW)


def draw_left_out(ax: Axes, left_out: pd.DataFrame) -> None:
    """Bands relative to measurements at levels left out; a cross for a refused prediction."""
    place = np.arange(len(left_out))
    low, median, high = (left_out[name] / left_out["measured"] for name in ("low", "median", "high"))
    refused = left_out["refused"].to_numpy(bool)
    if not refused.all():
        ax.vlines(place, low, high, color=plots.CREDIBLE, linewidth=5, label=f"{100 * LEVEL:g} % predictive")
        ax.plot(place, median, "o", color=plots.AVERAGE, markersize=4, label="median")
    linear = 1.0 + left_out["linear_over_percent"] / 100.0
    ax.plot(place, linear, "_", color=plots.LINEAR, markersize=9, markeredgewidth=1.8, label="linear")
    if refused.any():
        ax.plot(place[refused], np.ones(refused.sum()), "x", color=plots.ALERT, label="refused")
    ax.axhline(1.0, color=plots.MEASURED, linewidth=0.8)
    labels = [f"{r.sweep}\nfrom {r.levels}\n× {r.ratio:.1f}" for r in left_out.itertuples()]
    ax.set_xticks(place, labels, fontsize=6.5)
    ax.grid(visible=False, axis="x")
    ax.set(
        xlim=(-0.6, len(left_out) - 0.4),
        ylabel="predicted over measured",
        title="higher levels left out",
    )
    if len(left_out):
        ax.legend(**_BELOW)


def draw_parts(ax: Axes, bands: pd.DataFrame) -> None:
    """Standard deviation of each part against the extrapolation ratio."""
    parts = bands[[forms.PART + name for name in forms.PART_NAMES]]
    for name, label, colour in zip(parts, forms.PART_NAMES.values(), _COLOURS, strict=True):
        ax.plot(bands["extrapolation_ratio"], parts[name], color=colour, label=label)
    whole = np.sqrt((parts**2).sum(axis=1, min_count=1))
    ax.plot(bands["extrapolation_ratio"], whole, color=plots.MEASURED, lw=1.0, ls=":", label="whole")
    ax.set(xscale="log", xlabel="force over largest tested", ylabel="standard deviation, % of amplitude")
    scales.plain_log(ax.xaxis)
    ax.set_title("four parts")
    ax.legend(**_BELOW)
