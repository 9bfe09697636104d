"""Campaigns with two modes that show one peak, against the closed form of viscous modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damping.campaign import analyse
from damping.campaign.merged import add_missing
from damping.campaign.modal_fit import Level, find_peaks_of, fit_level
from tests.campaign.spectra import write_force_runs

LEVELS = (1.0, 2.0, 4.0)
RATIOS = (0.012, 0.016)
SHAPES = np.array([[1.0, 0.8], [0.6, -0.7], [-0.4, 0.9]])
F = np.linspace(25.0, 38.0, 400)


def move(f, hertz):
    """Accelerations (sensors, n) under 1 N; modal masses of 10 kg."""
    w, w_n = 2 * np.pi * f, 2 * np.pi * np.array(hertz)[:, np.newaxis]
    return -(w**2) / 10.0 * (SHAPES @ (1.0 / (w_n**2 - w**2 + 2j * np.array(RATIOS)[:, np.newaxis] * w_n * w)))


def write(path, hertz):
    return write_force_runs(path, F, LEVELS, lambda force: force * move(F, hertz), seed=4)


def test_a_low_peak_alone_is_no_mode():
    """Two broad modes of one sensor make one low peak between them, and no shape that it could differ from."""
    f = np.geomspace(17.0, 40.0, 500)
    w, H = 2.0 * np.pi * f, np.zeros((1, len(f)), complex)
    for hertz, ratio in ((25.0, 0.2), (30.0, 0.3)):
        H += 0.5 * w**2 / ((2.0 * np.pi * hertz) ** 2 - w**2 + 4.0j * np.pi * ratio * hertz * w)
    assert find_peaks_of(f, H, -1.0) == []


@pytest.mark.parametrize(("apart", "peaks"), [(0.02, 1), (0.06, 2), pytest.param(0.035, 1, marks=pytest.mark.slow)])
def test_two_modes_in_one_peak_or_two_are_told_apart(tmp_path, few_laws, apart, peaks):
    """Answered as one mode, its peaks at four times the top level were up to 50 % off, outside their bands."""
    hertz = (30.0, 30.0 * (1.0 + apart))
    assert len(find_peaks_of(F, move(F, hertz), -1.0)) == peaks
    found = analyse([write(tmp_path / "a.h5", hertz)], [16.0])
    assert [mode.frequency for mode in found.modes] == pytest.approx(hertz, rel=1e-3)
    assert not any("two close modes" in note for note in found.summary.notes)
    for mode, ratio in zip(found.modes, RATIOS, strict=True):
        for at in mode.places:
            assert at.ratio[1] < ratio < at.ratio[2], at


def test_a_level_without_rows_near_two_modes_in_one_peak():
    """Two sensors see the two only next to their peak, where the highest run has no rows."""
    w_n, levels = 2 * np.pi * np.array([[50.0], [50.6], [55.0]]), []
    shapes = np.array([[1.0, 0.8, 0.5], [0.6, -0.7, 0.9]])

    def fit(starts):
        return [replace(level, fit=fit_level(level.f, level.H, starts, -1.0)) for level in levels]

    for begin in (46.0, 46.0, 53.0):
        f = np.linspace(begin, 60.0, 300)
        w = 2 * np.pi * f
        H = -(w**2) * (shapes @ (1.0 / (w_n**2 - w**2 + 2j * 0.006 * w_n * w)))
        H = H * (1.0 + 0.003 * np.random.default_rng(0).normal(size=(2, len(f), 2)) @ [1.0, 1j])
        levels.append(Level(None, f, H, np.ones_like(f), fit_level(f, H, [50.2, 55.0], -1.0)))
    for level in add_missing(levels, fit)[:2]:
        np.testing.assert_allclose(level.fit.frequency, w_n[:, 0] / (2 * np.pi), rtol=1e-3)


def test_one_mode_named_for_two_gets_a_caution(tmp_path, few_laws):
    found = analyse([write(tmp_path / "a.h5", (30.0, 31.05))], [16.0], [30.5])
    (mode,) = found.modes
    assert all(any("probably two close modes" in caution for caution in at.cautions) for at in mode.places)
    assert any("mode-1: near" in note and "try --modes F1,F2" in note for note in found.summary.notes)
