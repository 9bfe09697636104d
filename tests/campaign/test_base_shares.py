"""What sensors read of the base below resonance, in closed form: units, scalings and axes that are not as they say."""

from __future__ import annotations

import numpy as np
import pytest

from damping.campaign import analyse
from damping.campaign.records import fit_right_levels
from damping.campaign.runs import ChannelCorrection, Corrections
from damping.campaign.sensors import describe_shares, find_bad_sensors
from damping.campaign.sources import read_runs
from damping.errors import InputError
from tests.campaign.spectra import write_spectra

G = 9.80665
RMS = 0.5**0.5
HERTZ, RATIO, PART = (40.0, 52.0), 0.0125, np.array([[0.9, 0.3], [0.63, -0.6], [-0.45, 0.7], [0.5, 0.5]])
LEVELS = (0.1, 0.2, 0.4)
SIZE = 10_000_000


def shaken(path, factors, axes=(1.0, 1.0, 1.0, 1.0), unit="g", first=25.0, drive=1.0, levels=1):
    """Sensors and ``drive`` of a shaker in their unit times ``factors``; ``axes``: part of the base that each reads.

    ``levels``: how many there are; what a sensor reads of the base is the same in each.
    """
    f = np.geomspace(first, 65.0, 300)
    w, motion = 2 * np.pi * f, np.outer(axes, np.ones(300)).astype(complex)
    for k, hertz in enumerate(HERTZ):
        w_n = 2 * np.pi * hertz
        motion += PART[:, k : k + 1] * w**2 / (w_n**2 - w**2 + 2j * RATIO * w_n * w)
    runs = {}
    for seed, level in enumerate(LEVELS[:levels]):
        read = level * motion * (1 + 0.005 * np.random.default_rng(seed).normal(size=motion.shape))
        read = read[: len(factors)] * np.array(factors)[:, np.newaxis] * (G if unit == "m/s^2" else 1.0)
        runs[f"run_{level}g"] = {"control": (drive * level, "g")} | {f"acc{s}": (x, unit) for s, x in enumerate(read)}
    return write_spectra(path, f, runs), np.max(np.abs(motion[:, np.abs(f - HERTZ[0]) < 2.0]), axis=1, initial=0.0)


@pytest.mark.parametrize(
    ("factors", "unit", "told"),
    [
        ((G, G, G, G), "g", r"every sensor is misread: 'acc0', .* 9\.[78]\d? to 9\.[89]\d? \(m/s\^2 for g\?\)"),
        ((G, G, G), "g", r"m/s\^2 for g\?"),
        ((1 / G,) * 4, "m/s^2", r"0\.10\d .*\(g for m/s\^2\?\)"),
        ((1e3,) * 4, "m/s^2", r"\(mm/s\^2 for m/s\^2\?\)"),
        ((5.0,) * 4, "g", r"every sensor is misread: .* read (4\.9\d|5) to 5"),
        ((G,), "g", r"every sensor is misread: 'acc0' reads 9\.[789]\d? \(m/s\^2 for g\?\); expected --correct FILE"),
    ],
)
def test_sensors_that_are_all_in_another_unit_are_refused(tmp_path, factors, unit, told):
    """Most of them being wrong makes none right: the base is 1 in each of them."""
    path, _ = shaken(tmp_path / "a.h5", factors, unit=unit)
    with pytest.raises(InputError, match=told):
        analyse([path], [0.8])


