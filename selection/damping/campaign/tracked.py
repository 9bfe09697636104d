"""A file of a campaign: time histories, also as a table, to a tracked run or a free decay."""

import io
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from damping.arrays import STANDARD_GRAVITY_M_S2, FloatArray
from damping.campaign.runs import (
    LABEL_AGREES,
    CampaignRun,
    Channel,
    Corrections,
    NamedUnit,
    describe_quantity,
    split_ratio,
)
from damping.errors import AnalysisError, InputError
from damping.formats.cells import DELIMITERS
from damping.formats.columns import Layout, TextTable, open_table
from damping.formats.headers import ROLE_NAMES, SCALING_WITHIN, ColumnHeader, find_abscissa_factor, lower_name
from damping.formats.levels import find_level
from damping.formats.quantity import unit
from damping.formats.series import Samples, Stated, Summary, require_finite
from damping.records.check_ceiling import Limits, find_ceiling, find_limit
from damping.records.text import count, describe_cell, describe_shortened, read_bytes
from damping.signals.histories import track_sine
from damping.signals.windows import UNEVEN, describe_uneven


@dataclass(frozen=True)
class Source:
    """A file: at most ``most`` bytes are read at once, ``stated`` holds the corrections.

    ``facts`` holds columns and units of tables. Notes are added to ``summary``, names of all channels to ``channels``.
    """

    file: Path
    most: int
    stated: Corrections
    summary: Summary
    channels: set[str]
    facts: Stated

    def make_channel(self, name: str, text: str, samples: Samples, quantity: str = "", **known: Any) -> Channel | None:
        """A channel of the unit ``text``, corrected as stated; None if stated to be out.

        A stated unit defines the quantity too; else it is ``quantity``, or follows from the unit. ``known``: further
        fields. InputError: the unit is not one of motion, or samples are not finite numbers.
        """
        self.channels.add(name)
        stated = self.stated.of(name)
        if stated.role == "out":
            return None
        own = self.find_unit(name, "response", "")
        ratio = split_ratio(own, "") if known.get("per_drive") else None
        own = ratio[0] if ratio else own
        text = own or text.replace("m/s2", "m/s^2")
        quantity = describe_quantity(text, name) if own or not quantity else quantity
        require_finite(name, samples)
        return Channel(name, quantity, text, samples, **known).scaled(stated.scale)

    def find_unit(self, name: str, what: str, text: str) -> str:
        """The unit of a channel: as stated for it, else for all (``what``: response or force), else ``text``."""
        return (self.stated.of(name).unit or self.facts.units.get(what) or text).replace("m/s2", "m/s^2")

    def refuse_columns(self) -> None:
        """Raise InputError for columns stated for a file that is no table of steady states."""
        if self.facts.columns:
            expected = "none: roles of channels are stated in --correct FILE.toml"
            raise InputError("--column of a file that is no table against frequency", expected=expected)

    def note_scaling(self, texts: Iterable[str]) -> None:
        """Note a caution on each scaling in names or ID lines of spectra: amplitudes are not converted."""
        said = ((match, text) for text in texts for match in SCALING_WITHIN.finditer(text) if not match["peak"])
        for word, text in {match[0].lower(): text for match, text in said}.items():
            taken = "amplitudes are taken as peak values of the sine"
            both = f"if drive and sensors are both {word}, so are levels and peaks"
            self.summary.note(f"caution: {self.file.name} says {describe_shortened(text)!r}: {taken}; {both}")

    def set_level(self, run: CampaignRun, label: str) -> CampaignRun:
        """The run with its level: that of the label if the control agrees, else the median of the control.

        If the label is in g and the control reads that level in m/s^2, the file has SI values labelled g, as universal
        files may: values of every channel in g are then divided by g.
        """
        assert run.drive is not None
        stated, measured = find_level(label.replace("_", " ")), float(np.median(np.abs(run.drive)))
        if not measured > 0.0:
            raise InputError(f"the drive of {run.label!r} is zero", expected="a control above 0")
        if stated is None or not stated[0] > 0.0 or unit(stated[1]).powers != unit(run.drive_unit).powers:
            return replace(run, level=measured)
        level = stated[0] * unit(stated[1]).factor / unit(run.drive_unit).factor
        control = f"the control of {run.label!r}"
        if abs(measured / level - 1.0) <= LABEL_AGREES:
            return replace(run, level=level)
        g = STANDARD_GRAVITY_M_S2
        if run.drive_unit == "g" and abs(measured / level / g - 1.0) <= LABEL_AGREES:
            said = f"values labelled g are in m/s^2 (according to {control}) and read as such"
            self.summary.note(f"{self.file.name}: {said}")
            channels = (channel.scaled(1.0 / g) if channel.unit == "g" else channel for channel in run.channels)
            return replace(run, level=level, drive=run.drive / g, channels=tuple(channels))
        self.summary.note(f"{self.file.name}: {control} reads {measured:.3g} {run.drive_unit}, taken as its level")
        return replace(run, level=measured)

    def track(
        self, label: str, units: Sequence[NamedUnit], drive: str, step: float, blocks: Iterable[FloatArray]
    ) -> CampaignRun:
        """The run of blocks of samples (channels, n) tracked by the channel named ``drive``."""
        stated, place, limits = self.stated.of(drive), [name for name, _ in units].index(drive), Limits()
        self.channels.add(drive)
        text = self.find_unit(drive, "force", units[place][1])
        self._require_unit("the drive", drive, text, "force [N]", "force=N")
        self.require_units([pair for pair in units if pair[0] != drive])
        try:
            tracked = track_sine(limits.watch(blocks), place, step)
        except AnalysisError as error:
            raise AnalysisError(f"{self.file}, run {label}: {error}") from error
        order = np.argsort(tracked.frequency, kind="stable")
        others = [*units[:place], *units[place + 1 :]]
        sensors = [
            self.make_channel(name, text, values[order], third=third[order])
            for (name, text), values, third in zip(others, tracked.response, tracked.third, strict=True)
        ]
        size = tracked.drive[order].astype(complex) * stated.scale
        channels = tuple(filter(None, sensors))
        run = CampaignRun(label, None, text, tracked.frequency[order], size, channels, rate=tracked.rate[order])
        named = zip((name for name, _ in units), limits.found, strict=True)
        return self.set_level(self.leave_clipped(dict(named), run), label)

    def require_units(self, units: Iterable[NamedUnit]) -> None:
        """Raise InputError for the first sensor without a unit, in the file or stated, that is not to be left out."""
        for name, text in units:
            if self.stated.of(name).role != "out":
                self._require_unit(
                    "a sensor", name, self.find_unit(name, "response", text), "tip [m/s^2]", "response=m/s^2"
                )

    def _require_unit(self, what: str, name: str, text: str, such: str, option: str) -> None:
        if not text:
            expected = f"a unit in its header, such as {such}, in --unit {option} or in --correct FILE.toml"
            raise InputError(f"{what} has no unit", file=self.file, column=name, expected=expected)

    def make_decay(
        self, label: str, t: FloatArray, units: Sequence[NamedUnit], samples: Sequence[FloatArray]
    ) -> CampaignRun:
        """The run of motions against time without a drive: a free decay. InputError: times that do not rise."""
        find_step(label, t)
        sensors = [self.make_channel(name, text, x) for (name, text), x in zip(units, samples, strict=True)]
        limits = {name: find_limit(x) for (name, _), x in zip(units, samples, strict=True)}
        run = CampaignRun(label, None, "", t, None, tuple(filter(None, sensors)))
        return self.leave_clipped(limits, run)

    def leave_flat(self, run: CampaignRun) -> CampaignRun:
        """The run of spectra without sensors whose amplitudes stand at a ceiling under a steady drive."""
        assert run.drive is not None
        require_finite(f"drive of {run.label}", run.drive)
        drive, of = np.abs(run.drive), run.channels
        limits = {one.name: find_ceiling(np.abs(one.samples), drive, per_force=one.per_drive) for one in of}
        return self.leave_clipped(limits, run)

    def leave_clipped(self, limits: Mapping[str, float | None], run: CampaignRun) -> CampaignRun:
        """The run without sensors that stand at a limit (None: no limit), except those with the stated role sensor.

        InputError: no sensor is left.
        """
        clipped = [name for name in run.names if limits.get(name) is not None and self.stated.of(name).role != "sensor"]
        why = {name: f"clipped: it stays at {limits[name]:.4g} in {run.label!r}" for name in clipped}
        for name, text in why.items():
            self.summary.note(f"{name!r} is {text} (--correct leaves that run out instead, or states role = 'sensor')")
        if clipped and len(clipped) == len(run.names):
            expected = "a run within the range of its sensors"
            raise InputError(f"every sensor of {run.label!r} is clipped", expected=expected)
        return replace(run.without(clipped), left_out=why)


