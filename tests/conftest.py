"""Fixtures that several parts share: the report's records as observations, and synthetic resonances."""

from __future__ import annotations

from collections.abc import Callable

import pipelines  # isort: skip  # first, since it sets one thread for the linear algebra before numpy is loaded
import numpy as np
import pytest

from selection.posterior.observations import Observations, observe
from selection.records.reading import read_record
from selection.records.report_tables import data_folder

assert pipelines.__doc__  # imported for its effect


def resonances_of(A: np.ndarray, F: np.ndarray, omega: np.ndarray | float) -> Observations:
    """One row a level, at phase resonance."""
    n = len(A)
    omega = np.broadcast_to(np.asarray(omega, dtype=float), (n,)).copy()
    zero = np.zeros(n)
    return Observations(
        A=A,
        omega=omega,
        D=F,
        R=zero,
        sweep=np.arange(n),
        sd_amplitude=zero,
        sd_force=zero,
        sd_phase=zero,
        sweeps=tuple(f"L{i}" for i in range(n)),
        tested_force=F,
        tested_amplitude=A,
        tested_omega=omega,
    )


@pytest.fixture
def peaks() -> Callable[..., Observations]:
    return resonances_of


@pytest.fixture(scope="session")
def saturn() -> Callable[[str], Observations]:
    """Observations of a record of the report by name."""
    return lambda name: observe(read_record(data_folder() / "saturn-v" / "records" / f"{name}.csv"))
