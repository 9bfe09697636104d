"""The best of 2^k - 1 subsets of correlated terms, by every criterion, free and with coefficients >= 0.

Run ``python -m benchmarks best_subset``. Peers: R's ``leaps`` (Debian's r-cran-leaps, where Rscript is there), exact by
the same method, whose best subset of each size holds the best by any criterion of size and SSE; abess, which searches
and proves nothing, by its own BIC and by 20-fold cross-validation (it has no leave-one-out). Both only without signs.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from shutil import which

import numpy as np

from benchmarks._rows import Row, Time, middle, timed
from damping.regression.criteria import NAMES
from damping.regression.design import Design, design_of_arrays
from damping.regression.fit import fit
from damping.regression.subsets import Subsets, best_subsets

REPEATS = 5
#: Terms, with ten rows each; goals in seconds of processor time for the best by BIC.
GOALS: dict[int, float | None] = {10: None, 20: 0.3, 30: None, 40: 10.0}
#: Terms of the comparison by every criterion.
TERMS = 20
#: Correlation of neighbouring columns; true coefficients, small ones among them.
CORRELATION = 0.8
TRUE = {0: 1.0, 3: -0.6, 4: 0.5, 9: 0.3, 15: 0.2, 22: 0.4, 30: -0.3, 35: 0.2}
#: Longest that a peer is waited for.
PATIENCE_S = 120.0

LEAPS = """
suppressMessages(library(leaps))
d <- as.matrix(read.csv(commandArgs(TRUE)[1])); k <- ncol(d) - 1
x <- d[, 1:k]; y <- d[, k + 1]
once <- function() regsubsets(x, y, nvmax = k, intercept = FALSE, really.big = TRUE)
first <- system.time(found <- once()); repeats <- max(1, min(100, floor(0.2 / max(first[["user.self"]], 1e-3))))
took <- system.time(for (i in seq_len(repeats)) found <- once())
sse <- found$ress[, 1]
cat((took[["user.self"]] + took[["sys.self"]]) / repeats, took[["elapsed"]] / repeats, format(sse, digits = 17), "\\n")
"""


def design(k: int) -> Design:
    """Columns with correlation .8^|i - j| on 10 k rows and a response of some of them with noise 1."""
    rng = np.random.default_rng(20)
    columns = rng.normal(size=(10 * k, k))
    for j in range(1, k):
        columns[:, j] = CORRELATION * columns[:, j - 1] + np.sqrt(1.0 - CORRELATION**2) * columns[:, j]
    true = sum(c * columns[:, j] for j, c in TRUE.items() if j < k)
    return design_of_arrays(columns, true + rng.normal(size=10 * k))


def by_leaps(data: Design) -> tuple[Time, np.ndarray] | str:
    """Time of one run within R, and the SSE of the best subset of each size (k,); or why there is none."""
    if which("Rscript") is None:
        return "no Rscript here"
    with tempfile.TemporaryDirectory() as folder:
        table, script = Path(folder) / "table.csv", Path(folder) / "leaps.R"
        header = ",".join(f"v{i}" for i in range(data.k + 1))
        np.savetxt(table, np.column_stack([data.columns, data.observed]), delimiter=",", header=header, comments="")
        script.write_text(LEAPS)
        try:
            run = subprocess.run(
                ["Rscript", str(script), str(table)], capture_output=True, text=True, timeout=PATIENCE_S, check=False
            )
        except subprocess.TimeoutExpired:
            return f"R leaps does not end within {PATIENCE_S:g} s on the wall"
    if run.returncode:
        return f"R leaps fails: {(run.stderr.strip().splitlines() or ['no message'])[-1]}"
    processor, wall, *sse = map(float, run.stdout.split())
    return Time(processor, wall), np.array(sse)


def by_abess(data: Design, criterion: str) -> Callable[[], np.ndarray]:
    """A run of abess: which terms it takes (k,)."""
    from abess import LinearRegression  # noqa: PLC0415 - a peer, installed for benchmarks alone

    how = {"cv": 20} if criterion == "loo" else {"ic_type": criterion}
    model = LinearRegression(support_size=range(data.k + 1), fit_intercept=False, **how)
    return lambda: model.fit(data.columns, data.observed).coef_ != 0.0


def ours(data: Design, criterion: str, nonnegative: bool) -> tuple[Time, Subsets]:
    """Median time of five runs, and what is found."""
    found: list[Subsets] = []
    runs = [
        timed(lambda: found.append(best_subsets(data, criterion, nonnegative=nonnegative, number=1)))
        for _ in range(REPEATS)
    ]
    return middle(runs), found[0]


def row_of_leaps(work: str, own: Time, found: Subsets, theirs: tuple[Time, np.ndarray], goal: float | None) -> Row:
    """Ours beside R's leaps: right where no size has less SSE than the winner of that size."""
    same = float(theirs[1][int(found.sizes[0]) - 1] / found.sse[0] - 1.0)
    remark = f"{said(found)}; SSE of the best of its size by leaps agrees to {abs(same):.0e}"
    return Row(work, own, "R leaps, exact", theirs[0], at_most=goal, right=abs(same) < 1e-9, remark=remark)


def said(found: Subsets) -> str:
    """The proof in words."""
    assert found.proof is not None
    return f"proved by {found.proof.nodes} fits"


def measure() -> list[Row]:
    """A row for each number of terms by BIC, then for each criterion, free and with signs, and each peer."""
    rows = []
    for k, goal in GOALS.items():
        data = design(k)
        own, found = ours(data, "bic", nonnegative=False)
        leaps = by_leaps(data)
        work = f"best of 2^{k} - 1 subsets, {data.n} rows, by BIC"
        if isinstance(leaps, str):
            rows.append(Row(work, own, at_most=goal, remark=f"{said(found)}; {leaps}"))
        else:
            rows.append(row_of_leaps(work, own, found, leaps, goal))
    data = design(TERMS)
    leaps = by_leaps(data)
    for criterion, name in NAMES.items():
        work = f"best of 2^{TERMS} - 1 subsets, {data.n} rows, by {name}"
        own, found = ours(data, criterion, nonnegative=False)
        if not isinstance(leaps, str) and criterion not in ("bic", "loo"):
            rows.append(row_of_leaps(work, own, found, leaps, GOALS[TERMS]))
        if criterion in ("bic", "aic", "loo"):
            rows.append(row_of_abess(work, own, found, data, criterion))
        signed, kept = ours(data, criterion, nonnegative=True)
        rows.append(Row(f"{work}, coefficients >= 0", signed, at_most=GOALS[TERMS], remark=said(kept)))
    return rows


def row_of_abess(work: str, own: Time, found: Subsets, data: Design, criterion: str) -> Row:
    """Ours beside abess, whose subset is scored by our criterion."""
    run = by_abess(data, criterion)
    taken = run()
    reached, score = float(fit(data.take(np.flatnonzero(taken))).criteria.score(criterion)), found.scores(criterion)[0]
    same = "the same subset" if np.array_equal(taken, found.members[0]) else f"{reached:.6g} beside our {score:.6g}"
    right = bool(reached >= score - 1e-9 * abs(score))
    theirs = middle([timed(run) for _ in range(REPEATS)])
    remark = f"{said(found)}; abess reaches {same}"
    return Row(work, own, "abess, which searches", theirs, at_most=GOALS[TERMS], right=right, remark=remark)
