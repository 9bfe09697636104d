"""A simulation of your own for ``damping gap --simulator two_beams:frame``: two beams joined by a spring.

A clamped beam and the beam that continues it, joined by a bending spring: Euler-Bernoulli elements with two degrees of
freedom a node (Bathe, Finite Element Procedures, 1996, section 5.4.1), structural damping, a force at the tip and the
displacement there. SI units.
"""

from __future__ import annotations

import numpy as np

#: Length of each beam, m; elements of each; mass per length, kg/m.
LENGTH = 0.6
ELEMENTS = 4
MASS_PER_LENGTH = 1.56


def stiffness_and_mass(bending: float) -> tuple[np.ndarray, np.ndarray]:
    """Matrices of one element of bending stiffness EI: deflection and slope at either end."""
    h = LENGTH / ELEMENTS
    K = bending / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h], [-12, -6 * h, 12, -6 * h],
         [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    )  # fmt: skip
    M = MASS_PER_LENGTH * h / 420.0 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h], [54, 13 * h, 156, -22 * h],
         [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    )  # fmt: skip
    return K, M


def assemble(bending: float, joint: float) -> tuple[np.ndarray, np.ndarray]:
    """Matrices of both beams; the slope at the joint is there twice, once for each beam."""
    nodes = 2 * ELEMENTS + 1
    size = 2 * nodes + 1
    K, M = np.zeros((size, size)), np.zeros((size, size))
    k, m = stiffness_and_mass(bending)
    for element in range(2 * ELEMENTS):
        at = 2 * element + np.arange(4)
        if element == ELEMENTS:
            at[1] = size - 1  # the second beam has its own slope at the joint
        K[np.ix_(at, at)] += k
        M[np.ix_(at, at)] += m
    own, other = 2 * ELEMENTS + 1, size - 1
    K[np.ix_([own, other], [own, other])] += joint * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return K[2:, 2:], M[2:, 2:]  # the root is clamped


def frame(
    force: np.ndarray,
    frequency: np.ndarray,
    *,
    bending: tuple[float, float] | float = (140.0, 0.01),
    joint: tuple[float, float] | float = (2500.0, 0.1),
    loss: tuple[float, float] | float = (0.02, 0.1),
) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude (m) and phase lag (rad) at the tip under forces (N) at frequencies (Hz), one of each for every row.

    Each parameter has its value and its relative tolerance as default and is a number when the diagnosis calls.
    """
    K, M = assemble(float(bending), float(joint))
    tip = K.shape[0] - 3  # deflection of the last node; its slope and the second slope at the joint follow
    unit = np.zeros(K.shape[0])
    unit[tip] = 1.0
    H = np.array(
        [np.linalg.solve(K * (1.0 + 1j * float(loss)) - M * (2.0 * np.pi * f) ** 2, unit)[tip] for f in frequency]
    )
    return force * np.abs(H), -np.angle(H)
