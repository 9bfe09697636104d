"""The best of all 2^20 - 1 subsets of 20 correlated terms on 200 rows, by BIC and by the leave-one-out error.

Run ``python -m benchmarks.best_subset``. Peers: an exhaustive loop of fits by QR (numpy, about the quickest a loop can
be), timed on some subsets and extrapolated to all; and abess, which searches and does not look at all, by its own BIC
and by 20-fold cross-validation (it has no leave-one-out). What abess finds is scored by our criteria.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks._rows import Row, timed
from damping.regression.design import Design, design_of_arrays
from damping.regression.fit import fit
from damping.regression.subsets import Subsets, best_subsets

TERMS, ROWS, GOAL_S, SAMPLE = 20, 200, 10.0, 2000
#: Correlation of neighbouring columns; true coefficients, small ones among them.
CORRELATION, TRUE = 0.8, {0: 1.0, 3: -0.6, 4: 0.5, 9: 0.3, 15: 0.2}


def design() -> Design:
    """Columns with correlation .8^|i - j| and a response of five of them with noise 1."""
    rng = np.random.default_rng(20)
    columns = rng.normal(size=(ROWS, TERMS))
    for j in range(1, TERMS):
        columns[:, j] = CORRELATION * columns[:, j - 1] + np.sqrt(1.0 - CORRELATION**2) * columns[:, j]
    return design_of_arrays(columns, sum(c * columns[:, j] for j, c in TRUE.items()) + rng.normal(size=ROWS))


def loop(data: Design, members: np.ndarray, criterion: str) -> np.ndarray:
    """Score of each subset (m,), one least-squares fit each; BIC up to a constant."""
    scores = []
    for chosen in members:
        columns = data.columns[:, chosen]
        q, r = np.linalg.qr(columns)
        deviations = data.observed - q @ (q.T @ data.observed)
        if criterion == "loo":
            scores.append(np.sqrt(np.mean((deviations / (1.0 - np.sum(q**2, axis=1))) ** 2)))
        else:
            np.linalg.solve(r, q.T @ data.observed)
            scores.append(ROWS * np.log(deviations @ deviations) + chosen.sum() * np.log(ROWS))
    return np.array(scores)


def by_abess(data: Design, criterion: str) -> Callable[[], np.ndarray]:
    """A run of abess: which terms it takes (k,)."""
    from abess import LinearRegression  # noqa: PLC0415 - a peer, installed for benchmarks alone

    if criterion == "loo":
        model = LinearRegression(support_size=range(TERMS + 1), cv=20, fit_intercept=False)
    else:
        model = LinearRegression(support_size=range(TERMS + 1), ic_type="bic", fit_intercept=False)
    return lambda: model.fit(data.columns, data.observed).coef_ != 0.0


def measure() -> list[Row]:
    """A row for each criterion and peer."""
    data, rows = design(), []
    rng = np.random.default_rng(1)
    some = rng.random((SAMPLE, TERMS)) < 0.5
    for criterion, name in (("bic", "BIC"), ("loo", "leave-one-out error")):
        found: list[Subsets] = []
        own = timed(lambda c=criterion, f=found: f.append(best_subsets(data, c)))  # type: ignore[misc]  # bound now
        best, score = found[0].members[0], float(found[0].scores(criterion)[0])
        scores: list[np.ndarray] = []
        slow = timed(lambda c=criterion, s=scores: s.append(loop(data, some, c)))  # type: ignore[misc]  # bound now
        none_better = bool(np.all(scores[0] >= loop(data, best[None, :], criterion)[0] * (1.0 - 1e-12)))
        run = by_abess(data, criterion)
        taken = run()
        theirs = timed(run, 5)
        reached = float(fit(data.take(np.flatnonzero(taken))).criteria.score(criterion))
        same = "the same subset" if np.array_equal(taken, best) else f"{reached:.6g} beside our {score:.6g}"
        work = f"best of 2^{TERMS} - 1 subsets, {ROWS} rows, by {name}"
        rows += [
            Row(
                work, own, f"exhaustive loop, from {SAMPLE} subsets", slow.times((2**TERMS - 1) / SAMPLE),
                at_most=GOAL_S, right=none_better and reached >= score * (1.0 - 1e-12),
                remark="exact: every subset is scored; none of those in the loop is better",
            ),
            Row(work, own, "abess, which searches", theirs, remark=f"abess reaches {same}"),
        ]  # fmt: skip
    return rows


if __name__ == "__main__":
    for row in measure():
        print(row, row.ratio, row.met)
