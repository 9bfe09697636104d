"""Energy, energy content, damping term and conversion factors against the report's tables, errata named."""

from __future__ import annotations

import numpy as np
import pytest

from damping.errors import AnalysisError
from damping.forces import (
    Coulomb,
    Displacement,
    DisplacementVelocity,
    DisplacementVelocityPower,
    Force,
    QuadraticDisplacement,
    Slip,
    VelocityPower,
    VelocitySquared,
    Viscous,
    case_five,
    coefficient_from_energy,
    damping_ratio,
    damping_term,
    energy_factor,
    energy_per_cycle,
)
from damping.forces.powers import B, beta

A, omega, M, omega_n, C, alpha = 1.3, 10.4, 50.8, 10.455, 0.37, 1.7
pi = np.pi
EXACT = 1e-14  # closed forms against closed forms: rounding only


@pytest.mark.parametrize(
    ("force", "energy", "psi"),
    [
        (Viscous(C), C * pi * A**2 * omega, C * pi / (M * omega)),
        (Displacement(C), 2 * C * A**2, 2 * C / (M * omega**2)),
        (VelocitySquared(C), 8 / 3 * C * A**3 * omega**2, 8 * C * A / (3 * M)),
        # psi of case IV is printed without the 3 (erratum E2II-1)
        (DisplacementVelocity(C), 4 / 3 * C * A**3 * omega, 4 * C * A / (3 * M * omega)),
        # case V with C1 in place of the printed C5 (erratum E2II-2)
        (
            case_five(C, alpha),
            C * pi * A**2 * omega + pi / 4 * A**4 * omega * C * alpha,
            C * pi / (M * omega) + C * pi * alpha * A**2 / (4 * M * omega),
        ),
    ],
)
def test_table_2_II(force: Force, energy: float, psi: float) -> None:
    np.testing.assert_allclose(energy_per_cycle(force, A, omega), energy, rtol=EXACT)
    content = energy_per_cycle(force, A, omega) / (M * (A * omega) ** 2)  # Eq 2.3.5
    np.testing.assert_allclose(content, psi, rtol=EXACT)


def test_damping_ratio_is_that_of_critical_damping() -> None:
    """m q'' + c q' + k q is critically damped at c = 2 sqrt(k m); at resonance F = c omega_n A."""
    critical = 2 * np.sqrt(M * omega_n**2 * M)
    ratio = damping_ratio(C * omega_n * A, A, M * omega_n**2)
    np.testing.assert_allclose(ratio, C / critical, rtol=EXACT)
    np.testing.assert_allclose(ratio, damping_term(Viscous(C), A, omega_n, M, omega_n) / 2, rtol=EXACT)


@pytest.mark.parametrize(
    ("force", "term"),
    [
        (Viscous(C), 2 * omega / omega_n),
        (Displacement(C), 4 / (pi * omega_n)),  # printed with omega in it (erratum E4III-1)
        (VelocitySquared(C), 16 / 3 * A * omega**2 / (pi * omega_n)),
        (DisplacementVelocity(C), 8 / 3 * A * omega / (pi * omega_n)),
        (case_five(C, alpha), 2 * omega / omega_n * (1 + A**2 * alpha / 4)),
    ],
)
def test_table_4_III(force: Force, term: float) -> None:
    """The normalised coefficient is xi = C/(2 M omega_n), Eq 4.2.6."""
    xi = C / (2 * M * omega_n)
    np.testing.assert_allclose(damping_term(force, A, omega, M, omega_n), xi * term, rtol=EXACT)


@pytest.mark.parametrize(
    ("force", "a_over_C"),
    [
        (Viscous, pi),
        (Displacement, 2.0),
        (VelocitySquared, 8 / 3),
        (DisplacementVelocity, 4 / 3),
        (QuadraticDisplacement, pi / 4),
        (Coulomb, 4.0),
    ],
)
def test_table_5_I(force: type[Force], a_over_C: float) -> None:
    np.testing.assert_allclose(energy_factor(force), a_over_C, rtol=EXACT)
    np.testing.assert_allclose(coefficient_from_energy(force, 5.0), 5.0 / a_over_C, rtol=EXACT)


def test_power_laws_contain_the_cases() -> None:
    pairs = [
        (VelocityPower(C, 1.0), Viscous(C)),
        (VelocityPower(C, 2.0), VelocitySquared(C)),
        (VelocityPower(C, 0.0), Coulomb(C)),
        (DisplacementVelocityPower(C, 0.0), Displacement(C)),
        (DisplacementVelocityPower(C, 1.0), DisplacementVelocity(C)),
    ]
    for power, case in pairs:
        # gamma functions by their logarithms lose two or three digits of sixteen
        np.testing.assert_allclose(power.quadrature(A, omega), case.quadrature(A, omega), rtol=1e-13)


def test_beta_and_B_of_section_4_3() -> None:
    # printed to four digits
    np.testing.assert_allclose(beta(1.859), 1.155, rtol=0, atol=5e-4)
    np.testing.assert_allclose(beta(1.342), 1.064, rtol=0, atol=5e-4)
    # B(p) = pi (p + 2)/4: the ratio of gamma functions whose arguments differ by one (erratum E43-4's proof)
    p = np.linspace(0.0, 3.0, 7)
    np.testing.assert_allclose(B(p), pi * (p + 2) / 4, rtol=1e-13)
    # alpha = beta F/(omega A)^p (4.3.9) and B F/(omega^p A^(p+1)) (4.3.19) are the forces with C = F at resonance
    for exponent in p:
        at_resonance = VelocityPower(beta(exponent) * 19.37 / (omega * A) ** exponent, exponent)
        np.testing.assert_allclose(at_resonance.quadrature(A, omega), 19.37, rtol=1e-13)
        at_resonance_too = DisplacementVelocityPower(
            B(exponent) * 19.37 / (omega**exponent * A ** (exponent + 1)), exponent
        )
        np.testing.assert_allclose(at_resonance_too.quadrature(A, omega), 19.37, rtol=1e-13)


def test_second_mode_coefficient_lost_pi_over_two() -> None:
    """Erratum E43-4: 59.4 of Eq 4.3.24 is 93.3 times 2/pi."""
    corrected = B(0.342) * 27.35 / (17.09**0.342 * 0.3061**1.342)
    np.testing.assert_allclose(corrected, 93.33, rtol=0, atol=0.005)  # the erratum's digits
    np.testing.assert_allclose(corrected * 2 / pi, 59.4, rtol=0, atol=0.05)  # the printed digits


def test_slip_has_no_single_factor() -> None:
    with pytest.raises(AnalysisError, match="no single product of powers"):
        energy_factor(Slip)
    with pytest.raises(AnalysisError, match="no single product of powers"):
        coefficient_from_energy(Slip, 1.0)


def test_power_law_factor_takes_its_exponent() -> None:
    # Eq 4.3.7: 2 Gamma((p+2)/2)/Gamma((p+4)/2) = 4/(p + 2)
    np.testing.assert_allclose(energy_factor(DisplacementVelocityPower, exponent=0.865), 4 / 2.865, rtol=1e-13)
