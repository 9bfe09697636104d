"""Energy per cycle over amplitude and frequency of Configuration I: counterpart of Fig. 5.1 (its data are not printed).

The report's figure is fitted to fifteen points "with zero error". What a fit that close is worth shows between its
points: the nine terms of Eq. 5.3.6 go below zero there, where a law of damping cannot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from selection.arrays import FloatArray
from selection.regression.fit import Fit, fit
from selection.regression.subsets import best_subsets
from selection.reproduction.nine_terms import INPUTS, Inputs, nine_term_design


@dataclass(frozen=True)
class EnergySurface:
    """Two surfaces on the grid ``amplitude`` (a,) times ``omega`` (f,), energies (a, f) in in-lb.

    ``physical``: best subset of the nine terms with every coefficient > 0, by BIC, its terms in ``law``; ``nine``: all
    nine terms, free. ``points``: ``omega_rad_s, amplitude_in, energy_in_lb``. ``rms_errors``: of both at the points.
    ``negative_share``: share of the grid on which the nine terms give energy to the structure. ``lowest``: the least.
    """

    amplitude: FloatArray
    omega: FloatArray
    physical: FloatArray
    nine: FloatArray
    law: tuple[str, ...]
    points: pd.DataFrame
    rms_errors: tuple[float, float]
    negative_share: float
    lowest: float


def energy_surface(inputs: Inputs = INPUTS[0], cells: int = 80) -> EnergySurface:
    """The surfaces over the rectangle that the points span and a little more, from zero amplitude.

    Args:
        inputs: A, omega and E of a table; by default the rough data of Table 5.III. cells: grid points each way.
    """
    A, omega, E = inputs.data()
    design = nine_term_design(A, omega, E)
    members = np.flatnonzero(best_subsets(design, "bic", nonnegative=True).members[0])
    physical, nine = fit(design.take(members)), fit(design)
    beyond = 0.03 * np.ptp(omega)
    grid_A = np.linspace(0.02 * A.max(), 1.05 * A.max(), cells)
    grid_omega = np.linspace(omega.min() - beyond, omega.max() + beyond, cells)
    surfaces = [_surface(one, grid_A, grid_omega, which) for one, which in ((physical, members), (nine, range(9)))]
    return EnergySurface(
        amplitude=grid_A,
        omega=grid_omega,
        physical=surfaces[0],
        nine=surfaces[1],
        law=physical.names,
        points=pd.DataFrame({"omega_rad_s": omega, "amplitude_in": A, "energy_in_lb": E}),
        rms_errors=(physical.rms_error, nine.rms_error),
        negative_share=float((surfaces[1] < 0.0).mean()),
        lowest=float(surfaces[1].min()),
    )


def _surface(found: Fit, A: FloatArray, omega: FloatArray, terms: np.ndarray | range) -> FloatArray:
    """Fitted energy (a, f) on a grid."""
    rows = [np.ravel(axis) for axis in np.meshgrid(A, omega, indexing="ij")]
    grid = nine_term_design(rows[0], rows[1], np.ones(rows[0].size)).columns[:, list(terms)]
    return np.asarray(grid @ found.coefficients).reshape(A.size, omega.size)
