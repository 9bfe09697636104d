"""Universal files (UFF, UNV), data set 58: frequency responses, spectra and time histories, text or binary, to series.

The format is read here and not by the pyuff package, which is the reference of the tests: for any bytes a reader must
end with a result or one line, in memory of a few times the file (pyuff takes twelve times a binary file of single
precision), and must read what laboratories have: touching columns, letters D, exponents without a letter, wide
abscissas, padded last lines, line ends after bytes, wrong byte counts, ``-1`` in ID lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.series import FileFacts, Samples, Series, Summary
from damping.formats.uff_blocks import Header, UffBlock, abscissa, blocks, header, units
from damping.formats.uff_values import PEAK, binary_form, values
from damping.records.text import describe_shortened

_FUNCTIONS = {
    0: "general",
    1: "time response",
    2: "auto spectrum",
    3: "cross spectrum",
    4: "frequency response",
    5: "transmissibility",
    6: "coherence",
    9: "power spectral density",
    10: "energy spectral density",
    12: "spectrum",
}
_TAKEN = (0, 1, 4, 12)  # the others are squares, ratios of motions or no functions of time or frequency
_QUANTITIES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force", 17: "time"}
_PER_FORCE = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}
#: Data types of an abscissa that is time, and frequency (field 1 of record 8 of data set 58).
_TIME = 17
_FREQUENCY = 18
_MOST_LISTED = 12
_MOST_SWEEPS = 1000


@dataclass(frozen=True)
class _Set:
    """One data set 58 of a file: its number from 1, where it is, its header, the units code before it."""

    number: int
    block: UffBlock
    header: Header
    units_code: int

    @property
    def quantity(self) -> str:
        return _QUANTITIES.get(self.header.numerator.code, "")

    @property
    def per(self) -> str:
        return _QUANTITIES.get(self.header.denominator.code, "")

    @property
    def is_time(self) -> bool:
        return self.header.function == 1 or self.header.abscissa.code == _TIME

    @property
    def is_force(self) -> bool:
        return self.quantity == "force" and not self.per and self.header.function != 4

    @property
    def point(self) -> str:
        (node, direction), (at, along) = self.header.response_point, self.header.reference_point
        return f"node {node} direction {direction}" + (f" from node {at} direction {along}" if at or along else "")


def read_uff(
    data: bytes, summary: Summary, datasets: tuple[int, ...] = (), labels: tuple[str, ...] = ()
) -> list[Series]:
    """The responses of a universal file, each with its measured force where the file has one.

    Args:
        data: the file. summary: grows by what was found.
        datasets: numbers of the data sets 58 to take, from 1; empty: all that are responses or forces.
        labels: not empty where the user labels the sweeps, so that ID lines need not tell them apart.

    Raises:
        InputError: no data set 58, a broken one, none that is a response, or responses at several points unchosen.
    """
    data = _as_lines(data)
    sets, others = _sets(data)
    _listed(sets, others, summary)
    chosen = _list_chosen(sets, datasets)
    forces, responses = [s for s in chosen if s.is_force], [s for s in chosen if not s.is_force]
    _one_point(responses, datasets)
    series = [_series(response, data, summary) for response in responses]
    if not labels:
        series = _list_labelled(series, responses)
    return _list_with_forces(series, forces, data, summary)


@dataclass(frozen=True)
class Function:
    """A data set 58 as it stands: ID line, response and reference (node, direction), type, abscissa and ordinate.

    ``quantity`` is what the ordinate is, ``per`` what it is divided by ('' where nothing), ``units`` their labels.
    """

    title: str
    response: tuple[int, int]
    reference: tuple[int, int]
    is_time: bool
    quantity: str
    per: str
    units: tuple[str, str]
    x: FloatArray
    y: Samples


def read_functions(data: bytes, summary: Summary) -> list[Function]:
    """Every function of time or frequency of a universal file, whatever the points and quantities.

    Raises:
        InputError: no data set 58, or a broken one.
    """
    data = _as_lines(data)
    taken = []
    for entry in (entry for entry in _sets(data)[0] if entry.header.function in (*_TAKEN, 5)):
        head = entry.header
        x, y = values(data, entry.block, head)
        at = abscissa(x, head.abscissa, entry.is_time, summary)
        labels = (head.numerator.unit, head.denominator.unit if entry.per else "")
        points = (head.response_point, head.reference_point)
        taken.append(Function(head.title, *points, entry.is_time, entry.quantity, entry.per, labels, at, y))
    return taken


def _as_lines(data: bytes) -> bytes:
    """The file with line feeds, where it has carriage returns alone."""
    return data if b"\n" in data else data.replace(b"\r", b"\n")


def _sets(data: bytes) -> tuple[list[_Set], list[int]]:
    """The data sets 58, one at least, and the numbers of all other data sets."""
    sets: list[_Set] = []
    others: list[int] = []
    code = 0
    for block in blocks(data, lambda block_: binary_form(data, block_, header(block_))[1]):
        if block.kind == 58:
            sets.append(_Set(len(sets) + 1, block, header(block), code))
        elif block.kind not in others and len(others) < _MOST_LISTED:
            others.append(block.kind)
        if block.kind == 164:
            field = data[block.start : block.start + 10].split(b"\n")[0].strip()
            code = int(field) if field.isdigit() else 0
    if not sets:
        has = f" (it has {', '.join(map(str, others))})" if others else ""
        raise InputError(f"no data set 58{has}", expected="a universal file with functions at nodal DOF")
    return sets, others


def _listed(sets: list[_Set], others: list[int], summary: Summary) -> None:
    for entry in sets[:_MOST_LISTED]:
        head = entry.header
        quantity = f"{entry.quantity or 'unknown quantity'}{f' per {entry.per}' if entry.per else ''}"
        what = _FUNCTIONS.get(head.function, f"function type {head.function}")
        form = "bytes" if entry.block.binary else "text"
        title = f", {describe_shortened(head.title, 40)!r}" if head.title else ""
        text = f"{what}, {quantity}, {head.points} points ({form}), {entry.point}{title}"
        summary.add(f"data set {entry.number}", text, "found in the file")
    if len(sets) > _MOST_LISTED:
        summary.note(f"{len(sets)} data sets 58; the first {_MOST_LISTED} are listed")
    if others:
        summary.note(f"data sets {', '.join(map(str, others))} are passed over")


def _list_chosen(sets: list[_Set], datasets: tuple[int, ...]) -> list[_Set]:
    """The sets asked for, or all functions of time or frequency that are motions or forces."""
    bad = next((number for number in datasets if not 1 <= number <= len(sets)), None)
    if bad is not None:
        raise InputError(f"no data set {bad}", expected=f"numbers from 1 to {len(sets)}")
    chosen = [sets[number - 1] for number in datasets] if datasets else [s for s in sets if s.header.function in _TAKEN]
    for entry in chosen:
        problem = _describe_unfit(entry)
        if problem and datasets:
            raise InputError(f"data set {entry.number} is {problem}", line=entry.block.line, expected=_EXPECTED)
    chosen = [entry for entry in chosen if not _describe_unfit(entry)]
    if not any(not entry.is_force for entry in chosen):
        raise InputError("no data set is a response", expected=_EXPECTED)
    has_ratio = any(entry.header.function == 4 for entry in chosen)
    if has_ratio and not datasets:  # the spectra of responses beside their frequency responses say the same twice
        chosen = [entry for entry in chosen if entry.header.function == 4 or (entry.is_force and not entry.is_time)]
    if len({entry.is_time for entry in chosen}) > 1:
        raise InputError("both time histories and spectra", expected="--dataset numbers of one kind")
    return chosen


_EXPECTED = "a frequency response (type 4), spectrum (12), general function (0) or time response (1) of a motion"


def _describe_unfit(entry: _Set) -> str:
    """Why a data set is neither a response nor a force; '' if it is one."""
    head = entry.header
    if head.function not in _TAKEN:
        return _FUNCTIONS.get(head.function, f"of function type {head.function}")
    if head.function == 4 and (entry.quantity == "force" or entry.per not in ("", "force")):
        return f"a ratio of {entry.quantity or 'unknown'} to {entry.per or 'unknown'}"
    if head.function == 4 and head.ordinate in (2, 4):
        return "a frequency response of real values, whose phase is lost"
    if entry.is_time and head.ordinate in (5, 6):
        return "a time history of complex values"
    if not entry.is_time and head.function != 4 and head.abscissa.code not in (_FREQUENCY, 0):
        return f"a function of abscissa type {head.abscissa.code}"
    if head.function == 0 and head.abscissa.code == 0:
        return "a function whose abscissa is neither said to be frequency nor time"
    return ""


def _one_point(responses: list[_Set], datasets: tuple[int, ...]) -> None:
    if len(responses) > _MOST_SWEEPS:
        expected = f"--dataset numbers of at most {_MOST_SWEEPS}"
        raise InputError(f"{len(responses)} responses", expected=expected)
    points = list(dict.fromkeys(response.point for response in responses))
    if len(points) > 1 and not datasets:
        expected = "--dataset numbers of the sweeps of one point, or damping campaign for all"
        message = f"responses at {len(points)} points ({points[0]}; {points[1]}; ...)"
        raise InputError(message, expected=expected)


def _series(entry: _Set, data: bytes, summary: Summary) -> Series:
    x, y = values(data, entry.block, entry.header)
    head = entry.header
    response = (
        (_PER_FORCE.get(entry.quantity) if entry.per == "force" else None) if head.function == 4 else entry.quantity
    )
    (_, along), (_, against) = head.response_point, head.reference_point
    if along * against < 0:
        summary.note(f"data set {entry.number}: response and reference directions are opposite ({along}, {against})")
    return Series(
        label=head.title or f"set {entry.number}",
        abscissa=abscissa(x, head.abscissa, entry.is_time, summary),
        response=y,
        is_time=entry.is_time,
        has_phase=bool(np.iscomplexobj(y)),
        facts=FileFacts(
            response or None,
            per_force=head.function == 4,
            scaling="peak" if PEAK in head.notes else None,
            units=units(head, entry.quantity, entry.per, entry.units_code, summary),
        ),
    )


def _list_labelled(series: list[Series], sets: list[_Set]) -> list[Series]:
    """ID lines as labels where they tell the sweeps apart, else numbers of data sets."""
    if len({row.label for row in series}) == len(series):
        return series
    return [replace(row, label=f"set {entry.number}") for row, entry in zip(series, sets, strict=True)]


def _list_with_forces(series: list[Series], forces: list[_Set], data: bytes, summary: Summary) -> list[Series]:
    """Each response with its force: as many forces as responses, in order, at the same abscissas."""
    if not forces:
        return series
    if len(forces) != len(series):
        expected = "a force for each response, in the same order; choose them with --dataset"
        raise InputError(f"{len(forces)} forces and {len(series)} responses", expected=expected)
    pairs = zip(series, _forces(forces, data, summary), strict=True)
    return [_joined(row, one_force, number) for (row, one_force), number in zip(pairs, forces, strict=True)]


def _forces(forces: list[_Set], data: bytes, summary: Summary) -> Iterator[tuple[FloatArray, Samples, dict[str, str]]]:
    for force in forces:
        x, y = values(data, force.block, force.header)
        head = force.header
        yield (
            abscissa(x, head.abscissa, force.is_time, summary),
            y,
            units(head, force.quantity, force.per, force.units_code, summary),
        )


def _joined(row: Series, force: tuple[FloatArray, Samples, dict[str, str]], entry: _Set) -> Series:
    x, y, named = force
    if len(x) != len(row.abscissa) or not np.allclose(x, row.abscissa, rtol=1e-4, atol=0.0):
        message = f"the force of data set {entry.number} is at other abscissas than response {row.label!r}"
        raise InputError(message, line=entry.block.line, expected="the same frequencies")
    known = dict(row.facts.units) | ({"force": named["force"]} if "force" in named else {})
    return replace(row, force=y, facts=replace(row.facts, units=known))
