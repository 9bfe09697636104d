"""Swept records against the full equation of motion integrated in time."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

import damping as dp
from damping import agreement
from damping.effects import CATALOGUE
from damping.errors import AnalysisError
from damping.predict.sweep_rate import as_steady, correct_rate, envelope, estimate_rate
from damping.records import audit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.rows import list_rates
from damping.records.text import AGREED

F_N = 20.0
RATIO = 0.01
GROWTH = 300.0
MASS = 2.0
RATE = 4.0  # octaves a minute


def full(force: float, frequency: np.ndarray, rate: float, growth: float = GROWTH) -> np.ndarray:
    """Complex amplitude by integrating q'' = F/m cos(theta) - 2 z(|a|) w_n q' - w_n^2 q, demodulated period by period.

    The damping follows the local amplitude, taken from energy: |a|^2 = q^2 + (q'/omega)^2.
    """
    r = rate * np.log(2.0) / 60.0
    w_0, w_n = 2 * np.pi * 0.8 * frequency[0], 2 * np.pi * F_N

    def theta(t):
        return w_0 * (np.exp(r * t) - 1.0) / r

    def rates(t, y):
        size = np.hypot(y[0], y[1] / w_n)
        damping = 2 * RATIO * (1 + growth * size) * w_n * y[1]
        return [y[1], force / MASS * np.cos(theta(t)) - damping - w_n**2 * y[0]]

    times = np.log(2 * np.pi * frequency / w_0) / r
    found = solve_ivp(
        rates, (0.0, times[-1] + 1.0), [0.0, 0.0], max_step=0.004, rtol=1e-7, atol=1e-12, dense_output=True
    )
    amplitudes = []
    for t, f in zip(times, frequency, strict=True):
        at = t + np.linspace(-1.5, 1.5, 301) / f
        basis = np.column_stack([np.cos(theta(at)), -np.sin(theta(at))])
        growing = np.column_stack([basis, basis * (at - t)[:, None]])
        c = np.linalg.lstsq(growing, found.sol(at)[0], rcond=None)[0]
        amplitudes.append(c[0] + 1j * c[1])
    return np.array(amplitudes)


def steady(force: float, frequency: np.ndarray) -> np.ndarray:
    w, w_n = 2 * np.pi * frequency, 2 * np.pi * F_N
    A = np.zeros_like(w)
    for _ in range(200):
        A = 0.5 * A + 0.5 * force / MASS / np.hypot(w_n**2 - w**2, 2 * RATIO * (1 + GROWTH * A) * w_n * w)
    return force / MASS / (w_n**2 - w**2 + 2j * RATIO * (1 + GROWTH * A) * w_n * w)


def record(motions: dict[float, np.ndarray], frequency: np.ndarray, rng: np.random.Generator) -> Record:
    tables = []
    for force, a in motions.items():
        noisy = a * np.exp(0.003 * (rng.normal(size=len(a)) + 1j * rng.normal(size=len(a))))
        columns = {"sweep": f"{force:g}", "force": force, "frequency": frequency, "amplitude": np.abs(noisy)}
        tables.append(pd.DataFrame(columns | {"phase": -np.angle(noisy)}))
    return Record(pd.concat(tables, ignore_index=True), "made")


def test_the_audit_names_the_rate(frequency, swept):
    """By the phases, which turn late; no other check blames something else, no second plane or offset is invented."""
    made = record(swept, frequency, np.random.default_rng(4))
    found = audit(made, Mode(name="made", frequency=F_N, mass=MASS))
    assert [finding.check for finding in found.findings] == ["sweep-rate"]
    assert found.verdict == "caution"
    said = float(found.findings[0].what.split(" octaves")[0].split()[-1])
    np.testing.assert_allclose(said, RATE, rtol=0.25)  # a first look; ``estimate_rate`` then tells it to a few per cent
    steady_rows = record({force: steady(force, frequency) for force in swept}, frequency, np.random.default_rng(4))
    assert audit(steady_rows).findings == ()


@pytest.mark.parametrize(
    ("bandwidths", "verdicts"), [(0.2, {}), (1.5, {"sweep-rate": "caution"}), (3.5, {"sweep-rate": "refuse"})]
)
def test_a_known_rate_is_a_fault_by_how_fast_it_is(bandwidths, verdicts):
    """(df/dt)/(2 zeta f)^2 of a linear mode; a slow one drags the phases by 2/pi of it, which no delay of channels did.

    The peaks of a fast one are low, which makes it look slower: 2.3 of 3.5.
    """
    hertz = bandwidths * (2.0 * RATIO * F_N) ** 2
    frequency = np.linspace(19.7, 20.6, 25)
    octaves = 60.0 / np.log(2.0) * hertz / F_N
    a = {force: envelope(frequency, octaves, force, MASS, F_N, RATIO) for force in (1.5, 4.0, 9.0)}
    made = record(a, frequency, np.random.default_rng(5))
    swept_record = Record(made.table.assign(sweep_rate=hertz * made.table["frequency"] / F_N), "made")
    found = audit(swept_record, Mode(name="made", frequency=F_N, mass=MASS)).findings
    assert {finding.check: finding.verdict for finding in found} == verdicts


def test_a_sweep_that_left_few_rows_says_what_to_do():
    f = np.array([19.9, 20.0, 20.1])
    made = record({1.5: steady(1.5, f)}, f, np.random.default_rng(4)).table.assign(sweep_rate=2.0)
    with pytest.raises(AnalysisError, match=r"has 3 frequencies .* 5 are needed to correct it; sweep slower, or dwell"):
        correct_rate(Record(made, "made"), MASS)


@pytest.fixture(scope="module")
def frequency() -> np.ndarray:
    return np.geomspace(18.8, 21.4, 29)


@pytest.fixture(scope="module")
def swept(frequency) -> dict[float, np.ndarray]:
    return {force: full(force, frequency, RATE) for force in (1.5, 4.0, 9.0)}


def test_the_envelope_is_the_full_equation(frequency, swept):
    for force, a in swept.items():
        found = envelope(frequency, RATE, force, MASS, F_N, RATIO, GROWTH)
        # what is left out, a'' against omega a', is of the order of the damping ratio times the severity at the peak
        ratio = RATIO * (1 + GROWTH * np.abs(a).max())
        severity = RATE * np.log(2.0) / 60.0 * F_N / (2.0 * ratio * F_N) ** 2
        np.testing.assert_allclose(found, a, atol=ratio * severity * np.abs(a).max(), rtol=0.0)


def test_the_rate_is_found_and_taken_out(frequency, swept):
    made = record(swept, frequency, np.random.default_rng(3))
    rate = estimate_rate(made, MASS, F_N)
    np.testing.assert_allclose(rate.octaves_a_minute, RATE, rtol=0.05)  # 0.3 % of noise, and the order of the envelope
    corrected, said = as_steady(made, MASS, F_N)
    assert "octaves a minute" in said[0]
    table = corrected.table
    w, w_n = 2 * np.pi * table["frequency"].to_numpy(), 2 * np.pi * F_N
    A = table["amplitude"].to_numpy()
    loss = table["force"] * np.sin(table["phase"]) / (MASS * A * 2 * w_n * w)
    high = 0.7 * table.groupby("sweep")["amplitude"].transform("max").to_numpy() < A
    true = RATIO * (1 + GROWTH * A)
    # the slope from rows 0.5 % apart: each row to some per cent, their median to 2 %
    np.testing.assert_allclose(np.median(loss[high] / true[high]), 1.0, atol=0.02)
    lowest = made.table[made.table["sweep"] == "1.5"]
    # the peak was passed half a per cent late or more, a row being 0.46 %
    assert lowest.loc[lowest["amplitude"].idxmax(), "frequency"] > 1.005 * F_N


def test_frequencies_read_twice_have_the_slope_of_their_mean(frequency, swept):
    """Equal readings give each row what it has alone: a spline through repeated frequencies does not exist."""
    rate = RATE * np.log(2.0) / 60.0 * frequency
    alone = record(swept, frequency, np.random.default_rng(3)).table.assign(sweep_rate=np.tile(rate, len(swept)))
    twice = pd.concat([alone, alone.assign(other=1.0)])
    (once, _), (both, said) = (as_steady(Record(table, "made"), MASS, F_N) for table in (alone, twice))
    assert "corrected" in said[0]
    for _, rows in both.table.groupby(both.table["other"].notna()):
        close = rows[["force", "phase"]].reset_index(drop=True)
        pd.testing.assert_frame_equal(close, once.table[["force", "phase"]], rtol=1e-12)


def test_a_steady_record_stays_as_it_is(frequency):
    made = record({force: steady(force, frequency) for force in (1.5, 4.0, 9.0)}, frequency, np.random.default_rng(4))
    same, said = as_steady(made, MASS, F_N)
    assert same is made
    assert said == ()


def test_an_empty_rate_is_that_of_its_sweep_and_not_0():
    """Rates of 0.1 f at some rows of one sweep, between which the others lie; a rig's comes first; else none is known.

    Rows are as taken: up through a logarithmic sweep, f proportional to its rate.
    """
    stated = np.array([1.0, np.nan, 1.2, np.nan, np.nan, np.nan])
    table = pd.DataFrame({"sweep": [*"aaaabb"], "force": 1.0, "frequency": [10.0, 11.0, 12.0, 13.0, 10.0, 11.0]})
    made = Record(table.assign(amplitude=1.0, sweep_rate=stated), "made")
    np.testing.assert_allclose(list_rates(made, None), [1.0, 1.1, 1.2, 1.2, 0.0, 0.0], rtol=1e-12)
    np.testing.assert_allclose(list_rates(made, -2.0), [1.0, -2.0, 1.2, -2.0, -2.0, -2.0], rtol=1e-12)


def test_rates_need_phases(frequency):
    table = pd.DataFrame({"sweep": "a", "force": 1.0, "frequency": frequency, "amplitude": 1.0, "sweep_rate": 5.0})
    made = Record(table, "made")
    assert as_steady(made, MASS, F_N) == (made, ())


def test_diagnoses_read_rows_as_swept_and_predictions_steady_states(frequency, swept, monkeypatch, few_laws, no_rivals):
    """Steady states that the rate was taken out of leave traces, which a diagnosis would take for a second plane; and
    peaks that a fast sweep never reached, which a prediction would take for damping."""
    made = record(swept, frequency, np.random.default_rng(4))
    viscous = 2.0 * RATIO * MASS * 2.0 * np.pi * F_N
    mode = Mode(name="made", frequency=F_N, mass=MASS, damping={"viscous": {"coefficient": viscous}})
    planes = {"planar-coupling": CATALOGUE["planar-coupling"]}
    monkeypatch.setattr("damping.gap.diagnose.CATALOGUE", planes)
    compared = []
    monkeypatch.setattr(agreement, "compare", lambda *both: compared.append(both) or AGREED)
    loads, diagnosis = dp.extrapolate(made, mode, [2.0 * max(swept)]), dp.diagnose(made, mode)
    (first, explained), (predicted, _) = compared
    assert loads.extrapolation.plan is first.plan
    assert explained.record is made
    assert diagnosis.against == AGREED
    np.testing.assert_allclose(predicted.plan.data.tested_amplitude, first.plan.data.tested_amplitude, rtol=1e-12)
