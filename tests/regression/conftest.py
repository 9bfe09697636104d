"""Designs that several tests share: the report's nine-term polynomial, and random ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from damping.regression import list_columns_of, parse_terms
from damping.regression.design import Design, design_of, design_of_arrays, take_columns
from damping_reed1970 import load_table

#: Eq. 5.3.6.
NINE_TERMS = "A^2*omega, A^2, A^3*omega^2, A^3*omega, A^4*omega, A, A^3, A^4, A^2*omega^2"


@pytest.fixture
def nine_terms() -> str:
    return NINE_TERMS


@pytest.fixture(scope="session")
def report_design() -> Callable[..., Design]:
    """The design of terms on a table of chapter 5, rows optionally restricted."""

    def build(name: str, terms: str, version: str = "used", run: str = "E4", rows: slice = slice(None)) -> Design:
        table = load_table(name, version, run).iloc[rows].reset_index(drop=True)  # type: ignore[arg-type]  # literals
        amplitude = next(column for column in table.columns if column in ("A_in", "A2bar_in", "A2p_in"))
        data = pd.DataFrame({"A": table[amplitude], "omega": table["omega_rad_s"], "E": table["E_in_lb"]}).astype(float)
        parsed = parse_terms(terms)
        return design_of(take_columns(data, ("E", *list_columns_of(parsed))), "E", parsed)

    return build


@pytest.fixture(scope="session")
def nine_term_design(report_design: Callable[..., Design]) -> Design:
    """Eq. 5.3.6 on the inputs that Table 5.III was computed from."""
    return report_design("5_III", NINE_TERMS)


@pytest.fixture(scope="session")
def random_design() -> Callable[..., Design]:
    """Normal columns and a response that depends on some of them; the same for the same seed."""

    def build(seed: int, n: int = 20, k: int = 4, noise: float = 0.5) -> Design:
        rng = np.random.default_rng(seed)
        columns = rng.normal(size=(n, k))
        observed = columns @ rng.normal(size=k) + noise * rng.normal(size=n)
        return design_of_arrays(columns, observed, [f"x{i}" for i in range(k)], "y")

    return build
