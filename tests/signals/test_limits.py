"""Readings at their limit: motions in closed form, in steps of any size, clipped and not."""

from __future__ import annotations

import numpy as np
import pytest

from damping.errors import AnalysisError
from damping.records.check_ceiling import FEWEST_VISITS, Limits, find_limit
from damping.signals.ringdown import ring_down

HERTZ, ZETA, RATE = 25.0, 0.008, 2000.0


def decay() -> tuple[np.ndarray, np.ndarray]:
    """A viscous decay from rest."""
    t, w = np.arange(0.0, 4.0, 1 / RATE), 2 * np.pi * HERTZ
    return t, np.exp(-ZETA * w * t) * np.cos(w * np.sqrt(1 - ZETA**2) * t)


def dwell() -> tuple[np.ndarray, np.ndarray]:
    """A steady sine, whose every cycle comes as near to the largest value."""
    t = np.arange(0.0, 4.0, 1 / RATE)
    return t, np.sin(2 * np.pi * 13.7 * t)


def sweep() -> tuple[np.ndarray, np.ndarray]:
    """Through a resonance and past it."""
    t = np.arange(0.0, 40.0, 1 / RATE)
    return t, np.sin(2 * np.pi * (5.0 * t + 0.5 * t**2)) / np.hypot(1.0, (t - 20.0) / 2.0)


@pytest.mark.parametrize("motion", [decay, dwell, sweep])
@pytest.mark.parametrize("bits", [None, 16, 12, 8, 6])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_motions_in_steps_are_not_clipped_and_clipped_ones_are(motion, bits, noise):
    """A cycle of height 1 over a limit b stands there for 2 arccos(b), and on the step e below for e/sqrt(1 - b^2)."""
    _, x = motion()
    x = x + noise * np.random.default_rng(1).normal(size=len(x))
    step = 0.0 if bits is None else 2.0 / 2**bits
    x = x if bits is None else np.round(x / step) * step
    assert find_limit(x) is None
    if motion is decay and step > 0.001:  # its later peaks pass the step below
        return
    for share in (0.9, 0.5) if step < 0.01 else (0.5,):  # ten steps or more over the limit
        limit = np.floor(share / step) * step if step else share
        assert find_limit(np.clip(x, -limit, limit)) == pytest.approx(limit)


def test_one_side_is_enough_and_blocks_are_one_signal():
    _, x = sweep()
    limits = Limits()
    channels = np.array([x, np.maximum(x, -0.6), np.minimum(x, 0.6)])
    for block in limits.watch(np.array_split(channels, 17, axis=1)):
        assert block.shape[0] == 3
    assert limits.found == [None, pytest.approx(0.6), pytest.approx(0.6)]


def test_a_value_held_once_is_no_limit():
    """Pulled and held before the release, without noise: fewer visits than a limit has."""
    _, x = decay()
    assert find_limit(np.concatenate([np.ones(3000), x])) is None
    assert FEWEST_VISITS > 1


@pytest.mark.parametrize("order", [0, 2])
def test_a_clipped_decay_is_refused_and_its_later_part_is_right(order):
    t, x = decay()
    x = -x * (2 * np.pi * HERTZ) ** 2 if order else x
    limit = 0.4 * np.max(np.abs(x))
    read = np.clip(x, -limit, limit)
    with pytest.raises(AnalysisError, match=r"repeatedly stay at .*clipped, .*--start"):
        ring_down(t, read, order=order, mass=1.0, frequency=HERTZ)
    later = ring_down(t, read, order=order, mass=1.0, frequency=HERTZ, start=0.9)
    np.testing.assert_allclose(later.damping_ratio, ZETA, rtol=2e-3)  # a viscous decay without noise


def test_a_value_held_over_several_blocks_is_one_visit():
    """Held before a release for longer than a block of samples, in which the value is reached once."""
    held, decay = np.ones((1, 100)), np.round(np.exp(-np.arange(100.0) / 30.0), 2)[np.newaxis]
    limits = Limits()
    for block in (held, held, held, held, decay):
        limits.note(block)
    assert limits.found == [None]
    assert FEWEST_VISITS < 4  # as many as the blocks that hold it
