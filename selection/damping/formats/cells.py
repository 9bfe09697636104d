"""Cells of a text table as numbers: decimal marks, missing values, and marks between thousands."""

import re
from collections.abc import Collection

from damping.errors import InputError
from damping.records.text import describe_shortened

_MISSING = ("", "nan", "NaN", "NA", "--", "#N/A", "#NV", "n/a")
_NOTHING = "|".join(map(re.escape, _MISSING))
#: Marks between cells; of blanks several count as one.
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
#: Decimal marks.
DECIMALS = {"point": ".", "comma": ","}
_OTHER = {"point": ",", "comma": "."}
_APART = "' \u2019\u00a0\u2009\u202f"  #: marks between thousands that are no decimal marks
#: A number with marks between its thousands, by decimal mark. The other decimal mark is one of these if it is repeated
#: or followed by decimals.
_GROUPED = {
    name: rf"[+-]?[1-9]\d{{0,2}}((?P<apart>[{_APART}])\d{{3}}((?P=apart)\d{{3}})*([{mark}]\d*)?"
    rf"|([{_OTHER[name]}]\d{{3}})+[{mark}]\d+|([{_OTHER[name]}]\d{{3}}){{2,}})"
    for name, mark in DECIMALS.items()
}
#: A number or a missing value, by decimal mark.
NUMBER = {
    name: re.compile(rf"[+-]?(\d+[{mark}]?\d*|[{mark}]\d+)([eE][+-]?\d+)?|{_NOTHING}|{_GROUPED[name]}")
    for name, mark in DECIMALS.items()
}
#: Digits in groups of three, and such an integer by the mark between them.
_IN_THREES = re.compile(rf"[+-]?\d{{1,3}}(?:[.,{_APART}]\d{{3}})+(?:[.,]\d*)?")
_WHOLE = {name: re.compile(rf"[+-]?[1-9]\d{{0,2}}([{mark}]\d{{3}})*|0") for name, mark in DECIMALS.items()}
#: Other numbers that show that it is no such mark: one with decimals, thousands without a mark.
_UNMARKED = {name: re.compile(rf".*[{mark}]|[+-]?\d{{4}}") for name, mark in DECIMALS.items()}


#: What a cell may hold instead.
_OTHERWISE = (
    (re.compile(r"\d:\d\d"), " (a clock time, in place of seconds)"),
    (re.compile(r"\d\s*[ij]\W*$"), " (a complex number: give its parts in two columns, such as re and im)"),
)
_CLOCK = re.compile(r"(?:[\d./-]+[ T])?(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)")  # 2024-01-05 12:00:00.004


def read_clock(cell: str) -> float | None:
    """Seconds since midnight of a clock time, with or without a date; None if the cell is none."""
    match = _CLOCK.fullmatch(cell.strip())
    return None if match is None else 3600.0 * int(match[1]) + 60.0 * int(match[2]) + float(match[3].replace(",", "."))


def read_number(cell: str, decimal: str, line: int, column: str) -> float:
    """The number in a cell; NaN if nothing was measured.

    InputError: no number, or a mark between thousands that may be a decimal mark.
    """
    text = cell.strip()
    if text in _MISSING:
        return float("nan")
    name = "comma" if decimal == "point" else "point"
    other = DECIMALS[name]
    try:
        if "_" not in text and other not in text and text.isascii():
            return float(text.replace(DECIMALS[decimal], "."))
    except ValueError:
        pass
    if re.fullmatch(_GROUPED[decimal], text):
        return float(write_plainly(text, decimal))
    hint = f" (is --decimal {name} meant?)" if re.fullmatch(rf"[+-]?\d*[{other}]\d*([eE][+-]?\d+)?", text) else ""
    grouped = ", without marks between thousands" if _IN_THREES.fullmatch(text) else ""
    hint = hint or next((said for pattern, said in _OTHERWISE if pattern.search(text)), "")
    message = f"{describe_shortened(text)!r} is not a number{hint}"
    expected = f"a number with a decimal {decimal}{grouped}"
    raise InputError(message, line=line, column=describe_shortened(column), expected=expected)


def write_plainly(text: str, decimal: str) -> str:
    """A number with a decimal point and no marks between thousands; any other text as it is."""
    if not NUMBER[decimal].fullmatch(text):
        return text
    return re.sub(rf"[{_OTHER[decimal]}{_APART}]", "", text).replace(DECIMALS[decimal], ".")


def find_decimal(texts: Collection[str]) -> str:
    """The decimal mark of numbers written as text: ``comma`` if some have commas and none has a point, else ``point``.

    Whether commas stand between thousands is for `Thousands`, or for `are_in_threes`.
    """
    commas = any("," in text and NUMBER["comma"].fullmatch(text) for text in texts)
    points = any("." in text and NUMBER["point"].fullmatch(text) for text in texts)
    return "comma" if commas and not points else "point"


def are_in_threes(texts: Collection[str]) -> bool:
    """Whether all numbers with commas may be integers with marks between their thousands."""
    commas = (text for text in texts if "," in text and NUMBER["comma"].fullmatch(text))
    return all(_IN_THREES.fullmatch(text) for text in commas)


class Thousands:
    """Whether decimal marks may stand between thousands: numbers as ``978`` and ``12.345``, no ``0.5``, no ``1234``.

    Taken for a decimal mark, such a mark makes numbers a thousand times too small. ``is_possible``: whether the layout
    allows it, and whether every number seen does.
    """

    def __init__(self, decimal: str, *, is_possible: bool) -> None:
        self.is_possible = is_possible
        self._decimal = decimal
        self._marked: tuple[str, str] | None = None
        self._has_plain = False

    def look_at(self, cell: str, column: str) -> None:
        """Take note of a cell."""
        text = cell.strip()
        if not _WHOLE[self._decimal].fullmatch(text):
            self.is_possible = self.is_possible and not _UNMARKED[self._decimal].match(text)
        elif DECIMALS[self._decimal] in text:
            self._marked = self._marked or (text, column)
        else:
            self._has_plain = True

    def require_none(self) -> None:
        """Raise InputError if it is possible."""
        if self.is_possible and self._has_plain and self._marked is not None:
            text, column = self._marked
            what = f"{text} beside whole numbers: a decimal {self._decimal}, or a mark between thousands?"
            expected = f"--decimal {self._decimal} if it is one, else numbers without marks between thousands"
            raise InputError(what, column=describe_shortened(column), expected=expected)
