"""Predictions of a mode beyond its levels, and back from the modal amplitude to every sensor.

The one place that asks the chain of ``damping.extrapolation``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from damping.extrapolation import draw_evidence, extrapolate_loads
from damping.extrapolation.near import near_resonance
from damping.extrapolation.prediction import Loads
from damping.predict.sweep_rate import as_steady
from damping.records.mode import Mode
from damping.records.record import Record

#: Content of the bands of a campaign.
LEVEL = 0.9


def modal_loads(record: Record, mode: Mode, forces: Sequence[float], seed: int) -> tuple[Loads, str, tuple[str, ...]]:
    """Amplitude at phase resonance at each modal force, averaged over laws on the draws of their evidence.

    Also the name of the law with the largest weight, and what was done about the sweep rate.

    Raises:
        AnalysisError: the levels do not allow a prediction.
    """
    asked = np.array(forces, dtype=float)
    steady, swept = as_steady(record, mode.mass, mode.frequency)
    data = near_resonance(steady)
    predicted = extrapolate_loads(data, asked, LEVEL, seed, mode=mode, sampler=draw_evidence)
    return predicted.loads, max(predicted.plan.laws, key=lambda law: law.weight).name, tuple(swept)
