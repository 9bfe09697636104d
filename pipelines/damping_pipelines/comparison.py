"""The page that sets studies, modes and configurations side by side: one table with units; the same law or not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from damping.infer.observations import Observations
from damping.ranking.sharing import SharedShape, share_shapes, weigh_sharing
from damping.report import (
    NOTHING,
    count,
    format_between,
    format_joined,
    format_length,
    format_percent,
    format_quantity,
    format_share,
    format_signed,
    number,
)
from damping.report.page import Block, Callout, Fold, Footer, Heading, List, Section, Table, Text, render_page

#: Odds from which on one law or several is said.
DECIDES = 3.0
#: Laws listed there at most.
MOST_POOLED = 8


@dataclass(frozen=True)
class TopOfTest:
    """Amplitude, frequency (Hz) and damping ratio with its band at the largest tested amplitude."""

    amplitude: float
    frequency: float
    ratio: float
    low: float
    high: float


@dataclass(frozen=True)
class RecordSummary:
    """What a study found for a record.

    Attributes:
        units: of force and length. exponent: p of a power law with its standard error.
        ranking: ``law, rank, weight, held_out_error, average_absolute_percent``, a row a candidate.
        loads: ``force, median, low, high, linear, linear_overprediction_percent``, a row a design force; may be empty.
        posteriors: ``law, parameter, unit, low, median, high``; may be empty.
        groups: laws that predict the same on the record, the one listed first, and their weight.
        observations: for a joint fit, where the study keeps them.
    """

    title: str
    units: tuple[str, str]
    ranking: pd.DataFrame
    loads: pd.DataFrame
    posteriors: pd.DataFrame
    top: TopOfTest | None = None
    exponent: tuple[float, float | None] | None = None
    groups: tuple[tuple[tuple[str, ...], float], ...] = ()
    observations: Observations | None = None


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
    sections = [Section("studies", "Side by side", _build_overview(studies, names))]
    sections.append(Section("sharing", "Is it the same law in all of them?", _build_sharing(_list_different(studies))))
    for name in names:
        having = [study for study in studies if name in study.records]
        if len(having) < 2 and len(studies) == 1:
            continue
        title = having[0].records[name].title or name
        sections.append(Section(f"record-{name}", title, _record(name, having, studies)))
    footer = Footer(
        seed=studies[0].seed,
        versions=versions,
        inputs={f"{study.name}: summary.json": study.digest for study in studies},
    )
    return render_page(f"{len(studies)} studies side by side", sections, footer)


def _build_overview(studies: Sequence[StudySummary], names: Sequence[str]) -> list[Block]:
    shared = [name for name in names if all(name in study.records for study in studies)]
    lead = f"{count(len(shared), 'record')} in every study" + (f": {format_joined(shared)}." if shared else ".")
    rows = [
        {"study": study.name, "title": study.title, "seed": study.seed, "level": study.level}
        | {"records": ", ".join(study.records)}
        for study in studies
    ]
    several = len(studies) > 1
    lines = [*_list_leading(studies, shared), *_list_differences(studies)] if several else []
    return [
        *([Text(lead, lead=True)] if several else []),
        _tabulate_records(studies),
        *([List(lines)] if lines else []),
        Table(pd.DataFrame(rows), "What is compared"),
    ]


def _tabulate_records(studies: Sequence[StudySummary]) -> Table:
    """One row for each record of each study, with units."""
    rows = [
        {"study": study.name, "record": record.title or name}
        | _describe_top(record.top, record.units[1])
        | {
            "leading law": _describe_best(record.ranking),
            "weight": format_share(max((weight for _, weight in record.groups), default=float("nan"))),
            "exponent": _describe_exponent(record.exponent),
        }
        for study in studies
        for name, record in study.records.items()
    ]
    caption = "Every record: damping at the top of its test with its 90 % band; exponent p of F in proportion to A^p."
    return Table(pd.DataFrame(rows), caption)


def _describe_top(top: TopOfTest | None, unit: str) -> dict[str, str]:
    if top is None:
        return dict.fromkeys(("tested to", "frequency", "damping ratio there"), NOTHING)
    between = format_between(100.0 * top.low, 100.0 * top.high, "%")
    return {
        "tested to": format_length(top.amplitude, unit),
        "frequency": format_quantity(top.frequency, "Hz", 4),
        "damping ratio there": f"{number(100.0 * top.ratio)} % ({between})",
    }


def _describe_exponent(exponent: tuple[float, float | None] | None) -> str:
    if exponent is None:
        return NOTHING
    p, error = exponent
    return f"{p:.2f}" if error is None else f"{p:.2f} ± {error:.2f}"


def _list_different(studies: Sequence[StudySummary]) -> list[tuple[str, RecordSummary]]:
    """Records that rest on data of their own: of two studies of the same files the first."""
    different: dict[tuple[str, tuple[tuple[str, str], ...]], tuple[str, RecordSummary]] = {}
    for study in studies:
        of = f"{study.name}: " if len(studies) > 1 else ""
        for name, record in study.records.items():
            key = (name, tuple(sorted(study.inputs.items())))
            different.setdefault(key, (of + (record.title or name), record))
    return list(different.values())


def _build_sharing(records: Sequence[tuple[str, RecordSummary]]) -> list[Block]:
    if len(records) < 2:
        return [Text("There is one record: nothing to share.")]
    groups = [record.groups for _, record in records]
    observed = [record.observations for _, record in records if record.observations is not None]
    complete = len(observed) == len(records)
    shapes = share_shapes(groups, observed) if complete else {}
    odds, table = weigh_sharing(groups, shapes)
    if not np.isfinite(odds):
        return [Text("No law was weighed on every record.")]
    among = f"{count(len(records), 'record')} ({format_joined(name for name, _ in records)})"
    if odds >= DECIDES:
        verdict = f"One law in all {among} is {odds:.2g} times more probable than a law of its own for each."
    elif odds <= 1.0 / DECIDES:
        times = "beyond doubt" if odds == 0.0 else f"{1.0 / odds:.2g} times more probable"
        verdict = f"A law of its own for each of {among} is {times} than one law in all."
    else:
        verdict = f"Whether one law holds in all {among} cannot be told: the odds are {odds:.2g} to 1."
    if not complete:
        verdict += " Studies that keep no observations were compared by their rankings: run them again for a joint fit."
    shown = table.head(MOST_POOLED)
    caption = (
        "Probability of each law if one holds in all records: one exponent where it has one, fitted jointly, with "
        "coefficients of each record's own"
    )
    blocks: list[Block] = [Text(verdict), *([Table(shown, caption, {"weight": format_share})] if len(shown) else [])]
    return [*blocks, *([_tabulate_shapes([name for name, _ in records], shapes)] if shapes else [])]


def _tabulate_shapes(names: Sequence[str], shapes: Mapping[str, SharedShape]) -> Table:
    """One row for each shared shape: its value if all records share it, its value in each, and the odds of sharing."""
    interval = "{0:.2f} ({1:.2f} to {2:.2f})"
    rows = [
        {"law": law, "shared": shape.name.removeprefix(f"{law} "), "odds of one value": number(np.exp(shape.log_odds))}
        | {"one value": interval.format(*shape.pooled)}
        | {f"alone: {name}": interval.format(*alone) for name, alone in zip(names, shape.each, strict=True)}
        for law, shape in shapes.items()
    ]
    caption = "Joint fits with one exponent: the odds against an exponent for each, and medians with 90 % intervals"
    return Table(pd.DataFrame(rows), caption)


def _list_leading(studies: Sequence[StudySummary], shared: Sequence[str]) -> list[str]:
    """Which law leads where."""
    lines = []
    for name in shared:
        best = {study.name: _describe_best(study.records[name].ranking) for study in studies}
        if len(set(best.values())) == 1:
            lines.append(f"{name}: {best[studies[0].name]} leads in every study.")
        else:
            lines.append(f"{name}: " + format_joined(f"{law} leads in {study}" for study, law in best.items()) + ".")
    return lines


def _describe_best(ranking: pd.DataFrame) -> str:
    ranked = ranking[ranking["weight"].notna()].sort_values("weight", ascending=False, kind="stable")
    return str(ranked["law"].iloc[0]) if len(ranked) else "no law"


def _list_differences(studies: Sequence[StudySummary]) -> list[str]:
    """What else than the data differs, by name."""
    differences = []
    for what in ("input", "version"):
        tables: list[Mapping[str, str]] = [getattr(study, f"{what}s") for study in studies]
        names = dict.fromkeys(name for table in tables for name in table)
        other = [name for name in names if len({table.get(name) for table in tables}) > 1]
        if other:
            differences.append(f"Not the same {what} in every study: {format_joined(other)}.")
    other = [what for what in ("seed", "level") if len({getattr(study, what) for study in studies}) > 1]
    return [*differences, *(f"Not the same {what} in every study." for what in other)]


def _record(name: str, having: Sequence[StudySummary], studies: Sequence[StudySummary]) -> list[Block]:
    blocks: list[Block] = []
    if len(having) < len(studies):
        missing = [study.name for study in studies if study not in having]
        blocks.append(Text(f"Not in {format_joined(missing)}."))
    units = {study.name: study.records[name].units for study in having}
    comparable = len(set(units.values())) == 1
    if not comparable:
        lines = [f"{study}: {' and '.join(filter(None, named)) or 'not stated'}" for study, named in units.items()]
        warning = "The studies are in different units: amplitudes and coefficients cannot be compared"
        blocks.append(Callout(warning, lines))
    predictions = _build_predictions(name, having, comparable=comparable)
    return [*blocks, *_build_rankings(name, having), *predictions, *_build_posteriors(name, having)]


def _build_rankings(name: str, having: Sequence[StudySummary]) -> list[Block]:
    table = _tabulate_stacked(name, having, "ranking")
    order = table.groupby("law", sort=False)["weight"].max().sort_values(ascending=False, kind="stable")
    wide = pd.DataFrame({"law": order.index})
    for study in having:
        ranking = study.records[name].ranking.drop_duplicates("law").set_index("law").reindex(order.index)
        wide[f"weight: {study.name}"] = ranking["weight"].to_numpy(float)
        wide[f"held-out error (%): {study.name}"] = ranking["held_out_error"].to_numpy(float)
    formats = {column: format_share if column.startswith("weight") else format_percent for column in wide.columns[1:]}
    caption = "Weight of each candidate (posterior probability among the physical ones) and its held-out error"
    return [Heading("Rankings"), Table(wide, caption, formats)]


def _build_predictions(name: str, having: Sequence[StudySummary], *, comparable: bool) -> list[Block]:
    table = _tabulate_stacked(name, having, "loads")
    if table.empty:
        return []
    first = table.drop_duplicates("force").set_index("force")["median"]
    table["difference"] = 100.0 * (table["median"] / table["force"].map(first).to_numpy(float) - 1.0)
    if not comparable:
        table["difference"] = np.nan
    table = table.sort_values("force", kind="stable")
    columns = ["force", "study", "median", "low", "high", "linear", "linear_overprediction_percent", "difference"]
    caption = "Resonant amplitude at design forces; difference: of the median from that of the first study that has it"
    headings = {"linear_overprediction_percent": "linear too high by (%)", "difference": "difference (%)"}
    formats = {
        "linear_overprediction_percent": format_percent,
        "difference": lambda value: format_signed(value).removesuffix(" %"),
    }
    return [Heading("Predictions"), Table(table[columns], caption, formats, headings)]


def _build_posteriors(name: str, having: Sequence[StudySummary]) -> list[Block]:
    table = _tabulate_stacked(name, having, "posteriors")
    if table.empty:
        return []
    columns = ["law", "parameter", "study", "median", "low", "high", "unit"]
    order = table.sort_values(["law", "parameter"], kind="stable")[columns]
    caption = "Median and 90 per cent interval of each parameter"
    return [Fold("Parameters of every law", [Table(order, caption, {"unit": lambda unit: str(unit) or NOTHING})])]


def _tabulate_stacked(name: str, having: Sequence[StudySummary], what: str) -> pd.DataFrame:
    """A table of every study below one another, with the column ``study``."""
    tables = [getattr(study.records[name], what).assign(study=study.name) for study in having]
    filled = [table for table in tables if not table.empty]
    return pd.concat(filled, ignore_index=True) if filled else pd.DataFrame()
