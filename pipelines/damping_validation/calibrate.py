"""``damping calibrate``: do bands and posteriors hold what they say? Trials on known structures, tables and figures."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.infer.law import Law
from damping.records.record import record_to_csv
from damping_pipelines.manifest import publish, sole_writer, versions
from damping_pipelines.terminal import end_with_parent, progress
from damping_validation import calibration_plots as plots
from damping_validation import calibration_tables as tables
from damping_validation.calibration import (
    CALIBRATED,
    LEVEL,
    LEVELS,
    NOISES,
    RANKED,
    RATIOS,
    SPANS,
    coverage_trial,
    ecdf,
    ecdf_band,
    rank_trial,
    rank_trial_of_sweeps,
)
from damping_validation.truths import TRUTHS

#: Law of the trials with whole sweeps.
SWEPT = Law(("viscous", "velocity-squared"))
#: Law of the trials sampled by emcee.
CHAINED = Law(("velocity-power",))
#: Trials sent to a process at once: enough to keep it busy for seconds.
BATCH = 12
_DPI = 130
#: In the title of a panel: what the posterior is of, where it is not of resonances by importance draws.
_OF = {"sweeps": "whole sweeps", "emcee": "by emcee"}


@dataclass(frozen=True)
class Sizes:
    """Trials of each structure by each way of sampling, of each posterior, and of the posterior sampled by emcee."""

    fast: int
    importance: int
    chained: int
    ranks: int
    chains: int


LARGEST = FULL = Sizes(40, 4, 0, 24, 2)
QUICK = Sizes(1, 0, 0, 12, 2)


@dataclass(frozen=True)
class Trial:
    """A unit of work for a process: what it is of, and the call that does it."""

    key: tuple[Any, ...]
    call: Callable[[], Any]


def calibrate(out: Path, quick: bool, seed: int, jobs: int | None) -> None:
    """Run all trials, in parallel with progress, then write tables, figures and the page ``README.md``."""
    with sole_writer(out, ("README.md",)):
        results = run(all_trials(QUICK if quick else FULL, seed), jobs or cpu_count() or 1)
        publish(out, render(results, seed, quick), seed=seed, versions=versions(), inputs={})
    print(f"{out / 'README.md'} written")


def render(results: dict[tuple[Any, ...], Any], seed: int, quick: bool) -> dict[str, bytes]:
    """Tables, figures and page of the results of all trials, by file name."""
    covered = {key[1:]: value for key, value in results.items() if key[0] == "coverage"}
    ranked = {key: value for key, value in results.items() if key[0] != "coverage"}
    predictions = tables.tabulate_predictions(covered)
    ranks = tables.tabulate_ranks(ranked)
    summary = tables.rank_summary(ranks)
    coverage = tables.tabulate_coverage(predictions)
    files = {
        f"{name}.csv": record_to_csv(table).encode()
        for name, table in (("predictions", predictions), ("coverage", coverage), ("ranks", summary))
    }
    files |= {f"{name}.png": png(figure) for name, figure in figures(predictions, ranks).items()}
    return files | {"README.md": render_page(predictions, summary, len(results), seed, quick).encode()}


def all_trials(sizes: Sizes, seed: int) -> list[Trial]:
    """Every trial, each with a seed of its own, which depends on its key alone: fewer trials are a part of more."""
    made = [*_coverage_calls(LARGEST), *_rank_calls(LARGEST)]
    seeds = np.random.SeedSequence(seed).generate_state(len(made))
    wanted = {key for key, _ in (*_coverage_calls(sizes), *_rank_calls(sizes))}
    return [
        Trial(key, partial(call, seed=int(own))) for (key, call), own in zip(made, seeds, strict=True) if key in wanted
    ]


def _coverage_calls(sizes: Sizes) -> Iterable[tuple[tuple[Any, ...], Callable[..., Any]]]:
    for way, trials in (("fast", sizes.fast), ("importance", sizes.importance), ("chains", sizes.chained)):
        for name in TRUTHS:
            yield from ((("coverage", way, name, n), partial(coverage_trial, name, way)) for n in range(trials))


def _rank_calls(sizes: Sizes) -> Iterable[tuple[tuple[Any, ...], Callable[..., Any]]]:
    for law in CALIBRATED:
        yield from ((("resonances", law.name, n), partial(rank_trial, law)) for n in range(sizes.ranks))
    yield from ((("sweeps", SWEPT.name, n), partial(rank_trial_of_sweeps, SWEPT)) for n in range(sizes.ranks))
    call = partial(rank_trial, CHAINED, chains=True)
    yield from ((("emcee", CHAINED.name, n), call) for n in range(sizes.chains))


def run(trials: list[Trial], jobs: int) -> dict[tuple[Any, ...], Any]:
    """Results of all trials by key, in the order of ``trials`` whatever finishes first."""
    batches = [trials[i : i + BATCH] for i in range(0, len(trials), BATCH)]
    results: dict[tuple[Any, ...], Any] = {}
    # "spawn": a forked copy of a process with threads (a progress bar has one) may lock up
    with (
        progress("calibrating", len(trials)) as done,
        ProcessPoolExecutor(jobs, get_context("spawn"), end_with_parent) as pool,
    ):
        futures = {pool.submit(_batch, batch): batch for batch in batches}
        for future in as_completed(futures):
            results |= future.result()
            batch = futures[future]
            done(f"{batch[-1].key[0]} {batch[-1].key[1]}", len(batch))
    return {trial.key: results[trial.key] for trial in trials}


def _batch(trials: list[Trial]) -> dict[tuple[Any, ...], Any]:
    return {trial.key: trial.call() for trial in trials}


def figures(predictions: pd.DataFrame, ranks: pd.DataFrame) -> dict[str, Figure]:
    """The figures by name."""
    found: dict[str, dict[str, np.ndarray]] = {}
    beyond: dict[str, np.ndarray] = {}
    counts: dict[str, int] = {}
    for (data, law, quantity), group in ranks.groupby(["data", "law", "quantity"], sort=False):
        name = str(law) if data == "resonances" else f"{law}\n({_OF[str(data)]})"
        values = group["rank"].to_numpy()
        found.setdefault(name, {})[str(quantity)] = ecdf(values)
        counts[name] = len(values)
        if quantity == "amplitude beyond":
            beyond[name] = values
    bands = {n: ecdf_band(n, tables.SURE) for n in set(counts.values())}
    return {
        "coverage": plots.coverage(tables.tabulate_coverage(predictions[predictions["way"] == "fast"]), LEVEL),
        "ranks": plots.rank_histograms(beyond, tables.BINS, RANKED),
        "ecdf": plots.rank_ecdfs(found, bands, counts),
    }


def png(figure: Figure) -> bytes:
    """The figure as PNG; equal figures give equal bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
    return buffer.getvalue()


