"""Chapter II: energy factors of the damping cases (Tables 2.II, 4.III, 5.I)."""

from __future__ import annotations

from selection.forces.catalogue import force_class
from selection.forces.derived import energy_factor

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
