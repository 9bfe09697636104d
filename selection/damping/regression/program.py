"""The "Multivariate Regression Program I" (SHARE SDA 3104) of section 5.2 for one curve on one table, and its form.

Its print-out has the order and the headings of section 5.2 (``printout.txt``).
"""

import textwrap
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, StrictUndefined

from damping.arrays import FloatArray, Floats, IntArray, plain
from damping.errors import AnalysisError, escape_control
from damping.regression import CONSTANT, Term, list_columns_of, parse_term
from damping.regression.criteria import NAMES
from damping.regression.design import Columns, Design, correlations, design_of, tabulate_variables
from damping.regression.fit import Fit, fit, tabulate_one_term_fits, tabulate_terms
from damping.regression.selecting import Choice, Selection, select
from damping.regression.subsets import Subsets

#: Upper ends of the bands of |percent deviation| in the break-down; what is beyond the last is a band of its own.
BANDS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
#: Largest deviation over the response, root mean squares, of a fit that is exact: a few roundings of 1e-16 each.
EXACT = 1e-14


def break_down(fit: Fit) -> pd.DataFrame:
    """One row for each band low <= |percent deviation| < high (item i): ``low, high, number, percent`` of all.

    The last band is open; observations of 0, which have no percent, are in none.
    """
    edges = (0.0, *BANDS, np.inf)
    size = np.abs(fit.percent)
    numbers = np.array([((size >= low) & (size < high)).sum() for low, high in pairwise(edges)])
    share = 100.0 * numbers / len(size)
    return pd.DataFrame({"low": edges[:-1], "high": edges[1:], "number": numbers, "percent": share})


def sum_up(fit: Fit) -> dict[str, float]:
    """The "goodness-of-fit" sums over all observations of fitted E, observed E-bar, E - E-bar, and of their squares.

    The difference is the report's fitted - observed: minus the deviation.
    """
    columns = {"fitted": fit.fitted, "observed": fit.observed, "difference": -fit.deviations}
    with np.errstate(over="ignore"):
        squares = {f"{name}_squared": float(values @ values) for name, values in columns.items()}
        return {name: float(values.sum()) for name, values in columns.items()} | squares


@dataclass(frozen=True)
class Regression:
    """The output of the program for one curve on one table."""

    data: str  #: name of the table
    choice: Choice
    design: Design  #: all terms and the response
    rows: IntArray  #: of the table used, from 0, (n,)
    independent: dict[str, FloatArray]  #: the independent variables by name
    full: Fit  #: fit of all terms without constraint
    plane: Fit | None  #: fit of a constant and the independent variables as they are; None if they determine none
    selected: Selection  #: what selection chose
    notes: tuple[str, ...]  #: unusual facts


def regression(columns: Columns, response: str, terms: Sequence[Term], choice: Choice, data: str = "") -> Regression:
    """Run the program on the columns of a table.

    ``columns`` of the ``response`` and of everything the terms need; ``data`` names the table in the print-out.

    AnalysisError: a term without a value, or a numerically rank-deficient design (the columns are named).
    """
    design = design_of(columns, response, terms)
    full = fit(design)
    selected = select(design, choice)
    independent = {name: columns.numbers[name] for name in list_columns_of(terms)}
    notes, plane = list(columns.notes), None
    if circular := [term.name for term in terms if response.strip() in term.columns]:
        notes.append(f"{response.strip()} is a factor of {', '.join(circular)}: the response is fitted to itself")
    try:
        plane = fit(design_of(columns, response, [parse_term(CONSTANT), *(Term(((n, 1.0),), n) for n in independent)]))
    except AnalysisError as error:
        notes.append(f"no plane through the independent variables: {error}")
    return Regression(
        data=data,
        choice=choice,
        design=design,
        rows=columns.rows,
        independent=independent,
        full=full,
        plane=plane,
        selected=selected,
        notes=(*notes, *_collect_cautions(selected.fit, selected=selected.fit.k < design.k)),
    )


