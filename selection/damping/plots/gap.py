"""A gap between simulation and test: its location, measured and simulated curves, local estimates, probabilities."""

from textwrap import wrap
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from damping import plots as look
from damping.plots import build_panel, build_panels, describe_with_unit, distinguish, draw_plain_rows, styled
from damping.plots.given import count_rows, name_rows
from damping.plots.scales import plain_log
from damping.records.text import format_share

_TICKS = [-1000, -100, -10, -2, 0, 2, 10, 100, 1000]  #: marks of the colour bar, in units of noise
#: Steps between marks of frequency over the width of a figure: numbers of five figures stand apart.
_MOST_STEPS = 5


@styled
def gap_map(rows: pd.DataFrame, label: str) -> Figure:
    """Draw one coloured mark for each row of the record, sweeps one below the other; ``label``: of the colour.

    Args:
        rows: ``sweep, frequency (Hz), quantity, value`` with the value in units of noise.
    """
    quantities = list(rows["quantity"].unique())
    sweeps = list(rows["sweep"].unique())
    figure, (axes,) = build_panels(1.5 + 0.24 * len(sweeps), 1, len(quantities), sharey=True, squeeze=False)
    reach = max(3.0, float(np.nanquantile(rows["value"].abs(), 0.99)))
    norm = SymLogNorm(linthresh=2.0, vmin=-reach, vmax=reach)
    for ax, quantity in zip(axes, quantities, strict=True):
        own = rows[rows["quantity"] == quantity]
        heights = [sweeps.index(sweep) for sweep in own["sweep"]]
        drawn = ax.scatter(own["frequency"], heights, c=own["value"], norm=norm, cmap="RdBu_r", marker="s", s=26)
        ax.set_title(quantity)
        ax.set_xlabel("frequency (Hz)")
        ax.locator_params(axis="x", nbins=max(_MOST_STEPS // len(quantities), 1))
        draw_plain_rows(ax, [f"sweep {name}" for name in distinguish(sweeps)])
    bar = figure.colorbar(drawn, ax=list(axes), label=label, shrink=0.9, format="%g")
    bar.set_ticks([tick for tick in _TICKS if abs(tick) <= reach])
    bar.outline.set_visible(False)
    if bar.solids is not None:
        bar.solids.set(rasterized=False, edgecolor="face")  # a page shows no pictures inside of drawings
    return figure


#: Colour, line and name of each model that is drawn.
MODELS = {
    "nominal": (look.MUTED, (0, (1, 1.2)), "simulation as given"),
    "refitted": (look.MUTED, "-", "refitted within its tolerance"),
    "explained": (look.ALERT, "-", "with the explanation"),
}
_PER_ROW = 2  #: sweeps beside one another
_LETTERS_UP = 20  #: letters beside or above a panel of amplitudes


def _draw_models(ax: Axes, curves: pd.DataFrame, x: str, y: str) -> None:
    for model, (colour, line, name) in MODELS.items():
        rows = curves[curves["model"] == model]
        if len(rows):
            ax.plot(rows[x], rows[y], color=colour, linestyle=line, label=name)


@styled
def gap_overlay(measured: pd.DataFrame, predicted: pd.DataFrame, length: str) -> Figure:
    """Draw one pair of panels for each sweep: amplitude above phase, over frequency.

    Args:
        measured: ``sweep, frequency (Hz), amplitude, phase (rad, NaN where none), outlier`` (left out of the fit).
        predicted: ``sweep, model, frequency, amplitude, phase``; models are nominal, refitted, explained.
        length: unit of the amplitude.
    """
    sweeps = list(measured["sweep"].unique())
    with_phase = bool(measured["phase"].notna().any())
    quantities = ("amplitude", "phase") if with_phase else ("amplitude",)
    kinds, bands = len(quantities), -(-len(sweeps) // _PER_ROW)
    height, ratios = (3.1, [1.5, 1.0]) if with_phase else (2.1, [1.0])
    grid = bands * kinds, min(_PER_ROW, len(sweeps))
    figure, axes = build_panels(height * bands + 0.5, *grid, squeeze=False, height_ratios=ratios * bands)
    for ax in axes.flat:
        ax.set_visible(False)
    for number, (sweep, name) in enumerate(zip(sweeps, distinguish(sweeps, _LETTERS_UP), strict=True)):
        band, column = divmod(number, _PER_ROW)
        points, curves = measured[measured["sweep"] == sweep], predicted[predicted["sweep"] == sweep]
        panels = axes[band * kinds : (band + 1) * kinds, column]
        for ax, quantity in zip(panels, quantities, strict=True):
            _draw_panel(ax, points, curves, quantity)
        panels[0].set_title(f"sweep {name}")
        if column == 0:
            panels[0].set_ylabel("\n".join(wrap(describe_with_unit("amplitude", length), _LETTERS_UP)))
        if with_phase:
            panels[0].tick_params(axis="x", labelbottom=False)
        if with_phase and column == 0:
            panels[1].set(ylabel="phase lag (rad)", xlabel="frequency (Hz)")
    drawn = {  # a row is an outlier in some panels alone
        label: handle for ax in axes.flat for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(drawn.values()), list(drawn), loc="outside lower center", ncols=2)
    return figure


def _draw_panel(ax: Axes, points: pd.DataFrame, curves: pd.DataFrame, quantity: str) -> None:
    ax.set_visible(True)
    _draw_models(ax, curves, "frequency", quantity)
    regular, outliers = points[~points["outlier"]], points[points["outlier"]]
    ax.plot(regular["frequency"], regular[quantity], "o", color=look.MEASURED, ms=2.6, label="measured", zorder=3)
    if len(outliers):
        style: dict[str, Any] = {"color": look.AVERAGE, "markersize": 4, "zorder": 3}
        ax.plot(outliers["frequency"], outliers[quantity], "x", **style, label="row set aside: outlier")
    ax.tick_params(axis="both", labelsize=7)
    ax.locator_params(axis="x", nbins=4)


#: Amplitudes beyond this ratio are drawn on a logarithmic axis.
_WIDE = 4.0
_MARKS = "os^Dv<>P*X"


@styled
def gap_local(estimates: pd.DataFrame, curves: pd.DataFrame, length: str) -> Figure:
    """Draw frequency, and damping ratio below it, over amplitude.

    Args:
        estimates: ``sweep, amplitude, frequency, frequency_sd, damping, damping_sd``.
        curves: ``model`` (refitted, explained, free)``, amplitude, frequency, damping``; ``free`` has limits
            ``frequency_low`` and so on.
        length: unit of the amplitude.
    """
    figure, axes = build_panels(5.0, 2)
    estimates, curves = (
        own.assign(**{name: 100.0 * own[name] for name in map(str, own) if name.startswith("damping")})
        for own in (estimates, curves)
    )
    sweeps = list(estimates["sweep"].unique())
    named = [f"sweep {name}" for name in distinguish(sweeps, _LETTERS_UP)]
    many = len(sweeps) > len(_MARKS)  # more marks than the eye keeps apart
    marks, names = (["o"] * len(sweeps), ["sweeps", *["_"] * (len(sweeps) - 1)]) if many else (_MARKS, named)
    for ax, quantity, label in zip(
        axes, ("frequency", "damping"), ("frequency (Hz)", "damping ratio (%)"), strict=True
    ):
        for model, name in (("refitted", "simulation, refitted"), ("explained", "with the explanation")):
            rows = curves[curves["model"] == model]
            if len(rows):
                ax.plot(rows["amplitude"], rows[quantity], color=MODELS[model][0], label=name)
        free = curves[curves["model"] == "free"]
        if len(free):
            low, high = free[f"{quantity}_low"], free[f"{quantity}_high"]
            style: dict[str, Any] = {"color": look.ALERT, "alpha": 0.15, "linewidth": 0.0}
            ax.fill_between(free["amplitude"], low, high, **style, label="free-form curve, 90 % credible band")
        for (_, rows), mark, name in zip(estimates.groupby("sweep", sort=False), marks, names, strict=False):
            ax.errorbar(
                rows["amplitude"], rows[quantity], rows[f"{quantity}_sd"], fmt=mark,
                markersize=3, linewidth=0.8, color=look.MEASURED, markerfacecolor="white", label=name,
            )  # fmt: skip
        if estimates["amplitude"].max() > _WIDE * estimates["amplitude"].min():
            ax.set_xscale("log")
            plain_log(ax.xaxis)
        # estimates and curves with a margin; the band of free form may leave it
        every = pd.concat([estimates[quantity], curves.loc[curves["model"] != "free", quantity]])
        margin = 0.1 * float(every.max() - every.min()) or 0.1 * float(every.max())
        ax.set_ylim(float(every.min()) - margin, float(every.max()) + margin)
        ax.set_xlabel(describe_with_unit("amplitude", length))
        ax.set_ylabel(label)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


@styled
def gap_resonances(measured: pd.DataFrame, predicted: pd.DataFrame, force: str, length: str) -> Figure:
    """Draw amplitude at phase resonance over force.

    Args:
        measured: ``sweep, force, amplitude, sd`` (relative).
        predicted: ``model, force, amplitude``; models are nominal, refitted, explained.
        force, length: units.
    """
    figure, ax = build_panel(3.0, describe_with_unit("force", force), describe_with_unit("resonant amplitude", length))
    _draw_models(ax, predicted.sort_values("force"), "force", "amplitude")
    bars = measured["sd"] * measured["amplitude"]
    style: dict[str, Any] = {"fmt": "o", "color": look.MEASURED, "markersize": 3.5, "label": "measured"}
    ax.errorbar(measured["force"], measured["amplitude"], bars, **style)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


@styled
def gap_probabilities(table: pd.DataFrame, *, axes: Axes | None = None) -> Figure:
    """Draw one bar for each explanation, most probable on top.

    Args:
        table: ``explanation, probability, listed`` (among those that together reach 0.95).
    """
    figure, ax = build_panel(0.7 + 0.24 * len(table), "probability", axes=axes)
    if axes is None:
        draw_plain_rows(ax, table["explanation"].tolist())
        at, height = np.arange(float(len(table))), 0.6
    else:
        table = table.head(count_rows(axes, len(table)))
        at, height = name_rows(axes, table["explanation"].tolist())
    colours = [look.ALERT if listed else look.MUTED for listed in table["listed"]]
    ax.barh(at, table["probability"], height, color=colours)
    for row, probability in zip(at, table["probability"], strict=True):
        ax.annotate(format_share(probability), (probability, row), (4, 0), **look.BESIDE)
    ax.set_xlim(0.0, 1.12)
    return figure
