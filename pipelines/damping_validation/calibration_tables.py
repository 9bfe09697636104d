"""Trials of a calibration as tables, and each goal beside what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binom, binomtest

from damping_validation.calibration import LEVEL, RANKED, RATIOS, Coverage, is_uniform, structures

#: Largest high/low of a 90 % band wanted at a ratio of force to the largest tested one.
WIDTHS = {1.5: 1.35, 4.0: 1.8}
#: Content of the band of ranks and of the binomial bounds that goals are held against.
SURE = 0.99
#: Bins of a histogram of ranks.
BINS = 8


def coverage_table(covered: Mapping[tuple[Any, ...], Coverage]) -> pd.DataFrame:
    """A row a structure, number of levels, noise and ratio: trials, predictions, hits; median width and error.

    Args:
        covered: trials by (structure, levels, noise, number).
    """
    rows = [
        {
            "structure": structure,
            "levels": levels,
            "noise": noise,
            "ratio": ratio,
            "predicted": not result.refused[i],
            "inside": result.inside[i],
            "width": result.width[i],
            "error_percent": 100.0 * np.expm1(result.error[i]),
        }
        for (structure, levels, noise, _), result in covered.items()
        for i, ratio in enumerate(RATIOS)
    ]
    cells = pd.DataFrame(rows).groupby(["structure", "levels", "noise", "ratio"], sort=False)
    return cells.agg(
        trials=("predicted", "size"),
        predicted=("predicted", "sum"),
        inside=("inside", "sum"),
        width=("width", "median"),
        error_percent=("error_percent", "median"),
    ).reset_index()


def selection_table(covered: Mapping[tuple[Any, ...], Coverage]) -> pd.DataFrame:
    """A row a structure, number of levels and noise: how often its law wins, how often the winner has a false term.

    Structures without a law among the candidates are left out. Arguments as in ``coverage_table``.
    """
    rows = []
    laws = {structure.name: structure.law for structure in structures()}
    for (structure, levels, noise, _), result in covered.items():
        law = laws[structure]
        if law is not None:
            false = not set(result.winner.components) <= set(law.components)
            win = result.winner == law
            rows.append(
                {"structure": structure, "levels": levels, "noise": noise, "true_wins": win, "false_term": false}
            )
    cells = pd.DataFrame(rows).groupby(["structure", "levels", "noise"], sort=False)
    return cells.agg(
        trials=("true_wins", "size"), true_wins=("true_wins", "sum"), false_term=("false_term", "sum")
    ).reset_index()


def winners_table(covered: Mapping[tuple[Any, ...], Coverage]) -> pd.DataFrame:
    """A row a structure and law that won, most often first: ``structure, winner, true, trials``.

    Arguments as in ``coverage_table``.
    """
    laws = {structure.name: structure.law for structure in structures()}
    rows = [
        {"structure": structure, "winner": result.winner.name, "true": result.winner == laws[structure]}
        for (structure, *_), result in covered.items()
    ]
    counts = pd.DataFrame(rows).groupby(["structure", "winner", "true"], sort=False).size().reset_index(name="trials")
    place = {name: i for i, name in enumerate(laws)}
    order = np.lexsort((-counts["trials"], counts["structure"].map(place)))
    return counts.iloc[order].reset_index(drop=True)


def ranks_table(ranked: Mapping[tuple[Any, ...], Mapping[str, int]]) -> pd.DataFrame:
    """A row a trial and quantity: the rank of its true value, 0 to ``RANKED``.

    Args:
        ranked: ranks by (data, law, number), ``data`` saying what the posterior is of.
    """
    rows = [
        {"data": data, "law": law, "trial": n, "quantity": quantity, "rank": rank}
        for (data, law, n), ranks in ranked.items()
        for quantity, rank in ranks.items()
    ]
    return pd.DataFrame(rows)


def rank_summary(ranks: pd.DataFrame) -> pd.DataFrame:
    """A row a posterior and quantity: whether its ranks are uniform, and their histogram."""
    rows = []
    for (data, law, quantity), group in ranks.groupby(["data", "law", "quantity"], sort=False):
        values = group["rank"].to_numpy()
        histogram = np.histogram(values, bins=BINS, range=(0, RANKED + 1))[0]
        rows.append(
            {"data": data, "law": law, "quantity": quantity, "trials": len(values)}
            | {"uniform": is_uniform(values, SURE)}
            | {f"bin_{i + 1}": int(count) for i, count in enumerate(histogram)}
        )
    return pd.DataFrame(rows)


def goals_table(coverage: pd.DataFrame, ranks: pd.DataFrame) -> pd.DataFrame:
    """Each goal beside its measured figure: ``goal, measured, met``."""
    rows = [_coverage_goal(coverage, "all", coverage)]
    for column in ("ratio", "levels", "noise", "structure"):
        rows += [
            _coverage_goal(group, f"{column} {name}", coverage) for name, group in coverage.groupby(column, sort=False)
        ]
    for ratio, most in WIDTHS.items():
        median = float(coverage.loc[coverage["ratio"] == ratio, "width"].median())
        goal = f"high/low of the {100 * LEVEL:g} % band at {ratio:g} times the tested force at most {most:g}"
        rows.append({"goal": goal, "measured": f"median {median:.2f}", "met": median <= most})
    outside = int((~ranks["uniform"]).sum())
    most_outside = int(binom.ppf(SURE, len(ranks), 1.0 - SURE))
    goal = f"ranks of {len(ranks)} quantities inside their simultaneous {100 * SURE:g} % band, but for {most_outside}"
    rows.append({"goal": goal, "measured": f"{outside} outside", "met": outside <= most_outside})
    return pd.DataFrame(rows)


def _coverage_goal(part: pd.DataFrame, name: str, whole: pd.DataFrame) -> dict[str, Any]:
    """Coverage no less than the level, within the binomial error of the independent trials among the predictions."""
    inside, predicted = int(part["inside"].sum()), int(part["predicted"].sum())
    # predictions of one trial at several ratios are not independent: count trials
    trials = round(predicted / part["ratio"].nunique())
    share = inside / predicted
    interval = binomtest(round(share * trials), trials).proportion_ci(SURE, "wilson")
    return {
        "goal": f"{100 * LEVEL:g} % band holds the next test: {name}",
        "measured": f"{100 * share:.1f} % of {predicted} ({100 * interval.low:.0f} to {100 * interval.high:.0f})",
        "met": interval.high >= LEVEL,
    }
