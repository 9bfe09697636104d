"""Lumped masses to modes (2.2) and modal damping of sub-systems (2.5), against closed forms and the dampers' matrix."""

from __future__ import annotations

import numpy as np

from damping_reed1970.chapter_2.page import JOINTS, MASSES, tabulate_lumped_masses

#: phi_ij = cos((i - 1/2) j pi/n) of n equal masses between equal springs, over that of the first mass.
MIDDLES = np.arange(MASSES) + 0.5
SHAPES = np.cos(np.outer(MIDDLES, np.arange(MASSES)) * np.pi / MASSES)
SHAPES = SHAPES / SHAPES[0]


def test_free_masses_have_their_closed_form() -> None:
    found = tabulate_lumped_masses()
    # LAPACK's symmetric eigenvectors: a few units of rounding
    np.testing.assert_allclose(found["mass"], np.sum(SHAPES**2, axis=0), rtol=1e-12, atol=0.0)
    np.testing.assert_allclose(found["force"], SHAPES[-1], rtol=1e-12, atol=0.0)  # Eq. 2.2.3, F = 1


def test_sub_system_dampers_add_to_the_modal_coefficients() -> None:
    """Each joint's column is diag(phi^T c phi) of its own damper, and C that of all of them."""
    found = tabulate_lumped_masses()
    total = np.zeros((MASSES, MASSES))
    for first, (name, coefficient) in enumerate(JOINTS.items()):
        damper = np.zeros((MASSES, MASSES))
        damper[first : first + 2, first : first + 2] = coefficient * np.array([[1.0, -1.0], [-1.0, 1.0]])
        # the table has twelve decimals
        np.testing.assert_allclose(found[name], np.diag(SHAPES.T @ damper @ SHAPES), rtol=0.0, atol=1e-12)
        total += damper
    np.testing.assert_allclose(found["C"], np.diag(SHAPES.T @ total @ SHAPES), rtol=0.0, atol=1e-12)
