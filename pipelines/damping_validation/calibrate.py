"""``damping calibrate``: coverage of bands and posteriors in trials on known structures, with tables and figures."""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from operator import call
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binom, binomtest

from damping.infer.law import Law
from damping.plots import ALERT, AVERAGE, CREDIBLE, INK, MUTED, PREDICTIVE, TEXT_WIDTH, build_panels, styled, to_png
from damping.records.record import record_to_csv
from damping.report.page import fill_text
from damping_pipelines import start_pool
from damping_pipelines.manifest import publish, sole_writer, versions
from damping_pipelines.terminal import progress
from damping_validation import calibration as trial
from damping_validation.truths import IN_LIBRARY, TRUTHS

SWEPT = Law(("viscous", "velocity-squared"))  #: law of the trials with whole sweeps
CHAINED = Law(("velocity-power",))  #: law of the trials sampled by emcee
BATCH = 12  #: trials sent to a process at once: enough to keep it busy for seconds
#: In the title of a panel: what the posterior is of, where it is not of resonances by importance draws.
_OF = {"sweeps": "whole sweeps", "emcee": "by emcee"}

#: Trials of each structure by each way of sampling (of 150, some 110 go to 4 times the tested force, and the share held
#: of those errs by 4 %), of each posterior, and of the posterior sampled by emcee.
FULL = {"fast": 150, "importance": 6, "ranks": 24, "emcee": 2}
QUICK = {"fast": 1, "importance": 0, "ranks": 12, "emcee": 2}

#: What a trial is of: ``coverage``, way, truth, number; or data, law, number of a posterior.
Key = tuple[Any, ...]


def calibrate(out: Path, quick: bool, seed: int, jobs: int | None) -> None:
    """Run all trials, in parallel with progress, then write tables, figures and the page ``README.md``."""
    calls, wanted = _list_calls(FULL), _list_calls(QUICK if quick else FULL)
    # the seed of a trial depends on its key alone: fewer trials are a part of more
    seeds = dict(zip(calls, np.random.SeedSequence(seed).generate_state(len(calls)), strict=True))
    trials = {key: partial(draw, seed=int(seeds[key])) for key, draw in calls.items() if key in wanted}
    with sole_writer(out, ("README.md", "coverage.csv")):
        results = run(trials, jobs)
        publish(out, render(results, seed, quick), seed=seed, versions=versions(), inputs={})
    print(f"{out / 'README.md'} written")


def render(results: dict[Key, Any], seed: int, quick: bool) -> dict[str, bytes]:
    """Tables, figures and page of the results of all trials, by file name."""
    covered = {key[1:]: value for key, value in results.items() if key[0] == "coverage"}
    ranked = {key: value for key, value in results.items() if key[0] != "coverage"}
    predictions, ranks = tabulate_predictions(covered), tabulate_ranks(ranked)
    fast = tabulate_coverage(predictions[predictions["way"] == "fast"])
    summary = rank_summary(ranks)
    posteriors = zip(ranks["data"], ranks["law"], strict=True)
    names = [law if data == "resonances" else f"{law}\n({_OF[data]})" for data, law in posteriors]
    panels = {str(name): group for name, group in ranks.groupby(np.array(names), sort=False)}
    drawn = {"coverage": draw_coverage(fast), "ranks": draw_rank_histograms(panels), "ecdf": draw_rank_ecdfs(panels)}
    written = {"predictions": predictions, "coverage": tabulate_coverage(predictions), "ranks": summary}
    page = render_page(predictions, fast, summary, len(results), seed, quick)
    files = {f"{name}.csv": record_to_csv(table).encode() for name, table in written.items()}
    files |= {f"{name}.png": to_png(figure) for name, figure in drawn.items()}
    return files | {"README.md": page.encode()}


