"""``damping check``: is a record what it seems to be (also before every command); ``damping sweep``: one of a model."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection
from pathlib import Path

import numpy as np
import typer

import damping
from damping.arrays import FloatArray
from damping.errors import InputError
from damping.records import Audit, audit
from damping.records.mode import Mode, Units, read_mode
from damping.records.reading import read_record
from damping.records.record import Record, record_to_csv
from damping_pipelines.store import refuse_inputs, write_json, write_text
from damping_pipelines.terminal import PlainTable, console, number, progress

#: Rows of a record that is computed: minutes, and far more than any analysis takes.
MOST_ROWS = 100_000


def check(record: Path, mode: Path | None, json_out: str | None, max_size: int) -> None:
    """Audit a record, print findings and what its sweeps imply, write the form; exit 1 where a finding refuses."""
    refuse_inputs("--json", json_out, record, *([mode] if mode else []))
    measured = read_record(record, max_size=max_size)
    described = None if mode is None else read_mode(mode, max_size=max_size)
    findings = audit(measured, described)
    if json_out is not None:
        write_json(json_out, findings.to_json())
    if json_out != "-":
        _print_audit(findings, described)
    if findings.verdict == "refuse":
        raise typer.Exit(1)


def report_findings(record: Record, mode: Mode | None, despite: Collection[str] = ()) -> Audit:
    """The audit of a record before any work on it; its findings go to standard error.

    Raises:
        Refused: a finding refuses that is not among the checks named in ``despite``.
    """
    findings = audit(record, mode)
    findings.require(despite)
    for finding in findings.findings:
        print(f"damping: {record.source}: {finding}", file=sys.stderr)
    return findings


def _print_audit(findings: Audit, mode: Mode | None) -> None:
    out = console()
    out.print(str(findings))
    units = mode.units if mode else Units()
    named = (("force", units.force), ("amplitude", units.length))
    measured = (f"{what} [{unit}]" if unit else what for what, unit in named)
    headings = ("frequency [Hz]", *measured, "mass", "damping ratio", "phase offset [rad]")
    table = PlainTable("What each sweep implies at its resonance", headings, ("sweep",))
    for row in findings.implied.to_dict(orient="records"):
        numbers = ("frequency", "force", "amplitude", "mass", "damping_ratio", "phase_offset")
        table.add_row(str(row["sweep"]), *(number(float(row[name])) for name in numbers))
    out.print(table)


def sweep(model: Path, force: list[float], frequency: str, out: Path, direction: str, method: str) -> None:
    """Sweep the model through ``frequency`` (``LO:HI:N``, Hz) at each force and write the record ``out``.

    Raises:
        InputError: a bad option, or a model file that cannot be read.
        AnalysisError: the model has an effect that is not simulated, or no steady state somewhere in a sweep.
    """
    refuse_inputs("--out", out, model)
    hertz = _frequencies(frequency)
    if len(hertz) * len(force) > MOST_ROWS:
        raise InputError(f"{len(hertz) * len(force)} rows", expected=f"{MOST_ROWS} rows (points times forces) at most")
    swept = damping.sweep(
        read_mode(model), force=force, frequency=hertz, direction=direction, method=method, progress=progress
    )
    write_text(out, record_to_csv(swept.record))


def _frequencies(text: str) -> FloatArray:
    """LO:HI:N as N equally spaced frequencies from LO to HI, Hz."""
    expected = "LO:HI:N with 0 < LO < HI in Hz and N >= 2 points"
    parts = text.split(":")
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        raise InputError(f"--frequency {text!r} is not understood", expected=expected) from None
    if count > MOST_ROWS:
        raise InputError(f"--frequency {text!r}: {count} points", expected=f"{MOST_ROWS} points at most")
    if len(parts) != 3 or not (0.0 < low < high < math.inf and count >= 2):
        raise InputError(f"--frequency {text!r} is out of range", expected=expected)
    return np.linspace(low, high, count)
