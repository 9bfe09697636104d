"""``damping fleet``: run the tasks not done yet, store results batch by batch, and write one page at the end."""

import itertools
import socket
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from damping.errors import AnalysisError, InputError
from damping.extrapolation.requested import check_loads
from damping.progress import Advance
from damping.records import require_checks
from damping.report import count, format_joined
from damping_pipelines.fleet import dataset
from damping_pipelines.fleet.analyse import BY_CHANCE, analyse_each
from damping_pipelines.fleet.page import COLUMNS, describe_fleet_page, list_copies, list_drives, shorten
from damping_pipelines.manifest import digest, digest_code, list_altered, publish, sole_writer, versions
from damping_pipelines.store import refuse_inputs, write_text
from damping_pipelines.terminal import print_lines, progress

BATCH = 32  #: rows of a batch at most
PERIOD = 5.0  #: seconds after which a batch is written however few rows it has: what a lost power costs


def fleet(
    records: Path,
    out: Path,
    *,
    scheduler: str | None = None,
    fast: bool = False,
    workers: int | None = None,
    force: Sequence[float] = (),
    level: float = 0.9,
    seed: int = 0,
    dashboard: str = "off",
    replace: bool = False,
    max_size: int,
    despite: Sequence[str] = (),
    time_limit: float = dataset.TIME_LIMIT,
) -> None:
    """Analyse every record of a folder into ``out``: ``records/*.parquet``, ``reports/*.html`` and ``fleet.html``.

    Options are those of ``damping fleet --help``; ``dashboard="off"``: none; ``workers=0``: records one by one.
    InputError: bad usage or input, or results in ``out`` that would be lost. AnalysisError: a record failed (the others
    are done), or the workers are gone.
    """
    check_loads(force or dataset.MULTIPLES, level)
    _check_workers(scheduler, workers, time_limit)
    if with_workers := scheduler is not None or workers != 0:
        from damping_pipelines.fleet import runners  # noqa: PLC0415 - Dask: 19 MB that records one by one do not need
    require_checks(despite)
    _check_address(address := None if dashboard == "off" else dashboard)
    settings = dataset.FleetSettings(
        seed, fast, level, tuple(sorted(force)), versions(), max_size, tuple(despite), digest_code(), time_limit
    )
    refuse_inputs("--out", out, records)
    cases = dataset.find_cases(records)
    with sole_writer(out, ("fleet.html",), [path for case in cases for path in (case.record, case.model)]):
        kept = dataset.FleetDataSet(out / "records")
        for path in kept.set_broken_aside():
            note = f"{path.stem} could not be read: kept as {path.name}, its records are computed again"
            print(f"damping: {note}", file=sys.stderr)
        if not replace:
            _refuse_loss(kept, dataset.tasks_of(cases, settings))
        book = _Book(kept, out, _final(kept, out))
        _name_skipped(records, dataset.list_skipped(records, cases))
        with progress("fleet", len(cases), each=True) as done:
            tasks = book.new(dataset.tasks_of(cases, settings), done)
            first = list(itertools.islice(tasks, 1))  # where nothing is left to do no cluster is started
            tasks = itertools.chain(first, tasks)
            if not first or not with_workers:
                book.keep(analyse_each(tasks), done)
            else:
                with runners.connected(scheduler, workers, address) as client:
                    runners.greet(client, done, shown=scheduler is not None or address is not None)
                    if scheduler is not None:
                        runners.check_code(client)
                    book.keep(runners.distributed(client, tasks), done)
        _drop(out, book.wanted, kept)
        _finish(out, kept, settings)


def _name_skipped(records: Path, skipped: list[str]) -> None:
    """Print which files and folders of the records are not read; nothing if all are."""
    if skipped:
        kinds, names = "none of NAME.csv, NAME/record.csv and NAME/data.csv", format_joined(shorten(skipped))
        print(f"damping: {records}: not read, as {kinds}: {names}", file=sys.stderr)


def _check_workers(scheduler: str | None, workers: int | None, time_limit: float) -> None:
    """InputError for a number of workers or a time limit that is none, or workers beside a scheduler."""
    if workers is not None and workers < 0:
        raise InputError(f"--workers {workers}", expected="0 (none: in this process), 1, 2, ...")
    if scheduler is not None and workers is not None:
        raise InputError("--workers is for a local cluster", expected="either --scheduler or --workers")
    if not time_limit > 0.0:
        raise InputError(f"--time-limit {time_limit:g}", expected="seconds, more than 0")


def _check_address(dashboard: str | None) -> None:
    """InputError unless this is ``HOST:PORT`` of a known host, or None."""
    if dashboard is None:
        return
    host, _, port = dashboard.rpartition(":")
    try:
        if not (port.isascii() and port.isdigit() and int(port) < 65536):
            raise OSError("no port")
        socket.getaddrinfo(host, int(port))
    except (OSError, UnicodeError) as error:
        raise InputError(f"--dashboard {dashboard!r}", expected="HOST:PORT of this machine, or off") from error


