"""Chapter V: energy polynomials by regression (Tables 5.II, 5.III, 5.IV; Eqs. 5.3.3 to 5.3.17)."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.forces import force_class
from damping.forces.powers import coefficient_from_energy
from damping.regression import parse_term
from damping.regression.design import Columns, Design, design_of
from damping.regression.fit import fit
from damping_reed1970 import Run, Version, by_point, columns, load_table
from damping_reed1970.chapter_2 import CASES

#: Energy terms by the names of the printed results.
TERMS = {
    "A2w": parse_term("A^2*omega"),
    "A3w": parse_term("A^3*omega"),
    "A3w2": parse_term("A^3*omega^2"),
    "A2": parse_term("A^2"),
    "A4w": parse_term("A^4*omega"),
}
EQUATION_5_3_3 = {"A2w": 1.455, "A3w": 0.827, "A3w2": 0.1179, "A2": 0.222, "A4w": 0.0223}
GENERATOR = {"A2w": 1.571, "A3w": 1.067}
EQUATION_5_3_9_E1 = {"A2w": 5.221, "A3w": 5.538}
EQUATION_5_3_9_E2 = {"A2w": 9.942}
EQUATION_5_3_14 = {"A2w": 1.17, "A3w2": 0.604}
EQUATION_5_3_15 = {"A3w2": 0.707}
#: Points that E_4 was fitted to (Eq. 5.3.13).
E4_POINTS = slice(3, 12)

#: Coefficient by term.
Polynomial = dict[str, float]


def polynomial(coefficients: Polynomial, A: FloatArray, omega: FloatArray) -> FloatArray:
    """E(A, omega) = sum_k a_k phi_k(A, omega) (Eq. 5.2.5)."""
    column = {"A": A, "omega": omega}.__getitem__
    result: FloatArray = np.sum([a * TERMS[name].values(column, len(A))[0] for name, a in coefficients.items()], axis=0)
    return result


def energy_design(terms: Iterable[str], A: FloatArray, omega: FloatArray, E: FloatArray) -> Design:
    """The design of an energy polynomial (Eq. 5.2.5); ``terms`` are names of ``TERMS``."""
    data = Columns({"A": A, "omega": omega, "E": E}, np.arange(len(E)), ())
    return design_of(data, "E", [TERMS[name] for name in terms])


def regression(terms: Iterable[str], A: FloatArray, omega: FloatArray, E: FloatArray) -> Polynomial:
    """Coefficients a_k of least squared deviation, no constant (Eq. 5.2.4)."""
    names = tuple(terms)
    fitted = fit(energy_design(names, A, omega, E))
    return dict(zip(names, fitted.coefficients.tolist(), strict=True))


def percent_deviation(E: FloatArray, fitted: FloatArray) -> FloatArray:
    """100 (E - fitted)/E."""
    return 100.0 * (E - fitted) / E


def table_5_ii(table: pd.DataFrame) -> dict[str, float]:
    """Printed polynomial 5.3.3, generator of the check-out data, per cent deviation of the printed columns."""
    A, omega, E = _columns(table, "A_in")
    return {
        **by_point("tab5II.E_eq533", polynomial(EQUATION_5_3_3, A, omega)),
        **by_point("tab5II.E_generator", polynomial(GENERATOR, A, omega)),
        **by_point("tab5II.dev", percent_deviation(E, table["E_eq533_in_lb"].to_numpy())),
    }


def equations_5_3_1_and_5_3_3() -> dict[str, float]:
    """The check-out fits: two terms on data of the generator pi/2, 16/15 to three decimals, five on Table 5.II."""
    A, omega, E = _columns(load_table("5_II", "corrected"), "A_in")
    exact = np.round(polynomial({"A2w": pi / 2, "A3w": 16 / 15}, A, omega), 3)
    return {
        **_named("eq531.a", regression(("A2w", "A3w"), A, omega, exact)),
        **_named("eq533.a", regression(EQUATION_5_3_3, A, omega, E)),
    }


def equation_5_3_9() -> dict[str, float]:
    """E_1 and E_2 on the rough data, printed and recovered inputs."""
    result: dict[str, float] = {}
    versions: dict[str, Version] = {"printed_data": "printed", "recovered": "used"}
    for name, version in versions.items():
        A, omega, E = _columns(load_table("5_III", version), "A2bar_in")
        result |= _named(f"eq539.E1_{name}", regression(EQUATION_5_3_9_E1, A, omega, E))
        result |= _named(f"eq539.E2_{name}", regression(EQUATION_5_3_9_E2, A, omega, E))
    return result


def table_5_iii() -> dict[str, float]:
    """A = X_t/.041 (Eq. 5.3.4), the printed polynomials 5.3.9 and the per cent deviation of the printed columns."""
    table, energies = load_table("5_III"), load_table("3_IV").query("corrected_row == 0")
    A, omega, E = _columns(table, "A2bar_in")
    return {
        **by_point("tab5III.A", load_table("3_I")["tail_pitch_disp_in_e2"] / 100.0 / 0.041),
        **by_point("tab5III.E1", polynomial(EQUATION_5_3_9_E1, A, omega)),
        **by_point("tab5III.E2", polynomial(EQUATION_5_3_9_E2, A, omega)),
        **by_point("tab5III.dev", percent_deviation(E, table["E2_in_lb"].to_numpy())),
        **{f"tab5III.E_vs_3IV[{k}]": float(energies["energy_input_in_lb"].iloc[k - 1]) for k in (4, 9)},
    }


def table_5_iii_recovered() -> dict[str, float]:
    """The fitted columns and deviations that the recovered inputs give."""
    A, omega, E = _columns(load_table("5_III", "used"), "A2bar_in")
    E_1 = polynomial(regression(EQUATION_5_3_9_E1, A, omega, E), A, omega)
    E_2 = polynomial(regression(EQUATION_5_3_9_E2, A, omega, E), A, omega)
    deviation = percent_deviation(E, E_2)
    return {**by_point("tab5III.E1", E_1), **by_point("tab5III.E2", E_2), **by_point("tab5III.dev", deviation)}


def fit_e3(version: Version) -> Polynomial:
    """E_3 (Eq. 5.3.12) on all 15 points."""
    return regression(EQUATION_5_3_14, *_table_5_iv(version, "E3"))


def fit_e4(version: Version) -> Polynomial:
    """E_4 (Eq. 5.3.13) on points 4 to 12."""
    A, omega, E = _table_5_iv(version, "E4")
    return regression(EQUATION_5_3_15, A[E4_POINTS], omega[E4_POINTS], E[E4_POINTS])


def fit_viscous(version: Version) -> float:
    """Viscous coefficient a/pi of A^2 omega on all 15 points (end of section 5.3)."""
    return regression(("A2w",), *_table_5_iv(version, "E4"))["A2w"] / pi


def equations_5_3_14_and_5_3_15() -> dict[str, float]:
    """Coefficients from the printed and the recovered inputs."""
    return {
        **_named("eq5314.E3_printed_data", fit_e3("printed")),
        **_named("eq5314.E3_recovered", fit_e3("used")),
        "eq5315.E4_printed_data": fit_e4("printed")["A3w2"],
        "eq5315.E4_recovered": fit_e4("used")["A3w2"],
        "sec53.viscous_2.39_printed_data": fit_viscous("printed"),
        "sec53.viscous_2.39_recovered": fit_viscous("used"),
    }


def table_5_iv() -> dict[str, float]:
    """The printed polynomials 5.3.14 and 5.3.15 on the printed data, deviation of the printed columns."""
    A, omega, _ = _table_5_iv("printed", "E4")
    return _table_5_iv_results(polynomial(EQUATION_5_3_14, A, omega), polynomial(EQUATION_5_3_15, A, omega), "printed")


def table_5_iv_recovered() -> dict[str, float]:
    """The same from fits to the recovered inputs; deviation of the printed E_4 from the recovered energies."""
    A_3, omega, _ = _table_5_iv("used", "E3")
    A_4 = _table_5_iv("used", "E4")[0]
    return _table_5_iv_results(polynomial(fit_e3("used"), A_3, omega), polynomial(fit_e4("used"), A_4, omega), "used")


def _table_5_iv_results(E_3: FloatArray, E_4: FloatArray, version: Version) -> dict[str, float]:
    deviation = percent_deviation(_table_5_iv(version, "E4")[2], load_table("5_IV")["E4_in_lb"].to_numpy())
    fitted = {f"tab5IV.E4[{k}]": float(E_4[k - 1]) for k in range(4, 13)}
    deviations = {f"tab5IV.dev[{k}]": float(deviation[k - 1]) for k in range(4, 13)}
    return {**by_point("tab5IV.E3", E_3), **fitted, **deviations}


def equations_5_3_10_to_5_3_17(E_1: Polynomial, E_2: Polynomial, E_3: Polynomial, E_4: Polynomial) -> dict[str, float]:
    """Damping coefficients of the fitted polynomials by the conversion factors of Table 5.I."""
    return {
        "eq5310.C1": table_5_i("I", E_1["A2w"]),
        "eq5310.C4": table_5_i("IV", E_1["A3w"]),
        "eq5311.C1": table_5_i("I", E_2["A2w"]),
        "eq5316.C1": table_5_i("I", E_3["A2w"]),
        "eq5316.C3": table_5_i("III", E_3["A3w2"]),
        "eq5317.C3": table_5_i("III", E_4["A3w2"]),
    }


def table_5_i(case: str, a: float) -> float:
    """Damping coefficient of a case from the coefficient of its energy term (Table 5.I)."""
    return float(coefficient_from_energy(force_class(CASES[case]), a))


def computed() -> dict[str, float]:
    """Every result of the chapter, from the tables as printed where the recipe does not say otherwise."""
    return {
        **table_5_ii(load_table("5_II")),
        **equations_5_3_1_and_5_3_3(),
        **equation_5_3_9(),
        **table_5_iii(),
        **equations_5_3_14_and_5_3_15(),
        **table_5_iv(),
        **equations_5_3_10_to_5_3_17(EQUATION_5_3_9_E1, EQUATION_5_3_9_E2, EQUATION_5_3_14, EQUATION_5_3_15),
    }


def after_correction() -> dict[str, float]:
    """Results from the corrected check-out data and from the recovered inputs of Tables 5.III and 5.IV."""
    A, omega, E = _columns(load_table("5_III", "used"), "A2bar_in")
    E_1, E_2 = (regression(terms, A, omega, E) for terms in (EQUATION_5_3_9_E1, EQUATION_5_3_9_E2))
    return {
        **table_5_ii(load_table("5_II", "corrected")),
        **table_5_iii_recovered(),
        **table_5_iv_recovered(),
        **equations_5_3_10_to_5_3_17(E_1, E_2, fit_e3("used"), fit_e4("used")),
    }


def _table_5_iv(version: Version, run: Run) -> tuple[FloatArray, FloatArray, FloatArray]:
    return _columns(load_table("5_IV", version, run), "A2p_in")


def _columns(table: pd.DataFrame, amplitude: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A, omega, E of a table of chapter V."""
    A, omega, E = columns(table, amplitude, "omega_rad_s", "E_in_lb")
    return A, omega, E


def _named(prefix: str, coefficients: Polynomial) -> dict[str, float]:
    """``eq533.a[A2w]`` and so on, one result a term."""
    return {f"{prefix}[{name}]": value for name, value in coefficients.items()}
