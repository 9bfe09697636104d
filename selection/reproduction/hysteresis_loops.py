"""Section 2.4: hysteresis loops of every force (Figs. 2.4, 2.5), and slip against its velocity-squared equivalent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from selection.arrays import FloatArray
from selection.forces.catalogue import CATALOGUE, case_five, make
from selection.forces.contract import Force, Sum
from selection.forces.derived import energy_per_cycle
from selection.forces.hysteresis import Loop, loop
from selection.forces.slip import Slip
from selection.forces.slip_equivalent import (
    EquivalenceError,
    corrected_coefficient,
    equivalence_error,
    exact_energy,
    printed_coefficient,
    printed_energy,
)
from selection.forces.velocity_squared import VelocitySquared

#: Energy loss of every loop drawn, over the largest energy of the spring, K A^2/2.
LOSS = 1.5
#: Slip joint of Fig. 2.4c: K1 = K/4, and the motion twice as far as it sticks.
SLIP_STIFFNESS, SLIP_LIMIT = 0.75, 0.5
#: Amplitude in units of A1 at which the equivalence is fixed, and how far it is then followed.
REFERENCE, FARTHEST = 2.0, 6.0
#: Exponents that no case of Table 2.I has, to draw the power laws with.
EXPONENTS = {"velocity-power": 0.5, "displacement-velocity-power": 1.5}


@dataclass(frozen=True)
class HysteresisLoops:
    """Loops over one cycle of amplitude 1 and frequency 1 about a spring of stiffness 1, by the force's name.

    ``areas``: force, polygon area of the loop, energy per cycle in closed form, relative difference of the two.
    """

    loops: dict[str, Loop]
    areas: pd.DataFrame


@dataclass(frozen=True)
class SlipEquivalent:
    """Slip and its velocity-squared equivalent (Fig. 2.5), stuck stiffness K = 1, limit A1 = 1.

    ``slip``, ``printed``, ``corrected``: loops at the amplitude ``REFERENCE``, the latter two of C3 q'^2 sgn q' by Eq.
    2.4.4 as printed and corrected, about the joint's mean slope. ``error``: against amplitude, C3 fixed there.
    ``energies``: amplitude over A1, exact energy, as printed (2.4.3), by each fixed C3; in units of K A1^2.
    """

    slip: Loop
    printed: Loop
    corrected: Loop
    error: EquivalenceError
    energies: pd.DataFrame


def hysteresis_loops() -> HysteresisLoops:
    """One loop of every force, all of one energy per cycle except slip's, which its stiffness and limit give."""
    forces = {name: _scaled(name) for name in CATALOGUE}
    forces["case V"] = _of_loss(case_five(1.0, 4.0))
    loops = {name: loop(force, 1.0, 1.0, stiffness=1.0) for name, force in forces.items()}
    closed = np.array([float(energy_per_cycle(force, 1.0, 1.0)) for force in forces.values()])
    areas = np.array([one.area for one in loops.values()])
    table = pd.DataFrame({"force": list(loops), "area": areas, "energy_per_cycle": closed})
    return HysteresisLoops(loops, table.assign(relative_difference=areas / closed - 1.0))


def slip_equivalent(stiffness: float = SLIP_STIFFNESS, reference: float = REFERENCE) -> SlipEquivalent:
    """The slip joint that loses ``stiffness`` (of K = 1) beyond A1 = 1 against the velocity-squared force.

    Args:
        reference: amplitude over A1, > 1, at which C3 is fixed.
    """
    slip, A = Slip(stiffness, 1.0), np.geomspace(1.02, FARTHEST, 300)
    coefficients = (float(f(slip, reference, 1.0)) for f in (printed_coefficient, corrected_coefficient))
    printed, corrected = (VelocitySquared(c) for c in coefficients)
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
    return A[left] - off[left] * (A[left + 1] - A[left]) / (off[left + 1] - off[left])


def _scaled(name: str) -> Force:
    """A force of the catalogue with the energy per cycle that is drawn (slip: as it comes)."""
    if name == "slip":
        return Slip(SLIP_STIFFNESS, SLIP_LIMIT)
    shapes = {"exponent": EXPONENTS[name]} if name in EXPONENTS else {}
    energy = float(energy_per_cycle(make(name, coefficient=1.0, **shapes), 1.0, 1.0))
    return make(name, coefficient=0.5 * LOSS / energy, **shapes)


def _of_loss(force: Sum) -> Sum:
    """A sum of forces proportional to their first field, scaled to the energy per cycle that is drawn."""
    factor = 0.5 * LOSS / float(energy_per_cycle(force, 1.0, 1.0))
    return Sum(tuple(make(part.name, coefficient=factor * part.coefficient) for part in force.forces))  # type: ignore[attr-defined]  # both parts of case V have one
