"""One level of peaks that is off the course of the others is named, and levels of right structures never are."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from audit_cases import record_of

import damping as dp
from damping.arrays import FloatArray
from damping.records import Finding, audit
from damping.records.check_sweeps import check_outlier
from damping.records.odd_levels import ODD, OF_OTHERS, _list_suspects
from damping.records.view import View
from damping_validation.truths import OMEGA, TRUTHS, draw_truth

MODE = dp.Mode(name="bracket", frequency=25.0, mass=40.0)
STRUCTURES = 200
#: The first quarter of those that must all be right, and all.
DRAWN = pytest.mark.parametrize(
    "structures", [STRUCTURES // 4, pytest.param(STRUCTURES, marks=pytest.mark.slow)], ids=["quarter", "all"]
)


def peaks_of(force: object, frequency: object, amplitude: object) -> dp.Record:
    """A record of peaks, one a level."""
    table = pd.DataFrame({"force": force, "frequency": frequency, "amplitude": amplitude})
    table.insert(0, "sweep", [f"L{k + 1}" for k in range(len(table))])
    return record_of(table)


def tell(force: object, frequency: object, amplitude: object) -> Finding | None:
    """What the audit says of readings that are off."""
    findings = audit(peaks_of(force, frequency, amplitude), MODE).findings
    return next((one for one in findings if one.check == "outlier"), None)


@pytest.mark.parametrize(
    ("frequency", "verdict"),
    [
        ((25.0, 31.0, 25.0, 25.0), "refuse"),
        ((25.0, 31.0, 25.0), "refuse"),
        ((25.0, 25.4, 25.0, 25.01), "caution"),
        ((25.01, 24.98, 25.0, 25.3, 25.02), "caution"),
        ((17.85, 17.17, 17.60, 17.56), "caution"),  # 17.71 of the example bolted-joint
        ((24.8, 24.4, 42.1, 23.7, 23.3), "refuse"),
    ],
)
def test_a_frequency_that_jumps_and_returns_is_named(frequency, verdict):
    force = 4.0 * 1.6 ** np.arange(len(frequency))
    found = tell(force, frequency, 6e-5 * force)
    off = np.abs(np.array(frequency) - np.median(frequency))
    assert found is not None
    assert (found.verdict, found.sweeps) == (verdict, (f"L{np.argmax(off) + 1}",))
    assert f"frequency {frequency[np.argmax(off)]:g} at row {np.argmax(off) + 1} " in found.what


@pytest.mark.parametrize("lowest", [True, False])
def test_a_low_reading_at_the_lowest_force_may_be_held_by_friction(lowest):
    """Below its breakaway force friction holds a structure, which then moves only as its joints deform."""
    force = 4.0 * 1.6 ** np.arange(5)
    amplitude = np.where(np.arange(5) == (0 if lowest else 2), 1e-6, 1e-4) * force
    found = tell(force, np.full(5, 25.0), amplitude)
    assert found is not None
    assert ("friction holds" in found.advice) == lowest


def test_a_level_run_twice_tells_of_a_wrong_frequency():
    force = [4.0, 8.0, 8.0, 16.0]
    found = tell(force, [25.0, 25.0, 25.4, 25.0], [2.5e-4, 5e-4, 5.01e-4, 1e-3])
    assert found is not None
    assert found.sweeps == ("L3",)


@pytest.mark.parametrize("column", ["mass", "added_mass"])
def test_levels_of_other_masses_have_other_frequencies(column):
    """A tenth more mass at one level: 4.7 % less frequency; a wrong amplitude is told there too."""
    table = pd.DataFrame({"sweep": list("ABCD"), "force": [4.0, 8.0, 16.0, 24.0]})
    table = table.assign(frequency=[25.0, 25.0 / 1.1**0.5, 25.0, 25.0], amplitude=6e-5 * table["force"])
    table[column] = [40.0, 44.0, 40.0, 40.0] if column == "mass" else [0.0, 4.0, 0.0, 0.0]
    assert "outlier" not in [one.check for one in audit(record_of(table), MODE).findings]
    table.loc[2, "amplitude"] *= 100.0
    assert ("C",) in [one.sweeps for one in audit(record_of(table), MODE).findings if one.check == "outlier"]


def draw_levels(rng: np.random.Generator) -> FloatArray:
    """Forces of three to eight levels, some of them run twice or more."""
    force = rng.uniform(1.2, 2.2) ** np.arange(rng.integers(3, 9))
    return np.sort(np.append(force, rng.choice(force, rng.integers(0, 4))))


@DRAWN
def test_no_frequency_of_a_right_structure_is_accused(structures):
    """Frequencies that fall or rise steadily by up to a third, with a scatter of up to .1 %, and repeats of levels."""
    rng = np.random.default_rng(22)
    for _ in range(structures):
        force = draw_levels(rng)
        a = (force / force[-1]) ** rng.uniform(0.5, 1.0)
        slip = a / (a + rng.uniform(0.1, 1.0))
        course = (a**2, slip, np.log(a / a[0]), np.zeros_like(a))[rng.integers(4)]
        scatter = rng.choice([0.0, 3e-4, 1e-3]) * rng.standard_normal(len(a))
        frequency = 25.0 * (1.0 + rng.uniform(-0.33, 0.33) * course / max(course.max(), 1.0)) * np.exp(scatter)
        amplitude = 1e-3 * a * np.exp(0.02 * rng.standard_normal(len(a)))
        assert check_outlier(View(peaks_of(5.0 * force, frequency, amplitude), MODE)) is None, (frequency, amplitude)


@DRAWN
def test_no_frequency_of_a_drawn_truth_is_accused(structures):
    """Joints with a memory and springs beside every kind of damping."""
    rng = np.random.default_rng(23)
    for _ in range(structures):
        truth = draw_truth(str(rng.choice(sorted(TRUTHS))), rng)
        force = np.exp(rng.uniform(-1.0, 0.0)) * draw_levels(rng)
        amplitude = truth.amplitude(force)
        force, amplitude = force[np.isfinite(amplitude)], amplitude[np.isfinite(amplitude)]
        frequency = truth.omega(amplitude) * np.exp(1e-3 * rng.standard_normal(len(force))) / (2.0 * np.pi)
        mode = dp.Mode(name="m", frequency=OMEGA / (2.0 * np.pi), mass=truth.mass)
        found = check_outlier(View(peaks_of(force, frequency, amplitude), mode))
        assert found is None or "frequency jumps" not in found.what, (truth.name, frequency, amplitude)


@pytest.mark.parametrize(
    ("sets", "most"), [(STRUCTURES, 0.03), pytest.param(2 * STRUCTURES, 0.02, marks=pytest.mark.slow)]
)
def test_an_amplitude_between_others_that_is_misread_is_named(sets, most):
    """Every kind of damping, 5 to 8 peaks, noise of .3 to 4 %; 15 % too much or too little where it is below 2 %.

    Of 7000 other such sets .5 % are accused, and 65 % of those misread, one of 300 at another level: of 200 (400)
    fewer than 3 % (2 %), and of the half of them that is misread more than half and at most 2, with .99 probability.
    """
    rng = np.random.default_rng(24)
    accused, named = [], []
    for number in range(sets):
        truth = draw_truth(sorted(TRUTHS)[number % len(TRUTHS)], rng)
        levels = int(rng.integers(5, 9))
        force = np.exp(np.linspace(-0.5, 0.5, levels) * np.log(rng.uniform(1.3, 8.0)))
        noise = rng.uniform(0.003, 0.04)
        amplitude = truth.amplitude(force) * np.exp(noise * rng.standard_normal(levels))
        frequency, mode = np.full(levels, 1.6), dp.Mode(name="m", frequency=1.6, mass=truth.mass)
        accused.append(check_outlier(View(peaks_of(force, frequency, amplitude), mode)) is not None)
        if noise < 0.02 and not accused[-1]:
            k = int(rng.integers(1, levels - 1))
            amplitude[k] *= 1.15 if number % 2 else 1.0 / 1.15
            found = check_outlier(View(peaks_of(force, frequency, amplitude), mode))
            named.append(None if found is None else found.sweeps == (f"L{k + 1}",))
            assert found is None or found.verdict == "caution"
    assert np.mean(accused) < most
    assert np.mean([right is not None for right in named]) > 0.5
    assert named.count(False) <= 2  # one of 300


@pytest.mark.parametrize("wrong", range(4))
@pytest.mark.parametrize("factor", [0.1, 10.0, 1000.0])
def test_of_four_levels_the_wrong_amplitude_is_named_and_no_other(wrong, factor):
    """Leaving the wrong one out, the others lie on one line; leaving a right one out they do not."""
    amplitude = np.array([0.00025, 0.00049, 0.00100, 0.0016])
    amplitude[wrong] *= factor
    found = tell([4.0, 8.0, 16.0, 25.0], 25.0, amplitude)
    assert found is not None
    assert (found.verdict, found.sweeps) == ("refuse", (f"L{wrong + 1}",))
    assert f"amplitude {amplitude[wrong]:g} at row {wrong + 1} (" in found.what


def test_where_levels_do_not_tell_which_is_wrong_all_are_named():
    """Of two forces alone any of the three that do not agree may be the wrong one."""
    found = tell([4.0, 4.0, 8.0, 8.0], 25.0, [0.00025, 0.00025, 0.05, 0.0005])
    assert found is not None
    assert found.sweeps == ("L3", "L4")
    assert "do not show which of them is wrong" in found.what


def test_suspects_are_few_and_hold_every_odd_level():
    """Against fits without each level in turn: of 400 levels few are suspects, and no odd one is lost."""
    rng = np.random.default_rng(5)
    x = np.sort(rng.uniform(0.0, 3.0, 400))
    y = x + 0.1 * x**2 + 0.005 * rng.normal(size=400)
    y[7] += 0.4
    suspects, odd = _list_suspects(x, y), []
    for k in range(400):
        others = np.arange(400) != k
        for degree in (0, 1, 2):
            miss = y - np.polyval(np.polyfit(x[others], y[others], degree), x)
            if abs(miss[k]) > np.log(ODD) and np.abs(miss[others]).max() < OF_OTHERS * abs(miss[k]):
                odd.append(k)
    assert suspects == [7] == odd
    x = np.repeat([1.0, 2.0], 10)  # no parabola; and a level that alone gives the trend its slope
    assert _list_suspects(x, x) == []
    assert 0 in _list_suspects(np.r_[0.0, np.ones(9)], np.r_[0.5, np.ones(9)])
