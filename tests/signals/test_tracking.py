"""Tracked sines against signals of known amplitude, phase, harmonic and rate, and a swept mode integrated in time."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.signal import lfilter

from damping.errors import AnalysisError, InputError
from damping.signals.histories import track_sine

RATE = 2000.0  # samples a second
GAIN = 3.0
LAG = 0.7
THIRD = 0.05


def swept(low: float, high: float, seconds: float, rate: float = RATE) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, phase and frequency of a logarithmic sweep."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    k = np.log(high / low) / seconds
    return t, 2 * np.pi * low * (np.exp(k * t) - 1.0) / k, low * np.exp(k * t)


def measured(phase: np.ndarray, noise: float, seed: int = 0) -> np.ndarray:
    """A drive, and a response of known gain and lag with a third harmonic, both with noise and offset."""
    rng = np.random.default_rng(seed)
    force = 2.0 * np.sin(phase)
    response = GAIN * np.sin(phase - LAG) + THIRD * np.sin(3 * phase - 0.2)
    x = np.array([force, response])
    return x + noise * rng.normal(size=x.shape) + 0.1


def cut(x: np.ndarray, size: int) -> list[np.ndarray]:
    return [x[:, k : k + size] for k in range(0, x.shape[1], size)]


@pytest.mark.parametrize("size", [200_000, 3_001])
def test_a_sweep_is_what_it_was_made_of(size):
    t, phase, frequency = swept(10.0, 60.0, 60.0)
    noise = 0.02
    found = track_sine(cut(measured(phase, noise), size), 0, 1.0 / RATE)
    np.testing.assert_allclose(found.frequency, np.interp(found.time, t, frequency), rtol=2e-4)  # the phase's noise
    np.testing.assert_allclose(found.rate, found.frequency * np.log(6.0) / 60.0, rtol=0.1)
    np.testing.assert_allclose(found.drive, 2.0, rtol=5e-3)
    # of x = Re[X exp(i theta)] with the drive 2 cos(theta): X = 3 exp(-0.7 i) and X_3 = -0.05 i^2 ... exp(-0.2 i)
    np.testing.assert_allclose(np.abs(found.response[0]), GAIN, rtol=5e-3)
    np.testing.assert_allclose(np.angle(found.response[0]), -LAG, atol=6e-3)
    np.testing.assert_allclose(np.abs(found.third[0]), THIRD, atol=5 * noise * np.sqrt(2.0 / 250))


def test_blocks_of_any_size_give_the_same_rows():
    _, phase, _ = swept(10.0, 30.0, 20.0)
    whole = track_sine([measured(phase, 0.0)], 0, 1.0 / RATE)
    parts = track_sine(cut(measured(phase, 0.0), 777), 0, 1.0 / RATE)
    np.testing.assert_allclose(parts.frequency, whole.frequency, rtol=1e-9)
    np.testing.assert_allclose(parts.response, whole.response, rtol=1e-7)


def test_a_dwell_is_its_last_settled_window():
    """Steps whose transient dies: the amplitude of the end, one row a step."""
    phase, sizes = [0.0], []
    for f in (20.0, 21.0, 22.0):
        phase.extend(phase[-1] + 2 * np.pi * f * np.arange(1, 8001) / RATE)
        sizes.append(GAIN * (1.0 - np.exp(-np.arange(8000) / RATE / 0.3)))
    phase = np.array(phase[1:])
    x = np.array([np.sin(phase), np.concatenate(sizes) * np.sin(phase - LAG)])
    found = track_sine([x], 0, 1.0 / RATE)
    settled = [np.flatnonzero(np.abs(found.frequency / f - 1.0) < 4e-4) for f in (20.0, 21.0, 22.0)]
    assert [len(rows) for rows in settled] == [1, 1, 1]
    last = [int(rows[0]) for rows in settled]
    np.testing.assert_allclose(np.abs(found.response[0][last]), GAIN, rtol=1e-4)
    np.testing.assert_allclose(found.rate[last], 0.0, atol=0.01)


def test_noise_makes_no_rate():
    """Neither of a sweep so slow that several windows are of one frequency, nor of dwells a twentieth of a Hz apart."""
    t = np.arange(0.0, 60.0, 1.0 / RATE)
    slow = track_sine([measured(2.0 * np.pi * (15.0 * t + 0.5 * 0.01 * t**2), 0.02)], 0, 1.0 / RATE)
    assert len(slow.time) < 100  # of 225 windows
    np.testing.assert_allclose(slow.rate, 0.01, rtol=0.05)
    step = 15.0 + 0.05 * np.floor(t / 6.0)
    dwells = track_sine([measured(2.0 * np.pi * np.cumsum(step) / RATE, 0.02)], 0, 1.0 / RATE)
    settled = np.abs(dwells.frequency - np.round(20.0 * dwells.frequency) / 20.0) < 2e-3
    assert settled.sum() >= 10
    np.testing.assert_array_equal(dwells.rate[settled], 0.0)


@pytest.mark.parametrize("order", ["rising", "any"])
def test_every_dwell_is_one_row(order):
    """Steps of 0.4 %, phase-continuous, at times that fall anywhere in a window: none that straddles two is a row."""
    rng = np.random.default_rng(4)
    steps = 11.6 + 0.05 * (np.arange(17) if order == "rising" else rng.permutation(17))
    rate = 200.0
    phase = 2.0 * np.pi * np.cumsum(np.repeat(steps, 3000)) / rate  # of 15 s, some 45 windows
    found = track_sine(cut(measured(phase, 0.01), 10_001), 0, 1.0 / rate)
    assert len(found.frequency) == len(steps)
    np.testing.assert_array_equal(found.rate, 0.0)
    # a phase of noise 0.01/2 over 133 samples and 2 pi 8 of phase: some 3e-5; a straddling window is off by up to 4e-3
    np.testing.assert_allclose(found.frequency, steps, rtol=1.5e-4)
    np.testing.assert_allclose(np.abs(found.response[0]), GAIN, rtol=2e-3)


def test_a_mode_swept_through_its_resonance():
    """Amplitude and phase of the slow envelope, integrated in time, where it changes within a window."""
    f_n, ratio, mass = 30.0, 0.01, 2.0
    _, phase, frequency = swept(25.0, 36.0, 40.0)
    k = np.log(36.0 / 25.0) / 40.0
    w_n = 2 * np.pi * f_n

    # z' = p z + F/M of either root p: exact for a force that is straight between four points of each sample, and a
    # chord of a sine at 36 Hz misses (2 pi 36/8000)^2/8 = 1e-4 of it
    fine = swept(25.0, 36.0, 40.0, 4.0 * RATE)
    root, step = w_n * (-ratio + 1j * np.sqrt(1.0 - ratio**2)), 0.25 / RATE
    h = root * step
    first, last = (np.exp(h) * (h - 1.0) + 1.0) / h**2, (np.exp(h) - 1.0 - h) / h**2
    z = lfilter([last, first], [1.0, -np.exp(h)], step / mass * np.sin(fine[1]))
    q = (z.imag / root.imag)[::4]
    found = track_sine([np.array([np.sin(phase), q])], 0, 1.0 / RATE)
    late = (found.time > 3.0) & (found.time < 37.0)
    w = 2 * np.pi * found.frequency[late]
    steady = 1.0 / mass / (w_n**2 - w**2 + 2j * ratio * w_n * w)
    # .27 Hz/s beside a bandwidth of .6 Hz: .75 bandwidths in the time one takes move the peak by some per cent
    np.testing.assert_allclose(np.abs(found.response[0][late]).max(), np.abs(steady).max(), rtol=0.1)
    np.testing.assert_allclose(found.rate[late], frequency[0] * np.exp(k * found.time[late]) * k, rtol=0.02)


def test_memory_is_that_of_a_block():
    """Ten times the samples take no more memory: blocks are made as they are asked for."""

    def peak(seconds: float) -> int:
        def blocks():
            for first in range(int(seconds)):
                t = first + np.arange(2000) / RATE
                yield np.array([np.sin(2 * np.pi * 20.0 * t), np.cos(2 * np.pi * 20.0 * t)])

        tracemalloc.start()
        track_sine(blocks(), 0, 1.0 / RATE)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    peak(4.0)  # what is made once
    assert peak(40.0) < 1.5 * peak(4.0)


def test_what_is_no_sine():
    rng = np.random.default_rng(2)
    with pytest.raises(AnalysisError, match="no sine"):
        track_sine([rng.normal(size=(2, 20_000))], 0, 1.0 / RATE)
    with pytest.raises(InputError, match="no numbers"):
        track_sine([np.full((2, 100), np.nan)], 0, 1.0 / RATE)
