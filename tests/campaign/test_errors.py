"""Standard errors of a campaign's frequencies and damping ratios, against closed forms of steady modes."""

from __future__ import annotations

import numpy as np
import pytest

from damping.campaign import _find_errors, analyse
from damping.campaign.records import fit_levels, join_modes
from damping.campaign.sources import read_runs
from tests.campaign.test_delays import LEVELS, G, write


def random_modes(rng):
    """One to three modes 7 to 12 % apart whose damping grows by up to the tested amplitude's own again."""
    hertz, modes = rng.uniform(31.0, 36.0), []
    for _ in range(rng.integers(1, 4)):
        ratio, part = rng.uniform(0.006, 0.02), rng.uniform(0.3, 1.0)
        A = LEVELS[-1] * G * part / (2 * ratio * (2 * np.pi * hertz) ** 2)
        modes.append((hertz, ratio, rng.uniform(0.0, 1.0) / A, 0.0, part))
        hertz *= rng.uniform(1.09, 1.14)
    return modes, rng.uniform(0.3, 1.0, size=(3, len(modes))) * rng.choice([-1.0, 1.0], size=(3, len(modes)))


def measure_scores(path, seeds):
    """(found - true)/standard error of every frequency and every ln damping ratio of random campaigns: (2, n)."""
    scores = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        modes, shapes = random_modes(rng)
        levels = fit_levels(read_runs([write(path, rng, 0.0, modes, shapes)], 10_000_000)[0], [m[0] for m in modes])
        for mode in join_modes(levels):
            hertz, ratio, growth, _, part = modes[mode.number]
            for k, level in enumerate(levels):
                force, w = LEVELS[k] * G * part, 2 * np.pi * hertz
                A = (np.sqrt(1 + 4 * growth * force / (2 * ratio * w**2)) - 1) / (2 * growth)
                f, z = float(mode.frequency[k]), float(mode.ratio[k])
                f_error, z_error = _find_errors(mode, level, k, f, z, read=False)
                scores.append(((f - hertz) / f_error, (z - ratio * (1 + growth * A)) / z_error))
    return np.array(scores).T


@pytest.mark.parametrize(("campaigns", "number"), [(5, 30), pytest.param(25, 150, marks=pytest.mark.slow)])
def test_standard_errors_hold_what_they_say(tmp_path, campaigns, number):
    """68 % within one, to two standard deviations of a binomial; damping is the line in A of the fit."""
    within = np.mean(np.abs(measure_scores(tmp_path / "a.h5", range(campaigns))) < 1.0, axis=1)
    np.testing.assert_allclose(within, 0.683, atol=2.0 * np.sqrt(0.68 * 0.32 / number))


def test_errors_are_given_at_tested_and_design_levels(tmp_path, few_laws):
    """At a design level the band is wider than the noise of the test."""
    (mode,) = analyse(
        [
            write(
                tmp_path / "a.h5",
                np.random.default_rng(1),
                0.0,
                [(38.0, 0.01, 600.0, 0.0, 0.9)],
                np.array([[1.0], [0.7], [-0.5]]),
            )
        ],
        [0.8],
    ).to_json()["modes"]
    tested, design = mode["at"][0], mode["at"][-1]
    assert abs(tested["frequency"] - 38.0) < 4.0 * tested["frequency_error"] < 0.004
    assert 0.0 < tested["damping_ratio_error"] < design["damping_ratio_error"] < 0.1 * design["damping_ratio"]["median"]
    assert design["frequency_error"] > tested["frequency_error"]
