"""The print-out of the regression program, in the order and with the headings of section 5.2 (``printout.txt``)."""

import textwrap
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from damping.arrays import Floats
from damping.errors import escape_control
from damping.regression.criteria import NAMES
from damping.regression.design import correlations, tabulate_variables
from damping.regression.program import Regression, break_down, sum_up, tabulate_one_term_fits

#: Columns of a terminal that a line keeps to.
WIDTH = 80
_MOST_MODELS = 20  # of the best subsets; all that are listed are in the JSON form
_MOST_ROWS = 1000  # of the table of deviations; all are in the JSON form


def printout(result: Regression) -> str:
    """All statistics of one curve on one table, as text that ends in a line end."""
    choice, fit = result.choice, result.selected.fit
    judge = NAMES[choice.criterion] if choice.t_stop is None else f"|T| = {choice.t_stop:g}"
    names = (*result.design.names, result.design.response)
    by_size = np.argsort(-np.nan_to_num(np.abs(fit.t_ratios), nan=0.0), kind="stable")
    columns = (fit.observed, fit.fitted, fit.deviations)
    values = {
        **vars(result),
        "fit": fit,
        "terms": [f"a{i + 1} {name}" for i, name in enumerate(result.design.names)],
        "names": names,
        "variables": tabulate_variables(result.design),
        "sums": sum_up(fit),
        "triangle": [
            (name, *(_number(value, ".5f") for value in row[: i + 1]), *[""] * (len(names) - i - 1))
            for i, (name, row) in enumerate(zip(names, correlations(result.design), strict=True))
        ],
        "alone": tabulate_one_term_fits(result.design).itertuples(index=False),
        "selects": choice.method != "none" or choice.nonnegative,
        "by": "" if choice.method == "none" else f", by {judge}",
        "criterion": NAMES[choice.criterion],
        "models": _list_models(result),
        "most_models": _MOST_MODELS,
        "by_t_ratio": [(fit.names[i], fit.t_ratios[i]) for i in by_size],
        "shares": [
            (f"{low:g} to {high:g}" if np.isfinite(high) else f"{low:g} and more", number, _number(percent, ".1f"))
            for low, high, number, percent in break_down(fit).itertuples(index=False)
        ],
        "listed": [
            (str(row + 1), *numbers, _number(percent, ".3f"))
            for row, percent, *numbers in zip(result.rows[:_MOST_ROWS], fit.percent, *columns, strict=False)
        ],
        "most_rows": _MOST_ROWS,
    }
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True)
    # lines of prose or of a formula, no name broken
    wrap = partial(textwrap.fill, width=WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    functions = {"table": _align_columns, "wrap": wrap, "number": _number, "zip": zip}
    template = environment.from_string(Path(__file__).with_suffix(".txt").read_text("utf-8"), globals=functions)
    return _show_control(template.render(values))


def describe_comparison(results: Sequence[Regression]) -> str:
    """One line for each fit, where several curves or several data sets were asked for."""
    rows = []
    for result in results:
        fit = result.selected.fit
        numbers = (fit.rms_error, fit.average_absolute_percent, fit.criteria.bic, fit.criteria.leave_one_out_error)
        rows.append((result.data, " + ".join(fit.names), fit.k, *numbers))
    header = ("data", "terms", "k", "rms error", "average %", "BIC", "leave-one-out")
    title = "COMPARISON OF FITS"
    return _show_control("\n".join([title, "-" * len(title), _align_columns(header, rows, left=2), ""]))


def _show_control(text: str) -> str:
    """Control characters in names of the input are shown, not sent to the terminal."""
    return "\n".join(map(escape_control, text.split("\n")))


def _number(value: Floats, form: str = ".6g") -> str:
    return "-" if np.isnan(value) else format(value, form)


def _list_models(result: Regression) -> list[tuple[Any, ...]]:
    """Terms, size, criterion and error of the best subsets, where all were searched."""
    models = result.selected.models
    if models is None:
        return []
    score = models.scores(result.choice.criterion) * (-1.0 if result.choice.criterion == "adjusted-r2" else 1.0)
    labels = [" + ".join(models.label(i)) for i in range(len(models))]
    if max(map(len, labels)) > WIDTH // 2:  # names beside which no number fits: numbered, as in the equation above
        labels = [" + ".join(f"a{i + 1}" for i in np.flatnonzero(members)) for members in models.members]
    return list(zip(labels, models.sizes, score, models.rms_errors, strict=True))


def _align_columns(header: Sequence[str] | None, rows: Iterable[Sequence[Any]], left: int = 1) -> str:
    """Lines of aligned columns, the first ``left`` to the left; those that do not fit beside them follow below."""
    written = [header] if header else []
    written += [
        [str(cell) if isinstance(cell, str | int | np.integer) else _number(cell) for cell in row] for row in rows
    ]
    widths = [max(len(cell) for cell in column) for column in zip(*written, strict=True)]
    blocks = [
        "\n".join(
            "  ".join(row[i].ljust(widths[i]) if i < left else row[i].rjust(widths[i]) for i in columns).rstrip()
            for row in written
        )
        for columns in _split_columns(widths, left)
    ]
    return "\n\n".join(blocks)


def _split_columns(widths: Sequence[int], left: int) -> list[list[int]]:
    """Indices of the columns of each block as wide as a terminal at most; the first ``left`` stand in every block."""
    first = list(range(left))
    blocks = [list(first)]
    for i in range(left, len(widths)):
        if len(blocks[-1]) > left and sum(widths[j] + 2 for j in [*blocks[-1], i]) - 2 > WIDTH:
            blocks.append(list(first))
        blocks[-1].append(i)
    return blocks
