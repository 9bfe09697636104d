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
    """One row per trial and ratio: ``way, truth, trial, levels, span, noise, ratio`` and the fields of ``Coverage``.

    Args:
        covered: trials by (way, truth, number).
    """
    rows = [
        {
            "way": way,
            "truth": truth,
            "trial": number,
            **{name: getattr(result, name) for name in ("levels", "span", "noise", "winner", "true")},
            "ratio": ratio,
            **{name: getattr(result, name)[i] for name in ("refused", "above", "below", "width", "oracle", "error")},
        }
        for (way, truth, number), result in covered.items()
        for i, ratio in enumerate(RATIOS)
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


def tabulate_goals(predictions: pd.DataFrame, ranks: pd.DataFrame) -> pd.DataFrame:
    """Each goal beside its measured figure: ``goal, measured, met``."""
    rows: list[tuple[str, str, bool]] = []
    for way in predictions["way"].unique():
        prediction = predictions[predictions["way"] == way]
        every, by_truth = tabulate_coverage(prediction, ("way",)), tabulate_coverage(prediction)
        columns = [every.sort_values("ratio")[name].tolist() for name in ("ratio", "given", "held", "share_above")]
        for ratio, given, held, above in zip(*columns, strict=True):
            low, high = binomtest(int(held), int(given)).proportion_ci(SURE, "wilson")
            goal = f"{way}: holds {100 * HELD[0]:g} to {100 * HELD[1]:g} % of next tests at {ratio:g} times"
            text = f"{100 * held / given:.1f} % of {given} ({100 * low:.0f} to {100 * high:.0f})"
            rows.append((goal, text, bool(high >= HELD[0] and low <= HELD[1])))
            goal = f"{way}: at most {100 * ABOVE:g} % above the band at {ratio:g} times"
            rows.append((goal, f"{100 * above:.1f} %", above <= ABOVE))
        if way != "chains":  # one trial a truth says nothing of it
            rows += _list_farthest(way, by_truth[by_truth["ratio"] == RATIOS[-1]])
    outside = int((~ranks["uniform"]).sum())
    most_outside = int(binom.ppf(SURE, len(ranks), 1.0 - SURE))
    goal = f"ranks of {len(ranks)} quantities inside their simultaneous {100 * SURE:g} % band, but for {most_outside}"
    rows.append((goal, f"{outside} outside", outside <= most_outside))
    return pd.DataFrame(rows, columns=["goal", "measured", "met"])


def _list_farthest(way: str, far: pd.DataFrame) -> list[tuple[str, str, bool]]:
    """Goals at the largest ratio: of each structure, and of widths where a law of the library holds."""
    ratio, over = RATIOS[-1], float(far["over_oracle"].median())
    worst, least = far["truth"].iloc[0], float(far["share_held"].iloc[0])
    highest, most = far["truth"].iloc[int(far["share_above"].argmax())], float(far["share_above"].max())
    above = f"{way}: no structure above the band in more than {100 * WORST_ABOVE:g} % at {ratio:g} times"
    width = f"{way}: ln width at {ratio:g} times at most {OVER_ORACLE:g} of the oracle's, laws of the library"
    under = f"{way}: no structure under {100 * WORST:g} % at {ratio:g} times"
    return [
        (under, f"{100 * least:.0f} % ({worst})", least >= WORST),
        (above, f"{100 * most:.0f} % ({highest})", most <= WORST_ABOVE),
        (width, f"median {over:.2f}", over <= OVER_ORACLE),
    ]
