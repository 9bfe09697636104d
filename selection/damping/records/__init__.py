"""Records and modes: their schema, reading, checking and writing, and the resonances of a record.

This module holds the audit of a record. Each check looks for one cause that makes a readable record wrong, and reports
it in the words of a test engineer, with the remedy. One cause gives one finding: findings suppress what they explain.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass
from typing import Any

import pandas as pd

from damping.errors import InputError, Refused
from damping.records import (
    check_ceiling,
    check_copies,
    check_edges,
    check_levels,
    check_mode_file,
    check_phases,
    check_sweeps,
    check_units,
)
from damping.records.base_drive import find_participation, has_masses, shake
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.view import Finding, View

FORMAT = "audit/1"
#: Names of all checks.
NAMES = (
    "units", "phase-unit", "phase-sign", "phase-offset", "edge-of-sweep", "several-modes", "energy", "amplitude-falls",
    "outlier",
    "repeated-sweep", "mixed-levels", "sweep-rate", "beyond-model", "level-offset",
    "sensor-saturation",
)  # fmt: skip
#: Findings that noise or exchanged columns explain: all but copies.
_EVERYTHING = tuple(name for name in NAMES if name not in ("repeated-sweep", "mixed-levels"))
_OF_LEVELS = ("amplitude-falls", "level-offset", "sensor-saturation")
_OF_A_FAST_SWEEP = ("several-modes", "phase-offset", "beyond-model", "edge-of-sweep", "units", *_OF_LEVELS)
#: Every check with the checks that its finding suppresses, causes before effects: a record with force and response
#: exchanged has no resonance either, which is then not reported.
CHECKS: tuple[tuple[Callable[[View], Finding | None], tuple[str, ...]], ...] = (
    (check_units.check_exchanged_frequency, _EVERYTHING),
    (check_units.check_exchanged_response, _EVERYTHING),
    (check_edges.check_noise, _EVERYTHING),
    (check_sweeps.check_outlier, ("beyond-model",)),
    (check_copies.check_copied_rows, ("several-modes", "sensor-saturation")),
    (check_sweeps.check_unlabelled, ("beyond-model", *_OF_LEVELS)),
    (check_sweeps.check_mixed_levels, ("several-modes", "sweep-rate", *_OF_LEVELS)),
    (check_phases.check_phase_unit, ("phase-sign", "phase-offset", "energy", "beyond-model", "sweep-rate")),
    (check_phases.check_phase_sign, ("phase-offset", "energy", "sweep-rate")),
    (check_sweeps.check_sweep_rate, _OF_A_FAST_SWEEP),
    (check_sweeps.check_several_modes, ("phase-offset", "beyond-model", *_OF_LEVELS, "edge-of-sweep", "units")),
    (check_edges.check_edge, (*_OF_LEVELS, "beyond-model", "phase-offset")),
    (check_edges.check_few, ()),
    (check_edges.check_jump, ()),
    (check_edges.check_jump_up, ()),
    (check_edges.check_coarse, ()),
    (check_units.check_energy, ()),
    (check_units.check_frequency_unit, ("beyond-model", "units", *_OF_LEVELS)),
    (check_units.check_units, ("beyond-model", "units", *_OF_LEVELS)),
    (check_units.check_velocity, ()),
    (check_mode_file.check_tolerances, ()),
    (check_mode_file.check_base_unit, ()),
    (check_mode_file.check_time_unit, ()),
    (check_units.check_uncertainties, ()),
    (check_phases.check_phase_offset, ()),
    (check_copies.check_repeats, _OF_LEVELS),
    (check_levels.check_levels, ("beyond-model",)),
    (check_ceiling.check_ceiling, ()),
    (check_mode_file.check_beyond_model, ()),
)


@dataclass(frozen=True, eq=False, repr=False)
class Audit:
    """Findings of a record, refusals first, and the quantities that its sweeps imply.

    ``implied``: one row for each sweep, with ``frequency``, ``force``, ``amplitude`` at resonance, ``mass``,
    ``damping_ratio``, ``phase_offset`` (rad); NaN where a sweep does not show one. ``source``: of the record.
    """

    findings: tuple[Finding, ...]
    implied: pd.DataFrame
    source: str

    @property
    def verdict(self) -> str:
        """``ok``, ``caution`` or ``refuse``."""
        verdicts = {finding.verdict for finding in self.findings}
        return "refuse" if "refuse" in verdicts else "caution" if verdicts else "ok"

    @property
    def table(self) -> pd.DataFrame:
        """One row for each finding: ``check, verdict, what, advice, sweeps``."""
        return pd.DataFrame([asdict(finding) for finding in self.findings], columns=list(Finding.__dataclass_fields__))

    def list_findings(self) -> list[dict[str, Any]]:
        """The findings as JSON values."""
        return [finding.to_json() for finding in self.findings]

    def list_cautions(self) -> list[str]:
        """The findings beside a diagnosis, without advice on causes that it names: the advice may contradict it."""
        cautions = [str(finding).replace(" (caution):", ":", 1) for finding in self.findings]
        advice = [f"; {finding.advice}" if finding.named else "" for finding in self.findings]
        return [caution.removesuffix(end) for caution, end in zip(cautions, advice, strict=True)]

    def to_json(self) -> dict[str, Any]:
        """The form ``audit/1``; ``implied`` is an extra key."""
        implied = self.implied.astype(object).where(self.implied.notna(), None).to_dict(orient="records")
        return {"format": FORMAT, "verdict": self.verdict, "findings": self.list_findings(), "implied": implied}

    def require(self, despite: Collection[str] = (), *, diagnosed: bool = False) -> Audit:
        """The audit, unless a finding outside ``despite`` refuses the record: then Refused is raised.

        ``diagnosed``: findings that a diagnosis names do not refuse. InputError: a name in ``despite`` is not a check.
        """
        require_checks(despite)
        for finding in self.findings:
            passed = finding.check in despite or (diagnosed and finding.named)
            if finding.verdict == "refuse" and not passed:
                others = ", ".join(other.check for other in self.findings if other is not finding)
                more = f" (damping check also finds {others})" if others else ""
                raise Refused(f"{finding}, or --despite {finding.check}{more}", file=self.source)
        return self

    def __str__(self) -> str:
        return "\n".join([f"audit: {self.verdict}", *map(str, self.findings)])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        findings = self.table.assign(sweeps=[", ".join(finding.sweeps) for finding in self.findings])
        with pd.option_context("display.max_colwidth", None):
            table = findings.to_html(index=False, border=0) if self.findings else ""
        return f"<p>Audit: <b>{self.verdict}</b></p>{table}{self.implied.to_html(index=False)}"


def require_checks(names: Collection[str]) -> None:
    """Raise InputError for a name that is not a check."""
    if isinstance(names, str) or not (isinstance(names, Collection) and getattr(names, "ndim", 1) != 0):
        raise InputError(f"despite is {names!r}", expected="a list of names of checks")
    for name in names:
        if name not in NAMES:
            raise InputError(f"no check {name!r}", expected=f"one of {', '.join(NAMES)}")


def audit(record: Record, mode: Mode | None = None) -> Audit:
    """Audit a record, and the mode that simulates it if given."""
    if mode and mode.drive == "base" and has_masses(record):
        record = shake(record, mode, find_participation([(record, mode.mass, 0.0)]))
    view, findings, explained = View(record, mode), [], set()
    for check, explains in CHECKS:
        finding = check(view)
        if finding is not None and finding.check not in explained:
            findings.append(finding)
            explained |= set(explains)
    return Audit(tuple(sorted(findings, key=lambda finding: finding.verdict != "refuse")), view.implied, record.source)
