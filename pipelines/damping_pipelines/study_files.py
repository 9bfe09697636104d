"""Input and output files of a study: settings, checked before anything runs; report, summary, tables, figures."""

import tempfile
from collections.abc import Iterable
from dataclasses import asdict
from importlib import import_module
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Self

import numpy as np
from matplotlib.figure import Figure
from pydantic import BaseModel, Field, field_validator, model_validator

from damping.arrays import plain
from damping.errors import InputError
from damping.extrapolation.backbone import Backbone
from damping.forces import damping_ratio, force_class
from damping.infer.chains import Posterior
from damping.infer.observations import Observations
from damping.plots import identifier, to_png
from damping.records.keys import read_schema, read_toml
from damping.records.record import record_to_csv
from damping.report.figures import record_figures
from damping.report.forms import curve_form, loads_form, rank_form
from damping.report.results import LawPosterior, RecordResult, StudyResult
from damping.report.study import render
from damping_pipelines.manifest import publish
from damping_pipelines.options import DEFAULT_SEED
from damping_pipelines.store import PNG_DPI, print_answer, refuse_inputs, to_json

PAGES = ("report.html", "summary.json")  #: outputs of every study


class RecordSettings(BaseModel, extra="forbid", frozen=True):
    """One record of a study."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=80)]  #: of its files
    title: str = ""  #: for people
    record: str  #: relative to the settings
    mode: str  #: likewise
    design_forces: tuple[
        Annotated[float, Field(gt=0.0, strict=True, allow_inf_nan=False)], ...
    ] = ()  #: where amplitudes are predicted
    design_levels: tuple[str, ...] = ()  #: what each design force stands for, in words such as "0.8 g"
    laws: tuple[Annotated[tuple[str, ...], Field(min_length=1)], ...] = ()  #: always sampled, whatever their weight
    note: Annotated[str, Field(max_length=400)] = ""  #: what to know of the record, said with the answer

    @model_validator(mode="after")
    def _level_a_force(self) -> Self:
        if self.design_levels and len(self.design_levels) != len(self.design_forces):
            raise ValueError(f"{len(self.design_levels)} design_levels of {len(self.design_forces)} design_forces")
        return self

    @field_validator("laws")
    @classmethod
    def _known(cls, laws: tuple[tuple[str, ...], ...]) -> tuple[tuple[str, ...], ...]:
        for law in laws:
            for name in law:
                try:
                    force_class(name)
                except InputError as error:
                    raise ValueError(str(error)) from None
        return laws


class StudySettings(BaseModel, extra="forbid", frozen=True):
    """A study: its records in order; ``docs/reference/files.md`` shows every key."""

    title: str
    seed: Annotated[int, Field(ge=0, strict=True)] = DEFAULT_SEED  #: of everything sampled
    level: Annotated[float, Field(gt=0.0, lt=1.0, strict=True)] = 0.9  #: content of every band
    source_report: Annotated[bool, Field(strict=True)] = False  #: whether the reproduction of the report of 1970 joins
    records: Annotated[tuple[RecordSettings, ...], Field(min_length=1)]

    @field_validator("records")
    @classmethod
    def _different_names(cls, records: tuple[RecordSettings, ...]) -> tuple[RecordSettings, ...]:
        known = dict[str, str]()
        for name in (record.name for record in records):
            if other := known.get(name.lower()):
                differs = "" if other == name else f" and {name!r}, and some file systems ignore case"
                raise ValueError(f"two records are called {other!r}{differs}")
            known[name.lower()] = name
        return records


def source_report() -> Any:
    """The module of the exhibit that ``source_report = true`` asks for, the report of 1970 recomputed."""
    return import_module("damping_reed1970.exhibit")


def default_study() -> Path:
    """The settings of the Saturn V study."""
    return Path(source_report().settings_file())


def read_settings(path: Path) -> StudySettings:
    """Read and check a study's settings.

    InputError: with file, line and key of the first fault, and the expected value.
    """
    return read_schema(read_toml(path), StudySettings, {"records": "[[records]], one for each record"})


def write_study(study: StudyResult, out: Path, read: Iterable[Path], *, png: bool, pdf: bool) -> None:
    """Write ``report.html``, exhibits' pages, ``summary.json``, ``*.csv``, figures, ``posterior/*.nc``, the manifest.

    Everything is rendered before the first file is written; ``read``: inputs, never overwritten; ``png``: figures as
    PNG too. ``pdf``: the answer as ``report.pdf``. InputError: a file cannot be written, or is one of the inputs or a
    user's own.
    """
    files = render_files(study)
    if png:
        files |= pictures(study, [name for name in files if name.endswith(".svg")])
    if pdf:
        files["report.pdf"] = print_answer(files["report.html"].decode())
    for name in files:
        refuse_inputs("--out", out / name, *read)
    publish(out, files, seed=study.seed, versions=study.versions, inputs=study.inputs)


def render_files(study: StudyResult) -> dict[str, bytes]:
    """Every file of a study by its path under the output folder; the report comes last."""
    rendered = render(study)
    files: dict[str, bytes] = {}
    for record in study.records:
        files |= {f"posterior/{record.name}--{identifier(law.law.name)}.nc": law.file for law in record.posteriors}
    for exhibit in study.exhibits:
        files |= {f"posterior/{name}.nc": content for name, content in exhibit.posteriors.items()}
    files |= {f"{name}.csv": record_to_csv(table).encode() for name, table in rendered.tables.items()}
    files |= {f"figures/{name}.svg": svg.encode() for name, svg in rendered.figures.items()}
    files |= {f"{name}.html": page.encode() for name, page in rendered.pages.items()}
    files["summary.json"] = to_json(summarise(study)).encode()
    files["report.html"] = rendered.html.encode()
    return files


def add_damping_ratio(data: Any, posterior: Posterior, tested: Observations, backbone: Backbone) -> Any:
    """The posterior with ``damping_ratio`` (chain, draw, sweep): zeta = C/(2 M omega^2 A) at each tested resonance.

    Attributes of the variable state its unit, the law, and where it holds.
    """
    A, omega = tested.tested_amplitude, tested.tested_omega
    law, draws = posterior.coordinates.law, posterior.draws
    ratio = damping_ratio(posterior.coordinates.force(draws).quadrature(A, omega), A, backbone.stiffness_at(A))
    shape = (*posterior.x.shape[:2], len(A))
    about = {"units": "1", "of": "critical damping", "law": law.name, "amplitude": A, "frequency_rad_s": omega}
    values = np.broadcast_to(ratio, (len(draws), len(A))).astype(np.float32).reshape(shape)
    data.posterior["damping_ratio"] = (("chain", "draw", "sweep"), values, about)
    return data


def to_netcdf(data: Any) -> bytes:
    """ArviZ groups of a posterior as netCDF: equal draws give equal bytes."""
    for group in data.groups():
        data[group].attrs.pop("created_at", None)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "posterior.nc"
        try:
            data.to_netcdf(str(path), engine="netcdf4")  # six times faster than h5netcdf
        except (OSError, RuntimeError) as error:  # RuntimeError: what the netCDF library makes of a full disk
            expected = "free space for temporary files"
            raise InputError(f"cannot be written ({error})", file=path, expected=expected) from None
        return path.read_bytes()


def summarise(study: StudyResult) -> dict[str, Any]:
    """The study as plain data; the parts of a source report are empty without one."""
    form = {
        "format": "study/1",
        "title": study.title,
        "seed": study.seed,
        "level": study.level,
        "inputs": dict(study.inputs),
        "versions": dict(study.versions),
        "records": [_summarise_record(record) for record in study.records],
        "reproduction": [],
        "section_6_1": [],
        "errata": [],
        "chapters": None,
    }
    for exhibit in study.exhibits:
        form |= exhibit.summary
    return form


#: Of a power law what the summary says.
_POWER_LAW = ("form", "p", "std_error", "p_low", "p_high", "level", "degrees_of_freedom", "alpha")


def _summarise_record(record: RecordResult) -> dict[str, Any]:
    return {
        "name": record.name,
        "title": record.title,
        "mode": record.mode.name,
        "units": asdict(record.mode.units),
        "audit": [finding.to_json() for finding in record.findings],
        "cautions": [*record.against, *filter(None, [record.ranking.fit.sentence]), *record.remarks],
        "rank": rank_form(record.ranking),
        "loads": loads_form(record.design, curve=record.design_curve) if record.design else None,
        "curve": curve_form(record.curve) if record.curve else None,
        "power_laws": [{name: getattr(law, name) for name in _POWER_LAW} for law in record.power_laws],
        "posteriors": [_summarise_posterior(law) for law in record.posteriors],
    }


def _summarise_posterior(law: LawPosterior) -> dict[str, Any]:
    return {
        "law": law.law.name,
        "weight": law.weight,
        "of_source": law.of_source,
        **{name: getattr(law.posterior, name) for name in ("converged", "failure", "steps", "acceptance")},
        "log_marginal_likelihood": law.posterior.log_z,
        "quantities": [asdict(diagnosis) for diagnosis in law.posterior.diagnoses],
        "loo": plain(asdict(law.leave_one_out)),
        "predictive_p_value": law.check.p_value,
    }


def pictures(study: StudyResult, svgs: Iterable[str]) -> dict[str, bytes]:
    """``NAME.png`` of every figure drawn as ``NAME.svg``, a path in the folder of the study."""
    figures: dict[str, Figure] = {}
    for result in study.records:
        drawn = record_figures(result, study.level)
        figures |= {result.stem(name): figure.figure for name, figure in drawn.items()}
    for exhibit in study.exhibits:
        figures |= {name: draw() for name, draw in exhibit.drawings.items()}
    return {str(path.with_suffix(".png")): to_png(figures[path.stem], PNG_DPI) for path in map(PurePosixPath, svgs)}
