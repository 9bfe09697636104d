"""Readings at a ceiling: of modes in closed form or by the library's steady states, clipped, rounded, controlled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from audit_cases import LAWS, Bench, at_one_amplitude, clean, dropped_out, measured, record_of

from damping.records import audit
from damping.records.check_ceiling import DIGITS, check_ceiling, count_digits, find_ceiling
from damping.records.view import View

BENCH = Bench(levels=3, rows=41, noise=0.005, span=(-6.0, 6.0))


def ceiling(share: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """Readings no larger than a share of the largest."""
    return lambda table: table.assign(amplitude=table["amplitude"].clip(upper=share * table["amplitude"].max()))


def clipped_sine(share: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """The fundamental of a sine of amplitude A clipped at L: (2/pi) (A asin(L/A) + L sqrt(1 - (L/A)^2))."""

    def clip(table: pd.DataFrame) -> pd.DataFrame:
        A = table["amplitude"].to_numpy()
        L = share * A.max()
        s = np.minimum(1.0, L / A)
        return table.assign(amplitude=2.0 / np.pi * (A * np.arcsin(s) + L * np.sqrt(1.0 - s**2)))

    return clip


def found_in(table: pd.DataFrame, bench: Bench) -> list[str]:
    return [one.check for one in audit(record_of(table), bench.mode).findings]


@pytest.mark.parametrize("phase", [True, False])
@pytest.mark.parametrize("levels", [1, 3])
@pytest.mark.parametrize("share", [0.4, 0.6, 0.8])
def test_readings_at_one_ceiling_are_named(share, levels, phase):
    bench = replace(BENCH, levels=levels)
    table = ceiling(share)(measured(clean(bench), bench))
    table = table if phase else table.drop(columns="phase")
    (found,) = audit(record_of(table), bench.mode).findings
    assert (found.check, found.verdict) == ("sensor-saturation", "caution")
    assert found.sweeps[-1] == "ABC"[levels - 1]  # the largest response of all


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("phase", [True, False])
@pytest.mark.parametrize("share", [0.2, 0.3])
def test_a_ceiling_that_cuts_the_wings_off_is_named_by_readings_that_repeat(law, phase, share):
    """Most rows read the same to the last digit, and no row is far below them."""
    bench = replace(BENCH, law=law)
    table = ceiling(share)(measured(clean(bench), bench))
    assert "sensor-saturation" in found_in(table if phase else table.drop(columns="phase"), bench)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("bend", [0.0, 0.5])
@pytest.mark.parametrize("share", [0.4, 0.6])
def test_a_clipped_sine_is_named_by_its_phases_whatever_the_damping_and_the_spring(law, bend, share):
    """Noise after clipping, as of an instrument whose input clips."""
    bench = replace(BENCH, law=law, bend=bend, rows=61)
    assert found_in(measured(clipped_sine(share)(clean(bench)), bench), bench) == ["sensor-saturation"]


@pytest.mark.parametrize("digits", [2, 3])
def test_a_response_per_force_with_few_digits_has_no_ceiling(digits):
    """Times a force of more digits it has many; clipped, it stands at its ceiling times the force."""
    f = np.linspace(17.0, 23.0, 121)
    H = 0.01 / np.abs(1.0 - (f / 20.0) ** 2 + 0.1j * (f / 20.0))
    F = np.full(len(f), 3.3337) * (1.0 + 0.01 * np.sin(f))
    rounded = np.array([float(f"{value:.{digits - 1}e}") for value in H])
    assert find_ceiling(rounded, np.full(len(f), 3.3337), per_force=True) is None
    assert find_ceiling(H, F, per_force=True) is None
    found = find_ceiling(np.minimum(H * F, 0.2) / F, F, per_force=True)
    assert found == pytest.approx(0.2)


def test_readings_of_few_digits_have_them_in_another_unit():
    """Of all readings of three digits in mm a quarter differ from decimals in m, by a last bit."""
    A = np.arange(1, 1000) / 100.0
    assert any(a * 1e-3 != float(f"{a * 1e-3:.2e}") for a in A.tolist())
    assert count_digits(A) == count_digits(A * 1e-3) == 3
    # a value that differs in its seventh digit is no decimal of three
    assert count_digits(A * (1.0 + 1e-7)) == DIGITS
    f = np.linspace(19.0, 21.0, 121)
    q = np.round(1.0 / np.abs(1.0 - (f / 20.0) ** 2 + 0.1j * (f / 20.0)), 1)
    assert find_ceiling(q * 1e-3, np.ones(len(f))) is None


@pytest.mark.parametrize("factor", [1e-3, 1e-3 / 0.0254, 2.0**0.5, 9.80665 / (2.0 * np.pi * 20.0) ** 2])
@pytest.mark.parametrize(("digits", "rows"), [(2, 41), (3, 401)])
@pytest.mark.parametrize("written", [6, 17])
def test_readings_of_few_digits_have_no_ceiling_in_any_unit(factor, digits, rows, written):
    """Four or more rows share the largest reading; a sensor that clips finer readings there is still found."""
    f = np.linspace(18.5, 21.5, rows)
    q = 1.3 / np.abs(1.0 - (f / 20.0) ** 2 + 0.1j * (f / 20.0)) * 0.1

    def convert(values, digits):
        few = [float(f"{value:.{digits - 1}e}") for value in values]
        return np.array([float(f"{value * factor:.{written - 1}e}") for value in few])

    rounded = convert(q, digits)
    assert np.count_nonzero(rounded == rounded.max()) >= 4
    assert find_ceiling(rounded, np.ones(rows)) is None
    clipped = convert(np.minimum(q, 0.9 * q.max()), 6)
    assert find_ceiling(clipped, np.ones(rows)) == pytest.approx(0.9 * q.max() * factor, rel=1e-5)  # six digits


#: Every law on a straight spring, and two on one that bends to either side; ``make slow``: every law on every spring.
TOPS = [
    pytest.param(law, bend, marks=[pytest.mark.slow] * (bend != 0.0 and law not in ("viscous", "slip")))
    for law in LAWS
    for bend in (0.0, 1.0, -2.0)
]


@pytest.mark.parametrize(("law", "bend"), TOPS)
def test_right_tops_are_no_ceiling(law, bend):
    """Flat tops of damping and springs, of fine rows without noise; rounded to two digits; held at one response."""
    for rows in (21, 161):
        bench = replace(BENCH, law=law, bend=bend, rows=rows, noise=0.002)
        table = measured(clean(bench), bench)
        rounded = table.assign(amplitude=[float(f"{A:.2g}") for A in table["amplitude"]])
        for shown in (table, rounded, at_one_amplitude(bench), dropped_out(table, bench, 0.4)):
            for kept in (shown, shown.drop(columns="phase")):
                assert check_ceiling(View(record_of(kept), bench.mode)) is None, (rows, law)


def test_a_force_that_falls_at_resonance_at_every_level_is_no_ceiling():
    """Unrecorded, it makes readings too small at its frequencies, be they small or large."""
    table = measured(clean(BENCH), BENCH)
    lost = dropped_out(table, BENCH, 0.5).assign(force=table["force"])
    assert "sensor-saturation" not in found_in(lost, BENCH)


STEPS = 25.0  #: of the converter, up to the largest reading


@pytest.mark.parametrize("phase", [True, False])
def test_readings_in_steps_of_a_converter_are_no_ceiling(phase):
    """Several rows about a peak share one step of the converter, which is written in six digits."""
    bench = replace(BENCH, rows=61, noise=0.0, phase=phase)
    table = measured(clean(bench), bench)
    step = table["amplitude"].max() / STEPS * 1.00123
    stepped = table.assign(amplitude=np.maximum(np.round(table["amplitude"] / step), 1.0) * step)
    assert "sensor-saturation" not in found_in(stepped, bench)
    assert "sensor-saturation" in found_in(ceiling(0.6)(stepped), bench)
