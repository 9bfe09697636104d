"""A record prepared for ranking and prediction: steady states under a force, its rows near resonance, and notes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from damping.extrapolation.backbone import Backbone, find_backbone
from damping.infer.observations import Observations, at_resonance, observe
from damping.predict import Measured, prepare
from damping.records import Audit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.resonance import SAME_LEVEL, tabulate_resonances

#: Ratio of amplitudes from which the rows of one level show how damping changes with amplitude; a sweep at constant
#: response has less.
TELLING = 1.1
#: Rows with |cot phase| up to this are near resonance: those between the half-power points of their sweep.
NEAR = 1.0


def near_resonance(record: Record) -> Observations:
    """The phase resonance of each sweep; of a single level that shows how damping changes, every row near resonance.

    A constant phase offset changes the energy of a row by offset times cot(phase), relative. It is subtracted first
    (`without_offset`). Then rows between the half-power points are kept, |F cos(phase)| <= ``NEAR`` F sin(phase):
    beyond them the measured energy is mostly phase error. A sweep without such rows keeps that nearest to resonance.

    AnalysisError: no row carries information about damping.
    """
    data = observe(without_offset(record))
    cotangent = np.where(data.D > 0.0, data.R / np.where(data.D > 0.0, data.D, 1.0), np.inf)
    near = cotangent <= NEAR
    for run in data.runs:
        near[run[np.argmin(cotangent[run])]] = True
    data = data.take_rows(near)
    one_telling = data.levels.max() == 0 and data.A.max() > TELLING * data.A.min()
    return data if one_telling else at_resonance(data)


def describe_weights(data: Observations, rows: int) -> tuple[str, ...]:
    """That predictions rest on fewer rows than the ``rows`` of a ranking, and what one level does not show."""
    on = "resonances of the sweeps, because rows of one sweep share its error"
    on = on if len(data.A) == len(data.sweeps) else "rows between the half-power points"
    fewer = f"predictions weigh the laws on the {on}; a ranking weighs them on every row"
    return tuple(filter(None, [fewer if len(data.A) < rows else "", _describe_one_level(data, rows)]))


def _describe_one_level(data: Observations, rows: int) -> str:
    """Caution for a record of one level; empty for several.

    For structures outside the library the 90 % band of one sweep misses a quarter.
    """
    if data.levels.max() > 0:
        return ""
    sweeps = len(data.sweeps)
    of = f" ({sweeps} sweeps within {100.0 * SAME_LEVEL:g} % of one another)" if sweeps > 1 else ""
    why = ", because frequency changes too along a sweep" if rows > sweeps else ""
    return (
        f"one level{of} does not show how damping changes with amplitude{why}: do not trust the band beyond the tested "
        "force, and test a second level"
    )


def without_offset(record: Record) -> Record:
    """The record without the phase offset of each sweep (:func:`damping.records.resonance.tabulate_resonances`).

    It is unchanged if it has no phases, or recorded energies.
    """
    if not record.has_phase or "energy" in record.frame.columns:
        return record
    offset = tabulate_resonances(record).set_index("sweep")["phase_offset"]
    table = record.frame.copy()
    table["phase"] = table["phase"] - table["sweep"].astype(str).map(offset)
    return Record.trusted(table, record.source)


def observe_ranked(record: Record, findings: Audit) -> tuple[Observations, tuple[str, ...]]:
    """The rows that laws are ranked on, without a phase offset that the audit found; and notes on it."""
    freed = without_offset(record) if any(f.check == "phase-offset" for f in findings.findings) else record
    if freed is record:
        return observe(record), ()
    offset = float(np.median(record.column("phase") - freed.column("phase")))
    said = f"each sweep's constant phase offset (median {offset:.3g} rad) was removed before laws were fitted"
    return observe(freed), (said,)


@dataclass(frozen=True)
class PreparedRecord:
    """A record prepared for ranking and prediction."""

    given: tuple[Record, Mode | None]  #: record and mode as read, for the diagnosis
    measured: Measured  #: rows under a force, as swept and as steady states, and their mode
    findings: Audit  #: of the audit
    all_rows: Observations  #: the rows that laws are ranked on
    notes: tuple[str, ...]  #: sentences on what was changed

    @property
    def mode(self) -> Mode:
        """The mode under that force; it must have been given."""
        assert self.measured.mode is not None  # every prediction has a mode; a ranking may have none
        return self.measured.mode

    @cached_property
    def data(self) -> Observations:
        """Rows near resonance, by :func:`near_resonance`."""
        return near_resonance(self.measured.record)

    @cached_property
    def backbone(self) -> Backbone:
        """Resonance frequency and mass against amplitude."""
        return find_backbone(self.measured.record, self.mode)

    @property
    def notes_of_loads(self) -> tuple[str, ...]:
        """``notes``, and which rows the weights of predicted loads are based on."""
        return (*self.notes, *describe_weights(self.data, len(self.measured.record)))


def prepare_record(record: Record, mode: Mode | None, findings: Audit) -> PreparedRecord:
    """Prepare a record for ranking and prediction; ``findings``: of its audit.

    AnalysisError: no row carries information about damping.
    """
    measured = prepare(record, mode)
    all_rows, freed = observe_ranked(measured.record, findings)
    return PreparedRecord((record, mode), measured, findings, all_rows, (*measured.notes, *freed))
