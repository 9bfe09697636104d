"""Whole sweeps of a mode of known damping, at steady states that a phase-controlled test holds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from damping.forces.contract import Force
from damping.predict.steady import resonant_amplitude
from damping.records.record import Record

M, OMEGA_N = 0.5, 10.0


def swept_record(
    force: Force,
    levels: np.ndarray,
    noise: float = 0.0,
    offset: float = 0.0,
    dropout: float = 0.0,
    rows: int = 21,
    seed: int = 0,
) -> Record:
    """Rows from phase 0.15 pi to 0.85 pi: C(A) = F sin(phase), M omega^2 = K + (S - F cos(phase))/A.

    Args:
        noise: relative, of amplitude, and in rad of phase. offset: added to every phase. dropout: share by which the
            force is lower at resonance than far from it (the force column is the real one).
    """
    rng = np.random.default_rng(seed)
    tables = []
    for level in levels:
        phase = np.linspace(0.15 * np.pi, 0.85 * np.pi, rows)
        F = level * (1.0 - dropout * np.sin(phase) ** 4)
        A = resonant_amplitude(force, F * np.sin(phase), OMEGA_N)
        S = np.asarray(force.in_phase(A, OMEGA_N))
        omega = np.sqrt(OMEGA_N**2 + (S - F * np.cos(phase)) / (M * A))
        tables.append(
            pd.DataFrame(
                {
                    "sweep": f"F{level:.3g}",
                    "force": F,
                    "frequency": omega / (2.0 * np.pi),
                    "amplitude": A * np.exp(noise * rng.standard_normal(rows)),
                    "phase": phase + offset + noise * rng.standard_normal(rows),
                }
            )
        )
    return Record(pd.concat(tables, ignore_index=True), "simulated")


@pytest.fixture
def swept() -> Callable[..., Record]:
    return swept_record
