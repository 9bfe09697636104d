"""One law in all records, or a law each: odds by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from damping.infer.evidence import evidence
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.ranking import sharing
from damping.ranking.sharing import SharedShape, fit_jointly, read_rows, tabulate_rows, weigh_sharing

VISCOUS = ("viscous",)
SQUARED = ("velocity-squared",)


def groups(viscous: float) -> tuple[tuple[tuple[str, ...], float], ...]:
    return ((VISCOUS, viscous), (SQUARED, 1.0 - viscous))


def test_odds_of_two_records_by_hand():
    """Two laws of prior 1/2: evidence 2 w, so odds (1/2)(4 a b + 4 (1 - a)(1 - b)) / 1."""
    a, b = 0.9, 0.8
    odds, table = weigh_sharing([groups(a), groups(b)])
    np.testing.assert_allclose(odds, 2.0 * (a * b + (1.0 - a) * (1.0 - b)), rtol=1e-12)
    assert table["law"].tolist() == ["viscous", "velocity-squared"]
    np.testing.assert_allclose(table["weight"].iloc[0], a * b / (a * b + (1.0 - a) * (1.0 - b)), rtol=1e-12)


def test_records_that_disagree_have_laws_of_their_own():
    odds, _ = weigh_sharing([groups(0.999), groups(0.001)])
    assert odds < 0.01
    assert weigh_sharing([((VISCOUS, 1.0),), ((SQUARED, 1.0),)])[0] == 0.0


def test_more_records_that_agree_raise_the_odds():
    few, many = (weigh_sharing([groups(0.95)] * n)[0] for n in (2, 5))
    assert 1.0 < few < many


def test_equivalents_share_the_evidence_of_their_group():
    """Squared predicts the same as viscous on the first record, so the second alone decides between them."""
    odds, table = weigh_sharing([((VISCOUS + SQUARED, 1.0),), groups(0.7)])
    np.testing.assert_allclose(odds, 1.0, rtol=1e-12)
    np.testing.assert_allclose(table["weight"].iloc[0], 0.7, rtol=1e-12)


def test_laws_that_nobody_knows_are_left_out():
    assert np.isnan(weigh_sharing([((("guess",), 1.0),), groups(0.5)])[0])
    assert weigh_sharing([(*groups(0.5), (("guess",), 0.1)), groups(0.5)])[0] > 0.0


POWER = Law(("velocity-power",))
EXPONENT = "velocity-power exponent"
#: Values that the prior of the exponent spans.
SPAN = 3.0


@pytest.fixture(scope="module")
def power_law(peaks) -> Callable[..., Observations]:
    """Twelve resonances of C A^p with 2 % scatter, in units of their own."""

    def tested(p: float, seed: int, unit: float = 1.0) -> Observations:
        F = np.geomspace(1.0, 8.0, 12)
        A = unit * F ** (1.0 / p) * np.exp(0.02 * np.random.default_rng(seed).standard_normal(12))
        return peaks(A, F, 10.0)

    return tested


@pytest.fixture(scope="module")
def same(power_law) -> SharedShape:
    """Two records of one exponent, fitted jointly."""
    return fit_jointly(POWER, EXPONENT, [power_law(1.6, 1), power_law(1.6, 2, 1e-3)])


def test_one_exponent_is_told_from_two(power_law, same):
    apart = fit_jointly(POWER, EXPONENT, [power_law(1.2, 1), power_law(2.2, 2, 1e-3)])
    assert same.log_odds > 1.0
    assert apart.log_odds < -3.0
    assert same.pooled[1] < 1.6 < same.pooled[2]
    # two records of one exponent say more than each: narrower than either
    assert same.pooled[2] - same.pooled[1] < min(high - low for _, low, high in same.each)
    for (_, low, high), p in zip(apart.each, (1.2, 2.2), strict=True):
        assert low < p < high


def test_odds_of_normal_posteriors(same):
    """Normal posteriors N(m_i, s_i) under a flat prior of width R: ln odds = ln(R N(m_1 - m_2; 0, s_1^2 + s_2^2))."""
    (m_1, low_1, high_1), (m_2, low_2, high_2) = same.each
    spread = np.hypot(high_1 - low_1, high_2 - low_2) / (2.0 * 1.645)
    expected = np.log(SPAN * norm.pdf(m_1 - m_2, scale=spread))
    # the posteriors are skew and have tails, since exponents may stray: a factor of 1.5
    np.testing.assert_allclose(same.log_odds, expected, rtol=0.0, atol=0.4)


def test_a_record_alone_has_the_evidence_of_its_law(power_law):
    """Averaged over the nodes, evidence with the shape held is that of :func:`evidence`, by another way."""
    data = power_law(1.6, 5)
    held = sharing._hold_shape(POWER, EXPONENT, data)
    nodes = (np.arange(40) + 0.5) / 40.0
    averaged = logsumexp([held(p) for p in nodes]) - np.log(40.0)
    # both are Monte Carlo: 6 % and 3 %, and forty nodes leave two on the peak
    np.testing.assert_allclose(averaged, evidence(Coordinates.of(POWER, data), data).log_z, rtol=0.0, atol=0.3)


def test_the_joint_fit_moves_the_odds():
    """A law that would need two exponents loses by what the joint fit says against one."""
    nothing = (1.0, 1.0, 1.0)
    two = SharedShape(EXPONENT, nothing, (nothing, nothing), -4.0)
    records = [((("velocity-power",), 0.6), (VISCOUS, 0.4)), ((("velocity-power",), 0.7), (VISCOUS, 0.3))]
    odds, table = weigh_sharing(records, {"velocity-power": two})
    weight = table.set_index("law")["weight"]
    expected = 0.6 * 0.7 / (0.4 * 0.3) * np.exp(-4.0)
    np.testing.assert_allclose(weight["velocity-power"] / weight["viscous"], expected, rtol=1e-12)
    assert odds < weigh_sharing(records)[0]


def test_rows_of_a_study_are_its_observations(saturn):
    data = saturn("config-1-mode-2-pitch")
    again = read_rows(tabulate_rows(data))
    assert (again.sweeps, again.amplitude_is_input) == (data.sweeps, data.amplitude_is_input)
    for name in ("A", "omega", "D", "R", "sweep", "sd_phase", "tested_force", "tested_amplitude", "tested_omega"):
        # frequencies pass through hertz
        np.testing.assert_allclose(getattr(again, name), getattr(data, name), rtol=1e-14)
