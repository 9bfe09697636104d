"""The page that compares studies, modes and configurations: one table with units, and whether they share a law."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import nan
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping import report
from damping.formats.quantity import find_factors_between
from damping.infer.observations import Observations
from damping.ranking.sharing import SharedShape, is_same_test, share_shapes, weigh_sharing
from damping.records.mode import Units
from damping.report.page import Block, Footer, Table, render_page, write_sections
from damping_pipelines.forms import StudyForm, StudyRecordForm
from damping_pipelines.manifest import Manifest
from damping_pipelines.terminal import number_with_error

DECIDES = 3.0  #: odds from which on one law or several is said
_AMPLITUDES = ["median", "low", "high", "linear"]  #: columns of predictions that hold amplitudes
MOST_POOLED = 8  #: laws listed there at most


@dataclass(frozen=True)
class RecordSummary:
    """The results of a study for a record."""

    form: StudyRecordForm
    posteriors: pd.DataFrame  #: ``law, parameter, unit, low, median, high``; may be empty
    observations: Observations | None  #: for a joint fit, where the study keeps them

    @property
    def title(self) -> str:
        """Title of the record on the page."""
        return self.form.title or self.form.name

    @property
    def groups(self) -> tuple[tuple[tuple[str, ...], float], ...]:
        """Laws that predict the same on the record, the one listed first, and their weight; without unranked ones.

        A law that could not be fitted had no part of the prior probability that ranked laws share.
        """
        models = [model for model in self.form.rank.models if model.rank is not None]
        return tuple(((model.name, *model.equivalents), model.weight or 0.0) for model in models)

    @property
    def best(self) -> tuple[str, float]:
        """The law of largest weight, and that."""
        return max(((laws[0], weight) for laws, weight in self.groups), key=itemgetter(1), default=("no law", nan))

    @property
    def ranking(self) -> pd.DataFrame:
        """``law, weight, held_out_error``, one row for each candidate."""
        rows = [(model.name, model.weight, model.held_out_error) for model in self.form.rank.models]
        table = pd.DataFrame(rows, columns=["law", "weight", "held_out_error"])
        return table.astype({"weight": float, "held_out_error": float})

    @property
    def loads(self) -> pd.DataFrame:
        """``force, median, low, high, linear, linear_overprediction_percent``, by design force; may be empty."""
        columns = ["force", "median", "low", "high", "linear", "linear_overprediction_percent"]
        rows = [vars(prediction) for prediction in self.form.loads.predictions] if self.form.loads else []
        return pd.DataFrame(rows, columns=columns).astype(float)


@dataclass(frozen=True)
class StudySummary:
    """A study with its name on the page; ``digest``: of its summary."""

    name: str
    form: StudyForm
    manifest: Manifest
    records: Mapping[str, RecordSummary]
    digest: str


def describe_comparison_page(studies: Sequence[StudySummary], versions: Mapping[str, str]) -> str:
    """The page as HTML. Equal arguments give equal text; names of studies are all different."""
    names = list(dict.fromkeys(name for study in studies for name in study.records))
    shared = [name for name in names if all(name in study.records for study in studies)]
    rows = [
        {"study": study.name, "title": study.form.title, "seed": study.form.seed, "level": study.form.level}
        | {"records": ", ".join(study.records)}
        for study in studies
    ]
    sharing, parts = _weigh_sharing(_list_different(studies))
    parts |= {"overview": _tabulate_records(studies), "studies": Table(pd.DataFrame(rows))}
    records = []
    for name in names if len(studies) > 1 else ():
        having = [study for study in studies if name in study.records]
        tables = _build_tables(name, having)
        parts |= {f"{name} {what}": table for what, table in tables.items()}
        present = {what: what in tables for what in ("predictions", "posteriors")}
        records.append(_describe_record(name, having, studies) | present)
    forms = [record.form for study in studies for record in study.records.values()]
    values = {
        "studies": studies,
        "shared": shared,
        "leaders": {name: {s.name: s.records[name].best[0] for s in studies} for name in shared},
        "differences": _list_differences(studies),
        "records": records,
        "interval": next((f"{100 * law.level:g}" for record in forms for law in record.power_laws), ""),
        "levels": list(dict.fromkeys(f"{100 * study.form.level:g}" for study in studies)),
        **sharing,
    }
    footer = Footer(studies[0].form.seed, versions, {f"{study.name}: summary.json": study.digest for study in studies})
    sections = write_sections(Path(__file__).with_suffix(".txt"), values, parts)
    compared = f"{len(studies)} studies" if len(studies) > 1 else "Records of a study"
    return render_page(f"{compared} side by side", sections, footer)


def _tabulate_records(studies: Sequence[StudySummary]) -> Table:
    """One row for each record of each study, in as few columns as a narrow page has room for."""
    rows = [
        {"record": _name_record(study, record, studies)}
        | _describe_top(record.form)
        | {
            "law and weight": f"{record.best[0]} {report.format_share(record.best[1])}",
            "p": next((number_with_error(law.p, law.half_width) for law in record.form.power_laws), report.NOTHING),
        }
        for study in studies
        for record in study.records.values()
    ]
    return Table(pd.DataFrame(rows))


def _name_record(study: StudySummary, record: RecordSummary, studies: Sequence[StudySummary]) -> str:
    return f"{study.name}: {record.title}" if len(studies) > 1 else record.title


def _describe_top(record: StudyRecordForm) -> dict[str, str]:
    """Frequency and damping ratio at the largest tested amplitude for which they are known."""
    tested = [row for row in (record.curve.rows if record.curve else []) if row.tested and row.damping_ratio]
    rows = [(row.amplitude, row.frequency, *vars(row.damping_ratio).values()) for row in tested]
    known = pd.DataFrame(rows, columns=["amplitude", "frequency", "ratio", "low", "high"]).astype(float).dropna()
    if known.empty:
        return dict.fromkeys(("tested to", "damping ratio there"), report.NOTHING)
    top = known.iloc[int(known["amplitude"].argmax())]
    between = report.format_between(100.0 * top["low"], 100.0 * top["high"], "%")
    frequency = report.format_quantity(top["frequency"], "Hz", 4)
    return {
        "tested to": f"{report.format_length(top['amplitude'], record.units.length)}, {frequency}",
        "damping ratio there": f"{report.number(100.0 * top['ratio'])} % ({between})",
    }


def _list_different(studies: Sequence[StudySummary]) -> list[tuple[str, RecordSummary]]:
    """Records of different tests: the first of those with the same observations, or files where none are stored."""
    different, stored = list[tuple[str, RecordSummary]](), set[object]()
    for study in studies:
        for name, record in study.records.items():
            files = (name, tuple(sorted(study.manifest.inputs.items())))
            observed = study.manifest.outputs.get(f"{name}-observations.csv", files)
            if observed not in stored and not any(_is_same_test(record, other) for _, other in different):
                different.append((_name_record(study, record, studies), record))
            stored.add(observed)
    return different


def _is_same_test(one: RecordSummary, other: RecordSummary) -> bool:
    """Whether two records hold the same observations, in whatever units they state."""
    factors = find_factors_between(one.form.units, other.form.units)
    if factors is None or one.observations is None or other.observations is None:
        return False
    return is_same_test(one.observations, other.observations, *factors)


def _weigh_sharing(records: Sequence[tuple[str, RecordSummary]]) -> tuple[dict[str, Any], dict[str, Block]]:
    """Values and tables of the text on one law in all records."""
    values: dict[str, Any] = {"among": "", "decides": DECIDES, "number": partial(report.number, digits=2)}
    if len(records) < 2:
        return values, {}
    names, groups = [name for name, _ in records], [record.groups for _, record in records]
    observed = [record.observations for _, record in records if record.observations is not None]
    complete = len(observed) == len(records)
    shapes = share_shapes(groups, observed) if complete else {}
    odds, table = weigh_sharing(groups, shapes)
    values |= {"odds": odds, "weighed": np.isfinite(odds), "complete": complete}
    values["among"] = f"{report.count(len(records), 'record')} ({report.format_joined(names)})"
    parts: dict[str, Block] = {}
    if len(table):
        parts["pooled"] = Table(table.head(MOST_POOLED), {"weight": report.format_share})
    if shapes:
        parts["shapes"] = _tabulate_shapes(names, shapes)
    return values, parts


def _tabulate_shapes(names: Sequence[str], shapes: Mapping[str, SharedShape]) -> Table:
    """One column for each shared shape: the odds of sharing it, its value if all records do, and its value in each."""
    interval = "{0:.2f} ({1:.2f} to {2:.2f})"
    columns = {"value": ["odds of one value", "one value", *names]}
    for law, shape in shapes.items():
        values = [interval.format(*value) for value in (shape.pooled, *shape.each)]
        columns[f"{law}: {shape.name.removeprefix(f'{law} ')}"] = [report.number(np.exp(shape.log_odds)), *values]
    return Table(pd.DataFrame(columns))


def _list_differences(studies: Sequence[StudySummary]) -> list[str]:
    """Differences other than the data, by name. A file under a name of its own is the same where its content is.

    Inputs are compared where a record is in several studies: those of different records differ as a matter of course.
    """
    differences = []
    manifests = [study.manifest for study in studies]
    versions = [{name: f"{name} {version}" for name, version in own.versions.items()} for own in manifests]
    inputs = [own.inputs for own in manifests] if _share_records(studies) else []
    for what, tables in (("input", inputs), ("version", versions)):
        pairs = [pair for table in tables for pair in table.items()]
        other = [n for n, value in pairs for own in tables if own.get(n, value) != value or value not in own.values()]
        if other:
            differences.append(f"Not the same {what} in every study: {report.format_joined(dict.fromkeys(other))}.")
    other = [what for what in ("seed", "level") if len({getattr(study.form, what) for study in studies}) > 1]
    return [*differences, *(f"Not the same {what} in every study." for what in other)]


def _share_records(studies: Sequence[StudySummary]) -> bool:
    """Whether some record is in several studies."""
    return len({name for study in studies for name in study.records}) < sum(len(study.records) for study in studies)


def _describe_record(name: str, having: Sequence[StudySummary], studies: Sequence[StudySummary]) -> dict[str, Any]:
    """Values of the text on a record: the studies without it, and its units if they differ."""
    units = {study.name: study.records[name].form.units for study in having}
    named = {study: " and ".join(filter(None, (own.force, own.length))) for study, own in units.items()}
    lines = [f"{study}: {text or 'not stated'}" for study, text in named.items()]
    return {
        "name": name,
        "title": having[0].records[name].title,
        "missing": [study.name for study in studies if study not in having],
        "units": lines if len(set(units.values())) > 1 else [],
        "stated": f" ({next(iter(named.values()))})" if len(set(named.values())) == 1 and all(named.values()) else "",
    }


def _build_tables(name: str, having: Sequence[StudySummary]) -> dict[str, Table]:
    """Rankings, predictions and posteriors of a record in all studies; empty ones are left out."""
    predictions, posteriors = (_tabulate_stacked(name, having, what) for what in ("loads", "posteriors"))
    tables = {"rankings": _tabulate_rankings(name, having)}
    if len(predictions):
        comparable = _convert_predictions(predictions, {study.name: study.records[name].form.units for study in having})
        tables["predictions"] = _tabulate_predictions(predictions, comparable=comparable)
    if len(posteriors):
        columns = ["law", "parameter", "study", "median", "low", "high", "unit"]
        order = posteriors.sort_values(["law", "parameter"], kind="stable")[columns]
        tables["posteriors"] = Table(order, {"unit": lambda unit: str(unit) or report.NOTHING})
    return tables


def _convert_predictions(table: pd.DataFrame, units: Mapping[str, Units]) -> bool:
    """Convert to the units of the first study and return whether all rows could be; ``units``: of each study."""
    to = next(iter(units.values()))
    factors = [find_factors_between(units[study], to) for study in table["study"]]
    shown = (units[study] if None in factors else to for study in table["study"])
    table["units"] = [", ".join(filter(None, (own.force, own.length))) or report.NOTHING for own in shown]
    if None in factors:
        return False
    of_force, of_length = np.array(factors, dtype=float).T
    table["force"] = [float(f"{force:.9g}") for force in table["force"] * of_force]  # equal ones to the last digit
    table[_AMPLITUDES] = table[_AMPLITUDES].mul(of_length, axis=0)
    return True


def _tabulate_rankings(name: str, having: Sequence[StudySummary]) -> Table:
    table = _tabulate_stacked(name, having, "ranking")
    order = table.groupby("law", sort=False)["weight"].max().sort_values(ascending=False, kind="stable")
    wide = pd.DataFrame({"law": order.index})
    formats: dict[str, Callable[[float], str]] = {}
    for study in having:
        ranking = study.records[name].ranking.drop_duplicates("law").set_index("law").reindex(order.index)
        weight, error = f"weight: {study.name}", f"held-out error (%): {study.name}"
        wide = wide.assign(**{weight: ranking["weight"].to_numpy(), error: ranking["held_out_error"].to_numpy()})
        formats |= {weight: report.format_share, error: report.format_percent}
    return Table(wide, formats)


def _tabulate_predictions(table: pd.DataFrame, *, comparable: bool) -> Table:
    first = table.drop_duplicates("force").set_index("force")["median"]
    table["difference"] = 100.0 * (table["median"] / table["force"].map(first).to_numpy(float) - 1.0)
    if not comparable:
        table["difference"] = np.nan
    table = table.sort_values("force", kind="stable")
    columns = ["force", "units", "study", *_AMPLITUDES, "linear_overprediction_percent", "difference"]
    headings = {"linear_overprediction_percent": "linear too high by (%)", "difference": "difference (%)"}
    formats = {
        "linear_overprediction_percent": report.format_percent,
        "difference": lambda value: report.format_signed(value).removesuffix(" %"),
    }
    return Table(table[columns], formats, headings)


def _tabulate_stacked(name: str, having: Sequence[StudySummary], what: str) -> pd.DataFrame:
    """A table of every study below one another, with the column ``study``."""
    tables = [getattr(study.records[name], what).assign(study=study.name) for study in having]
    filled = [table for table in tables if not table.empty]
    return pd.concat(filled, ignore_index=True) if filled else pd.DataFrame()
