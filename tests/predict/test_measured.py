"""Base drive and sweep rates before laws are fitted: against motions of known participation and the full equation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import damping as dp
from damping.extrapolation.prepared import near_resonance
from damping.gap.rows import read_rows
from damping.predict import prepare
from damping.records import audit
from damping.records.mode import Mode, Rig, Units, describe_mode_to_toml
from damping.records.reading import read_record
from damping.report import format_parameter_unit
from damping_pipelines.store import write_text
from damping_validation.bands import predict_structure

F_N = 25.0
RATIO = 0.008
GROWTH = 900.0
MASS = 3.0
PARTICIPATION = 0.35
LEVELS = (1.0, 2.0, 4.0)  # m/s^2 of the base
FREQUENCY = np.linspace(23.5, 26.5, 25)
NOISE = 0.01


def relative_motion(acceleration: float, frequency: np.ndarray) -> np.ndarray:
    """Complex motion relative to the base under m q'' + 2 z(A) m w_n q' + m w_n^2 q = p m a, by bisection for |q|."""
    w, w_n = 2 * np.pi * frequency, 2 * np.pi * F_N
    low, high = np.zeros_like(w), np.ones_like(w)
    for _ in range(60):
        A = 0.5 * (low + high)
        over = A * np.hypot(w_n**2 - w**2, 2 * RATIO * (1 + GROWTH * A) * w_n * w) > PARTICIPATION * acceleration
        low, high = np.where(over, low, A), np.where(over, A, high)
    return PARTICIPATION * acceleration / (w_n**2 - w**2 + 2j * RATIO * (1 + GROWTH * A) * w_n * w)


@pytest.fixture(scope="module")
def record() -> dp.Record:
    rng = np.random.default_rng(5)
    tables = []
    for level in LEVELS:
        a = relative_motion(level, FREQUENCY) * np.exp(NOISE * (rng.normal(size=25) + 1j * rng.normal(size=25)))
        columns = {"sweep": f"{level:g} m/s^2", "force": level, "frequency": FREQUENCY, "amplitude": np.abs(a)}
        tables.append(pd.DataFrame(columns | {"phase": -np.angle(a)}))
    return dp.Record(pd.concat(tables, ignore_index=True), "shaken.csv")


@pytest.fixture(scope="module")
def mode() -> Mode:
    c = 2.0 * MASS * RATIO * 2.0 * np.pi * F_N
    return Mode(name="shaken", frequency=F_N, mass=MASS, drive="base", damping={"viscous": c})


def test_the_participation_and_its_uncertainty_come_from_the_rows(record, mode):
    measured = prepare(record, mode)
    forced, said = measured.mode, measured.notes
    assert forced.drive == "force"
    # rows of 1 % noise: three masses of 25 rows each, three standard errors as stated
    np.testing.assert_allclose(1.0 / forced.mass, PARTICIPATION, rtol=3.0 * forced.tolerance.mass)
    assert 0.003 < forced.tolerance.mass < 0.05
    assert forced.tolerance.from_record
    assert "participation of 0.3" in said[0]
    # 2 z w_n = c/m stays: c over p m beside the mass 1/p
    coefficient = forced.damping["viscous"]["coefficient"]
    np.testing.assert_allclose(coefficient / forced.mass, 2.0 * RATIO * 2.0 * np.pi * F_N, rtol=1e-12)


def test_loads_of_a_base_driven_mode(record, mode):
    """The steady peak at twice the top acceleration."""
    loads = dp.extrapolate(record, replace(mode, damping={}), [8.0])
    row = loads.table.iloc[0]
    f = np.linspace(23.5, 26.5, 4001)
    true = float(np.max(np.abs(relative_motion(8.0, f))))
    assert row["low"] <= true <= row["high"]
    np.testing.assert_allclose(row["median"], true, rtol=0.06)  # what is asked of a campaign
    assert any("participation" in caution for caution in loads.to_json()["cautions"])


def test_loads_of_a_base_driven_mode_are_those_of_any_mass(record, mode, few_laws):
    loads = [dp.extrapolate(record, replace(mode, mass=mass, damping={}), [8.0]) for mass in (1.0, 50.0)]
    pd.testing.assert_frame_equal(loads[0].table, loads[1].table)


@pytest.mark.parametrize(("column", "factor"), [("force", 1 / 9.80665), ("amplitude", 1000.0), ("force", 1000.0)])
def test_units_of_a_base_are_audited(record, mode, column, factor):
    """g for m/s^2, mm for m, mm/s^2 for m/s^2: the participation that would follow is none; as measured it is one."""
    assert audit(record, mode).verdict == "ok"
    wrong = dp.Record(record.table.assign(**{column: record.table[column] * factor}))
    found = audit(wrong, mode)
    assert [finding.check for finding in found.findings] == ["units"]
    assert "participation" in found.findings[0].what


