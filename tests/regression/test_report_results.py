"""Section 5.3 of the report: the check-out data and the Saturn V regressions, from the inputs that it computed with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from damping.regression.design import Design
from damping.regression.fit import fit, one_term_fits
from damping.regression.selecting import fit_nonnegative, stepwise
from damping_reed1970 import load_table

Build = Callable[..., Design]


def half_a_digit(printed: str) -> float:
    """Half a unit of the last printed digit."""
    return 0.5 * 10.0 ** -len(printed.partition(".")[2])


def with_response(design: Design, observed: np.ndarray) -> Design:
    return Design(design.names, design.columns, design.tails, design.response, observed)


def test_checkout_data_give_back_the_polynomial_they_were_calculated_from(report_design: Build) -> None:
    """Eq. 5.3.1: 1.571, 1.066 (the generator is 1.571, 1.067).

    The energies printed have a slide rule's errors; calculated from pi/2 and 16/15 and rounded to the three decimals
    printed they give 1.5707 and 1.0668: the printed 1.571 to the digit, 1.066 to one unit of its last.
    """
    design = report_design("5_II", "A^2*omega, A^3*omega", "corrected")
    exact = with_response(design, np.round(design.columns @ [np.pi / 2, 16 / 15], 3))
    found = fit(exact)
    assert abs(found.coefficients[0] - 1.571) <= half_a_digit("1.571")
    assert abs(found.coefficients[1] - 1.066) <= 2 * half_a_digit("1.066")
    # each coefficient within three standard errors of the generator's: what rounding E leaves
    assert (np.abs(found.coefficients - [np.pi / 2, 16 / 15]) < 3 * found.std_errors).all()
    # recomputed value of the project's list of printed results, to its ten digits
    np.testing.assert_allclose(found.coefficients, [1.570694357, 1.066789604], atol=1e-9, rtol=0)


@pytest.mark.parametrize("version", ["printed", "corrected"])
def test_checkout_order_of_significance(report_design: Build, version: str) -> None:
    """ "phi_1 to be more significant than phi_2; with the same ordering for the T-ratio test"."""
    design = report_design("5_II", "A^3*omega, A^2*omega", version)
    assert [one.names[0] for one in one_term_fits(design)] == ["A^2*omega", "A^3*omega"]
    if version == "corrected":  # the printed A of row 6 (1.040) is wrong and reverses the T-ratios
        found = fit(design)
        assert abs(found.t_ratios[1]) > abs(found.t_ratios[0])


def test_checkout_five_terms(report_design: Build) -> None:
    """Eq. 5.3.3 cannot be had from three-digit data (E5II-3): the optimum on the corrected table, its condition number
    and that the printed coefficients are not the optimum."""
    design = report_design("5_II", "A^2*omega, A^3*omega, A^3*omega^2, A^2, A^4*omega", "corrected")
    found = fit(design)
    # the erratum's values, to the digits it gives
    np.testing.assert_allclose(found.coefficients, [1.4851, 0.5443, 0.1667, 0.3473, 0.1177], atol=5e-5, rtol=0)
    np.testing.assert_allclose(found.std_errors, [0.62, 0.31, 0.28, 0.77, 0.15], atol=5e-3, rtol=0)
    assert round(found.condition_number) == 1748
    printed = design.observed - design.columns @ [1.455, 0.827, 0.1179, 0.222, 0.0223]
    np.testing.assert_allclose([found.sse, printed @ printed], [6.31e-4, 7.35e-4], atol=5e-7, rtol=0)
    # and that is why the printed ones are inside their errors
    assert (np.abs(found.coefficients - [1.455, 0.827, 0.1179, 0.222, 0.0223]) < found.std_errors).all()


def test_more_terms_never_fit_worse(report_design: Build) -> None:
    """E5II-5: the report says the five-term fit has more than twice the error of the two-term one; on the same data a
    nested fit cannot have."""
    two = fit(report_design("5_II", "A^2*omega, A^3*omega", "corrected"))
    five = fit(report_design("5_II", "A^2*omega, A^3*omega, A^3*omega^2, A^2, A^4*omega", "corrected"))
    # the erratum's figures, to its digits
    assert [round(f.rms_error, 4) for f in (two, five)] == [0.0084, 0.0067]
    assert [round(f.average_absolute_percent, 3) for f in (two, five)] == [0.152, 0.109]


def test_rough_data_give_the_printed_fits_and_energies(report_design: Build) -> None:
    """Eqs. 5.3.9 and Table 5.III on the inputs recovered from it."""
    E1, E2 = fit(report_design("5_III", "A^2*omega, A^3*omega")), fit(report_design("5_III", "A^2*omega"))
    for found, printed in zip([*E1.coefficients, *E2.coefficients], ["5.221", "5.538", "9.942"], strict=True):
        assert abs(found - float(printed)) <= half_a_digit(printed)
    # four more digits, from the record of what the recovered inputs give
    np.testing.assert_allclose([*E1.coefficients, *E2.coefficients], [5.2213, 5.538193, 9.941913], atol=5e-5, rtol=0)
    table = load_table("5_III")
    # the recovered inputs give the printed columns to .012 (two units of their last digit, which the report cut off)
    np.testing.assert_allclose(E1.fitted, table["E1_in_lb"], atol=0.012, rtol=0)
    np.testing.assert_allclose(E2.fitted, table["E2_in_lb"], atol=0.012, rtol=0)
    # and the printed per cents to one unit of their last digit
    np.testing.assert_allclose(E2.percent, table["percent_deviation_E2"], atol=0.01, rtol=0)


def test_rough_data_as_printed_give_something_else(report_design: Build) -> None:
    """E5III-1: 5.091, 5.667 and 9.926."""
    E1 = fit(report_design("5_III", "A^2*omega, A^3*omega", "printed"))
    E2 = fit(report_design("5_III", "A^2*omega", "printed"))
    np.testing.assert_allclose([*E1.coefficients, *E2.coefficients], [5.091, 5.667, 9.926], atol=5e-4, rtol=0)


def test_pitch_data_give_the_printed_fits_and_energies(report_design: Build) -> None:
    """Eqs. 5.3.14 and 5.3.15 and the viscous 2.39; A^2 omega in E_3 is not significant."""
    E3 = fit(report_design("5_IV", "A^2*omega, A^3*omega^2", run="E3"))
    E4 = fit(report_design("5_IV", "A^3*omega^2", rows=slice(3, 12)))
    viscous = fit(report_design("5_IV", "A^2*omega"))
    found = [*E3.coefficients, *E4.coefficients, viscous.coefficients[0] / np.pi]
    for value, printed in zip(found, ["1.17", ".604", ".707", "2.39"], strict=True):
        assert abs(value - float(printed)) <= half_a_digit(printed)
    np.testing.assert_allclose(found, [1.173396846, 0.6040829231, 0.7074112693, 2.390072561], atol=5e-10, rtol=0)
    assert abs(E3.t_ratios[1]) > abs(E3.t_ratios[0])  # "with the A^3 omega^2 term being more significant"
    assert abs(E3.t_ratios[0]) < 0.6  # far below any T-ratio that is called significant
    # fitted energies as printed, to the .008 of the erratum; row 13 has two digits exchanged (E5IV-3)
    others = np.arange(15) != 12
    np.testing.assert_allclose(E3.fitted[others], load_table("5_IV")["E3_in_lb"][others], atol=0.008, rtol=0)
    np.testing.assert_allclose(E4.fitted, load_table("5_IV")["E4_in_lb"][3:12].astype(float), atol=0.01, rtol=0)
    # per cents to the printed digit, after the rounding of the fitted energies (.005 of 22) as well
    percent = load_table("5_IV")["percent_deviation_E4"][3:12].astype(float)
    np.testing.assert_allclose(E4.percent, percent, atol=0.08, rtol=0)


def test_pitch_data_as_printed_give_something_else(report_design: Build) -> None:
    """E5IV-1: 1.0901, .6164 and .7138."""
    E3 = fit(report_design("5_IV", "A^2*omega, A^3*omega^2", "printed"))
    E4 = fit(report_design("5_IV", "A^3*omega^2", "printed", rows=slice(3, 12)))
    np.testing.assert_allclose([*E3.coefficients, *E4.coefficients], [1.0901, 0.6164, 0.7138], atol=5e-5, rtol=0)
    assert round(float(E3.t_ratios[0]), 1) == 0.5  # the T-ratio that the project's list of results states


def test_nine_terms_have_negative_coefficients_and_no_significant_one(nine_term_design: Design) -> None:
    """ "When attempting to use the nine term polynomial ... negative coefficients resulted"; condition near 1e7."""
    found = fit(nine_term_design)
    assert (found.coefficients < 0).any()
    assert np.abs(found.t_ratios).max() < 2
    assert 0.9e7 < found.condition_number < 1.2e7


def test_repeating_with_the_most_significant_terms(nine_term_design: Design) -> None:
    """Backward elimination leaves large cancelling coefficients; with coefficients >= 0 a few terms are left."""
    free = stepwise(nine_term_design, "backward", t_stop=2.0)
    assert np.abs(free.fit.t_ratios).min() >= 2.0
    assert (free.fit.coefficients < 0).any()
    share = np.abs(free.fit.coefficients * nine_term_design.take(free.chosen).columns).max(axis=1)
    assert np.median(share / nine_term_design.observed) > 100  # terms a hundred times their sum
    physical = stepwise(nine_term_design, "backward", t_stop=2.0, fitter=fit_nonnegative)
    assert (physical.fit.coefficients > 0).all()
    assert len(physical.chosen) <= 3
