"""Chapter II: energy factors (Table 2.II), hysteresis loops, slip and its velocity-squared equivalent (section 2.4).

The report integrates the slip loop of Fig. 2.5 to A^2 (K - K1) - A1^2 (K - K1) (Eq 2.4.3). The parallelogram has the
area 4 (K - K1) A1 (A - A1); the printed energy is (A + A1)/(4 A1) times that, equal only at A = 3 A1 (erratum E243).
The bars over A and K in Eq 2.4.4 stand for A and K (erratum E244).
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, Floats
from damping.forces import CATALOGUE, case_five, energy_factor, energy_per_cycle, force_class, make
from damping.forces.contract import Force, Sum
from damping.forces.joints import Slip
from damping.forces.powers import VelocitySquared

#: The force whose energy term each case of Table 2.I adds (case V: its second term, C5 Q^2 Q').
CASES = {
    "I": "viscous",
    "II": "displacement",
    "III": "velocity-squared",
    "IV": "displacement-velocity",
    "V": "quadratic-displacement",
}


def table_2_ii() -> dict[str, float]:
    """Energy loss per cycle over C A^m omega^n: pi, 2, 8/3, 4/3, pi/4."""
    return {f"tab2II.energy_factor[{case}]": float(energy_factor(force_class(name))) for case, name in CASES.items()}


@dataclass(frozen=True)
class Loop:
    """One closed loop: displacement ``q`` and ``force``, both of shape (points,), the last point equal to the first."""

    q: FloatArray
    force: FloatArray

    @property
    def area(self) -> float:
        """Enclosed area, the energy loss per cycle, by the trapezoidal rule (exact for polygons with their corners)."""
        return float(np.sum(0.5 * (self.force[1:] + self.force[:-1]) * np.diff(self.q)))


def loop(force: Force, A: float, omega: float, stiffness: float = 0.0, points: int = 1441) -> Loop:
    """The loop of ``force`` plus a spring ``stiffness`` q over the cycle q = A sin(theta).

    A slip joint is given relative to its stuck state, so the stiffness of that state, K, draws Fig. 2.4c.
    """
    theta = np.linspace(0.0, 2.0 * np.pi, points)
    q = A * np.sin(theta)
    return Loop(q=q, force=stiffness * q + np.asarray(force.cycle(theta, A, omega)))


def printed_energy(slip: Slip, A: Floats) -> Floats:
    """(K - K1)(A^2 - A1^2) for A > A1, zero below: Eq 2.4.3 as printed (erratum E243)."""
    slipping = np.maximum(A, slip.limit)
    return slip.stiffness * (slipping**2 - slip.limit**2)


def exact_energy(slip: Slip, A: Floats) -> Floats:
    """4 (K - K1) A1 (A - A1) for A > A1, zero below: the area of the slip loop."""
    return 4.0 * slip.stiffness * slip.limit * (np.maximum(A, slip.limit) - slip.limit)


def equivalent_coefficient(energy: Floats, A: Floats) -> Floats:
    """C3 omega^2 = 3 E/(8 A^3), C3 of the velocity-squared force that loses the energy E per cycle at A.

    With E as printed it is Eq 2.4.4 as printed, 3 (A^2 - A1^2)(K - K1)/(8 A^3) (erratum E243), with the exact one
    3 A1 (A - A1)(K - K1)/(2 A^3).
    """
    return 3.0 * energy / (8.0 * A**3)


def equivalence_error(slip: Slip, amplitude: FloatArray, reference: float) -> pd.DataFrame:
    """Error of a velocity-squared force fitted to slip at ``reference``, at each ``amplitude``, all above A1.

    ``coefficient_percent``: Eq 2.4.4 as printed against corrected, at each amplitude. ``printed_percent``,
    ``corrected_percent``: energy of the force with C3 fixed at the reference, printed or corrected, against the exact
    energy of the joint. ``shape_percent``: with equal energy, root mean square over the cycle of the difference between
    the joint's force about its mean slope (K less what slip lost, S/A) and C3 q'^2 sgn q', over that of the former. The
    frequency cancels: C3 omega^2 is what the equivalence fixes (section 2.4).
    """
    A = np.asarray(amplitude, dtype=float)
    exact = np.asarray(exact_energy(slip, A))
    growth = (8.0 / 3.0) * A**3 / exact
    fixed = [equivalent_coefficient(energy(slip, reference), reference) for energy in (printed_energy, exact_energy)]
    theta = np.linspace(0.0, 2.0 * np.pi, CYCLE_POINTS, endpoint=False) + np.pi / CYCLE_POINTS
    rows = A[..., np.newaxis]
    about_mean_slope = slip.cycle(theta, rows, 1.0) - slip.in_phase(rows, 1.0) * np.sin(theta)
    equivalent = VelocitySquared(equivalent_coefficient(exact[..., np.newaxis], rows)).cycle(theta, rows, 1.0)
    residual = np.mean((about_mean_slope - equivalent) ** 2, axis=-1)
    return pd.DataFrame(
        {
            "amplitude": A,
            "coefficient_percent": 100.0 * (printed_energy(slip, A) / exact - 1.0),
            "printed_percent": 100.0 * (fixed[0] * growth - 1.0),
            "corrected_percent": 100.0 * (fixed[1] * growth - 1.0),
            "shape_percent": 100.0 * np.sqrt(residual / np.mean(np.asarray(about_mean_slope) ** 2, axis=-1)),
        }
    )


CYCLE_POINTS = 2880  #: points of a cycle over which shapes of loops are compared
LOSS = 1.5  #: energy loss of every loop drawn, over the largest energy of the spring, K A^2/2
#: Stiffness that slip loses, of K = 1: K1 = K/4 as in Fig. 2.4c.
SLIP_STIFFNESS = 0.75
#: Amplitude at which slip starts, of a motion of 1: twice as far as it sticks, as in Fig. 2.4c.
SLIP_LIMIT = 0.5
#: Amplitude in units of A1 at which the equivalence is fixed: where the printed energy is still near the exact one.
REFERENCE = 2.0
FARTHEST = 6.0  #: amplitude in units of A1 up to which the equivalence is followed: three times that
#: Forces of the catalogue that no chapter of the report has.
LATER = {"dahl"}
#: Exponents that no case of Table 2.I has, to draw the power laws with.
EXPONENTS = {"velocity-power": 0.5, "displacement-velocity-power": 1.5}


@dataclass(frozen=True)
class HysteresisLoops:
    """Loops over one cycle of amplitude 1 and frequency 1 about a spring of stiffness 1."""

    loops: dict[str, Loop]  #: by the force's name
    #: force, polygon area of the loop, energy per cycle in closed form, relative difference of the two
    areas: pd.DataFrame


@dataclass(frozen=True)
class SlipEquivalent:
    """Slip and its velocity-squared equivalent (Fig. 2.5), stuck stiffness K = 1, limit A1 = 1.

    Loops are at the amplitude ``REFERENCE``.
    """

    slip: Loop  #: loop of the joint
    printed: Loop  #: of C3 q'^2 sgn q' by Eq. 2.4.4 as printed, about the joint's mean slope
    corrected: Loop  #: of C3 q'^2 sgn q' by Eq. 2.4.4 corrected, about the joint's mean slope
    error: pd.DataFrame  #: against amplitude, C3 fixed at the reference
    energies: pd.DataFrame  #: amplitude over A1, exact energy, as printed (2.4.3), by each fixed C3; in units of K A1^2


def hysteresis_loops() -> HysteresisLoops:
    """One loop of every force here, all of one energy per cycle except slip's, which its stiffness and limit give."""
    forces = {name: _scaled(name) for name in CATALOGUE if name not in LATER}
    fifth = case_five(1.0, 4.0)  # scaled to the same loss
    factor = 0.5 * LOSS / float(energy_per_cycle(fifth, 1.0, 1.0))
    forces["case V"] = Sum(tuple(make(part.name, coefficient=factor * part.coefficient) for part in fifth.forces))  # type: ignore[attr-defined]  # both parts of case V have one
    loops = {name: loop(force, 1.0, 1.0, stiffness=1.0) for name, force in forces.items()}
    closed = np.array([float(energy_per_cycle(force, 1.0, 1.0)) for force in forces.values()])
    areas = np.array([closed_loop.area for closed_loop in loops.values()])
    table = pd.DataFrame({"force": list(loops), "area": areas, "energy_per_cycle": closed})
    return HysteresisLoops(loops, table.assign(relative_difference=areas / closed - 1.0))


