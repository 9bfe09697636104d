"""Chapter V: energy polynomials by regression (Tables 5.II, 5.III, 5.IV; Eqs. 5.3.1 to 5.3.17).

Every fit of the report is an ``EnergyFit``, made again from printed, corrected and recovered inputs, side by side.
"""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.forces import coefficient_from_energy, force_class
from damping.regression import parse_term
from damping.regression.design import Columns, Design, design_of
from damping.regression.fit import Fit, fit, tabulate_terms
from damping_reed1970 import Run, Version, by_point, columns, load_table
from damping_reed1970.chapter_2 import CASES

#: What the chapter prints beside its tables.
PRINTED: dict[str, Any] = tomllib.loads(Path(__file__).with_name("printed.toml").read_text("utf-8"))
#: Energy terms by the names of the printed results.
TERMS = {name: parse_term(term) for name, (term, _) in PRINTED["terms"].items()}
#: Case of Table 5.I of each energy term.
TERM_CASES: dict[str, str] = {name: case for name, (_, case) in PRINTED["terms"].items()}
#: What the inputs of a fit may be, by the name in the tables.
INPUT_VERSIONS: dict[str, Version] = {"printed": "printed", "corrected": "corrected", "recovered": "used"}
GENERATOR: dict[str, float] = PRINTED["generator"]  #: the law that made the check-out data, as printed

Polynomial = dict[str, float]  #: coefficient by term
Points = tuple[FloatArray, FloatArray, FloatArray]  #: A, omega, E


def polynomial(coefficients: Polynomial, A: FloatArray, omega: FloatArray) -> FloatArray:
    """E(A, omega) = sum_k a_k phi_k(A, omega) (Eq. 5.2.5)."""
    column = {"A": A, "omega": omega}.__getitem__
    return np.asarray(np.sum([a * TERMS[name].values(column, len(A))[0] for name, a in coefficients.items()], axis=0))


def energy_design(terms: Iterable[str], A: FloatArray, omega: FloatArray, E: FloatArray) -> Design:
    """The design of an energy polynomial without a constant (Eqs. 5.2.4, 5.2.5); ``terms`` as ``A^2*omega``."""
    data = Columns({"A": A, "omega": omega, "E": E}, np.arange(len(E)), ())
    return design_of(data, "E", [parse_term(term) for term in terms])


def load_points(table: str, version: Version, run: Run = "E4") -> Points:
    """A, omega, E of a table of chapter V."""
    amplitude = {"5_II": "A_in", "5_III": "A2bar_in", "5_IV": "A2p_in"}[table]
    A, omega, E = columns(load_table(table, version, run), amplitude, "omega_rad_s", "E_in_lb")
    return A, omega, E


@dataclass(frozen=True)
class EnergyFit:
    """One fit of an energy polynomial as the report made it."""

    name: str
    equation: str
    table: str
    printed: Polynomial  #: coefficients by term, in the report's order
    erratum: str
    forces: Polynomial = field(default_factory=dict)  #: the printed force coefficients (Table 5.I)
    run: Run = "E4"  #: which inputs of Table 5.IV were used
    rows: tuple[int | None, int | None] = (None, None)  #: the points fitted
    fitted: str = ""  #: printed column of fitted energy, where there is one
    percent: str = ""  #: printed column of per cent deviation, where there is one

    def data(self, version: Version) -> Points:
        """A, omega, E of the points fitted."""
        A, omega, E = load_points(self.table, version, self.run)
        rows = slice(*self.rows)
        return A[rows], omega[rows], E[rows]

    def inputs(self) -> dict[str, Points]:
        """Inputs by name; of the check-out data there are none recovered but the generator that made them."""
        inputs = {name: self.data(version) for name, version in INPUT_VERSIONS.items()}
        if self.table == "5_II":
            del inputs["recovered"]
            inputs["generator"] = generate_check_out()
        return inputs

    def fit(self, A: FloatArray, omega: FloatArray, E: FloatArray) -> Fit:
        """Least squares with this fit's terms."""
        return fit(energy_design([TERMS[name].name for name in self.printed], A, omega, E))

    def coefficients(self, version: Version) -> Polynomial:
        """Fitted coefficients by term."""
        return dict(zip(self.printed, self.fit(*self.data(version)).coefficients.tolist(), strict=True))


FITS = {key: EnergyFit(**fields) for key, fields in PRINTED["fits"].items()}
CHECK_OUT_TWO = FITS["check_out_two"]
CHECK_OUT_FIVE = FITS["check_out_five"]
E_1 = FITS["E1"]
E_2 = FITS["E2"]
E_3 = FITS["E3"]
E_4 = FITS["E4"]


