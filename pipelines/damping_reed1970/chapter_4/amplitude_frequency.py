"""Damped against undamped response curves (section 4.2, Figs 4.3 to 4.9).

At an amplitude A the undamped curve lies at the distance u = F/(M omega_n^2 A) from the backbone eta^2 = 1, the damped
one at sqrt(u^2 - G^2) (Eq 4.2.4). The horizontal difference of the two is delta, their vertical difference at the
damped curve's frequency epsilon. Sides: -1 below resonance, +1 above. For pure damping (no in-phase part). NaN where
the curve has no point of that amplitude: above the resonant one, and below resonance under the static one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Literal

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, Floats
from damping.forces import case_five, make
from damping.forces.contract import Force
from damping.forces.powers import damping_term
from damping.predict.steady import phase_lag
from damping_reed1970.chapter_2 import CASES
from damping_reed1970.chapter_4 import SWEEP_C

Side = Literal[-1, 1]


def undamped_distance(A: Floats, F: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """u = F/(M omega_n^2 A), the distance |1 - eta^2| of the undamped curve from the backbone (Eqs 4.2.8, 4.2.9)."""
    return np.asarray(F / (M * omega_n**2 * A))


def damped_distance(force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: Side = -1) -> FloatArray:
    """|1 - eta^2| of the damped curve at the amplitude A: sqrt(u^2 - G(A, omega)^2), omega that of the curve itself.

    The report takes G at omega_n; the two differ by the relative width of the resonance. NaN above the resonance.
    """
    u = undamped_distance(A, F, M, omega_n)
    distance = np.zeros(np.shape(u))
    with np.errstate(invalid="ignore"):
        for _ in range(50):  # G changes by a small share of itself over the curve: each turn adds digits
            omega = omega_n * np.sqrt(1.0 + side * distance)
            previous, distance = distance, np.sqrt(u**2 - damping_term(force, A, omega, M, omega_n) ** 2)
            if not np.any(np.abs(distance - previous) > 1e-15):
                break
    return np.asarray(distance)


def horizontal_difference(
    force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: Side = -1
) -> FloatArray:
    """Delta = u - |1 - eta^2| of the damped curve at the amplitude A (Figs 4.3, 4.7)."""
    return undamped_distance(A, F, M, omega_n) - damped_distance(force, A, F, M, omega_n, side)


def vertical_difference(force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: Side = -1) -> FloatArray:
    """Epsilon: undamped amplitude less A at the frequency where the damped curve has the amplitude A (Figs 4.3, 4.8).

    It grows without bound towards the resonance, where the undamped amplitude is infinite.
    """
    with np.errstate(divide="ignore"):
        return F / (M * omega_n**2 * damped_distance(force, A, F, M, omega_n, side)) - A


def percent_error_undamped(
    force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: Side = -1
) -> FloatArray:
    """100 delta/u, the error of Eq 4.2.9, which neglects damping, at the amplitude A (Fig 4.9).

    For case I, 100 (1 - sqrt(1 - (A/A_m)^2)) but for the frequency in G: 13.4 % at half the resonant amplitude.
    """
    return 100.0 * horizontal_difference(force, A, F, M, omega_n, side) / undamped_distance(A, F, M, omega_n)


#: Amplitudes of a curve, in units of the resonant one: dense towards resonance, where the curve turns.
RATIOS = 1.0 - np.linspace(0.95, 0.0, 300) ** 1.5
#: Printed in section 4.2: delta of case I and distance of the undamped curve at A = 1.01 (erratum E4-8), largest error
#: at half the resonant amplitude, and the band of frequency ratio squared in which damping is significant.
PRINTED = {"A": 1.01, "delta": 0.001209, "distance": 0.005404, "percent_at_half": 14.0, "eta_squared": 0.992}


@dataclass(frozen=True)
class CaseCurve:
    """The response of one case; arrays (points,) over ``amplitude``, two of them below and above resonance.

    ``eta_squared`` and ``phase`` (rad) are (2, points), below resonance first (NaN under the static amplitude).
    ``delta``, ``epsilon``, ``percent``: horizontal and vertical difference from the undamped curve and its error, below
    resonance.
    """

    name: str
    force: Force
    amplitude: FloatArray
    eta_squared: FloatArray
    phase: FloatArray
    delta: FloatArray
    epsilon: FloatArray
    percent: FloatArray


@dataclass(frozen=True)
class AmplitudeFrequency:
    """All cases with one resonant amplitude ``A_m`` under the modal force ``F``.

    ``undamped``: eta^2 (2, points) of the undamped curve over ``amplitude``. ``widths``: case, width in eta^2 at shares
    of the resonant amplitude, error of neglecting damping there.
    """

    M: float
    omega_n: float
    F: float
    A_m: float
    curves: tuple[CaseCurve, ...]
    amplitude: FloatArray
    undamped: FloatArray
    widths: pd.DataFrame

    def curve(self, name: str) -> CaseCurve:
        """The curve of a case."""
        return next(curve for curve in self.curves if curve.name == name)


def case_force(case: str, M: float, omega_n: float, F: float, A_m: float, alpha: float = 0.0) -> Force:
    """The force of a case of Table 2.I with the resonant amplitude A_m under F (Eq. 4.2.7); V with ``alpha``."""
    unit = case_five(1.0, alpha) if case == "V" else make(CASES[case], coefficient=1.0)
    coefficient = F / float(unit.quadrature(A_m, omega_n))
    return case_five(coefficient, alpha) if case == "V" else make(CASES[case], coefficient=coefficient)


def amplitude_frequency(
    M: float = SWEEP_C["M"],
    omega_n: float = SWEEP_C["omega_n"],
    F: float = SWEEP_C["F_e"],
    A_m: float = SWEEP_C["A_m"],
    alphas: Sequence[float] = (1.0, 100.0),
) -> AmplitudeFrequency:
    """Curves of the cases I to IV and of V with each alpha; by default of the first mode of Configuration II, sweep C.

    Args:
        M: mass. omega_n: rad/s. F: modal force. A_m: resonant amplitude. alphas: of case V, 1/length^2.
    """
    forces = {f"case {case}": case_force(case, M, omega_n, F, A_m) for case in ("I", "II", "III", "IV")}
    forces |= {f"case V, α = {alpha:g}": case_force("V", M, omega_n, F, A_m, alpha) for alpha in alphas}
    A = A_m * RATIOS
    curves = tuple(_curve(name, force, A, M, omega_n, F) for name, force in forces.items())
    distance = F / (M * omega_n**2 * A)
    return AmplitudeFrequency(
        M=M,
        omega_n=omega_n,
        F=F,
        A_m=A_m,
        curves=curves,
        amplitude=A,
        undamped=np.stack([1.0 - distance, 1.0 + distance]),
        widths=_tabulate_widths(forces, M, omega_n, F, A_m),
    )


def _curve(name: str, force: Force, A: FloatArray, M: float, omega_n: float, F: float) -> CaseCurve:
    at_peak = np.isclose(A, A[-1], rtol=1e-3)  # where rounding, or the frequency in G, ends one side just below it
    sides = (damped_distance(force, A, F, M, omega_n, side) for side in (-1, 1))
    below, above = (np.where(at_peak & np.isnan(distance), 0.0, distance) for distance in sides)
    eta_squared = np.stack([np.where(below < 1.0, 1.0 - below, np.nan), 1.0 + above])
    with np.errstate(divide="ignore"):
        epsilon = vertical_difference(force, A, F, M, omega_n)
    return CaseCurve(
        name=name,
        force=force,
        amplitude=A,
        eta_squared=eta_squared,
        phase=phase_lag(force, A, omega_n * np.sqrt(eta_squared), M, omega_n),
        delta=F / (M * omega_n**2 * A) - below,
        epsilon=epsilon,
        percent=100.0 * (1.0 - below * M * omega_n**2 * A / F),
    )


def _tabulate_widths(forces: dict[str, Force], M: float, omega_n: float, F: float, A_m: float) -> pd.DataFrame:
    rows = []
    for name, force in forces.items():
        for share in (0.5, 0.9):
            A = share * A_m
            width = sum(float(damped_distance(force, A, F, M, omega_n, side)) for side in (-1, 1))
            error = float(percent_error_undamped(force, A, F, M, omega_n))
            rows.append(
                {
                    "case": name,
                    "amplitude_over_resonant": share,
                    "width_eta_squared": width,
                    "percent_error_undamped": error,
                }
            )
    return pd.DataFrame(rows)


def section_4_2_points(result: AmplitudeFrequency) -> pd.DataFrame:
    """What section 4.2 prints of its curves (case I) beside ours, with G at the curve's own frequency and at omega_n.

    Args:
        result: of the sweep that the section is about, the default of `amplitude_frequency`.
    """
    M, omega_n, F, A_m, viscous = result.M, result.omega_n, result.F, result.A_m, result.curve("case I").force
    A, edge = PRINTED["A"], F / (M * omega_n**2 * (1.0 - PRINTED["eta_squared"]))
    delta, half, at_edge = (float(horizontal_difference(viscous, a, F, M, omega_n)) for a in (A, 0.5 * A_m, edge))
    G = float(damping_term(viscous, A, omega_n, M, omega_n))
    u, u_half, u_edge = (F / (M * omega_n**2 * a) for a in (A, 0.5 * A_m, edge))
    names = (
        "delta at A = 1.01 in",
        "distance of the undamped curve at A = 1.01 in",
        "per cent error at half the resonant amplitude",
        "per cent error at eta^2 = 0.992",
    )
    return pd.DataFrame(
        {
            "quantity": names,
            "printed": [PRINTED["delta"], PRINTED["distance"], PRINTED["percent_at_half"], np.nan],
            "computed": [delta, u, 100.0 * half / u_half, 100.0 * at_edge / u_edge],
            "computed_with_G_at_omega_n": [_delta(u, G), u, *(100.0 * _delta(v, G) / v for v in (u_half, u_edge))],
            "erratum": ["E4-8", "E4-8", "", ""],
        }
    )


def _delta(u: float, G: float) -> float:
    """Delta = u - sqrt(u^2 - G^2) (Eqs. 4.2.4, 4.2.8)."""
    return u - sqrt(u**2 - G**2)
