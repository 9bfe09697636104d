"""The only writer of files (tables, figures, pages): every output is written completely or not at all."""

from __future__ import annotations

import errno
import io
import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damping.arrays import plain
from damping.errors import AnalysisError, InputError

if TYPE_CHECKING:
    import pandas as pd

    from damping.result import Result


def write_bytes(path: Path, content: bytes) -> None:
    """Write ``content`` to ``path`` atomically (:func:`write_chunks`)."""
    write_chunks(path, (content,))


def write_chunks(path: Path, chunks: Iterable[bytes]) -> None:
    """Write ``chunks`` one after the other to ``path``; a missing folder is made.

    A file, or the target of a link, is replaced atomically. A pipe or a device is written to.
    InputError: the target cannot be written (read-only folder, full disk, a folder of that name).
    """
    make_folder(path.parent)
    try:
        if _is_stream(path):
            with path.open("wb", buffering=0) as stream:
                for chunk in chunks:
                    stream.write(chunk)
        else:
            _replace(Path(os.path.realpath(path, strict=path.exists())), chunks)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise _unwritable(path, error) from error


def _is_stream(path: Path) -> bool:
    """Whether this is, or leads to, a pipe, a device or a socket: which is written to and never replaced."""
    try:
        kind = os.stat(path).st_mode
    except FileNotFoundError:
        return False
    return not (stat.S_ISREG(kind) or stat.S_ISDIR(kind))


def _replace(path: Path, chunks: Iterable[bytes]) -> None:
    """Write a file beside ``path``, flush it and rename it over ``path``: a reader sees the old file or the new."""
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.writelines(chunks)
            stream.flush()
            os.fsync(stream.fileno())
        mask = os.umask(0)  # there is no call that reads it without setting it
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def refuse_inputs(option: str, target: Path | str | None, *inputs: Path) -> None:
    """InputError, before any work, if the file of ``option`` is one of the inputs, by any path."""
    if target is None or target == "-":
        return
    if os.path.realpath(target) in map(os.path.realpath, inputs):  # Path.resolve fails on a link to itself
        expected = "another file"
        raise InputError(f"{option} is one of the inputs, which are never overwritten", file=target, expected=expected)


def check_outputs(targets: Mapping[str, Path | str | None], *inputs: Path) -> None:
    """InputError, before any work, if an output is an input, another output, of no known format, or unwritable."""
    for option, target in targets.items():
        refuse_inputs(option.split()[0], target, *inputs)  # a file of a folder is listed as ``--plots NAME``
    seen: dict[str, str] = {}
    for option, target in targets.items():
        if str(target) == "-" and option != "--json":
            raise InputError(f"{option} - is no file; only --json writes to standard output", expected="a name")
        if target is not None and target != "-":
            other = seen.setdefault(os.path.realpath(target), option)
            if other != option:  # the later would replace the earlier
                expected = "another file for each output"
                raise InputError(f"{option} is the file of {other}", file=target, expected=expected)
            refuse_unwritable(Path(target))
    for option, endings in (("--plot", PICTURES), ("--report", PAGES)):
        target = targets.get(option)
        if target is not None and Path(target).suffix.lower() not in endings:
            expected = f"a name ending in {' or '.join(endings)}"
            raise InputError(f"{option} {Path(target).name!r} is of no known format", expected=expected)


def refuse_unwritable(target: Path, *, folder: bool = False) -> None:
    """InputError if no file, or no ``folder``, can be written there, as far as that is known beforehand."""
    try:
        if not folder and _is_stream(target):
            return
        above = Path(os.path.realpath(target))
        wrong = errno.EISDIR if not folder and above.is_dir() else 0
        above = above if folder else above.parent
        while not os.path.exists(above) and above != above.parent:
            above = above.parent
        if above.is_dir():
            wrong = wrong or (0 if os.access(above, os.W_OK | os.X_OK) else errno.EACCES)
        else:
            wrong = errno.ENOTDIR
        if wrong:
            raise OSError(wrong, os.strerror(wrong))
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise _unwritable(target, error) from error


