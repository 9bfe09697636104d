"""Records that a diagnosis is not to be denied, beside like ones that stay refused; modal sums in closed form."""

import numpy as np
import pandas as pd
import pytest

from damping.errors import Refused
from damping.records import Audit, audit
from damping.records.check_sweeps import measure_miss_of_two
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.runs import Run

M, ZETA, HERTZ = 10.0, 0.01, 10.0
OMEGA_N = 2.0 * np.pi * HERTZ
NOISE = 0.01


def swept(levels: int, *close: tuple[float, float], half_widths: float = 8.0) -> pd.DataFrame:
    """Sweeps of a mode and ``close`` others: distance in half-power half-widths, and share of the compliance."""
    omega = OMEGA_N * (1.0 + ZETA * np.linspace(-half_widths, half_widths, 41))
    compliance = np.zeros(len(omega), dtype=complex)
    for apart, share in ((0.0, 1.0), *close):
        own = OMEGA_N * (1.0 + ZETA * apart)
        compliance += share / (M * (own**2 - omega**2 + 2j * ZETA * own * omega))
    return measured(omega, compliance, levels)


def measured(omega: np.ndarray, compliance: np.ndarray, levels: int) -> pd.DataFrame:
    """Sweeps at forces 1, 2... of a linear structure, with noise."""
    rng, tables = np.random.default_rng(4), []
    for level in range(1, levels + 1):
        phasor = level * compliance * np.exp(NOISE * rng.standard_normal(len(omega)))
        phase = -np.angle(phasor) + NOISE * rng.standard_normal(len(omega))
        columns = {"frequency": omega / (2.0 * np.pi), "amplitude": np.abs(phasor), "phase": phase}
        tables.append(pd.DataFrame({"sweep": str(level), "force": float(level), **columns}))
    return pd.concat(tables, ignore_index=True)


def audited(table: pd.DataFrame, frequency: float = HERTZ) -> Audit:
    c = 2.0 * ZETA * M * OMEGA_N
    mode = Mode(name="own", frequency=frequency, mass=M, damping={"viscous": {"coefficient": c}}, source="own.toml")
    return audit(Record(table, "own.csv"), mode)


def is_diagnosed_and_not_ranked(found: Audit, check: str) -> bool:
    assert [(own.check, own.verdict) for own in found.findings] == [(check, "refuse")]
    with pytest.raises(Refused, match=check):
        found.require()
    return found.require(diagnosed=True) is found


@pytest.mark.parametrize("offset", [0.9, -0.95])
def test_phases_off_by_less_than_a_radian_are_diagnosed_and_not_ranked(offset):
    table = swept(2)
    assert is_diagnosed_and_not_ranked(audited(table.assign(phase=table["phase"] + offset)), "phase-offset")


@pytest.mark.parametrize("offset", [1.2, -1.2, -0.5 * np.pi])
def test_phases_of_another_quantity_are_not_diagnosed_either(offset):
    """A velocity leads the displacement by a quarter turn."""
    table = swept(2)
    with pytest.raises(Refused, match="phase-"):
        audited(table.assign(phase=table["phase"] + offset)).require(diagnosed=True)


@pytest.mark.parametrize("levels", [2, 4])
def test_coarse_readings_of_small_levels_are_no_other_unit(levels):
    """Readings in steps of three tenths of the largest: rows of a level on one step imply hardly any mass.

    The smaller the level, the smaller the mass, while a unit is wrong by one factor for every level.
    """
    table = swept(levels)
    step = 0.3 * table["amplitude"].max()
    coarse = table.assign(amplitude=np.maximum(np.round(table["amplitude"] / step), 1.0) * step)
    assert audited(coarse).verdict != "refuse"
    for name in ("amplitude", "force"):
        for factor in (9.80665, 25.4, 1000.0):
            with pytest.raises(Refused, match="units"):
                audited(coarse.assign(**{name: coarse[name] * factor})).require(diagnosed=True)