@dataclass
class _Book:
    """Stored rows, requested tasks, and results not written yet."""

    kept: dataset.FleetDataSet
    out: Path
    there: set[str]
    wanted: set[str] = field(default_factory=set)
    results: list[dataset.FleetResult] = field(default_factory=list)
    written: float = field(default_factory=time.monotonic)

    def new(self, tasks: Iterable[dataset.FleetTask], done: Advance) -> Iterator[dataset.FleetTask]:
        """Tasks without results."""
        for known, run in itertools.groupby(tasks, lambda task: task.key in self.there):
            if known:
                keys = [task.key for task in run]
                self.wanted.update(keys)
                done("done in an earlier run", len(keys))
            else:
                for task in run:
                    self.wanted.add(task.key)
                    yield task

    def keep(self, results: Iterator[dataset.FleetResult], done: Callable[[str], None]) -> None:
        """Write results in batches as they arrive, also when the run is interrupted."""
        try:
            for result in results:
                self.results.append(result)
                row = result.row
                done(row["name"] + (f" {row['status']}: {row['reason']}" if row["reason"] else ""))
                if len(self.results) >= BATCH or time.monotonic() - self.written > PERIOD:
                    self.flush()
        finally:
            self.flush()

    def flush(self) -> None:
        """Write pages first, so that a row never lacks its page."""
        for result in self.results:
            for name, html in result.pages.items():
                write_text(self.out / name, html)
        self.kept.add([result.row for result in self.results])
        self.results, self.written = [], time.monotonic()


def _final(kept: dataset.FleetDataSet, out: Path) -> set[str]:
    """Keys of rows that stay, without records that failed for external reasons or whose pages are gone or changed."""
    table, altered = kept.read(["reason", "report", "effects"]), list_altered(out)
    needed = [
        _list_pages(report)[: 1 if effects is None else 2]
        for report, effects in zip(table["report"], table["effects"], strict=True)
    ]
    there = [all((out / page).is_file() and page not in altered for page in pages) for pages in needed]
    again = _find_chance(table) | ~pd.Series(there, dtype=bool)
    final = set(table.loc[~again, "key"])
    if again.any():
        kept.keep(final)
    return final


def _find_chance(table: pd.DataFrame) -> pd.Series:
    """Which rows failed for external reasons."""
    return table["reason"].fillna("").str.startswith(BY_CHANCE)


def _list_pages(report: str) -> list[str]:
    """Pages of a row by its ``report``, that of the record and that of its diagnosis, where there is one."""
    stem = Path(report).stem  # a name alone: a row that was tampered with leads nowhere else
    return [f"reports/{stem}{ending}" for ending in (".html", "-gap.html")]


def _refuse_loss(kept: dataset.FleetDataSet, tasks: Iterable[dataset.FleetTask]) -> None:
    """InputError for stored rows that this run does not request although their records have not changed."""
    names, contents, keys = set(), set(), set()
    for task in tasks:
        names.add(task.name)
        contents.add((task.name, *task.digests))
        keys.add(task.key)
    table = kept.read(["record_sha256", "model_sha256", "reason"])
    other = table[~table["key"].isin(keys) & ~_find_chance(table)]
    contained = list(zip(other["name"], other["record_sha256"], other["model_sha256"], strict=True))
    lost = [content[0] for content in contained if content[0] not in names or content in contents]
    if lost:
        message = f"holds {count(len(lost), 'result')} of other records, settings or versions, the first of {lost[0]!r}"
        raise InputError(message, file=kept.folder, expected="another --out, or --replace to drop them")


def _drop(out: Path, wanted: set[str], kept: dataset.FleetDataSet) -> None:
    """Remove rows that are no longer requested, and their pages, and nothing else in the folder."""
    table = kept.read(["report"])
    for report in table.loc[~table["key"].isin(wanted), "report"]:
        for page in _list_pages(report):
            (out / page).unlink(missing_ok=True)
    kept.keep(wanted)


def _finish(out: Path, kept: dataset.FleetDataSet, settings: dataset.FleetSettings) -> None:
    """Write the page of the fleet and the manifest of every file of the run, and print the summary."""
    table = kept.read((*COLUMNS, "model_sha256"))
    page = describe_fleet_page(table, settings)
    pages = itertools.chain.from_iterable(map(_list_pages, table["report"]))
    parts = [path.relative_to(out).as_posix() for path in kept.files()]
    sources = table[["name", "record_sha256", "model_sha256"]].to_numpy()
    publish(
        out,
        {"fleet.html": page.encode()},
        seed=settings.seed,
        versions=settings.versions,
        inputs={name: digest((record + model).encode()) for name, record, model in sources},
        kept=[*parts, *(name for name in pages if (out / name).is_file())],
    )
    counts = table["status"].value_counts()
    outcome = ", ".join(f"{counts[status]} {status}" for status in ("done", "partial", "failed") if status in counts)
    print_lines(f"{len(table)} records: {outcome}. {out / 'fleet.html'} and {kept.folder} written")
    for said in (*list_drives(table, settings.forces), *list_copies(table)):
        print_lines(f"Caution: {said}.")
    lost = table.loc[table["status"] == "failed", "reason"]
    if len(lost):
        raise AnalysisError(f"{len(lost)} of {len(table)} records failed; the first: {lost.iloc[0]}")
