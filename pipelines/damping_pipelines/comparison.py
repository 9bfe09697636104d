"""Studies side by side: weights of laws, predictions at design forces, posteriors of parameters.

The page that sets studies side by side: rankings, predictions and posteriors of the records they share.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from damping.plots.style import (
    GRID,
    INK,
    LINEAR,
    WIDTH,
    describe_short,
    describe_with_unit,
    draw_plain_rows,
    identifier,
    styled,
    to_svg,
)
from damping.report.page import Block, Callout, FigureBlock, Footer, Heading, List, Section, Table, Text, describe_page
from damping.report.words import (
    NOTHING,
    count,
    format_force_text,
    format_joined,
    format_percent,
    format_share,
    format_signed,
    number,
)

#: Colours and markers of studies, in order; there are not more of either.
COLOURS = ("#0060a8", "#d55e00", "#009e73", "#882255", "#8c6d1f", "#5c6670", "#332288", "#d45fb0")
MARKERS = "osD^vP*X"
#: Studies that can be told apart in a figure.
MOST_STUDIES = len(COLOURS)
_LETTERS = 30


@styled
def weights(table: pd.DataFrame, studies: Sequence[str]) -> Figure:
    """Draw the weight of each law in each study.

    Args:
        table: ``law, study, weight``; the first law on top. studies: their names, in order.
    """
    laws = list(dict.fromkeys(table["law"]))
    figure = Figure(figsize=(0.85 * WIDTH, 0.9 + 0.24 * len(laws)))
    axes = figure.subplots()
    draw_plain_rows(axes, [describe_short(law, 60) for law in laws])
    for place, name in enumerate(studies):
        mine = table[table["study"] == name]
        rows = [laws.index(law) for law in mine["law"]]
        _draw_points(axes, mine["weight"].to_numpy(float), np.array(rows) + _aside(place, len(studies)), place, name)
    axes.set_xlim(left=-0.02)
    axes.set_xlabel("weight (posterior probability)")
    _draw_lines(axes, len(laws))
    figure.legend(loc="outside upper right", ncols=min(4, len(studies)))
    return figure


@styled
def predictions(table: pd.DataFrame, studies: Sequence[str], force_unit: str, length_unit: str) -> Figure:
    """Draw the predicted amplitude of each study at each design force with its interval, and what is linear.

    Args:
        table: ``force, study, median, low, high, linear``.
    """
    forces = sorted(set(table["force"]))
    figure = Figure(figsize=(0.85 * WIDTH, 3.6))
    axes = figure.subplots()
    for place, name in enumerate(studies):
        mine = table[table["study"] == name]
        x = np.array([forces.index(force) for force in mine["force"]]) + _aside(place, len(studies))
        median, low, high = (mine[column].to_numpy(float) for column in ("median", "low", "high"))
        axes.vlines(x, low, high, color=COLOURS[place], linewidth=2.2)
        axes.plot(
            x,
            median,
            MARKERS[place],
            color=COLOURS[place],
            markeredgecolor="white",
            label=describe_short(name, _LETTERS),
        )
        axes.plot(x, mine["linear"].to_numpy(float), "_", color=LINEAR, markersize=9, markeredgewidth=1.6)
    axes.plot([], [], "_", color=LINEAR, markersize=9, markeredgewidth=1.6, label="linear damping")
    axes.set_xticks(range(len(forces)), [f"{force:g}" for force in forces])
    axes.set_xlim(-0.6, len(forces) - 0.4)
    axes.set_xlabel(describe_with_unit("design force", force_unit))
    axes.set_ylabel(describe_with_unit("resonant amplitude", length_unit))
    figure.legend(loc="outside upper right", ncols=min(4, len(studies) + 1))
    return figure


@styled
def posteriors(table: pd.DataFrame, studies: Sequence[str]) -> Figure:
    """Draw the posterior interval of each parameter in each study, relative to its median over the studies.

    Args:
        table: ``law, parameter, study, low, median, high``, medians other than 0.
    """
    keys = list(dict.fromkeys(zip(table["law"], table["parameter"], strict=True)))
    middle = table.groupby(["law", "parameter"], sort=False)["median"].median()
    figure = Figure(figsize=(WIDTH, 0.9 + (0.16 + 0.09 * len(studies)) * len(keys)))
    axes = figure.subplots()
    draw_plain_rows(axes, [describe_short(law if law == name else f"{law}: {name}", 60) for law, name in keys])
    for place, name in enumerate(studies):
        mine = table[table["study"] == name]
        pairs = list(zip(mine["law"], mine["parameter"], strict=True))
        scale = np.array([middle[pair] for pair in pairs], dtype=float)
        low, median, high = (mine[column].to_numpy(float) / scale for column in ("low", "median", "high"))
        y = np.array([keys.index(pair) for pair in pairs]) + _aside(place, len(studies))
        axes.hlines(y, low, high, color=COLOURS[place], linewidth=1.8)
        _draw_points(axes, median, y, place, name)
    axes.axvline(1.0, color=INK, linewidth=0.7)
    axes.set_xlabel("posterior, relative to the middle of the medians")
    _draw_lines(axes, len(keys))
    figure.legend(loc="outside upper right", ncols=min(4, len(studies)))
    return figure


def _draw_points(axes: Axes, x: np.ndarray, y: np.ndarray, place: int, name: str) -> None:
    axes.plot(x, y, MARKERS[place], color=COLOURS[place], markeredgecolor="white", label=describe_short(name, _LETTERS))


def _aside(place: int, studies: int) -> float:
    """How far a study is moved from the middle of a row, so that none hides another."""
    return 0.6 * ((place + 0.5) / studies - 0.5)


def _draw_lines(axes: Axes, rows: int) -> None:
    """Faint lines between the rows."""
    for row in range(1, rows):
        axes.axhline(row - 0.5, color=GRID, linewidth=0.6)


#: Laws below this weight in every study are left out of figures.
LEAST_WEIGHT = 0.005


@dataclass(frozen=True)
class RecordSummary:
    """What a study found for a record.

    Attributes:
        title: for people. units: of force and length.
        ranking: ``law, rank, weight, held_out_error, average_absolute_percent``, a row a candidate.
        loads: ``force, median, low, high, linear, linear_overprediction_percent``, a row a design force; may be empty.
        posteriors: ``law, parameter, unit, low, median, high``; may be empty.
    """

    title: str
    units: tuple[str, str]
    ranking: pd.DataFrame
    loads: pd.DataFrame
    posteriors: pd.DataFrame


@dataclass(frozen=True)
class StudySummary:
    """A study under the name it goes by on the page; ``level``: of its predictions, ``digest``: of its summary."""

    name: str
    title: str
    seed: int
    level: float
    inputs: Mapping[str, str]
    versions: Mapping[str, str]
    records: Mapping[str, RecordSummary] = field(default_factory=dict)
    digest: str = ""


def describe_comparison_page(studies: Sequence[StudySummary], versions: Mapping[str, str]) -> str:
    """The page as HTML. Equal arguments give equal text; names of studies are all different."""
    names = list(dict.fromkeys(name for study in studies for name in study.records))
    sections = [Section("studies", "The studies", _build_overview(studies, names))]
    for name in names:
        having = [study for study in studies if name in study.records]
        title = having[0].records[name].title or name
        sections.append(Section(f"record-{name}", title, _record(name, having, studies)))
    footer = Footer(
        seed=studies[0].seed,
        versions=versions,
        inputs={f"{study.name}: summary.json": study.digest for study in studies},
    )
    return describe_page(f"{len(studies)} studies side by side", sections, footer)


def _build_overview(studies: Sequence[StudySummary], names: Sequence[str]) -> list[Block]:
    shared = [name for name in names if all(name in study.records for study in studies)]
    lead = f"{count(len(shared), 'record')} in every study" + (f": {format_joined(shared)}." if shared else ".")
    rows = [
        {"study": study.name, "title": study.title, "seed": study.seed, "level": study.level}
        | {"records": ", ".join(study.records)}
        for study in studies
    ]
    blocks: list[Block] = [Text(lead, lead=True), Table(pd.DataFrame(rows), "What is compared")]
    said = [*_list_leading(studies, shared), *_list_differences(studies)]
    if said:
        blocks.append(List(said))
    return blocks


def _list_leading(studies: Sequence[StudySummary], shared: Sequence[str]) -> list[str]:
    """Which law leads where."""
    said = []
    for name in shared:
        best = {study.name: _describe_best(study.records[name].ranking) for study in studies}
        if len(set(best.values())) == 1:
            said.append(f"{name}: {best[studies[0].name]} leads in every study.")
        else:
            said.append(f"{name}: " + format_joined(f"{law} leads in {study}" for study, law in best.items()) + ".")
    return said


def _describe_best(ranking: pd.DataFrame) -> str:
    ranked = ranking[ranking["weight"].notna()].sort_values("weight", ascending=False, kind="stable")
    return str(ranked["law"].iloc[0]) if len(ranked) else "no law"


def _list_differences(studies: Sequence[StudySummary]) -> list[str]:
    """What else than the data differs, by name."""
    said = []
    for what, tables in (
        ("input", [study.inputs for study in studies]),
        ("version", [study.versions for study in studies]),
    ):
        names = dict.fromkeys(name for table in tables for name in table)
        other = [name for name in names if len({table.get(name) for table in tables}) > 1]
        if other:
            said.append(f"Not the same {what} in every study: {format_joined(other)}.")
    for what, values in (("seed", {study.seed for study in studies}), ("level", {study.level for study in studies})):
        if len(values) > 1:
            said.append(f"Not the same {what} in every study.")
    return said


def _record(name: str, having: Sequence[StudySummary], studies: Sequence[StudySummary]) -> list[Block]:
    blocks: list[Block] = []
    if len(having) < len(studies):
        missing = [study.name for study in studies if study not in having]
        blocks.append(Text(f"Not in {format_joined(missing)}."))
    units = {study.records[name].units for study in having}
    if len(units) > 1:
        told = [
            f"{study.name}: {' and '.join(filter(None, study.records[name].units)) or 'not stated'}" for study in having
        ]
        blocks.append(
            Callout("The studies are in different units: amplitudes and coefficients cannot be compared", told)
        )
    one_unit = next(iter(units)) if len(units) == 1 else None
    return [
        *blocks,
        *_build_rankings(name, having),
        *_build_predictions(name, having, one_unit),
        *_build_posteriors(name, having, drawn=one_unit is not None),
    ]


def _build_rankings(name: str, having: Sequence[StudySummary]) -> list[Block]:
    table = _tabulate_stacked(name, having, "ranking")
    order = table.groupby("law", sort=False)["weight"].max().sort_values(ascending=False, kind="stable")
    drawn = [law for law in order.index if order[law] > LEAST_WEIGHT]
    wide = pd.DataFrame({"law": order.index})
    for study in having:
        mine = study.records[name].ranking.drop_duplicates("law").set_index("law").reindex(order.index)
        wide[f"weight: {study.name}"] = mine["weight"].to_numpy(float)
        wide[f"held-out error (%): {study.name}"] = mine["held_out_error"].to_numpy(float)
    formats = {column: format_share if column.startswith("weight") else format_percent for column in wide.columns[1:]}
    caption = "Weight of each candidate (posterior probability among the physical ones) and its held-out error"
    blocks: list[Block] = [Heading("Rankings")]
    if drawn:
        chosen = table[table["law"].isin(drawn)].sort_values(
            "law", key=lambda laws: laws.map(drawn.index), kind="stable"
        )
        said = format_joined(f"{study.name} {_describe_best(study.records[name].ranking)}" for study in having)
        figure = weights(chosen[chosen["weight"].notna()], [study.name for study in having])
        blocks.append(_figure(figure, f"weights-{name}", "Weights of laws", f"Leading laws: {said}."))
    return [*blocks, Table(wide, caption, formats)]


def _build_predictions(name: str, having: Sequence[StudySummary], units: tuple[str, str] | None) -> list[Block]:
    table = _tabulate_stacked(name, having, "loads")
    if table.empty:
        return []
    first = table.drop_duplicates("force").set_index("force")["median"]
    table["difference"] = 100.0 * (table["median"] / table["force"].map(first).to_numpy(float) - 1.0)
    if units is None:
        table["difference"] = np.nan
    table = table.sort_values("force", kind="stable")
    columns = ["force", "study", "median", "low", "high", "linear", "linear_overprediction_percent", "difference"]
    caption = "Resonant amplitude at design forces; difference: of the median from that of the first study that has it"
    headings = {"linear_overprediction_percent": "linear too high by (%)", "difference": "difference (%)"}
    formats = {"linear_overprediction_percent": format_percent, "difference": _describe_signed}
    blocks: list[Block] = [Heading("Predictions")]
    if units is not None and np.isfinite(table["median"]).any():
        said = format_joined(
            f"{study} at {format_force_text(force, units[0])} {number(median)} ({number(low)} to {number(high)})"
            for force, study, median, low, high in table[columns[:5]].itertuples(index=False)
        )
        figure = predictions(table, [study.name for study in having], *units)
        blocks.append(_figure(figure, f"predictions-{name}", "Predictions at design forces", f"Medians: {said}."))
    return [*blocks, Table(table[columns], caption, formats, headings)]


def _describe_signed(value: float) -> str:
    return format_signed(value).removesuffix(" %")


def _build_posteriors(name: str, having: Sequence[StudySummary], *, drawn: bool) -> list[Block]:
    table = _tabulate_stacked(name, having, "posteriors")
    if table.empty:
        return []
    known = table.dropna(subset=["low", "median", "high"])
    known = known[known["median"] != 0.0]
    blocks: list[Block] = [Heading("Posteriors")]
    if drawn and len(known):
        figure = posteriors(known, [study.name for study in having])
        said = f"{count(known.groupby(['law', 'parameter']).ngroups, 'parameter')} of {known['law'].nunique()} laws."
        blocks.append(_figure(figure, f"posteriors-{name}", "Posteriors of parameters", said))
    order = table.sort_values(["law", "parameter"], kind="stable")[
        ["law", "parameter", "study", "median", "low", "high", "unit"]
    ]
    return [*blocks, Table(order, "Median and 90 per cent interval of each parameter", {"unit": _describe_text})]


def _describe_text(value: object) -> str:
    return str(value) or NOTHING


def _tabulate_stacked(name: str, having: Sequence[StudySummary], what: str) -> pd.DataFrame:
    """A table of every study below one another, with the column ``study``."""
    tables = [getattr(study.records[name], what).assign(study=study.name) for study in having]
    filled = [table for table in tables if not table.empty]
    return pd.concat(filled, ignore_index=True) if filled else pd.DataFrame()


def _figure(figure: Figure, name: str, title: str, description: str) -> FigureBlock:
    return FigureBlock(to_svg(figure, identifier(name), title, description), f"{title}. {description}")