def find_step(label: str, t: FloatArray) -> float:
    """Mean step of times (n,), s. InputError: a single one, or times that do not rise."""
    step = float(t[-1] - t[0]) / max(len(t) - 1, 1)
    if not step > 0.0:
        expected = "two samples or more, at rising times"
        raise InputError(f"{label}: {count(len(t), 'sample')} from {t[0]:g} to {t[-1]:g} s", expected=expected)
    return step


BLOCK = 8_000_000  #: characters of a table that are read together


def is_of_time(headers: Sequence[ColumnHeader]) -> bool:
    """Whether a table is of motions against time: it has a time beside them, and no frequency."""
    names = [header.name.lower() for header in headers if header.text]
    frequencies = {*ROLE_NAMES["frequency"], *ROLE_NAMES["omega"]}
    has_frequency = any(lower_name(header.name) in frequencies for header in headers)
    return not has_frequency and len(names) > 1 and bool(set(ROLE_NAMES["time"]) & set(names))


def read_table(source: Source, start: TextTable) -> CampaignRun:
    """The run of a table of motions against time: tracked if a column is the drive, else a free decay.

    ``start``: the beginning of the table, with its headers.
    """
    source.refuse_columns()
    headers = start.headers
    time = next(k for k, header in enumerate(headers) if header.name.lower() in ROLE_NAMES["time"])
    columns = [k for k, header in enumerate(headers) if header.text and k != time]
    units = [(headers[k].name, headers[k].unit) for k in columns]
    factor = find_abscissa_factor("time", headers[time].unit)
    drive = source.stated.choose_drive(source.file.stem, dict(units))
    if drive:
        blocks = _list_table_blocks(source, start.layout, [time, *columns])
        return _track_table(source, units, drive, factor, blocks)
    whole = open_table(read_bytes(source.file, source.most))
    numbers, _ = whole.read({"time": time} | {str(k): k for k in columns})
    return source.make_decay(source.file.stem, numbers["time"] * factor, units, [numbers[str(k)] for k in columns])


