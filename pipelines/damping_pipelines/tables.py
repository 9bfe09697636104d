"""Commands on single tables and records: ``damping regress``, ``condition``, ``check`` and ``sweep``."""

import math
import re
import sys
from collections.abc import Collection, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import typer

import damping
from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError, naming
from damping.records import Audit, audit
from damping.records.mode import Mode, Units, read_mode
from damping.records.reading import read_record, read_table
from damping.records.record import Record, record_to_csv
from damping.regression import list_columns_for, parse_terms
from damping.regression.design import list_required_columns
from damping.regression.program import Regression, describe_comparison
from damping.regression.selecting import Choice
from damping.result import RegressionResult
from damping.signals.chain import ConditioningStep
from damping.signals.description import Description
from damping.signals.reading import check_repeats, condition_steps, list_doubts, read_description, read_raw
from damping_pipelines.store import check_outputs, refuse_unwritable, write_json, write_plain, write_text
from damping_pipelines.terminal import PlainTable, console, name_quantity, number, number_whole, progress

#: Rows beyond which the list of deviations would take more memory than a few times the file.
MOST_ROWS = 100_000
MOST_NUMBERS = 800_000  #: rows times terms beyond which the columns would


def regress(
    data: list[Path],
    response: str,
    terms: list[str],
    *,
    json_out: str | None,
    plots: Path | None,
    max_size: int,
    **choice: Any,
) -> None:
    """Run every curve on every table, then print and write.

    With one table and one curve the JSON is the form ``regress/1``, otherwise a list of them, tables outermost. Nothing
    is written unless every fit succeeded. With ``--json -`` standard output holds only the JSON. ``choice``: the
    selection of terms, as in :func:`damping.regress`.
    """
    check_outputs({"--json": json_out}, *data)
    if plots is not None:
        refuse_unwritable(plots, folder=True)
    # what is not allowed is refused before any table is read
    chosen = Choice(**{"method" if name == "select" else name: value for name, value in choice.items()})
    if chosen.method == "none" and chosen.criterion != Choice().criterion:
        print(f"damping: --criterion {chosen.criterion} changes nothing without --select", file=sys.stderr)
    results = run_regress(data, response, terms, max_size, **choice)
    regressions = [result.regression for result in results]
    drawn = {} if plots is None else {plots / name: text for name, text in deviation_plots(regressions).items()}
    check_outputs({"--json": json_out, **{f"--plots {path.name}": path for path in drawn}}, *data)
    if json_out is not None:
        forms = [result.to_json() for result in results]
        write_plain(json_out, forms[0] if len(forms) == 1 else forms)
    for path, text in drawn.items():
        write_text(path, text)
    if json_out != "-":
        pages = [result.printout() for result in results]
        sys.stdout.write("\n".join([*pages, describe_comparison(regressions)] if len(pages) > 1 else pages))


def run_regress(
    data: Sequence[Path], response: str, curves: Sequence[str], max_size: int, **choice: Any
) -> list[RegressionResult]:
    """Every curve on every table, tables outermost; everything is parsed and read before the first fit.

    InputError: terms that cannot be parsed, a table that cannot be read, a column that is missing or not numbers.
    AnalysisError: a fit that fails; a rank-deficient design names its columns.
    """
    parsed = [parse_terms(curve) for curve in curves]
    names = list_columns_for(response, chain.from_iterable(parsed))
    tables = [(path, _read(path, names, max_size)) for path in data]
    widest = max(len(terms) for terms in parsed)
    for path, table in tables:
        if len(table) * widest > MOST_NUMBERS:
            message = f"{path}: {len(table)} rows of {widest} terms; rows times terms is {MOST_NUMBERS} at most"
            raise AnalysisError(message)
    results = list[RegressionResult]()
    for path, table in tables:
        try:
            for curve in curves:
                results.append(damping.regress(table, response=names[0], terms=curve, source=str(path), **choice))
        except AnalysisError as error:
            raise AnalysisError(f"{path}: {error}") from error
    return results


def _read(path: Path, names: Sequence[str], max_size: int) -> pd.DataFrame:
    """The table; the columns of all names are present and numeric."""
    table = read_table(path, text_columns=("sweep",), max_size=max_size)
    if len(table) > MOST_ROWS:
        raise AnalysisError(f"{path}: {len(table)} rows; every deviation is listed, of {MOST_ROWS} rows at most")
    with naming(path):
        required = list_required_columns(names, list(table.columns))
    numbers = [name for name in required if name != "sweep"]
    text = ("sweep",) if "sweep" not in names else ()  # a label, unless a term takes it as a number
    if text and all(name in table.columns and pd.api.types.is_float_dtype(table[name]) for name in numbers):
        return table
    return read_table(path, required=required, text_columns=text, max_size=max_size)


