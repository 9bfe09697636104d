"""Columns that belong together and differ: in unit, in scaling, in what their phase is counted from, or not even in
name."""

from __future__ import annotations

import numpy as np
import pytest

from damping.errors import InputError
from damping.formats.headers import NAMES, parse_header
from damping.formats.quantity import find_powers
from damping.formats.roles import find_roles
from tests.files import write_csv, write_hdf5

#: Roundings of a few operations in double precision.
CLOSE = 1e-13


@pytest.mark.parametrize(
    ("table", "stated", "places"),
    [
        (
            "Lauf, Abtrieb [Hz], M, moment [N m], twist [rad]",
            {},
            {"sweep": 0, "frequency": 1, "force": 3, "amplitude": 4},
        ),
        ("freq, F [N], Weg [mm], phi [deg]", {}, {"frequency": 0, "force": 1, "amplitude": 2, "angle": 3}),
        ("freq, F [N], Weg [mm], amplitude [mm]", {}, {"frequency": 0, "force": 1, "amplitude": 3}),
        ("freq, F [N], Weg [mm], tip [mm]", {"amplitude": "tip"}, {"amplitude": 3, "frequency": 0, "force": 1}),
        ("f, x [mm], y [mm]", {}, {"frequency": 0, "x": 1, "y": 2}),
        ("t, accel [g], phase", {"response": "accel"}, {"response": 1, "time": 0}),
    ],
)
def test_each_role_has_its_column_by_the_first_rule_that_gives_one(table, stated, places):
    roles = find_roles([parse_header(name) for name in table.split(", ")], stated, NAMES["own"])
    assert roles.places == places


@pytest.mark.parametrize(("name", "factor"), [("um", 1e6), ("mm", 1e3), ("m", 1.0)])
def test_an_uncertainty_is_in_the_unit_of_its_own_header(truth, tmp_path, imported, name, factor):
    sd = 0.01 * truth.amplitude
    columns = {"frequency": truth.f, "force [N]": truth.F, "force_sd [mN]": 20.0 * truth.F}
    columns |= {"amplitude [mm]": 1e3 * truth.amplitude, f"amplitude_sd [{name}]": factor * sd, "phase": truth.lag}
    record = imported(write_csv(tmp_path / "a.csv", columns)).record
    np.testing.assert_allclose(record.column("amplitude_sd"), sd, rtol=CLOSE)
    np.testing.assert_allclose(record.column("force_sd"), 0.02 * truth.F, rtol=CLOSE)


def test_an_uncertainty_is_in_the_unit_of_its_own_attribute(truth, tmp_path, imported):
    sd = 0.01 * truth.amplitude
    contents = {"frequency": (truth.f, "Hz"), "force": (truth.F, "N"), "amplitude": (1e3 * truth.amplitude, "mm")}
    path = write_hdf5(tmp_path / "a.h5", contents | {"amplitude_sd": (1e6 * sd, "um")})
    np.testing.assert_allclose(imported(path).record.column("amplitude_sd"), sd, rtol=CLOSE)


def test_an_uncertainty_in_another_quantity_is_refused(truth, tmp_path, imported):
    columns = {"frequency": truth.f, "force [N]": truth.F, "amplitude [mm]": truth.amplitude, "amplitude_sd [%]": 1.0}
    with pytest.raises(InputError, match="unit of amplitude_sd '%' is not understood"):
        imported(write_csv(tmp_path / "a.csv", columns))
    columns["amplitude_sd [N]"] = columns.pop("amplitude_sd [%]")
    with pytest.raises(InputError, match="amplitude_sd in N; expected the unit of its quantity, such as mm"):
        imported(write_csv(tmp_path / "a.csv", columns))


def test_an_uncertainty_in_volts_is_scaled_as_its_amplitude(truth, tmp_path, imported):
    """The stated unit and sensitivity are of the column, and of its uncertainty in the same volts."""
    columns = {"frequency": truth.f, "force [N]": truth.F, "amplitude [V]": truth.amplitude / 5e-3}
    columns["amplitude_sd [V]"] = 0.01 * columns["amplitude [V]"]
    stated = {"units": {"response": "mm"}, "scale": {"response": 5.0}, "response": "displacement"}
    record = imported(write_csv(tmp_path / "a.csv", columns), **stated).record
    np.testing.assert_allclose(record.column("amplitude_sd"), 0.01 * truth.amplitude, rtol=CLOSE)


