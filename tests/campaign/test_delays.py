"""Delays common to all sensors of a campaign, against closed forms of steady modes."""

from __future__ import annotations

import re

import numpy as np
import pytest

from damping.campaign import analyse
from damping.campaign.delays import remove_delay
from damping.campaign.records import fit_levels
from damping.campaign.sources import read_runs
from tests.campaign.spectra import write_shaken

G, SIZE = 9.80665, 10_000_000
FREQUENCY = np.geomspace(25.0, 60.0, 500)
#: (Hz, damping ratio at rest, growth with amplitude in 1/m, share of stiffness lost in 1/m, participation).
MODES = ((38.0, 0.008, 600.0, 0.0, 0.9), (42.6, 0.006, 1200.0, 0.0, 0.5))
SHAPES = np.array([[1.0, 0.4], [0.7, -0.8], [-0.5, 0.9]])
LEVELS = (0.1, 0.2, 0.4)


def read(f, level, modes, shapes, delay):
    """Absolute accelerations (sensors, n) in g: each mode's own amplitude by bisection, later by ``delay`` s."""
    w, base = 2 * np.pi * f, level * G
    total = np.full((len(shapes), len(f)), base, complex)
    for shape, (hertz, ratio, growth, loss, part) in zip(shapes.T, modes, strict=True):
        w_n, low, high = 2 * np.pi * hertz, np.zeros_like(f), np.full_like(f, base / (ratio * (2 * np.pi * hertz) ** 2))
        for _ in range(60):
            A = 0.5 * (low + high)
            H = part * base / (w_n**2 * (1 - loss * A) - w**2 + 2j * ratio * (1 + growth * A) * w_n * w)
            low, high = np.where(np.abs(H) < A, low, A), np.where(np.abs(H) < A, A, high)
        total += shape[:, np.newaxis] * w**2 * H
    return total / G * np.exp(-1j * w * delay)


def write(path, rng, delay, modes=MODES, shapes=SHAPES, noise=0.005):
    readings = {}
    for level in LEVELS:
        motion = read(FREQUENCY, level, modes, shapes, delay)
        both = rng.normal(size=(2, *motion.shape)) / 2**0.5
        readings[level] = motion * (1 + noise * (both[0] + 1j * both[1]))
    return write_shaken(path, FREQUENCY, readings)


@pytest.mark.parametrize("delay", [0.0, -5e-4, *(pytest.param(d, marks=pytest.mark.slow) for d in (5e-4, 2e-3))])
def test_a_delay_of_all_sensors_is_named_and_removed(tmp_path, delay, few_laws):
    """0.5 ms turns the modes by 0.13 rad: left in, 7 % of a peak at a tested level."""
    answer = analyse([write(tmp_path / "a.h5", np.random.default_rng(1), delay)], [0.8])
    form, notes = answer.to_json(), [note for note in answer.summary.notes if "drive by" in note]
    if delay:
        assert form["delay"]["seconds"] == pytest.approx(delay, abs=3.0 * form["delay"]["error"])
        assert form["delay"]["error"] < 2e-6  # 0.5 % of noise over some 600 readings about each mode
        assert len(notes) == 1
        lag, told = re.match(r"every sensor (lags|leads) the drive by ([\d.]+) ± 0\.000\d+ ms", notes[0]).groups()
        assert (lag == "lags") == (delay > 0.0)
        assert float(told) == pytest.approx(1e3 * abs(delay), abs=0.002)
    else:
        assert form["delay"] is None
        assert not notes
    for mode in answer.modes:
        assert not mode.shape_caution  # peaks grow apart by 8 %, as the base and the other mode do not grow alike
        f = np.linspace(0.98 * mode.frequency, 1.02 * mode.frequency, 2001)
        for at in mode.places:
            peaks = np.max(np.abs(read(f, at.level, MODES, SHAPES, 0.0)), axis=1)
            found = [peak.band[0] for peak in at.response]
            np.testing.assert_allclose(found, peaks, rtol=0.005 if at.tested else 0.01)


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 12), marks=pytest.mark.slow)])
def test_no_delay_is_found_where_there_is_none(tmp_path, seeds):
    """Random modes, some with softening stiffness or a neighbour that shows no peak: bends and misfits are no delay."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        hertz, modes = 32.0, []
        for _ in range(2):
            ratio, part = rng.uniform(0.006, 0.02), rng.uniform(0.3, 1.0)
            A = LEVELS[-1] * G * part / (2 * ratio * (2 * np.pi * hertz) ** 2)
            modes.append((hertz, ratio, rng.uniform(0.0, 1.0) / A, rng.uniform(0.0, 0.6) * ratio / A, part))
            hertz *= rng.choice([1.02, 1.1, 1.4])
        shapes = rng.uniform(0.3, 1.0, size=(3, 2)) * rng.choice([-1.0, 1.0], size=(3, 2))
        runs, _ = read_runs([write(tmp_path / "a.h5", rng, 0.0, modes, shapes)], SIZE)
        assert remove_delay(fit_levels(runs), fit_levels)[0].run.delay == 0.0, seed
