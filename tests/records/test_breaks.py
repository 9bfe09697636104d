"""What the audit says to do helps, it compares only what may be a copy, and a resonance of nothing has a prediction."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pandas as pd
import pytest
from audit_cases import Bench, clean, measured

from damping.effects.contract import Drive, Terms
from damping.effects.terms import predict
from damping.records import audit, check_copies
from damping.records.record import Record

BENCH = Bench(law="velocity-squared", levels=4, seed=7)


@cache
def right() -> pd.DataFrame:
    """Four sweeps with phases through the resonance."""
    return measured(clean(BENCH), BENCH)


def repeat() -> pd.DataFrame:
    """An exact copy of a sweep under another label."""
    return pd.concat([right(), right()[right()["sweep"] == "B"].assign(sweep="E")])


@pytest.mark.parametrize("offset", [0.3, -0.15])
def test_the_advice_on_an_offset_of_phases_helps(offset):
    """It says how much to take off the column of phases, to some 0.02 rad, with which the finding goes."""
    turned = right().assign(phase=right()["phase"] + offset)
    (finding,) = audit(Record(turned), BENCH.mode).findings
    way, size = re.search(r"\((take|add) ([\d.]+) (?:off|to) the column phase;", finding.advice).groups()
    found = float(size) * (1.0 if way == "take" else -1.0)
    np.testing.assert_allclose(found, offset, rtol=0.0, atol=0.02)
    assert f"lag = {found:.3f} rad in [node]" in finding.advice
    assert not audit(Record(turned.assign(phase=turned["phase"] - found)), BENCH.mode).findings


def test_sweeps_that_differ_at_first_sight_are_not_compared_row_by_row(monkeypatch):
    """A thousand levels are half a million pairs: only what may be a copy is looked at closer."""
    compared = []
    find = check_copies._find_factor
    monkeypatch.setattr(check_copies, "_find_factor", lambda *pair: compared.append(pair) or find(*pair))
    peaks = right().loc[right().groupby("sweep")["amplitude"].idxmax()]
    scaled = (peaks[["force", "amplitude"]] * (1.0 + 0.01 * k) for k in range(9))
    levels = [peaks.assign(sweep=peaks["sweep"] + str(k), **by) for k, by in enumerate(scaled)]
    for table in (right(), pd.concat(levels)):
        assert "repeated-sweep" not in str(audit(Record(table)))
    assert not compared
    assert "repeated-sweep" in str(audit(Record(repeat())))
    assert compared


@pytest.mark.parametrize("resonant", [False, True])
def test_a_row_at_the_frequency_of_a_mode_without_damping(resonant):
    """Nothing is left to divide by, and still there is a prediction and its derivatives."""
    drive = Drive(np.ones(1), np.full(1, 10.0), resonant=resonant)
    found = predict(Terms(M=1.0, omega_n=10.0), np.zeros(1), drive)
    assert all(np.isfinite(np.asarray(part)).all() for part in vars(found).values())
