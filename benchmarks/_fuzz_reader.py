"""One reader under atheris: ``python -m benchmarks._fuzz_reader NAME CORPUS -runs=N ...`` (options of libFuzzer).

Every input is a file. The reader may give a result or raise the two errors that people see; anything else, and a line
that is no line, ends the run with the input that did it. libFuzzer ends it for a hang and for memory.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["damping.records", "damping.errors", "tomllib", "scipy.io.matlab"]):
    from damping.formats import read_file, worker
    from damping.formats.series import Stated
    from damping.formats.steady import steady_record
    from damping.records.mode import describe_mode_to_toml, read_mode
    from damping.records.reading import read_record, read_table
    from damping.records.record import record_to_csv

with atheris.instrument_imports(
    include=[
        "damping_pipelines.study_files",
        "damping.signals.reading",
        "damping_pipelines.export",
        "damping_pipelines.manifest",
    ]
):
    from damping.signals.reading import read_description, read_raw
    from damping_pipelines.export import read_answer, tabulate_form
    from damping_pipelines.manifest import MANIFEST, open_folder
    from damping_pipelines.study_files import default_study, read_settings

from damping.errors import AnalysisError, InputError

_UNITS = {"response": "m/s^2/N", "force": "N"}
_DESCRIPTION = read_description(default_study().with_name("condition.toml"))
_MOST_BYTES = 1_000_000
_NAMES = ["frequency", "response", "f", "s.x"]


def _imported(kind: str) -> Callable[[Path], object]:
    stated = Stated(format=kind, response="accelerance", units=_UNITS, forces=(1.0,), scaling="rms")
    plain = Stated(format=kind)

    def read(path: Path) -> None:
        for one in (plain, stated):
            with suppress(InputError):
                series, summary = read_file(path, one)
                steady_record(series, one, path, summary)

    return read


def _mat(path: Path) -> None:
    """What the process that reads MAT files does; the library may fail in any way, but must end."""
    with suppress(Exception):  # as in the program, where it is a process of its own that fails
        list(worker._read_mat(str(path), _NAMES, worker.Contents(_MOST_BYTES)))


READERS: dict[str, Callable[[Path], object]] = {
    "record": lambda path: record_to_csv(read_record(path)),
    "table": read_table,
    "mode": lambda path: describe_mode_to_toml(read_mode(path)),
    "study": read_settings,
    "condition": read_description,
    "raw": lambda path: read_raw(path, _DESCRIPTION, _MOST_BYTES),
    "uff": _imported("uff"),
    "csv": _imported("csv"),
    "lock-in": _imported("lock-in"),
    "mat": _mat,
    "form": lambda path: tabulate_form(read_answer(path)),
    "manifest": lambda path: open_folder(path.rename(path.with_name(MANIFEST)).parent),
}


def main() -> None:
    """Fuzz the reader that is named first; never returns."""
    name = sys.argv.pop(1)
    read = READERS[name]
    folder = tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None)
    path = Path(folder.name) / "input"

    def one(data: bytes) -> None:
        path.write_bytes(data)
        try:
            read(path)
        except (InputError, AnalysisError) as error:
            if not str(error).isprintable():
                raise AssertionError("an error of more than one line") from error

    atheris.Setup(sys.argv, one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
