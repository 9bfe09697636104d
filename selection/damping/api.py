"""The shortest way from a record to an answer: functions that give results; ``import damping``."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import pandas as pd

from damping.extrapolation import sample_members
from damping.extrapolation.near import near_resonance
from damping.extrapolation.plan import load_candidates, plan_loads
from damping.extrapolation.prediction import predict
from damping.infer.observations import observe
from damping.ranking import rank_laws
from damping.records.audit import Audit, audit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.report.tables import candidates_table, loads_table

#: Seed of everything sampled, that of the command line.
SEED = 1970


def check(record: Record, mode: Mode | None = None) -> Audit:
    """Whether a record is what it seems to be, beside the mode that simulates it: what ``damping check`` says."""
    return audit(record, mode)


def rank(record: Record, seed: int = SEED, *, despite: Collection[str] = ()) -> pd.DataFrame:
    """Every candidate damping law of a record, best first, as ``damping rank`` lists them.

    Returns:
        a row a law: ``rank, law, weight, score, held_out_error, average_absolute_percent, ..., cautions``; errors in
        per cent of resonant amplitude.

    Args:
        despite: checks of the audit whose refusal is passed over.

    Raises:
        Refused: the record cannot be what it seems.
        AnalysisError: no candidate could be fitted.
    """
    audit(record).require(despite)
    return candidates_table(rank_laws(observe(record), seed))


def extrapolate(
    record: Record,
    mode: Mode,
    forces: Sequence[float],
    level: float = 0.9,
    seed: int = SEED,
    *,
    despite: Collection[str] = (),
) -> pd.DataFrame:
    """Resonant amplitude at each force, as ``damping extrapolate`` predicts it.

    Args:
        level: content of the bands.
        despite: checks of the audit whose refusal is passed over.

    Returns:
        a row a force: ``force, extrapolation_ratio, median``, predictive ``low, high``, ``credible_low,
        credible_high, linear``, and by how many per cent linear exceeds the median, ``overprediction``; in the units
        of the record. NaN where no prediction is given; ``cautions`` says why.

    Raises:
        Refused: the record cannot be what it seems.
        AnalysisError: the levels do not allow a prediction.
    """
    audit(record, mode).require(despite)
    asked = np.array(forces, dtype=float)
    data = near_resonance(record)
    plan = plan_loads(data, load_candidates(data), seed, mass=mode.mass)
    members = sample_members(plan, asked, seed)
    return loads_table(predict(members, asked, data, level, seed, plan, mode.repeatability.amplitude or 0.0))
