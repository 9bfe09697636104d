"""Stage of ``damping blind``: cases whose effect is withheld, diagnosed from their files alone, then scored.

Three steps that share nothing but files: the generator writes case folders and a sealed file of labels, whose SHA-256
is recorded before anything is diagnosed; the diagnosis reads the case folders; the scorer opens labels and answers.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.generator import Case, Stratum, draw_case, strata
from pipelines.progress import progress
from pipelines.store import to_json, write_text


def make_cases(
    folder: Path, labels: Path, n: int, seed: int, kinds: tuple[str, ...] | None = None, jobs: int | None = None
) -> str:
    """Write ``n`` cases as ``folder/NAME/model.toml`` and ``data.csv`` and their labels as ``labels``; its SHA-256.

    Names are random and carry nothing. ``kinds`` chooses effects (or ``null:nothing``, ``null:parameters``,
    ``null:scatter``, ``pair:force-instrument``, ``pair:two-forces``, ``pair:force-structure``); all, in the shares of a
    blind run, without it. Half are drawn clean, half in field conditions. The seed alone decides every case.
    """
    plan = strata(n, kinds)
    names = _names(n, seed)
    tasks = [(stratum, (seed, number), name) for number, (stratum, name) in enumerate(zip(plan, names, strict=True))]
    sealed: dict[str, Any] = {}
    with progress("cases", n) as advance:
        for (_, _, name), case in zip(tasks, _drawn(tasks, jobs), strict=True):
            write_text(folder / name / "model.toml", case.model)
            write_text(folder / name / "data.csv", case.data)
            sealed[name] = case.label
            advance(name)
    text = to_json({"format": "labels/1", "seed": seed, "cases": dict(sorted(sealed.items()))})
    write_text(labels, text)
    return hashlib.sha256(text.encode()).hexdigest()


def _names(n: int, seed: int) -> list[str]:
    """Random names, all different, in no order."""
    rng = np.random.default_rng([seed, 0x6E616D65])
    return [f"{number:08x}" for number in rng.choice(1 << 32, size=n, replace=False)]


def _drawn(tasks: list[tuple[Stratum, tuple[int, int], str]], jobs: int | None) -> Iterator[Case]:
    workers = jobs or os.cpu_count() or 1
    if workers == 1:
        yield from map(_one, tasks)
        return
    with ProcessPoolExecutor(workers) as pool:
        results: Iterable[Case] = pool.map(_one, tasks, chunksize=4)
        yield from results


def _one(task: tuple[Stratum, tuple[int, int], str]) -> Case:
    stratum, seed, name = task
    return draw_case(stratum.kind, stratum.field, seed, f"case {name}")
