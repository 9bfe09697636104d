"""The "Multivariate Regression Program I" (SHARE SDA 3104) of the report's section 5.2, for one curve on one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray, IntArray
from selection.errors import AnalysisError
from selection.regression.columns import Columns
from selection.regression.design import Design, Variable, correlations, design_of, variables
from selection.regression.deviations import Band, Deviations, Sums, breakdown, deviations_of, goodness_of_fit
from selection.regression.fit import Fit, fit
from selection.regression.one_term import one_term_fits
from selection.regression.selecting import Choice, Selected, select
from selection.regression.terms import CONSTANT, Term, columns_of, parse_term


@dataclass(frozen=True)
class Regression:
    """Everything the program says of one curve on one table.

    ``design`` holds all terms; ``variables`` and ``correlations`` (k+1, k+1) describe them and the response (last);
    ``one_term`` their one-term fits, most significant first; ``full`` the fit of all terms without constraint;
    ``plane`` the fit of a constant and the independent variables as they are, None where they determine none;
    ``selected`` what selection left, to which ``deviations``, ``sums`` and ``bands`` belong; ``rows`` (n,) the rows of
    the table used, from 0; ``independent`` the independent variables by name; ``notes`` say what is unusual.
    """

    data: str
    choice: Choice
    design: Design
    rows: IntArray
    independent: dict[str, FloatArray]
    variables: list[Variable]
    correlations: FloatArray
    one_term: list[Fit]
    full: Fit
    plane: Fit | None
    selected: Selected
    deviations: Deviations
    sums: Sums
    bands: list[Band]
    notes: tuple[str, ...]


def regression(columns: Columns, response: str, terms: Sequence[Term], choice: Choice, data: str = "") -> Regression:
    """Run the program on the columns of a table.

    Args:
        columns: of the response and of everything the terms need.
        response: name of the dependent column.
        terms: the transformations.
        choice: how terms are selected.
        data: name of the table, for the print-out.

    Raises:
        AnalysisError: a term without a value, or a numerically rank-deficient design (the columns are named).
    """
    design = design_of(columns, response, terms)
    full = fit(design)
    selected = select(design, choice)
    deviations = deviations_of(selected.fit)
    independent = {name: columns.numbers[name] for name in columns_of(terms)}
    plane, why_not = _plane(columns, response, tuple(independent))
    return Regression(
        data=data,
        choice=choice,
        design=design,
        rows=columns.rows,
        independent=independent,
        variables=variables(design),
        correlations=correlations(design),
        one_term=one_term_fits(design),
        full=full,
        plane=plane,
        selected=selected,
        deviations=deviations,
        sums=goodness_of_fit(selected.fit),
        bands=breakdown(deviations),
        notes=(*columns.notes, *why_not, *_cautions(selected.fit)),
    )


def _plane(columns: Columns, response: str, independent: tuple[str, ...]) -> tuple[Fit | None, tuple[str, ...]]:
    """The plane, or why there is none."""
    terms = [parse_term(CONSTANT), *(Term(((name, 1.0),), name) for name in independent)]
    try:
        return fit(design_of(columns, response, terms)), ()
    except AnalysisError as error:
        return None, (f"no plane: {error}",)


def _cautions(found: Fit) -> tuple[str, ...]:
    """What a reader of the coefficients must know."""
    cautions = []
    if found.n == found.k:
        cautions.append("as many terms as observations: the fit is exact and says nothing of errors")
    if found.condition_number > 1e4:
        digits = int(np.log10(found.condition_number))
        cautions.append(
            f"nearly dependent terms: the scaled condition number {found.condition_number:.2g} magnifies errors of the"
            f" data by up to {digits} powers of ten, whatever the fit's own accuracy"
        )
    if not found.active.all():
        cautions.append("statistics take the terms that are not held at 0 as given")
    return tuple(cautions)
