"""Studies of chapter V: many fits at once, nine terms, false terms, circularity, the energy surface."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import least_squares, nnls

from damping.forces import VelocitySquared
from damping.predict.steady import steady_state
from damping.regression.design import design_of_arrays
from damping.regression.selecting import stepwise
from damping.regression.subsets import all_subsets, best_subsets
from damping.signals import damping_roots, plane_motion
from damping_reed1970 import load_table
from damping_reed1970.chapter_3 import PLANES, PlanarOscillator, pitch_response
from damping_reed1970.chapter_5 import energy_design
from damping_reed1970.chapter_5.circularity import (
    ASSUMED,
    FITTED,
    LOW_ROOT,
    ROUTES,
    circularity,
    routes,
    true_motions,
    velocity_squared_motion,
    xi_as_the_report,
)
from damping_reed1970.chapter_5.false_terms import (
    POSITIONS,
    design,
    false_terms,
    fits_in_blocks,
    known_law,
    subset_fits,
)
from damping_reed1970.chapter_5.nine_terms import NINE_TERMS, energy_surface, load_inputs, nine_terms

FIVE, NINE = POSITIONS


@pytest.fixture(scope="module")
def noisy() -> tuple[np.ndarray, np.ndarray]:
    """Five columns of the check-out data and 40 noisy responses."""
    A, omega, E = known_law()
    rng = np.random.default_rng(7)
    return design(A, omega, FIVE), E * (1.0 + 0.01 * rng.standard_normal((40, len(E))))


def test_many_fits_are_the_fits_of_one_response(noisy: tuple[np.ndarray, np.ndarray]) -> None:
    X, E = noisy
    found = subset_fits(X, E)
    for r in (0, 17, 39):
        single = all_subsets(design_of_arrays(X, E[r]))
        order = [np.flatnonzero((found.members == members).all(axis=1))[0] for members in single.members]
        # scaled condition number 1.7e3: eleven digits or more are left
        np.testing.assert_allclose(found.coefficients[order, r], single.coefficients, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(found.sse[order, r], single.sse, rtol=1e-9, atol=0.0)
        np.testing.assert_allclose(found.t_ratios[order, r], np.nan_to_num(single.t_ratios), rtol=1e-7, atol=1e-9)
    # a design of its own for each response gives the same
    own = subset_fits(np.broadcast_to(X, (len(E), *X.shape)), E)
    np.testing.assert_allclose(own.sse, found.sse, rtol=1e-10, atol=0.0)


def test_many_selections_are_the_selections_of_one_response(noisy: tuple[np.ndarray, np.ndarray]) -> None:
    X, E = noisy
    (found,) = fits_in_blocks(X, E)
    free, positive, backward = found.best(), found.best(nonnegative=True), found.backward(2.0)
    for r in range(0, len(E), 8):
        one = design_of_arrays(X, E[r])
        assert (found.members[free[r]] == best_subsets(one).members[0]).all()
        assert (found.members[positive[r]] == best_subsets(one, nonnegative=True).members[0]).all()
        kept = np.isin(np.arange(5), stepwise(one, "backward", t_stop=2.0).chosen)
        assert (found.members[backward[r]] == kept).all()


def test_nine_terms_of_the_report() -> None:
    found = nine_terms(["5.IV printed"])
    A, omega, E = load_inputs("5.IV printed")
    X = np.column_stack(
        [A**2 * omega, A**2, A**3 * omega**2, A**3 * omega, A**4 * omega, A, A**3, A**4, A**2 * omega**2]
    )
    unit = X / np.linalg.norm(X, axis=0)
    summary = found["nine_terms_summary"].iloc[0]
    # numpy's singular values lose the condition number's seven digits of sixteen
    np.testing.assert_allclose(summary["condition_number"], np.linalg.cond(unit), rtol=1e-6, atol=0.0)
    weights, _ = nnls(unit, E)
    # what is held at nought is exact; the rest is a well-conditioned fit
    expected = weights / np.linalg.norm(X, axis=0)
    np.testing.assert_allclose(found["nine_terms"]["nonnegative"], expected, rtol=1e-6, atol=1e-9)
    assert summary["negative_coefficients"] == 4  # "negative coefficients resulted"
    assert list(found["nine_terms"]["term"]) == list(NINE_TERMS)
    positive = 0
    for size in (1, 2, 3):  # no larger subset of these data has all coefficients above 0
        for subset in combinations(range(9), size):
            positive += bool((np.linalg.lstsq(unit[:, subset], E, rcond=None)[0] > 0.0).all())
    assert summary["subsets_all_positive"] == positive
    path = found["nine_terms_elimination"].query("coefficients == 'free'")
    assert path["terms_left"].tolist() == list(range(9, 0, -1))
    assert path["rms_error_in_lb"].is_monotonic_increasing


def test_false_terms_of_the_full_fit_are_student_t() -> None:
    """With the true law among the terms each false T-ratio is Student's t with 14 - 5 degrees of freedom."""
    A, omega, E = known_law()
    runs = 4000
    noise = 0.01 * E.mean() * np.random.default_rng(11).standard_normal((runs, len(E)))
    X = design(A, omega, FIVE)
    full = np.concatenate([fits.t_ratios[fits.members.all(axis=1)][0] for fits in fits_in_blocks(X, E + noise)])
    expected = 2.0 * stats.t.sf(2.0, 9)
    shares = (np.abs(full[:, 2:]) >= 2.0).mean(axis=0)
    # four binomial standard errors
    np.testing.assert_allclose(shares, expected, rtol=0.0, atol=4.0 * np.sqrt(expected * (1.0 - expected) / runs))


