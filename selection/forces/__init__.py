"""Damping forces: one contract (`contract.Force`), one short module a force, the catalogue, what follows."""

from selection.forces.catalogue import CATALOGUE, case_five, from_damping, make, parameter_names
from selection.forces.contract import Force, Sum
from selection.forces.coulomb import Coulomb
from selection.forces.cubic_stiffness import CubicStiffness
from selection.forces.displacement import Displacement
from selection.forces.displacement_velocity import DisplacementVelocity
from selection.forces.displacement_velocity_power import DisplacementVelocityPower
from selection.forces.energy_term import EnergyTerm
from selection.forces.quadratic_displacement import QuadraticDisplacement
from selection.forces.slip import Slip
from selection.forces.velocity_power import VelocityPower
from selection.forces.velocity_squared import VelocitySquared
from selection.forces.viscous import Viscous

__all__ = [
    "CATALOGUE",
    "Coulomb",
    "CubicStiffness",
    "Displacement",
    "DisplacementVelocity",
    "DisplacementVelocityPower",
    "EnergyTerm",
    "Force",
    "QuadraticDisplacement",
    "Slip",
    "Sum",
    "VelocityPower",
    "VelocitySquared",
    "Viscous",
    "case_five",
    "from_damping",
    "make",
    "parameter_names",
]
