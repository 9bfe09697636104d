"""Lumped masses to modes (2.2) and modal damping of sub-systems (2.5), against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from damping.errors import AnalysisError
from damping_reed1970.chapter_2.page import (
    Damper,
    modal_force,
    normal_modes,
    subsystem_damping,
)


def chain(n: int, m: float, k: float) -> tuple[np.ndarray, np.ndarray]:
    """n equal masses between equal springs, both ends of the chain fixed."""
    stiffness = 2 * k * np.eye(n) - k * np.eye(n, k=1) - k * np.eye(n, k=-1)
    return np.full(n, m), stiffness


def test_uniform_chain() -> None:
    """omega_j = 2 sqrt(k/m) sin(j pi/(2(n + 1))), phi_ij = sin(i j pi/(n + 1))."""
    n, m, k = 7, 2.5, 40.0
    modes = normal_modes(*chain(n, m, k), reference=0)
    j = np.arange(1, n + 1)
    # LAPACK's symmetric eigenvalues: a few units of rounding
    np.testing.assert_allclose(modes.omega, 2 * np.sqrt(k / m) * np.sin(j * np.pi / (2 * (n + 1))), rtol=1e-13)
    shapes = np.sin(np.outer(j, j) * np.pi / (n + 1))
    np.testing.assert_allclose(modes.shapes, shapes / shapes[0], rtol=1e-11, atol=1e-12)
    # sum_i sin^2 = (n + 1)/2, scaled to 1 at the reference
    np.testing.assert_allclose(modes.masses, m * (n + 1) / 2 / shapes[0] ** 2, rtol=1e-12)


def test_shapes_diagonalise_both_matrices() -> None:
    """Eq 2.2.2: phi^T m phi = [M_j], phi^T k phi = [omega_j^2 M_j], with a full mass matrix."""
    rng = np.random.default_rng(7)
    root = rng.normal(size=(5, 5))
    mass, stiffness = root @ root.T + 5 * np.eye(5), chain(5, 1.0, 30.0)[1]
    modes = normal_modes(mass, stiffness, reference=2)
    np.testing.assert_allclose(modes.shapes[2], 1.0, rtol=1e-13)
    # rounding of a 5 by 5 product, relative to the largest entry
    np.testing.assert_allclose(modes.shapes.T @ mass @ modes.shapes, np.diag(modes.masses), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(
        modes.shapes.T @ stiffness @ modes.shapes, np.diag(modes.omega**2 * modes.masses), rtol=1e-10, atol=1e-9
    )


def test_free_free_beam_of_two_masses() -> None:
    """A rigid-body mode at zero and omega^2 = k (1/m1 + 1/m2); the second shape is 1, -m1/m2."""
    m1, m2, k = 3.0, 5.0, 70.0
    modes = normal_modes(np.array([m1, m2]), k * np.array([[1.0, -1.0], [-1.0, 1.0]]), reference=0)
    # the square root of rounding: 1e-16 k/m under the root
    np.testing.assert_allclose(modes.omega, [0.0, np.sqrt(k / m1 + k / m2)], rtol=1e-13, atol=1e-6)
    np.testing.assert_allclose(modes.shapes, [[1.0, 1.0], [1.0, -m1 / m2]], rtol=1e-12)
    np.testing.assert_allclose(modes.masses, [m1 + m2, m1 + m1**2 / m2], rtol=1e-12)


def test_modal_force_at_the_tail_node() -> None:
    """F_e,j = phi_rj F (Eq 2.2.3)."""
    modes = normal_modes(*chain(4, 1.0, 1.0), reference=0)
    np.testing.assert_array_equal(modal_force(modes, 3, 20.0), modes.shapes[3] * 20.0)
    # a uniform chain is symmetric: odd modes move both ends alike, even ones against each other
    np.testing.assert_allclose(modal_force(modes, 3, 20.0), [20.0, -20.0, 20.0, -20.0], rtol=1e-12)


DAMPERS = [
    Damper("booster", 0.4, 0),
    Damper("booster", 0.3, 0, 1),
    Damper("upper stage", 0.2, 1, 2),
    Damper("payload", 0.7, 3, 2),
]


def test_sub_system_dampers_add_to_the_modal_coefficients() -> None:
    modes = normal_modes(*chain(4, 1.5, 9.0), reference=3)
    c = np.zeros((4, 4))
    for damper in DAMPERS:
        ends = [node for node in (damper.node, damper.other) if node is not None]  # one end may be on the ground
        pair = np.array([[1.0, -1.0], [-1.0, 1.0]])[: len(ends), : len(ends)]
        c[np.ix_(ends, ends)] += damper.coefficient * pair
    full = modes.shapes.T @ c @ modes.shapes
    shares = subsystem_damping(modes, DAMPERS)
    assert list(shares) == ["booster", "upper stage", "payload"]
    np.testing.assert_allclose(sum(shares.values()), np.diag(full), rtol=1e-13)
    # a damper dissipates pi omega c (stroke)^2 a cycle: its share is c times the squared relative motion
    stroke = modes.shapes[3] - modes.shapes[2]
    np.testing.assert_allclose(shares["payload"], 0.7 * stroke**2, rtol=1e-13)


def test_a_still_reference_node_is_refused() -> None:
    """The middle of an odd chain does not move in even modes."""
    with pytest.raises(AnalysisError, match="mode 2 does not move node 1"):
        normal_modes(*chain(3, 1.0, 1.0), reference=1)
