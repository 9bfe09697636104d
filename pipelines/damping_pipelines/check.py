"""``damping check``: is a record what it seems to be (form ``audit/1``), and the same question before every command."""

from __future__ import annotations

import sys
from collections.abc import Collection
from pathlib import Path

import typer

from damping.records.audit import Audit, audit
from damping.records.mode import Mode, Units, read_mode
from damping.records.reading import read_record
from damping.records.record import Record
from damping_pipelines.store import refuse_inputs, write_json
from damping_pipelines.terminal import console, number, plain_table


def check(record: Path, mode: Path | None, json_out: str | None, max_size: int) -> None:
    """Audit a record, print findings and what its sweeps imply, write the form; exit 1 where a finding refuses."""
    refuse_inputs("--json", json_out, record, *([mode] if mode else []))
    found = audit(read_record(record, max_size=max_size), None if mode is None else read_mode(mode, max_size=max_size))
    if json_out is not None:
        write_json(json_out, found.to_json())
    if json_out != "-":
        _print(found, None if mode is None else read_mode(mode, max_size=max_size))
    if found.verdict == "refuse":
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


def _print(found: Audit, mode: Mode | None) -> None:
    out = console()
    out.print(str(found))
    units = mode.units if mode else Units()
    named = (("force", units.force), ("amplitude", units.length))
    measured = (f"{what} [{unit}]" if unit else what for what, unit in named)
    headings = ("frequency [Hz]", *measured, "mass", "damping ratio", "phase offset [rad]")
    table = plain_table("What each sweep implies at its resonance", headings, ("sweep",))
    for row in found.implied.to_dict(orient="records"):
        numbers = ("frequency", "force", "amplitude", "mass", "damping_ratio", "phase_offset")
        table.add_row(str(row["sweep"]), *(number(float(row[name])) for name in numbers))
    out.print(table)
