"""The shortest way from a record to an answer: two functions that give tables; ``import damping``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from damping.extrapolation import sample_members
from damping.extrapolation.near import near_resonance
from damping.extrapolation.plan import load_candidates, plan_loads
from damping.extrapolation.prediction import predict
from damping.infer.observations import observe
from damping.predict.sweep_rate import as_steady
from damping.ranking import rank_laws
from damping.records.mode import Mode
from damping.records.record import Record
from damping.report.tables import candidates_table, loads_table

#: Seed of everything sampled, that of the command line.
SEED = 1970


def rank(record: Record, seed: int = SEED) -> pd.DataFrame:
    """Every candidate damping law of a record, best first, as ``damping rank`` lists them.

    Returns:
        a row a law: ``rank, law, weight, score, held_out_error, average_absolute_percent, ..., cautions``; errors in
        per cent of resonant amplitude.

    Raises:
        AnalysisError: no candidate could be fitted.
    """
    return candidates_table(rank_laws(observe(record), seed))


def extrapolate(
    record: Record, mode: Mode, forces: Sequence[float], level: float = 0.9, seed: int = SEED
) -> pd.DataFrame:
    """Resonant amplitude at each force, as ``damping extrapolate`` predicts it.

    Args:
        level: content of the bands.

    Returns:
        a row a force: ``force, extrapolation_ratio, median``, predictive ``low, high``, ``credible_low,
        credible_high, linear``, and by how many per cent linear exceeds the median, ``overprediction``; in the units
        of the record. NaN where no prediction is given; ``cautions`` says why.

    Raises:
        AnalysisError: the levels do not allow a prediction.
    """
    asked = np.array(forces, dtype=float)
    data = near_resonance(as_steady(record, mode.mass, mode.frequency)[0])
    plan = plan_loads(data, load_candidates(data), seed, mass=mode.mass)
    members = sample_members(plan, asked, seed)
    return loads_table(predict(members, asked, data, level, seed, plan, mode.repeatability.amplitude or 0.0))
