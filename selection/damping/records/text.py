"""Files as text: bounded size, encodings, rows of a CSV file with their lines; and text shared by many messages."""

import codecs
import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import SupportsFloat

from damping.errors import InputError, describe_nearest

DEFAULT_MAX_SIZE = 200_000_000  #: default size limit of a file, bytes (200 MB: some four million steady states)

LONGEST_ROW = 1_000_000  #: longest row of a CSV file, characters

#: A number in a cell: digits 0-9, no grouping marks, no NaN or infinity.
NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)

_EXECUTED = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet may execute cells that begin with one of these
_LINE_END = re.compile(rb"\r\n?|\n")
_LINE = re.compile(r"[^\r\n]*(?:\r\n?|\n)|[^\r\n]+")
_LOOKED_AT = 2100  # first bytes of a file, by which it is text or not
_TOGETHER = 65_536  # bytes decoded together, extended to the end of the line
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_GZIP = b"\x1f\x8b"  #: first bytes of a file compressed by gzip
_CONTROLS = bytes(set(range(32)) - set(b"\t\n\v\f\r"))  # control characters that text does not contain
_OPEN_QUOTE = "unexpected end of data"  # message of the csv module on a file that ends in an open quote


def read_source(source: object) -> str:
    """Where a record or mode is from, for messages. InputError if it is neither text nor path."""
    if not isinstance(source, str | PathLike):
        raise InputError(f"source is of type {type(source).__name__}", expected="a text or a path")
    return str(source)


def is_binary(start: bytes) -> bool:
    """Whether the first bytes of a file are not text in any encoding: over one in twenty is a control character."""
    controls = len(start) - len(start.translate(None, _CONTROLS))
    return not start.startswith(_UTF16) and 20 * controls > len(start)


def read_bytes(path: str | Path, max_size: int = DEFAULT_MAX_SIZE) -> bytes:
    """Contents of a file of at most ``max_size`` bytes. InputError if it cannot be read, is empty or is larger."""
    data = read_start(path, max_size + 1)
    if len(data) > max_size:
        raise too_large(path, max_size)
    if not data.removeprefix(codecs.BOM_UTF8).strip():
        raise InputError("the file is empty", file=path, expected="a file with contents")
    return data


def too_large(path: str | Path, max_size: int) -> InputError:
    """The error on a file of more than ``max_size`` bytes."""
    return InputError(f"larger than {max_size} bytes", file=path, expected="a smaller file or a larger --max-size")


def read_start(path: str | Path, most: int) -> bytes:
    """The first ``most`` bytes of a file. InputError if it cannot be read."""
    if isinstance(path, str) and not path:  # which Path takes for the working folder
        raise InputError("an empty path", expected="the name of a file")
    try:
        if not Path(path).is_dir() and Path(path).exists() and not Path(path).is_file():  # a pipe would be waited for
            raise InputError("is no regular file", file=path, expected="a file")
        with Path(path).open("rb") as stream:
            return stream.read(most)
    except FileNotFoundError:
        raise InputError("no such file", file=path, expected="the name of a file") from None
    except IsADirectoryError:
        raise InputError("is a folder", file=path, expected="a file") from None
    except TypeError:
        raise InputError(f"path is of type {type(path).__name__}", expected="the name of a file") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        why = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {why}", file=path, expected="a file that can be read") from None


def decode(data: bytes) -> tuple[str, InputError | None]:
    """Text before the first line that is not UTF-8 (a byte order mark is dropped), and the error on that line."""
    data = data.removeprefix(codecs.BOM_UTF8)
    bad = data.find(b"\0") if b"\0" in data else len(data)
    try:
        text = data[:bad].decode()
    except UnicodeDecodeError as error:
        bad = error.start
    if bad == len(data):
        return text, None
    if data.startswith(_GZIP):
        return "", InputError("is compressed", expected="the file itself, as gunzip unpacks it")
    if is_binary(data[:_LOOKED_AT]):  # a workbook, an archive, measured samples
        expected = "text, CSV or TOML (damping import and campaign read XLSX, MAT, HDF5, TDMS and UFF files)"
        return "", InputError("is no text", expected=expected)
    ends = [match.end() for match in _LINE_END.finditer(data, 0, bad)]
    start = ends[-1] if ends else 0
    byte = "a NUL byte" if data[bad] == 0 else f"byte 0x{data[bad]:02x}"
    hint = " (the file looks like UTF-16)" if data.startswith(_UTF16) else ""
    message = f"{byte} at byte {bad - start + 1} of the line is not UTF-8 text{hint}"
    return data[:start].decode(), InputError(message, line=len(ends) + 1, expected="text in UTF-8")


def recode(data: bytes) -> tuple[bytes, str]:
    """Text recoded to UTF-8, and its original encoding if converted: ``UTF-16``, ``Windows-1252``, else ''."""
    if data.isascii():
        return data, ""
    try:
        if data.startswith(_UTF16):
            return data.decode("utf-16").encode(), "UTF-16"
        codecs.getincrementaldecoder("utf-8")().decode(data)  # its end may be cut within a character
    except UnicodeDecodeError:
        try:
            return data.decode("cp1252").encode(), "Windows-1252"
        except UnicodeDecodeError:
            return data, ""
    return data, ""


def describe_shortened(text: str, length: int = 30, mark: str = "...") -> str:
    """``text``, cut to ``length`` characters for a message, including a final ``mark``."""
    return text if len(text) <= length else text[: max(length - len(mark), 0)] + mark


def describe_cell(cell: str) -> str:
    """A cell that is not a number, for a message."""
    return repr(describe_shortened(cell.strip())) if cell.strip() else "an empty cell"


