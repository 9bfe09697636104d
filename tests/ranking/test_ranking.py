"""The table of candidates: right law first, weights, physical or not, cautions, held-out errors."""

from itertools import pairwise

import numpy as np
import pytest
import statsmodels.api as sm

from damping.errors import AnalysisError
from damping.forces import CATALOGUE, make
from damping.infer.evidence import evidence, find_mode
from damping.infer.law import Coordinates, Law
from damping.ranking import rank_laws
from damping.ranking.candidates import (
    MOST_FOLDS,
    candidate_laws,
    fit,
    fitted_force,
    held_out_errors,
    percent_errors,
    polynomial_laws,
)
from damping_validation.calibration import simulated_levels, structures

OMEGA = 12.0
LEVELS = np.geomspace(0.4, 2.0, 8)


def levels_of(forces, peaks, noise=0.01, seed=0, A=LEVELS):
    """Resonances whose amplitudes carry relative noise."""
    F = sum(np.asarray(force.quadrature(A, OMEGA)) for force in forces)
    return peaks(A * np.exp(noise * np.random.default_rng(seed).standard_normal(len(A))), F, OMEGA)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("viscous", {"coefficient": 1.5}),
        ("velocity-squared", {"coefficient": 0.2}),
        ("displacement-velocity", {"coefficient": 2.0}),
        ("quadratic-displacement", {"coefficient": 3.0}),
        ("displacement", {"coefficient": 20.0}),
    ],
)
def test_the_true_single_force_leads_or_ties(name, parameters, peaks):
    """At one frequency, forces of one power of amplitude cannot be told apart: the leader has the true power."""
    ranking = rank_laws(levels_of([make(name, **parameters)], peaks), laws=[Law((n,)) for n in CATALOGUE])
    powers = {n: make(n, coefficient=1.0).energy_exponents[0] for n in CATALOGUE if n in _POWERS}
    leader = ranking.candidates[0].law.components[0]
    assert powers.get(leader) == powers[name]


_POWERS = ("viscous", "velocity-squared", "displacement-velocity", "quadratic-displacement", "displacement")


def test_pair_beats_its_parts_and_gives_its_coefficients(peaks):
    true = [make("viscous", coefficient=1.0), make("quadratic-displacement", coefficient=2.0)]
    data = levels_of(true, peaks, noise=0.005)
    ranking = rank_laws(data)
    pair = ranking.find(Law(("viscous", "quadratic-displacement")))
    for single in ("viscous", "quadratic-displacement"):
        assert ranking.find(Law((single,))).score > pair.score + 20.0
    for coefficient, value in zip(pair.coefficients, (1.0, 2.0), strict=True):
        assert abs(coefficient.value - value) < 4.0 * coefficient.std_error  # seed fixed: 4 standard errors suffice
        assert coefficient.low < value < coefficient.high


def test_weights_ranks_and_order(saturn):
    ranking = rank_laws(saturn("config-2-mode-1"))
    fitted = [c for c in ranking.candidates if c.rank is not None]
    assert [c.rank for c in fitted] == list(range(1, len(fitted) + 1))
    assert all(a.score <= b.score for a, b in pairwise(fitted))
    np.testing.assert_allclose(sum(c.weight for c in ranking.candidates), 1.0, rtol=1e-12)
    assert len(ranking.candidates) == len(candidate_laws(saturn("config-2-mode-1")))


def test_weights_are_posterior_probabilities(saturn):
    ranking = rank_laws(saturn("config-2-mode-2"))
    a, b = ranking.weighted(0.01)[:2]
    np.testing.assert_allclose(a.weight / b.weight, np.exp(-0.5 * (a.score - b.score)), rtol=1e-12)


def test_friction_alone_is_listed_with_the_reason(saturn):
    coulomb = rank_laws(saturn("config-2-mode-1"), laws=[Law(("coulomb",)), Law(("viscous",))]).find(Law(("coulomb",)))
    assert coulomb.rank is None
    assert "friction alone" in coulomb.cautions[0]
    assert coulomb.weight == 0.0


def test_negative_coefficient_is_not_physical(saturn):
    row = rank_laws(saturn("config-2-mode-1")).find(Law(("viscous", "coulomb")))
    assert not row.physical
    assert row.weight == 0.0
    assert min(c.value for c in row.coefficients) < 0.0
    assert any("negative" in caution for caution in row.cautions)


