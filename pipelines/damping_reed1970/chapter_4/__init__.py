"""Chapter IV: nonlinear damping of Configuration II from its three sweeps (Tables 4.I to 4.V, section 4.3)."""

import tomllib
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, FloatArray, Floats
from damping.forces import case_five, make
from damping.forces.contract import Force
from damping.forces.powers import B, beta
from damping.predict.steady import resonant_amplitude
from damping.regression.fit import fit_power_law
from damping_reed1970 import Version, by_point, columns, load_table
from damping_reed1970.chapter_2 import CASES

#: What the chapter prints beside its tables.
PRINTED: dict[str, Any] = tomllib.loads(Path(__file__).with_name("printed.toml").read_text("utf-8"))
#: Sweep C of the first mode with omega_n in rad/s.
SWEEP_C: dict[str, float] = PRINTED["sweep_C"] | {"omega_n": RAD_S_PER_HZ * PRINTED["sweep_C"]["f_n"]}
F_EXAMPLE: float = PRINTED["example"]["force"]  #: force of the extrapolation example of section 4.3, lb


def tabulate_sweeps(version: Version = "printed") -> pd.DataFrame:
    """Tables 4.I and 4.II side by side; ``label`` is mode and sweep (1A), ``omega_n`` in rad/s.

    Corrected: the one wrong modal force (2A, erratum E4I-1) is the product phi_r F of its own row.
    """
    table = load_table("4_I").merge(load_table("4_II"), on=["mode", "sweep"], validate="1:1")
    if version == "corrected":
        wrong = load_table("4_I", "corrected")["modal_force_lb"] != table["modal_force_lb"]
        table["modal_force_lb"] = table["modal_force_lb"].mask(wrong, table["phi_r_load_point"] * table["force_lb"])
    return table.assign(
        label=table["mode"].astype(str) + table["sweep"], omega_n=RAD_S_PER_HZ * table["modal_frequency_hz"]
    )


def table_4_i_ii(table: pd.DataFrame) -> dict[str, float]:
    """F_e = phi_r F, C_1 = 2 M omega_n xi_1 (Eq. 4.1.3), A_m (4.1.5), energy pi A_m^2 omega_n C_1."""
    M, omega_n, xi = columns(table, "generalized_mass_lb_s2_per_in", "omega_n", "average_damping_xi")
    phi_r, F, F_e = columns(table, "phi_r_load_point", "force_lb", "modal_force_lb")
    A_m, C_1 = columns(table, "Am_in", "C1_lb_s_per_in")
    return {
        **by_point("tab4I.Fe", phi_r * F, list(table["label"])),
        **by_point("tab4II.C1", 2.0 * M * omega_n * xi, list(table["label"])),
        **by_point("tab4II.Am", F_e / (2.0 * M * omega_n**2 * xi), list(table["label"])),
        **by_point("tab4II.E", pi * A_m**2 * omega_n * C_1, list(table["label"])),
    }


def equations_4_1_8_to_4_1_15() -> dict[str, float]:
    """Mean C_1 (4.1.8), the line C_1 = C_01 + C_11 A_m (4.1.10), case IV coefficient 3 pi C_11/4 (4.1.13)."""
    result: dict[str, float] = {}
    for mode, (_, C_11) in ((row["mode"], row["line"]) for row in PRINTED["lines"] if row["power"] == 1):
        A_m, C_1 = columns(load_table("4_II").query("mode == @mode"), "Am_in", "C1_lb_s_per_in")
        result[f"eq418.C1_mode{mode}"] = float(C_1.mean())
        result[f"eq4110.slope_mode{mode}"] = float((np.diff(C_1) / np.diff(A_m)).mean())
        result[f"eq4110.intercept_mode{mode}"] = float(C_1[1] - C_11 * A_m[1])
        result[f"eq4113.C4_mode{mode}"] = 0.75 * pi * C_11
    return result


def build_case(case: str, coefficient: float = 1.0, alpha: float = 1.0) -> Force:
    """The damping force of a case of Table 2.I (case V: coefficient (1 + alpha Q^2))."""
    return case_five(coefficient, alpha) if case == "V" else make(CASES[case], coefficient=coefficient)


def table_4_v() -> dict[str, float]:
    """Coefficients of each sweep and their largest variation, from the corrected Table 4.V.

    xi_i = C_i/(2 M omega_n) of a case with the resonant amplitude A_m under F_e (Eq. 4.2.7; case V: xi_1, E427).
    """
    table = load_table("4_V", "corrected").set_index("parameter")
    result = {}
    for case, parameter in zip(CASES, ("xi_1", "xi_2", "xi_3", "xi_4", "xi_5_alpha_1"), strict=True):
        for sweep in "ABC":
            M, F_e, f_n, A_m = table[f"sweep_{sweep}"].iloc[:4]
            omega_n = RAD_S_PER_HZ * f_n
            xi = F_e / build_case(case).quadrature(A_m, omega_n) / (2.0 * M * omega_n)
            result[f"tab4V.{parameter}[{sweep}]"] = float(xi)
        xi_a, xi_c = float(table["sweep_A"][parameter]), float(table["sweep_C"][parameter])
        result[f"tab4V.maxvar[{parameter}]"] = 100.0 * (xi_a - xi_c) / xi_c
    return result


