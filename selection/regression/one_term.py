"""One-term fits: each transformed variable "as an indicator of E when taken by itself" (report, section 5.2)."""

from __future__ import annotations

from selection.regression.design import Design
from selection.regression.fit import Fit, fit


def one_term_fits(design: Design) -> list[Fit]:
    """The fit of each term alone, most significant first.

    The order is that of |T| and of R^2 about zero, which are one: T^2 = (n - 1) R^2/(1 - R^2). AnalysisError if a
    column is zero at every observation.
    """
    fits = [fit(design.take([i])) for i in range(design.k)]
    return sorted(fits, key=lambda one: one.sse)
