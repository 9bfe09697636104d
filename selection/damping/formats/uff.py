"""Universal files (UFF, UNV), data set 58: frequency responses, spectra and time histories, text or binary, to series.

For any bytes the reader ends with a result or a one-line error, in memory of a few times the file.

pyuff is the reference of the tests, not the reader. Of the 20 ways to write a file in ``test_uff_oddities`` version
2.5.8 reads 12 (not exponents with D, titles with ``-1``, bytes that read as ``-1``, a file without the last line), and
8 of the 17 broken files, or an abscissa of single precision in bytes, give wrong values or none without an error. Its
errors name no line, and it writes neither spectra (type 12) nor sweeps of one row. It takes 9 to 15 times a binary file
in memory, where 3 to 5 times are taken here.
"""

from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.headers import ABSCISSAS, NAMES, refuse_decibels
from damping.formats.quantity import unit
from damping.formats.series import MOST_SWEEPS, FileFacts, Samples, Series, Summary
from damping.formats.uff_blocks import FREQUENCY, DataSet, find_sets
from damping.formats.uff_values import PEAK, values
from damping.records.text import describe_shortened

#: Function types of data set 58 by code.
_FUNCTIONS: dict[int, str] = {int(code): name for code, name in NAMES["uff"]["function"].items()}
_TAKEN = (0, 1, 4, 12)  # the others are squares, ratios of motions, or not functions of time or frequency
_PER_FORCE = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}
_MOST_LISTED = 12


def read_uff(data: bytes, summary: Summary, datasets: tuple[int, ...], labels: tuple[str, ...]) -> list[Series]:
    """The responses of a universal file, each with its measured force if the file has one.

    ``datasets``: numbers of the data sets 58 to take, from 1; empty: all that are responses or forces. ``labels``: of
    the sweeps, if stated; ID lines then need not be unique.

    InputError: no data set 58, a broken one, none that is a response, or responses at several points without a choice.
    """
    data = _as_lines(data)
    sets, others = find_sets(data)
    _summarise(sets, others, summary)
    chosen = _list_chosen(sets, datasets)
    forces, responses = [s for s in chosen if s.is_force], [s for s in chosen if not s.is_force]
    _require_one_point(responses, datasets)
    series = []
    for response in responses:
        series.append(_series(response, data, summary))
        (_, along), (_, against) = response.response_point, response.reference_point
        if along * against < 0:
            message = f"response and reference directions are opposite ({along}, {against})"
            summary.note(f"data set {response.number}: {message}")
    if not labels and len({row.label for row in series}) < len(series):  # ID lines are not unique
        series = [replace(row, label=f"set {entry.number}") for row, entry in zip(series, responses, strict=True)]
    if not forces:
        return series
    if len(forces) != len(series):
        expected = "a force for each response, in the same order; choose them with --dataset"
        raise InputError(f"{len(forces)} forces and {len(series)} responses", expected=expected)
    return [_with_force(row, entry, data, summary) for row, entry in zip(series, forces, strict=True)]


@dataclass(frozen=True)
class Function:
    """A data set 58 with its abscissa and ordinate."""

    of: DataSet
    x: FloatArray
    y: Samples


def read_functions(data: bytes, summary: Summary) -> list[Function]:
    """Every function of time or frequency of a universal file, whatever the points and quantities.

    InputError: no data set 58, a broken one, or none that is such a function.
    """
    data = _as_lines(data)
    sets, _ = find_sets(data)
    taken, entries = [], [entry for entry in sets if entry.function in (*_TAKEN, 5)]
    if not entries:
        raise InputError(f"no data set is a response: the first is {_describe_unfit(sets[0])}", expected=_EXPECTED)
    for entry in entries:
        x, y = values(data, entry)
        taken.append(Function(entry, _abscissa(x, entry, summary), y))
    return taken


def _as_lines(data: bytes) -> bytes:
    """The file with line feeds in place of carriage returns, if it has no line feeds."""
    return data if b"\n" in data else data.replace(b"\r", b"\n")


def _summarise(sets: list[DataSet], others: list[int], summary: Summary) -> None:
    for entry in sets[:_MOST_LISTED]:
        quantity = f"{entry.quantity or 'unknown quantity'}{f' per {entry.per}' if entry.per else ''}"
        what = _FUNCTIONS.get(entry.function, f"function type {entry.function}")
        form = "text" if entry.form is None else "binary"
        title = f", {describe_shortened(entry.title, 40)!r}" if entry.title else ""
        text = f"{what}, {quantity}, {entry.points} points ({form}), {entry.place}{title}"
        summary.add(f"data set {entry.number}", text, "found in the file")
    if len(sets) > _MOST_LISTED:
        summary.note(f"{len(sets)} data sets 58; the first {_MOST_LISTED} are listed")
    if others:
        summary.note(f"data sets {', '.join(map(str, others))} are skipped")


def _list_chosen(sets: list[DataSet], datasets: tuple[int, ...]) -> list[DataSet]:
    """The requested data sets, or all functions of time or frequency that are motions or forces."""
    bad = next((number for number in datasets if not 1 <= number <= len(sets)), None)
    if bad is not None:
        raise InputError(f"no data set {bad}", expected=f"numbers from 1 to {len(sets)}")
    chosen = [sets[number - 1] for number in datasets] if datasets else [s for s in sets if s.function in _TAKEN]
    unfit = {entry.number: problem for entry in chosen if (problem := _describe_unfit(entry))}
    first = next((f"data set {number} is {problem}" for number, problem in unfit.items()), "")
    if unfit and datasets:
        raise InputError(first, line=sets[next(iter(unfit)) - 1].line, expected=_EXPECTED)
    chosen = [entry for entry in chosen if entry.number not in unfit]
    if all(entry.is_force for entry in chosen):
        raise InputError(f"no data set is a response{': ' if first else ''}{first}", expected=_EXPECTED)
    has_ratio = any(entry.function == 4 for entry in chosen)
    if has_ratio and not datasets:  # spectra of responses repeat their frequency responses
        chosen = [entry for entry in chosen if entry.function == 4 or (entry.is_force and not entry.is_time)]
    if len({entry.is_time for entry in chosen}) > 1:
        raise InputError("both time histories and spectra", expected="--dataset numbers of one kind")
    return chosen


