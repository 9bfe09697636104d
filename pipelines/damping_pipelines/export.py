"""``damping export``: records to universal files and other units, rankings, loads and curves to CSV and Parquet."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from damping.errors import InputError
from damping.formats.quantity import SYSTEMS, convert_curve, convert_loads, convert_mode, convert_record, factors, unit
from damping.formats.uff_values import write_uff
from damping.records.base_drive import has_masses
from damping.records.mode import Mode, Units, describe_mode_to_toml, read_mode
from damping.records.reading import read_record
from damping.records.record import Record, record_to_csv
from damping.records.text import DEFAULT_MAX_SIZE, read_bytes
from damping_pipelines.decks import export_deck
from damping_pipelines.forms import (
    ANSWER,
    MAX_FORM_SIZE,
    Answer,
    FormPart,
    IntervalForm,
    LoadsForm,
    ParameterForm,
    RankForm,
    read_form,
)
from damping_pipelines.store import check_outputs, to_parquet, write_bytes, write_text
from damping_pipelines.terminal import print_lines, report_findings

_UFF = (".uff", ".unv")


def export(
    source: Path,
    out: Path,
    *,
    units: str | None = None,
    given: str | None = None,
    mode: Path | None = None,
    mode_out: Path | None = None,
    text: bool = False,
    to: str | None = None,
    of_record: str | None = None,
    despite: Collection[str] = (),
    max_size: int = DEFAULT_MAX_SIZE,
) -> None:
    """Write a record, or a form ``rank/1``, ``loads/1`` or ``curve/1``, in the format that ``out`` ends with.

    Options are those of ``damping export --help``; ``given`` is ``--from``. The first character identifies a form.
    InputError: bad options, an unreadable file, a record that the audit refuses, unknown or contradictory units, or
    units for a ranking, which is not converted. AnalysisError: a record that a universal file cannot hold, or a mode
    that cannot be converted.
    """
    if to is not None:
        if units or given or mode or mode_out or text:
            raise InputError("--to beside an option of records", expected="--to CODE --out FILE alone")
        export_deck(source, out, to, of_record)
        return
    if of_record is not None:
        raise InputError("--record without --to", expected="--to CODE and the folder of a study")
    inputs = [path for path in (source, mode) if path is not None]
    _check_out(out, text=text)
    check_outputs({"--out": out, "--mode-out": mode_out}, *inputs)
    if read_bytes(source, max_size).lstrip()[:1] == b"{":
        if out.suffix.lower() in _UFF:
            raise InputError("an answer is no record", file=source, expected="--out name.csv or name.parquet")
        if mode_out:
            raise InputError("--mode-out is for records, and this is a form", file=source, expected="no --mode-out")
        _export_form(source, out, units, given, mode, max_size)
        return
    record = read_record(source, max_size=max_size)
    described = read_mode(mode) if mode else None
    names = _names(described.units if described else Units(), given, str(mode or source))
    report_findings(record, described, despite)
    notes: list[str] = []
    if units is not None:
        record, described, notes = _convert(record, described, names, units, str(mode or source))
        names = Units(*SYSTEMS[units], "s")
    if mode_out is not None and (described is None or units is None):
        expected = "--mode MODE.toml and --units"
        raise InputError("--mode-out without a mode to convert", file=mode_out, expected=expected)
    of_base = described is not None and described.drive == "base"
    _write_record(record, names.of_base_drive if of_base else names, out, notes, text=text, of_base=of_base)
    if mode_out is not None and described is not None:  # last: the record may not fit its format
        write_text(mode_out, describe_mode_to_toml(described))


def _check_out(out: Path, *, text: bool) -> None:
    """InputError: a name of no known format, or ``text`` for a format without a text form."""
    kind = out.suffix.lower()
    if kind not in (*_UFF, ".csv", ".parquet"):
        expected = "a name ending in .uff, .unv, .csv or .parquet, or --to nastran or another structural code"
        raise InputError(f"--out {out.name!r} is of no known format", expected=expected)
    if text and kind not in _UFF:
        raise InputError(f"--text beside --out {out.name!r}", expected="a universal file: .uff or .unv")


def _convert(
    record: Record, mode: Mode | None, names: Units, units: str, source: str
) -> tuple[Record, Mode | None, list[str]]:
    """A record and its mode in other units, with notes."""
    by = factors(names, units, source=source)
    if mode is None:
        record, notes = convert_record(record, by, "force")
        notes.append("the column force is taken as a force: --mode tells whether it is a base acceleration")
        return record, None, notes
    # the mass that a base-driven mode has where none is stated is a number
    plain = mode.drive == "base" and mode.mass == 1.0 and not has_masses(record)
    record, notes = convert_record(record, by, mode.drive)
    return record, convert_mode(mode, by.per_mass if plain else by, units), notes


def _names(own: Units, given: str | None, source: str) -> Units:
    """Units as ``--from`` states them, else the ``own`` of a mode or a form. InputError where ``own`` names others."""
    if given is None:
        return own
    if given not in SYSTEMS:
        raise InputError(f"--from {given!r} is unknown", expected=" or ".join(SYSTEMS))
    stated = Units(*SYSTEMS[given], "s")
    stated = stated.of_base_drive if own.drive == "base acceleration" else stated
    for what, text in vars(own).items():
        meant = unit(getattr(stated, what))
        named = unit(text, what=f"unit of {what}") if text else meant
        if not named.agrees_with(meant):
            message = f"{what} is in {text} and --from {given} says {meant.text}"
            raise InputError(message, file=source, expected="one of them, or both alike")
    return stated


def _export_form(
    source: Path, out: Path, units: str | None, given: str | None, mode: Path | None, max_size: int
) -> None:
    """Write a form as a table; loads and curves in other units if requested."""
    form = read_answer(source, max_size)
    table = tabulate_form(form)
    if units is None:
        _write_table(table, out)
        return
    if isinstance(form, RankForm):
        message = "--units is for all but a ranking, with coefficients of many dimensions"
        raise InputError(message, file=source, expected="a ranking of the converted record")
    own = form.units
    described = read_mode(mode) if mode is not None and not (own.force or own.length) else None
    names = _names(described.units if described else own, given, str(mode or source))
    if described and described.drive == "base":
        names = replace(names, time="s").of_base_drive
    by = factors(names, units, source=str(mode or source))
    _write_table(convert_loads(table, by, form.asked) if isinstance(form, LoadsForm) else convert_curve(table, by), out)
    new = Units(*SYSTEMS[units], "s")
    notes = ["numbers within cautions are text and kept as they are"] if table["cautions"].any() else []
    print_lines(f"{len(table)} rows written to {out}, {new.of_base_drive if names.drive != 'force' else new}", notes)


def _write_record(record: Record, names: Units, out: Path, notes: list[str], *, text: bool, of_base: bool) -> None:
    if out.suffix.lower() in _UFF:
        content, lost = write_uff(record, names.length, names.force, binary=not text, of_base=of_base)
        write_bytes(out, content)
        notes = [*notes, *lost]
    else:
        _write_table(record.frame, out)
    print_lines(f"{len(record)} rows written to {out}, {names}", notes)


def _write_table(table: pd.DataFrame, out: Path) -> None:
    if out.suffix.lower() == ".parquet":
        write_bytes(out, to_parquet(table))
    else:
        write_text(out, record_to_csv(table))


def tabulate_form(form: Answer) -> pd.DataFrame:
    """A form as a table; of a curve medians under the name of the quantity, bands as ``NAME_low, NAME_high``."""
    if isinstance(form, RankForm):
        return _tabulate_ranking(form)
    if isinstance(form, LoadsForm):
        return _tabulate_loads(form)
    return _tabulate_typed(pd.DataFrame(map(_flatten, form.rows)), ("cautions",)).assign(level=form.level)


def read_answer(path: Path, max_size: int = MAX_FORM_SIZE) -> Answer:
    """A form ``rank/1``, ``loads/1`` or ``curve/1``. InputError for the first fault."""
    content = read_bytes(path, min(max_size, MAX_FORM_SIZE))
    return read_form(ANSWER, content, path, "a form rank/1, loads/1 or curve/1, as --json writes it")


def _tabulate_ranking(form: RankForm) -> pd.DataFrame:
    """One row for each parameter of each force of each candidate."""
    rows: list[dict[str, Any]] = []
    for model in form.models:
        whole = {"model": model.name, **model.model_dump(exclude={"forces", "cautions", "name", "equivalents"})}
        parameters = [(force.name, *item) for force in model.forces for item in force.parameters().items()]
        for force, parameter, value in parameters or [("", "", ParameterForm())]:
            part = {"force": force, "parameter": parameter, **value.model_dump()}
            rows.append({**whole, **part, "cautions": "; ".join(model.cautions)})
    table = _tabulate_typed(pd.DataFrame(rows), ("model", "force", "parameter", "cautions"))
    return table.assign(criterion=form.criterion)


def _tabulate_loads(form: LoadsForm) -> pd.DataFrame:
    """One row for each design force or amplitude and law, the average over laws first (``model`` empty)."""
    rows: list[dict[str, Any]] = []
    other = "force" if form.asked == "amplitude" else "amplitude"
    for prediction in form.predictions:
        rows.append({"model": "", "weight": None, **_flatten(prediction, "by_model", other)})
        asked = {form.asked: getattr(prediction, form.asked)}
        rows += [{"model": law.name, **asked, **_flatten(law, "name")} for law in prediction.by_model]
    return _tabulate_typed(pd.DataFrame(rows), ("model", "cautions")).assign(level=form.level)


def _flatten(part: FormPart, *without: str) -> dict[str, Any]:
    """A part of a form as columns of a table: an interval as three, cautions as one text."""
    columns: dict[str, Any] = {}
    for name, value in part:
        if name == "cautions":
            columns[name] = "; ".join(value)
        elif name == "damping_ratio" or isinstance(value, IntervalForm):  # a refused load has no damping ratio
            median, low, high = (end for _, end in value or IntervalForm())
            columns |= {name: median, f"{name}_low": low, f"{name}_high": high}
        elif name not in without:
            columns[name] = value
    return columns


def _tabulate_typed(table: pd.DataFrame, text: tuple[str, ...]) -> pd.DataFrame:
    """The table with one type per column: ``text``, integer and Boolean with missing values, and float."""
    types = {"rank": "Int64", "physical": "boolean", "tested": "boolean", **dict.fromkeys(text, "str")}
    filled = table.fillna(dict.fromkeys(text, ""))
    return filled.astype({str(name): types.get(str(name), "float64") for name in table.columns})
