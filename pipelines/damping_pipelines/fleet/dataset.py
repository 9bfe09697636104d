"""Parts of a fleet: records in a folder, tasks with everything a result depends on, and the data set."""

import csv
import hashlib
import io
import json
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from damping import __version__
from damping.arrays import plain
from damping.errors import InputError, escape_control
from damping.plots import identifier
from damping.records.mode import Mode, parse_mode
from damping.records.reading import parse_record
from damping.records.record import Record
from damping.records.text import read_bytes
from damping_pipelines.manifest import digest, digest_code
from damping_pipelines.store import write_bytes

#: Design forces where none are asked for, in multiples of the largest tested force of each record.
MULTIPLES = (1.5, 2.0)
#: The mode of every record in a folder that has none of its own name.
SHARED_MODE = "mode.toml"
#: Seconds that a record may take: many times what chains of the largest records in use took.
TIME_LIMIT = 3600.0


@dataclass(frozen=True)
class FleetSettings:
    """Settings of a run; every field except ``max_size`` and ``time_limit`` is part of the key of a result."""

    seed: int
    fast: bool  #: few importance draws
    level: float
    forces: tuple[float, ...]  #: design forces; empty for ``MULTIPLES`` of each record's own
    versions: dict[str, str]
    max_size: int  #: largest input file, bytes
    despite: tuple[str, ...] = ()  #: checks of the audit whose refusal is passed over
    code: str = ""  #: digest of versions and source
    time_limit: float = TIME_LIMIT  #: seconds that a record may take

    @property
    def digest(self) -> str:
        """SHA-256 of every field that a result depends on."""
        fields = {name: value for name, value in asdict(self).items() if name not in ("max_size", "time_limit")}
        return digest(json.dumps(fields, sort_keys=True).encode())

    @property
    def method(self) -> str:
        """The method for posteriors, as stated in every row."""
        return "few importance draws" if self.fast else "importance draws"


@dataclass(frozen=True)
class FleetCase:
    """A record, ``name`` as shown and ``entry`` in its folder, with its mode or (``is_model``) a model to diagnose."""

    name: str
    entry: str
    record: Path
    model: Path
    is_model: bool

    @property
    def files(self) -> tuple[str, str]:
        """Record and mode as messages name them, which a reader finds under the folder of records."""
        inside = f"{self.name}/" if self.entry != self.record.name else ""
        return inside + describe_shown(self.record.name), inside + describe_shown(self.model.name)


@dataclass(frozen=True)
class FleetTask:
    """A record to analyse. Files go with it, so that workers need no folder in common."""

    name: str
    key: str  #: of content, name and settings
    seed: int  #: of the record
    record_text: bytes | None  #: None where the file cannot be read, and then ``problem`` says why
    model_text: bytes | None  #: likewise
    is_model: bool
    files: tuple[str, str]  #: see `FleetCase.files`
    settings: FleetSettings
    problem: str = ""

    @property
    def digests(self) -> tuple[str, str]:
        """SHA-256 of record and model."""
        return digest(self.record_text or b""), digest(self.model_text or b"")

    @property
    def inputs(self) -> dict[str, str]:
        """SHA-256 of both files, by the user's names for them."""
        return dict(zip(self.files, self.digests, strict=True))

    @property
    def stem(self) -> str:
        """Path of the pages under the output folder, without their ending; safe for any name."""
        return f"reports/{identifier(self.name)[:60]}-{self.key[:12]}"


@dataclass(frozen=True)
class FleetResult:
    """The result of a task: a row, and pages (HTML) by their path under the output folder."""

    row: dict[str, Any]
    pages: dict[str, str]


def find_cases(folder: Path) -> list[FleetCase]:
    """Records ``NAME.csv`` with ``NAME.toml`` or else ``SHARED_MODE``, and those in folders of their own.

    These are ``NAME/data.csv`` with ``NAME/model.toml``, as of ``gap``, else ``NAME/record.csv`` with
    ``NAME/mode.toml``, as of a campaign. They are in the order of their names. A record without a mode is listed too,
    and fails for that reason; that of a record ``mode.csv`` is not shared. InputError: no record.
    """
    if not folder.is_dir():
        raise InputError("no such folder", file=folder, expected="a folder of records")
    cases, shared = [], folder / SHARED_MODE
    is_shared = shared.is_file() and not shared.with_suffix(".csv").exists()
    for entry in os.scandir(folder):
        path = Path(entry.path)  # whose questions, unlike those of the entry, a link to itself answers with no
        data, model, record = path / "data.csv", path / "model.toml", path / "record.csv"
        if path.is_dir() and (data.exists() or model.exists()):
            cases.append(FleetCase(describe_shown(entry.name), entry.name, data, model, True))
        elif path.is_dir() and record.exists():
            cases.append(FleetCase(describe_shown(entry.name), entry.name, record, path / SHARED_MODE, False))
        elif entry.name.endswith(".csv") and path.is_file():
            own = path.with_suffix(".toml")
            mode = shared if is_shared and not os.path.lexists(own) else own
            cases.append(FleetCase(describe_shown(entry.name[:-4]), entry.name, path, mode, False))
    if not cases:
        expected = "NAME.csv with NAME.toml or mode.toml, NAME/record.csv with mode.toml, NAME/data.csv with model.toml"
        raise InputError("holds no record", file=folder, expected=expected)
    return sorted(cases, key=lambda case: (case.name, case.entry))


