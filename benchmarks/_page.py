"""Tables of benchmarks, the page made of them and the figure of growing costs."""

from __future__ import annotations

import os
import platform
from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from benchmarks._rows import Row, seconds
from benchmarks.cost import Growth
from damping.plots import ALERT, AVERAGE, WIDTH, styled
from damping.plots.scales import plain_log


def rows_table(rows: Sequence[Row]) -> pd.DataFrame:
    """One row per comparison, times in seconds."""
    return pd.DataFrame(
        {
            "work": row.work,
            "ours_processor_s": row.ours.processor,
            "ours_wall_s": row.ours.wall,
            "peer": row.peer or None,
            "peer_processor_s": row.theirs.processor if row.theirs else None,
            "peer_wall_s": row.theirs.wall if row.theirs else None,
            "ratio": row.ratio,
            "goal": row.goal or None,
            "met": {True: "yes", False: "no", None: None}[row.met],
            "remark": row.remark,
        }
        for row in rows
    )


def cost_table(found: Sequence[Growth]) -> pd.DataFrame:
    """One row per size, with the exponent of its work."""
    return pd.DataFrame(
        {"work": g.work, "against": g.against, "size": size, "processor_s": time, "exponent": g.exponent}
        for g in found
        for size, time in zip(g.sizes, g.seconds, strict=True)
    )


@styled
def cost_figure(table: pd.DataFrame) -> Figure:
    """Processor time against size, with the line of the exponent."""
    figure = Figure(figsize=(WIDTH, 6.4))
    panels = figure.subplots(3, 2).ravel()
    for ax, ((work, against), rows) in zip(panels, table.groupby(["work", "against"], sort=False), strict=True):
        size, time = rows["size"].to_numpy(), rows["processor_s"].to_numpy()
        exponent = rows["exponent"].iloc[0]
        half = slice(len(size) // 2, None)
        middle = np.exp(np.mean(np.log(time[half])) - exponent * np.mean(np.log(size[half])))
        ax.loglog(
            size[half], middle * size[half] ** exponent, color=ALERT, linewidth=1.2, label=f"~ size^{exponent:.2f}"
        )
        ax.loglog(size, time, "o", color=AVERAGE, markersize=4)
        ax.set_title(str(work), fontsize=8)
        ax.set_xlabel(str(against))
        ax.set_ylabel("processor time (s)")
        ax.set_ylim(0.5 * time.min(), 3.0 * time.max())  # so that every axis has numbers
        plain_log(ax.xaxis)
        plain_log(ax.yaxis)
        ax.legend(loc="upper left")
    return figure


def write(out: Path, names: Sequence[str]) -> None:
    """``README.md`` and ``cost.png`` from the tables in ``out``."""
    tables = [pd.read_csv(out / f"{name}.csv") for name in names if name != "cost" and (out / f"{name}.csv").exists()]
    lines = [_line(row) for table in tables for row in table.replace({np.nan: None}).to_dict("records")]
    growth = ""
    if (out / "cost.csv").exists():
        costs = pd.read_csv(out / "cost.csv")
        cost_figure(costs).savefig(out / "cost.png", dpi=130, metadata={"Software": None})
        first = costs.groupby(["work", "against"], sort=False)
        growth = _GROWTH.format(
            rows="\n".join(
                f"| {work} | {against} | {rows['size'].min()} to {rows['size'].max()} | {rows['exponent'].min():.2f} |"
                for (work, against), rows in first
            )
        )
    machine = (
        f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}"
    )
    (out / "README.md").write_text(
        _PAGE.format(rows="\n".join(lines), growth=growth, machine=machine), encoding="utf-8"
    )


def _line(row: dict[Hashable, Any]) -> str:
    """A row of the table in Markdown."""
    theirs = seconds(row["peer_processor_s"]) if row["peer_processor_s"] else ""
    walls = seconds(row["ours_wall_s"]) + (f", {seconds(row['peer_wall_s'])}" if row["peer_wall_s"] else "")
    ratio = f"{row['ratio']:.3g}" if row["ratio"] else ""
    cells = (row["work"], row["peer"], seconds(row["ours_processor_s"]), theirs, ratio, row["goal"], row["met"], walls)
    return "| " + " | ".join(str(cell or "") for cell in (*cells, row["remark"])) + " |"


_PAGE = """# Speed

By `make bench` (`python -m benchmarks [NAME ...]`; each name is a module of `benchmarks/`, which says what is done and
how the peer is used). Ours and the peer run in one process, or in processes one after the other, with one thread each.
Ratios are of processor time. Where wall times are far longer, the machine was busy. `python -m benchmarks --guard`
runs commands by turns with the tree at the tag set last (without a tag, with the one that these times are of), and
fails where one has become 1.5 times slower.

| work | peer | ours | peer | ratio | goal | met | on the wall | |
|---|---|---|---|---|---|---|---|---|
{rows}

{growth}
{machine}
"""
_GROWTH = """## Growing costs

Exponent b of processor time ~ size^b over the upper half of the sizes ([cost.csv](cost.csv)).

| work | size | from, to | exponent |
|---|---|---|---|
{rows}

![Processor time against size](cost.png)
"""