@pytest.mark.parametrize(
    ("headers", "message"),
    [
        (("x [mm]", "y [um]", "fx [N]", "fy [N]"), "x in mm and y in um; expected one unit"),
        (("x [mm]", "y [mm]", "fx [N]", "fy [mN]"), "force_x in N and force_y in mN; expected one unit"),
        (("x [mm rms]", "y [mm]", "fx [N]", "fy [N]"), "x in mm rms and y in mm; expected one unit"),
    ],
)
def test_parts_of_one_phasor_are_in_one_unit(truth, tmp_path, imported, headers, message):
    parts = (truth.H.real, truth.H.imag, np.ones_like(truth.f), np.zeros_like(truth.f))
    path = write_csv(tmp_path / "a.csv", {"frequency": truth.f} | dict(zip(headers, parts, strict=True)))
    columns = dict(zip(("x", "y", "force_x", "force_y"), headers, strict=True))
    with pytest.raises(InputError, match=message):
        imported(path, columns=columns, scaling="peak")


@pytest.mark.parametrize("name", ["phase", "lag_deg"])
def test_a_lag_behind_the_force_needs_no_phase_of_the_force(truth, tmp_path, imported, name):
    """The force as a phasor against some reference, the lag of the response behind that force."""
    drive = truth.F * np.exp(0.7j)
    columns = {"frequency": truth.f, "fx": drive.real, "fy": drive.imag, "amplitude": truth.amplitude}
    columns[name] = np.degrees(truth.lag) if name == "lag_deg" else truth.lag
    stated = {"response": "displacement", "consistent": True, "scaling": "peak"}
    roles = {"force_x": "fx", "force_y": "fy", "amplitude": "amplitude", name: name}
    record = imported(write_csv(tmp_path / "a.csv", columns), columns=roles, **stated).record
    np.testing.assert_allclose(record.column("phase"), truth.lag, rtol=0.0, atol=CLOSE)
    np.testing.assert_allclose(record.column("force"), truth.F, rtol=CLOSE)


@pytest.mark.parametrize(("twice", "numbers"), [("Accel [m/s^2]", {"amplitude": "2"}), ("Force [N]", {"force": "3"})])
def test_columns_of_one_name_are_told_apart_by_number(truth, tmp_path, imported, twice, numbers):
    """The first of the two is the true one."""
    acceleration, force = truth.amplitude * (2 * np.pi * truth.f) ** 2, np.full_like(truth.f, truth.F)
    table = {"frequency": truth.f, "Accel [m/s^2]": acceleration, "Force [N]": force}
    header = ",".join([*table, twice])
    values = np.column_stack([*table.values(), 7.0 * table[twice]])
    np.savetxt(tmp_path / "a.csv", values, delimiter=",", header=header, comments="", fmt="%.17g")
    with pytest.raises(InputError, match=f"line 1: several columns are '{twice.split()[0].lower()}'"):
        imported(tmp_path / "a.csv")
    record = imported(tmp_path / "a.csv", columns={"amplitude": "2"} | numbers, scaling="peak").record
    np.testing.assert_allclose(record.column("amplitude"), truth.amplitude, rtol=CLOSE)
    np.testing.assert_allclose(record.column("force"), truth.F, rtol=CLOSE)


@pytest.mark.parametrize("before", ["phase_sd [deg]", "phase_3 [deg]"])
def test_the_phase_is_told_from_columns_that_begin_so(truth, tmp_path, imported, before):
    columns = {"frequency": truth.f, "force [N]": truth.F, "amplitude [mm]": 1e3 * truth.amplitude, before: 1.0}
    columns["Phase [deg]"] = np.degrees(truth.lag)
    record = imported(write_csv(tmp_path / "a.csv", columns)).record
    np.testing.assert_allclose(record.column("phase"), truth.lag, rtol=0.0, atol=CLOSE)


def test_of_two_phases_the_one_is_asked_for(truth, tmp_path, imported):
    columns = {"frequency": truth.f, "force [N]": truth.F, "Displacement [mm]": 1e3 * truth.amplitude}
    columns |= {"Phase 1 [deg]": 30.0 + np.degrees(truth.lag), "Phase 2 [deg]": np.degrees(truth.lag)}
    path = write_csv(tmp_path / "a.csv", columns)
    with pytest.raises(InputError, match="line 1: several columns are 'phase'"):
        imported(path)
    stated = {"amplitude": "Displacement", "lag_deg": "Phase 2"}
    np.testing.assert_allclose(imported(path, columns=stated).record.column("phase"), truth.lag, rtol=0.0, atol=CLOSE)


@pytest.mark.parametrize("text", ["ms-2", "ms^-2", "ms-1", "N/ms^-1"])
def test_metres_and_seconds_that_touch_are_no_milliseconds(text):
    assert find_powers(text) is None
    assert find_powers("mm/ms") == (0, 1, -1)
