"""The form ``regress/1`` of everything the program says of one curve on one table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import pandas as pd

from damping.arrays import plain
from damping.regression.fit import Fit
from damping.regression.program import Regression

Form = dict[str, Any]


def tabulate_terms(fit: Fit) -> pd.DataFrame:
    """A row a term: ``name, coefficient, std_error, t_ratio, p_value``."""
    columns = (fit.names, fit.coefficients, fit.std_errors, fit.t_ratios, fit.p_values)
    keys = ("name", "coefficient", "std_error", "t_ratio", "p_value")
    return pd.DataFrame(dict(zip(keys, columns, strict=True)))


def regress_form(result: Regression) -> Form:
    """The JSON form ``regress/1``; what does not exist is None."""
    fit, choice = result.selected.fit, result.choice
    form: Form = {
        "format": "regress/1",
        "data": result.data,
        "n": fit.n,
        "response": result.design.response,
        "terms": _list_terms(fit),
        "one_term_fits": [_one_term(one) for one in result.one_term],
        "summary": _summary(result),
        "criteria": asdict(fit.criteria),
        "deviations": [],  # in its place among the keys
        "steps": _list_steps(result),
        "selection": asdict(choice),
        "subsets": _list_subsets(result),
        "proof": _proof(result),
        "all_terms": _list_terms(result.full),
        "plane": None if result.plane is None else _list_terms(result.plane),
        "variables": [asdict(variable) for variable in result.variables],
        "correlations": {"names": [*result.design.names, result.design.response], "matrix": result.correlations},
        "goodness_of_fit": asdict(result.sums),
        "breakdown": [asdict(band) for band in result.bands],
        "notes": list(result.notes),
    }
    return {**plain(form), "deviations": _list_deviations(result)}


def _list_terms(fit: Fit) -> list[Form]:
    return [{str(key): value for key, value in row.items()} for row in tabulate_terms(fit).to_dict("records")]


def _one_term(fit: Fit) -> Form:
    return {
        "name": fit.names[0],
        "coefficient": fit.coefficients[0],
        "t_ratio": fit.t_ratios[0],
        "rms_error": fit.rms_error,
        "r_squared": fit.r_squared,
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


def _list_deviations(result: Regression) -> list[Form]:
    d = result.deviations
    columns = plain((d.observed, d.fitted, d.deviation, d.percent, result.rows + 1))
    keys = ("observed", "fitted", "deviation", "percent", "row")
    return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]


def _list_steps(result: Regression) -> list[Form]:
    return [
        {
            "action": step.action,
            "term": step.term,
            "reason": step.reason,
            "t_ratio": step.t_ratio,
            "score": step.score,
            "terms": _list_terms(step.fit),
        }
        for step in result.selected.steps
        if step.action != "start"
    ]


def _proof(result: Regression) -> Form | None:
    """How many subsets there are, by how many fits none is better than the first, and the least score that one can have
    (lower is better, adjusted R^2 with its sign changed); None where every subset was fitted, or none searched."""
    models = result.selected.models
    return None if models is None or models.proof is None else asdict(models.proof)


def _list_subsets(result: Regression) -> list[Form] | None:
    """The best subsets, best first; None where subsets were not searched."""
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
