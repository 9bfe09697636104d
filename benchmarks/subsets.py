"""All 511 subsets of the nine-term polynomial (Eq. 5.3.6) with their statistics, against a loop of statsmodels fits.

Run ``python -m benchmarks subsets``. Ours gives, for every subset, coefficients, standard errors, T-ratios, SSE,
adjusted R^2, AIC, AICc, BIC and the leave-one-out error. The loop fits every subset and reads nothing, which is the
least it can do; a second loop reads standard errors, T-ratios, adjusted R^2, AIC and BIC as well.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import statsmodels.api as sm

from benchmarks._rows import Row, middle, timed
from damping.regression import list_columns_of, parse_terms
from damping.regression.design import Design, design_of, take_columns
from damping.regression.subsets import Subsets, all_subsets
from damping_reed1970 import load_table

TERMS = parse_terms("A^2*omega, A^2, A^3*omega^2, A^3*omega, A^4*omega, A, A^3, A^4, A^2*omega^2")
GOAL = 40.0
REPEATS = 5
PER_LOOP = 10


def nine_terms() -> Design:
    """The design on Table 5.III as the report used it."""
    table = load_table("5_III", "used")
    data = pd.DataFrame({"A": table["A2bar_in"], "omega": table["omega_rad_s"], "E": table["E_in_lb"]})
    return design_of(take_columns(data, ("E", *list_columns_of(TERMS))), "E", TERMS)


def ours(design: Design) -> Subsets:
    """Every subset with all statistics."""
    models = all_subsets(design)
    _ = models.t_ratios, models.criteria
    return models


def loop(design: Design, members: np.ndarray, read: bool) -> np.ndarray:
    """One statsmodels fit a subset, by QR as is right on columns so alike; sums of squared deviations (m,)."""
    sse = []
    for chosen in members:
        result = sm.OLS(design.observed, design.columns[:, chosen]).fit(method="qr")
        if read:
            _ = result.bse, result.tvalues, result.rsquared_adj, result.aic, result.bic
            sse.append(result.ssr)
    return np.array(sse)


def measure() -> list[Row]:
    """Ours beside both loops, runs by turns."""
    design = nine_terms()
    models = ours(design)
    sse = loop(design, models.members, read=True)
    agreement = float(np.max(np.abs(sse / models.sse - 1.0)))
    runs = [
        (
            timed(lambda: ours(design), PER_LOOP),
            timed(lambda: loop(design, models.members, read=False)),
            timed(lambda: loop(design, models.members, read=True)),
        )
        for _ in range(REPEATS)
    ]
    fast, bare, reading = (middle(times) for times in zip(*runs, strict=True))
    remark = f"sums of squares agree to {agreement:.0e}"
    work = "all 511 subsets of nine terms, with statistics"
    return [
        Row(work, fast, "loop of statsmodels fits", bare, at_least=GOAL, right=agreement < 1e-6, remark=remark),
        Row(work, fast, "the same, its statistics read", reading, remark=remark),
    ]
