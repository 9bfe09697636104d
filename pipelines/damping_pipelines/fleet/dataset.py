"""What a fleet is made of: records found in a folder, tasks that carry all a result depends on, and its data set.

The data set is a folder of Parquet files, one a batch, each written whole and then renamed.
"""

from __future__ import annotations

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
from damping.records.text import read_bytes
from damping_pipelines.manifest import digest_code
from damping_pipelines.store import write_bytes

#: Design forces where none are asked for, in multiples of the largest tested force of each record.
MULTIPLES = (1.5, 2.0)
#: Seconds that a record may take: many times what chains of the largest records in use took.
TIME_LIMIT = 3600.0


@dataclass(frozen=True)
class FleetSettings:
    """What a run is asked to do; every field but ``max_size`` and ``time_limit`` takes part in the key of a result.

    Attributes:
        seed: of the run. fast: few importance draws. level: content of the bands.
        forces: design forces; empty for ``MULTIPLES`` of each record's own. versions: of what computes.
        max_size: largest input file, bytes. despite: checks of the audit whose refusal is passed over.
        code: digest of versions and source (``manifest.digest_code``). time_limit: seconds that a record may take.
    """

    seed: int
    fast: bool
    level: float
    forces: tuple[float, ...]
    versions: dict[str, str]
    max_size: int
    despite: tuple[str, ...] = ()
    code: str = ""
    time_limit: float = TIME_LIMIT

    @property
    def digest(self) -> str:
        """SHA-256 of every field that a result depends on."""
        fields = {name: value for name, value in asdict(self).items() if name not in ("max_size", "time_limit")}
        return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()

    @property
    def method(self) -> str:
        """How posteriors are had, as stated in every row."""
        return "few importance draws" if self.fast else "importance draws"


@dataclass(frozen=True)
class FleetCase:
    """A record with its mode or model.

    Attributes:
        name: as shown. entry: as it stands in the folder. is_model: whether there is a ``model.toml``, to be diagnosed.
    """

    name: str
    entry: str
    record: Path
    model: Path
    is_model: bool


@dataclass(frozen=True)
class FleetTask:
    """A record to analyse. Files go with it, so that workers need no folder in common.

    Attributes:
        name: as shown. key: of content, name and settings. seed: of the record. record_text, model_text: the files;
            None where one cannot be read, and then ``problem`` says why. is_model: diagnose.
    """

    name: str
    key: str
    seed: int
    record_text: bytes | None
    model_text: bytes | None
    is_model: bool
    settings: FleetSettings
    problem: str = ""

    @property
    def digests(self) -> tuple[str, str]:
        """SHA-256 of record and model."""
        return hashlib.sha256(self.record_text or b"").hexdigest(), hashlib.sha256(self.model_text or b"").hexdigest()

    @property
    def inputs(self) -> dict[str, str]:
        """SHA-256 of both files by the names that the user knows."""
        names = ("data.csv", "model.toml") if self.is_model else (f"{self.name}.csv", f"{self.name}.toml")
        return dict(zip(names, self.digests, strict=True))

    @property
    def stem(self) -> str:
        """Path of the pages under the output folder, without their ending; safe whatever the name holds."""
        return f"reports/{identifier(self.name)[:60]}-{self.key[:12]}"


@dataclass(frozen=True)
class FleetResult:
    """What comes of a task: a row, and pages (HTML) by their path under the output folder."""

    row: dict[str, Any]
    pages: dict[str, str]


def find_cases(folder: Path) -> list[FleetCase]:
    """Records ``NAME.csv`` with ``NAME.toml``, and ``NAME/data.csv`` with ``NAME/model.toml``, by name.

    A record without its TOML is listed too, and fails for that reason.

    Raises:
        InputError: no such folder, or nothing in it.
    """
    if not folder.is_dir():
        raise InputError("no such folder", file=folder, expected="a folder of records")
    cases = []
    for entry in os.scandir(folder):
        path = Path(entry.path)
        data, model = path / "data.csv", path / "model.toml"
        if entry.is_dir() and (data.exists() or model.exists()):
            cases.append(FleetCase(describe_shown(entry.name), entry.name, data, model, True))
        elif entry.name.endswith(".csv") and entry.is_file():
            cases.append(FleetCase(describe_shown(entry.name[:-4]), entry.name, path, path.with_suffix(".toml"), False))
    if not cases:
        expected = "NAME.csv with NAME.toml, or NAME/data.csv with NAME/model.toml"
        raise InputError("holds no record", file=folder, expected=expected)
    return sorted(cases, key=lambda case: (case.name, case.is_model))


def describe_shown(name: str) -> str:
    """A file name as text for any file and terminal: bytes that are no UTF-8 and control characters as escapes."""
    return escape_control(os.fsencode(name).decode("utf-8", "backslashreplace"))


