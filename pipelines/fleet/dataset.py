"""The data set of a fleet: a folder of Parquet files, one a batch, each written whole and then renamed."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from pipelines.fleet.rows import to_table
from pipelines.store import write_bytes
from selection.errors import InputError


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

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Add a batch as one file, named after its keys."""
        if rows:
            digest = hashlib.sha256("".join(sorted(row["key"] for row in rows)).encode()).hexdigest()
            write_bytes(self.folder / f"part-{digest[:20]}.parquet", _parquet(to_table(rows)))

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
        frame = self._table(path, columns).to_pandas()
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
