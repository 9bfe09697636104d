"""How large the gap is: residuals whitened by noise and repeatability, and their root mean square."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from selection.arrays import BoolArray, FloatArray
from selection.gap.fit import WILD_WEIGHT, Fit, fit
from selection.gap.model import Model

#: A larger share of wild values than this is no error of measurement: then none counts as wild.
MOST_WILD = 0.08


@dataclass(frozen=True)
class Gap:
    """Root mean squares (1 = noise alone) and the share of the gap that the leading explanation closes.

    Attributes:
        nominal: the simulation as given. before: refitted within its tolerance. after: with the explanation.
        shrinkage: 1 - max(after^2 - 1, 0)/(before^2 - 1); None where before^2 - 1 is within its sampling error.
    """

    nominal: float
    before: float
    after: float
    shrinkage: float | None


def gap(leading: Fit) -> Gap:
    """The gap of a record before and after its leading explanation, without wild points."""
    regular = regular_values(leading)
    nominal = float(np.sqrt(np.mean(nominal_residuals(leading)[regular] ** 2)))
    before = root_mean_square(refitted(leading), regular)
    after = root_mean_square(leading, regular)
    return Gap(nominal, before, after, shrinkage(before, after, int(regular.sum())))


def regular_values(one: Fit) -> BoolArray:
    """Values (m,) that a fit does not take for wild points; all, where they would be more than a few."""
    found = one.weights > WILD_WEIGHT
    return found if found.mean() >= 1.0 - MOST_WILD else np.ones_like(found)


def shrinkage(before: float, after: float, values: int) -> float | None:
    """1 - max(after^2 - 1, 0)/(before^2 - 1); None where before^2 - 1 is below two of its standard errors."""
    if before**2 - 1.0 < 2.0 * np.sqrt(2.0 / values):
        return None
    return float(1.0 - max(after**2 - 1.0, 0.0) / (before**2 - 1.0))


def root_mean_square(one: Fit, regular: BoolArray) -> float:
    """sqrt((|r|^2 + |z|^2)/n) of a fit: at its mode this is the residual whitened by noise and repeatability."""
    z = one.y[one.model.size :]
    r = one.r[regular] * one.model.scatter.dispersion
    return float(np.sqrt((r @ r + z @ z) / regular.sum()))


def refitted(leading: Fit) -> Fit:
    """The simulation alone, refitted within its tolerance by least squares to the regular points of a fit."""
    model = _alone(leading)
    weights = regular_values(leading).astype(float)
    return fit(model, np.zeros((1, model.size)), weights=weights)[0]


def nominal_residuals(leading: Fit) -> FloatArray:
    """Residuals (m,) of the simulation as given, whitened by noise and by the leading fit's repeatability."""
    model = _alone(leading)
    r, J = model.jacobian(np.zeros((1, model.size + 2 * model.sweeps)))
    return whitened(r[0], J[0, :, model.size :])


def _alone(leading: Fit) -> Model:
    """The simulation alone, with the leading fit's repeatability and the noise as it is."""
    return Model(leading.model.problem, (), replace(leading.model.scatter, dispersion=1.0))


def whitened(r: FloatArray, C: FloatArray) -> FloatArray:
    """(1 + C C^T)^(-1/2) r, the symmetric root: each entry stays as near to its own row as it can.

    Args:
        r: residuals in units of noise, (m,). C: their changes by the deviations of sweeps in units of repeatability.
    """
    U, S, _ = np.linalg.svd(C, full_matrices=False)
    return np.asarray(r - U @ ((1.0 - 1.0 / np.sqrt(1.0 + S**2)) * (U.T @ r)))
