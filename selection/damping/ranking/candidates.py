"""The laws that compete: every force alone, viscous with each nonlinear one, and polynomials that selection found.

Least-squares fit of a law in its own parameters: coefficients with standard errors and T-ratios.

Coefficients may come out negative here, which is how data say that a force is not there; shapes stay in their ranges.
Residuals are those of the likelihood, whitened by its scatter at the posterior mode, so a standard error is honest
about noise even where there are as many parameters as points.

Errors of a law at the tested resonances, in per cent of resonant amplitude: fitted, and with the level held out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from damping.arrays import FloatArray, IntArray
from damping.errors import AnalysisError
from damping.forces import CATALOGUE, Viscous, term_name
from damping.forces.contract import Force, Sum
from damping.infer.evidence import find_mode
from damping.infer.law import Coordinates, Law, residuals
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude
from damping.regression.design import design_of_arrays
from damping.regression.subsets import best_subsets

#: Powers (m, n) of A^m omega^n in the energy polynomial (5.3.6). Six of the nine terms are forces (Table 5.I).
POWERS = ((2.0, 1.0), (2.0, 0.0), (3.0, 2.0), (3.0, 1.0), (4.0, 1.0), (1.0, 0.0), (3.0, 0.0), (4.0, 0.0), (2.0, 2.0))
#: Best subsets of the polynomial of each size that become candidates, and the most terms of one.
SUBSETS_PER_SIZE, MOST_TERMS = 2, 3


def candidate_laws(data: Observations) -> list[Law]:
    """All candidates for a record, named ones first, each once."""
    beside = [name for name, kind in CATALOGUE.items() if kind.beside_viscous]
    laws = [Law((name,)) for name in CATALOGUE] + [Law((Viscous.name, name)) for name in beside]
    known = {frozenset(law.components) for law in laws}
    return laws + [law for law in polynomial_laws(data) if frozenset(law.components) not in known]


def polynomial_laws(data: Observations) -> list[Law]:
    """Best subsets of the energy polynomial (5.3.6) with coefficients >= 0, by BIC, as in section 5.3.

    None where there are no more rows than terms: the nine terms cannot then be told apart.
    """
    terms = np.column_stack([data.A**m * data.omega**n for m, n in POWERS])
    names = np.array([term_name(m, n) for m, n in POWERS])
    energy = np.pi * data.A * data.D
    if len(energy) <= len(POWERS):
        return []
    try:
        found = best_subsets(
            design_of_arrays(terms, energy, list(names)), "bic", nonnegative=True, per_size=SUBSETS_PER_SIZE
        )
    except AnalysisError:  # one frequency only, or amplitudes that repeat: the terms are one column written twice
        return []
    return [Law(tuple(names[members].tolist())) for members in found.members if members.sum() <= MOST_TERMS]


@dataclass(frozen=True)
class Fit:
    """Generalised least squares of a law.

    Attributes:
        names: parameters, coefficients first; coefficients: how many they are.
        values, std_errors: in the units of the record; standard errors are NaN where the data cannot tell the
            parameters apart. rows, parameters: counts.
        rss: sum of squared relative residuals; aic, aicc, bic: of them, rows taken as independent and the scatter
            as one more parameter; NaN where there are too few rows.
    """

    names: tuple[str, ...]
    coefficients: int
    values: FloatArray
    std_errors: FloatArray
    rows: int
    parameters: int
    rss: float
    aic: float
    aicc: float
    bic: float

    @property
    def physical(self) -> bool:
        """Whether no coefficient is negative."""
        return bool(np.all(self.values[: self.coefficients] >= 0.0))

    @property
    def t_ratios(self) -> FloatArray:
        """Value over standard error."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.values / self.std_errors


def natural_force(law: Law, values: FloatArray) -> Sum:
    """The force of a law from coefficients and then shapes, numbers in the units of the record."""
    position, forces = len(law.parts), []
    for part, coefficient in zip(law.parts, values, strict=False):
        shapes = {}
        for shape in part.free_shapes:
            shapes[shape.name] = values[position]
            position += 1
        forces.append(part.build(coefficient, **shapes))
    return Sum(tuple(forces))


def fit(coordinates: Coordinates, data: Observations, mode: FloatArray) -> Fit:
    """Fit a law, starting from its posterior mode ``mode`` (dimension,)."""
    law = coordinates.law
    start = _natural(coordinates, mode)
    row, level = (float(value[0]) for value in coordinates.scatter(mode[None, :]))
    ranges = [shape.fitted_range for shape in law.free_shapes.values()]
    low, high = zip(*[(-np.inf, np.inf)] * len(law.parts), *ranges, strict=True)
    scale = np.where(np.abs(start) > 0, np.abs(start), 1.0)

    def whitened(values: FloatArray) -> FloatArray:
        n, h, known = residuals(natural_force(law, values), data)
        z = _whiten(n, h, row**2 + known, level**2, data.sweep)
        return np.where(np.isfinite(z), z, 1e6)

    start = np.clip(start, np.array(low) + 1e-9 * scale, np.array(high) - 1e-9 * scale)
    result = least_squares(whitened, start, jac="3-point", bounds=(low, high), x_scale=scale, xtol=1e-12, ftol=1e-12)
    n = residuals(natural_force(law, result.x), data)[0]
    rss, rows, k = float(n @ n), len(n), len(start)
    return Fit(
        names=_names(law),
        coefficients=len(law.parts),
        values=result.x,
        std_errors=_standard_errors(np.asarray(result.jac) * scale, scale),
        rows=rows,
        parameters=k,
        rss=rss,
        **_criteria(rss, rows, k + 1),
    )