def _list_calls(sizes: Mapping[str, int]) -> dict[Key, Callable[..., Any]]:
    """Every trial, without its seed."""
    calls: dict[Key, Callable[..., Any]] = {}
    for way in ("fast", "importance"):
        for name in TRUTHS:
            calls |= {("coverage", way, name, n): partial(trial.coverage_trial, name, way) for n in range(sizes[way])}
    for law in trial.CALIBRATED:
        calls |= {("resonances", law.name, n): partial(trial.rank_trial, law) for n in range(sizes["ranks"])}
    calls |= {("sweeps", SWEPT.name, n): partial(trial.rank_trial, SWEPT, swept=True) for n in range(sizes["ranks"])}
    calls |= {
        ("emcee", CHAINED.name, n): partial(trial.rank_trial, CHAINED, chains=True) for n in range(sizes["emcee"])
    }
    return calls


def run(trials: Mapping[Key, Callable[[], Any]], jobs: int | None) -> dict[Key, Any]:
    """Results of all trials by key, in the order of ``trials``."""
    results: dict[Key, Any] = {}
    with progress("calibrating", len(trials)) as done, start_pool(jobs) as pool:
        for key, result in zip(trials, pool.map(call, trials.values(), chunksize=BATCH), strict=True):
            results[key] = result
            done(f"{key[0]} {key[1]}")
    return results


