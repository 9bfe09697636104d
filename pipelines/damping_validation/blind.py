"""Stage of ``damping blind``: cases whose effect is withheld, diagnosed from their files alone, then scored.

Three steps that share nothing but files: the generator writes case folders and a sealed file of labels, whose SHA-256
is recorded before anything is diagnosed; the diagnosis reads the case folders; the scorer opens labels and answers.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from damping.errors import InputError
from damping_pipelines.manifest import publish, sole_writer
from damping_pipelines.provenance import versions
from damping_pipelines.store import to_json, write_json, write_text
from damping_pipelines.terminal import progress
from damping_validation import generator
from damping_validation.generator import BLIND_CASES, BLIND_SEED, BlindCase, Stratum, draw_case, strata
from damping_validation.scorer import read_sealed, score
from damping_validation.scorer_output import SCORES, render_scores

#: Seed of whatever the diagnosis samples: it has nothing to do with the seed of the cases.
DIAGNOSIS_SEED = 1970

__all__ = ["BLIND_CASES", "BLIND_SEED", "blind", "make_cases"]

_REPORTED = 25  # cases between two lines of progress


def blind(out: Path, cases: int, seed: int | None, jobs: int | None) -> None:
    """Draw cases, seal their labels, diagnose from the case files alone, score; everything goes to ``out``.

    ``out`` gets ``cases/NAME/model.toml`` and ``data.csv``, ``labels.sealed.json``, ``sealed.json`` (their SHA-256,
    written before the diagnosis), ``answers/NAME.json`` and what the scorer leaves (``scorer_output.render_scores``).
    Cases that the same generator sealed there before, for the same seed, are used again. Without a seed it is the one
    kept for blind cases.

    Raises:
        InputError: fewer than one case, or an ``out`` that holds the cases of another run.
    """
    seed = BLIND_SEED if seed is None else seed
    if cases < 1:
        raise InputError(f"{cases} cases", expected="one or more")
    with sole_writer(out, SCORES):
        _blind(out, cases, seed, jobs)


def _blind(out: Path, cases: int, seed: int, jobs: int | None) -> None:
    folder, labels = out / "cases", out / "labels.sealed.json"
    strangers = {path.name for path in folder.glob("*")} - set(_list_names(cases, seed))
    if strangers:
        raise InputError("holds cases of another run", file=folder, expected="an empty --out, or the same run again")
    run = {"format": "sealed/1", "cases": cases, "seed": seed, "generator": _describe_generator_digest()}
    sealed = _describe_sealed_before(out, run)
    if sealed is None:
        sealed = make_cases(folder, labels, cases, seed, jobs=jobs, nearest=True)
        write_json(out / "sealed.json", {**run, "sha256": sealed})
    from damping_pipelines.gap import diagnose_folder  # noqa: PLC0415 - not even loaded before the labels are sealed

    before = _processor_time()
    diagnose_folder(folder, out / "answers", jobs=jobs, seed=DIAGNOSIS_SEED)
    spent = _processor_time() - before
    verdicts = read_sealed(labels, out / "answers", sealed)
    written = [*folder.glob("*/*.*"), *(out / "answers").glob("*.json"), labels, out / "sealed.json"]
    kept = sorted(path.relative_to(out).as_posix() for path in written)
    scores = render_scores(score(verdicts, spent), verdicts, seed)
    publish(out, scores, seed=seed, versions=versions(), inputs={}, kept=kept)


def _describe_sealed_before(out: Path, run: dict[str, Any]) -> str | None:
    """The SHA-256 of the labels in ``out``, if they are those of this very run; None otherwise."""
    try:
        noted = json.loads((out / "sealed.json").read_text(encoding="utf-8"))
        sealed = hashlib.sha256((out / "labels.sealed.json").read_bytes()).hexdigest()
    except (FileNotFoundError, ValueError):
        return None
    return sealed if noted == {**run, "sha256": sealed} else None


def _describe_generator_digest() -> str:
    """SHA-256 of the generator's source."""
    modules = sorted(Path(generator.__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(module.read_bytes() for module in modules)).hexdigest()


def _processor_time() -> float:
    """Processor time of this process and of its finished children, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


class _Task(NamedTuple):
    stratum: Stratum
    seed: tuple[int, int]
    name: str
    nearest: bool


def make_cases(
    folder: Path,
    labels: Path,
    n: int,
    seed: int,
    kinds: tuple[str, ...] | None = None,
    jobs: int | None = None,
    nearest: bool = False,
) -> str:
    """Write ``n`` cases as ``folder/NAME/model.toml`` and ``data.csv`` and their labels as ``labels``; its SHA-256.

    Names are random and carry nothing. ``kinds`` chooses effects (or ``null:nothing``, ``null:parameters``,
    ``null:scatter``, ``pair:force-instrument``, ``pair:two-forces``, ``pair:force-structure``); all, in the shares of a
    blind run, without it. Half are drawn clean, half in field conditions. The seed alone decides every case.
    ``nearest`` has the label say which other effect comes closest (seconds a case).
    """
    names = _list_names(n, seed)
    drawn = zip(strata(n, kinds), names, strict=True)
    tasks = [_Task(stratum, (seed, number), name, nearest) for number, (stratum, name) in enumerate(drawn)]
    sealed: dict[str, Any] = {}
    with progress("cases drawn", n) as advance:
        for number, (task, case) in enumerate(zip(tasks, _cases(tasks, jobs), strict=True), start=1):
            write_text(folder / task.name / "model.toml", case.model)
            write_text(folder / task.name / "data.csv", case.data)
            sealed[task.name] = case.label
            if number % _REPORTED == 0 or number == n:
                advance(task.name, (number - 1) % _REPORTED + 1)
    text = to_json({"format": "labels/1", "seed": seed, "cases": dict(sorted(sealed.items()))})
    write_text(labels, text)
    return hashlib.sha256(text.encode()).hexdigest()


def _list_names(n: int, seed: int) -> list[str]:
    """Random names, all different, in no order."""
    rng = np.random.default_rng([seed, 0x6E616D65])
    return [f"{number:08x}" for number in rng.choice(1 << 32, size=n, replace=False).tolist()]


def _cases(tasks: list[_Task], jobs: int | None) -> Iterator[BlindCase]:
    workers = min(jobs or os.cpu_count() or 1, len(tasks))
    if workers == 1:
        yield from map(_drawn, tasks)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(_drawn, tasks, chunksize=4)


def _drawn(task: _Task) -> BlindCase:
    return draw_case(task.stratum.kind, task.stratum.field, task.seed, f"case {task.name}", task.nearest)