def deviation_plots(results: Sequence[Regression]) -> dict[str, str]:
    """File names and SVG of the deviations against every independent variable, every term, the fitted response and the
    row."""
    from damping.plots import to_svg  # noqa: PLC0415 - only drawing needs matplotlib
    from damping.plots.fits import deviations_figure  # noqa: PLC0415 - as above

    drawn: dict[str, str] = {}
    for place, result in enumerate(results, start=1):
        fit, response = result.selected.fit, result.design.response
        variables = {
            **result.independent,
            **dict(zip(result.design.names, result.design.columns.T, strict=True)),
            f"fitted {response}": fit.fitted,
            "row": (result.rows + 1).astype(np.float64),
        }
        for name, x in variables.items():
            curve = f"{place}-" if len(results) > 1 else ""
            stem = f"{_describe_file_name(Path(result.data).stem)}-{curve}deviations-{_describe_file_name(name)}"
            taken = {name.lower() for name in drawn}  # where case makes no difference
            stems = (stem, *(f"{stem}-{i}" for i in range(2, len(drawn) + 3)))
            stem = next(free for free in stems if f"{free}.svg".lower() not in taken)
            figure = deviations_figure(x, fit.deviations, fit.percent, x_label=name, response=response)
            title = f"{result.data}: deviations of {response} against {name}"
            largest, average = fit.largest_absolute_deviation, fit.average_absolute_percent
            caption = f"Largest deviation {largest:.4g}, average {average:.4g} per cent."
            drawn[f"{stem}.svg"] = to_svg(figure, stem, title, caption)
            figure.clear()
    return drawn


def _describe_file_name(text: str) -> str:
    """The text as a file name for any system: letters, digits and a few marks."""
    return re.sub(r"[^A-Za-z0-9.+-]+", "_", text.replace("^", "").replace("*", "."))[:80].strip("._") or "table"


def condition(
    raw: Path, config: Path, out: Path, steps: Path | None, max_size: int, despite: Collection[str] = ()
) -> None:
    """Condition a raw table, write the record and, if requested, one CSV per step; print the effect of each step.

    InputError: a description or a table that cannot be read or contradicts itself, or a folder with steps of another
    run. Refused: a check refuses the record and is not among ``despite``. AnalysisError: the requested steps cannot be
    done on this table.
    """
    check_outputs({"--out": out}, raw, config)
    description = read_description(config)
    table = read_raw(raw, description, max_size)
    done = condition_steps(table, description)
    record = done[-1].after
    check_repeats(record, raw, max_size)
    findings = None
    with suppress(InputError):  # a table that is no record is written as it is
        findings = audit(Record(record, str(raw)))
    if findings is not None:
        findings.require(despite)
    texts = {} if steps is None else {steps / name: text for name, text in step_files(done).items()}
    check_outputs({"--out": out, **{f"--steps {path.name}": path for path in texts}}, raw, config)
    for path in sorted(steps.glob("[0-9][0-9]-*.csv")) if steps else ():
        if path not in texts:  # numbers of steps differ between descriptions: two runs cannot be told apart
            raise InputError("is a step of another run", file=path, expected="a folder of its own for each description")
    write_text(out, record_to_csv(record))
    for path, text in texts.items():
        write_text(path, text)
    _print_steps(done, description, out)
    for doubt in list_doubts(table, description, done):
        console().print(f"- caution: {doubt}")
    if findings is not None:
        _print_audit(findings, None, Units(description.units.force, description.units.length, description.units.time))


def step_files(steps: tuple[ConditioningStep, ...]) -> dict[str, str]:
    """One CSV per step by file name: the table after it, its removals and its findings, on the rows before it."""
    files = {}
    for place, step in enumerate(steps, 1):
        table = step.after.reindex(step.before.index).join(step.removed.add_prefix("removed "))
        if len(step.after) < len(step.before):  # rows that were left out keep what the step does not change
            kept = step.before.loc[step.after.index]
            for name in step.before.columns.intersection(step.after.columns):
                if kept[name].equals(step.after[name]):
                    table[name] = step.before[name]
            table["left out"] = (~step.before.index.isin(step.after.index)).astype(int)
        table = table.assign(**step.constants)
        files[f"{place:02d}-{step.name.replace(' ', '-')}.csv"] = record_to_csv(table)
    return files


