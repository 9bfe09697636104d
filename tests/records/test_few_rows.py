"""Sweeps of two or three rows without phases: whether the resonance may lie beyond them."""

import numpy as np
import pandas as pd
import pytest

from damping.records import audit
from damping.records.mode import Mode
from damping.records.record import Record

FORCES = (1.0, 2.0, 4.0)


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
