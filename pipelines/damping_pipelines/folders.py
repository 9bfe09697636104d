"""Answers in the folders of finished runs: the form of a study, and the damping of one of its records for a deck."""

from pathlib import Path

from damping.errors import AnalysisError, InputError, list_nearest
from damping.records.text import read_bytes
from damping_pipelines.forms import DAMPED, MAX_FORM_SIZE, CurveForm, Damped, StudyForm, StudyRecordForm, read_form
from damping_pipelines.manifest import Folder, open_folder

STUDY = "summary.json"  #: the output that tells a study
CAMPAIGN = "campaign.json"  #: and a campaign
_DAMPING = "a form curve/1, loads/1 or campaign/1 (JSON), as damping curve --json writes it, or the folder of a study"


def read_study(folder: Folder) -> tuple[StudyForm, bytes]:
    """The form of a study and its text. InputError: the folder holds none."""
    if STUDY not in folder.manifest.outputs:
        raise InputError("holds no study", file=folder.path, expected="a folder that damping study wrote")
    content = folder.read(STUDY)
    return read_form(StudyForm, content, folder.path / STUDY, "a file that a study wrote"), content


def list_files(source: Path) -> list[Path]:
    """The file, or the outputs of the run in the folder, which an output must not replace."""
    if not source.is_dir():
        return [source]
    return [source / name for name in open_folder(source).manifest.outputs]


def read_damping(source: Path, record: str | None) -> tuple[Damped, bytes]:
    """The form that holds damping ratios, and the text it is from: a file, or the folder of a campaign or a study.

    ``record`` names one of a study, and is needed where it has several. InputError: no such file, folder or record, or
    no such name. AnalysisError: the laws of that record could not be weighed.
    """
    folder = open_folder(source) if source.is_dir() else None
    if folder is not None and CAMPAIGN not in folder.manifest.outputs:
        form, content = read_study(folder)
        return _take_record(_find_record(form, record, source), source), content
    if record is not None:
        beside = "campaign" if folder else "file"
        raise InputError(f"--record {record!r} beside a {beside}", expected="--record of a study")
    content = folder.read(CAMPAIGN) if folder else read_bytes(source, MAX_FORM_SIZE)
    return read_form(DAMPED, content, source / CAMPAIGN if folder else source, _DAMPING), content


def _find_record(form: StudyForm, name: str | None, source: Path) -> StudyRecordForm:
    names = [record.name for record in form.records]
    if name is None and len(names) > 1:
        message = f"the study has {len(names)} records, and a deck holds the damping of one"
        raise InputError(message, file=source, expected=f"--record {' or '.join(names)}")
    if name is not None and name not in names:
        raise InputError(f"no record {name!r}", file=source, expected=f"--record {list_nearest(name, names)}")
    return form.records[0 if name is None else names.index(name)]


def _take_record(record: StudyRecordForm, source: Path) -> CurveForm:
    """The tested part of the curve with the loads at the design forces, or without such the whole curve."""
    if record.curve is None:
        raise AnalysisError(f"{source}: {record.name} has no curve of damping: its laws could not be weighed")
    loads = [] if record.loads is None else record.loads.predictions
    return record.curve.model_copy(
        update={
            "format": "study/1",
            "name": record.name,
            "rows": [*(row for row in record.curve.rows if row.tested or not loads), *loads],
            "units": record.units,
            "drive": record.units.drive,
            "audit": record.audit,
            "cautions": record.cautions,
        }
    )
