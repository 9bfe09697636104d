"""One law in all records, or a law each: odds by hand."""

from __future__ import annotations

import numpy as np

from damping.ranking.sharing import weigh_sharing

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
