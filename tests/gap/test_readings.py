"""Readings that no fit follows, and noise that is stated too small: said, and told from what a cause does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from damping.effects import CATALOGUE
from damping.gap.corrected import list_ends
from damping.gap.diagnose import diagnose
from damping.gap.directed import Test, directed_tests
from damping.gap.outliers import find_pattern
from damping.gap.readings import describe_rest, describe_rounding, list_far_readings
from damping.gap.rows import read_rows
from damping.gap.where import trend
from damping.records.record import Record
from damping.report.gap import describe_diagnosis
from damping.result import DiagnosisResult
from tests.gap.limited import limited

#: What any record of these is compared with: enough to be blamed, and quick.
FEW = {name: CATALOGUE[name] for name in ("velocity-squared", "coulomb-friction", "sensor-saturation")}
POINTS = 20


@pytest.fixture(scope="module")
def honest(lab):
    """Three sweeps of the simulation itself, in closed form, with the noise that they state."""
    rows = lab.bench(points=POINTS).rows
    return lab.record(rows, lab.linear(rows), 2)


def spoilt(record, rows, factor, quantity="amplitude"):
    """The record with a factor on the readings of some rows."""
    table = record.table.copy()
    table.loc[rows, quantity] *= factor
    return Record(table)


def peak(record, sweep):
    """The row of the largest amplitude of a sweep."""
    own = record.table[record.table["sweep"] == sweep]
    return int(own["amplitude"].idxmax())


def test_a_stray_reading_is_set_aside_and_said(lab, honest):
    row = POINTS + 4  # beside the peak of sweep B
    record = spoilt(honest, [row], 1.3)
    found = limited(FEW, diagnose, record, lab.mode())
    assert (found.leading.effects, found.unexplained) == ((), False)
    assert found.gap.after < 1.2  # without it; with it sqrt(1 + 30^2/120) = 2.9
    (reading,) = list_far_readings(found.leading.best)
    hertz = record.table["frequency"][row]
    assert (reading.sweep, reading.quantity, reading.frequency) == ("B", "amplitude", pytest.approx(hertz, rel=1e-12))
    # ln 1.3 over a noise of .01/1.3 of what was read, 34, within three of its own noise
    np.testing.assert_allclose(reading.sigma, 1.3 * np.log(1.3) / lab.noise, rtol=0.0, atol=3.0)
    (said,) = [caution for caution in found.cautions if "reading" in caution and "excluded as stray" in caution]
    assert said.startswith(f"1 reading excluded as stray from the numbers of the gap: {reading}")
    (listed,) = DiagnosisResult(found).to_json()["far_off"]
    assert listed == {**vars(reading), "set_aside": True}


@pytest.mark.parametrize(
    ("places", "factor", "words"),
    [
        ([-2, -1, 0, 1], 0.7, "4 readings far off side by side"),
        ([0], 1.4, "1 reading far off at the peak of a sweep"),
        ([-9, -7, -5, 4, 6, 8], 1.3, "6 readings far off in 6 of 60 rows, too many to be stray"),
    ],
    ids=["a top that is cut off in one of two sweeps", "the peak", "a tenth of the rows"],
)
def test_readings_that_no_chance_puts_there_are_unexplained(lab, honest, places, factor, words):
    rows = lab.bench(levels=2, points=POINTS).rows
    again = lab.record(rows, lab.linear(rows), 8).table
    top = again[again["sweep"] == "B"].assign(sweep="D")  # the highest level once more
    table = honest.table if len(places) > 4 else pd.concat([honest.table, top], ignore_index=True)
    record = spoilt(Record(table), peak(honest, "C") + np.array(places), factor)
    if len(places) <= 4:
        words = words.replace("6 of 60", "6 of 80")
    found = limited(FEW, diagnose, record, lab.mode())
    assert (found.leading.effects, found.unexplained) == ((), True)
    assert found.gap.after > 2.0  # they are in the numbers
    (verdict,) = describe_diagnosis(found)["verdict"]
    assert verdict.startswith(f"The simulation fits the test except for {words}")
    assert "fits the test to its noise" not in verdict
    assert any(caution.startswith(words) for caution in found.cautions)
    assert not any(reading["set_aside"] for reading in DiagnosisResult(found).to_json()["far_off"])


def test_stray_readings_are_few_and_anywhere(lab, honest):
    rows = read_rows(honest, lab.mode())
    n = len(rows)
    tops = [own[np.argmax(rows.u[own])] for own in rows.runs]

    def pattern(places, size):
        r = np.zeros(2 * n)
        r[places] = size
        return find_pattern(rows, r, r != 0.0, np.full(n, 1e-6))

    assert pattern([], 0.0) == ""
    assert pattern([3, 30, 50, n + 10], 40.0) == ""
    assert pattern([4, 5], 40.0) == ""
    assert "side by side" in pattern([4, 5, 6], 40.0)
    assert "side by side" in pattern([4, n + 5, 6], 40.0)  # of any quantity
    assert pattern([POINTS - 1, POINTS, POINTS + 1], 40.0) == ""  # of two sweeps
    assert "at the peak" in pattern([tops[1]], 40.0)
    assert pattern([n + tops[1]], 40.0) == ""  # a phase has no peak
    # one of 60 readings is at one of three peaks by chance once in 20 times, and 15 of N(0, 10^2) is exceeded by 13 %
    assert pattern([tops[1]], 15.0) == ""
    assert pattern([0, 3, 6, 22, 25], 40.0) == ""
    assert "too many" in pattern([0, 3, 6, 22, 25, 28], 40.0)  # one more than .05 x 60 + 2
    # three of 60 rows at one of 20 frequencies: 20 (3/60)^3 is .0025 by chance, two of 60 at one 20 x 3 (2/60)^2, .07
    assert "at one frequency in 3 sweeps" in pattern([2, POINTS + 2, n + 2 * POINTS + 2], 40.0)
    assert pattern([2, POINTS + 2], 40.0) == ""
    assert pattern([2, POINTS + 4, 2 * POINTS + 6], 40.0) == ""


@pytest.mark.parametrize("factor", [2.0, 6.0])
def test_noise_that_is_stated_too_small_is_said_and_is_no_cause(lab, factor):
    rows = lab.bench(points=POINTS).rows
    table = lab.record(rows, lab.linear(rows), 4).table
    record = Record(table.assign(**{name: table[name] / factor for name in ("amplitude_sd", "phase_sd")}))
    found = limited(FEW, diagnose, record, lab.mode())
    assert found.leading.effects == ()
    assert found.unexplained  # more than the stated noise is left: its root mean square is that factor
    np.testing.assert_allclose(found.gap.after, factor, rtol=0.2, atol=0.0)  # 120 values: .065, three of these
    # 51 kept of 60 values: known to .8/sqrt(60) = .1, three of these
    scatter = found.understated
    np.testing.assert_allclose([scatter.amplitude, scatter.phase], factor, rtol=0.3, atol=0.0)
    assert found.in_library > 0.5
    (verdict,) = describe_diagnosis(found)["verdict"]
    assert str(scatter) in verdict
    assert "Is the stated noise right?" in verdict
    assert "nothing in the library" not in verdict
    (said,) = [caution for caution in found.cautions if "white along every sweep" in caution]
    assert said == f"the {scatter}: is the stated noise right?"
    assert f"Caution: {said}" in DiagnosisResult(found).sentences  # and no full stop after it


def test_readings_of_a_coarse_range_are_said_to_be_rounded(honest):
    """To a fifth of the smallest amplitude, and to 5 degrees; not to four digits, nor without a step."""
    table, least, degrees = honest.table, honest.column("amplitude").min(), np.radians(5.0)
    for name, step, most in (("amplitude", 0.2 * least, "10 % of the smallest"), ("phase", degrees, "0.044 rad")):
        (said,) = describe_rounding(Record(table.assign(**{name: step * np.round(table[name] / step)})))
        assert said.startswith(f"every {name} is a multiple of {step:.3g}: rounded by up to {most}")
    fine = [float(f"{A:.4g}") for A in table["amplitude"]]
    assert describe_rounding(honest) == describe_rounding(Record(table.assign(amplitude=fine))) == []


def test_noise_that_is_stated_too_small_hides_no_large_cause(lab):
    table = lab.measured("velocity-squared").table
    record = Record(table.assign(**{name: table[name] / 3.0 for name in ("amplitude_sd", "phase_sd")}))
    found = limited(FEW, diagnose, record, lab.mode())
    assert found.leading.effects == ("velocity-squared",)
    np.testing.assert_allclose(found.understated.amplitude, 3.0, rtol=0.3, atol=0.0)
    assert found.in_library > 0.5
    (verdict,) = describe_diagnosis(found)["verdict"]
    assert "What is left is scatter" in verdict


def correlated(record, rows, rho, seed, scale):
    """Readings with errors that go together from row to row within each sweep as rho, (rows,) of N(0, scale^2)."""
    rng, table = np.random.default_rng(seed), record.table.copy()
    for quantity, size in (("amplitude", table["amplitude"]), ("phase", 1.0)):
        e = rng.normal(size=len(table))
        for k in np.flatnonzero(rows.sweep[1:] == rows.sweep[:-1]) + 1:
            e[k] = rho * e[k - 1] + np.sqrt(1.0 - rho**2) * e[k]
        table[quantity] += scale * e * size
    return Record(table)


def test_errors_that_go_together_are_no_white_scatter_and_are_named(lab):
    rows = lab.bench(points=POINTS).rows
    exact = lab.record(rows, lab.linear(rows))
    one = limited({}, diagnose, correlated(exact, rows, 0.9, 5, lab.noise), lab.mode())
    assert one.unexplained
    assert one.understated is None
    (verdict,) = describe_diagnosis(one)["verdict"]
    assert "; residuals of neighbouring rows are correlated (p < 0.001)), and nothing in the library" in verdict
    many = limited({}, diagnose, correlated(exact, rows, 0.9, 5, 3.0 * lab.noise), lab.mode())
    assert many.setting.dispersion > 1.0
    assert many.understated is None


def test_what_shows_a_rest_is_named(lab, honest):
    fit = limited({}, diagnose, honest, lab.mode()).leading.best
    tests = [Test("drift", 1.0, 3, 0.5), Test("second path", 60.0, 14, 5e-4)]
    assert describe_rest(fit, tests) == "a second path of the force, free over frequency, improves the fit (p = 0.001)"
    assert describe_rest(fit, tests[:1]) == ""
    for test in directed_tests(fit):
        assert describe_rest(fit, [replace(test, p_value=1e-9)]).endswith("(p < 0.001)")


def test_a_hard_clip_is_at_no_end(lab):
    """A compression of the largest power is a clip; one of the least, and too large a clip, is at its end."""
    rows = lab.bench(points=POINTS).rows
    cells = lab.linear(rows)
    level = 0.7 * cells.amplitude.max()
    a = np.maximum(cells.amplitude / level, 1.0)  # fundamental of a sine that is cut off at a level
    end = np.arcsin(1.0 / a)
    cut = np.where(a > 1.0, level * (2.0 / np.pi) * (a * end + np.cos(end)), cells.amplitude)
    record = lab.record(rows, replace(cells, amplitude=cut), 3)
    found = limited(FEW, diagnose, record, lab.mode())
    assert found.leading.effects == ("sensor-saturation",)
    assert list_ends(found.leading.best) == []
    fit = found.leading.best
    (form,) = [form for form in CATALOGUE["sensor-saturation"].forms(fit.model.problem.scales) if form.shapes]
    part = replace(fit.model.parts[0], form=form)
    for power, ends in ((4.0, 0), (-4.0, 1)):
        model = replace(fit.model, parts=(part,), at=None)
        y = np.zeros(model.size + 2 * model.sweeps)
        y[model.size - 1] = power
        assert len(list_ends(replace(fit, model=model, y=y))) == ends


def test_a_channel_across_that_reads_its_floor_is_no_cause(lab, honest):
    """Of any phase in half a turn, as of hum: its mean is none of noise, and it never rises above its floor."""
    rng, n = np.random.default_rng(3), len(honest)
    floor = 0.002 * honest.table["amplitude"].max() * np.abs(1.0 + 0.3 * rng.normal(size=n))
    record = Record(honest.table.assign(amplitude_y=floor, phase_y=rng.uniform(0.0, 3.0, n)))
    found = limited(FEW, diagnose, record, lab.mode())
    assert (found.leading.effects, found.unexplained) == ((), False)


def test_peaks_of_one_frequency_are_diagnosed(lab):
    """No trend of a frequency that is the same in every row, to the last digit."""
    forces = np.array([1.0, 2.0, 4.0, 8.0])
    amplitude = forces / (lab.viscous * lab.omega)  # viscous damping at phase resonance
    table = {"sweep": list("ABCD"), "force": forces, "frequency": lab.omega / (2.0 * np.pi), "amplitude": amplitude}
    found = limited(FEW, diagnose, Record(pd.DataFrame(table)), lab.mode())
    assert found.leading.effects == ()
    assert DiagnosisResult(found).to_json()["effects"] == []


def test_equal_values_have_no_trend():
    """A constant leaves exactly nothing of them: no share of it is a power's."""
    found = trend(np.array([1.0, 2.0, 4.0]), np.ones(3), np.ones(3))
    assert found is not None
    assert found.share == 0.0


def test_chances_are_read_as_sentences(lab, honest):
    found = limited({}, diagnose, honest, lab.mode())
    (verdict,) = describe_diagnosis(replace(found, unexplained=True, in_library=0.0))["verdict"]
    assert verdict.endswith("The chance that the cause is in the library at all is less than 0.001.")