def tasks_of(cases: list[FleetCase], settings: FleetSettings) -> Iterator[FleetTask]:
    """Tasks one by one: the files of a record are read when its turn comes."""
    for case in cases:
        record, first = _content(case.record, settings.max_size)
        model, second = _content(case.model, settings.max_size)
        parts = (settings.digest, os.fsencode(case.entry), case.is_model, record, model)
        digest = hashlib.sha256()
        for part in parts:
            content = part if isinstance(part, bytes) else repr(part).encode()
            digest.update(len(content).to_bytes(8, "big") + content)
        key = digest.hexdigest()
        seed = seed_of(settings.seed, key)
        yield FleetTask(case.name, key, seed, record, model, case.is_model, settings, first or second)


def seed_of(seed: int, key: str) -> int:
    """Seed of a record (31 bits) from that of the run and the key of its content: the same on any worker."""
    return int.from_bytes(hashlib.sha256(f"{seed} {key}".encode()).digest()[:4], "big") >> 1


def _content(path: Path, max_size: int) -> tuple[bytes | None, str]:
    """The bytes of a file, or None with the reason."""
    try:
        return read_bytes(path, max_size), ""
    except InputError as error:
        return None, f"{describe_shown(path.name)}: {error.message}"


#: Columns of the data set. ``status``: done, partial (a stage failed, ``reason`` says which) or failed.
SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in ("key", "name", "status", "reason", "audit", "method", "mode", "report")),
        *((name, pa.string()) for name in ("units_force", "units_length", "record_sha256", "model_sha256")),
        *((name, pa.string()) for name in ("version", "code")),
        *((name, pa.int64()) for name in ("seed", "rows", "levels")),
        ("largest_tested_force", pa.float64()),
        ("law", pa.string()),
        *((name, pa.float64()) for name in ("weight", "average_absolute_percent", "held_out_error")),
        ("load_law", pa.string()),
        ("load_weight", pa.float64()),
        *((name, pa.float64()) for name in ("design_force", "extrapolation_ratio", "median", "low", "high", "linear")),
        *((name, pa.float64()) for name in ("frequency", "damping_ratio", "damping_ratio_low", "damping_ratio_high")),
        *((f"linear_overprediction_{name}", pa.float64()) for name in ("percent", "low", "high")),
        ("cautions", pa.list_(pa.string())),
        ("effects", pa.list_(pa.string())),
        ("effects_probability", pa.float64()),
        ("unexplained", pa.bool_()),
        *((f"gap_{name}", pa.float64()) for name in ("nominal", "before", "after", "shrinkage")),
        *((name, pa.string()) for name in ("rank_form", "loads_form", "gap_form")),
    ]
)


def row_of(task: FleetTask) -> dict[str, Any]:
    """A row with what is known before any work; every other column is empty."""
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
class DataSet:
    """Rows kept under ``folder``. A row is known by its ``key``."""

    folder: Path

    def files(self) -> list[Path]:
        """The Parquet files that are ours, in order of name."""
        return sorted(self.folder.glob("part-*.parquet"))

    def read(self, columns: Sequence[str], keys: Collection[str] | None = None) -> pd.DataFrame:
        """Columns of all rows (of those with ``keys``), sorted by name and key; a key counts once.

        Raises:
            InputError: a file that is no Parquet file of a fleet.
        """
        wanted = list(dict.fromkeys(("name", "key", *columns)))
        frames = [self._rows(path, wanted, keys) for path in self.files()]
        if not frames:
            return pd.DataFrame(columns=wanted)
        table = pd.concat(frames, ignore_index=True).drop_duplicates("key")
        return table.sort_values(["name", "key"], ignore_index=True)

    def set_broken_aside(self) -> list[Path]:
        """Rename files that are no Parquet of ours to ``NAME.broken``: their records are computed again."""
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
            digest = hashlib.sha256("".join(sorted(row["key"] for row in rows)).encode()).hexdigest()
            write_bytes(self.folder / f"part-{digest[:20]}.parquet", _parquet(table))

    def keep(self, keys: Collection[str]) -> None:
        """Take out rows with other keys (of records that are gone or have changed), file by file."""
        for path in self.files():
            table = self._table(path, None)
            kept = table.filter(pa.array([key in keys for key in table["key"].to_pylist()], pa.bool_()))
            if len(kept) == 0:
                path.unlink()
            elif len(kept) < len(table):
                write_bytes(path, _parquet(kept))

    def _rows(self, path: Path, columns: Sequence[str], keys: Collection[str] | None) -> pd.DataFrame:
        frame: pd.DataFrame = self._table(path, columns).to_pandas()
        return frame if keys is None else frame[frame["key"].isin(keys)]

    @staticmethod
    def _table(path: Path, columns: Sequence[str] | None) -> pa.Table:
        try:
            return pq.ParquetFile(path).read(columns=None if columns is None else list(columns))
        except (pa.ArrowException, OSError, KeyError) as error:
            reason = str(error).splitlines()[0]
            raise InputError(f"is no part of a fleet ({reason})", file=path, expected="a folder of its own") from error


def _parquet(table: pa.Table) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()
