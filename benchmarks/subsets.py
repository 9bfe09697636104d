"""All 511 subsets of the nine-term polynomial (Eq. 5.3.6) with their statistics, against a loop of statsmodels fits.

Run ``python -m benchmarks.subsets``. Ours gives, for every subset, coefficients, standard errors, T-ratios, SSE,
adjusted R^2, AIC, AICc, BIC and the leave-one-out error. The loop fits every subset and reads nothing, which is the
least it can do; a second loop reads standard errors, T-ratios, adjusted R^2, AIC and BIC as well. Then the best of all
2^20 - 1 subsets of 20 terms on 200 rows.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import perf_counter

import numpy as np
import pandas as pd
import statsmodels.api as sm

from selection.records.report_tables import load_table
from selection.regression.columns import take_columns
from selection.regression.design import Design, design_of, design_of_arrays
from selection.regression.subsets import Subsets, all_subsets, best_subsets
from selection.regression.terms import columns_of, parse_terms

TERMS = parse_terms("A^2*omega, A^2, A^3*omega^2, A^3*omega, A^4*omega, A, A^3, A^4, A^2*omega^2")
GOAL, REPEATS, PER_LOOP = 40.0, 7, 20
GOAL_20_TERMS_S = 10.0


def nine_terms() -> Design:
    """The design on Table 5.III as the report used it."""
    table = load_table("5_III", "used")
    data = pd.DataFrame({"A": table["A2bar_in"], "omega": table["omega_rad_s"], "E": table["E_in_lb"]})
    return design_of(take_columns(data, ("E", *columns_of(TERMS))), "E", TERMS)


def ours(design: Design) -> Subsets:
    """Every subset with all statistics."""
    models = all_subsets(design)
    _ = models.t_ratios, models.criteria
    return models


def loop(design: Design, members: np.ndarray, read: bool) -> None:
    """One statsmodels fit a subset."""
    for chosen in members:
        result = sm.OLS(design.observed, design.columns[:, chosen]).fit()
        if read:
            _ = result.bse, result.tvalues, result.rsquared_adj, result.aic, result.bic


def seconds(work: Callable[[], object], repeats: int = 1) -> float:
    """Time of one run, averaged over ``repeats``."""
    start = perf_counter()
    for _ in range(repeats):
        work()
    return (perf_counter() - start) / repeats


def compare() -> tuple[float, float, float]:
    """Median seconds of ours and the bare loop, and the median ratio loop/ours of runs one after the other."""
    design = nine_terms()
    members = ours(design).members
    loop(design, members[:20], read=True)
    pairs = [
        (seconds(lambda: ours(design), PER_LOOP), seconds(lambda: loop(design, members, read=False)))
        for _ in range(REPEATS)
    ]
    reading = median(seconds(lambda: loop(design, members, read=True)) for _ in range(3))
    fast, slow = (median(times) for times in zip(*pairs, strict=True))
    ratio = median(b / a for a, b in pairs)
    print(
        f"all 511 subsets with statistics: {1e3 * fast:.2f} ms; loop of statsmodels fits: {1e3 * slow:.1f} ms;"
        f" ratio {ratio:.0f} (goal >= {GOAL:g}); loop that reads statistics: {1e3 * reading:.1f} ms,"
        f" ratio {reading / fast:.0f}"
    )
    return fast, slow, ratio


def twenty_terms() -> None:
    """The best of a million subsets, by BIC and by leave-one-out error."""
    rng = np.random.default_rng(20)
    columns = rng.normal(size=(200, 20))
    design = design_of_arrays(columns, columns[:, :5].sum(axis=1) + rng.normal(size=200))
    for criterion in ("bic", "loo"):
        taken = seconds(lambda criterion=criterion: best_subsets(design, criterion))  # type: ignore[misc]
        print(f"best of 2^20 - 1 subsets, 200 rows, by {criterion}: {taken:.1f} s (goal <= {GOAL_20_TERMS_S:g} s)")


def main() -> None:
    compare()
    twenty_terms()


if __name__ == "__main__":
    main()