def render_page(predictions: pd.DataFrame, ranks: pd.DataFrame, trials: int, seed: int, quick: bool) -> str:
    """The page: goals beside what was measured, every structure, figures."""
    goals = tables.tabulate_goals(predictions, ranks)
    command = f"damping calibrate --out DIR --seed {seed}" + (" --quick" if quick else "")
    selection = tables.tabulate_selection(predictions)
    return _PAGE.format(
        trials=trials,
        command=command,
        goals="\n".join(f"| {r.goal} | {r.measured} | {'yes' if r.met else 'no'} |" for r in goals.itertuples()),
        structures="\n".join(_list_structures(predictions[predictions["way"] == "fast"])),
        leads="; ".join(f"{r.truth} {r.true_leads} of {r.trials}" for r in selection.itertuples()),
        outside=_describe_outside(ranks),
        sure=f"{100 * tables.SURE:g}",
        refused=int(predictions["refused"].sum()),
        predictions=len(predictions),
        levels=f"{LEVELS[0]} to {LEVELS[1]}",
        spans=f"{SPANS[0]:g} to {SPANS[1]:g}",
        noises=f"{100 * NOISES[0]:g} to {100 * NOISES[1]:g} %",
    )


def _list_structures(predictions: pd.DataFrame) -> list[str]:
    """One line per structure, worst first at the largest ratio: held and above at each ratio, widths."""
    table = tables.tabulate_coverage(predictions)
    lines = []
    for truth in table.loc[table["ratio"] == RATIOS[-1], "truth"]:  # the worst stands first
        rows = table[table["truth"] == truth].sort_values("ratio")
        held, above = (
            " | ".join(f"{100 * share:.0f}" for share in rows[column]) for column in ("share_held", "share_above")
        )
        width, over = (float(rows[column].iloc[-1]) for column in ("width", "over_oracle"))
        lines.append(f"| {truth} | {held} | {above} | {width:.2f} | {f'{over:.1f}' if np.isfinite(over) else ''} |")
    return lines


def _describe_outside(ranks: pd.DataFrame) -> str:
    """The quantities whose ranks leave their band."""
    names = [f"{row.quantity} of {row.law}, {row.data}" for row in ranks[~ranks["uniform"]].itertuples()]
    return "; ".join(names) or "none"


_PAGE = """# Calibration

{trials} trials, by `{command}`. Every trial has a seed of its own; the same command gives the same tables.

## Goals beside what was measured

In parentheses the {sure} % binomial interval; cover is met when the interval reaches the goal.

| goal | measured | met |
|---|---|---|
{goals}

![Coverage of the bands](coverage.png)

Structures are drawn at random (`pipelines/damping_validation/truths.py`), tested at {levels} forces that span a factor
of {spans}, with noise of {noises}, one in seven by whole sweeps. Refused predictions are left out of the shares:
{refused} of {predictions} (two levels are no test of 2 and 4 times). Every prediction:
[predictions.csv](predictions.csv); counts: [coverage.csv](coverage.csv).

By structure, `--fast`, the worst at 4 times first: per cent of next tests held and above the band, median high/low, and
its ln over that of a fitter who knows the form (least squares, Student's t).

| structure | held 1.5 | 2 | 4 | above 1.5 | 2 | 4 | high/low at 4 | over the oracle's |
|---|---|---|---|---|---|---|---|---|
{structures}

The law of largest weight is the structure's own: {leads}. Over a narrow span some laws imitate others to within the
noise; a choice among them would be a guess, which is why bands average over laws by weight.

## Posteriors

Simulation-based calibration: parameters from the prior, data from the likelihood, rank of the true value among 63
posterior draws. Shaded: {sure} % simultaneous band of uniform ranks ([ranks.csv](ranks.csv)). Outside it: {outside}.

Of whole sweeps, the scatter of rows comes out somewhat too large: the likelihood divides a row's residual by the slope
at the measured point, as is right for small scatter. The residuals of simulated rows are 2 % wider than it says at a
scatter of 2 %, and 12 % wider at 10 %, which the prior allows and few tests show.

![Ranks of the amplitude beyond the test](ranks.png)

![ECDF of all ranks less uniform](ecdf.png)
"""