def slip_equivalent() -> SlipEquivalent:
    """The slip joint that loses ``SLIP_STIFFNESS`` (of K = 1) beyond A1 = 1 against the velocity-squared force."""
    slip, A, reference = Slip(SLIP_STIFFNESS, 1.0), np.geomspace(1.02, FARTHEST, 300), REFERENCE
    energies_there = (printed_energy(slip, reference), exact_energy(slip, reference))
    printed, corrected = (VelocitySquared(float(equivalent_coefficient(E, reference))) for E in energies_there)
    mean_slope = 1.0 + float(slip.in_phase(reference, 1.0)) / reference
    energies = pd.DataFrame(
        {
            "amplitude": A,
            "exact": exact_energy(slip, A),
            "printed": printed_energy(slip, A),
            "printed_equivalent": energy_per_cycle(printed, A, 1.0),
            "corrected_equivalent": energy_per_cycle(corrected, A, 1.0),
        }
    )
    return SlipEquivalent(
        slip=loop(slip, reference, 1.0, stiffness=1.0),
        printed=loop(printed, reference, 1.0, stiffness=mean_slope),
        corrected=loop(corrected, reference, 1.0, stiffness=mean_slope),
        error=equivalence_error(slip, A, reference),
        energies=energies,
    )


def equal_amplitudes(energies: pd.DataFrame, column: str) -> FloatArray:
    """Amplitudes over A1 at which an energy of ``SlipEquivalent.energies`` is the exact one, in rising order.

    The printed energy is right at one (3 A1, erratum E243). The cube of a fixed C3 meets the straight line of the joint
    at two, or touches it at 1.5 A1.
    """
    A = energies["amplitude"].to_numpy(float)
    off = (energies[column] - energies["exact"]).to_numpy(float)
    left = np.flatnonzero(np.diff(np.sign(off)) != 0.0)
    return np.asarray(A[left] - off[left] * (A[left + 1] - A[left]) / (off[left + 1] - off[left]))


def _scaled(name: str) -> Force:
    """A force of the catalogue with the energy per cycle that is drawn (slip: as it comes)."""
    if name == "slip":
        return Slip(SLIP_STIFFNESS, SLIP_LIMIT)
    shapes = {"exponent": EXPONENTS[name]} if name in EXPONENTS else {}
    energy = float(energy_per_cycle(make(name, coefficient=1.0, **shapes), 1.0, 1.0))
    return make(name, coefficient=0.5 * LOSS / energy, **shapes)
