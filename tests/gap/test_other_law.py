"""Damping of another law than the simulated one is called so; structural damping, in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from damping.gap.corrected import corrected_mode
from damping.gap.diagnose import diagnose
from damping.records.record import Record
from damping.report.gap import describe_diagnosis
from tests.gap.limited import limited

pytestmark = pytest.mark.usefixtures("no_folds")


def structural(lab, rows, seed, added=0.0, share=1.0):
    """F/(K (1 + i eta) - (M + m) w^2), of a share of the simulated damping at the resonance for m = 0."""
    loss = share * lab.viscous * lab.omega
    Y = lab.mass * lab.omega**2 - (lab.mass + added) * rows.omega**2 + 1j * loss
    return lab.record(rows, lab.cells(rows.force / np.abs(Y), np.angle(Y)), seed)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_structural_damping_against_a_viscous_simulation(lab, seed, among):
    """1/(K (1 + 2 i xi) - M w^2) is a viscous receptance turned by xi: one state cannot tell it from a phase offset."""
    found = limited(among("time-delay"), diagnose, structural(lab, lab.bench().rows, seed), lab.mode())
    assert not found.unexplained
    leading, group = found.leading.effects, next(group for group in found.groups if "displacement" in group.effects)
    assert leading in {("displacement",), ("phase-lag",)}
    assert {"displacement", "phase-lag"} <= set(group.effects)
    probability = {own.effects: own.probability for own in found.hypotheses}
    # each is half of what is left of one cause, give or take the scatter of their odds, of order one in ln
    assert 0.15 < probability["displacement",] < 0.95
    assert 0.15 < probability["phase-lag",] < 0.95
    test = found.next_tests[0]
    assert "added_mass" in test.columns
    own = next(own.hypothesis.best for own in found.hypotheses if own.effects == ("displacement",))
    corrected = corrected_mode(own)
    # C = (2/pi) C2 A of the law is the loss; 60 rows of 1 % know it to .3 %: four of them
    loss = 0.5 * np.pi * lab.viscous * lab.omega
    assert (set(corrected.damping), corrected.effects) == ({"displacement"}, {})
    np.testing.assert_allclose(corrected.damping["displacement"]["coefficient"], loss, rtol=0.012, atol=0.0)


@pytest.mark.parametrize("seed", [4, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (5, 7))])
def test_added_mass_tells_structural_damping_from_a_phase_offset(lab, seed, among):
    """At a lower resonance c w is smaller and the loss of a structure is not: the test that is proposed settles it."""
    rows, added = lab.bench().rows, 0.2 * lab.mass
    slower = replace(rows, omega=rows.omega / np.sqrt(1.2))
    first, table = (
        structural(lab, rows, seed).table.assign(added_mass=0.0),
        structural(lab, slower, 10 + seed, added).table.assign(added_mass=added),
    )
    table["sweep"] = "with mass " + table["sweep"]
    found = limited(
        among("time-delay"), diagnose, Record(pd.concat([first, table], ignore_index=True), "two states"), lab.mode()
    )
    assert found.leading.effects == ("displacement",)
    assert found.hypotheses[0].probability > 0.95
    (said,) = describe_diagnosis(found)["verdict"]
    assert "replaces the simulated viscous damping" in said


@pytest.mark.parametrize("share", [0.4, 2.5])
def test_structural_damping_of_another_size_than_simulated(lab, share, among):
    """The step to a law of the simulated size points the wrong way then; those to other sizes do not."""
    found = limited(among("time-delay"), diagnose, structural(lab, lab.bench().rows, 7, share=share), lab.mode())
    named = {own.effects: own.hypothesis.best for own in found.hypotheses if own.probability > 0.1}
    assert ("displacement",) in named
    coefficient = corrected_mode(named["displacement",]).damping["displacement"]["coefficient"]
    # as above; the smaller damping is known less well in proportion
    np.testing.assert_allclose(coefficient, share * 0.5 * np.pi * lab.viscous * lab.omega, rtol=0.03, atol=0.0)


@pytest.mark.parametrize("times", [-1.0, 3.0])
def test_a_phase_offset_stays_one(lab, times, among):
    """Of three damping ratios, or of one the other way: no structural damping of this loss makes it."""
    rows = lab.bench().rows
    cells = lab.linear(rows)
    record = lab.record(rows, lab.cells(cells.amplitude, cells.phase + times * lab.xi), 6)
    found = limited(among("time-delay"), diagnose, record, lab.mode())
    assert found.leading.effects == ("phase-lag",)
    assert all("displacement" not in group.effects for group in found.groups)


def test_mass_and_frequency_that_are_both_off(lab, among, no_rivals):
    """All levels share both: repeatability that is not stated does not stand for them."""
    rows = lab.bench().rows
    damping = {"viscous": {"coefficient": 1.15 * lab.viscous}}
    mode = replace(
        lab.mode(None, None, damping=damping), frequency=1.02 * lab.omega / (2.0 * np.pi), mass=1.15 * lab.mass
    )
    found = limited(among("level-offset", "drift"), diagnose, lab.record(rows, lab.linear(rows), 8), mode)
    assert (set(found.leading.effects), found.unexplained) == ({"natural-frequency", "amplitude-scale"}, False)
