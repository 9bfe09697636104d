"""The fit of the planar oscillator: exact data, derivatives, errors by simulation, and the test of Configuration I."""

from __future__ import annotations

from math import degrees, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import approx_fprime

from damping_reed1970.chapter_3 import PlanarOscillator, pitch_response, planar_fit
from damping_reed1970.chapter_3.planar_fit import PARAMETERS, Phasors, PlanarFit, comparison, fit_planar, phasors

OMEGA = np.linspace(11.1, 11.7, 25)
F = np.linspace(37.0, 40.0, 25)
TRUE = PlanarOscillator(M=21.0, C=2.3, omega_p=11.39, omega_y=11.48, theta=radians(36.0))


def measured(
    model: PlanarOscillator, noise: float = 0.0, seed: int = 0, kind: planar_fit.Noise = "constant"
) -> Phasors:
    rng = np.random.default_rng(seed)
    scatter = noise * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
    return Phasors(pitch_response(model, F, OMEGA) + scatter, F, OMEGA, kind)


@settings(max_examples=15, deadline=None)
@given(
    split=st.floats(0.05, 0.25),
    theta=st.floats(0.2, 1.37),
    xi=st.floats(0.003, 0.02),
    M=st.floats(1.0, 1e4),
    kind=st.sampled_from(["constant", "proportional"]),
)
def test_exact_phasors_give_the_parameters_back(
    split: float, theta: float, xi: float, M: float, kind: planar_fit.Noise
) -> None:
    model = PlanarOscillator(M, 2.0 * xi * M * 11.3, 11.3, 11.3 + split, theta)
    found = fit_planar(measured(model, kind=kind)).model
    # the minimiser stops at steps of 1e-12; a plane that carries little (theta 10 degrees: 3 per cent) loses two digits
    assert_allclose(found, model, rtol=1e-8, atol=1e-9)


def test_a_swapped_plane_and_a_negative_angle_are_the_same_response() -> None:
    swapped = TRUE._replace(omega_p=TRUE.omega_y, omega_y=TRUE.omega_p, theta=-(np.pi / 2 - TRUE.theta))
    assert_allclose(pitch_response(swapped, F, OMEGA), pitch_response(TRUE, F, OMEGA), rtol=1e-12)
    assert_allclose(fit_planar(measured(swapped)).model, TRUE, rtol=1e-6, atol=1e-9)


def test_motion_in_phase_and_lag_are_found() -> None:
    model = TRUE._replace(R=-1.4e-3, lag=0.05)
    assert_allclose(fit_planar(measured(model), extras=("R", "lag")).model, model, rtol=1e-6)


@pytest.mark.parametrize("kind", ["constant", "proportional"])
def test_jacobian_is_the_derivative(kind: planar_fit.Noise) -> None:
    names = (*PARAMETERS, "R", "lag")
    at = TRUE._replace(R=1e-3, lag=0.1)
    data = measured(TRUE, noise=0.01, kind=kind)

    def residuals(x: np.ndarray) -> np.ndarray:
        return planar_fit._real(data.residuals(at._replace(**dict(zip(names, x, strict=True)))))

    numerical = approx_fprime(np.array([getattr(at, name) for name in names]), residuals, 1e-7)
    # forward differences: half the second derivative times the step, large near resonance
    scale = np.abs(numerical).max(axis=0)
    found = planar_fit._real(planar_fit._jacobian(data, at, names))
    assert_allclose(found / scale, numerical / scale, rtol=0, atol=2e-4)


@pytest.fixture
def fewer_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two starts instead of five: for all data of these tests their minima are the same to rounding (one is not)."""
    monkeypatch.setattr(planar_fit, "_REFINED", 2)


@pytest.mark.usefixtures("fewer_starts")
def test_standard_errors_are_those_of_repeated_tests() -> None:
    fits = [fit_planar(measured(TRUE, noise=0.02, seed=seed)) for seed in range(64)]
    for name in (*PARAMETERS, "xi"):
        values = [one.xi if name == "xi" else getattr(one.model, name) for one in fits]
        stated = np.median([one.standard_errors[name] for one in fits])
        # the standard deviation of 64 values is known to 9 per cent: four of these
        assert_allclose(np.std(values, ddof=1), stated, rtol=0.36)
    # chi-square with 2 n - 5 degrees of freedom: 2.6 per cent of standard error of the mean of sigma^2, four of these
    assert_allclose(np.mean([one.sigma**2 for one in fits]), 0.02**2, rtol=0.105)
    # 24 products of 64 fits; fitting five parameters makes neighbours differ a little
    assert abs(np.mean([one.correlation for one in fits])) < 0.1


@pytest.mark.usefixtures("fewer_starts")
def test_chi_square_of_a_true_restriction() -> None:
    """Holding theta at the truth costs chi-square with one degree of freedom."""
    costs = []
    for seed in range(40):
        data = measured(TRUE, noise=0.02, seed=1000 + seed)
        costs.append(comparison(fit_planar(data, {"theta": TRUE.theta}), fit_planar(data))["chi_square"])
    assert min(costs) > -1e-8
    # mean 1 (times 2 n/(2 n - k) = 1.1 for the estimated sigma), standard deviation 1.4/sqrt(40) = .22: four of these
    assert abs(np.mean(costs) - 1.1) < 0.9


def held(noise: planar_fit.Noise = "constant") -> PlanarFit:
    return fit_planar(phasors("A2", noise), {"theta": radians(28.0), "M": 21.0})


def test_the_frequencies_that_the_report_read_off_its_plot() -> None:
    """Eqs. 3.1.36, 3.1.37 with theta and M of 3.2.16: 11.40 and 11.50 rad/s, read to .01."""
    fit = held()
    assert_allclose([fit.model.omega_p, fit.model.omega_y], [11.40, 11.50], rtol=0, atol=0.005)
    assert fit.standard_errors["theta"] == fit.standard_errors["M"] == 0.0


@pytest.mark.parametrize("noise", ["constant", "proportional"])
def test_all_parameters_of_the_second_mode(noise: planar_fit.Noise) -> None:
    """Ranges found by an independent fit of the same points with either noise, to their last digit."""
    fit = fit_planar(phasors("A2", noise))
    assert 11.385 < fit.model.omega_p < 11.405
    assert 11.475 < fit.model.omega_y < 11.495
    assert 36.5 < degrees(float(fit.model.theta)) < 37.5
    assert 22.35 < fit.model.M < 23.35
    assert 0.00465 < fit.xi < 0.00505
    assert comparison(fit, held(noise))["chi_square"] < 0.0  # two parameters more fit better


def test_the_tail_says_the_same_once_motion_in_phase_is_free() -> None:
    tail, mode = (fit_planar(phasors(name), extras=("R",)) for name in ("tail", "A2"))
    for name in ("omega_p", "omega_y", "theta", "C"):
        # one test seen twice: they differ by what the printed corrections vary from point to point
        assert abs(getattr(tail.model, name) - getattr(mode.model, name)) < 0.2 * mode.standard_errors[name]
    # and by what was removed: C_t2 of Table 3.III, .0583 in on average, known to the error of R
    removed = (mode.model.R - tail.model.R) * phasors("A2").F.mean()
    assert_allclose(removed, 0.0583, rtol=0.02)
