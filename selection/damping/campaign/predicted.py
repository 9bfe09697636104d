"""Predictions from the record of a mode of a campaign, and which of its levels lies apart from the others."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from damping.extrapolation import Extrapolation, extrapolate_loads
from damping.extrapolation.near import near_resonance, observe_ranked
from damping.infer.observations import Observations
from damping.predict import prepare
from damping.records import audit
from damping.records.mode import Mode
from damping.records.record import Record

LEVEL = 0.9  #: content of the bands of a campaign


@dataclass(frozen=True)
class Predicted:
    """Predictions from the record of a mode, the rows they rest on, and what was done before."""

    extrapolation: Extrapolation
    data: Observations
    said: tuple[str, ...]

    @property
    def apart(self) -> str:
        """What is said of a level that lies apart from the others; empty where none does."""
        return self.extrapolation.plan.fit.apart

    def find_steady(self, sweep: str, mass: float) -> tuple[float, float] | None:
        """Frequency (Hz) and damping ratio F/(2 m w^2 A) of a tested sweep made steady; None where nothing was done."""
        if not self.said:
            return None
        k = list(self.data.sweeps).index(sweep)
        w, A, F = self.data.tested_omega[k], self.data.tested_amplitude[k], self.data.tested_force[k]
        return float(w / (2.0 * pi)), float(F / (2.0 * mass * w**2 * A))

    @property
    def law(self) -> str:
        """Name of the law with the largest weight."""
        return max(self.extrapolation.plan.laws, key=lambda law: law.weight).name

    def caution(self, row: Sequence[str] = ()) -> tuple[str, ...]:
        """Cautions of a level, with those of its prediction: ``row``."""
        known = not self.apart or any(self.apart in said for said in row)
        return (*self.said, *row) if known else (*self.said, self.apart, *row)


def predict_mode(record: Record, mode: Mode, forces: Sequence[float], seed: int) -> Predicted:
    """Amplitude at phase resonance at each modal force, averaged over laws on the draws of their evidence.

    AnalysisError: the levels do not allow a prediction.
    """
    measured = prepare(record, mode)
    data = near_resonance(measured.record)
    every, _ = observe_ranked(measured.record, audit(record, mode))
    asked = np.array(forces, dtype=float)
    predicted = extrapolate_loads(data, asked, LEVEL, seed, mode=mode, every=every, fresh=False)
    return Predicted(predicted, data, measured.said)
