"""The laws that compete: every force alone, viscous with each nonlinear one, and polynomials that selection found."""

from __future__ import annotations

import numpy as np

from selection.errors import AnalysisError
from selection.forces.catalogue import CATALOGUE
from selection.posterior.law import Law
from selection.posterior.observations import Observations

#: Forces that go with a viscous part; a free exponent beside a viscous term adds nothing that data can show.
PARTNERS = ("displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement", "coulomb", "slip")
#: Terms of the energy polynomial (5.3.6), with the force each of them is (Table 5.I; A is Coulomb friction) or itself.
POLYNOMIAL_TERMS = {
    "A^2*omega": "viscous",
    "A^2": "displacement",
    "A^3*omega^2": "velocity-squared",
    "A^3*omega": "displacement-velocity",
    "A^4*omega": "quadratic-displacement",
    "A": "coulomb",
    "A^3": "A^3",
    "A^4": "A^4",
    "A^2*omega^2": "A^2*omega^2",
}
#: Best subsets of the polynomial that become candidates.
SUBSETS = 3


def named_laws() -> list[Law]:
    """Every force of the catalogue alone, then viscous with each partner."""
    return [Law((name,)) for name in CATALOGUE] + [Law(("viscous", name)) for name in PARTNERS]


def polynomial_laws(data: Observations) -> list[Law]:
    """The best few subsets of the energy polynomial (5.3.6) with coefficients >= 0, by BIC, as laws."""
    from selection.regression.candidates import best_nonnegative_subsets

    return best_nonnegative_subsets
