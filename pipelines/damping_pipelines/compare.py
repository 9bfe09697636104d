"""``damping compare``: studies side by side on one page. Each is read by its manifest, so that none is of two runs."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import ValidationError

from damping.errors import InputError
from damping.infer.observations import MOST_ROWS, Observations
from damping.ranking.sharing import read_rows
from damping.records.text import describe_shortened
from damping_pipelines.comparison import RecordSummary, StudySummary, TopOfTest, describe_comparison_page
from damping_pipelines.forms import DampedRow, PosteriorRow, StudyForm, StudyRecordForm, describe_invalid, read_form
from damping_pipelines.manifest import MANIFEST, Folder, digest, open_folder, verify, versions
from damping_pipelines.store import refuse_inputs, write_text

#: Studies on a page: more columns of weights are not read.
MOST_STUDIES = 8
_EXPECTED = "a file that a study wrote"
_RANKING = ["law", "rank", "weight", "held_out_error", "average_absolute_percent"]
_LOADS = ["force", "median", "low", "high", "linear", "linear_overprediction_percent"]
_POSTERIORS = ["law", "parameter", "unit", "low", "median", "high"]


def compare(folders: Sequence[Path], out: Path) -> None:
    """Write the page that sets the studies in ``folders``, or the records of one, side by side.

    InputError: fewer than two records, a folder that is no finished study, or whose files are of two runs; an ``out``
    that is a file of one of the studies.
    """
    if len(folders) > MOST_STUDIES:
        raise InputError(f"{len(folders)} folders", expected=f"up to {MOST_STUDIES} folders of studies")
    names = _list_names(folders)
    opened = [open_folder(folder) for folder in folders]
    for study in opened:
        refuse_inputs("--out", out, study.path / MANIFEST, *(study.path / name for name in study.manifest.outputs))
    studies = [_study(folder, name) for folder, name in zip(opened, names, strict=True)]
    if sum(len(study.records) for study in studies) < 2:
        raise InputError("one record", expected=f"two records or more, of one to {MOST_STUDIES} folders of studies")
    write_text(out, describe_comparison_page(studies, versions()))
    print(f"{out} written")


def check(folders: Sequence[Path]) -> None:
    """Print that each folder is of one finished run, file by file. InputError for the first that is not."""
    for folder in folders:
        manifest = verify(folder).manifest
        print(f"{folder}: {len(manifest.outputs)} files of one run, seed {manifest.seed}")


def _list_names(folders: Sequence[Path]) -> list[str]:
    """What each folder is called on the page: its own name, after those above it where two have one name."""
    resolved = [Path(os.path.realpath(folder)) for folder in folders]  # Path.resolve fails on a link to itself
    if len(set(resolved)) < len(resolved):
        raise InputError("a folder is given twice", expected="different folders")
    return [_describe_shortest(path, resolved) for path in resolved]


def _describe_shortest(path: Path, among: Sequence[Path]) -> str:
    """The least end of a path that no other one has."""
    ends = [path.parts[-n:] for n in range(1, len(path.parts) + 1)]
    alone = next((end for end in ends if sum(other.parts[-len(end) :] == end for other in among) == 1), path.parts)
    return describe_shortened("/".join(alone), 60)


def _study(folder: Folder, name: str) -> StudySummary:
    content = folder.read("summary.json")
    summary = read_form(StudyForm, content, folder.path / "summary.json", _EXPECTED)
    return StudySummary(
        name=name,
        title=summary.title,
        seed=summary.seed,
        level=summary.level,
        inputs=folder.manifest.inputs,
        versions=folder.manifest.versions,
        records={record.name: _record(record, folder) for record in summary.records},
        digest=digest(content),
    )


def _record(record: StudyRecordForm, folder: Folder) -> RecordSummary:
    ranking = [vars(model) | {"law": model.name} for model in record.rank.models]
    loads = [vars(prediction) for prediction in record.loads.predictions] if record.loads else []
    return RecordSummary(
        title=record.title,
        units=(record.units.force, record.units.length),
        ranking=_tabulate_frame(ranking, _RANKING),
        loads=_tabulate_frame(loads, _LOADS),
        posteriors=_tabulate_frame(_list_posteriors(folder, f"{record.name}-posteriors.csv"), _POSTERIORS),
        top=_find_top(record.curve.rows if record.curve else []),
        exponent=next(((law.p, law.std_error) for law in record.power_laws), None),
        observations=_read_observations(folder, f"{record.name}-observations.csv"),
        groups=tuple(
            ((model.name, *model.equivalents), model.weight) for model in record.rank.models if model.weight is not None
        ),
    )


def _find_top(rows: Sequence[DampedRow]) -> TopOfTest | None:
    """Amplitude, frequency and damping ratio of the largest tested amplitude that has them."""
    tested = [(row, row.damping_ratio) for row in rows if row.tested and row.damping_ratio]
    known = (
        TopOfTest(row.amplitude, row.frequency, ratio.median, ratio.low, ratio.high)
        for row, ratio in tested
        if row.amplitude is not None and row.frequency is not None
        if ratio.median is not None and ratio.low is not None and ratio.high is not None
    )
    return max(known, key=lambda top: top.amplitude, default=None)


def _list_posteriors(folder: Folder, name: str) -> list[dict[str, Any]]:
    """Rows of a table of posteriors; none where the study has no such file."""
    if name not in folder.manifest.outputs:
        return []
    path = folder.path / name
    try:
        rows = list(csv.DictReader(io.StringIO(folder.read(name).decode()), strict=True))
        return [PosteriorRow.model_validate(row).model_dump() for row in rows]
    except ValidationError as error:
        raise describe_invalid(error, path, _EXPECTED) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"not CSV: {error}", file=path) from None


def _read_observations(folder: Folder, name: str) -> Observations | None:
    """The rows that laws were weighed on; None where the study has no such file or one without them."""
    if name not in folder.manifest.outputs:
        return None
    path = folder.path / name
    try:
        table = pd.read_csv(io.BytesIO(folder.read(name)), dtype={"sweep": str, "point": str}, keep_default_na=False)
        if "force_in_phase" not in table or not 0 < len(table) <= MOST_ROWS:
            return None
        numbers = table.drop(columns=["sweep", "point"], errors="ignore").to_numpy(dtype=float)
        data = read_rows(table)
    except (ValueError, KeyError) as error:
        raise InputError(f"not what a study wrote: {error}", file=path) from None
    sizes = (data.A, data.omega, data.tested_amplitude, data.tested_force, data.tested_omega)
    if not (np.isfinite(numbers).all() and all((values > 0.0).all() for values in sizes)):
        raise InputError("not what a study wrote: numbers that are none", file=path)
    return data


def _tabulate_frame(rows: list[dict[str, Any]], columns: list[str]) -> pd.DataFrame:
    """Columns of text and of numbers, missing ones NaN."""
    table = pd.DataFrame(rows, columns=columns)
    text = {"law", "parameter", "unit"}
    return table.astype({name: "str" if name in text else "float64" for name in columns})
