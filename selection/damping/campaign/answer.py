"""The answer of a campaign as objects and as the form ``campaign/1``: modes, their levels, the peak of each sensor."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.series import Summary
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.view import Finding

FORMAT = "campaign/1"
#: Half of a 90 % band in standard deviations.
NORMAL_90 = 1.645


@dataclass(frozen=True)
class DesignLevel:
    """A design input: ``level`` (n,) in the unit of the drive over ``frequency`` (n,) Hz; one of each: everywhere."""

    frequency: FloatArray
    level: FloatArray

    def __post_init__(self) -> None:
        rising = len(self.frequency) == 1 or bool(np.all(np.diff(self.frequency) > 0.0))
        if not (rising and np.all(np.isfinite(self.level)) and np.all(self.level > 0.0) and self.frequency[0] > 0.0):
            raise InputError("--design is no level", expected="levels > 0 over rising frequencies > 0")

    @classmethod
    def flat(cls, level: float) -> DesignLevel:
        """One level at all frequencies."""
        return cls(np.array([1.0]), np.array([float(level)]))

    def at(self, frequency: float) -> float:
        """The level there, straight between the corners on logarithmic axes, flat beyond the ends."""
        corners = np.log(self.frequency), np.log(self.level)
        return float(np.exp(np.interp(np.log(frequency), *corners)))


@dataclass(frozen=True)
class Response:
    """Peak of a sensor: ``band`` is (median, low, high) in ``unit``."""

    sensor: str
    quantity: str
    unit: str
    band: tuple[float, float, float]


@dataclass(frozen=True)
class At:
    """A mode at a level; ``tested`` or a design level; bands are (median, low, high), None where there is no answer."""

    level: float
    tested: bool
    frequency: float
    ratio: tuple[float, float, float] | None
    response: tuple[Response, ...]
    cautions: tuple[str, ...]


@dataclass(frozen=True)
class ModeAnswer:
    """A mode with its record and its levels; ``law`` is the one with the largest weight, ``findings`` its audit."""

    name: str
    frequency: float
    law: str
    places: tuple[At, ...]
    left_out: dict[str, str]
    record: Record
    mode: Mode
    design_forces: tuple[float, ...]
    findings: tuple[Finding, ...] = ()
    notches: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Campaign:
    """All modes, the levels and their unit, and what was understood of the files."""

    modes: tuple[ModeAnswer, ...]
    levels: tuple[float, ...]
    design: tuple[float, ...]
    unit: str
    summary: Summary = field(default_factory=Summary)

    def to_json(self) -> dict[str, Any]:
        """The form ``campaign/1``."""
        return {
            "format": FORMAT,
            "modes": [_mode_form(mode) for mode in self.modes],
            "levels": list(self.levels),
            "design": list(self.design),
            "level_unit": self.unit,
            "audit": [
                asdict(finding) | {"sweeps": list(finding.sweeps), "mode": mode.name}
                for mode in self.modes
                for finding in mode.findings
            ],
            "understood": self.summary.table.to_dict(orient="records"),
            "notes": list(self.summary.notes),
        }

    @property
    def table(self) -> pd.DataFrame:
        """A row a mode, level and sensor."""
        rows = []
        for mode in self.modes:
            for at in mode.places:
                for one in at.response:
                    median, low, high = one.band
                    row = {"mode": mode.name, "frequency": at.frequency, "level": at.level, "tested": at.tested}
                    rows.append(
                        row | {"sensor": one.sensor, "median": median, "low": low, "high": high, "unit": one.unit}
                    )
        return pd.DataFrame(rows)


def _band(band: tuple[float, float, float] | None) -> dict[str, float | None]:
    return dict(zip(("median", "low", "high"), band or (None, None, None), strict=True))


def _mode_form(mode: ModeAnswer) -> dict[str, Any]:
    lowest = min((at for at in mode.places if at.tested), key=lambda at: at.level)
    return {
        "name": mode.name,
        "frequency": mode.frequency,
        "damping_ratio": _band(lowest.ratio),
        "law": mode.law,
        "sensors_left_out": list(mode.left_out),
        "why_left_out": dict(mode.left_out),
        "notches": [asdict(notch) for notch in mode.notches],
        "at": [
            {
                "level": at.level,
                "tested": at.tested,
                "frequency": at.frequency,
                "damping_ratio": _band(at.ratio),
                "response": [
                    {"sensor": one.sensor, "quantity": one.quantity, "unit": one.unit} | _band(one.band)
                    for one in at.response
                ],
                "cautions": list(at.cautions),
            }
            for at in mode.places
        ],
    }
