"""Two gaps whose cause the report knows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from damping.gap.corrected import corrected_mode, effect_values
from damping.gap.diagnose import diagnose
from damping.gap.where import describe_resonances
from damping.records.mode import Tolerance
from tests.gap.limited import limited

#: Effects by which energy is lost, of those of one structure.
DISSIPATIVE = {
    *("viscous-coefficient", "displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement"),
    *("coulomb-friction", "slip"),
}


@pytest.fixture(scope="module")
def first(gaps):
    return gaps["1"]


@pytest.fixture(scope="module")
def second(gaps):
    return gaps["2"]


def test_configuration_1_has_two_planes_and_does_not_soften(first):
    assert first.leading.effects == ("planar-coupling",)
    # fifteen rows whose noise nobody stated, and one chance in two that the library holds the cause
    assert first.hypotheses[0].probability > 0.5
    assert first.in_library > 0.5  # a mount of a sensor has no residue of that sign
    # within the library a joint or a spring has less than a hundredth of the evidence
    for other in ("stiffness-softening", "slip"):
        rest = [one.hypothesis.log_posterior for one in first.hypotheses if other in one.effects]
        assert logsumexp(rest) < np.log(0.01) + first.leading.log_posterior


@pytest.mark.parametrize(
    ("frequency", "mass", "viscous"),
    [
        (0.003, 0.05, 0.12),
        *(
            pytest.param(*of, marks=pytest.mark.slow)
            for of in ((0.0005, 0.01, 0.12), (0.001, 0.05, 0.12), (0.002, 0.01, 0.12), (0.002, 0.05, 0.2))
        ),
    ],
)
def test_configuration_1_has_two_planes_at_other_tolerances(first, frequency, mass, viscous, among):
    """They are no more than assumed: beyond 0.001 a joint that slips and a resonance moved by 0.5 % fit as well.

    Two planes lead, or the answer says that it is they or slip.
    """
    mode = replace(first.mode, tolerance=Tolerance(frequency, mass, viscous))
    found = limited(among("slip", "stiffness-softening", "residual-modes"), diagnose, first.record, mode)
    said = [one.effects for one in found.explanations]
    assert said[0] == ("planar-coupling",) or {("planar-coupling",), ("slip",)} <= set(said)
    assert said[0] == ("planar-coupling",) or frequency > 0.001


def test_configuration_1_second_plane(first):
    own = first.leading.best
    ratio = effect_values(own)["planar-coupling"]["frequency_ratio"]
    second = corrected_mode(own).omega_n * ratio
    # least squares of Table 3.III with all parameters: 11.49 and 36 degrees with planes damped alike, 11.464 and 56
    # degrees with a second plane damped twice as much; the prior, a quarter more or less, lies between, and the mass is
    # held within 2 per cent here (28 degrees for 21, damped alike)
    assert 11.46 <= second <= 11.50
    assert 28.0 <= np.degrees(effect_values(own)["planar-coupling"]["angle"]) <= 56.0


def test_configuration_1_shrinks_in_its_own_record_only(first):
    assert first.gap.after < first.gap.before < first.gap.nominal
    assert first.held_out is None  # one level
    assert any("one force level" in caution for caution in first.cautions)


def test_configuration_2_loses_more_energy_at_larger_amplitudes(second):
    assert set(second.leading.effects) <= DISSIPATIVE
    assert second.leading.effects
    named = {effect for one in second.explanations for effect in one.effects}
    assert named <= DISSIPATIVE | {"amplitude-scale"}  # the shape of three points is not told from a wrong reading
    assert second.damping_trend.change > 0.0
    assert any("phase resonance" in caution for caution in second.cautions)


def test_configuration_2_is_that_of_the_report(second, saturn):
    zeta, A = (np.array([getattr(one, name) for one in second.local]) for name in ("damping", "amplitude"))
    levels = saturn("config-2-mode-1")
    np.testing.assert_allclose(A, levels.A, rtol=1e-12, atol=0.0)  # a level is a row: rounding
    # F = 2 M zeta omega_n omega A with the mass of each level (Table 4.I): rounding
    table = second.record.table
    expected = levels.D / (2.0 * table["mass"] * second.mode.omega_n * levels.omega * levels.A)
    np.testing.assert_allclose(zeta, expected, rtol=1e-12, atol=0.0)
    assert np.all(np.diff(zeta) > 0.0)
    assert second.gap.after < 1.0 < 2.0 < second.gap.before  # three levels, two parameters


def test_configuration_2_resonance_falls_as_no_damper_lets_it(second):
    """Table 4.I: 1.6688 Hz at the lowest level, 1.6640 Hz at the highest, .29 % less."""
    (said,) = (caution for caution in second.cautions if "resonance falls" in caution)
    assert "falls by 0.29 %, but with the leading explanation it stays: something else changes the stiffness" in said


def test_resonances_found_to_a_tenth_of_a_radian_are_no_fall(second):
    """Frequencies of one resonance in errors of their standard uncertainty; chi-square 13.8: one in a thousand."""
    one = second.local[0].frequency
    for errors in ((0.0, 0.0, 0.0), (1.0, -1.0, 0.5), (-1.0, 0.0, 1.0)):
        pairs = zip(second.local, errors, strict=True)
        local = [replace(each, frequency=one + error * each.frequency_sd) for each, error in pairs]
        assert describe_resonances(second.leading.best, local) == []


def test_the_next_test_of_tables_is_read_from_files_yet_to_be_named(first):
    """Table 3.III is no file: the command that would read the next test has the names of no other."""
    assert "damping gap MODEL.toml RECORD.csv" in first.next_tests[0].command
