"""``damping import``: a laboratory's file to a record, with a table of the facts read from it."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from rich.console import Console

from damping.errors import AnalysisError, InputError, escape_control, naming
from damping.formats import read_file
from damping.formats.motions import TimeHistory, time_histories
from damping.formats.quantity import SYSTEMS, unit
from damping.formats.series import Series, Stated, Summary
from damping.formats.steady import steady_record
from damping.records.mode import Mode, Units, read_mode
from damping.records.record import Record, record_to_csv
from damping.records.text import DEFAULT_MAX_SIZE
from damping.report import format_quantity
from damping.signals.ringdown import Decay, ring_down
from damping.signals.windows import PERIODS
from damping_pipelines.store import check_outputs, write_json, write_text
from damping_pipelines.terminal import PlainTable, console, parse_number, parse_pairs, report_findings

Part: TypeAlias = tuple[float | None, float | None]  #: start and end, s, of a decay; None: that of the file


def import_(
    file: Path,
    out: Path,
    json_out: str | None,
    max_size: int,
    despite: Collection[str],
    ring_down: bool,
    mode: Path | None,
    **options: Any,
) -> None:
    """:func:`import_file` with the statements of the command line; ``options`` are the fields of ``Stated``.

    InputError: invalid or incomplete options, and all that :func:`import_file` raises.
    """
    given = {name: options.pop(name) for name in ("periods", "levels", "start", "end")}
    window = {name: value for name, value in given.items() if value not in (None, [])}
    options["scaling"], options["force_scaling"] = scalings(options["scaling"])
    options |= {
        "columns": parse_pairs("--column", options["columns"]),
        "units": parse_pairs("--unit", options["units"]),
        "scale": scales(options["scale"]),
        "band": read_band(options["band"]),
        **{name: tuple(options[name]) for name in ("forces", "labels", "datasets")},
    }
    if not ring_down and (mode is not None or window):
        name = "mode" if mode is not None else next(iter(window))
        raise InputError(f"--{name} without --ring-down", expected="both, where the file holds free decays")
    if ring_down and mode is None:
        raise InputError("--ring-down without --mode", expected="--mode MODE.toml with the frequency and mass")
    parts = pair_parts(window.pop("start", []), window.pop("end", []))
    (start, _), (_, end) = parts[0], parts[-1]
    if ring_down and (start, end) != (None, None):
        options["span"] = (-math.inf if start is None else start, math.inf if end is None else end)
    import_file(file, out, Stated(**options), mode, json_out, max_size, despite, parts, **window)


def import_file(
    file: Path,
    out: Path,
    stated: Stated,
    mode_file: Path | None = None,
    json_out: str | None = None,
    max_size: int = DEFAULT_MAX_SIZE,
    despite: Collection[str] = (),
    parts: Sequence[Part] = ((None, None),),
    **window: Any,
) -> None:
    """Read a file, write its record and print the facts read (form ``import/1`` if requested).

    ``mode_file`` is for time histories, which are free decays of that mode, each of their ``parts`` for itself in the
    ``window`` of :func:`ring_down`; without it the file holds steady states. InputError: a file that cannot be read, or
    a fact that neither the file nor the user states. Refused: a check refuses the record and is not among ``despite``.
    AnalysisError: no usable decay.
    """
    check_outputs({"--out": out, "--json": json_out}, *filter(None, (file, mode_file)))
    series, summary = read_file(file, stated, max_size=max_size)
    mode = None
    with naming(file):
        if mode_file is not None:
            _refuse_steady(stated)
            mode = read_mode(mode_file)
            record = _decays(series, stated, mode, parts, window, file, summary)
        elif any(row.is_time for row in series):
            expected = "--ring-down --mode MODE.toml of free decays, or damping campaign where a sine drives them"
            raise InputError("the file holds time histories", expected=expected)
        else:
            record = steady_record(series, stated, file, summary)
    findings = report_findings(record, mode, despite)
    write_text(out, record_to_csv(record))
    if json_out is not None:
        form = {
            "format": "import/1",
            "record": str(out),
            "rows": len(record),
            "sweeps": list(record.sweeps),
            # ``whence``: the name of ``source`` in version 0.1.0, whose readers go on
            "understood": summary.table.assign(whence=lambda rows: rows["source"]).to_dict(orient="records"),
            "notes": summary.notes,
            "audit": findings.to_json()["findings"],
        }
        write_json(json_out, form)
    if json_out != "-":
        _print(record, summary, out, console())


def _refuse_steady(stated: Stated) -> None:
    """InputError for a statement on steady states, which would have no effect on free decays."""
    no_force, no_sine = "one of them: a free decay has no force", "one of them: a free decay is no steady sine"
    of_force = {
        "--force": stated.forces,
        "--scale force": stated.scale.get("force"),
        "--unit force": stated.units.get("force"),
        "--reverse": stated.reverse,
    }
    of_sine = {"--band": stated.band, "--scaling": stated.scaling or stated.force_scaling}
    for options, expected in ((of_force, no_force), (of_sine, no_sine)):
        for option, value in options.items():
            if value:
                raise InputError(f"{option} beside --ring-down", expected=expected)


def pair_parts(starts: Sequence[float], ends: Sequence[float]) -> list[Part]:
    """Start and end, s, of each decay in a time history; None where there is none. A decay ends where the next starts.

    InputError: not an end for each start, or parts that are empty or overlap.
    """
    if len(starts) > 1 and not ends:
        ends = starts[1:]
    elif len(ends) != max(len(starts), 1) and ends:
        expected = "as many of both, or --start alone"
        raise InputError(f"{len(starts)} times --start and {len(ends)} times --end", expected=expected)
    parts = list(zip_longest(starts, ends)) or [(None, None)]
    times = [time for part in parts for time in part if time is not None]
    wrong = [pair for pair in pairwise(times) if not pair[0] <= pair[1]]
    wrong += [(start, end) for start, end in parts if start is not None and start == end]
    for before, after in wrong[:1]:
        raise InputError(f"--start and --end: {before:g} s before {after:g} s", expected="rising, each part for itself")
    return parts


def scalings(words: Sequence[str]) -> tuple[str | None, str | None]:
    """Scaling of the response and of the force of ``--scaling``. InputError for a scaling given twice."""
    plain = [word for word in words if "=" not in word]
    named = parse_pairs("--scaling", [word for word in words if "=" in word])
    wrong = next((key for key in named if key not in ("response", "force")), None)
    if wrong or len(plain) + ("response" in named) > 1:
        raise InputError("--scaling is not understood", expected="--scaling X and --scaling force=X, each once")
    return (plain[0] if plain else named.get("response")), named.get("force")


def scales(words: Sequence[str]) -> dict[str, float]:
    """``KEY=NUMBER`` words of ``--scale``. InputError for 0 or text that is no number."""
    factors: dict[str, float] = {}
    for key, text in parse_pairs("--scale", words).items():
        factors[key] = parse_number(text)
        if not math.isfinite(factors[key]) or factors[key] == 0.0:
            raise InputError(f"--scale {key}={text} is no factor", expected="a number other than 0")
    return factors


def read_band(text: str | None) -> tuple[float, float] | None:
    """LO:HI in Hz. InputError for invalid text."""
    if text is None:
        return None
    low, _, high = text.partition(":")
    limits = (parse_number(low), parse_number(high))
    if not all(map(math.isfinite, limits)):
        raise InputError(f"--band {text!r} is not understood", expected="LO:HI in Hz")
    return limits


def _decays(
    series: list[Series],
    stated: Stated,
    mode: Mode,
    parts: Sequence[Part],
    window: Mapping[str, Any],
    file: Path,
    summary: Summary,
) -> Record:
    """The record of free decays: one sweep per level."""
    _same_system(mode, stated, summary)
    histories = time_histories(series, stated, summary)
    summary.add("mode", f"{mode.name}: {mode.frequency:g} Hz, mass {mode.mass:g}", mode.source)
    known, length = {"mass": mode.mass, "frequency": mode.frequency, **window}, mode.units.length
    tables = [table for history in histories for table in _list_levels(history, parts, known, length, file, summary)]
    table = pd.concat(tables, ignore_index=True)
    if len(histories) > 1:
        one = "take one (--column response=NAME), or all with damping campaign"
        summary.note(f"caution: {len(histories)} signals are taken as decays of one point; of several points {one}")
    if len({history.label for history in histories}) < len(histories):
        raise InputError("two time histories have one label", expected="--label of each, all different")
    return Record(table, str(file))


def _list_levels(
    history: TimeHistory, parts: Sequence[Part], known: Mapping[str, Any], length: str, file: Path, summary: Summary
) -> Iterator[pd.DataFrame]:
    """The levels of each part of a time history; ``known``: of its mode and window; ``length``: unit of amplitude."""
    free = history.list_free(2.0 * PERIODS / known["frequency"]) if parts[0] == (None, None) else []
    if (part := _choose_part(history, free)) is not None:
        parts = [part]
        summary.add(f"start of {history.label!r}", f"{part[0]:.6g} s, where the force stops", "follows")
    if len(free) > 1:
        each = " ".join(f"--start {start:.6g} --end {end:.6g}" for start, end in free)
        summary.note(f"{history.label!r}: the force stops {len(free)} times; {each} takes each")
    for k, (start, end) in enumerate(parts, 1):
        label = f"{history.label} {k}" if len(parts) > 1 else history.label
        try:
            levels = ring_down(history.t, history.signal, order=history.order, start=start, end=end, **known)
        except AnalysisError as error:
            raise AnalysisError(f"{file}: {label!r}: {error}") from error
        if history.is_driven(float(levels.time[0]), float(levels.time[-1])):
            remedy = "choose a part without it (--start, --end), or damping campaign where it is a sine"
            raise AnalysisError(f"{file}: {label!r} is no free decay: the force acts on; {remedy}")
        _summarise(label, levels, length, summary)
        yield levels.table(label)


def _choose_part(history: TimeHistory, free: Sequence[Part]) -> Part | None:
    """The first of some parts that ends after the largest motion; None if there is none."""
    if not free:  # a large file has no room for further arrays of its length
        return None
    largest = float(history.t[np.argmax(np.abs(history.signal - np.mean(history.signal)))])
    return next((part for part in free if part[1] is not None and part[1] > largest), None)


def _summarise(label: str, levels: Decay, length: str, summary: Summary) -> None:
    largest, smallest = (format_quantity(levels.amplitude[k], length, 4) for k in (0, -1))
    summary.add(
        f"decay {label!r}",
        f"{len(levels.time)} levels, amplitude {largest} to {smallest}, "
        f"{levels.frequency[0]:.5g} to {levels.frequency[-1]:.5g} Hz, "
        f"damping ratio {levels.damping_ratio[0]:.3g} to {levels.damping_ratio[-1]:.3g}",
        "follows",
    )
    for note in levels.notes:
        summary.note(f"{label!r}: {note}")


def _same_system(mode: Mode, stated: Stated, summary: Summary) -> None:
    """InputError if the units of the mode differ from those of the record, in which its mass would be wrong."""
    if stated.consistent:
        return
    names = SYSTEMS[stated.system]
    if mode.units == Units():
        of_a_rotation = f"{names[0]} {names[1]} s^2 of a rotation"
        summary.note(f"the mode names no units: its mass is taken in {names[0]} s^2/{names[1]}, or {of_a_rotation}")
        return
    own = (mode.units.force, mode.units.length)
    for name, text in zip(names, own, strict=True):
        if text and not unit(text).agrees_with(unit(name)):
            fitting = [f"--to {key}" for key, system in SYSTEMS.items() if _agree(own, system)]
            otherwise = "--consistent with every value in the units of the mode"
            expected = f"{(fitting or [otherwise])[0]}, or a mode in {name}"
            raise InputError(f"the mode is in {text} and the record in {name}", file=mode.source, expected=expected)


def _agree(texts: Sequence[str], system: Sequence[str]) -> bool:
    """Whether the named units are those of a system; one that is not named agrees."""
    return all(not text or unit(text).agrees_with(unit(name)) for text, name in zip(texts, system, strict=True))


def _print(record: Record, summary: Summary, out: Path, to: Console) -> None:
    title = f"{escape_control(Path(record.source).name)}: what was understood"
    table = PlainTable(title, (), ("what", "understood", "source"))
    for row in summary.rows:
        table.add_row(*(escape_control(cell) for cell in row))
    to.print(table)
    for note in summary.notes:
        to.print(f"- {escape_control(note)}")
    to.print(f"{len(record)} rows written to {out}")