def test_false_terms_study() -> None:
    found = false_terms(noise=(0.1, 3.0), replicates=200, seed=5)
    table = found.selection.set_index(["terms", "method", "noise_percent"])["share_false"]
    again = false_terms(noise=(0.1, 3.0), replicates=200, seed=5)
    assert found.selection.equals(again.selection)  # seeded
    assert len(table) == 2 * 3 * 2
    shares = found.selection
    assert (shares["share_exact"] + shares["share_false"] <= 1.0 + 1e-12).all()  # shares of 200 in binary
    # with nine terms backward elimination keeps a term that is not there nearly always, already at 0.1 per cent noise
    assert table[NINE, "backward elimination, |T| >= 2", 0.1] > 0.9
    # coefficients > 0 protect, at every noise and with either set of terms, and never come out negative
    for terms in (FIVE, NINE):
        for noise in (0.1, 3.0):
            free, held = (table[terms, method, noise] for method in
                          ("best subset, BIC", "best subset, BIC, coefficients > 0"))  # fmt: skip
            assert held < free
    assert (shares.loc[shares["method"].str.contains("> 0"), "share_negative"] == 0.0).all()
    frequency = found.frequency.query("terms == @FIVE and noise_percent == 0.1 and true")["share"]
    assert (frequency > 0.95).all()  # true terms are there at small noise


def test_inflation_against_simulation() -> None:
    A, omega, E = known_law()
    found = false_terms(noise=(1.0,), replicates=2).inflation
    rng = np.random.default_rng(2)
    noise = 0.01 * E.mean() * rng.standard_normal((4000, len(E)))
    for row, k in ((0, 2), (1, 5)):
        X = design(A, omega, FIVE)[:, :k]
        first = np.linalg.lstsq(X, (E + noise).T, rcond=None)[0][0]
        # a standard deviation from 4000 draws is known to 1.1 per cent; four of those
        np.testing.assert_allclose(100.0 * first.std() / 1.571, found["sd_percent"].iloc[row], rtol=0.045, atol=0.0)


def test_xi_of_many_energies_is_the_root_of_one() -> None:
    table = load_table("3_IV").query("corrected_row == 0")
    E = table["energy_input_in_lb"].to_numpy(dtype=float)
    F, omega = (load_table("3_I")[name].to_numpy(dtype=float) for name in ("force_lb", "omega_rad_s"))
    xi, found = xi_as_the_report(np.stack([E, 0.9 * E]))
    for row, energies in enumerate((E, 0.9 * E)):
        for k in range(15):
            roots = damping_roots(PLANES, F[k], omega[k], energies[k])
            below = roots.roots[roots.roots < 0.05]
            assert found[row, k] == (below.size > 0)
            expected = roots.xi_peak if not below.size else below[0] if LOW_ROOT[k] else below[-1]
            # companion eigenvalues against Newton-polished roots; double roots near the maximum keep half the digits
            np.testing.assert_allclose(xi[row, k], expected, rtol=1e-6, atol=0.0)
    assert (~found[0]).nonzero()[0].tolist() == [9, 12]  # points 10 and 13 (E3IV-1)


def test_route_returns_the_linear_truth() -> None:
    """Without noise the energies of the assumed structure give its xi back wherever the report's branch is right."""
    motion = true_motions()["linear, planes as assumed"]
    C_t2 = load_table("3_III", "corrected")["correction_Ct2_in"].to_numpy(dtype=float)
    A, E, _ = routes((motion - C_t2)[None])[ROUTES[0]]
    F, omega = (load_table("3_I")[name].to_numpy(dtype=float) for name in ("force_lb", "omega_rad_s"))
    expected = plane_motion(PLANES, F, omega, ASSUMED.C / (2.0 * PLANES.mass * PLANES.omega_p))
    right = np.isin(np.arange(1, 16), (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 14, 15))
    # xi = C/(2 M omega_p) differs by omega_y/omega_p - 1 = 0.9 per cent between the planes, the route takes one xi
    np.testing.assert_allclose(A[0, right], expected.A_p[right], rtol=0.01, atol=0.0)
    np.testing.assert_allclose(E[0, right], expected.E_p[right], rtol=0.02, atol=0.0)
    A_2, E_2, _ = routes((motion - C_t2)[None])[ROUTES[1]]
    np.testing.assert_allclose(A_2[0], np.abs(motion), rtol=1e-12, atol=0.0)
    np.testing.assert_allclose(E_2[0], -np.pi * PLANES.phi * F * motion.imag, rtol=1e-12, atol=0.0)