def _track_table(
    source: Source, units: Sequence[NamedUnit], drive: str, factor: float, blocks: Iterator[FloatArray]
) -> CampaignRun:
    """The run of a table of time and channels with their ``units``; ``factor``: one unit of time in s.

    InputError for cells that are not numbers, or uneven times.
    """
    first = next(blocks, None)
    if first is None or first.shape[1] < 2:
        raise InputError("no samples", expected="rows of time, drive and responses")
    step = float(first[0, -1] - first[0, 0]) / (first.shape[1] - 1) * factor

    def samples() -> Iterator[FloatArray]:
        start = float(first[0, 0]) * factor
        for block in chain([first], blocks):
            t = block[0] * factor
            off = np.max(np.abs(t - (start + step * np.arange(len(t)))))
            if not step > 0.0 or not off <= max(UNEVEN * step, 1e-6 * float(np.max(np.abs(t)))):
                raise InputError(describe_uneven(np.append(start - step, t)), expected="one step throughout, rising")
            start = float(block[0, -1]) * factor + step
            yield block[1:]

    return source.track(source.file.stem, units, drive, step, samples())


def _list_table_blocks(source: Source, layout: Layout, columns: Sequence[int]) -> Iterator[FloatArray]:
    """Columns (columns, n) of a table, block by block."""
    delimiter = DELIMITERS[layout.delimiter]
    with source.file.open(encoding=layout.encoding or "utf-8", errors="replace") as stream:
        for _ in range(layout.header):
            stream.readline(BLOCK)
        line = layout.header
        while block := stream.read(BLOCK):
            rest = stream.readline(BLOCK)
            if len(rest) == BLOCK:
                expected = "rows of time, drive and responses"
                raise InputError(f"a line of more than {BLOCK} characters", expected=expected)
            block += rest
            text = block.replace(",", ".") if layout.decimal == "comma" else block
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)  # a block of blank lines or comments has no rows
                    table = np.loadtxt(
                        io.BytesIO(text.encode()),
                        delimiter=None if delimiter == " " else delimiter,
                        usecols=columns,
                        ndmin=2,
                        comments=["#", "%"] if layout.comments else None,
                    )
                if not np.isfinite(table).all():
                    raise ValueError("values that are no numbers")
            except ValueError as error:
                expected = f"numbers in every row from line {line + 1} on"
                whole = InputError(describe_shortened(str(error), 100), expected=expected)
                raise _find_cell(text, delimiter, columns, line, expected) or whole from None
            line += block.count("\n")
            if table.size:
                yield table.T


def _find_cell(text: str, delimiter: str, columns: Sequence[int], above: int, expected: str) -> InputError | None:
    """The error on the first cell of some rows that is not a number; ``above``: number of lines before the rows."""
    for number, row in enumerate(text.splitlines(), above + 1):
        cells = row.split(None if delimiter == " " else delimiter)
        if not row.strip() or row.lstrip()[0] in "#%":
            continue
        for column in columns:
            cell = cells[column].strip() if column < len(cells) else ""
            try:
                known = isfinite(float(cell))
            except ValueError:
                known = False
            if not known:
                return InputError(describe_cell(cell), line=number, column=str(column + 1), expected=expected)
    return None
