"""Certified reference data sets for linear least squares, easy to very ill-conditioned, through the command."""

from __future__ import annotations

import csv
import json
from decimal import Decimal, localcontext
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damping.regression import parse_terms
from damping.regression.design import LARGEST_CONDITION, Columns, design_of
from damping.regression.fit import fit
from damping_pipelines.tables import regress

FOLDER = Path(__file__).parents[1] / "reference" / "strd"
CERTIFIED: dict[str, dict[str, Any]] = json.loads((FOLDER / "certified.json").read_text())["sets"]


def stated() -> dict[str, tuple[float, float]]:
    """Digits that the table of the folder's README promises: of coefficients and of standard deviations."""
    rows = [line.split("|") for line in (FOLDER / "README.md").read_text().splitlines() if line.startswith("| ")]
    return {row[1].strip(): (float(row[3]), float(row[4])) for row in rows if row[1].strip() in CERTIFIED}


def exact_solution(columns: list[list[Fraction]], observed: list[Fraction]) -> tuple[list[Fraction], list[Fraction]]:
    """Coefficients and squared standard errors of a least-squares fit, in rational arithmetic."""
    k, n = len(columns), len(observed)
    rows = [[sum(a * b for a, b in zip(x, y, strict=True)) for y in [*columns, observed]] for x in columns]
    system = [row + [Fraction(int(i == j)) for j in range(k)] for i, row in enumerate(rows)]
    for i in range(k):
        system[i] = [value / system[i][i] for value in system[i]]
        for j in range(k):
            if j != i:
                system[j] = [b - system[j][i] * a for a, b in zip(system[i], system[j], strict=True)]
    coefficients = [row[k] for row in system]
    fitted = [sum(c * x[i] for c, x in zip(coefficients, columns, strict=True)) for i in range(n)]
    sse = sum((y - f) ** 2 for y, f in zip(observed, fitted, strict=True))
    return coefficients, [sse / (n - k) * system[i][k + 1 + i] if n > k else Fraction(0) for i in range(k)]


def power(term: str, row: dict[str, Fraction]) -> Fraction:
    column, _, exponent = term.partition("^")
    return Fraction(1) if term == "1" else row[column] ** int(exponent or 1)


def rounds_to(value: Fraction, printed: str, root: bool = False) -> bool:
    """Whether the value (or its root) rounds to the printed digits."""
    with localcontext() as context:
        context.prec = 60
        number = Decimal(value.numerator) / Decimal(value.denominator)
        number = number.sqrt() if root else number
        last = Decimal((0, (1,), int(Decimal(printed).as_tuple().exponent)))
        # half a unit, and a hair for the tie
        return abs(number - Decimal(printed)) <= last * Decimal("0.500001")


@pytest.mark.parametrize("name", CERTIFIED)
def test_certified_values_follow_from_the_data(name: str) -> None:
    """Every digit of the data and of the certified values is right: rational arithmetic gives all fifteen."""
    with (FOLDER / f"{name}.csv").open() as stream:
        rows = [{key: Fraction(value) for key, value in row.items()} for row in csv.DictReader(stream)]
    certified = CERTIFIED[name]
    terms = certified["terms"].split(", ")
    columns = [[power(term, row) for row in rows] for term in terms]
    coefficients, variances = exact_solution(columns, [row["y"] for row in rows])
    assert all(rounds_to(a, b) for a, b in zip(coefficients, certified["estimates"], strict=True))
    assert all(rounds_to(a, b, root=True) for a, b in zip(variances, certified["sd"], strict=True))


def digits(found: Any, certified: Any) -> float:
    """Least number of right digits, at most 15: -log10 of the relative error, of the absolute one where 0 is right."""
    found, certified = np.atleast_1d(found).astype(float), np.atleast_1d(certified).astype(float)
    error = np.abs(found - certified) / np.where(certified == 0.0, 1.0, np.abs(certified))
    return float(np.min(-np.log10(np.clip(error, 1e-15, None))))


@pytest.mark.parametrize("name", CERTIFIED)
def test_command_reaches_the_stated_digits(name: str, tmp_path: Path) -> None:
    certified, target = CERTIFIED[name], tmp_path / "fit.json"
    regress([FOLDER / f"{name}.csv"], "y", [certified["terms"]], json_out=str(target), plots=None, max_size=10**6)
    form = json.loads(target.read_text())
    coefficients, deviations = stated()[name]
    assert digits([term["coefficient"] for term in form["terms"]], certified["estimates"]) >= coefficients
    assert digits([term["std_error"] for term in form["terms"]], certified["sd"]) >= deviations
    summary = form["summary"]
    assert digits(summary["standard_error"], certified["residual_sd"]) >= deviations
    centred = "r_squared_centred" if "1" in certified["terms"].split(", ") else "r_squared"
    # R^2 of Wampler 5 is .002, the difference of two numbers near 1: two digits fewer than theirs
    assert digits(summary[centred], certified["r_squared"]) >= 12


def test_every_set_reaches_seven_digits() -> None:
    assert set(stated()) == set(CERTIFIED)
    assert min(min(pair) for pair in stated().values()) >= 7


@pytest.mark.parametrize("degree", [14])
def test_fits_up_to_the_largest_condition_number(degree: int) -> None:
    """Filip's data with higher powers, up to the edge of what is refused, against rational arithmetic."""
    with (FOLDER / "filip.csv").open() as stream:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(stream)]
    x, y = (np.array([row[name] for row in rows]) for name in ("x", "y"))
    terms = parse_terms(", ".join(["1", *(f"x^{i}" for i in range(1, degree + 1))]))
    found = fit(design_of(Columns({"x": x, "y": y}, np.arange(len(x)), ()), "y", terms))
    exact, variances = exact_solution(
        [[Fraction(value) ** i for value in x] for i in range(degree + 1)], [Fraction(value) for value in y]
    )
    assert 1e10 < found.condition_number < LARGEST_CONDITION
    # the columns are exact to 2^-104 and the factor that scales them is corrected: rounding of y at 1e-16, magnified by
    # at most the condition number over the size of the coefficients, leaves eight digits
    np.testing.assert_allclose(found.coefficients, np.array([float(c) for c in exact]), rtol=1e-8)
    np.testing.assert_allclose(found.std_errors, np.sqrt([float(v) for v in variances]), rtol=1e-8)
