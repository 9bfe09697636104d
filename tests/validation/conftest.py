"""A mode with 1 % damping and rows about its resonance, for the tests of the generator."""

from __future__ import annotations

import numpy as np
import pytest

from damping_validation.generator.balance import TrueRows, plain_rows
from damping_validation.generator.laws import Structure
from damping_validation.generator.plan import Bench

OMEGA = 2 * np.pi * 3.0
MASS = 10.0
XI = 0.01
VISCOUS = 2 * XI * MASS * OMEGA
FORCES = (1.0, 4.0)
#: Resonant amplitude at the highest force with viscous damping alone.
A_TOP = FORCES[-1] / (VISCOUS * OMEGA)


@pytest.fixture(scope="session")
def mode() -> Structure:
    return Structure(MASS, OMEGA, VISCOUS)


@pytest.fixture(scope="session")
def rows() -> TrueRows:
    offsets = np.linspace(-6 * XI, 6 * XI, 13)
    sweep = np.repeat(np.arange(len(FORCES)), offsets.size)
    return plain_rows(sweep, np.repeat(FORCES, offsets.size), np.tile(OMEGA * (1 + offsets), len(FORCES)))


@pytest.fixture(scope="session")
def bench(mode: Structure, rows: TrueRows) -> Bench:
    """A test of the mode without scatter, its simulation right but for what an effect adds."""
    return Bench(mode, (0.001, 0.02, 0.05), (0.0,) * 3, (), rows, (0.0, 0.0), False, A_TOP, XI)
