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
from damping_pipelines.manifest import publish, sole_writer
from damping_pipelines.provenance import versions
from damping_pipelines.terminal import end_with_parent, progress
from damping_validation import calibration_plots as plots
from damping_validation import calibration_tables as tables
from damping_validation.calibration import (
    CALIBRATED,
    LEVEL,
    RANKED,
    coverage_trial,
    ecdf,
    ecdf_band,
    rank_trial,
    rank_trial_of_sweeps,
    structures,
)

#: Force levels of a trial: as few as laboratories make, and as many.
LEVELS = (3, 5, 8)
#: Noise of a trial, standard deviation of ln A.
NOISES = (0.005, 0.01, 0.02, 0.04)
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
    """Trials of each cell of the coverage table, of each posterior, and of the posterior sampled by emcee."""

    coverage: int
    ranks: int
    chains: int


LARGEST = FULL = Sizes(6, 120, 48)
QUICK = Sizes(1, 12, 2)


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
    coverage, selection = tables.coverage_table(covered), tables.selection_table(covered)
    winners = tables.winners_table(covered)
    ranks = tables.ranks_table(ranked)
    summary = tables.rank_summary(ranks)
    files = {
        f"{name}.csv": record_to_csv(table).encode()
        for name, table in (("coverage", coverage), ("selection", selection), ("winners", winners), ("ranks", summary))
    }
    files |= {f"{name}.png": png(figure) for name, figure in figures(coverage, selection, ranks).items()}
    text = page(coverage, summary, selection, winners, len(results), seed, quick)
    return files | {"README.md": text.encode()}


def all_trials(sizes: Sizes, seed: int) -> list[Trial]:
    """Every trial, each with a seed of its own, which depends on its key alone: fewer trials are a part of more."""
    made = [*_coverage_calls(LARGEST), *_rank_calls(LARGEST)]
    seeds = np.random.SeedSequence(seed).generate_state(len(made))
    wanted = {key for key, _ in (*_coverage_calls(sizes), *_rank_calls(sizes))}
    return [
        Trial(key, partial(call, seed=int(own))) for (key, call), own in zip(made, seeds, strict=True) if key in wanted
    ]


def _coverage_calls(sizes: Sizes) -> Iterable[tuple[tuple[Any, ...], Callable[..., Any]]]:
    for structure in structures():
        for levels in LEVELS:
            for noise in NOISES:
                call = partial(coverage_trial, structure, levels, noise)
                yield from ((("coverage", structure.name, levels, noise, n), call) for n in range(sizes.coverage))


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


def figures(coverage: pd.DataFrame, selection: pd.DataFrame, ranks: pd.DataFrame) -> dict[str, Figure]:
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
        "coverage": plots.coverage(coverage, LEVEL),
        "widths": plots.widths(coverage, tables.WIDTHS),
        "selection": plots.selection_errors(selection),
        "ranks": plots.rank_histograms(beyond, tables.BINS, RANKED),
        "ecdf": plots.rank_ecdfs(found, bands, counts),
    }


def png(figure: Figure) -> bytes:
    """The figure as PNG; equal figures give equal bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
    return buffer.getvalue()


def page(
    coverage: pd.DataFrame,
    ranks: pd.DataFrame,
    selection: pd.DataFrame,
    winners: pd.DataFrame,
    trials: int,
    seed: int,
    quick: bool,
) -> str:
    """The page: goals beside what was measured, selection errors, figures."""
    goals = tables.goals_table(coverage, ranks)
    command = f"damping calibrate --out DIR --seed {seed}" + (" --quick" if quick else "")
    rows = [f"| {r.goal} | {r.measured} | {'yes' if r.met else 'no'} |" for r in goals.itertuples()]
    by_noise = selection.groupby("noise")[["trials", "true_wins", "false_term"]].sum().reset_index()
    by_noise["wins"], by_noise["false"] = (by_noise[name] / by_noise["trials"] for name in ("true_wins", "false_term"))
    errors = [
        f"| {100 * noise:g} % | {wins:.2f} | {false:.2f} | {n} |"
        for noise, wins, false, n in by_noise[["noise", "wins", "false", "trials"]].itertuples(index=False)
    ]
    return _PAGE.format(
        trials=trials,
        command=command,
        goals="\n".join(rows),
        errors="\n".join(errors),
        outside=_outside(ranks),
        winners="\n".join(_winners(str(name), rows) for name, rows in winners.groupby("structure", sort=False)),
        sure=f"{100 * tables.SURE:g}",
        refused=int((coverage["trials"] - coverage["predicted"]).sum()),
        predictions=int(coverage["trials"].sum()),
    )


def _outside(ranks: pd.DataFrame) -> str:
    """The quantities whose ranks leave their band."""
    names = [f"{row.quantity} of {row.law}, {row.data}" for row in ranks[~ranks["uniform"]].itertuples()]
    return "; ".join(names) or "none"


def _winners(structure: str, rows: pd.DataFrame) -> str:
    """What won for one structure, most often first."""
    said = [f"{'**' * true}{winner}{'**' * true} {n}" for _, winner, true, n in rows.itertuples(index=False)]
    return f"| {structure} | {', '.join(said)} |"


_PAGE = """# Calibration

{trials} trials, by `{command}`. Every trial has a seed of its own; the same command gives the same tables.

## Goals beside what was measured

In parentheses the {sure} % binomial interval over independent trials (predictions of one trial at several forces count
once). A coverage goal is met when the interval reaches the level; bands may hold more than they promise, as they allow
for laws that are not among the candidates.

| goal | measured | met |
|---|---|---|
{goals}

![Coverage of the bands](coverage.png)

Structures: `pipelines/damping_validation/calibration.py`, tested at 3, 5 or 8 forces that span a factor of four,
with the noise given; the Iwan joint is none of the candidates.
Refused predictions are left out of the shares: {refused} of {predictions}
([coverage.csv](coverage.csv)).

![Widths of the bands](widths.png)

## Selection errors

The winner is the law of largest marginal likelihood on the resonances. A term is false when the structure has no such
force.

| noise | true law wins | false term in the winner | trials |
|---|---|---|---|
{errors}

![Selection errors](selection.png)

By structure and number of levels: [selection.csv](selection.csv). What won how often, the true law in bold
([winners.csv](winners.csv)):

| structure | winners |
|---|---|
{winners}

Over a factor of four in force some laws imitate others to within the noise, with fewer coefficients or other ones. A
choice among them would be a guess, which is why bands average over laws by weight and hold nevertheless.

## Posteriors

Simulation-based calibration: parameters from the prior, data from the likelihood, rank of the true value among 63
posterior draws. Shaded: {sure} % simultaneous band of uniform ranks ([ranks.csv](ranks.csv)). Outside it: {outside}.

Of whole sweeps, the scatter of rows comes out somewhat too large: the likelihood divides a row's residual by the slope
at the measured point, as is right for small scatter. The residuals of simulated rows are 2 % wider than it says at a
scatter of 2 %, and 12 % wider at 10 %, which the prior allows and few tests show.

![Ranks of the amplitude beyond the test](ranks.png)

![ECDF of all ranks less uniform](ecdf.png)
"""
