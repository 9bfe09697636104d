"""What names of columns stand for: themselves, aliases, the derived energy."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from damping.errors import AnalysisError, InputError
from damping.records.reading import read_table
from damping.regression.design import list_required_columns, take_columns
from damping_reed1970 import data_folder


def table(**columns: object) -> pd.DataFrame:
    return pd.DataFrame(columns)


def test_aliases_only_where_the_column_is_missing() -> None:
    record = table(amplitude=[1.0, 2.0], frequency=[3.0, 4.0])
    taken = take_columns(record, ("A", "omega"))
    np.testing.assert_array_equal(taken.numbers["A"], [1.0, 2.0])
    # one multiplication
    np.testing.assert_allclose(taken.numbers["omega"], [6 * np.pi, 8 * np.pi], rtol=1e-15)
    own = take_columns(record.assign(A=[5.0, 6.0], omega=[7.0, 8.0]), ("A", "omega"))
    np.testing.assert_array_equal(own.numbers["A"], [5.0, 6.0])
    np.testing.assert_array_equal(own.numbers["omega"], [7.0, 8.0])


def test_names_with_blanks() -> None:
    blank = table(**{"tail amplitude": [1.0]})
    assert list_required_columns(["tailamplitude"], list(blank.columns)) == ("tail amplitude",)
    assert list_required_columns(["tail  amplitude"], list(blank.columns)) == ("tail amplitude",)


@pytest.mark.parametrize(("typed", "meant"), [("energi", "energy"), ("omga", "omega")])
def test_a_typing_error_in_a_derived_column_is_named(typed: str, meant: str) -> None:
    with pytest.raises(InputError, match=rf"missing column {typed} \(is '{meant}' meant\?\)"):
        list_required_columns([typed], ["sweep", "force", "frequency", "amplitude"])
    assert list_required_columns([typed], [typed]) == (typed,)
    assert list_required_columns(["forse"], ["force", "amplitude"]) == ("forse",)  # that of the table is named later


def test_energy_as_given_wins() -> None:
    record = table(force=[1.0], amplitude=[2.0], phase=[0.3], energy=[9.0])
    assert take_columns(record, ["energy"]).numbers["energy"] == [9.0]


def test_energy_from_force_amplitude_and_phase() -> None:
    record = table(force=[1.0, 2.0], amplitude=[2.0, 3.0], phase=[0.3, -0.1])
    taken = take_columns(record, ["energy", "A"])
    # pi F A sin(phase), three multiplications; noise may carry it below 0
    expected = np.pi * np.array([2 * np.sin(0.3), 6 * np.sin(-0.1)])
    np.testing.assert_allclose(taken.numbers["energy"], expected, rtol=1e-15)
    assert taken.notes == ("energy = pi * force * amplitude * sin(phase)",)


@pytest.mark.parametrize(
    ("column", "message"),
    [
        ({"phase": [0.3, 90.0]}, r"phase: 90 at observation 2, from which energy follows; expected radians"),
        ({"force": [1.0, -2.0]}, r"force: -2 at observation 2, .* expected a force amplitude > 0"),
    ],
)
def test_energy_does_not_follow_from_what_no_record_holds(column: dict[str, list[float]], message: str) -> None:
    rows = {"force": [1.0, 2.0], "amplitude": [2.0, 3.0], "phase": [0.3, 1.5]}
    with pytest.raises(InputError, match=message):
        take_columns(table(**{**rows, **column}), ["energy"])


def test_without_phase_only_resonance_has_an_energy() -> None:
    record = table(sweep=["a", "a", "b"], force=[1.0, 2.0, 3.0], amplitude=[2.0, 1.0, 1.0], frequency=[1.0, 2.0, 3.0])
    taken = take_columns(record, ["energy", "A", "omega"])
    np.testing.assert_array_equal(taken.rows, [0, 2])
    # pi F A, two multiplications
    np.testing.assert_allclose(taken.numbers["energy"], np.pi * np.array([2.0, 3.0]), rtol=1e-15)
    assert "2 rows at phase resonance of 3 are used" in taken.notes[1]
    np.testing.assert_array_equal(take_columns(record.drop(columns="frequency"), ["energy", "A"]).rows, [0, 2])


def test_energy_of_the_reports_record() -> None:
    """The derived energies of Configuration I are those of Table 3.IV: that is pi X_t F sin(phase) by slide rule from
    factors of two to three digits, of which X_t (.0086 at the least) and the phase near 0 and pi take up to 2 %."""
    record = read_table(data_folder() / "saturn-v" / "records" / "config-1-mode-2-rough.csv", text_columns=["sweep"])
    derived = take_columns(record.drop(columns="energy"), ["energy"]).numbers["energy"]
    np.testing.assert_allclose(derived, record["energy"], rtol=0.02)


def test_missing_columns_are_asked_for_by_name() -> None:
    assert list_required_columns(["energy"], ["force", "amplitude"]) == ("force", "amplitude", "phase")
    assert list_required_columns(["energy"], ["amplitude"]) == ("energy",)
    assert list_required_columns(["A", "omega"], ["force"]) == ("A", "omega")


def test_no_row_left_is_refused() -> None:
    with pytest.raises(AnalysisError, match="no row"):
        take_columns(table(x=[np.nan]), ["x"])
