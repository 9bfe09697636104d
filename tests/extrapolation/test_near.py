"""Rows near resonance: phase offsets, drop-out, restoring forces, records of other kinds."""

import numpy as np
import pandas as pd
import pytest

from benchmarks._structures import structures
from damping.errors import AnalysisError
from damping.extrapolation.near import NEAR, at_resonance, near_resonance, without_offset
from damping.forces import CubicStiffness, Sum
from damping.infer.observations import MOST_ROWS, MOST_SWEEPS, observe
from damping.records.record import Record

LEVELS = np.array([0.5, 1.0, 2.0])
PAIR = next(s for s in structures() if s.name == "viscous + velocity-squared")


def test_a_phase_offset_is_taken_off(swept):
    """A lag of 3 degrees rotates the energy by up to 5 % at the half-power points; free of it the law is met again."""
    data = near_resonance(swept(PAIR.force, LEVELS, offset=np.radians(3.0)))
    # the offset is found to a few thousandths of a rad: velocity-squared damping grows with frequency by another power
    # than viscous damping, which displaces it by a damping ratio of 1 %
    np.testing.assert_allclose(PAIR.force.quadrature(data.A, data.omega), data.D, rtol=0.02)
    raw = observe(swept(PAIR.force, LEVELS, offset=np.radians(3.0)))
    worst = np.max(np.abs(raw.D / PAIR.force.quadrature(raw.A, raw.omega) - 1.0))
    assert worst > 0.05


def test_rows_kept_lie_between_the_half_power_points(swept):
    data = near_resonance(swept(PAIR.force, LEVELS[:1]))
    assert np.all(data.R <= NEAR * data.D)
    # sin(phase) >= 1/sqrt(2): 15 of 21 rows between 0.15 pi and 0.85 pi; of several levels one row each
    assert data.rows_per_sweep.tolist() == [15]
    assert near_resonance(swept(PAIR.force, LEVELS)).rows_per_sweep.tolist() == [1, 1, 1]


def test_drop_out_changes_nothing_where_the_force_was_measured(swept):
    with_dropout = near_resonance(swept(PAIR.force, LEVELS, dropout=0.4))
    np.testing.assert_allclose(PAIR.force.quadrature(with_dropout.A, with_dropout.omega), with_dropout.D, rtol=0.02)
    # the force falls by 40 %, a quarter of that between the half-power points: its value at resonance is fitted to
    # 5 %, and force and amplitude there belong together far better
    np.testing.assert_allclose(with_dropout.tested_force, 0.6 * LEVELS, rtol=0.06)
    carried = PAIR.force.quadrature(with_dropout.tested_amplitude, with_dropout.tested_omega)
    np.testing.assert_allclose(carried, with_dropout.tested_force, rtol=0.02)


def test_a_cubic_spring_moves_frequencies_only(swept):
    hard = Sum((*PAIR.force.forces, CubicStiffness(0.3)))
    data = near_resonance(swept(hard, LEVELS))
    assert np.ptp(data.tested_omega) > 0.01
    # the fit of the resonance is exact for a linear mode; a spring that hardens by 1 % within a sweep costs 0.2 %
    np.testing.assert_allclose(data.tested_amplitude, PAIR.amplitude(LEVELS), rtol=5e-3)


def test_recorded_energies_are_not_touched(swept):
    record = swept(PAIR.force, LEVELS, offset=0.1)
    record.table["energy"] = np.pi * record.table["force"] * record.table["amplitude"]
    assert without_offset(record) is record


def test_peaks_alone_stay_as_they_are(saturn):
    from damping.records.reading import read_record
    from damping_reed1970 import data_folder

    record = read_record(data_folder() / "saturn-v" / "records" / "config-2-mode-1.csv")
    data = near_resonance(record)
    np.testing.assert_array_equal(data.A, saturn("config-2-mode-1").A)
    np.testing.assert_allclose(data.D, data.tested_force, rtol=1e-14)  # E/(pi A) rounds


def test_a_sweep_of_one_wing_keeps_its_nearest_row(swept):
    record = swept(PAIR.force, LEVELS[:1])
    wing = type(record)(record.table[record.table["phase"] < 0.2 * np.pi].reset_index(drop=True), record.source)
    data = near_resonance(wing)
    assert len(data.A) == 1
    np.testing.assert_allclose(data.A[0], wing.table["amplitude"].max(), rtol=1e-12)


@pytest.mark.parametrize("column", ["A", "D", "omega"])
def test_one_row_a_sweep_at_resonance(column, swept):
    data = near_resonance(swept(PAIR.force, LEVELS))
    alone = at_resonance(data)
    tested = {"A": data.tested_amplitude, "D": data.tested_force, "omega": data.tested_omega}
    np.testing.assert_array_equal(getattr(alone, column), tested[column])
    assert not alone.has_repeats


def test_too_many_rows_or_sweeps_are_refused_in_a_line():
    def record(rows, sweeps):
        A = np.linspace(1.0, 2.0, rows)
        columns = {"sweep": [str(i % sweeps) for i in range(rows)], "force": A, "frequency": A, "amplitude": A}
        return Record(pd.DataFrame({**columns, "phase": 1.5}), "r.csv")

    assert len(observe(record(MOST_ROWS, MOST_SWEEPS)).sweeps) == MOST_SWEEPS
    for rows, sweeps in ((MOST_ROWS + 1, 3), (MOST_SWEEPS + 1, MOST_SWEEPS + 1)):
        with pytest.raises(AnalysisError, match=f"{rows} rows of {sweeps} sweeps.*every second one"):
            observe(record(rows, sweeps))