def _print_steps(steps: tuple[ConditioningStep, ...], description: Description, out: Path) -> None:
    terminal, table = console(), PlainTable(description.title or out.stem, (), ("step", "report", "removed, at most"))
    for step in steps:
        removed = [f"{name}: {np.nanmax(np.abs(step.removed[name])):.3g}" for name in step.removed]
        constants = [f"{name} = {value:.4g}" for name, value in step.constants.items()]
        left = len(step.before) - len(step.after)
        rows = [f"{left} rows without a damping factor"] if left else []
        table.add_row(step.name, step.equation, ", ".join([*removed, *constants, *rows]))
    terminal.print(table)
    names = {what: getattr(description.units, what) for what in ("force", "length", "time")}
    units = ", ".join(f"{what} in {unit}" for what, unit in names.items() if unit) or "one consistent system"
    terminal.print(f"{out}: {len(steps[-1].after)} rows of {len(steps[0].before)}. Units: {units}.")


def check(record: Path, mode: Path | None, json_out: str | None, max_size: int) -> None:
    """Audit a record, print findings and the implied values of its sweeps, write the form; exit 1 if one refuses."""
    check_outputs({"--json": json_out}, *(path for path in (record, mode) if path))
    measured = read_record(record, max_size=max_size)
    described = None if mode is None else read_mode(mode, max_size=max_size)
    findings = audit(measured, described)
    if json_out is not None:
        write_json(json_out, findings.to_json())
    if json_out != "-":
        _print_audit(findings, described)
    if findings.verdict == "refuse":
        raise typer.Exit(1)


def _print_audit(findings: Audit, mode: Mode | None, units: Units | None = None) -> None:
    out = console()
    out.print(str(findings))
    units = mode.units if mode else units or Units()
    units = units.of_base_drive if mode and mode.drive == "base" else units
    measured = name_quantity(units.drive, units.force), name_quantity("amplitude", units.length)
    headings = ("frequency [Hz]", *measured, "mass", "damping ratio", "phase offset [rad]")
    table = PlainTable("Values implied by each sweep at its resonance", headings, ("sweep",))
    for row in findings.implied.to_dict(orient="records"):
        numbers = ("force", "amplitude", "mass", "damping_ratio", "phase_offset")
        implied = (number(float(row[name])) for name in numbers)
        table.add_row(str(row["sweep"]), number_whole(float(row["frequency"])), *implied)
    if mode is not None:
        values = (math.nan, math.nan, mode.mass, mode.viscous_ratio or math.nan, math.nan)
        table.add_row("mode file", number_whole(mode.frequency), *map(number, values))
    out.print(table)


def sweep(
    model: Path, force: list[float], frequency: str, out: Path, direction: str, method: str, *, structure: bool = False
) -> None:
    """Sweep the model through ``frequency`` (``LO:HI:N``, Hz) at each force and write the record ``out``.

    InputError: a bad option, or a model file that cannot be read. AnalysisError: the model has an effect that is not
    simulated, or no steady state somewhere in a sweep.
    """
    check_outputs({"--out": out}, model)
    hertz = _read_frequencies(frequency)
    how: dict[str, Any] = {"direction": direction, "method": method, "structure": structure, "progress": progress}
    swept = damping.sweep(read_mode(model), force=force, frequency=hertz, **how)
    write_text(out, record_to_csv(swept.record))
    for remark in swept.remarks:
        print(f"damping: {model}: {remark}", file=sys.stderr)
    if swept.of_rig:
        print("damping: --structure writes the motion of the structure, which loads need", file=sys.stderr)


def _read_frequencies(text: str) -> FloatArray:
    """LO:HI:N as N equally spaced frequencies from LO to HI, Hz."""
    from damping.gap.sweeping import MOST_POINTS  # noqa: PLC0415 - loads the diagnosis, which only a sweep needs

    expected = "LO:HI:N with 0 < LO < HI in Hz and N >= 2 points"
    try:
        ends = text.split(":")
        low, high, count = float(ends[0]), float(ends[1]), int(":".join(ends[2:]))
    except (ValueError, IndexError):
        raise InputError(f"--frequency {text!r} is not understood", expected=expected) from None
    if count > MOST_POINTS:
        raise InputError(f"--frequency {text!r}: {count} points", expected=f"{MOST_POINTS} points at most")
    if not (0.0 < low < high < math.inf and count >= 2):
        raise InputError(f"--frequency {text!r} is out of range", expected=expected)
    return np.linspace(low, high, count)
