"""Records per second against workers, and memory against fleet size, of ``damping fleet --fast`` on a local cluster.

Run ``python -m benchmarks.fleet [--records N] [--long N]``: N records with 1 worker and with 2, then a longer fleet
with 2, whose memory is sampled as it goes. Records are resonances of seven structures at 4 to 6 levels, with 2 % of
noise. The command runs as a process of its own; what its processes use is read from outside. Table, trace and figure
go to ``results/benchmarks``.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
import pandas as pd
import psutil
from matplotlib.figure import Figure

from pipelines.store import write_text
from selection.loads.simulated import OMEGA, simulated_levels, structures
from selection.plots.style import AVERAGE, LINEAR, MUTED, WIDTH, styled, to_svg
from selection.records.serialise import record_to_csv

OUT = Path(__file__).parents[1] / "results" / "benchmarks"
RECORDS, LONG = 60, 200
SAMPLE_S = 0.5
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
    """One fleet: wall time from the first to the last record, and of all; processor time of all processes."""

    records: int
    workers: int
    steady_s: float
    wall_s: float
    processor_s: float
    failed: int
    client_mb: float
    worker_mb: float
    trace: pd.DataFrame

    @property
    def row(self) -> dict[str, float]:
        """The run as a row of the table."""
        return {
            "records": self.records,
            "workers": self.workers,
            "records_per_s": (self.records - 1) / self.steady_s,
            "wall_s": self.wall_s,
            "processor_s": self.processor_s,
            "processor_s_per_record": self.processor_s / self.records,
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


def run(number: int, workers: int) -> Run:
    """Run the command on new records and watch it."""
    with tempfile.TemporaryDirectory() as folder:
        source, out, log = (Path(folder) / name for name in ("in", "out", "log"))
        write_records(source, number)
        words = [sys.executable, "-m", "pipelines.cli", "fleet", str(source), "--out", str(out), "--fast"]
        words += ["--workers", str(workers), "--dashboard", "off"]
        usage, first, last = Usage(), None, 0.0
        started = perf_counter()
        with log.open("w") as stream, subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=stream) as process:
            client = psutil.Process(process.pid)
            while process.poll() is None:
                done = _done(log)
                if done and first is None:
                    first = (perf_counter(), done)
                if done < number:
                    last = perf_counter()
                usage.look(client, done)
                sleep(SAMPLE_S)
        wall = perf_counter() - started
        if process.returncode:
            raise SystemExit(f"the fleet ended with {process.returncode}: {log.read_text()[-500:]}")
        status = pd.read_parquet(out / "records", columns=["status"])["status"]
        begun, ahead = first or (started, 0)
        trace = pd.DataFrame(usage.trace, columns=["records", "client_mb", "worker_mb"])
        return Run(
            records=number,
            workers=workers,
            steady_s=max(last - begun, SAMPLE_S) * (number - 1) / max(number - ahead, 1),
            wall_s=wall,
            processor_s=sum(usage.processor.values()),
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
def figure(table: pd.DataFrame, trace: pd.DataFrame) -> Figure:
    """Records per second beside memory against records done."""
    drawn = Figure(figsize=(WIDTH, 2.8))
    rate, memory = drawn.subplots(1, 2, width_ratios=(1.0, 1.7))
    short = table[table["records"] == table["records"].min()]
    rate.bar(short["workers"].astype(str), short["records_per_s"], color=AVERAGE, width=0.5)
    rate.set_xlabel("workers")
    rate.set_ylabel("records per second (wall)")
    memory.plot(trace["records"], trace["client_mb"], color=AVERAGE, label="client and scheduler")
    memory.plot(trace["records"], trace["worker_mb"], color=LINEAR, label="largest worker")
    memory.axhline(trace["client_mb"].median(), color=MUTED, linewidth=0.6)
    memory.set_ylim(0.0, 1.25 * trace[["client_mb", "worker_mb"]].to_numpy().max())
    memory.set_xlabel("records done")
    memory.set_ylabel("memory (MB)")
    memory.legend(loc="lower right")
    return drawn


def growth(trace: pd.DataFrame) -> pd.Series:
    """MB by which each process grows in a thousand records, by least squares over the second half of the run."""
    half = trace[trace["records"] >= 0.5 * trace["records"].max()]
    columns = ("client_mb", "worker_mb")
    return pd.Series({name: 1000.0 * np.polyfit(half["records"], half[name], 1)[0] for name in columns})


def measure(records: int, long: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Short fleets with 1 and 2 workers and a long one with 2: the table, and the trace of the long one."""
    runs = []
    for number, workers in ((records, 1), (records, 2), (long, 2)):
        runs.append(run(number, workers))
        one = runs[-1].row
        print(
            f"{number} records, {workers} worker{'s' * (workers > 1)}: {one['records_per_s']:.2f} records/s,"
            f" {1e3 * one['processor_s_per_record']:.0f} ms of processor a record, client at most"
            f" {one['largest_client_mb']:.0f} MB, worker {one['largest_worker_mb']:.0f} MB, {one['failed']} failed",
            flush=True,
        )
    grown = growth(runs[-1].trace)
    print(f"growth in 1000 records: client {grown['client_mb']:.1f} MB, worker {grown['worker_mb']:.1f} MB")
    return pd.DataFrame([one.row for one in runs]), runs[-1].trace


def main(records: int = RECORDS, long: int = LONG, keep: bool = False) -> None:
    """Measure; ``keep`` writes table, trace and figure to ``results/benchmarks``."""
    table, trace = measure(records, long)
    if not keep:
        return
    write_text(OUT / "fleet.csv", record_to_csv(table))
    write_text(OUT / "fleet-memory.csv", record_to_csv(trace.groupby("records", as_index=False).max()))
    said = "Bars: records per second with 1 and 2 workers. Lines: memory of client and worker against records done."
    write_text(OUT / "fleet.svg", to_svg(figure(table, trace), "fleet", "Fleet: speed and memory", said))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=RECORDS)
    parser.add_argument("--long", type=int, default=LONG)
    given = parser.parse_args()
    main(given.records, given.long, keep=True)