def generate_check_out() -> Points:
    """A and omega of the corrected Table 5.II with the energy pi/2 A^2 omega + 16/15 A^3 omega to three decimals.

    The printed generator 1.571, 1.067 rounds pi/2 and 16/15; fitted, this gives 1.5707 and
    1.0668 (printed 1.571, 1.066).
    """
    A, omega, _ = CHECK_OUT_TWO.data("corrected")
    return A, omega, np.round(polynomial({"A2w": pi / 2.0, "A3w": 16.0 / 15.0}, A, omega), 3)


def table_5_ii(version: Version) -> dict[str, float]:
    """Printed polynomial 5.3.3, generator of the check-out data, per cent deviation of the printed columns."""
    A, omega, E = load_points("5_II", version)
    fitted = load_table("5_II", version)["E_eq533_in_lb"].to_numpy()
    return {
        **by_point("tab5II.E_eq533", polynomial(CHECK_OUT_FIVE.printed, A, omega)),
        **by_point("tab5II.E_generator", polynomial(GENERATOR, A, omega)),
        **by_point("tab5II.dev", 100.0 * (E - fitted) / E),
    }


def table_5_iii() -> dict[str, float]:
    """A = X_t/.041 (Eq. 5.3.4), the printed polynomials 5.3.9 and the per cent deviation of the printed columns."""
    energies = load_table("3_IV").query("corrected_row == 0")
    A, omega, E = load_points("5_III", "printed")
    fitted = load_table("5_III")["E2_in_lb"].to_numpy()
    return {
        **by_point("tab5III.A", load_table("3_I")["tail_pitch_disp_in_e2"] / 100.0 / 0.041),
        **by_point("tab5III.E1", polynomial(E_1.printed, A, omega)),
        **by_point("tab5III.E2", polynomial(E_2.printed, A, omega)),
        **by_point("tab5III.dev", 100.0 * (E - fitted) / E),
        **by_point("tab5III.E_vs_3IV", energies["energy_input_in_lb"].iloc[[3, 8]], (4, 9)),
    }


def table_5_iii_recovered() -> dict[str, float]:
    """The fitted columns and deviations that the recovered inputs give."""
    A, omega, E = load_points("5_III", "used")
    E1, E2 = (polynomial(energy_fit.coefficients("used"), A, omega) for energy_fit in (E_1, E_2))
    return by_point("tab5III.E1", E1) | by_point("tab5III.E2", E2) | by_point("tab5III.dev", 100.0 * (E - E2) / E)


def table_5_iv(version: Version) -> dict[str, float]:
    """The printed polynomials 5.3.14 and 5.3.15, or those of fits to recovered inputs; deviation of the printed E_4."""
    E3, E4 = (f.printed if version == "printed" else f.coefficients(version) for f in (E_3, E_4))
    A, omega, E = E_4.data(version)
    deviation = 100.0 * (E - load_table("5_IV")["E4_in_lb"].to_numpy()[slice(*E_4.rows)]) / E
    return {
        **by_point("tab5IV.E3", polynomial(E3, *E_3.data(version)[:2])),
        **by_point("tab5IV.E4", polynomial(E4, A, omega), range(4, 13)),
        **by_point("tab5IV.dev", deviation, range(4, 13)),
    }


def fitted_coefficients() -> dict[str, float]:
    """Coefficients of every fit: of the check-out data, of the rough data and of the principal pitch data."""
    exact = dict(zip(CHECK_OUT_TWO.printed, CHECK_OUT_TWO.fit(*generate_check_out()).coefficients, strict=True))
    results = {"eq531.a": exact, "eq533.a": CHECK_OUT_FIVE.coefficients("corrected")}
    single = {}
    versions: dict[str, Version] = {"printed_data": "printed", "recovered": "used"}
    for name, version in versions.items():
        results |= {f"eq539.{own.name}_{name}": own.coefficients(version) for own in (E_1, E_2)}
        results[f"eq5314.E3_{name}"] = E_3.coefficients(version)
        single[f"eq5315.E4_{name}"] = E_4.coefficients(version)["A3w2"]
        single[f"sec53.viscous_2.39_{name}"] = FITS["viscous"].coefficients(version)["A2w"] / pi
    return single | {f"{name}[{term}]": float(a) for name, terms in results.items() for term, a in terms.items()}