@pytest.mark.parametrize(
    ("factors", "unit", "left", "why"),
    [
        ((G, G, 1.0, G), "g", 2, "m/s^2 for g?"),
        ((2.0, 1.0, 1.0, 2.0), "g", 2, "peak-to-peak for peak?"),
        ((1 / G, 1.0, 1 / G, 1 / G), "m/s^2", 1, "g for m/s^2?"),
    ],
)
def test_the_sensors_that_are_right_are_answered(tmp_path, factors, unit, left, why, few_laws):
    """Viscous modes: the peak at the design level is the closed form times the level."""
    path, peak = shaken(tmp_path / "a.h5", factors, unit=unit, levels=3)
    mode = analyse([path], [0.8]).modes[0]
    wrong = {f"acc{s}" for s, factor in enumerate(factors) if factor != 1.0}
    assert set(mode.left_out) == wrong
    assert all(why in mode.left_out[name] for name in wrong)
    (tip,) = (one for one in mode.places[-1].response if one.sensor == f"acc{left}")
    assert tip.band[0] == pytest.approx(0.8 * peak[left] * (G if unit == "m/s^2" else 1.0), rel=0.01)


@pytest.mark.parametrize(
    ("factors", "told"),
    [
        ((RMS, RMS, RMS, RMS), "'acc0', 'acc1', 'acc2', 'acc3' read 0.70"),
        ((RMS, 1.0, RMS, RMS), "'acc0', 'acc2', 'acc3' read 0.70"),
        ((1.0, RMS, 1.0, 1.0), "'acc1' reads 0.7"),
        ((1 / RMS,) * 4, "rms of the drive for peak?"),
        ((0.5,) * 4, "peak-to-peak of the drive?"),
    ],
)
def test_rms_beside_peak_is_told(tmp_path, factors, told):
    """A caution names the sensors, what they read, and what that is."""
    path, _ = shaken(tmp_path / "a.h5", factors)
    levels, misread = fit_right_levels(read_runs([path], SIZE)[0])
    assert misread == {}
    (note,) = describe_shares(levels)
    assert told in note
    assert "?)" in note


def test_sensors_that_are_stated_are_not_doubted(tmp_path, few_laws):
    """A campaign has the caution once, and none where the sensors are stated to be right."""
    path, _ = shaken(tmp_path / "a.h5", (RMS,) * 4, levels=2)
    (note,) = [note for note in analyse([path], [0.8]).summary.notes if "caution" in note]
    assert "rms of the drive for peak?" not in note
    assert "read 0.70" in note
    stated = Corrections(channels={f"acc{s}": ChannelCorrection("sensor") for s in range(4)})
    assert not any("caution" in note for note in analyse([path], [0.8], corrections=stated).summary.notes)


@pytest.mark.parametrize(
    "axes",
    [
        (1.0, 1.0, 1.0, 1.0),
        (0.0, 0.0, 0.0, 0.0),  # relative to the base
        (1.0, 1.0, 0.0, 1.0),  # one across the drive, which reads its modes
        (0.0, 0.0, 0.0, 1.0),
        (1.0, 0.97, 0.06, 1.08),  # calibration and transverse sensitivity
    ],
)
@pytest.mark.parametrize("first", [25.0, 36.0])
def test_right_sensors_are_not_doubted(tmp_path, axes, first):
    """Sweeps that begin far below the first mode, and 10 % below it."""
    path, _ = shaken(tmp_path / "a.h5", (1.0,) * 4, axes, first=first, levels=2)
    levels, misread = fit_right_levels(read_runs([path], SIZE)[0])
    assert misread == find_bad_sensors(levels) == {}
    assert describe_shares(levels) == []


def test_a_sweep_between_modes_is_no_wrong_unit(tmp_path):
    """It begins above the first mode, whose motion is in all sensors: 1 - r/(1 - (f_1/f)^2) of the base."""
    path, _ = shaken(tmp_path / "a.h5", (1.0,) * 4, first=46.0)
    levels, misread = fit_right_levels(read_runs([path], SIZE)[0])
    assert misread == {}
    assert describe_shares(levels) == []


def test_a_drive_in_another_unit_is_told(tmp_path):
    """Every sensor then reads 1/9.8 of the base, which none does that is right."""
    path, _ = shaken(tmp_path / "a.h5", (1.0,) * 4, drive=G)
    with pytest.raises(InputError, match=r"0\.10\d .*\(the drive in m/s\^2 for g\?\)"):
        analyse([path], [0.8])
