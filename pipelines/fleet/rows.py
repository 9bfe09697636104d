"""A row of the fleet's data set: what it holds, and where each value comes from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from pipelines.extrapolate import loads_form, plan_form
from pipelines.fleet.inputs import Task
from pipelines.gap import gap_form
from pipelines.rank import rank_form
from pipelines.store import plain, to_json
from selection.compare.ranking import Ranking
from selection.gap.diagnose import Diagnosis
from selection.loads.plan import Plan
from selection.loads.prediction import Loads
from selection.plots.style import identifier

#: Columns of the data set. ``status``: done, partial (a stage failed, ``reason`` says which) or failed.
SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in ("key", "name", "status", "reason", "method", "mode", "report")),
        *((name, pa.string()) for name in ("units_force", "units_length", "record_sha256", "model_sha256", "version")),
        *((name, pa.int64()) for name in ("seed", "rows", "levels")),
        ("largest_tested_force", pa.float64()),
        ("law", pa.string()),
        ("weight", pa.float64()),
        ("average_absolute_percent", pa.float64()),
        ("held_out_error", pa.float64()),
        ("load_law", pa.string()),
        ("load_weight", pa.float64()),
        *((name, pa.float64()) for name in ("design_force", "extrapolation_ratio", "median", "low", "high", "linear")),
        *((f"linear_overprediction_{name}", pa.float64()) for name in ("percent", "low", "high")),
        ("cautions", pa.list_(pa.string())),
        ("effects", pa.list_(pa.string())),
        ("effects_probability", pa.float64()),
        ("unexplained", pa.bool_()),
        *((f"gap_{name}", pa.float64()) for name in ("nominal", "before", "after", "shrinkage")),
        *((name, pa.string()) for name in ("rank_form", "loads_form", "gap_form")),
    ]
)


def row_of(task: Task) -> dict[str, Any]:
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
        "version": task.settings.versions["damping-selection"],
        "seed": task.seed,
    }


def report_stem(task: Task) -> str:
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


def loads_columns(loads: Loads, plan: Plan) -> dict[str, Any]:
    """The prediction at the largest design force, and the form."""
    i = int(loads.force.argmax())
    return {
        "load_law": plan.laws[0].name,
        "load_weight": plan.laws[0].weight,
        "design_force": loads.force[i],
        "extrapolation_ratio": loads.ratio[i],
        "median": loads.average.median[i],
        "low": loads.average.low[i],
        "high": loads.average.high[i],
        "linear": loads.linear[i],
        "linear_overprediction_percent": loads.overprediction[i],
        "linear_overprediction_low": loads.overprediction_low[i],
        "linear_overprediction_high": loads.overprediction_high[i],
        "cautions": list(loads.cautions[i]),
        "loads_form": to_json({**loads_form(loads), **plan_form(plan)}),
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
