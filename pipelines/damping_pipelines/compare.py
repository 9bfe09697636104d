"""``damping compare``: studies side by side on one page, read by their manifests so that no study mixes two runs."""

import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from damping.errors import InputError
from damping.infer.observations import MOST_ROWS, Observations
from damping.ranking.sharing import read_rows
from damping.records.text import describe_shortened, unguarded
from damping_pipelines.compare_page import RecordSummary, StudySummary, describe_comparison_page
from damping_pipelines.folders import CAMPAIGN, read_study
from damping_pipelines.manifest import MANIFEST, Folder, digest, open_folder, verify, versions
from damping_pipelines.store import refuse_inputs, refuse_unwritable, write_text

#: Studies on a page: more columns of weights are not read.
MOST_STUDIES = 8
_EXPECTED = "a file that a study wrote"
#: Columns of ``NAME-posteriors.csv`` that are compared, texts and numbers.
_TEXTS = ("law", "parameter", "unit")
_NUMBERS = ("low", "median", "high")


def compare(folders: Sequence[Path], out: Path) -> None:
    """Write the page that sets the studies in ``folders``, or the records of one, side by side.

    InputError: fewer than two records, a folder that is no finished study or mixes files of two runs, or an ``out``
    that is a file of one of the studies.
    """
    if len(folders) > MOST_STUDIES:
        raise InputError(f"{len(folders)} folders", expected=f"up to {MOST_STUDIES} folders of studies")
    names = _list_names(folders)
    opened = [open_folder(folder) for folder in folders]
    for study in opened:
        refuse_inputs("--out", out, study.path / MANIFEST, *(study.path / name for name in study.manifest.outputs))
    refuse_unwritable(out)
    studies = [_open_study(folder, name) for folder, name in zip(opened, names, strict=True)]
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
    """The name of each folder on the page: its own, preceded by its parents if two have the same name."""
    resolved = [Path(os.path.realpath(folder)) for folder in folders]  # Path.resolve fails on a link to itself
    if len(set(resolved)) < len(resolved):
        raise InputError("a folder is given twice", expected="different folders")
    names = []
    for path in resolved:
        ends = [path.parts[-n:] for n in range(1, len(path.parts) + 1)]
        alone = (end for end in ends if sum(other.parts[-len(end) :] == end for other in resolved) == 1)
        names.append(describe_shortened("/".join(next(alone, path.parts)), 60))
    return names


def _open_study(folder: Folder, name: str) -> StudySummary:
    if CAMPAIGN in folder.manifest.outputs:
        expected = f"the folder that damping study {folder.path / 'study.toml'} writes"
        raise InputError("results of a campaign, not of a study", file=folder.path, expected=expected)
    form, content = read_study(folder)
    records = {
        record.name: RecordSummary(
            record,
            _tabulate_posteriors(folder, f"{record.name}-posteriors.csv"),
            _read_observations(folder, f"{record.name}-observations.csv"),
        )
        for record in form.records
    }
    return StudySummary(name, form, folder.manifest, records, digest(content))


def _tabulate_posteriors(folder: Folder, name: str) -> pd.DataFrame:
    """A table of posteriors; empty where the study has no such file."""
    types = dict.fromkeys(_TEXTS, "str") | dict.fromkeys(_NUMBERS, "float64")
    if name not in folder.manifest.outputs:
        return pd.DataFrame(columns=list(types)).astype(types)
    content = io.BytesIO(folder.read(name))
    try:
        table = pd.read_csv(content, dtype=types, na_values=dict.fromkeys(_NUMBERS, ""), keep_default_na=False)
        return table.assign(**{text: table[text].map(unguarded) for text in _TEXTS})[list(types)]
    except (ValueError, KeyError) as error:
        raise InputError(f"not written by a study: {error}", file=folder.path / name, expected=_EXPECTED) from None


def _read_observations(folder: Folder, name: str) -> Observations | None:
    """The rows on which laws were weighed; None if the study has no such file, or one without rows."""
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
        raise InputError(f"not written by a study: {error}", file=path, expected=_EXPECTED) from None
    sizes = (data.A, data.omega, data.tested_amplitude, data.tested_force, data.tested_omega)
    if not (np.isfinite(numbers).all() and all((values > 0.0).all() for values in sizes)):
        raise InputError("not written by a study: not numbers", file=path, expected=_EXPECTED)
    return data