_EXPECTED = "a frequency response (type 4), spectrum (12), general function (0) or time response (1) of a motion"


def _describe_unfit(entry: DataSet) -> str:
    """Why a data set is neither a response nor a force; '' if it is one."""
    if entry.function not in _TAKEN:
        return _FUNCTIONS.get(entry.function, f"of function type {entry.function}")
    if entry.function == 4 and (entry.quantity == "force" or entry.per not in ("", "force")):
        return f"a ratio of {entry.quantity or 'unknown'} to {entry.per or 'unknown'}"
    if entry.function == 4 and entry.ordinate in (2, 4):
        return "a frequency response of real values, whose phase is lost"
    if entry.is_time and entry.ordinate in (5, 6):
        return "a time history of complex values"
    if not entry.is_time and entry.function != 4 and entry.abscissa.code not in (FREQUENCY, 0):
        return f"a function of abscissa type {entry.abscissa.code}"
    if entry.function == 0 and entry.abscissa.code == 0:
        return "a function whose abscissa is neither said to be frequency nor time"
    return ""


def _require_one_point(responses: list[DataSet], datasets: tuple[int, ...]) -> None:
    """Raise InputError for too many responses, or for several points without a choice of data sets."""
    if len(responses) > MOST_SWEEPS:
        expected = f"--dataset numbers of at most {MOST_SWEEPS}"
        raise InputError(f"{len(responses)} responses", expected=expected)
    points = list(dict.fromkeys(response.place for response in responses))
    if len(points) > 1 and not datasets:
        expected = "--dataset numbers of the sweeps of one point, or damping campaign for all"
        raise InputError(f"responses at {len(points)} points ({points[0]}; {points[1]}; ...)", expected=expected)


def _series(entry: DataSet, data: bytes, summary: Summary) -> Series:
    """The series of a response, or of a force as if it were a response."""
    x, y = values(data, entry)
    response = entry.quantity
    if entry.function == 4:
        response = _PER_FORCE.get(entry.quantity, "") if entry.per == "force" else ""
    return Series(
        label=entry.title or f"set {entry.number}",
        abscissa=_abscissa(x, entry, summary),
        response=y,
        is_time=entry.is_time,
        has_phase=bool(np.iscomplexobj(y)),
        facts=FileFacts(
            response or None,
            per_force=entry.function == 4,
            scaling="peak" if PEAK in entry.notes else None,
            units=_units(entry, summary),
            remarks=(entry.title, *entry.notes),
        ),
    )


def _with_force(row: Series, entry: DataSet, data: bytes, summary: Summary) -> Series:
    """A response with its force, which must have the same abscissas."""
    force = _series(entry, data, summary)
    x = force.abscissa
    if len(x) != len(row.abscissa) or not np.allclose(x, row.abscissa, rtol=1e-4, atol=0.0):
        message = f"the force of data set {entry.number} is at other abscissas than response {row.label!r}"
        raise InputError(message, line=entry.line, expected="the same frequencies")
    of_force = {"force": force.facts.units["force"]} if "force" in force.facts.units else {}
    return replace(row, force=force.response, facts=replace(row.facts, units={**row.facts.units, **of_force}))


_PER_TIME = {"displacement": "", "velocity": "/s", "acceleration": "/s^2"}
_FREQUENCIES = ABSCISSAS["frequency"] | {"": 1.0, "hertz": 1.0, "rad/sec": ABSCISSAS["frequency"]["rad/s"]}


def _abscissa(x: FloatArray, entry: DataSet, summary: Summary) -> FloatArray:
    """Abscissa in Hz or s."""
    label = entry.abscissa.unit
    source = "found in the file" if label else "of the format"
    if entry.is_time:
        time = unit(label or "s", what="unit of time")
        if time.powers != (0, 0, 1):
            raise InputError(f"time in {label!r}", expected="a unit of time")
        summary.add("time", time.text, source)
        return x * time.factor
    if label.lower() not in _FREQUENCIES:
        raise InputError(f"frequency in {label!r}", expected=f"one of {', '.join(filter(None, _FREQUENCIES))}")
    summary.add("frequency", label or "Hz", source)
    return x * _FREQUENCIES[label.lower()]


def _units(entry: DataSet, summary: Summary) -> dict[str, str]:
    """Units of response and force from their labels, else from the units code of data set 164."""
    texts = {}
    refuse_decibels(f"data set {entry.number}", entry.numerator.unit)
    if entry.numerator.unit:
        texts["force" if (entry.quantity == "force" and not entry.per) else "response"] = entry.numerator.unit
    if entry.function == 4 and entry.denominator.unit:
        texts["force"] = entry.denominator.unit
    code = entry.units_code
    if str(code) in NAMES["uff"]["units"]:
        length, force = NAMES["uff"]["units"][str(code)]
        if entry.quantity in _PER_TIME and "response" not in texts:
            texts["response"] = length + _PER_TIME[entry.quantity]
            summary.note(f"units code {code} of data set 164 gives {length} and {force}")
        if "force" in (entry.quantity, entry.per):
            texts.setdefault("force", force)
    elif code:
        summary.note(f"units code {code} of data set 164 is not used: it names no units")
    return texts
