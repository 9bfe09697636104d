"""Sweeps of few rows: whether the resonance may lie beyond them, and whether their phases have the right sign."""

import numpy as np
import pandas as pd
import pytest

from damping.records import audit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.view import Finding

FORCES = (1.0, 2.0, 4.0)
NOISES = (0.005, 0.005, 0.15)  # of phases, rad


def swept(ratios: list[float], **columns: float) -> Record:
    """A linear mode of 10 Hz and 1 % in closed form, at ``ratios`` of its frequency."""
    r = np.array(ratios)
    H = 1.0 / (1.0 - r**2 + 0.02j * r)
    tables = [
        pd.DataFrame({"sweep": f"{F:g}", "force": F, "frequency": 10.0 * r, "amplitude": F * abs(H), **columns})
        for F in FORCES
    ]
    return Record(pd.concat(tables, ignore_index=True))


@pytest.mark.parametrize("ratios", [[0.97, 0.98], [0.96, 0.97, 0.98], [1.02, 1.03], [1.02, 1.03, 1.04]])
def test_few_rows_beside_the_resonance_are_named(ratios):
    """Their edge was taken for the resonance without a word: the damping ratio reads 2.2 times too high."""
    (found,) = (finding for finding in audit(swept(ratios)).findings if finding.check == "edge-of-sweep")
    assert found.verdict == "caution"
    assert found.sweeps == ("1", "2", "4")
    assert "the resonance may lie beyond" in found.what


@pytest.mark.parametrize("ratios", [[1.0], [0.999, 1.001], [0.998, 1.0, 1.002], [0.99, 1.0, 1.01], [0.995, 1.0, 1.02]])
def test_few_rows_at_the_resonance_are_not(ratios):
    assert not audit(swept(ratios)).findings


def test_few_rows_with_phases_or_energies_say_what_the_damping_is():
    r = [0.97, 0.98]
    H = 1.0 / (1.0 - np.array(r) ** 2 + 0.02j * np.array(r))
    table = swept(r).table
    lag = np.tile(-np.angle(H), len(FORCES))
    energy = np.pi * table["force"] * table["amplitude"] * np.sin(lag)
    for column, values in (("phase", lag), ("energy", energy)):
        found = audit(Record(table.assign(**{column: values}))).findings
        assert not [finding for finding in found if "may lie beyond" in finding.what]


@pytest.mark.parametrize("ratios", [[0.93, 0.95], [0.92, 0.93, 0.95], [1.06, 1.08]])
def test_a_damping_that_reads_high_at_the_edge_is_no_second_finding(ratios):
    """|H| of the mode file beside its resonance, taken for a peak, shows a ratio of |1 - r^2|/2 = 5 %, not 1 %."""
    damping = {"viscous": {"coefficient": 0.02 / (2.0 * np.pi * 10.0)}}
    mode = Mode(frequency=10.0, mass=(2.0 * np.pi * 10.0) ** -2, damping=damping)
    assert [finding.check for finding in audit(swept(ratios), mode).findings] == ["edge-of-sweep"]


def test_a_damping_that_the_edge_does_not_explain_is_still_named():
    """Forces seven times too large for the mode's mass give seven times its |1 - r^2|/2."""
    mass = (2.0 * np.pi * 10.0) ** -2 / 7.0
    mode = Mode(frequency=10.0, mass=mass, damping={"viscous": {"coefficient": 0.02 * mass * 2.0 * np.pi * 10.0}})
    found = audit(swept([0.93, 0.95]), mode).findings
    assert [finding.check for finding in found] == ["edge-of-sweep", "beyond-model"]


def swept_lag(frequency: np.ndarray, F: float, *, turbulent: float, noise: float, seed: int) -> pd.DataFrame:
    """A mode of 10 Hz and 0.4 %, with a part ``turbulent`` A/F of its damping ratio more; phases with noise, rad."""
    r = frequency / 10.0
    A = np.full(len(r), F)
    for _ in range(200):  # halfway steps towards |Y(A)| A = F
        Y = 1.0 - r**2 + 2j * r * (0.004 + turbulent * A / F)
        A = 0.5 * (A + F / abs(Y))
    lag = np.angle(Y) + noise * np.random.default_rng(seed).normal(size=len(r))
    return pd.DataFrame({"sweep": f"{F:g}", "force": F, "frequency": frequency, "amplitude": A, "phase": lag})


def find_sign(tables: list[pd.DataFrame]) -> Finding:
    (sign,) = (found for found in audit(Record(pd.concat(tables))).findings if found.check == "phase-sign")
    return sign


@pytest.mark.parametrize(
    ("turn", "advice"),
    [
        (lambda lag: -lag, "negate it"),
        (lambda lag: lag - np.pi, "add pi"),
        (lambda lag: np.pi - lag, "take pi - phase"),
    ],
)
@pytest.mark.parametrize("wrong", [("1",), ("1", "2", "4")])
def test_a_wrong_sign_across_a_narrow_resonance_is_certain_in_few_rows(turn, advice, wrong):
    """One sine of 17 is large, and its scatter about the mean is no doubt about its sign."""
    tables = [swept_lag(np.linspace(9.0, 11.0, 17), F, turbulent=1e-4, noise=0.005, seed=6) for F in FORCES]
    for table in tables:
        if table["sweep"][0] in wrong:
            table["phase"] = turn(table["phase"])
    sign = find_sign(tables)
    assert sign.sweeps == wrong
    assert sign.advice.startswith(advice)
    assert ("leave the others" in sign.advice) == (len(wrong) == 1)


def test_sweeps_that_are_likely_of_the_wrong_sign_are_not_to_be_left_as_they_are():
    """Of two levels that are certain and a third with noisy phases in its wings, all negated, the third was."""
    f = np.linspace(9.0, 11.0, 15)
    tables = [swept_lag(f, F, turbulent=6e-5, noise=noise, seed=4) for F, noise in zip(FORCES, NOISES, strict=True)]
    sign = find_sign([table.assign(phase=-table["phase"]) for table in tables])
    assert sign.sweeps == ("1", "2", "4")
    assert "leave the others" not in sign.advice
