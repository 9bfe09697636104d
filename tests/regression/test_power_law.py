"""Power-law forms of section 4.3 against the report, its errata and closed forms."""

import numpy as np
import pytest

from damping.errors import AnalysisError
from damping.regression.fit import fit_power_law
from damping_reed1970 import load_table


@pytest.fixture(scope="module")
def tables():
    one, two = load_table("4_I"), load_table("4_II")
    corrected = load_table("4_I", "corrected")
    return one, two, corrected


def of_mode(tables, mode, corrected=False):
    one, two, mended = tables
    forces = (mended if corrected else one).query("mode == @mode")["modal_force_lb"].to_numpy(float)
    return forces, two.query("mode == @mode")["Am_in"].to_numpy(float)


def test_first_mode(tables):
    F, A = of_mode(tables, 1)
    law = fit_power_law(F, A, 10.47)
    # erratum E43-1: the printed points give 1.6515 +- 0.0389, not 1.859
    np.testing.assert_allclose([law.p, law.std_error], [1.6515, 0.0389], atol=5e-5)
    assert law.degrees_of_freedom == 1
    # E43-5: 3.119 in at 90 lb, 95 % interval 2.45 to 3.97 (t = 12.71)
    np.testing.assert_allclose(law.amplitude(90.0), 3.119, atol=5e-4)
    np.testing.assert_allclose(law.amplitude_interval(90.0), [2.45, 3.97], atol=5e-3)
    np.testing.assert_allclose(law.quantile, 12.71, atol=5e-3)


def test_second_mode_with_and_without_the_misprint(tables):
    # erratum E4I-1: 1.3635 as printed (s.e. .0002), 1.3492 with F_A = 27.55 (s.e. .0071)
    printed = fit_power_law(*of_mode(tables, 2), 17.09)
    np.testing.assert_allclose([printed.p, printed.std_error], [1.3635, 0.0002], atol=5e-5)
    mended = fit_power_law(*of_mode(tables, 2, corrected=True), 17.09)
    np.testing.assert_allclose([mended.p, mended.std_error], [1.3492, 0.0071], atol=5e-5)


@pytest.mark.parametrize("form", ["velocity-power", "displacement-velocity-power"])
@pytest.mark.parametrize("p", [0.5, 1.0, 2.0])
def test_exact_data_give_the_law_back(form, p):
    from damping.forces import make

    A, omega = np.array([0.3, 0.7, 1.1, 2.0]), np.array([9.0, 9.5, 10.0, 10.2])
    F = np.asarray(make(form, coefficient=0.8, exponent=p).quadrature(A, 10.0))
    law = fit_power_law(F, A, 10.0, form)
    np.testing.assert_allclose([law.p, law.alpha], [p, 0.8], rtol=1e-10)
    np.testing.assert_allclose(law.amplitude(F), A, rtol=1e-10)
    # the frequency of each level goes into its coefficient only
    np.testing.assert_allclose(fit_power_law(F, A, omega, form).alphas, 0.8 * (10.0 / omega) ** p, rtol=1e-10)


def test_both_forms_differ_by_one_in_p(tables):
    F, A = of_mode(tables, 1)
    a, b = fit_power_law(F, A, 10.47), fit_power_law(F, A, 10.47, "displacement-velocity-power")
    np.testing.assert_allclose(a.p - b.p, 1.0, rtol=1e-12)
    np.testing.assert_allclose(a.amplitude(90.0), b.amplitude(90.0), rtol=1e-12)


def test_two_levels_have_no_interval_and_one_has_no_law():
    law = fit_power_law(np.array([1.0, 4.0]), np.array([1.0, 2.0]), 1.0)
    np.testing.assert_allclose(law.p, 2.0, rtol=1e-12)
    assert np.isnan(law.p_low)
    assert np.isnan(law.std_error)
    with pytest.raises(AnalysisError, match="two levels"):
        fit_power_law(np.array([1.0, 2.0]), np.array([1.0, 1.0]), 1.0)