def test_velocity_squared_motion_balances_energy() -> None:
    F, omega = (load_table("3_I")[name].to_numpy(dtype=float) for name in ("force_lb", "omega_rad_s"))
    motion = velocity_squared_motion(0.265)
    loss = np.zeros(15)
    for omega_j, g in PLANES.planes:
        A = steady_state(VelocitySquared(0.265), abs(g) * F, omega, PLANES.mass, omega_j).amplitude
        loss += 8.0 / 3.0 * 0.265 * A**3 * omega**2
    # what the tail takes in is lost in both planes: Newton's tolerance
    np.testing.assert_allclose(-np.pi * PLANES.phi * F * motion.imag, loss, rtol=1e-7, atol=0.0)


def test_fitted_planes_are_the_least_squares_ones() -> None:
    table = load_table("3_III", "corrected")
    F, omega = (load_table("3_I")[name].to_numpy(dtype=float) for name in ("force_lb", "omega_rad_s"))
    A, phase = (table[name].to_numpy(dtype=float) for name in ("modal_amplitude_A2_in", "modal_phase_rad"))

    def residuals(p: np.ndarray) -> np.ndarray:
        ratio = pitch_response(PlanarOscillator(*p), PLANES.phi * F, omega) / (A * np.exp(-1j * phase))
        return np.concatenate([np.log(np.abs(ratio)), np.angle(ratio)])

    start = np.array([float(value) for value in FITTED[:5]])
    best = least_squares(residuals, start, x_scale=np.abs(start)).x
    # FITTED is written with three to five digits
    np.testing.assert_allclose(best, start, rtol=3e-3, atol=0.0)


def test_circularity_study() -> None:
    found = circularity(noise=(0.0, 3.0), replicates=100, seed=1)
    claims = found.claims.set_index(["truth", "noise_percent", "route"])
    assert found.identity < 0.05  # E_p = 2 pi M omega_p xi omega A_p^2 in every row of Table 3.IV, but for its errata
    totals = found.laws.groupby(["truth", "noise_percent", "route"], dropna=False)["share"].sum()
    np.testing.assert_allclose(totals, 1.0, rtol=1e-12, atol=0.0)
    linear = claims.loc["linear, planes as assumed"]
    assert (linear["nonlinear_share"] <= 0.05).all()
    # planes a few thousandths off, and the route makes a third of the coefficient of 5.3.16 and more from nothing
    off = claims.loc[("linear, planes as fitted", 0.0, ROUTES[0])]
    assert off["C_3"] > 0.1
    assert off["C_1"] < 0.6 * 2.49
    truth = claims.loc["velocity squared, planes as assumed"]
    assert (truth["nonlinear_share"] > 0.9).all()
    measured = claims.loc["measured"].droplevel("noise_percent")
    # Eq. 5.3.14 from the printed table, by Table 5.I
    printed = measured.loc["Table 5.IV as printed", ["C_1", "C_3"]].astype(float)
    np.testing.assert_allclose(printed, [1.0901 / np.pi, 0.375 * 0.6164], rtol=0.0, atol=5e-5)  # four decimals
    assert measured.loc["Table 5.IV as printed", "significant_share"] == 1.0
    assert measured.loc[ROUTES[0], "significant_share"] == 0.0  # without the corrections by hand


def test_energy_surface_passes_where_the_fits_do() -> None:
    found = energy_surface(cells=40)
    A, omega, E = load_inputs("5.III printed")
    X = energy_design(NINE_TERMS, A, omega, E).columns
    members = [NINE_TERMS.index(term) for term in found.law]
    expected = np.linalg.lstsq(X[:, members], E, rcond=None)[0]
    grid = energy_design(NINE_TERMS, found.amplitude, np.full(40, found.omega[7]), np.ones(40)).columns[:, members]
    np.testing.assert_allclose(found.physical[:, 7], grid @ expected, rtol=1e-9, atol=1e-9)  # two terms: rounding
    assert (expected > 0.0).all()
    assert found.negative_share > 0.0 > found.lowest
    assert found.rms_errors[1] < found.rms_errors[0]