def list_skipped(folder: Path, cases: Collection[FleetCase]) -> list[str]:
    """Names in a folder that look like records or modes and are no case: modes alone, .CSV, folders of folders."""
    taken = {case.entry for case in cases} | {case.model.name for case in cases}
    skipped = []
    for entry in os.scandir(folder):
        seems = Path(entry.name).suffix.lower() in (".csv", ".toml")
        if entry.name not in taken and (seems or any(Path(entry.path).glob("*.csv"))):
            skipped.append(describe_shown(entry.name))
    return sorted(skipped)


def describe_shown(name: str) -> str:
    """A file name as text for any file and terminal, with escapes for invalid UTF-8 and control characters."""
    return escape_control(os.fsencode(name).decode("utf-8", "backslashreplace"))


def tasks_of(cases: list[FleetCase], settings: FleetSettings) -> Iterator[FleetTask]:
    """Tasks one by one; the files of a record are read on demand."""
    for case in cases:
        names = case.files
        record, first = _content(case.record, names[0], settings.max_size)
        model, second = _content(case.model, names[1], settings.max_size)
        hashed = hashlib.sha256()
        for part in (settings.digest, os.fsencode(case.entry), case.is_model, record, model):
            content = part if isinstance(part, bytes) else repr(part).encode()
            hashed.update(len(content).to_bytes(8, "big") + content)
        key = hashed.hexdigest()
        seed = seed_of(settings.seed, key)
        yield FleetTask(case.name, key, seed, record, model, case.is_model, names, settings, first or second)


def seed_of(seed: int, key: str) -> int:
    """Seed of a record (31 bits) from that of the run and the key of its content: the same on any worker."""
    return int.from_bytes(hashlib.sha256(f"{seed} {key}".encode()).digest()[:4], "big") >> 1


def _content(path: Path, name: str, max_size: int) -> tuple[bytes | None, str]:
    """The bytes of a file, or None with the reason, which names it."""
    try:
        return read_bytes(path, max_size), ""
    except InputError as error:
        return None, f"{name}: {error.message}"


def read_files(task: FleetTask) -> tuple[Record, Mode]:
    """Record and mode of a task; messages use the user's names of the files."""
    record, model = task.files
    return parse_record(task.record_text or b"", record), parse_mode(task.model_text or b"", model, task.name)


_TYPES = {
    **{"text": pa.string(), "texts": pa.list_(pa.string()), "logical": pa.bool_()},
    **{"whole": pa.int64(), "number": pa.float64()},
}
with Path(__file__).with_name("columns.csv").open(encoding="utf-8") as _stream:
    #: Columns of the data set; the file says what each of them is.
    SCHEMA = pa.schema([(row["name"], _TYPES[row["type"]]) for row in csv.DictReader(_stream)])


def row_of(task: FleetTask) -> dict[str, Any]:
    """A row with the values known before any work; all other columns are empty."""
    record, model = task.digests
    return dict.fromkeys(SCHEMA.names) | {
        "key": task.key,
        "name": task.name,
        "status": "failed",
        "reason": task.problem,
        "method": task.settings.method,
        "report": f"{task.stem}.html",
        "record_sha256": record,
        "model_sha256": model,
        "version": __version__,
        "code": digest_code(),
        "seed": task.seed,
    }


@dataclass(frozen=True)
class FleetDataSet:
    """Rows in Parquet files under ``folder``, one file per batch, each row identified by its ``key``."""

    folder: Path

    def files(self) -> list[Path]:
        """The Parquet files of the data set, in order of name."""
        return sorted(self.folder.glob("part-*.parquet"))

    def read(self, columns: Sequence[str]) -> pd.DataFrame:
        """Columns of all rows, sorted by name and key, each key once. InputError for a file that is not of a fleet."""
        wanted = list(dict.fromkeys(("name", "key", *columns)))
        frames: list[pd.DataFrame] = [self._table(path, wanted).to_pandas() for path in self.files()]
        if not frames:
            return pd.DataFrame(columns=wanted)
        table = pd.concat(frames, ignore_index=True).drop_duplicates("key")
        return table.sort_values(["name", "key"], ignore_index=True)

    def set_broken_aside(self) -> list[Path]:
        """Rename files that are no Parquet files of a fleet to ``NAME.broken``; their records are computed again."""
        aside = []
        for path in self.files():
            try:
                self._table(path, SCHEMA.names)
            except InputError:
                aside.append(path.with_name(f"{path.name}.broken"))
                path.replace(aside[-1])
        return aside

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Add a batch as one file, named after its keys."""
        if rows:
            table = pa.Table.from_pylist([plain(row) for row in rows], schema=SCHEMA)
            name = digest("".join(sorted(row["key"] for row in rows)).encode())[:20]
            write_bytes(self.folder / f"part-{name}.parquet", _parquet(table))

    def keep(self, keys: Collection[str]) -> None:
        """Remove rows with other keys (of records that are gone or have changed), file by file."""
        for path in self.files():
            table = self._table(path, SCHEMA.names)
            kept = table.filter(pa.array([key in keys for key in table["key"].to_pylist()], pa.bool_()))
            if len(kept) == 0:
                path.unlink()
            elif len(kept) < len(table):
                write_bytes(path, _parquet(kept))

    @staticmethod
    def _table(path: Path, columns: Sequence[str]) -> pa.Table:
        try:
            table = pq.ParquetFile(path).read(columns=list(columns))  # leaves out columns that the file has not
            return table.select(list(columns))
        except (pa.ArrowException, OSError, KeyError) as error:
            reason = str(error).splitlines()[0]
            raise InputError(f"is no part of a fleet ({reason})", file=path, expected="a folder of its own") from error


def _parquet(table: pa.Table) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()
