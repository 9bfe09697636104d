"""Records per second against workers, and memory against fleet size, of ``damping fleet --fast`` on a local cluster.

Run ``python -m benchmarks.fleet [--records N] [--long N]``: N records with 1 worker and with 2, then a longer fleet
with 2, whose memory is sampled as it goes. Records are resonances of seven structures at 4 to 6 levels, with 2 % of
noise. The command runs as a process of its own; what its processes use is read from outside. The last fleet, of
``--machinery N`` records, tries the machinery alone: every worker analyses its first record and answers the others with
that row and page, so that thousands pass through scheduler, data set and page in little time. Table, traces and figure
go to ``results/benchmarks``.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
import pandas as pd
import psutil
from matplotlib.figure import Figure

from benchmarks._structures import simulated_levels, structures
from damping.plots import AVERAGE, LINEAR, WIDTH, styled, to_svg
from damping.records.record import record_to_csv
from damping_pipelines import fleet as command
from damping_pipelines.fleet import runners
from damping_pipelines.fleet.analyse import analyse
from damping_pipelines.fleet.dataset import FleetResult, FleetTask, row_of
from damping_pipelines.store import write_text
from damping_validation.truths import OMEGA

OUT = Path(__file__).parents[1] / "results" / "benchmarks"
RECORDS = 20
LONG = 60
MACHINERY = 500
SAMPLE_S = 0.5
#: Records from which on a growth of memory is told from the filling of caches at the start.
FEWEST = 400
MB = 1e6


@dataclass
class Usage:
    """What the processes of a run used, sampled: ``trace`` of (records done, MB of the client, MB of a worker)."""

    processor: dict[int, float] = field(default_factory=dict)
    trace: list[tuple[int, float, float]] = field(default_factory=list)

    def look(self, client: psutil.Process, done: int) -> None:
        """Take a sample; a process that has ended in between is left out."""
        sizes = []
        try:
            family = [client, *client.children(recursive=True)]
        except psutil.NoSuchProcess:
            return
        for process in family:
            try:
                times, size = process.cpu_times(), process.memory_info().rss / MB
            except psutil.NoSuchProcess:
                continue
            self.processor[process.pid] = times.user + times.system
            sizes.append(size)
        if sizes:
            self.trace.append((done, sizes[0], max(sizes[1:], default=0.0)))


@dataclass(frozen=True)
class Run:
    """One fleet.

    Attributes:
        steady_s, processor_s: on the wall and of all processors, a record, from the first one done to the last.
        wall_s: of the whole command, with the start of its processes. client_mb, worker_mb: the most at any time.
    """

    work: str
    records: int
    workers: int
    steady_s: float
    processor_s: float
    wall_s: float
    failed: int
    client_mb: float
    worker_mb: float
    trace: pd.DataFrame

    @property
    def row(self) -> dict[str, float | str]:
        """The run as a row of the table."""
        return {
            "work": self.work,
            "records": self.records,
            "workers": self.workers,
            "records_per_s": 1.0 / self.steady_s,
            "processor_s_per_record": self.processor_s,
            "wall_s": self.wall_s,
            "failed": self.failed,
            "largest_client_mb": self.client_mb,
            "largest_worker_mb": self.worker_mb,
        }


def write_records(folder: Path, number: int) -> None:
    """Records drawn from structures whose law is known."""
    folder.mkdir(parents=True)
    known = structures()
    for i in range(number):
        data = simulated_levels(known[i % len(known)], 4 + i % 3, 4.0, 0.02, np.random.default_rng(i))
        rows = zip(data.tested_force.tolist(), data.tested_amplitude.tolist(), strict=True)
        lines = "".join(f"L{j},{F},{OMEGA / (2.0 * np.pi)},{A}\n" for j, (F, A) in enumerate(rows))
        (folder / f"record-{i:05d}.csv").write_text("sweep,force,frequency,amplitude\n" + lines)
        (folder / f"record-{i:05d}.toml").write_text("[mode]\nfrequency = 1.6\nmass = 1.0\n")


_FIRST: list[FleetResult] = []


def answered(task: FleetTask) -> FleetResult:
    """The first result of this worker under the name of ``task``: what the machinery costs without the analysis."""
    if not _FIRST:
        _FIRST.append(analyse(task))
    first = _FIRST[0]
    own = row_of(task)
    kept = {name: own[name] for name in ("key", "name", "report", "seed", "record_sha256", "model_sha256")}
    return FleetResult(first.row | kept, {own["report"]: next(iter(first.pages.values()))})


def machinery(source: str, out: str, workers: str) -> None:
    """``damping fleet --fast`` with ``answered`` in place of the analysis."""
    vars(runners)["distributed"] = partial(runners.distributed, work=answered)
    command.fleet(Path(source), Path(out), fast=True, workers=int(workers), max_size=1_000_000)


def run(number: int, workers: int, alone: bool = False) -> Run:
    """Run the command on new records and watch it; ``alone``: the machinery without the analysis."""
    with tempfile.TemporaryDirectory() as folder:
        source, out, log = (Path(folder) / name for name in ("in", "out", "log"))
        write_records(source, number)
        words = [sys.executable, "-m", "damping_pipelines.cli", "fleet", str(source), "--out", str(out), "--fast"]
        words += ["--workers", str(workers), "--dashboard", "off"]
        if alone:
            script = "import sys; from benchmarks.fleet import machinery; machinery(*sys.argv[1:])"
            words = [sys.executable, "-c", script, str(source), str(out), str(workers)]
        usage = Usage()
        marks: list[tuple[int, float, float]] = []  # records done, wall and processor time
        started = perf_counter()
        with log.open("w") as stream, subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=stream) as process:
            client = psutil.Process(process.pid)
            while process.poll() is None:
                done = _done(log)
                usage.look(client, done)
                if done and (not marks or done > marks[-1][0]):
                    marks.append((done, perf_counter(), sum(usage.processor.values())))
                sleep(SAMPLE_S)
        wall = perf_counter() - started
        if process.returncode:
            raise SystemExit(f"the fleet ended with {process.returncode}: {log.read_text()[-500:]}")
        status = pd.read_parquet(out / "records", columns=["status"])["status"]
        (ahead, begun, spent), (reached, ended, total) = marks[0], marks[-1]
        passed = max(reached - ahead, 1)
        trace = pd.DataFrame(usage.trace, columns=["records", "client_mb", "worker_mb"])
        return Run(
            work="machinery alone" if alone else "analysis",
            records=number,
            workers=workers,
            steady_s=max(ended - begun, SAMPLE_S) / passed,
            processor_s=(total - spent) / passed,
            wall_s=wall,
            failed=int((status != "done").sum()),
            client_mb=float(trace["client_mb"].max()),
            worker_mb=float(trace["worker_mb"].max()),
            trace=trace,
        )


def _done(log: Path) -> int:
    """Records that the command has said to be done."""
    with log.open("rb") as stream:
        stream.seek(0, 2)
        stream.seek(max(0, stream.tell() - 400))
        found = re.findall(rb"^fleet: (\d+)/", stream.read(), re.MULTILINE)
    return int(found[-1]) if found else 0


@styled
def figure(table: pd.DataFrame, traces: dict[str, pd.DataFrame]) -> Figure:
    """Records per second beside memory against records done, analysed and passed through."""
    drawn = Figure(figsize=(WIDTH, 2.8), layout="constrained")
    rate, *memory = drawn.subplots(1, 1 + len(traces), width_ratios=(1.0, *(1.3 for _ in traces)))
    analysed = table[table["work"] == "analysis"]
    short = analysed[analysed["records"] == analysed["records"].min()]
    rate.bar(short["workers"].astype(str), short["records_per_s"], color=AVERAGE, width=0.5)
    rate.set_xlabel("workers")
    rate.set_ylabel("records per second (wall)")
    for axes, (work, trace) in zip(memory, traces.items(), strict=True):
        axes.plot(trace["records"], trace["client_mb"], color=AVERAGE, label="client and scheduler")
        axes.plot(trace["records"], trace["worker_mb"], color=LINEAR, label="largest worker")
        axes.set_ylim(0.0, 1.25 * trace[["client_mb", "worker_mb"]].to_numpy().max())
        axes.set_title(work)
        axes.set_xlabel("records done")
    memory[0].set_ylabel("memory (MB)")
    drawn.legend(*memory[0].get_legend_handles_labels(), loc="outside lower right", ncols=2)
    return drawn


def growth(trace: pd.DataFrame) -> pd.Series:
    """MB by which each process grows in a thousand records, by least squares over the second half of the run."""
    half = trace[(trace["records"] >= 0.5 * trace["records"].max()) & (trace["records"] < trace["records"].max())]
    columns = ("client_mb", "worker_mb")
    return pd.Series({name: 1000.0 * np.polyfit(half["records"], half[name], 1)[0] for name in columns})


def measure(records: int, long: int, alone: int) -> tuple[pd.DataFrame, dict[str, pd.DataFrame]]:
    """Short fleets with 1 and 2 workers, a longer one and the machinery: the table, and the traces of the last two."""
    runs = []
    for number, workers, only in ((records, 1, False), (records, 2, False), (long, 2, False), (alone, 2, True)):
        one = run(number, workers, only)
        runs.append(one)
        print(
            f"{number} records, {workers} worker{'s' * (workers > 1)}, {one.work}: {1.0 / one.steady_s:.2f}"
            f" records/s, {1e3 * one.processor_s:.0f} ms of processor a record, client at most"
            f" {one.client_mb:.0f} MB, worker {one.worker_mb:.0f} MB, {one.failed} failed",
            flush=True,
        )
    traces = {one.work: one.trace for one in runs[-2:]}
    for work, trace in traces.items():
        if trace["records"].max() < FEWEST:
            continue
        grown = growth(trace)
        print(f"{work}: growth in 1000 records: client {grown['client_mb']:.1f} MB, worker {grown['worker_mb']:.1f} MB")
    return pd.DataFrame([one.row for one in runs]), traces


def main(records: int = RECORDS, long: int = LONG, alone: int = MACHINERY, keep: bool = False) -> None:
    """Measure; ``keep`` writes table, traces and figure to ``results/benchmarks``."""
    table, traces = measure(records, long, alone)
    if not keep:
        return
    write_text(OUT / "fleet.csv", record_to_csv(table))
    for work, trace in traces.items():
        name = f"fleet-memory-{work.replace(' ', '-')}.csv"
        write_text(OUT / name, record_to_csv(trace.groupby("records", as_index=False).max()))
    said = "Bars: records per second with 1 and 2 workers. Lines: memory of client and worker against records done."
    write_text(OUT / "fleet.svg", to_svg(figure(table, traces), "fleet", "Fleet: speed and memory", said))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=RECORDS)
    parser.add_argument("--long", type=int, default=LONG)
    parser.add_argument("--machinery", type=int, default=MACHINERY)
    given = parser.parse_args()
    main(given.records, given.long, given.machinery, keep=True)