def test_the_base_s_acceleration_has_its_own_unit(record, mode):
    """Coefficients are those of c q'/M = .. under an acceleration: [c] = (m/s^2)/(m/s), [c2] = (m/s^2)/(m/s)^2."""
    units = prepare(record, replace(mode, units=Units("N", "m", "s"))).mode.units
    assert (units.drive, units.force) == ("base acceleration", "m/s²")
    named = [format_parameter_unit(name, units) for name in ("viscous", "velocity-squared", "coulomb", "slip limit")]
    assert named == ["1/s", "1/m", "m/s²", "m"]
    assert prepare(record, mode).mode.units.drive == Units("N", "m", "s").drive == "force"


def test_mode_file_of_a_base(mode, tmp_path):
    path = tmp_path / "m.toml"
    write_text(path, describe_mode_to_toml(mode))
    assert replace(dp.read_mode(path), source="") == mode
    write_text(path, '[mode]\nfrequency = 25.0\ndrive = "base"\n')
    assert dp.read_mode(path).drive == "base"
    write_text(path, '[mode]\nfrequency = 25.0\nmass = 1.0\ndrive = "floor"\n')
    with pytest.raises(dp.InputError, match='\'floor\'; expected "force" or "base"'):
        dp.read_mode(path)
    write_text(path, "[mode]\nfrequency = 25.0\n")
    with pytest.raises(dp.InputError, match="no mass"):
        dp.read_mode(path)


def test_a_steady_record_is_returned_as_it_is(record, mode, tmp_path):
    path = tmp_path / "r.csv"
    write_text(path, record.table.to_csv(index=False))
    read = read_record(path)
    forced = replace(mode, drive="force", mass=1.0 / PARTICIPATION, damping={})
    found = prepare(read, forced)
    assert found.record is read
    assert found.notes == ()


def test_the_rate_of_the_rig_is_that_of_its_rows(record, mode):
    """A rate of the rig and a column of it are one thing: the same steady states."""
    forced = replace(mode, drive="force", mass=1.0 / PARTICIPATION, damping={})
    of_rig = prepare(record, replace(forced, rig=Rig(rate=0.4)))
    of_rows = prepare(dp.Record(record.table.assign(sweep_rate=0.4)), forced)
    pd.testing.assert_frame_equal(of_rig.record.table, of_rows.record.table)
    assert "sweep rate" in of_rig.notes[0]
    slow = prepare(record, replace(forced, rig=Rig(rate=0.005)))  # .014 half-power bandwidths in the time one takes
    np.testing.assert_array_equal(slow.record.column("amplitude"), record.column("amplitude"))
    assert slow.notes == ()


def test_the_rate_of_the_rig_goes_with_the_rows(record, mode):
    """Rows that run down have the rate of the rig below 0, as a column would; the audit does not ask for it again."""
    forced = replace(mode, drive="force", mass=1.0 / PARTICIPATION, damping={}, rig=Rig(rate=0.4))
    down = dp.Record(record.table.iloc[::-1].reset_index(drop=True))
    for swept, rate in ((record, 0.4), (down, -0.4)):
        stated = dp.Record(swept.table.assign(sweep_rate=rate))
        np.testing.assert_array_equal(read_rows(swept, forced).rate, read_rows(stated, forced).rate)
        np.testing.assert_array_equal(prepare(swept, forced).record.table, prepare(stated, forced).record.table)
        (of_rig,), (of_rows,) = (
            [found for found in dp.check(given, forced).findings if found.check == "sweep-rate"]
            for given in (swept, stated)
        )
        assert str(of_rig) == str(of_rows)
    partly = dp.Record(record.table.assign(sweep_rate=np.where(np.arange(len(record)) < 5, 0.4, np.nan)))
    stated = prepare(dp.Record(record.table.assign(sweep_rate=0.4)), forced).record.table
    np.testing.assert_array_equal(prepare(partly, forced).record.table, stated)  # blank cells: the rate of the rig
    upwards = replace(forced, rig=Rig(rate=-0.4))  # as stated
    np.testing.assert_allclose(read_rows(record, upwards).rate, -0.4 * 2.0 * np.pi, rtol=1e-14)


def test_the_page_of_bands_rests_on_the_steady_states(record, mode, tmp_path, few_laws):
    """A rate that the audit only cautions about, one half-power bandwidth in the time that one takes."""
    forced = replace(mode, drive="force", mass=1.0 / PARTICIPATION, damping={})
    swept = dp.Record(record.table.assign(sweep_rate=(2.0 * RATIO * F_N) ** 2))
    write_text(tmp_path / "record.csv", swept.table.to_csv(index=False))
    write_text(tmp_path / "mode.toml", describe_mode_to_toml(forced))
    band, measured = predict_structure(tmp_path, seed=1), prepare(swept, forced)
    np.testing.assert_allclose(band.plan.data.tested_force, near_resonance(measured.record).tested_force, rtol=1e-12)
    assert band.notes == measured.notes
    assert "sweep rate" in band.notes[0]
