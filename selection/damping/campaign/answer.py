"""Results of a campaign as objects and as the form ``campaign/1``: modes, their levels, the peak of each sensor."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from math import hypot
from typing import Any

import numpy as np

from damping.campaign.values import At, Bounds, Notch, Outcome, Response
from damping.extrapolation import Extrapolation, predict_record
from damping.extrapolation.curve import Curve
from damping.extrapolation.prepared import PreparedRecord, prepare_record
from damping.formats.series import Summary
from damping.ranking import weigh_laws
from damping.ranking.candidates import candidate_laws
from damping.records import audit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.view import Finding

LEVEL = 0.9  #: content of the bands of a campaign
NORMAL_90 = 1.645  #: half of a 90 % band in standard deviations
LEAST_SPREAD = 0.01  #: least relative standard uncertainty of a damping ratio, by noise of the drive and calibration


@dataclass(frozen=True)
class ModeAnswer:
    """A mode with its record and its levels."""

    law: str  #: first in the ranking on every row
    places: tuple[At, ...]
    left_out: dict[str, str]
    record: Record
    mode: Mode
    design_forces: tuple[float, ...]
    notches: tuple[Notch, ...] = ()
    level_caution: str = ""  #: caution on levels that lie apart from the others
    laws: tuple[tuple[str, float], ...] = ()  #: those that predictions average, with their weights on the resonances
    shape_caution: str = ""  #: on sensors whose share of the motion changes with the level

    @property
    def name(self) -> str:
        """Name of the mode."""
        return self.mode.name

    @property
    def frequency(self) -> float:
        """Frequency at the lowest tested level, Hz; for swept rows that of their steady states."""
        tested = {at.level: at.frequency for at in self.places if at.tested}
        return tested[min(tested)] if tested else self.mode.frequency

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings of the audit of the record."""
        return audit(self.record, self.mode).findings


@dataclass(frozen=True)
class PredictedMode:
    """A mode with its record, ``prepared``, and what the laws of its levels predict; ``law``: see `ModeAnswer`."""

    record: Record
    mode: Mode
    prepared: PreparedRecord
    predicted: Extrapolation
    law: str

    def cautions(self, row: Sequence[str] = ()) -> tuple[str, ...]:
        """Notes on preparation, the caution on levels that lie apart unless it is in the ``row``, and the row's own."""
        apart = self.predicted.plan.fit.level_caution
        known = not apart or any(apart in caution for caution in row)
        return (*self.prepared.notes, *([] if known else [apart]), *row)

    def answer(self, places: Sequence[At], left_out: dict[str, str], forces: Sequence[float]) -> ModeAnswer:
        """The mode at its ``places``; ``forces``: modal, of the design levels."""
        plan, laws = self.predicted.plan, tuple((law.name, law.weight) for law in self.predicted.plan.laws)
        fields = (left_out, self.record, self.mode, tuple(forces), (), plan.fit.level_caution, laws)
        return ModeAnswer(self.law, tuple(places), *fields)


def predict_mode(record: Record, mode: Mode, forces: Sequence[float], seed: int) -> PredictedMode:
    """Amplitude at phase resonance at each modal force, averaged over laws with the draws of their evidence.

    AnalysisError: the levels do not allow a prediction.
    """
    prepared = prepare_record(record, mode, audit(record, mode))
    predicted = predict_record(prepared, np.array(forces, dtype=float), (), LEVEL, seed, fresh=False)
    law = weigh_laws(prepared.all_rows, seed, candidate_laws()).candidates[0].name
    return PredictedMode(record, mode, prepared, predicted, law)


def bound_ratio(ratio: float, sd: float) -> Bounds:
    """The band of a measured damping ratio of relative standard error ``sd``."""
    return Bounds.about(ratio, NORMAL_90 * hypot(sd, LEAST_SPREAD))


def predict_at(
    curve: Curve, row: int, level: float, cautions: tuple[str, ...], response: tuple[Response, ...] = ()
) -> At:
    """A design level by a row of the curve, with standard errors as of a normal; without a band no damping is known."""
    f, zeta = curve.frequency.form(row), curve.damping_ratio.form(row)
    if not np.isfinite([f["median"], *zeta.values()]).all():
        return At(level, False, f["median"], None, response, cautions)
    errors = ((band["high"] - band["low"]) / (2.0 * NORMAL_90) for band in (f, zeta))
    return At(level, False, f["median"], Bounds(**zeta), response, cautions, None, *errors)


@dataclass(frozen=True)
class Campaign:
    """All modes, the levels and their unit, the summary of the files, and the comparison with an earlier campaign."""

    modes: tuple[ModeAnswer, ...]
    levels: tuple[float, ...]
    design: tuple[float, ...]
    unit: str
    summary: Summary = field(default_factory=Summary)
    outcomes: tuple[Outcome, ...] = ()
    changes: tuple[str, ...] = ()
    level_name: str = "amplitude"  #: quantity of a level
    #: Time in s by which all sensors lag the drive, removed from the motions, and its standard error; None: none.
    delay: tuple[float, float] | None = None

    @property
    def tested(self) -> tuple[int, int]:
        """The fewest and the most levels that a mode was tested at: free decays give each mode levels of its own."""
        numbers = [sum(at.tested for at in mode.places) for mode in self.modes]
        return min(numbers, default=0), max(numbers, default=0)

    @property
    def is_driven(self) -> bool:
        """Whether levels are of an input; in free decays, which have none, of an amplitude."""
        return self.level_name != "amplitude"

    @property
    def input_name(self) -> str:
        """The quantity of levels at a mode."""
        return "input at the mode" if self.is_driven else "amplitude of the sensor that moves most"

    def to_json(self) -> dict[str, Any]:
        """The form ``campaign/1``."""
        return {
            "format": "campaign/1",
            "modes": [_mode_form(mode) for mode in self.modes],
            "levels": list(self.levels),
            "design": list(self.design),
            "level_name": self.level_name,
            "level_unit": self.unit,
            "delay": dict(zip(("seconds", "error"), self.delay, strict=True)) if self.delay else None,
            "audit": [finding.to_json() | {"mode": mode.name} for mode in self.modes for finding in mode.findings],
            "outcomes": [asdict(row) | {"above_db": row.above_db, "held": row.held} for row in self.outcomes],
            "changes": list(self.changes),
            "understood": self.summary.table.to_dict(orient="records"),
            "notes": list(self.summary.notes),
        }


def _band(band: Bounds | None) -> dict[str, Any]:
    return dict.fromkeys(Bounds._fields) if band is None else band._asdict()


def _mode_form(mode: ModeAnswer) -> dict[str, Any]:
    lowest = min((at for at in mode.places if at.tested), key=lambda at: at.level)
    return {
        "name": mode.name,
        "frequency": mode.frequency,
        "damping_ratio": _band(lowest.ratio),
        "law": mode.law,
        "laws": [{"name": name, "weight": weight} for name, weight in mode.laws],
        "sensors_left_out": list(mode.left_out),
        "why_left_out": dict(mode.left_out),
        "notches": [asdict(notch) for notch in mode.notches],
        "at": [
            {
                "level": at.level,
                "tested": at.tested,
                "input": at.input,
                "frequency": at.frequency,
                "frequency_error": at.frequency_error,
                "damping_ratio": _band(at.ratio),
                "damping_ratio_error": at.ratio_error,
                "response": [
                    {"sensor": response.sensor, "quantity": response.quantity, "unit": response.unit}
                    | _band(response.band)
                    for response in at.response
                ],
                "cautions": list(at.cautions),
            }
            for at in mode.places
        ],
    }
