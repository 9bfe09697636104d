"""Folders of results of one run: staged, moved into place, and sealed by a manifest of hashes written last.

Each file is moved atomically. Between the first move and the last the manifest in the folder, if any, no longer
matches, so a reader that checks it never mixes files of two runs: it names the file of the other run.
"""

import hashlib
import importlib.metadata
import os
import platform
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from damping import __version__
from damping.errors import InputError
from damping.records.text import name_apart, read_bytes
from damping_pipelines.forms import read_form
from damping_pipelines.store import make_folder, to_json, write_bytes

MANIFEST = "manifest.json"  #: name of the manifest in its folder
#: The command whose results a manifest names, by an output that every run of it has; the first that is there
#: (bands come last: a calibration has a README.md too).
COMMANDS = {
    "campaign.json": "campaign",
    "summary.json": "study",
    "fleet.html": "fleet",
    "confusion.csv": "blind",
    "coverage.csv": "calibrate",
    "README.md": "bands",
}
_STAGED = ".staged"
_MAX_SIZE = 10_000_000
_MOST_FILE = 1_000_000_000

Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class Manifest(BaseModel, extra="ignore", frozen=True):
    """``inputs`` and ``outputs``: SHA-256 by name; outputs relative to the folder, inputs to the settings."""

    format: Literal["manifest/1"] = "manifest/1"
    seed: int
    versions: dict[str, str]
    inputs: dict[str, Digest]
    outputs: dict[str, Digest]


