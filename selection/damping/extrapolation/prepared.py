"""A record as every answer about its laws takes it: under a force, as steady states, with what was done to it."""

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
    """A record as laws are ranked on it and predicted from it.

    Attributes:
        given: record and mode as they were read, which a diagnosis takes. measured: rows under a force, as swept and as
            steady states, and the mode of them. findings: of the audit. all_rows: those that laws are ranked on.
        notes: what was done, in words.
    """

    given: tuple[Record, Mode | None]
    measured: Measured
    findings: Audit
    all_rows: Observations
    notes: tuple[str, ...]

    @property
    def mode(self) -> Mode:
        """The mode under that force, of a record that is given one."""
        assert self.measured.mode is not None  # predictions have one; a ranking alone may not
        return self.measured.mode

    @cached_property
    def data(self) -> Observations:
        """Rows near resonance, by :func:`damping.extrapolation.near.near_resonance`."""
        return near_resonance(self.measured.record)

    @cached_property
    def backbone(self) -> Backbone:
        """Where the resonances lie."""
        return find_backbone(self.measured.record, self.mode)

    @property
    def notes_of_loads(self) -> tuple[str, ...]:
        """What was done, and what the weights of loads rest on."""
        return (*self.notes, *describe_rests(self.data, len(self.measured.record)))


def prepare_record(record: Record, mode: Mode | None, findings: Audit) -> PreparedRecord:
    """The record as laws are ranked on it and predicted from it; ``findings``: of its audit.

    Raises:
        AnalysisError: no row says anything about damping.
    """
    measured = prepare(record, mode)
    all_rows, freed = observe_ranked(measured.record, findings)
    return PreparedRecord((record, mode), measured, findings, all_rows, (*measured.notes, *freed))