def tabulate_predictions(covered: Mapping[tuple[Any, ...], trial.Coverage]) -> pd.DataFrame:
    """One row per trial and ratio: ``way, truth, trial`` (the keys of ``covered``) and the fields of ``Coverage``."""
    rows = [
        {"way": way, "truth": truth, "trial": number}
        | {name: value[i] if isinstance(value, np.ndarray) else value for name, value in vars(result).items()}
        for (way, truth, number), result in covered.items()
        for i in range(len(trial.RATIOS))
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
        histogram = np.histogram(values, bins=trial.BINS, range=(0, trial.RANKED + 1))[0]
        rows.append(
            {"data": data, "law": law, "quantity": quantity, "trials": len(values)}
            | {"uniform": trial.is_uniform(values, trial.SURE)}
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
        limits = [binomtest(held, given).proportion_ci(trial.SURE, "wilson") for held, given in counts]
        every = every.join(pd.DataFrame(limits, columns=["low", "high"])).sort_values("ratio")
        ways.append((str(way), every, by_truth[by_truth["ratio"] == trial.RATIOS[-1]]))
    return ways


def render_page(
    predictions: pd.DataFrame, fast: pd.DataFrame, ranks: pd.DataFrame, trials: int, seed: int, quick: bool
) -> str:
    """The page: goals and measured values, every structure, figures."""
    # how often the law of a structure of the library has the largest weight, by the fast way
    first = predictions[(predictions["ratio"] == trial.RATIOS[0]) & (predictions["way"] == "fast")]
    selection = first[first["truth"].isin(IN_LIBRARY)].groupby("truth", sort=False)["true"]
    worst_first = fast.loc[fast["ratio"] == trial.RATIOS[-1], "truth"]
    values = {
        "trials": trials,
        "command": f"damping calibrate --out DIR --seed {seed}" + (" --quick" if quick else ""),
        "ways": collect_ways(predictions),
        "ranks": ranks,
        # as many of the quantities may lie outside their band by chance
        "most_outside": int(binom.ppf(trial.SURE, len(ranks), 1.0 - trial.SURE)),
        "structures": [(truth, fast[fast["truth"] == truth].sort_values("ratio")) for truth in worst_first],
        "leads": [f"{truth} {true.sum()} of {len(true)}" for truth, true in selection],
        "outside": [f"{row.quantity} of {row.law}, {row.data}" for row in ranks[~ranks["uniform"]].itertuples()],
        "predictions": predictions,
        "trial": trial,
    }
    return fill_text(Path(__file__).with_suffix(".txt"), values) + "\n"


@styled
def draw_coverage(table: pd.DataFrame) -> Figure:
    """Draw the share of next tests inside the band and above it, by structure and ratio, with 95 % intervals."""
    names = list(dict.fromkeys(table["truth"]))[::-1]
    figure, (left, right) = build_panels(0.28 * len(names) + 1.0, 1, 2, TEXT_WIDTH, sharey=True)
    for ax, column, goal in ((left, "held", trial.LEVEL), (right, "above", 0.5 * (1.0 - trial.LEVEL))):
        ax.axvline(goal, color=ALERT, linewidth=1.0, linestyle="--", label="share of an exact band")
        for shift, ratio in zip((-0.22, 0.0, 0.22), sorted(set(table["ratio"].to_numpy(float))), strict=True):
            rows = table[(table["ratio"] == ratio) & (table["given"] > 0)]
            place = np.array([names.index(name) for name in rows["truth"]]) + shift
            shares = [binomtest(int(k), int(n)) for k, n in zip(rows[column], rows["given"], strict=True)]
            limits = [result.proportion_ci(0.95, "wilson") for result in shares]
            ax.hlines(place, [limit.low for limit in limits], [limit.high for limit in limits], color=CREDIBLE)
            ax.plot([result.statistic for result in shares], place, "o", markersize=2 + ratio / 2, color=AVERAGE,
                    label=f"{ratio:g} times")  # fmt: skip
        ax.set_xlim(-0.02, 1.02)
    left.set_yticks(np.arange(len(names)), names)
    left.set_xlabel(f"share inside the {100 * trial.LEVEL:g} % band")
    right.set_xlabel("share above it (lines: 95 % interval)")
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=4)  # not on the intervals
    return figure


@styled
def draw_rank_ecdfs(ranks: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw the ECDFs of ranks less the uniform one, every parameter of a law in a panel, in the simultaneous band."""
    z = np.linspace(0.0, 1.0, trial.RANKED + 2)[1:-1]
    figure, panels = _open_panels(ranks, 1.2, sharey=True)
    for law, ax in panels.items():
        low, high = trial.ecdf_band(ranks[law]["trial"].nunique(), trial.SURE)
        ax.fill_between(z, low - z, high - z, color=PREDICTIVE, linewidth=0)
        for _, values in ranks[law].groupby("quantity", sort=False)["rank"]:
            ax.plot(z, trial.ecdf(values.to_numpy()) - z, color=AVERAGE, linewidth=0.8)
    figure.supxlabel("rank of the true value among posterior draws, relative", fontsize=8.5)
    figure.supylabel(f"ECDF less uniform, {100 * trial.SURE:g} % band", fontsize=8.5)
    return figure


@styled
def draw_rank_histograms(ranks: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw histograms of the ranks of the amplitude beyond the test, by law, with the range of a uniform count."""
    figure, panels = _open_panels(ranks, 1.1, sharey=False)
    for law, ax in panels.items():
        beyond = ranks[law].query("quantity == 'amplitude beyond'")["rank"]
        ax.axhspan(*binom.interval(trial.SURE, len(beyond), 1.0 / trial.BINS), color=PREDICTIVE, linewidth=0)
        bins: dict[str, Any] = {"bins": trial.BINS, "range": (0, trial.RANKED + 1)}
        ax.hist(beyond, **bins, color=MUTED, edgecolor="white", linewidth=0.5)
        ax.axhline(len(beyond) / trial.BINS, color=INK, linewidth=0.7)
        ax.set_ylim(0)
    figure.supxlabel("rank of the true amplitude beyond the test among posterior draws", fontsize=8.5)
    figure.supylabel(f"trials, {100 * trial.SURE:g} % range", fontsize=8.5)
    return figure


def _open_panels(names: Collection[str], height: float, sharey: bool) -> tuple[Figure, dict[str, Axes]]:
    """A figure of three columns of small panels, one for each name; ``height``: of a row, inches."""
    rows = -(-len(names) // 3)
    figure, panels = build_panels(height * rows, rows, 3, TEXT_WIDTH, sharex=True, sharey=sharey, squeeze=False)
    for ax in panels.flat[len(names) :]:
        ax.set_visible(False)
    for ax, name in zip(panels.flat, names, strict=False):
        ax.set_title(name, fontsize=7)
    return figure, dict(zip(names, panels.flat, strict=False))