@dataclass(frozen=True)
class Folder:
    """A folder whose manifest was read; ``read`` returns contents that match the manifest."""

    path: Path
    manifest: Manifest

    def read(self, name: str) -> bytes:
        """Contents of an output. InputError if it is missing or of another run."""
        if name not in self.manifest.outputs:
            raise InputError(f"no {name} in the manifest", file=self.path / MANIFEST, expected="a folder of this kind")
        path = self.path / name
        if path.is_symlink():
            raise InputError("is a link", file=path, expected="the file that the run wrote")
        content = read_bytes(path, _MOST_FILE)
        if digest(content) != self.manifest.outputs[name]:
            expected = "files of one run; run it again"
            raise InputError("is not from the run of the manifest", file=path, expected=expected)
        return content


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def digest_file(path: Path) -> str:
    """SHA-256 of a file of any size, read in blocks."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def digest_inputs(paths: Iterable[Path]) -> dict[str, str]:
    """SHA-256 of every file by its name; later files of the same name are numbered."""
    files = list(dict.fromkeys(paths))
    return {name: digest_file(file) for name, file in zip(name_apart(f.name for f in files), files, strict=True)}


def publish(
    folder: Path,
    files: Mapping[str, bytes],
    *,
    seed: int,
    versions: Mapping[str, str],
    inputs: Mapping[str, str],
    kept: Iterable[str] = (),
) -> None:
    """Replace the results in a folder by ``files`` (contents by relative name): all of them, or none.

    Files are written beside the results first, so that a full disk changes nothing. Then they replace the old ones,
    outputs that only the earlier run had are removed, and the manifest is moved last. ``kept``: names of files that the
    run has already written into the folder, to be sealed with the others. InputError: a file cannot be written, or a
    file that no run has written is in the way; the earlier results are unchanged.
    """
    refuse_foreign(folder, files)
    outputs = {name: digest(content) for name, content in files.items()}
    outputs |= {name: digest(read_bytes(folder / name, _MOST_FILE)) for name in kept}
    manifest = Manifest(seed=seed, versions=dict(versions), inputs=dict(inputs), outputs=outputs)
    staged = folder / _STAGED
    try:
        for name, content in files.items():
            write_bytes(staged / name, content)
            make_folder((folder / name).parent)
        write_bytes(staged / MANIFEST, to_json(manifest.model_dump()).encode())  # last: from here on all can be moved
    except BaseException:
        shutil.rmtree(staged, ignore_errors=True)
        raise
    _move_staged(folder, manifest)


def _move_staged(folder: Path, manifest: Manifest) -> None:
    """Move every staged file into place, remove files that only an earlier run had, and move the manifest last."""
    staged, old = folder / _STAGED, _outputs_of_before(folder)
    for name in manifest.outputs:
        if (staged / name).exists():
            os.replace(staged / name, folder / name)
    for name in old - set(manifest.outputs):
        (folder / name).unlink(missing_ok=True)
    os.replace(staged / MANIFEST, folder / MANIFEST)
    shutil.rmtree(staged, ignore_errors=True)


def refuse_foreign(folder: Path, names: Collection[str], inputs: Iterable[Path] = ()) -> None:
    """InputError where results of another command, or an input, would be lost, or a user's own file is in the way.

    A run may remove files that the manifest names; files that no manifest names belong to the user.
    """
    ours = _outputs_of_before(folder)
    lost = {os.path.realpath(folder / name) for name in (*ours, MANIFEST)} if ours else set()
    for path in inputs:
        if os.path.realpath(path) in lost:
            message = "is an input, and --out would replace the results that contain it"
            raise InputError(message, file=path, expected="another --out")
    before, now = _find_command(ours), _find_command(names)
    if before and now and before != now:
        message = f"holds results of damping {before}, which damping {now} would replace"
        raise InputError(message, file=folder, expected="another --out")
    for name in names:
        path = folder / name
        if name not in ours and os.path.lexists(path):
            raise InputError("is no result of an earlier run", file=path, expected="another --out, or that file moved")
    if not ours and os.path.lexists(folder / MANIFEST):
        expected = "another --out, or that file moved"
        raise InputError("is no manifest of damping", file=folder / MANIFEST, expected=expected)


def _find_command(names: Collection[str]) -> str | None:
    return next((command for name, command in COMMANDS.items() if name in names), None)


def _outputs_of_before(folder: Path) -> set[str]:
    """Files that the manifest in the folder names; none without a readable manifest."""
    with suppress(InputError):
        return set(open_folder(folder).manifest.outputs)
    return set()


def open_folder(folder: Path) -> Folder:
    """A folder of results by its manifest, whose files are checked when they are read.

    InputError: no manifest, an invalid one, or one that names files outside the folder.
    """
    path = folder / MANIFEST
    if not folder.is_dir():
        what = "no such folder" if not folder.exists() else "is no folder"
        raise InputError(what, file=folder, expected="a folder of results")
    if not path.is_file():
        raise InputError(f"no {MANIFEST}", file=folder, expected="the folder of a run that was finished")
    manifest = read_form(Manifest, read_bytes(path, _MAX_SIZE), path, "a manifest/1")
    for name in manifest.outputs:
        parts = PurePosixPath(name)
        if parts.is_absolute() or ".." in parts.parts or "\\" in name or "\0" in name or not parts.parts:
            raise InputError(f"{name!r} is outside the folder", file=path, expected="names relative to it")
        if any((folder / parent).is_symlink() for parent in parts.parents[:-1]):  # the folder itself may be one
            raise InputError(f"{name!r} is behind a link", file=path, expected="files in the folder itself")
    return Folder(folder, manifest)


def verify(folder: Path) -> Folder:
    """The folder with every one of its files checked. InputError for the first that is missing or of another run."""
    opened = open_folder(folder)
    for name in opened.manifest.outputs:
        opened.read(name)
    return opened


def list_altered(folder: Path) -> set[str]:
    """Files that the manifest in the folder names and that are missing or of another run; none without a manifest."""
    altered = set()
    with suppress(InputError):
        opened = open_folder(folder)
        for name in opened.manifest.outputs:
            try:
                opened.read(name)
            except InputError:
                altered.add(name)
    return altered


@contextmanager
def sole_writer(folder: Path, names: Collection[str] = (), inputs: Iterable[Path] = ()) -> Iterator[None]:
    """Hold a folder while results for it are computed: it can be written, and no other run is writing there.

    The lock ends with the process, however that ends. Staged files of a killed run are removed; if it had begun to move
    finished results into place, the moves are completed first. ``names``, ``inputs``: outputs known beforehand and
    inputs, so that loss of files is refused before the work (:func:`refuse_foreign`). A folder that is made here and
    stays empty is removed. InputError: such a loss, a folder that cannot be written, or another run holds it.
    """
    made = not folder.exists()
    make_folder(folder)
    handle = os.open(folder, os.O_RDONLY)
    try:
        _lock(handle, folder)
        with suppress(InputError):  # no manifest is staged: the run was killed before it had all results
            _move_staged(folder, open_folder(folder / _STAGED).manifest)
        shutil.rmtree(folder / _STAGED, ignore_errors=True)
        refuse_foreign(folder, names, inputs)
        try:
            write_bytes(folder / _STAGED / "probe", b"can be written")
        finally:
            shutil.rmtree(folder / _STAGED, ignore_errors=True)
        yield
    finally:
        os.close(handle)
        if made:
            with suppress(OSError):  # it holds results
                folder.rmdir()


def _lock(handle: int, folder: Path) -> None:
    try:
        import fcntl  # noqa: PLC0415 - there is none on Windows
    except ImportError:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError("another run is writing here", file=folder, expected="another --out, or to wait") from None
    except OSError:  # a file system without locks
        return


#: Packages whose numbers results rest on.
PACKAGES = ("numpy", "scipy", "pandas", "statsmodels", "emcee", "arviz", "matplotlib")
#: The packages of the project: a result may depend on any module of them.
SHIPPED = ("damping", "damping_pipelines", "damping_reed1970", "damping_validation")


@cache
def versions() -> dict[str, str]:
    """Versions that a result depends on."""
    packages = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"damping-selection": __version__, "Python": platform.python_version(), **packages}


@cache
def digest_source() -> str:
    """SHA-256 of every module of the project, at the first call in this process."""
    hashed = hashlib.sha256()
    for package in SHIPPED:
        spec = find_spec(package)
        for folder in map(Path, spec.submodule_search_locations or ()) if spec else ():
            for path in sorted(folder.rglob("*.py")):
                content = path.read_bytes()
                hashed.update(f"{package}/{path.relative_to(folder).as_posix()} {len(content)}\n".encode() + content)
    return hashed.hexdigest()


def describe_code() -> dict[str, str]:
    """Versions and the digest of the source: two processes that agree in it compute the same results."""
    return {**versions(), "source": digest_source()}


def digest_code() -> str:
    """SHA-256 of :func:`describe_code`, which is in the key of every result."""
    return hashlib.sha256(repr(sorted(describe_code().items())).encode()).hexdigest()
