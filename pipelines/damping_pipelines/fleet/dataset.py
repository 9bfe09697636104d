"""A row of the fleet's data set: what it holds, and where each value comes from.

The data set of a fleet: a folder of Parquet files, one a batch, each written whole and then renamed.
"""

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

from damping import __version__
from damping.errors import InputError
from damping.extrapolation.curve import Curve
from damping.extrapolation.plan import Plan
from damping.extrapolation.prediction import Loads
from damping.gap.diagnose import Diagnosis
from damping.plots import identifier
from damping.ranking import Ranking
from damping.report.forms import gap_form, loads_form, rank_form
from damping_pipelines.fleet.inputs import FleetTask
from damping_pipelines.provenance import digest_code
from damping_pipelines.store import plain, to_json, write_bytes

#: Columns of the data set. ``status``: done, partial (a stage failed, ``reason`` says which) or failed.
SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in ("key", "name", "status", "reason", "audit", "method", "mode", "report")),
        *(
            (name, pa.string())
            for name in ("units_force", "units_length", "record_sha256", "model_sha256", "version", "code")
        ),
        *((name, pa.int64()) for name in ("seed", "rows", "levels")),
        ("largest_tested_force", pa.float64()),
        ("law", pa.string()),
        ("weight", pa.float64()),
        ("average_absolute_percent", pa.float64()),
        ("held_out_error", pa.float64()),
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
        "report": f"{report_stem(task)}.html",
        "record_sha256": record,
        "model_sha256": model,
        "version": __version__,
        "code": digest_code(),
        "seed": task.seed,
    }


def report_stem(task: FleetTask) -> str:
    """Path of a record's page under the output folder, without its ending; safe whatever the name holds."""
    return f"reports/{identifier(task.name)[:60]}-{task.key[:12]}"


def ranking_columns(ranking: Ranking) -> dict[str, Any]:
    """The law of largest weight, and the form."""
    best = max(ranking.candidates, key=lambda candidate: candidate.weight)
    return {
        "law": best.name,
        "weight": best.weight,
        "average_absolute_percent": best.average_absolute_percent,
        "held_out_error": best.held_out_error,
        "rank_form": to_json(rank_form(ranking)),
    }


def loads_columns(loads: Loads, plan: Plan, curve: Curve) -> dict[str, Any]:
    """The prediction at the largest design force with the damping there, and the form."""
    i = int(loads.force.argmax())
    ratio = curve.damping_ratio
    return {
        "load_law": plan.laws[0].name,
        "load_weight": plan.laws[0].weight,
        "design_force": loads.force[i],
        "extrapolation_ratio": loads.ratio[i],
        "median": loads.average.median[i],
        "low": loads.average.low[i],
        "high": loads.average.high[i],
        "frequency": curve.frequency.median[i],
        "damping_ratio": ratio.median[i],
        "damping_ratio_low": ratio.low[i],
        "damping_ratio_high": ratio.high[i],
        "linear": loads.linear[i],
        "linear_overprediction_percent": loads.overprediction[i],
        "linear_overprediction_low": loads.overprediction_low[i],
        "linear_overprediction_high": loads.overprediction_high[i],
        "cautions": list(loads.cautions[i]),
        "loads_form": to_json(loads_form(loads, plan, curve)),
    }


def gap_columns(diagnosis: Diagnosis) -> dict[str, Any]:
    """The leading explanation, and the form."""
    gap = diagnosis.gap
    return {
        "effects": list(diagnosis.leading.effects),
        "effects_probability": diagnosis.hypotheses[0].probability,
        "unexplained": diagnosis.unexplained,
        "gap_nominal": gap.nominal,
        "gap_before": gap.before,
        "gap_after": gap.after,
        "gap_shrinkage": gap.shrinkage,
        "gap_form": to_json(gap_form(diagnosis)),
    }


def to_table(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Rows as an Arrow table; NaN becomes empty."""
    return pa.Table.from_pylist([plain(row) for row in rows], schema=SCHEMA)


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