@pytest.mark.parametrize("apart", [-4.0, -3.0, -1.5, 1.2, 2.0, 3.0])
@pytest.mark.parametrize("share", [-0.45, -0.3])
def test_two_close_modes_are_no_fast_sweep(apart, share):
    """The phases of both are late; `test_breaks` and `test_audit` have sweeps that are fast, integrated in time."""
    assert "sweep-rate" not in [own.check for own in audited(swept(2, (apart, share))).findings]


def test_two_modes_and_a_constant_are_fitted_exactly():
    """A ratio of squares in omega^2, in closed form, without noise."""
    omega = OMEGA_N * (1.0 + ZETA * np.linspace(-6.0, 6.0, 31))
    modes = [share / (own**2 - omega**2 + 2e-2j * own * OMEGA_N) for own, share in ((62.0, 1.0), (63.5, -0.4))]
    compliance = sum(modes) + 2e-3 + 1e-3j
    one = np.ones(len(omega))
    run = Run("A", np.arange(len(omega)), one, omega, np.abs(compliance), -np.angle(compliance), 0.0 * one)
    assert measure_miss_of_two(run) < 1e-8  # of a system of equations with a condition of some 1e6


def split(share: float, ratio: float, rows: int) -> pd.DataFrame:
    """The mode with a part of that ``share`` of its mass on a spring, at ``ratio`` times its frequency."""
    omega = OMEGA_N * np.linspace(0.8, 1.2, rows)
    m, w = share * M, ratio * OMEGA_N
    spring = m * (w**2 + 0.01j * w * omega)
    own = M * (OMEGA_N**2 - omega**2 + 2j * ZETA * OMEGA_N * omega)
    return measured(omega, 1.0 / (own + spring - spring**2 / (spring - m * omega**2)), 2)


@pytest.mark.parametrize("rows", [41, 61])
@pytest.mark.parametrize(("share", "ratio"), [(0.02, 1.0), (0.05, 0.96), (0.05, 1.03), (0.09, 0.98)])
def test_a_mode_split_by_a_tuned_part_is_diagnosed_and_not_ranked(share, ratio, rows):
    assert is_diagnosed_and_not_ranked(audited(split(share, ratio, rows)), "several-modes")


def test_a_split_mode_without_phases_is_not_diagnosed_either():
    """Amplitudes alone do not tell an antiresonance from a saddle between two modes that respond oppositely."""
    with pytest.raises(Refused, match="--despite several-modes"):
        audited(split(0.05, 1.0, 41).drop(columns="phase")).require(diagnosed=True)


@pytest.mark.parametrize("ratio", [1.0, 0.99, 1.07, 1.15])
@pytest.mark.parametrize("share", [1.0, -1.0, 3.0])
def test_two_separate_modes_are_not_diagnosed_as_one(share, ratio):
    """Modes at 10 and 11.5 Hz, the mode file at one or between them: both imply half the mass, none or a quarter."""
    omega = OMEGA_N * np.linspace(0.9, 1.25, 61)
    each = ((OMEGA_N, 1.0), (1.15 * OMEGA_N, share))
    compliance = sum(part / (M * (own**2 - omega**2 + 2j * ZETA * own * omega)) for own, part in each)
    with pytest.raises(Refused, match="several-modes"):
        audited(measured(omega, compliance, 2), ratio * HERTZ).require(diagnosed=True)


def with_factors(table: pd.DataFrame, factors: dict[str, float]) -> pd.DataFrame:
    """The readings of some sweeps times factors."""
    return table.assign(amplitude=table["amplitude"] * table["sweep"].map(factors).fillna(1.0))


def test_one_level_that_falls_by_its_own_gain_is_diagnosed_and_not_ranked():
    assert is_diagnosed_and_not_ranked(audited(with_factors(swept(4), {"3": 0.55})), "amplitude-falls")


def test_levels_with_exchanged_readings_are_not_diagnosed_either():
    """Levels 2 and 4: both are odd, and no gain of one level explains it."""
    with pytest.raises(Refused, match="amplitude-falls"):
        audited(with_factors(swept(5), {"2": 2.0, "4": 0.5})).require(diagnosed=True)
