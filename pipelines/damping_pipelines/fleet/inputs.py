"""What a fleet is made of: records found in a folder, tasks that carry all a result depends on, results."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from damping.errors import InputError, escape_control

#: Design forces where none are asked for, in multiples of the largest tested force of each record.
MULTIPLES = (1.5, 2.0)
#: Seconds that a record may take: many times what chains of the largest records in use took.
TIME_LIMIT = 3600.0


@dataclass(frozen=True)
class FleetSettings:
    """What a run is asked to do; every field but ``max_size`` and ``time_limit`` takes part in the key of a result.

    Attributes:
        seed: of the run. fast: few importance draws. level: content of the bands.
        forces: design forces; empty for ``MULTIPLES`` of each record's own. versions: of what computes.
        max_size: largest input file, bytes. despite: checks of the audit whose refusal is passed over.
        code: digest of versions and source (``provenance.digest_code``). time_limit: seconds that a record may take.
    """

    seed: int
    fast: bool
    level: float
    forces: tuple[float, ...]
    versions: dict[str, str]
    max_size: int
    despite: tuple[str, ...] = ()
    code: str = ""
    time_limit: float = TIME_LIMIT

    @property
    def digest(self) -> str:
        """SHA-256 of every field that a result depends on."""
        fields = {name: value for name, value in asdict(self).items() if name not in ("max_size", "time_limit")}
        return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()

    @property
    def method(self) -> str:
        """How posteriors are had, as stated in every row."""
        return "few importance draws" if self.fast else "importance draws"


@dataclass(frozen=True)
class FleetCase:
    """A record with its mode or model.

    Attributes:
        name: as shown. entry: as it stands in the folder. is_model: whether there is a ``model.toml``, to be diagnosed.
    """

    name: str
    entry: str
    record: Path
    model: Path
    is_model: bool


@dataclass(frozen=True)
class FleetTask:
    """A record to analyse. Files go with it, so that workers need no folder in common.

    Attributes:
        name: as shown. key: of content, name and settings. seed: of the record. record_text, model_text: the files;
            None where one cannot be read, and then ``problem`` says why. is_model: diagnose.
    """

    name: str
    key: str
    seed: int
    record_text: bytes | None
    model_text: bytes | None
    is_model: bool
    settings: FleetSettings
    problem: str = ""

    @property
    def digests(self) -> tuple[str, str]:
        """SHA-256 of record and model."""
        return hashlib.sha256(self.record_text or b"").hexdigest(), hashlib.sha256(self.model_text or b"").hexdigest()


@dataclass(frozen=True)
class FleetResult:
    """What comes of a task: a row, and pages (HTML) by their path under the output folder."""

    row: dict[str, Any]
    pages: dict[str, str]


def find_cases(folder: Path) -> list[FleetCase]:
    """Records ``NAME.csv`` with ``NAME.toml``, and ``NAME/data.csv`` with ``NAME/model.toml``, by name.

    A record without its TOML is listed too, and fails for that reason.

    Raises:
        InputError: no such folder, or nothing in it.
    """
    if not folder.is_dir():
        raise InputError("no such folder", file=folder, expected="a folder of records")
    cases = []
    for entry in os.scandir(folder):
        path = Path(entry.path)
        if entry.is_dir() and ((path / "data.csv").exists() or (path / "model.toml").exists()):
            cases.append(
                FleetCase(describe_shown(entry.name), entry.name, path / "data.csv", path / "model.toml", True)
            )
        elif entry.name.endswith(".csv") and entry.is_file():
            cases.append(FleetCase(describe_shown(entry.name[:-4]), entry.name, path, path.with_suffix(".toml"), False))
    if not cases:
        raise InputError(
            "holds no record", file=folder, expected="NAME.csv with NAME.toml, or NAME/data.csv with NAME/model.toml"
        )
    return sorted(cases, key=lambda case: (case.name, case.is_model))


def describe_shown(name: str) -> str:
    """A file name as text for any file and terminal: bytes that are no UTF-8 and control characters as escapes."""
    return escape_control(os.fsencode(name).decode("utf-8", "backslashreplace"))


def tasks_of(cases: list[FleetCase], settings: FleetSettings) -> Iterator[FleetTask]:
    """Tasks one by one: the files of a record are read when its turn comes."""
    for case in cases:
        record, first = _content(case.record, settings.max_size)
        model, second = _content(case.model, settings.max_size)
        parts = (settings.digest, os.fsencode(case.entry), case.is_model, record, model)
        digest = hashlib.sha256()
        for part in parts:
            one = part if isinstance(part, bytes) else repr(part).encode()
            digest.update(len(one).to_bytes(8, "big") + one)
        key = digest.hexdigest()
        yield FleetTask(
            case.name, key, seed_of(settings.seed, key), record, model, case.is_model, settings, first or second
        )


def seed_of(seed: int, key: str) -> int:
    """Seed of a record (31 bits) from that of the run and the key of its content: the same on any worker."""
    return int.from_bytes(hashlib.sha256(f"{seed} {key}".encode()).digest()[:4], "big") >> 1


def _content(path: Path, max_size: int) -> tuple[bytes | None, str]:
    """The bytes of a file, or None with the reason."""
    try:
        if path.exists() and not path.is_file():  # a pipe would be waited for
            return None, f"{describe_shown(path.name)}: is no regular file"
        with path.open("rb") as stream:
            content = stream.read(max_size + 1)
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
        return None, f"{describe_shown(path.name)}: {reason}"
    if len(content) > max_size:
        return None, f"{describe_shown(path.name)}: larger than {max_size} bytes"
    return content, ""
