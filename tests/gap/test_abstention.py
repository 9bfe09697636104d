"""With the true effect deleted from the library there is no confident answer."""

from __future__ import annotations

import pytest

from damping.effects import CATALOGUE
from damping.gap.diagnose import diagnose

#: Effects that are the same to first order: a second plane is a mode beside and a gain, a delay a lag in a narrow band.
ALIKE = {"planar-coupling": {"second-mode"}, "phase-lag": {"time-delay"}}
#: Effects whose gap in ``lab`` is 6 to 31 sigma: an instrument, a structure and a damping force; others of each kind.
LARGE = ("phase-lag", "residual-modes", "slip")
FURTHER = ("planar-coupling", "force-dropout", "stiffness-hardening")


@pytest.mark.parametrize("name", [*LARGE, *(pytest.param(name, marks=pytest.mark.slow) for name in FURTHER)])
def test_a_large_gap_without_its_effect_is_unexplained(lab, name):
    smaller = {other: effect for other, effect in CATALOGUE.items() if other not in {name} | ALIKE.get(name, set())}
    found = diagnose(lab.measured(name, points=10), lab.mode(), smaller)
    assert found.unexplained or found.hypotheses[0].probability < 0.95
    assert all(name not in one.effects for one in found.hypotheses)
    assert found.gap.nominal > 2.0  # the gap is seen
