"""A record prepared for ranking and prediction: steady states under a force, with notes on what was changed."""

from dataclasses import dataclass
from functools import cached_property

from damping.extrapolation.backbone import Backbone, find_backbone
from damping.extrapolation.near import describe_rests, near_resonance, observe_ranked
from damping.infer.observations import Observations
from damping.predict import Measured, prepare
from damping.records import Audit
from damping.records.mode import Mode
from damping.records.record import Record


@dataclass(frozen=True)
class PreparedRecord:
    """A record prepared for ranking and prediction.

    Attributes:
        given: record and mode as read, for the diagnosis. measured: rows under a force, as swept and as steady states,
            and their mode. findings: of the audit. all_rows: the rows that laws are ranked on.
        notes: sentences on what was changed.
    """

    given: tuple[Record, Mode | None]
    measured: Measured
    findings: Audit
    all_rows: Observations
    notes: tuple[str, ...]

    @property
    def mode(self) -> Mode:
        """The mode under that force; it must have been given."""
        assert self.measured.mode is not None  # every prediction has a mode; a ranking may have none
        return self.measured.mode

    @cached_property
    def data(self) -> Observations:
        """Rows near resonance, by :func:`damping.extrapolation.near.near_resonance`."""
        return near_resonance(self.measured.record)

    @cached_property
    def backbone(self) -> Backbone:
        """Resonance frequency and mass against amplitude."""
        return find_backbone(self.measured.record, self.mode)

    @property
    def notes_of_loads(self) -> tuple[str, ...]:
        """``notes``, and which rows the weights of predicted loads are based on."""
        return (*self.notes, *describe_rests(self.data, len(self.measured.record)))


def prepare_record(record: Record, mode: Mode | None, findings: Audit) -> PreparedRecord:
    """Prepare a record for ranking and prediction; ``findings``: of its audit.

    Raises:
        AnalysisError: no row carries information about damping.
    """
    measured = prepare(record, mode)
    all_rows, freed = observe_ranked(measured.record, findings)
    return PreparedRecord((record, mode), measured, findings, all_rows, (*measured.notes, *freed))
