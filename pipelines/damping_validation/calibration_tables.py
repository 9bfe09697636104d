"""Trials of a calibration as tables, and each goal beside what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binom, binomtest

from damping_validation.calibration import RANKED, RATIOS, Coverage, is_uniform
from damping_validation.truths import IN_LIBRARY

#: Share of next tests that bands are to hold, least and most; largest share above them.
HELD = (0.86, 0.96)
ABOVE = 0.08
#: The same of any one structure at the largest ratio: least share held, largest share above.
WORST = 0.75
WORST_ABOVE = 0.20
#: Largest ln width over that of a fitter who knows the form, at the largest ratio.
OVER_ORACLE = 2.2
#: Content of the band of ranks and of the binomial bounds that goals are held against.
SURE = 0.99
#: Bins of a histogram of ranks.
BINS = 8


def tabulate_predictions(covered: Mapping[tuple[Any, ...], Coverage]) -> pd.DataFrame:
    """One row per trial and ratio: ``way, truth, trial`` (the keys of ``covered``) and the fields of ``Coverage``."""
    rows = [
        {"way": way, "truth": truth, "trial": number}
        | {name: value[i] if isinstance(value, np.ndarray) else value for name, value in vars(result).items()}
        for (way, truth, number), result in covered.items()
        for i in range(len(RATIOS))
    ]
    return pd.DataFrame(rows)


def tabulate_coverage(predictions: pd.DataFrame, by: Sequence[str] = ("way", "truth")) -> pd.DataFrame:
    """One row per group and ratio, worst first: predictions given and refused, shares held, above and below, widths.

    ``width`` is the median of high/low, ``over_oracle`` that of ln width over the oracle's.
    """
    table = predictions.assign(
        given=~predictions["refused"],
        held=~(predictions["above"] | predictions["below"] | predictions["refused"]),
        over_oracle=predictions["width"] / predictions["oracle"],
        width=np.exp(predictions["width"]),
    )
    cells = table.groupby([*by, "ratio"], sort=False).agg(
        trials=("given", "size"),
        given=("given", "sum"),
        held=("held", "sum"),
        above=("above", "sum"),
        below=("below", "sum"),
        width=("width", "median"),
        over_oracle=("over_oracle", "median"),
    )
    shares = cells[["held", "above", "below"]].div(cells["given"], axis=0).add_prefix("share_")
    return pd.concat([cells, shares], axis=1).reset_index().sort_values("share_held", kind="stable", ignore_index=True)


def tabulate_selection(predictions: pd.DataFrame) -> pd.DataFrame:
    """One row per structure of the library: trials by the fast way, and how often its law has the largest weight."""
    first = predictions[(predictions["ratio"] == RATIOS[0]) & (predictions["way"] == "fast")]
    first = first[first["truth"].isin(IN_LIBRARY)]
    return first.groupby("truth", sort=False).agg(trials=("true", "size"), true_leads=("true", "sum")).reset_index()


def tabulate_ranks(ranked: Mapping[tuple[Any, ...], Mapping[str, int]]) -> pd.DataFrame:
    """One row per trial and quantity: the rank of its true value, 0 to ``RANKED``.

    ``ranked``: ranks by (data, law, number), ``data`` saying what the posterior is of.
    """
    rows = [
        {"data": data, "law": law, "trial": n, "quantity": quantity, "rank": rank}
        for (data, law, n), ranks in ranked.items()
        for quantity, rank in ranks.items()
    ]
    return pd.DataFrame(rows)


def rank_summary(ranks: pd.DataFrame) -> pd.DataFrame:
    """One row per posterior and quantity: whether its ranks are uniform, and their histogram."""
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


def collect_ways(predictions: pd.DataFrame) -> list[tuple[str, pd.DataFrame, pd.DataFrame]]:
    """By way of sampling: shares over all structures at each ratio with their interval ``low`` to ``high``, and
    those of each structure at the largest ratio, worst first."""
    ways = []
    for way in predictions["way"].unique():
        prediction = predictions[predictions["way"] == way]
        every, by_truth = tabulate_coverage(prediction, ("way",)), tabulate_coverage(prediction)
        counts = every[["held", "given"]].to_numpy(int).tolist()
        limits = [binomtest(held, given).proportion_ci(SURE, "wilson") for held, given in counts]
        every = every.join(pd.DataFrame(limits, columns=["low", "high"])).sort_values("ratio")
        ways.append((str(way), every, by_truth[by_truth["ratio"] == RATIOS[-1]]))
    return ways


def most_outside(ranks: pd.DataFrame) -> int:
    """How many of the quantities may lie outside their band by chance, with the probability ``SURE``."""
    return int(binom.ppf(SURE, len(ranks), 1.0 - SURE))
