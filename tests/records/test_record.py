"""A record's rows by sweep."""

import numpy as np
import pandas as pd
import pytest

from damping.errors import InputError
from damping.records.record import Record
from damping.records.runs import runs_of

TABLE = pd.DataFrame(
    {
        "sweep": ["up", "low", "up", "low", "high"],
        "force": [2.0, 1.0, 2.0, 1.0, 3.0],
        "frequency": [1.0, 2.0, 3.0, 4.0, 5.0],
        "amplitude": [1.0, 1.0, 2.0, 2.0, 3.0],
    }
)


def test_sweeps_in_order_of_appearance_and_rows_in_file_order():
    record = Record(TABLE, "made.csv")
    assert record.sweeps == ("up", "low", "high")
    assert not record.has_phase
    low = record.of("low")
    assert low.column("frequency").tolist() == [2.0, 4.0]
    assert low.table.index.tolist() == [0, 1]
    assert len(record) == 5
    assert record.source == low.source == "made.csv"


def test_columns_are_copies_and_masses_fall_back():
    record = Record(TABLE.assign(mass=[np.nan, 5.0, 6.0, np.nan, 7.0]), "made.csv")
    record.column("force")[:] = 0.0
    assert record.column("force").min() == 1.0
    np.testing.assert_array_equal(record.masses(9.0), [9.0, 5.0, 6.0, 9.0, 7.0])
    np.testing.assert_array_equal(Record(TABLE, "").masses(9.0), np.full(5, 9.0))


def test_a_sweep_that_is_not_there_is_refused():
    with pytest.raises(InputError, match=r"made\.csv: no sweep 'hihg'; expected one of up, low, high"):
        Record(TABLE, "made.csv").of("hihg")


def test_runs_are_legs_by_frequency_with_the_rows_that_they_are_of():
    """Four rows up and four down, the sweeps between each other."""
    up = np.array([1.0, 1.1, 1.2, 1.3])
    f = np.array([*up, *up[::-1] - 0.01])
    table = {"sweep": "A", "force": 2.0, "frequency": f, "amplitude": 0.1 * np.arange(1.0, 9.0), "phase": 1.0 + 0.1 * f}
    one = pd.DataFrame(table)
    both = pd.concat([one, one.assign(sweep="B", force=3.0)]).sort_index(kind="stable")
    record = Record(both)
    runs = runs_of(record)
    assert [run.sweep for run in runs] == ["A", "A", "B", "B"]
    rows = [(0, 2, 4, 6), (14, 12, 10, 8), (1, 3, 5, 7), (15, 13, 11, 9)]
    assert [tuple(run.rows) for run in runs] == rows
    for run in runs:
        for name, values in (("force", run.F), ("amplitude", run.A), ("phase", run.phase)):
            np.testing.assert_array_equal(values, record.column(name)[run.rows])
        assert np.all(np.diff(run.omega) > 0.0)