def _collect_cautions(fit: Fit, *, selected: bool) -> tuple[str, ...]:
    """Cautions on the coefficients; ``selected``: terms were left out."""
    cautions = []
    if fit.n == fit.k:
        cautions.append("as many terms as observations: the fit is exact and gives no errors")
    elif np.linalg.norm(fit.deviations) <= EXACT * np.linalg.norm(fit.observed):
        cautions.append(
            "the fit is exact to the digits of the table: errors, T-ratios and criteria are of rounding, as for a"
            " response that was computed from these terms"
        )
    if fit.condition_number > 1e4:
        cautions.append(
            f"nearly dependent terms: the scaled condition number {fit.condition_number:.2g} magnifies errors of the"
            f" data by up to {int(np.log10(fit.condition_number))} powers of ten, whatever the fit's own accuracy"
        )
    if selected:
        cautions.append("statistics take the selected terms as given: |T| is too large and p too small, of noise too")
    elif not fit.active.all():
        cautions.append("statistics take the terms that are not held at 0 as given")
    return tuple(cautions)


Form = dict[str, Any]
_OF_A_STEP = ("action", "term", "reason", "t_ratio", "score")


def regress_form(result: Regression) -> Form:
    """The JSON form ``regress/1``; missing values are None."""
    fit, design, models = result.selected.fit, result.design, result.selected.models
    form: Form = {
        "format": "regress/1",
        "data": result.data,
        "n": fit.n,
        "response": design.response,
        "terms": _build_terms(fit),
        "one_term_fits": tabulate_one_term_fits(design).to_dict("records"),
        "summary": {
            "rms_error": fit.rms_error,
            "average_absolute_deviation": fit.average_absolute_deviation,
            "average_absolute_percent": fit.average_absolute_percent,
            "standard_error": fit.standard_error,
            "largest_absolute_deviation": fit.largest_absolute_deviation,
            "largest_absolute_percent": fit.largest_absolute_percent,
            "r_squared": fit.r_squared,
            "r_squared_centred": fit.r_squared_centred,
            "correlation_fitted_observed": fit.correlation,
            "squared_correlation": fit.correlation**2,
            "condition_number": fit.condition_number,
            "degrees_of_freedom": fit.n - fit.k,
        },
        "criteria": asdict(fit.criteria),
        "deviations": [],  # in its place among the keys
        "steps": [
            {name: getattr(step, name) for name in _OF_A_STEP} | {"terms": _build_terms(step.fit)}
            for step in result.selected.steps
            if step.action != "start"
        ],
        "selection": asdict(result.choice),
        "subsets": _build_subsets(models),
        # None where every subset was fitted, or none searched
        "proof": asdict(models.proof) if models is not None and models.proof is not None else None,
        "all_terms": _build_terms(result.full),
        "plane": None if result.plane is None else _build_terms(result.plane),
        "variables": tabulate_variables(design).to_dict("records"),
        "correlations": {"names": [*design.names, design.response], "matrix": correlations(design)},
        "goodness_of_fit": sum_up(fit),
        "breakdown": break_down(fit).to_dict("records"),
        "notes": list(result.notes),
    }
    columns = {"observed": fit.observed, "fitted": fit.fitted, "deviation": fit.deviations, "percent": fit.percent}
    columns = plain(columns | {"row": result.rows + 1})
    rows = zip(*columns.values(), strict=True)
    return {**plain(form), "deviations": [dict(zip(columns, row, strict=True)) for row in rows]}


def _build_terms(fit: Fit) -> list[dict[Hashable, Any]]:
    return tabulate_terms(fit).to_dict("records")


def _build_subsets(models: Subsets | None) -> list[Form] | None:
    """The best subsets, best first; None where subsets were not searched."""
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
    template = environment.from_string(Path(__file__).with_name("printout.txt").read_text("utf-8"), globals=functions)
    # names of the input may hold control characters, which are shown and not sent to the terminal
    return "\n".join(map(escape_control, template.render(values).split("\n")))


def describe_comparison(results: Sequence[Regression]) -> str:
    """One line for each fit of several curves or data sets."""
    rows = []
    for result in results:
        fit = result.selected.fit
        numbers = (fit.rms_error, fit.average_absolute_percent, fit.criteria.bic, fit.criteria.leave_one_out_error)
        rows.append((result.data, " + ".join(fit.names), fit.k, *numbers))
    header = ("data", "terms", "k", "rms error", "average %", "BIC", "leave-one-out")
    title, table = "COMPARISON OF FITS", _align_columns(header, rows, left=2)
    return "\n".join(map(escape_control, [title, "-" * len(title), *table.split("\n"), ""]))


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
    """Lines of aligned columns, the first ``left`` to the left; columns beyond the width follow below."""
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
