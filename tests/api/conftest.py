"""The flagship record and its mode, as users read them."""

import pytest

import damping as dp
from damping_reed1970 import data_folder

SATURN = data_folder() / "saturn-v"


@pytest.fixture
def record() -> dp.Record:
    return dp.read_record(SATURN / "records" / "config-2-mode-1.csv")


@pytest.fixture
def mode() -> dp.Mode:
    return dp.read_mode(SATURN / "modes" / "config-2-mode-1.toml")
