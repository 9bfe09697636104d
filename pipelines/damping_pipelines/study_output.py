"""What a study leaves behind: report, summary, tables, figures, posteriors. Rendered first, then written whole.

The figures of a study as PNG images, by the names of their SVG files.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path, PurePosixPath
from typing import Any

import pandas as pd

from damping.errors import InputError
from damping.infer.checks import inference_data
from damping.records.record import record_to_csv
from damping.report.figures import record_figures
from damping.report.forms import loads_form, rank_form
from damping.report.results import ChapterResults, LawPosterior, RecordResult, StudyResult, file_stem
from damping.report.study import render, study_figures
from damping_pipelines.export import to_png
from damping_pipelines.manifest import publish
from damping_pipelines.store import plain, to_json
from damping_reed1970.chapter_3.words import chapter_3_figures
from damping_reed1970.figures import ChapterFigure, chapter_figures
from damping_reed1970.study import chapters_summary, planar_data, rows


def write_study(study: StudyResult, out: Path, *, png: bool = False) -> None:
    """Write ``report.html``, ``summary.json``, ``*.csv``, ``figures/*.svg``, ``posterior/*.nc`` and the manifest.

    Everything is rendered before the first file is written; ``png``: figures as PNG too.

    Raises:
        InputError: a file cannot be written.
    """
    files = study_files(study)
    if png:
        files |= pictures(study, [name for name in files if name.endswith(".svg")])
    publish(out, files, seed=study.seed, versions=study.versions, inputs=study.inputs)


def study_files(study: StudyResult) -> dict[str, bytes]:
    """Every file of a study by its path under the output folder; the report comes last."""
    rendered = render(study)
    files: dict[str, bytes] = {}
    for record in study.records:
        for law in record.posteriors:
            data = inference_data(law.posterior, record.data)
            files[f"posterior/{record.name}--{slug(law.law.name)}.nc"] = to_netcdf(data)
    if study.chapters:
        for known in study.chapters.chapter_3.posteriors.values():
            if known.posterior:
                files[f"posterior/chapter-3--{slug(f'{known.data} {known.variant}')}.nc"] = to_netcdf(
                    planar_data(known)
                )
    files |= {f"{name}.csv": record_to_csv(table).encode() for name, table in rendered.tables.items()}
    files |= {f"figures/{name}.svg": svg.encode() for name, svg in rendered.figures.items()}
    files["summary.json"] = to_json(summary(study)).encode()
    files["report.html"] = rendered.html.encode()
    return files


def slug(name: str) -> str:
    """A law's name as part of a file name."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")


def to_netcdf(data: Any) -> bytes:
    """ArviZ groups of a posterior as netCDF: equal draws give equal bytes."""
    for group in data.groups():
        data[group].attrs.pop("created_at", None)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "posterior.nc"
        try:
            data.to_netcdf(str(path))
        except (OSError, RuntimeError) as error:  # RuntimeError: what the netCDF library makes of a full disk
            raise InputError(
                f"cannot be written ({error})", file=path, expected="free space for temporary files"
            ) from None
        return path.read_bytes()


def summary(study: StudyResult) -> dict[str, Any]:
    """The study as plain data."""
    return {
        "format": "study/1",
        "title": study.title,
        "seed": study.seed,
        "level": study.level,
        "inputs": dict(study.inputs),
        "versions": dict(study.versions),
        "records": [_record(record) for record in study.records],
        "reproduction": _rows(study.tables, "reproduction", _REPRODUCTION),
        "section_6_1": _rows(study.tables, "section_6_1"),
        "errata": _rows(study.tables, "errata"),
        "chapters": chapters_summary(study.chapters) if study.chapters else None,
    }


_REPRODUCTION = ("id", "printed", "computed", "computed_after_correction", "erratum")


def _rows(tables: Mapping[str, pd.DataFrame], name: str, columns: tuple[str, ...] | None = None) -> list[Any]:
    """A table as a list of rows, empty where there is none."""
    if name not in tables:
        return []
    return rows(tables[name] if columns is None else tables[name][list(columns)])


def _record(record: RecordResult) -> dict[str, Any]:
    return {
        "name": record.name,
        "title": record.title,
        "mode": record.mode.name,
        "units": asdict(record.mode.units),
        "rank": rank_form(record.ranking),
        "loads": loads_form(record.design) if record.design else None,
        "power_laws": [
            {"form": law.form, "p": law.p, "std_error": law.std_error, "p_low": law.p_low, "p_high": law.p_high}
            | {"level": law.level, "degrees_of_freedom": law.degrees_of_freedom, "alpha": law.alpha}
            for law in record.power_laws
        ],
        "posteriors": [_posterior(law) for law in record.posteriors],
    }


def _posterior(law: LawPosterior) -> dict[str, Any]:
    return {
        "law": law.law.name,
        "weight": law.weight,
        "of_source": law.of_source,
        "converged": law.posterior.converged,
        "failure": law.posterior.failure,
        "steps": law.posterior.steps,
        "acceptance": law.posterior.acceptance,
        "log_marginal_likelihood": law.posterior.log_z,
        "quantities": [asdict(diagnosis) for diagnosis in law.posterior.diagnoses],
        "loo": plain(asdict(law.leave_one_out)),
        "predictive_p_value": law.check.p_value,
    }


def pictures(study: StudyResult, svgs: Iterable[str]) -> dict[str, bytes]:
    """``NAME.png`` of every figure drawn as ``NAME.svg``, a path in the folder of the study."""
    figures = {name.replace("_", "-"): one.figure for name, one in study_figures(study).items()}
    for result in study.records:
        figures |= {file_stem(result, name): one.figure for name, one in record_figures(result, study.level).items()}
    of_chapters = _of_chapters(study.chapters) if study.chapters else {}
    drawn: dict[str, bytes] = {}
    for svg in svgs:
        path = PurePosixPath(svg)
        figure = figures.get(path.stem) or of_chapters[_CHAPTER.sub("", path.stem)].draw()
        drawn[str(path.with_suffix(".png"))] = to_png(figure)
    return drawn


_CHAPTER = re.compile(r"^chapter-\d-")


def _of_chapters(results: ChapterResults) -> dict[str, ChapterFigure]:
    """Figures of the chapters of the source report by name."""
    of_studies = chapter_figures(results.studies, results.tables["section_6_1_errors"])
    chapter_3 = [ChapterFigure(*row) for row in chapter_3_figures(results.chapter_3)]
    return {one.name: one for one in [*of_studies, *chapter_3]}
