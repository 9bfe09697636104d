"""What Python users hand in by mistake is an InputError, and what is meant well is understood."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import damping as dp
from damping.extrapolation import check_loads
from damping.plots.curves import damping_curve
from damping.plots.fits import ranking, sweeps

FORCE = np.array([4.0, 8.0, 12.0, 18.0, 25.0])
TABLE = pd.DataFrame(
    {"sweep": list("ABCDE"), "force": FORCE, "frequency": 25.0, "amplitude": 0.2 * (FORCE / 4.0) ** 0.76}
)


@pytest.mark.parametrize(
    ("column", "values", "said"),
    [
        ("amplitude", TABLE["amplitude"] * np.exp(1j), "column amplitude: holds complex values"),
        ("amplitude", (TABLE["amplitude"] * np.exp(1j)).astype(object), "column amplitude: holds complex values"),
        ("force", [True] * 5, "column force: holds boolean values"),
        ("time", pd.date_range("2020", periods=5), "column time: holds datetime64 values"),
        ("time", pd.to_timedelta(range(5), unit="s"), "column time: holds timedelta64 values"),
    ],
)
def test_columns_that_pandas_would_make_numbers_of(column, values, said):
    with pytest.raises(dp.InputError, match=said):
        dp.Record(TABLE.assign(**{column: values}))


def test_two_columns_of_one_name():
    with pytest.raises(dp.InputError, match="column force: two columns of this name"):
        dp.Record(pd.concat([TABLE, TABLE[["force"]]], axis=1))


def test_a_mass_may_be_left_out_where_the_base_is_shaken():
    assert dp.Mode(name="m", frequency=25.0, drive="base").mass == 1.0
    with pytest.raises(dp.InputError, match="no mass in"):
        dp.Mode(name="m", frequency=25.0)
    with pytest.raises(dp.InputError, match="is nan"):
        dp.Mode(name="m", frequency=25.0, mass=float("nan"), drive="base")
    with pytest.raises(dp.InputError, match="column name: is None; expected a text"):
        dp.Mode(name=None, frequency=25.0, mass=1.0)


def test_messages_without_a_file_begin_with_what_is_wrong():
    assert str(dp.InputError("wrong", file="")) == "wrong"


@pytest.mark.parametrize("value", [1e300, 1e51, 1e-51, 1e-300])
def test_forces_and_amplitudes_are_of_the_magnitudes_of_records(value):
    """Before any work: neither an overflow nor a warning."""
    record, mode = dp.Record(TABLE), dp.Mode(name="m", frequency=25.0, mass=0.04)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(dp.InputError, match="of a magnitude of 1e-50 to 1e\\+50"):
            dp.curve(record, mode, [value])
        with pytest.raises(dp.InputError, match="of a magnitude of 1e-50 to 1e\\+50"):
            dp.extrapolate(record, mode, value)
    assert check_loads([1e50, 1e-50], 0.9).tolist() == [1e50, 1e-50]


def test_a_notebook_shows_records_and_modes():
    html = dp.Record(TABLE, "<b>")._repr_html_()
    assert "&lt;b&gt;: 5 rows in 5 sweeps" in html
    assert html.count("<tr") == 6
    assert "frequency = 25.0" in dp.Mode(name="m", frequency=25.0, mass=0.04)._repr_html_()


def test_axes_that_are_none():
    with pytest.raises(dp.InputError, match="ax is of type int; expected Axes"):
        sweeps(TABLE, axes=3)


def test_a_drawing_on_given_axes_has_its_legend():
    """And no second one on the figure, which is the caller's."""
    figure = Figure()
    axes = figure.add_subplot()
    table = pd.DataFrame({"amplitude": [1.0, 2.0], "damping_ratio": 0.02, "tested": [True, False]})
    damping_curve(table.assign(damping_ratio_low=0.01, damping_ratio_high=0.03), 0.9, axes=axes)
    assert [text.get_text() for text in axes.get_legend().get_texts()][:2] == [
        "median, tested",
        "median, beyond (hatched)",
    ]
    assert not figure.legends


def test_laws_are_told_apart_beside_their_bars():
    laws = ["viscous + velocity-squared + " + last for last in ("slip", "coulomb", "quadratic-displacement")]
    table = pd.DataFrame({"rank": [1, 2, 3], "law": laws, "weight": [0.5, 0.3, 0.2], "physical": True})
    axes = Figure().add_subplot()
    ranking(table, axes=axes)
    assert [" ".join(label.get_text().split()) for label in axes.get_yticklabels()] == laws