def equations_5_3_10_to_5_3_17(version: Version) -> dict[str, float]:
    """Damping coefficients of the printed or fitted polynomials by the conversion factors of Table 5.I."""
    results, numbers = {}, {"I": 1, "III": 3, "IV": 4}
    for equation, energy_fit in {"eq5310": E_1, "eq5311": E_2, "eq5316": E_3, "eq5317": E_4}.items():
        terms = energy_fit.printed if version == "printed" else energy_fit.coefficients(version)
        for case, a in ((TERM_CASES[term], a) for term, a in terms.items()):
            results[f"{equation}.C{numbers[case]}"] = table_5_i(case, a)
    return results


def table_5_i(case: str, a: float) -> float:
    """Damping coefficient of a case from the coefficient of its energy term (Table 5.I)."""
    return float(coefficient_from_energy(force_class(CASES[case]), a))


def computed() -> dict[str, float]:
    """Every result of the chapter, from the tables as printed where the recipe does not say otherwise."""
    tables = table_5_ii("printed") | table_5_iii() | table_5_iv("printed")
    return tables | fitted_coefficients() | equations_5_3_10_to_5_3_17("printed")


def after_correction() -> dict[str, float]:
    """Results from the corrected check-out data and from the recovered inputs of Tables 5.III and 5.IV."""
    return table_5_ii("corrected") | table_5_iii_recovered() | table_5_iv("used") | equations_5_3_10_to_5_3_17("used")


def tabulate_regressions() -> pd.DataFrame:
    """One row per fit, inputs and term.

    Coefficients belong to energy in in-lb with A in inches and omega in rad/s; ``force_coefficient`` is that of the
    damping force of the term (Table 5.I; lb, in, s). ``cells_changed``: input cells that differ from the print.
    ``printed``, ``printed_force``: as printed, NaN where the report prints none.
    """
    parts = []
    for energy_fit in FITS.values():
        printed = np.concatenate(energy_fit.data("printed"))
        for inputs, data in energy_fit.inputs().items():
            changed = int(np.sum(np.concatenate(data) != printed))
            parts.append(_tabulate_fit(energy_fit, inputs, changed, energy_fit.fit(*data)))
    return pd.concat(parts, ignore_index=True)


def _tabulate_fit(energy_fit: EnergyFit, inputs: str, changed: int, fitted: Fit) -> pd.DataFrame:
    terms = list(energy_fit.printed)
    cases = [TERM_CASES[term] for term in terms]
    return pd.DataFrame(
        {
            "fit": energy_fit.name,
            "equation": energy_fit.equation,
            "inputs": inputs,
            "cells_changed": changed,
            "points": fitted.n,
            "term": [TERMS[term].name for term in terms],
            **tabulate_terms(fitted)[["coefficient", "std_error", "t_ratio"]].to_dict("list"),
            "printed": list(energy_fit.printed.values()),
            "force": [CASES[case] for case in cases],
            "force_coefficient": [table_5_i(case, a) for case, a in zip(cases, fitted.coefficients, strict=True)],
            "printed_force": [energy_fit.forces.get(term, np.nan) for term in terms],
            "r_squared_without_constant": fitted.r_squared,
            "rms_error_in_lb": fitted.rms_error,
            "average_absolute_percent": fitted.average_absolute_percent,
            "largest_absolute_percent": fitted.largest_absolute_percent,
            "condition_number": fitted.condition_number,
            "erratum": energy_fit.erratum,
        }
    )


def tabulate_regression_deviations() -> pd.DataFrame:
    """Per cent deviations 100 (E - fitted)/E of Tables 5.II, 5.III and 5.IV beside ours, one row per fit and point.

    ``*_printed`` are the table's own columns (NaN where it has none), ``*_from_X_inputs`` those of our fit to the
    inputs X, of the fit's own points.
    """
    parts = []
    for energy_fit in (own for own in FITS.values() if own.fitted):
        table = load_table(energy_fit.table)[slice(*energy_fit.rows)]
        A, omega, E = energy_fit.data("printed")
        part = pd.DataFrame({"fit": energy_fit.name, "table": energy_fit.table.replace("_", ".")}, index=table.index)
        part["point"] = table["row" if "row" in table else "point"]
        part = part.assign(omega_rad_s=omega, A_printed_in=A, E_printed_in_lb=E)
        part["fitted_printed_in_lb"] = table[energy_fit.fitted]
        part["percent_printed"] = table[energy_fit.percent] if energy_fit.percent else np.nan
        for inputs, data in energy_fit.inputs().items():
            if inputs != "generator":
                fitted = energy_fit.fit(*data)
                part[f"fitted_from_{inputs}_inputs_in_lb"] = fitted.fitted
                part[f"percent_from_{inputs}_inputs"] = fitted.percent
        parts.append(part)
    return pd.concat(parts, ignore_index=True)
