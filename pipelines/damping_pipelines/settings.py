"""Settings of a study (``STUDY.toml``), checked before anything runs.

title = "Bolted joint, spring campaign"
seed = 1970                        # of everything sampled
level = 0.9                        # content of every band

[[records]]
name = "panel-mode-1"              # of its files: letters, digits, - and _
title = "Panel, first mode"        # for people
record = "panel.csv"               # relative to this file
mode = "panel.toml"
design_forces = [30.0, 60.0, 90.0] # where amplitudes are predicted; none by default
laws = [["viscous"], ["viscous", "coulomb"]]  # always sampled, whatever their weight
note = "The force was held by hand."    # what to know of the record, said with the answer
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from damping.errors import InputError
from damping.forces import force_class
from damping.records.keys import describe_nearest, line_of, read_toml
from damping.records.text import describe_shortened
from damping_pipelines.exhibits import source_report

#: Seed of the default study: the year of the report.
DEFAULT_SEED = 1970
#: What belongs where pydantic found another thing, by its name for the mistake.
_EXPECTED = {
    "string_type": "text",
    "string_pattern_mismatch": "letters, digits, - and _, the first a letter or digit",
    "string_too_long": "at most 80 characters",
    "tuple_type": "a list",
    "model_type": "a table",
    "int_type": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "too_short": "at least one",
}


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RecordSettings(_Table):
    """One record of a study."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=80)]
    title: str = ""
    record: str
    mode: str
    design_forces: tuple[Annotated[float, Field(gt=0.0, strict=True)], ...] = ()
    laws: tuple[tuple[str, ...], ...] = ()
    note: Annotated[str, Field(max_length=400)] = ""

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


class StudySettings(_Table):
    """A study: its records in order."""

    title: str
    seed: Annotated[int, Field(ge=0, strict=True)] = DEFAULT_SEED
    level: Annotated[float, Field(gt=0.0, lt=1.0, strict=True)] = 0.9
    source_report: bool = False
    records: Annotated[tuple[RecordSettings, ...], Field(min_length=1)]

    @field_validator("records")
    @classmethod
    def _different_names(cls, records: tuple[RecordSettings, ...]) -> tuple[RecordSettings, ...]:
        names = [record.name for record in records]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two records are called {name!r}")
        return records


def default_study() -> Path:
    """The settings of the Saturn V study."""
    return source_report().settings_file()


def read_settings(path: Path) -> StudySettings:
    """Read and check a study's settings.

    Raises:
        InputError: with file, line and key of the first thing that is wrong, and what was expected.
    """
    table = read_toml(path)
    try:
        return StudySettings.model_validate(table.values)
    except ValidationError as error:
        # a misspelt key explains a missing one, so it comes first
        problems = sorted(error.errors(), key=lambda problem: problem["type"] != "extra_forbidden")
        raise _input_error(problems[0], path, table.content) from None


def _input_error(problem: Any, path: Path, content: str) -> InputError:
    """Pydantic's first problem as one line for people."""
    keys = tuple(str(key) for key in problem["loc"] if isinstance(key, str))
    key = ".".join(str(part) for part in problem["loc"])
    line = _line(content, tuple(problem["loc"]))
    if problem["type"] == "extra_forbidden":
        known = RecordSettings.model_fields if len(keys) > 1 else StudySettings.model_fields
        message, expected = "unknown key", f"{describe_nearest(keys[-1], known)} (nearest of {', '.join(known)})"
        return InputError(message, file=path, line=line, column=key, expected=expected)
    if problem["type"] == "missing":
        return InputError("missing key", file=path, line=line, column=key, expected=f"{keys[-1]} = ...")
    if problem["type"] in _EXPECTED:
        given = describe_shortened(repr(problem["input"]))
        return InputError(given, file=path, line=line, column=key, expected=_EXPECTED[problem["type"]])
    return InputError(problem["msg"].removeprefix("Value error, "), file=path, line=line, column=key)


def _line(content: str, loc: tuple[str | int, ...]) -> int | None:
    """Line of what a problem is with, or of the least that holds it."""
    lines = (line_of(content, loc[:length]) for length in range(len(loc), 0, -1))
    return next((line for line in lines if line is not None), None)
