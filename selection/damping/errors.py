"""Exceptions shown to the user: bad input (exit code 2) and an analysis that cannot be done (exit code 1)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from numbers import Integral
from os import PathLike
from pathlib import Path


def escape_control(text: str) -> str:
    """Text of a file made safe for a terminal: control characters and line ends are escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def describe_nearest(name: str, known: Iterable[str], *, likeness: float = 0.0) -> str | None:
    """The known name most similar to ``name``; None if no similarity reaches ``likeness`` (0 to 1)."""
    return next(iter(get_close_matches(name, list(known), n=1, cutoff=likeness)), None)


def list_nearest(name: str, known: Iterable[str]) -> str:
    """The known name most similar to ``name``, and all known names."""
    names = list(known)
    return f"{describe_nearest(name, names)} (nearest of {', '.join(names)})" if names else "no key"


class DampingError(Exception):
    """Base of every error that is reported to the user as one line."""


class InputError(DampingError):
    """Bad usage or bad input: says what is wrong, where, and what was expected.

    The text reads ``FILE, line N, column C: MESSAGE; expected EXPECTED`` with the parts that are known.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | Path | None = None,
        line: int | None = None,
        column: str | None = None,
        expected: str | None = None,
    ) -> None:
        self.message, self.line, self.column, self.expected = message, line, column, expected
        self.file = str(file) if isinstance(file, str | PathLike) and str(file) else None
        place = [self.file] if self.file is not None else []
        if line is not None:
            place.append(f"line {line}")
        if column is not None:
            place.append(f"column {column}")
        text = f"{', '.join(place)}: {message}" if place else message
        if expected is not None:
            text += f"; expected {expected}"
        super().__init__(escape_control(text))  # always one line

    def in_file(self, file: str | Path) -> InputError:
        """The same error with the name of its file."""
        return type(self)(self.message, file=file, line=self.line, column=self.column, expected=self.expected)


class Refused(InputError):  # noqa: N818 - the name is part of the interface
    """A record was read, but a check of the audit shows that any result would be wrong; the message names the check."""


class AnalysisError(DampingError):
    """The analysis cannot be done on this (valid) data; the message says why."""


def check_kind(value: object, kind: type, name: str) -> None:
    """Raise InputError if the argument ``name`` is not of type ``kind``."""
    if not isinstance(value, kind):
        raise InputError(f"{name} is of type {type(value).__name__}", expected=f"{kind.__name__}")


def check_choice(value: object, known: Iterable[str], message: str) -> None:
    """Raise InputError with the ``message`` if ``value`` is not one of the ``known`` texts."""
    if not (isinstance(value, str) and value in known):
        raise InputError(message, expected=f"one of {', '.join(known)}")


def check_whole(**numbers: object) -> None:
    """Raise InputError if an argument is not a whole number >= 0."""
    for name, number in numbers.items():
        if isinstance(number, bool) or not isinstance(number, Integral) or number < 0:
            raise InputError(f"{name} {number!r}", expected="a whole number >= 0")


def check_flags(**flags: object) -> None:
    """Raise InputError if an argument is neither true nor false."""
    for name, flag in flags.items():
        if type(flag).__name__ != "bool":  # Python's or NumPy's, which loads slowly
            raise InputError(f"{name} {flag!r}", expected="True or False")


@contextmanager
def naming(file: str | Path) -> Iterator[None]:
    """Add the name of the ``file`` being read to every InputError raised inside that names none."""
    try:
        yield
    except InputError as error:
        if error.file is not None:
            raise
        raise error.in_file(file) from error