def _names(law: Law) -> tuple[str, ...]:
    """Parameter names: components, then their shapes."""
    return (*law.components, *law.free_shapes)


def _natural(coordinates: Coordinates, x: FloatArray) -> FloatArray:
    """Coefficients and shapes at one point."""
    coefficients = [float(c) for c in coordinates.coefficients(x)]
    return np.array(coefficients + [float(v) for shapes in coordinates.shapes(x) for v in shapes.values()])


def _whiten(n: FloatArray, h: FloatArray, variance: FloatArray, level: float, sweep: IntArray) -> FloatArray:
    """Residuals of unit covariance: the inverse Cholesky factor of diag(variance) + level h h^T, sweep by sweep."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a force that is not there at all: no finite residual
        z = n / np.sqrt(variance)
    if level == 0.0:
        return z
    for s in np.unique(sweep):
        rows = sweep == s
        u = h[rows] / np.sqrt(variance[rows])
        uu = float(u @ u)
        # (I + t u u^T)^(-1/2) = I - (1 - 1/sqrt(1 + t uu)) u u^T / uu
        if uu > 0:
            z[rows] -= (1.0 - 1.0 / np.sqrt(1.0 + level * uu)) * u * float(u @ z[rows]) / uu
    return z


def _standard_errors(jacobian: FloatArray, scale: FloatArray) -> FloatArray:
    """Square roots of the diagonal of (J^T J)^-1, in original units; NaN where J is numerically rank deficient."""
    _, singular, vt = np.linalg.svd(jacobian, full_matrices=False)
    if len(singular) < jacobian.shape[1] or singular[-1] <= 1e-10 * singular[0]:
        return np.full(jacobian.shape[1], np.nan)
    result: FloatArray = np.sqrt(np.sum((vt.T / singular) ** 2, axis=1)) * scale
    return result


def _criteria(rss: float, rows: int, k: int) -> dict[str, float]:
    """AIC, AICc and BIC of Gaussian residuals with ``k`` parameters, the scatter included."""
    if rows <= k or rss <= 0.0:
        return {"aic": np.nan, "aicc": np.nan, "bic": np.nan}
    deviance = rows * np.log(rss / rows)
    aic = deviance + 2.0 * k
    aicc = aic + 2.0 * k * (k + 1) / (rows - k - 1) if rows > k + 1 else np.nan
    return {"aic": aic, "aicc": aicc, "bic": deviance + k * np.log(rows)}


#: Times that a law is fitted without some of the sweeps, at most.
MOST_FOLDS = 20


def percent_errors(force: Force, data: Observations) -> FloatArray:
    """100 (predicted/measured - 1) of the resonant amplitude of each sweep at its tested force, (sweeps,).

    Where the force has no resonance at a tested force the error is NaN.
    """
    amplitude = resonant_amplitude(force, data.tested_force, data.tested_omega)
    return 100.0 * (amplitude / data.tested_amplitude - 1.0)


def fitted_force(coordinates: Coordinates, least_squares: Fit, mode: FloatArray) -> Force:
    """The law as least squares gives it, or at its posterior mode where that would have a negative coefficient."""
    if least_squares.physical:
        return natural_force(coordinates.law, least_squares.values)
    return coordinates.force(mode)


def held_out_errors(law: Law, data: Observations) -> FloatArray:
    """Percent errors of each sweep predicted by the law fitted to all other sweeps, (sweeps,).

    More than ``MOST_FOLDS`` sweeps are left out in as many groups, neighbours in the record in different ones.

    Raises:
        AnalysisError: the law cannot carry the forces of the other sweeps.
    """
    errors = np.full(len(data.sweeps), np.nan)
    folds = min(len(data.sweeps), MOST_FOLDS)
    for fold in range(folds):
        keep = np.arange(len(data.sweeps)) % folds != fold
        others = data.keep_sweeps(keep)
        coordinates = Coordinates.of(law, others)
        mode = find_mode(coordinates, others)
        force = fitted_force(coordinates, fit(coordinates, others, mode), mode)
        errors[~keep] = percent_errors(force, data.keep_sweeps(~keep))
    return errors


def root_mean_square(errors: FloatArray) -> float:
    """Root mean square; NaN when any error is."""
    return float(np.sqrt(np.mean(errors**2)))
