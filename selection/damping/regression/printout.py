"""The print-out of the regression program, in the order and with the headings of section 5.2 of the report."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

import numpy as np

from damping.arrays import Floats
from damping.errors import escape_control
from damping.regression.criteria import NAMES
from damping.regression.fit import Fit
from damping.regression.program import Regression

#: Columns of a terminal that a line keeps to.
WIDTH = 80
_MOST_MODELS = 20  # of the best subsets; all that are listed are in the JSON form
_MOST_ROWS = 1000  # of the table of deviations; all are in the JSON form


def printout(result: Regression) -> str:
    """All statistics of one curve on one table, as text that ends in a line end."""
    parts = [_describe_heading(result), _describe_variables(result)]
    parts += [_describe_correlations(result), _describe_one_term(result)]
    if result.plane is not None:
        parts.append(_describe_section("PLANE THROUGH THE INDEPENDENT VARIABLES", _format_coefficients(result.plane)))
    selects = result.choice.method != "none" or result.choice.nonnegative
    if selects:
        parts.append(_describe_section("REGRESSION OF ALL TERMS, COEFFICIENTS FREE", _format_coefficients(result.full)))
        parts.append(_describe_selection(result))
    fit = result.selected.fit
    title = "REGRESSION OF THE SELECTED TERMS" if selects else "REGRESSION"
    parts.append(_describe_section(title, _format_coefficients(fit)))
    parts.append(_describe_section("TERMS IN DESCENDING ORDER OF T-RATIO", _rank_by_t_ratio(fit)))
    parts += [_describe_goodness(result), _describe_criteria(result)]
    parts += [_describe_bands(result), _describe_deviations(result)]
    if result.notes:
        parts.append(_describe_section("NOTES", [line for note in result.notes for line in _wrap(f"- {note}")]))
    return _describe_shown("\n".join(parts))


def describe_comparison(results: Sequence[Regression]) -> str:
    """One line a fit, where several curves or several data sets were asked for."""
    rows = []
    for result in results:
        fit, percent = result.selected.fit, result.deviations.average_absolute_percent
        numbers = (fit.rms_error, percent, fit.criteria.bic, fit.criteria.leave_one_out_error)
        rows.append((result.data, " + ".join(fit.names), str(fit.k), *map(_number, numbers)))
    header = ("data", "terms", "k", "rms error", "average %", "BIC", "leave-one-out")
    return _describe_shown(_describe_section("COMPARISON OF FITS", _align_columns(header, rows, left=2)))


def _describe_shown(text: str) -> str:
    """Control characters in names of the input are shown, not sent to the terminal."""
    return "\n".join(map(escape_control, text.split("\n")))


def _number(value: Floats) -> str:
    return "-" if np.isnan(value) else f"{value:.6g}"


def _describe_section(title: str, lines: Iterable[str]) -> str:
    return "\n".join([title, "-" * len(title), *lines, ""])


def _align_columns(header: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> list[str]:
    """Aligned columns, the first ``left`` to the left; those that do not fit beside them follow below."""
    widths = [max(len(cell) for cell in column) for column in zip(header, *rows, strict=True)]
    lines: list[str] = []
    for columns in _split_columns(widths, left):
        lines += [""] * bool(lines)
        lines += [
            "  ".join(row[i].ljust(widths[i]) if i < left else row[i].rjust(widths[i]) for i in columns).rstrip()
            for row in (header, *rows)
        ]
    return lines


def _split_columns(widths: Sequence[int], left: int) -> list[list[int]]:
    """Indices of the columns of each block as wide as a terminal at most; the first ``left`` stand in every block."""
    first = list(range(left))
    blocks = [list(first)]
    for i in range(left, len(widths)):
        if len(blocks[-1]) > left and sum(widths[j] + 2 for j in [*blocks[-1], i]) - 2 > WIDTH:
            blocks.append(list(first))
        blocks[-1].append(i)
    return blocks


def _describe_heading(result: Regression) -> str:
    terms = " + ".join(f"a{i + 1} {name}" for i, name in enumerate(result.design.names))
    size = f"{result.data or 'table'}, number of observations {result.design.n}"
    lines = [size, *_wrap(f"{result.design.response} = {terms}")]
    return _describe_section("MULTIVARIATE REGRESSION PROGRAM I", lines)


def _wrap(text: str) -> list[str]:
    """Lines of prose or of a formula, no name broken."""
    return textwrap.wrap(text, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)


def _describe_variables(result: Regression) -> str:
    header = ("variable", "sum", "average value", "standard deviation", "sum of squares")
    rows = [(name, *map(_number, numbers)) for name, *numbers in result.variables.itertuples(index=False)]
    return _describe_section("TRANSFORMED VARIABLES", _align_columns(header, rows))


def _describe_correlations(result: Regression) -> str:
    names = (*result.design.names, result.design.response)
    rows = [
        (name, *("-" if np.isnan(value) else f"{value:.5f}" for value in row[: i + 1]), *[""] * (len(names) - i - 1))
        for i, (name, row) in enumerate(zip(names, result.correlations, strict=True))
    ]
    return _describe_section("CORRELATION COEFFICIENTS", _align_columns(("", *names), rows))


def _describe_one_term(result: Regression) -> str:
    header = ("term", "coefficient", "T-ratio", "rms error", "R^2 about zero")
    rows = [
        (fit.names[0], *map(_number, (fit.coefficients[0], fit.t_ratios[0], fit.rms_error, fit.r_squared)))
        for fit in result.one_term
    ]
    return _describe_section("ONE-TERM FITS IN DECREASING ORDER OF SIGNIFICANCE", _align_columns(header, rows))


def _format_coefficients(fit: Fit) -> list[str]:
    header = ("term", "coefficient", "standard error", "T-ratio", "p-value")
    columns = (fit.coefficients, fit.std_errors, fit.t_ratios, fit.p_values)
    rows = [(name, *map(_number, row)) for name, *row in zip(fit.names, *columns, strict=True)]
    held = [] if fit.active.all() else ["A coefficient of 0 without standard error is held there: coefficients >= 0."]
    return [*_align_columns(header, rows), *held, f"Scaled condition number {fit.condition_number:.4g}"]


def _rank_by_t_ratio(fit: Fit) -> list[str]:
    order = np.argsort(-np.nan_to_num(np.abs(fit.t_ratios), nan=0.0), kind="stable")
    return _align_columns(("term", "T-ratio"), [(fit.names[i], _number(fit.t_ratios[i])) for i in order])


def _describe_selection(result: Regression) -> str:
    choice = result.choice
    by = NAMES[choice.criterion] if choice.t_stop is None else f"|T| = {choice.t_stop:g}"
    title = f"SELECTION: {choice.method}" + ("" if choice.method == "none" else f", by {by}")
    title += ", coefficients >= 0" if choice.nonnegative else ""
    lines = [f"{step.action:5s}  {step.term:14s}  {step.reason}" for step in result.selected.steps]
    return _describe_section(title, [*lines, *_describe_models(result)])


def _describe_models(result: Regression) -> list[str]:
    """The best subsets, where all were searched, and what proves them so."""
    models = result.selected.models
    if models is None:
        return []
    score = models.scores(result.choice.criterion) * (-1.0 if result.choice.criterion == "adjusted-r2" else 1.0)
    rows = [
        (" + ".join(models.label(i)), str(models.sizes[i]), *map(_number, (score[i], models.rms_errors[i])))
        for i in range(min(_MOST_MODELS, len(models)))
    ]
    proof, every = models.proof, f"all 2^{len(models.names)} - 1 subsets"
    proved = f"best of {every}, each fitted" if proof is None else f"best of {every}, proved by {proof.nodes} fits"
    return ["", *_align_columns(("best subsets", "k", NAMES[result.choice.criterion], "rms error"), rows), proved]


def _describe_goodness(result: Regression) -> str:
    sums, fit, deviations = result.sums, result.selected.fit, result.deviations
    names = ("fitted", "observed", "difference")
    table = _align_columns(
        ("", "fitted E", "observed E", "E fitted - observed"),
        [
            ("sum", *(_number(sums[name]) for name in names)),
            ("sum of squares", *(_number(sums[f"{name}_squared"]) for name in names)),
        ],
    )
    rows = [
        ("a) root-mean-square error", fit.rms_error),
        ("b) average absolute deviation", deviations.average_absolute),
        ("c) average absolute per cent of deviation", deviations.average_absolute_percent),
        ("d) standard error of the regression", fit.standard_error),
        ("e) largest absolute deviation", deviations.largest_absolute),
        ("f) largest absolute per cent of deviation", deviations.largest_absolute_percent),
        ("g) square of the correlation coefficient", fit.correlation**2),
        ("h) correlation coefficient, fitted against observed", fit.correlation),
        ("   R^2 about zero, 1 - SSE/sum y^2", fit.r_squared),
        ("   R^2 about the mean, 1 - SSE/sum (y - mean)^2", fit.r_squared_centred),
    ]
    figures = _align_columns(("", ""), [(name, _number(value)) for name, value in rows])[1:]
    return _describe_section("GOODNESS OF FIT", [*table, "", *figures])


def _describe_criteria(result: Regression) -> str:
    names = ("AIC", "AICc", "BIC", "adjusted R^2 about zero", "leave-one-out error")
    values = vars(result.selected.fit.criteria).values()
    rows = [(name, _number(value)) for name, value in zip(names, values, strict=True)]
    return _describe_section("CRITERIA", _align_columns(("", ""), rows)[1:])


def _describe_bands(result: Regression) -> str:
    rows = [
        (f"{low:g} to {high:g}" if np.isfinite(high) else f"{low:g} and more", str(number), f"{percent:.1f}")
        for low, high, number, percent in result.bands.itertuples(index=False)
    ]
    header = ("i) |per cent deviation|", "observations", "per cent of them")
    return _describe_section("OBSERVATIONS BY PER CENT OF DEVIATION", _align_columns(header, rows))


def _describe_deviations(result: Regression) -> str:
    d = result.deviations
    columns = (d.observed, d.fitted, d.deviation)
    rows = [
        (str(row + 1), *map(_number, values), "-" if np.isnan(percent) else f"{percent:.3f}")
        for row, percent, *values in zip(result.rows[:_MOST_ROWS], d.percent, *columns, strict=False)
    ]
    left_out = len(d.observed) - len(rows)
    more = [f"and {left_out} more"] if left_out else []
    header = ("row", "observed", "fitted", "deviation", "per cent")
    return _describe_section("DEVIATIONS (observed - fitted)", [*_align_columns(header, rows), *more])