def table_4_iv() -> dict[str, float]:
    """Amplitudes that the coefficients of sweep C predict for A and B (Eq. 4.2.7), and the printed per cent errors."""
    result = {}
    for row in load_table("4_IV", "corrected").to_dict("records"):
        key, omega_n = f"{row['sweep']}-{row['case']}", RAD_S_PER_HZ * row["natural_frequency_hz"]
        coefficient = 2.0 * row["M_lb_s2_per_in"] * omega_n * row["zeta_from_sweep_C"]
        A = float(resonant_amplitude(build_case(row["case"]), row["Fe_lb"] / coefficient, omega_n))
        result[f"tab4IV.Am_pred[{key}]"] = A
        result[f"tab4IV.pct[{key}]"] = 100.0 * (row["Am_predicted_in"] - row["Am_in"]) / row["Am_in"]
    return result


def equation_4_2_11() -> dict[str, float]:
    """c_1 = 2 xi_1 M omega_n of case V, sweep C, with the values of Table 4.V (erratum E4-1)."""
    table = load_table("4_V", "corrected").set_index("parameter")["sweep_C"]
    omega_n = RAD_S_PER_HZ * table["natural_frequency_hz"]
    return {"eq4211.c1": float(2.0 * table["xi_5_alpha_1"] * table["M_lb_s2_per_in"] * omega_n)}


def section_4_2() -> dict[str, float]:
    """Distance of the undamped curve, delta of case I at A = 1.01, largest error at A = A_m/2 (Eqs. 4.2.4, 4.2.9)."""
    c, A, xi_1 = SWEEP_C, PRINTED["curves"]["A"], 0.00166541
    undamped = c["F_e"] / (c["M"] * c["omega_n"] ** 2 * A)
    return {
        "sec42.undamped_dist": undamped,
        "sec42.delta_caseI": undamped - sqrt(undamped**2 - 4.0 * xi_1**2),
        "sec42.max_error_half_Am": 100.0 * (1.0 - sqrt(1.0 - 0.5**2)),
    }


def equation_4_3_9(F_e: Floats, A_m: Floats, omega_n: float, p: float) -> Floats:
    """alpha = beta(p) F_e/(omega_n^p A_m^p)."""
    return np.asarray(beta(p) * F_e / (omega_n**p * A_m**p))


def equation_4_3_19(F_e: Floats, A_m: Floats, omega_n: float, p: float) -> Floats:
    """alpha = B(p) F_e/(omega_n^p A_m^(p+1)) (erratum E43-4: the report dropped pi/2 of B for mode 2)."""
    return np.asarray(B(p) * F_e / (omega_n**p * A_m ** (p + 1.0)))


def section_4_3(version: Version = "printed") -> dict[str, float]:
    """Exponents, coefficients and the extrapolation to 90 lb."""
    result = {}
    for mode, law in enumerate(PRINTED["power_laws"], start=1):
        F, A, omega = resonances(mode, version)
        result[f"eq43{11 + 2 * mode}.p_mode{mode}"] = fit_power_law(F, A, omega).p
        result[f"eq43{12 + 2 * mode}.beta_mode{mode}"] = float(beta(law["p"]))
        result[f"eq43{12 + 2 * mode}.alpha_mode{mode}"] = float(np.mean(equation_4_3_9(F, A, law["omega"], law["p"])))
        with_displacement = equation_4_3_19(F[0], A[0], law["omega"], law["p_with_displacement"])
        result[f"eq43{20 + mode}.alpha_mode{mode}"] = float(with_displacement)
        result[f"sec43.wn_mode{mode}"] = float(omega.mean())
    F, A, omega = resonances(1, version)
    return result | {
        "sec43.A90_linear": float(A[2] * F_EXAMPLE / F[2]),
        "sec43.A90_power": float(fit_power_law(F, A, omega).amplitude(F_EXAMPLE)),
        "sec43.A90_power_p1859": float(A[2] * (F_EXAMPLE / F[2]) ** (1.0 / PRINTED["power_laws"][0]["p"])),
        "sec43.pct67": 100.0 * (PRINTED["example"]["linear"] / PRINTED["example"]["power"] - 1.0),
    }


def computed() -> dict[str, float]:
    """Every result of the chapter, from the tables as printed where the recipe does not say otherwise."""
    return {
        **table_4_i_ii(tabulate_sweeps()),
        **equations_4_1_8_to_4_1_15(),
        **table_4_v(),
        **table_4_iv(),
        **equation_4_2_11(),
        **section_4_2(),
        **section_4_3(),
    }


def after_correction() -> dict[str, float]:
    """Results that the corrected modal force of mode 2, sweep A changes (erratum E4I-1)."""
    return {**table_4_i_ii(tabulate_sweeps("corrected")), **section_4_3("corrected")}


def resonances(mode: int, version: Version) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Modal force F_e, resonant amplitude A_m and omega_n of the sweeps A, B, C of a mode (Eq. 4.3.12)."""
    table = load_table("4_I", version).merge(load_table("4_II"), on=["mode", "sweep"]).query("mode == @mode")
    F_e, A_m, f_n = columns(table, "modal_force_lb", "Am_in", "modal_frequency_hz")
    return F_e, A_m, RAD_S_PER_HZ * f_n
