"""The laws that compete: every force alone, viscous with each nonlinear one, and polynomials that selection found."""

from __future__ import annotations

import numpy as np

from selection.errors import AnalysisError
from selection.forces.catalogue import CATALOGUE
from selection.posterior.law import Law
from selection.posterior.observations import Observations
from selection.regression.design import design_of_arrays
from selection.regression.subsets import best_subsets

#: Forces that go with a viscous part; a free exponent beside a viscous term adds nothing that data can show.
PARTNERS = ("displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement", "coulomb", "slip")
#: Powers (m, n) of A^m omega^n in the energy polynomial (5.3.6), by the force that each term is (Table 5.I; A is
#: Coulomb friction) or by the term where no force is known for it.
POLYNOMIAL = {
    "viscous": (2, 1),
    "displacement": (2, 0),
    "velocity-squared": (3, 2),
    "displacement-velocity": (3, 1),
    "quadratic-displacement": (4, 1),
    "coulomb": (1, 0),
    "A^3": (3, 0),
    "A^4": (4, 0),
    "A^2*omega^2": (2, 2),
}
#: Best subsets of the polynomial of each size that become candidates, and the most terms of one.
SUBSETS_PER_SIZE, MOST_TERMS = 2, 3


def candidate_laws(data: Observations) -> list[Law]:
    """All candidates for a record, named ones first, each once."""
    laws = [Law((name,)) for name in CATALOGUE] + [Law(("viscous", name)) for name in PARTNERS]
    known = {frozenset(law.components) for law in laws}
    return laws + [law for law in polynomial_laws(data) if frozenset(law.components) not in known]


def polynomial_laws(data: Observations) -> list[Law]:
    """Best subsets of the energy polynomial (5.3.6) with coefficients >= 0, by BIC, as in section 5.3.

    None where there are no more rows than terms: the nine terms cannot then be told apart.
    """
    terms = np.column_stack([data.A**m * data.omega**n for m, n in POLYNOMIAL.values()])
    energy = np.pi * data.A * data.D
    if len(energy) <= len(POLYNOMIAL):
        return []
    try:
        found = best_subsets(
            design_of_arrays(terms, energy, list(POLYNOMIAL)), "bic", nonnegative=True, per_size=SUBSETS_PER_SIZE
        )
    except AnalysisError:  # one frequency only, or amplitudes that repeat: the terms are one column written twice
        return []
    names = np.array(list(POLYNOMIAL))
    return [Law(tuple(names[members])) for members in found.members if members.sum() <= MOST_TERMS]