def describe_separator(names: Sequence[str]) -> str:
    """A remark on a header that is not separated by commas; empty on one that is."""
    if len(names) == 1 and (";" in names[0] or "\t" in names[0]):
        return " (the header is separated by semicolons or tabs: damping import reads such files)"
    return ""


def count(n: int, what: str) -> str:
    """``1 sweep``, ``3 sweeps``."""
    return f"{n} {what}{'' if n == 1 else 's'}"


def per_cent(value: SupportsFloat) -> str:
    """A size in per cent as a sentence needs it: two significant digits below ten, whole from there (``657``)."""
    x = float(value)
    return f"{x:.0f}" if abs(x) >= 9.95 and isfinite(x) else f"{x:.2g}"


SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")  #: makes a power of its digits
NOTHING = "–"  #: sign for a missing number


def describe_p(p: float) -> str:
    """A p-value to two digits: ``p = 0.024``; smaller than any model is exact to, ``p < 0.0001``."""
    return f"p = {p:.2g}" if p >= 1e-4 else "p < 0.0001"


def format_share(value: SupportsFloat) -> str:
    """A probability with two decimals, three where small; ``< 0.001``, which no line breaks, for less than that."""
    x = float(value)
    if not isfinite(x):
        return NOTHING
    if x == 0.0:
        return "0"
    return f"{x:.2f}" if x >= 0.0095 else f"{x:.3f}" if x >= 0.0005 else "<\N{NO-BREAK SPACE}0.001"


def name_apart(names: Iterable[str]) -> list[str]:
    """The names in order, made unique: a repeated name gets a number, ``run``, ``run (2)``."""
    unique: dict[str, None] = {}  # in order
    for name in names:
        numbered, number = name, 2
        while numbered in unique:
            numbered, number = f"{name} ({number})", number + 1
        unique[numbered] = None
    return list(unique)


def describe_meant(name: str, known: Iterable[str], likeness: float = 0.5) -> str:
    """A hint at the known name most similar to ``name``, for a message; empty if none is similar."""
    nearest = describe_nearest(name, known, likeness=likeness)
    return f" (is {describe_shortened(nearest)!r} meant?)" if nearest else ""


def guarded(text: str) -> str:
    """``text`` with a leading apostrophe if a spreadsheet might execute it: if it begins with = + - @, tab or CR.

    A plain number needs none. ``unguarded`` removes exactly that apostrophe.
    """
    return f"'{text}" if text.lstrip("'").startswith(_EXECUTED) and not NUMBER.fullmatch(text) else text


def unguarded(text: str) -> str:
    """``text`` without the apostrophe that ``guarded`` added."""
    return text[1:] if text.startswith("'") and text.lstrip("'").startswith(_EXECUTED) else text


class CsvRows:
    """Iterator over the rows of a CSV file as (line on which the row starts, cells); blank lines are skipped.

    It stops at the first row that cannot be read; ``problem`` then holds the error. Quoted cells may contain commas and
    line ends. Lines are decoded in blocks, so that memory stays at the file and a row. Several blanks count as one
    delimiter. The first ``skip`` lines are skipped, and with ``comments`` also lines that begin with # or %.
    """

    def __init__(self, data: bytes, delimiter: str = ",", *, comments: bool = False, skip: int = 0) -> None:
        self._data = data.removeprefix(codecs.BOM_UTF8)
        self._delimiter, self._comments, self._skip = delimiter, comments, skip
        self._reader = csv.reader(self._lines(), delimiter=delimiter, strict=True, skipinitialspace=delimiter == " ")
        self._separated = "by commas" if delimiter == "," else "as stated"
        self._size = self._start = 0
        self.problem: InputError | None = None

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        return self

    def __next__(self) -> tuple[int, list[str]]:
        while True:
            self._size = self._start = 0
            try:
                cells = next(self._reader)
            except InputError as error:
                self.problem = error
                raise StopIteration from None
            except csv.Error as error:
                problem, expected = f"not CSV: {error}", f"cells separated {self._separated}"
                if str(error) == _OPEN_QUOTE:
                    problem, expected = "a quote that is opened and never closed", '"..."'
                self.problem = InputError(problem, line=self._start, expected=expected)
                raise StopIteration from None
            if len(cells) > 1 or (cells and cells[0].strip()):
                return self._start, cells

    def _lines(self) -> Iterator[str]:
        """Lines with their ends. InputError for the first that is not text or makes a row too long."""
        start, number = 0, 0
        while start < len(self._data):
            end = self._data.find(b"\n", start + _TOGETHER) + 1 or len(self._data)
            text, broken = decode(self._data[start:end])
            for match in _LINE.finditer(text):
                number += 1
                if number <= self._skip or (self._comments and match[0].lstrip().startswith(("#", "%"))):
                    continue
                self._start = self._start or number
                self._size += match.end() - match.start()
                if self._size > LONGEST_ROW:
                    message = f"a row of more than {LONGEST_ROW} characters"
                    raise InputError(message, line=number, expected="cells in rows")
                yield match[0] if self._delimiter != " " else match[0].rstrip(" \r\n") + "\n"
            if broken is not None:
                raise InputError(broken.message, line=number + 1, expected=broken.expected)
            start = end


@dataclass(frozen=True)
class Disagreement:
    """Sentences on contradictions between ranking and diagnosis, those on loads first; none where they agree."""

    on_loads: tuple[str, ...] = ()  #: on the amplitude at a force; shown before a result
    on_rows: tuple[str, ...] = ()  #: on what explains the rows; shown after a result

    def __iter__(self) -> Iterator[str]:
        return iter((*self.on_loads, *self.on_rows))


AGREED = Disagreement()  #: ranking and diagnosis agree, or are not compared
