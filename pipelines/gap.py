"""``damping gap``: the gap between a simulation and a test, of one record or of a folder of cases (form ``gap/1``)."""

from __future__ import annotations

import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from pipelines.progress import progress
from pipelines.store import write_json, write_text
from selection.errors import AnalysisError, DampingError, InputError
from selection.gap.corrected import corrected_mode, effect_values, refitted_values
from selection.gap.diagnose import Diagnosis, diagnose
from selection.gap.effects.catalogue import CATALOGUE
from selection.records.mode import mode_to_toml, read_mode
from selection.records.reading import read_record

FORMAT = "gap/1"


def gap(
    model: Path,
    record: Path | None,
    report: Path | None,
    model_out: Path | None,
    json_out: str | None,
    posterior: bool | None,
    seed: int,
    max_size: int,
    jobs: int | None,
) -> None:
    """Diagnose one record, or, without ``record``, every case of the folder ``model`` into the folder ``json_out``.

    Raises:
        InputError: bad usage or input.
        AnalysisError: the diagnosis cannot be made, or some cases of a folder failed.
    """
    if record is None:
        _folder(model, report, model_out, json_out, jobs, seed)
        return
    diagnosis = diagnose(read_record(record, max_size=max_size), read_mode(model, max_size=max_size))
    if json_out is not None:
        write_json(json_out, gap_form(diagnosis))
    if model_out is not None:
        write_text(model_out, mode_to_toml(corrected_mode(diagnosis.leading.best, CATALOGUE)))


def _folder(
    cases: Path, report: Path | None, model_out: Path | None, json_out: str | None, jobs: int | None, seed: int
) -> None:
    if report is not None or model_out is not None:
        raise InputError("--report and --model-out are for one record", expected="MODEL.toml RECORD.csv")
    if json_out is None or json_out == "-":
        raise InputError("a folder of cases needs a folder for the answers", expected="--json OUT_DIR")
    if diagnose_folder(cases, Path(json_out), jobs=jobs, seed=seed):
        raise AnalysisError("some cases could not be diagnosed; their answers say why")


def diagnose_folder(cases: Path, out: Path, *, jobs: int | None, seed: int) -> int:
    """Diagnose ``NAME/model.toml`` with ``NAME/data.csv`` of every NAME in ``cases`` into ``out/NAME.json``.

    A case that fails gets ``{"format", "error"}`` and the others go on. Returns the exit code: 0, or 1 if any failed.

    Raises:
        InputError: ``cases`` is no folder, or holds no case.
    """
    if not cases.is_dir():
        raise InputError("no such folder", file=cases, expected="MODEL.toml RECORD.csv, or a folder of cases")
    names = sorted(path.parent.name for path in cases.glob("*/model.toml"))
    if not names:
        raise InputError("holds no case", file=cases, expected="NAME/model.toml with NAME/data.csv")
    failed = 0
    with progress("diagnosing", len(names)) as advance, ProcessPoolExecutor(_workers(jobs, len(names))) as pool:
        futures = {pool.submit(partial(diagnose_case, cases / name)): name for name in names}
        for future in as_completed(futures):
            name, answer = futures[future], future.result()
            write_json(out / f"{name}.json", answer)
            failed += "error" in answer
            advance(f"{name} failed: {answer['error']}" if "error" in answer else name)
    return 1 if failed else 0


def diagnose_case(folder: Path) -> dict[str, Any]:
    """The answer of one case, or ``{"format", "error"}``."""
    started = time.process_time()
    try:
        diagnosis = diagnose(read_record(folder / "data.csv"), read_mode(folder / "model.toml"))
        answer = gap_form(diagnosis)
    except DampingError as error:
        return {"format": FORMAT, "error": str(error)}
    return answer | {"cpu_seconds": time.process_time() - started}


def gap_form(diagnosis: Diagnosis) -> dict[str, Any]:
    """The form ``gap/1``."""
    leading = diagnosis.leading
    held = diagnosis.held_out
    return {
        "format": FORMAT,
        "effects": list(leading.effects),
        "explanations": [
            {"effects": list(one.effects), "probability": one.probability} for one in diagnosis.explanations
        ],
        "equivalents": [list(group.effects) for group in diagnosis.groups],
        "unexplained": diagnosis.unexplained,
        "where": [asdict(cell) for cell in diagnosis.where],
        "footprint": [asdict(cell) for cell in diagnosis.footprint],
        "gap": {
            "nominal": diagnosis.gap.nominal,
            "before": diagnosis.gap.before,
            "after": diagnosis.gap.after,
            "shrinkage": diagnosis.gap.shrinkage,
            "held_out": None
            if held is None
            else {
                "scheme": held.scheme,
                "nominal": held.nominal,
                "before": held.before,
                "after": held.after,
                "shrinkage": held.shrinkage,
                "low": held.low,
                "high": held.high,
            },
        },
        "parameters": effect_values(leading.best) | {"simulation": refitted_values(leading.best)},
        "next_test": None,
        "tests": [asdict(test) for test in diagnosis.tests],
        "cautions": list(diagnosis.cautions),
    }


def _workers(jobs: int | None, cases: int) -> int:
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(jobs or available, cases))