def test_nothing_fits_is_an_analysis_error(saturn):
    with pytest.raises(AnalysisError, match="friction alone"):
        rank_laws(saturn("config-2-mode-1"), laws=[Law(("coulomb",))])


def test_one_level_has_no_held_out_error(saturn):
    row = rank_laws(saturn("config-1-mode-2-rough"), laws=[Law(("viscous",))]).candidates[0]
    assert np.isnan(row.held_out_error)
    assert "one level: nothing to hold out" in row.cautions


def test_held_out_error_is_refitting_without_the_level(saturn):
    data, law = saturn("config-2-mode-1"), Law(("velocity-squared",))
    keep = np.array([True, True, False])
    others = data.keep_sweeps(keep)
    c = Coordinates.of(law, others)
    coefficient = float(fit(c, others, find_mode(c, others)).values[0])
    # C = (8/3 pi) c (omega A)^2 = F solved for A
    predicted = np.sqrt(data.tested_force[2] * 3.0 * np.pi / (8.0 * coefficient)) / data.tested_omega[2]
    np.testing.assert_allclose(
        held_out_errors(law, data)[2], 100.0 * (predicted / data.tested_amplitude[2] - 1.0), rtol=1e-9
    )


def test_many_sweeps_are_left_out_in_groups():
    """Each sweep is predicted without its whole group."""
    data = simulated_levels(structures()[1], 3 * MOST_FOLDS, 4.0, 0.02, np.random.default_rng(5))
    law = structures()[1].law
    grouped = held_out_errors(law, data)
    assert np.isfinite(grouped).all()
    keep = np.arange(len(grouped)) % MOST_FOLDS != 7
    others = data.keep_sweeps(keep)
    c = Coordinates.of(law, others)
    force = fitted_force(c, fit(c, others, find_mode(c, others)), find_mode(c, others))
    np.testing.assert_allclose(grouped[~keep], percent_errors(force, data.keep_sweeps(~keep)), rtol=1e-9)


def test_percent_errors_of_the_linear_law_of_sweep_c(saturn):
    """A constant c of sweep C gives A = A_C (F/F_C)(omega_C/omega), Eq. 4.1.7; Table 4.IV holds xi constant instead."""
    data = saturn("config-2-mode-1")
    top = data.keep_sweeps(np.array([False, False, True]))
    x = np.array([0.0, 0.0])  # total = 1: carries the force of sweep C exactly
    expected = 1.567 * data.tested_force / 28.98 * data.tested_omega[2] / data.tested_omega
    errors = percent_errors(Coordinates.of(Law(("viscous",)), top).force(x), data)
    np.testing.assert_allclose(errors, 100.0 * (expected / data.tested_amplitude - 1.0), rtol=1e-9, atol=1e-9)


def test_least_squares_against_statsmodels(peaks):
    """Two viscous-like columns, exact data but for small noise: the same coefficients as a weighted regression."""
    data = levels_of([make("viscous", coefficient=1.0), make("displacement-velocity", coefficient=2.0)], peaks, 0.002)
    c = Coordinates.of(Law(("viscous", "displacement-velocity")), data)
    found = fit(c, data, evidence(c, data).mode)
    columns = np.stack([make(n, coefficient=1.0).quadrature(data.A, OMEGA) for n in c.law.components], axis=1)
    slope = c.force(evidence(c, data).mode).slope(data.A, OMEGA)
    wls = sm.WLS(data.D, columns, weights=1.0 / slope**2).fit()
    np.testing.assert_allclose(found.values, wls.params, rtol=2e-3)  # weights move with the fit: second order in 0.2 %
    ratio = found.std_errors / wls.bse
    np.testing.assert_allclose(ratio, ratio[0], rtol=0.02)  # one common scatter, theirs from residuals, ours inferred


def test_polynomial_candidates_need_rows(saturn):
    assert polynomial_laws(saturn("config-2-mode-1")) == []
    found = polynomial_laws(saturn("config-1-mode-2-rough"))
    assert found
    assert all(len(law.components) <= 3 for law in found)


def test_repeated_amplitudes_give_no_polynomials(peaks):
    A = np.full(12, 1.0)
    assert polynomial_laws(peaks(A, 3.0 * A, OMEGA)) == []


def test_every_force_and_pair_is_a_candidate(saturn):
    laws = {law.components for law in candidate_laws(saturn("config-2-mode-1"))}
    assert {(name,) for name in CATALOGUE} <= laws
    assert ("viscous", "slip") in laws
    assert ("viscous", "coulomb") in laws
