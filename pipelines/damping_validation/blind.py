"""Stage of ``damping blind``: cases whose effect is withheld, diagnosed from their files alone, then scored.

Three steps that share nothing but files: the generator writes case folders and a sealed file of labels, whose SHA-256
is recorded before anything is diagnosed; the diagnosis reads the case folders; the scorer opens labels and answers.
If requested, the test proposed by an answer is made on the truth of its case, and the case is diagnosed again.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from damping.errors import InputError
from damping_pipelines import count_jobs, start_pool
from damping_pipelines.manifest import digest, publish, sole_writer, versions
from damping_pipelines.store import to_json, write_json, write_text
from damping_pipelines.terminal import progress
from damping_validation import generator
from damping_validation.scorer import Verdict, judge, score
from damping_validation.scorer_output import SCORES, describe_verdict, render_scores

Work = TypeVar("Work")
Done = TypeVar("Done")
_REPORTED = 25  # cases between two lines of progress


def blind(out: Path, cases: int, seed: int | None, jobs: int | None, follow: bool = False) -> None:
    """Draw cases, seal their labels, diagnose from the case files alone, score; everything goes to ``out``.

    ``out`` gets ``cases/NAME/model.toml`` and ``data.csv``, ``labels.sealed.json``, ``sealed.json`` (their SHA-256,
    written before the diagnosis), ``answers/NAME.json`` and the output of the scorer (``scorer_output.render_scores``).
    Cases that the same generator sealed there before, for the same seed, are used again. Without a seed it is the one
    kept for blind cases. ``follow``: every test that an answer proposes in numbers is made on the truth of its case,
    its rows stand after the case's own in ``next/cases/NAME``, and ``next/answers/NAME.json`` is the answer to both.
    InputError: fewer than one case, or an ``out`` that holds the cases of another run.
    """
    seed = generator.BLIND_SEED if seed is None else seed
    if cases < 1:
        raise InputError(f"{cases} cases", expected="one or more")
    with sole_writer(out, SCORES):
        folder, labels = out / "cases", out / "labels.sealed.json"
        strangers = {path.name for path in folder.glob("*")} - set(_list_names(cases, seed))
        if strangers:
            raise InputError(
                "holds cases of another run", file=folder, expected="an empty --out, or the same run again"
            )
        source = sorted(Path(generator.__file__).parent.glob("*.*"))
        code = digest(b"".join(file.read_bytes() for file in source))
        run = {"format": "sealed/1", "cases": cases, "seed": seed, "generator": code}
        sealed = _describe_sealed_before(out, run)
        if sealed is None:
            sealed = make_cases(folder, labels, cases, seed, jobs=jobs)
            write_json(out / "sealed.json", {**run, "sha256": sealed})
        from damping_pipelines.gap import diagnose_folder  # noqa: PLC0415 - not even loaded before the labels are sealed

        before = sum(os.times()[:4])  # processor time of this process and of its finished children, s
        diagnose_folder(folder, out / "answers", jobs)
        spent = sum(os.times()[:4]) - before
        verdicts = read_sealed(labels, out / "answers", sealed)
        followed = None
        if follow:
            names = set(make_proposed_tests(out, _list_tasks(cases, seed), jobs))
            if names:
                diagnose_folder(out / "next" / "cases", out / "next" / "answers", jobs)
            again = read_verdicts(json.loads(labels.read_bytes()), out / "next" / "answers")
            followed = [verdict for verdict in again if verdict.name in names]
        figures = score(verdicts, spent, followed)
        kept = [labels, out / "sealed.json", *(path for path in out.glob("**/cases/*/*.*"))]
        kept += list(out.glob("**/answers/*.json"))
        names_kept = sorted(path.relative_to(out).as_posix() for path in kept)
        publish(out, render_scores(figures, verdicts, seed), seed=seed, versions=versions(), inputs={}, kept=names_kept)
        print(describe_verdict(figures, verdicts))


def make_proposed_tests(out: Path, tasks: Iterable[_Task], jobs: int | None) -> list[str]:
    """Make every test proposed by an answer in ``out/next/cases``; return the names of these cases.

    A test without a steady state gives no case, and so no answer.
    """
    for folder in ("cases", "answers"):
        shutil.rmtree(out / "next" / folder, ignore_errors=True)
    proposals = []
    for task in tasks:
        proposed = read_answer(out / "answers" / f"{task.name}.json").get("next_test") or {}
        if proposed.get("rows"):
            data = (out / "cases" / task.name / "data.csv").read_text(encoding="utf-8")
            proposals.append(_Proposal(task, data, proposed["rows"], set(proposed.get("columns") or ())))
    with progress("proposed tests made", len(proposals)) as advance:
        for proposal, text in zip(proposals, _each(_make_test, proposals, jobs), strict=True):
            name = proposal.task.name
            if text is not None:
                model = (out / "cases" / name / "model.toml").read_text(encoding="utf-8")
                write_text(out / "next" / "cases" / name / "model.toml", model)
                write_text(out / "next" / "cases" / name / "data.csv", text)
            advance(name)
    return [proposal.task.name for proposal in proposals]


def _describe_sealed_before(out: Path, run: dict[str, Any]) -> str | None:
    """The SHA-256 of the labels in ``out``, if they are those of this very run; None otherwise."""
    try:
        noted = json.loads((out / "sealed.json").read_text(encoding="utf-8"))
        sealed = digest((out / "labels.sealed.json").read_bytes())
    except (FileNotFoundError, ValueError):
        return None
    return sealed if noted == {**run, "sha256": sealed} else None


def read_sealed(labels: Path, answers: Path, sealed: str) -> list[Verdict]:
    """The verdicts, from labels that are still those whose SHA-256 was recorded before the diagnosis.

    InputError: labels that were changed since, or an answer of another form.
    """
    content = labels.read_bytes()
    if digest(content) != sealed:
        raise InputError("the labels are not those that were sealed", file=labels, expected=f"SHA-256 {sealed}")
    return read_verdicts(json.loads(content), answers)


def read_verdicts(labels: Mapping[str, Any], answers: Path) -> list[Verdict]:
    """The verdicts of all labelled cases, failed where there is no answer. InputError: an answer of another form."""
    rig = frozenset(labels.get("rig", ()))
    return [judge(name, label, read_answer(answers / f"{name}.json"), rig) for name, label in labels["cases"].items()]


def read_answer(path: Path) -> Mapping[str, Any]:
    """The answer in a file; an error if there is no file. InputError: an answer of another form."""
    if not path.exists():
        return {"error": "no answer"}
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"not JSON: {error}", file=path, expected="gap/1") from None
    if not isinstance(answer, dict) or ("error" not in answer and answer.get("format") != "gap/1"):
        raise InputError("not an answer", file=path, expected="gap/1")
    return answer


class _Task(NamedTuple):
    kind: str
    field: bool
    seed: tuple[int, int]
    name: str


class _Proposal(NamedTuple):
    task: _Task
    data: str
    rows: list[dict[str, Any]]
    asked: set[str]


def make_cases(
    folder: Path, labels: Path, n: int, seed: int, kinds: tuple[str, ...] | None = None, jobs: int | None = None
) -> str:
    """Write ``n`` cases as ``folder/NAME/model.toml`` and ``data.csv`` and their labels as ``labels``; its SHA-256.

    Names are random and carry no information. ``kinds`` chooses kinds of the generator (``phase-lag``,
    ``null:nothing``, ``pair:two-forces`` and so on); all, in the shares of a blind run, without it. Half are drawn
    clean, half in field conditions. The seed alone determines every case.
    """
    tasks = _list_tasks(n, seed, kinds)
    sealed: dict[str, Any] = {}
    with progress("cases drawn", n) as advance:
        for number, (task, case) in enumerate(zip(tasks, _each(_draw, tasks, jobs), strict=True), start=1):
            write_text(folder / task.name / "model.toml", case.model)
            write_text(folder / task.name / "data.csv", case.data)
            sealed[task.name] = case.label
            if number % _REPORTED == 0 or number == n:
                advance(task.name, (number - 1) % _REPORTED + 1)
    header = {"format": "labels/1", "seed": seed, "rig": sorted(generator.RIG_NAMES)}
    text = to_json({**header, "cases": dict(sorted(sealed.items()))})
    write_text(labels, text)
    return digest(text.encode())


def _list_tasks(n: int, seed: int, kinds: tuple[str, ...] | None = None) -> list[_Task]:
    drawn = zip(generator.strata(n, kinds), _list_names(n, seed), strict=True)
    return [_Task(stratum.kind, stratum.field, (seed, number), name) for number, (stratum, name) in enumerate(drawn)]


def _list_names(n: int, seed: int) -> list[str]:
    """Random names, all different, in no order."""
    rng = np.random.default_rng([seed, 0x6E616D65])
    return [f"{number:08x}" for number in rng.choice(1 << 32, size=n, replace=False).tolist()]


def _each(do: Callable[[Work], Done], work: list[Work], jobs: int | None) -> Iterator[Done]:
    """Results of ``do`` for each, in order; in this process if one is enough."""
    if min(count_jobs(jobs), len(work)) <= 1:
        yield from map(do, work)
        return
    with start_pool(jobs) as pool:
        yield from pool.map(do, work, chunksize=4)


def _draw(task: _Task) -> generator.BlindCase:
    return generator.draw_case(task.kind, task.field, task.seed, f"case {task.name}")


def _make_test(proposal: _Proposal) -> str | None:
    """The data of a case with the rows of the proposed test; None without a steady state."""
    (kind, field, seed, _), data, rows, asked = proposal
    try:
        return generator.draw_further_rows(kind, field, seed, data, rows, asked)
    except generator.NoSteadyStateError:
        return None
