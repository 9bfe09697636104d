"""``damping regress``: tables and curves in, print-outs, the form ``regress/1`` and plots out."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.records.reading import read_table
from damping.regression.design import required_columns, take_columns
from damping.regression.fit import Fit
from damping.regression.printout import comparison, printout
from damping.regression.program import Regression, regression
from damping.regression.selecting import Choice
from damping.regression.terms import Term, columns_of, parse_terms
from damping_pipelines.store import plain, refuse_inputs, write_plain, write_text

Form = dict[str, Any]


#: Rows beyond which the list of deviations would take more memory than a few times the file.
MOST_ROWS = 100_000
#: Rows times terms beyond which the columns would.
MOST_NUMBERS = 800_000


def regress(
    data: list[Path],
    response: str,
    terms: list[str],
    select: str,
    criterion: str,
    nonnegative: bool,
    t_stop: float | None,
    json_out: str | None,
    plots: Path | None,
    max_size: int,
) -> None:
    """The command: run every curve on every table, then print and write.

    With one table and one curve the JSON is the form ``regress/1``, otherwise a list of them, tables outermost. Nothing
    is written unless every fit succeeded. With ``--json -`` standard output holds the JSON alone.
    """
    refuse_inputs("--json", json_out, *data)
    results = run_regress(data, response, terms, Choice(select, criterion, nonnegative, t_stop), max_size)
    if json_out is not None:
        _write_forms(json_out, results)
    if plots is not None:
        for name, text in deviation_plots(results).items():
            write_text(plots / name, text)
    if json_out != "-":
        pages = [printout(result) for result in results]
        sys.stdout.write("\n".join([*pages, comparison(results)] if len(pages) > 1 else pages))


def _write_forms(json_out: str, results: Sequence[Regression]) -> None:
    forms = [regress_form(result) for result in results]
    write_plain(json_out, forms[0] if len(forms) == 1 else forms)


def run_regress(
    data: Sequence[Path], response: str, curves: Sequence[str], choice: Choice, max_size: int
) -> list[Regression]:
    """Every curve on every table, tables outermost; all is parsed and read before anything is fitted.

    Raises:
        InputError: terms that cannot be parsed, a table that cannot be read, a column that is missing or not numbers.
        AnalysisError: a fit that cannot be made; a rank-deficient design names its columns.
    """
    parsed = [parse_terms(curve) for curve in curves]
    wanted = response.strip()
    if not wanted:
        raise InputError("the name of the response is empty", expected="a column of the table")
    names = tuple(dict.fromkeys([wanted, *columns_of(term for terms in parsed for term in terms)]))
    tables = [(path, _read(path, names, max_size)) for path in data]
    widest = max(len(terms) for terms in parsed)
    for path, table in tables:
        if len(table) * widest > MOST_NUMBERS:
            raise AnalysisError(
                f"{path}: {len(table)} rows of {widest} terms; rows times terms is {MOST_NUMBERS} at most"
            )
    return [_one(path, table, wanted, terms, choice) for path, table in tables for terms in parsed]


def _one(path: Path, table: pd.DataFrame, response: str, terms: Sequence[Term], choice: Choice) -> Regression:
    names = dict.fromkeys([response, *columns_of(terms)])
    return regression(take_columns(table, names, str(path)), response, terms, choice, path.name)


def _read(path: Path, names: Sequence[str], max_size: int) -> pd.DataFrame:
    """The table; what the names stand for is there and numbers."""
    table = read_table(path, text_columns=("sweep",), max_size=max_size)
    if len(table) > MOST_ROWS:
        raise AnalysisError(f"{path}: {len(table)} rows; every deviation is listed, of {MOST_ROWS} rows at most")
    required = required_columns(names, list(table.columns))
    numbers = [name for name in required if name != "sweep"]
    if "sweep" in names:  # used as a number
        return read_table(path, required=required, max_size=max_size)
    if all(name in table.columns and pd.api.types.is_float_dtype(table[name]) for name in numbers):
        return table
    return read_table(path, required=required, text_columns=("sweep",), max_size=max_size)


def regress_form(result: Regression) -> Form:
    """The JSON form ``regress/1``; what does not exist is None."""
    fit, choice = result.selected.fit, result.choice
    form: Form = {
        "format": "regress/1",
        "data": result.data,
        "n": fit.n,
        "response": result.design.response,
        "terms": _terms(fit),
        "one_term_fits": [_one_term(one) for one in result.one_term],
        "summary": _summary(result),
        "criteria": asdict(fit.criteria),
        "deviations": [],  # in its place among the keys
        "steps": _steps(result),
        "selection": asdict(choice),
        "subsets": _subsets(result),
        "all_terms": _terms(result.full),
        "plane": None if result.plane is None else _terms(result.plane),
        "variables": [asdict(variable) for variable in result.variables],
        "correlations": {"names": [*result.design.names, result.design.response], "matrix": result.correlations},
        "goodness_of_fit": asdict(result.sums),
        "breakdown": [asdict(band) for band in result.bands],
        "notes": list(result.notes),
    }
    return {**plain(form), "deviations": _deviations(result)}


def _terms(fit: Fit) -> list[Form]:
    columns = (fit.names, fit.coefficients, fit.std_errors, fit.t_ratios, fit.p_values)
    keys = ("name", "coefficient", "std_error", "t_ratio", "p_value")
    return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]


def _one_term(one: Fit) -> Form:
    return {
        "name": one.names[0],
        "coefficient": one.coefficients[0],
        "t_ratio": one.t_ratios[0],
        "rms_error": one.rms_error,
        "r_squared": one.r_squared,
    }


def _summary(result: Regression) -> Form:
    fit, deviations = result.selected.fit, result.deviations
    return {
        "rms_error": fit.rms_error,
        "average_absolute_deviation": deviations.average_absolute,
        "average_absolute_percent": deviations.average_absolute_percent,
        "standard_error": fit.standard_error,
        "largest_absolute_deviation": deviations.largest_absolute,
        "largest_absolute_percent": deviations.largest_absolute_percent,
        "r_squared": fit.r_squared,
        "r_squared_centred": fit.r_squared_centred,
        "correlation_fitted_observed": fit.correlation,
        "squared_correlation": fit.correlation**2,
        "condition_number": fit.condition_number,
        "degrees_of_freedom": fit.n - fit.k,
    }


def _deviations(result: Regression) -> list[Form]:
    d = result.deviations
    columns = plain((d.observed, d.fitted, d.deviation, d.percent, result.rows + 1))
    keys = ("observed", "fitted", "deviation", "percent", "row")
    return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]


def _steps(result: Regression) -> list[Form]:
    return [
        {
            "action": step.action,
            "term": step.term,
            "reason": step.reason,
            "t_ratio": step.t_ratio,
            "score": step.score,
            "terms": _terms(step.fit),
        }
        for step in result.selected.steps
        if step.action != "start"
    ]


def _subsets(result: Regression) -> list[Form] | None:
    """The best subsets of each size, best first over all; None where subsets were not searched."""
    models = result.selected.models
    if models is None:
        return None
    columns: Mapping[str, Any] = {"sse": models.sse, "rms_error": models.rms_errors, **asdict(models.criteria)}
    return [
        {
            "terms": list(models.label(i)),
            "coefficients": models.coefficients[i, models.members[i]],
            "t_ratios": models.t_ratios[i, models.members[i]],
            **{name: values[i] for name, values in columns.items()},
        }
        for i in range(len(models))
    ]


def deviation_plots(results: Sequence[Regression]) -> dict[str, str]:
    """File names and SVG of the deviations against every independent variable, every term, the fitted response and the
    row."""
    from damping.plots.fits import deviations_figure  # noqa: PLC0415 - only drawing needs matplotlib
    from damping.plots.style import to_svg  # noqa: PLC0415 - as above

    drawn: dict[str, str] = {}
    for number, result in enumerate(results, start=1):
        d, response = result.deviations, result.design.response
        for name, x in _variables(result).items():
            curve = f"{number}-" if len(results) > 1 else ""
            stem = _unused(f"{_file_name(Path(result.data).stem)}-{curve}deviations-{_file_name(name)}", drawn)
            figure = deviations_figure(x, d.deviation, d.percent, x_label=name, response=response)
            title = f"{result.data}: deviations of {response} against {name}"
            told = f"Largest deviation {d.largest_absolute:.4g}, average {d.average_absolute_percent:.4g} per cent."
            drawn[f"{stem}.svg"] = to_svg(figure, stem, title, told)
            figure.clear()
    return drawn


def _variables(result: Regression) -> dict[str, FloatArray]:
    """What deviations are drawn against, by name."""
    return {
        **result.independent,
        **dict(zip(result.design.names, result.design.columns.T, strict=True)),
        f"fitted {result.design.response}": result.deviations.fitted,
        "row": (result.rows + 1).astype(np.float64),
    }


def _file_name(text: str) -> str:
    """Letters, digits and a few marks of the text, for a file name on any system."""
    return re.sub(r"[^A-Za-z0-9.+-]+", "_", text.replace("^", "").replace("*", "."))[:80].strip("._") or "table"


def _unused(stem: str, taken: Mapping[str, str]) -> str:
    """The stem, numbered if a file has it already, also where case makes no difference."""
    lower = {name.lower() for name in taken}
    names = (stem, *(f"{stem}-{i}" for i in range(2, len(taken) + 3)))
    return next(name for name in names if f"{name}.svg".lower() not in lower)
