"""Derivatives of what columns leave, against differences of the least squares of numpy."""

from __future__ import annotations

import numpy as np

from damping.campaign.projection import project, stack_parts


def test_derivatives_are_those_of_least_squares():
    """Central differences of 1e-6 are right to 1e-9 or so of derivatives of the order of 1."""
    rng = np.random.default_rng(2)
    columns, rates, H = (rng.normal(size=(k, 30)) + 1j * rng.normal(size=(k, 30)) for k in (4, 3, 2))
    sd, of = rng.uniform(0.5, 2.0, size=(2, 30)), np.array([2, 3, 3])  # two parameters move one column

    def rest(parameter: int, step: float) -> np.ndarray:
        moved = columns.copy()
        moved[of[parameter]] += step * rates[parameter]
        left = []
        for row, one in zip(H, sd, strict=True):
            P, y = stack_parts(moved / one).T, stack_parts(row / one)
            left.append(y - P @ np.linalg.lstsq(P, y, rcond=None)[0])
        return np.concatenate(left)

    found = project(columns.T, H, sd)
    np.testing.assert_allclose(found.rest.ravel(), rest(0, 0.0), atol=1e-12)
    right = np.transpose([(rest(k, 1e-6) - rest(k, -1e-6)) / 2e-6 for k in range(3)])
    np.testing.assert_allclose(found.differentiate(rates, of, sd), right, atol=1e-7)