def make_folder(path: Path) -> None:
    """Make a folder and its missing parents. InputError if that fails."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(f"cannot be written ({reason})", file=path, expected="a writable place with free space")


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text atomically."""
    write_bytes(path, text.encode("utf-8"))


def write_json(target: Path | str, value: Any) -> None:
    """Write ``value`` as JSON to a file, or to standard output when ``target`` is ``-``; NaN becomes ``null``."""
    write_plain(target, plain(value))


def write_plain(target: Path | str, value: Any) -> None:
    """:func:`write_json` of data that are already :func:`plain`, without copying them."""
    chunks = _json_chunks(value)
    if str(target) == "-":
        sys.stdout.writelines(chunks)
    else:
        write_chunks(Path(target), (chunk.encode("utf-8") for chunk in chunks))


def to_json(value: Any) -> str:
    """JSON text of plain data, numpy numbers and arrays included; missing values are ``null``."""
    return "".join(_json_chunks(plain(value)))


def _json_chunks(value: Any) -> Iterator[str]:
    """The text of plain data in pieces: the whole text can be many times larger than the data."""
    yield from json.JSONEncoder(indent=2, ensure_ascii=False, allow_nan=False).iterencode(value)
    yield "\n"


def to_parquet(table: pd.DataFrame) -> bytes:
    """A table as a Parquet file."""
    import_module("pyarrow")  # of the extra [formats]: pandas says less clearly that it is not there
    buffer = io.BytesIO()
    table.to_parquet(buffer, engine="pyarrow", index=False)
    return buffer.getvalue()


PNG_DPI = 200  #: dots per inch of a PNG image
PICTURES = (".svg", ".png")  #: endings of a picture's name
PAGES = (".html", ".htm")  #: endings of a page's name


def write_answer(
    json_out: str | None, result: Result, plot: Path | None, texts: Mapping[Path, str] | None = None
) -> None:
    """Further texts by file, picture (SVG or PNG, by its ending) and form of a result, all made before any is written.

    A picture that cannot be drawn leaves every earlier file as it was, and nothing on standard output.
    """
    contents = {path: text.encode() for path, text in (texts or {}).items()}
    if plot is not None:
        contents[plot] = _draw_picture(plot, result)
    form = None if json_out is None else result.to_json()
    for path, content in contents.items():
        write_bytes(path, content)
    if plot is not None:
        print(f"{plot} drawn", file=sys.stderr)
    if json_out is not None:
        write_plain(json_out, form)


def _draw_picture(path: Path, result: Result) -> bytes:
    from damping.plots import to_png, to_svg  # noqa: PLC0415 - only drawing needs matplotlib

    figure: Any = result.plot()  # a figure of its own, without axes to draw on
    if path.suffix.lower() == ".png":
        return to_png(figure, PNG_DPI)
    return to_svg(figure, path.stem, result.title, result.title).encode()


#: Names of the browser that prints, the first that is there.
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
#: What is printed of a page: its answer alone.
ANSWER_ALONE = """<style>@media print {
  main > section:not(#answer), nav, footer { display: none }
  body { zoom: 0.7 }
}</style></head>"""
LONGEST_PRINT = 60  #: seconds that printing may take


def print_answer(page: str) -> bytes:
    """The section ``answer`` of a page as PDF, by Chromium. AnalysisError: no Chromium, or it cannot print."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise AnalysisError(f"--pdf: none of {', '.join(BROWSERS)} is installed; print report.html from any browser")
    with tempfile.TemporaryDirectory() as folder:
        source, printed = Path(folder) / "report.html", Path(folder) / "report.pdf"
        write_text(source, page.replace("</head>", ANSWER_ALONE, 1))
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer"]
        words = [*command, f"--print-to-pdf={printed}", source.as_uri()]
        try:
            done = subprocess.run(words, capture_output=True, check=False, timeout=LONGEST_PRINT)
        except subprocess.TimeoutExpired:
            message = f"--pdf: {browser} has not printed within {LONGEST_PRINT:g} s; print report.html from any browser"
            raise AnalysisError(message) from None
        if done.returncode or not printed.exists():
            raise AnalysisError(f"--pdf: {browser} ended with {done.returncode} and no page")
        return printed.read_bytes()
