"""The "Multivariate Regression Program I" (SHARE SDA 3104) of section 5.2 for one curve on one table, and its form."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, IntArray, plain
from damping.errors import AnalysisError
from damping.regression import CONSTANT, Term, list_columns_of, parse_term
from damping.regression.design import Columns, Design, correlations, design_of, tabulate_variables
from damping.regression.fit import Fit, fit, one_term_fits
from damping.regression.selecting import Choice, Selection, select
from damping.regression.subsets import Subsets

#: Upper ends of the bands of |percent deviation| in the break-down; what is beyond the last is a band of its own.
BANDS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


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
    """Everything the program says of one curve on one table.

    ``design`` holds all terms and the response; ``full`` the fit of all terms without constraint; ``plane`` that of a
    constant and the independent variables as they are, None where they determine none; ``selected`` what selection
    left; ``rows`` (n,) the rows of the table used, from 0; ``independent`` the independent variables by name;
    ``notes`` say what is unusual.
    """

    data: str
    choice: Choice
    design: Design
    rows: IntArray
    independent: dict[str, FloatArray]
    full: Fit
    plane: Fit | None
    selected: Selection
    notes: tuple[str, ...]


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
    linear = [parse_term(CONSTANT), *(Term(((name, 1.0),), name) for name in independent)]
    try:
        plane = fit(design_of(columns, response, linear))
    except AnalysisError as error:
        notes.append(f"no plane: {error}")
    return Regression(
        data=data,
        choice=choice,
        design=design,
        rows=columns.rows,
        independent=independent,
        full=full,
        plane=plane,
        selected=selected,
        notes=(*notes, *_collect_cautions(selected.fit)),
    )


def _collect_cautions(fit: Fit) -> tuple[str, ...]:
    """What a reader of the coefficients must know."""
    cautions = []
    if fit.n == fit.k:
        cautions.append("as many terms as observations: the fit is exact and says nothing of errors")
    if fit.condition_number > 1e4:
        digits = int(np.log10(fit.condition_number))
        cautions.append(
            f"nearly dependent terms: the scaled condition number {fit.condition_number:.2g} magnifies errors of the"
            f" data by up to {digits} powers of ten, whatever the fit's own accuracy"
        )
    if not fit.active.all():
        cautions.append("statistics take the terms that are not held at 0 as given")
    return tuple(cautions)


Form = dict[str, Any]
_OF_A_STEP = ("action", "term", "reason", "t_ratio", "score")


def tabulate_terms(fit: Fit) -> pd.DataFrame:
    """One row for each term: ``name, coefficient, std_error, t_ratio, p_value``."""
    numbers = {"coefficient": fit.coefficients, "std_error": fit.std_errors, "t_ratio": fit.t_ratios}
    return pd.DataFrame({"name": fit.names, **numbers, "p_value": fit.p_values})


def tabulate_one_term_fits(design: Design) -> pd.DataFrame:
    """The fit of each term alone, most significant first."""
    rows = [(f.names[0], f.coefficients[0], f.t_ratios[0], f.rms_error, f.r_squared) for f in one_term_fits(design)]
    return pd.DataFrame(rows, columns=["name", "coefficient", "t_ratio", "rms_error", "r_squared"])


def regress_form(result: Regression) -> Form:
    """The JSON form ``regress/1``; what does not exist is None."""
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
