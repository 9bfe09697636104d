"""Files that are wrong but plausible, one by one: the check that names each, and what ``damping check`` ends with.

Every one of them was once answered with confidence and without a word. The audit over many draws of them is in
``test_audit`` and ``test_plausible_corruption``; here is the command, on one record.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from audit_cases import Bench, clean, many_modes, measured, swept_fast

from damping.effects.contract import Drive, Terms
from damping.effects.terms import predict
from damping.records import audit, check_copies
from damping.records.mode import describe_mode_to_toml
from damping.records.record import Record
from damping_pipelines.store import write_text

BENCH = Bench(law="velocity-squared", levels=4, seed=7)
RNG = np.random.default_rng(7)


@cache
def right() -> pd.DataFrame:
    """Four sweeps with phases through the resonance."""
    return measured(clean(BENCH), BENCH)


def change(**columns: Callable[[pd.DataFrame], object]) -> Callable[[], pd.DataFrame]:
    """The right record with columns made from it anew."""
    return lambda: right().assign(**columns)


def cut_below() -> pd.DataFrame:
    """Sweeps that end before their resonance, without phases."""
    return measured(clean(replace(BENCH, span=(-12.0, -1.5))), BENCH).drop(columns="phase")


def fall() -> pd.DataFrame:
    """Forces of the levels the wrong way round."""
    force = right().groupby("sweep", sort=False)["force"].first()
    return right().assign(force=right()["sweep"].map(dict(zip(force.index, force.to_numpy()[::-1], strict=True))))


def misread() -> pd.DataFrame:
    """One amplitude ten times too large."""
    return right().assign(amplitude=right()["amplitude"].where(np.arange(len(right())) != 30, lambda a: 10.0 * a))


def repeat() -> pd.DataFrame:
    """An exact copy of a sweep under another label."""
    return pd.concat([right(), right()[right()["sweep"] == "B"].assign(sweep="E")])


def energy(factor: float) -> Callable[[pd.DataFrame], object]:
    """So many times pi F A sin(phase)."""
    return lambda t: factor * np.pi * t["force"] * t["amplitude"] * np.abs(np.sin(t["phase"])) + 1e-12


def sweep_at(rate: float) -> pd.DataFrame:
    """A lightly damped mode at 20 Hz under a sweep of so many octaves a minute."""
    quick = replace(BENCH, f=20.0, zeta=0.006, span=(-8.0, 12.0), levels=2)
    return measured(swept_fast(quick, rate), quick)


#: What was wrong: the check, the exit code (1: no answer can be right), the record.
BREAKS: dict[str, tuple[str, int, Callable[[], pd.DataFrame]]] = {
    "record in m, mode in mm": ("units", 1, change(amplitude=lambda t: t["amplitude"] / 1000.0)),
    "g read as m/s^2": ("units", 1, change(amplitude=lambda t: t["amplitude"] / 9.80665)),
    "force and response swapped": (
        "units", 1, lambda: right().rename(columns={"force": "amplitude", "amplitude": "force"})
    ),
    "phase in degrees, wrapped modulo 2 pi": (
        "phase-unit", 1, change(phase=lambda t: np.mod(np.degrees(t["phase"]), 2.0 * np.pi))
    ),
    "phase negated (x/F)": ("phase-sign", 1, change(phase=lambda t: -t["phase"])),
    "phase minus pi": ("phase-sign", 1, change(phase=lambda t: t["phase"] - np.pi)),
    "phase led": ("phase-sign", 1, change(phase=lambda t: np.mod(-t["phase"], 2.0 * np.pi))),
    "phase modulo pi": ("phase-sign", 1, change(phase=lambda t: np.arctan(np.tan(t["phase"])))),
    "an offset of .3 rad": ("phase-offset", 0, change(phase=lambda t: t["phase"] + 0.3)),
    "sweeps that stop below resonance": ("edge-of-sweep", 1, cut_below),
    "a record of four modes": ("several-modes", 1, lambda: measured(many_modes(BENCH), BENCH)),
    "a sweep at 4 oct/min": ("sweep-rate", 0, lambda: sweep_at(4.0)),
    "amplitude falling with force": ("amplitude-falls", 1, fall),
    "energies beyond pi F A": ("energy", 1, change(energy=energy(2.0))),
    "one amplitude ten times too large": ("outlier", 0, misread),
    "an exact copy of a sweep": ("repeated-sweep", 0, repeat),
    "four levels under one label": ("mixed-levels", 0, change(sweep=lambda t: "all")),
    "pure noise": (
        "edge-of-sweep",
        1,
        change(
            amplitude=lambda t: BENCH.A * np.exp(RNG.normal(size=len(t))), phase=lambda t: RNG.uniform(0.0, 3.1, len(t))
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BREAKS)
def test_what_was_answered_without_a_word(name, tmp_path, damping):
    check, code, make = BREAKS[name]
    record, mode = tmp_path / "record.csv", tmp_path / "mode.toml"
    write_text(record, make().to_csv(index=False))
    bench = replace(BENCH, f=20.0, zeta=0.006) if check == "sweep-rate" else BENCH
    write_text(mode, describe_mode_to_toml(bench.mode))
    run = damping("check", record, "--mode", mode)
    assert run.code == code
    assert f"{check} ({'refuse' if code else 'caution'})" in " ".join(run.out.split())
    if code:  # whoever asks for an answer is told the same, before any work
        asked = damping("extrapolate", record, "--mode", mode, "--force", 1e3)
        assert (asked.code, asked.out) == (1, "")
        assert f"{check} (refuse)" in asked.err


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


def test_right_records_pass(tmp_path, damping):
    write_text(tmp_path / "record.csv", right().to_csv(index=False))
    write_text(tmp_path / "mode.toml", describe_mode_to_toml(BENCH.mode))
    run = damping("check", tmp_path / "record.csv", "--mode", tmp_path / "mode.toml")
    assert (run.code, run.err) == (0, "")
    assert "audit: ok" in run.out


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
