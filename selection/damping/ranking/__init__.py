"""Candidates, fits and the ranking of damping laws.

One table that lists every candidate damping law, best first.

Candidates are sorted by ``score`` = -2 ln(marginal likelihood): coefficients >= 0, equal prior probability of every
candidate, priors of :mod:`damping.infer.law`. Weights are posterior probabilities over the physical candidates,
those whose unconstrained coefficients come out >= 0; a candidate with a negative coefficient is a simpler law with a
force that is not there, and gets none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from damping.errors import AnalysisError
from damping.infer.evidence import Estimate, Evidence, evidence
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.ranking.candidates import (
    Fit,
    candidate_laws,
    fit,
    fitted_force,
    held_out_errors,
    percent_errors,
    root_mean_square,
)

CRITERION = "-2 ln(marginal likelihood), coefficients >= 0"
#: Content of the credible interval of a coefficient in the table.
INTERVAL = 0.90
#: A fitted shape within this of an end of its range is said to be at the edge of it.
EDGE = 0.01


@dataclass(frozen=True)
class Coefficient:
    """One parameter of a candidate: least-squares value, standard error and T-ratio; credible ``low`` and ``high``.

    ``shape`` is empty for the coefficient of a force and names the parameter (``exponent``, ``limit``) otherwise.
    """

    force: str
    shape: str
    value: float
    std_error: float
    t_ratio: float
    low: float
    high: float


@dataclass(frozen=True)
class Candidate:
    """A candidate's row of the table; numbers that do not exist are NaN.

    Attributes:
        rank: 1 is best; None where the candidate could not be fitted. score, weight: see the module.
        held_out_error: root mean square percent error of resonant amplitudes, each predicted from the other levels.
        average_absolute_percent: mean absolute percent error of resonant amplitudes as fitted.
        physical: unconstrained coefficients all >= 0. fit, evidence: where the numbers come from.
    """

    law: Law
    rank: int | None
    coefficients: tuple[Coefficient, ...]
    score: float
    weight: float
    held_out_error: float
    average_absolute_percent: float
    physical: bool
    cautions: tuple[str, ...]
    fit: Fit | None = None
    evidence: Evidence | None = None
    coordinates: Coordinates | None = None

    @property
    def name(self) -> str:
        """The law's name."""
        return self.law.name


@dataclass(frozen=True)
class Ranking:
    """All candidates, best first, those that could not be fitted last."""

    criterion: str
    candidates: tuple[Candidate, ...]
    data: Observations

    def weighted(self, least: float = 0.0) -> tuple[Candidate, ...]:
        """Candidates with a weight above ``least``."""
        return tuple(c for c in self.candidates if c.weight > least)

    def find(self, law: Law) -> Candidate:
        """The row of a law. KeyError if it is no candidate."""
        for candidate in self.candidates:
            if set(candidate.law.components) == set(law.components):
                return candidate
        raise KeyError(law.name)


def rank_laws(
    data: Observations,
    seed: int = 0,
    laws: Sequence[Law] | None = None,
    done: Callable[[str], None] = lambda name: None,
    estimate: Estimate = evidence,
    hold_out: bool = True,
) -> Ranking:
    """Fit and rank candidates.

    Args:
        laws: the candidates; by default :func:`candidate_laws`. done: called with each candidate's name.
        estimate: of the marginal likelihood. hold_out: whether held-out errors are wanted; else they are NaN.

    Raises:
        AnalysisError: no candidate could be fitted.
    """
    rows = []
    for law in candidate_laws(data) if laws is None else laws:
        rows.append(_candidate(law, data, seed, estimate, hold_out))
        done(law.name)
    fitted = sorted((row for row in rows if np.isfinite(row.score)), key=lambda row: row.score)
    if not fitted:
        raise AnalysisError("no damping law could be fitted: " + "; ".join(c for row in rows for c in row.cautions))
    weights = _weights(fitted)
    ranked = [replace(row, rank=i + 1, weight=w) for i, (row, w) in enumerate(zip(fitted, weights, strict=True))]
    return Ranking(CRITERION, tuple(ranked + [row for row in rows if not np.isfinite(row.score)]), data)


def _weights(fitted: Sequence[Candidate]) -> list[float]:
    """Posterior probabilities over the physical candidates (over all when none is)."""
    physical = np.array([row.physical for row in fitted])
    score = np.array([row.score for row in fitted])
    allowed = physical if physical.any() else np.ones_like(physical)
    w = np.where(allowed, np.exp(-0.5 * (score - score[allowed].min())), 0.0)
    return [float(v) for v in w / w.sum()]


def _candidate(law: Law, data: Observations, seed: int, estimate: Estimate, hold_out: bool) -> Candidate:
    """Fit one law; what cannot be done becomes a caution."""
    nothing = Candidate(law, None, (), np.nan, 0.0, np.nan, np.nan, False, ())
    if not law.has_resonance:
        return replace(nothing, cautions=("friction alone sets no resonant amplitude",))
    coordinates = Coordinates.of(law, data)
    try:
        found = estimate(coordinates, data, seed)
    except AnalysisError as error:
        return replace(nothing, cautions=(str(error),))
    least_squares = fit(coordinates, data, found.mode)
    errors = percent_errors(fitted_force(coordinates, least_squares, found.mode), data)
    held_out, held_out_caution = _held_out(law, data) if hold_out else (np.nan, ())
    return Candidate(
        law=law,
        rank=None,
        coefficients=_coefficients(coordinates, least_squares, found),
        score=-2.0 * found.log_z,
        weight=0.0,
        held_out_error=held_out,
        average_absolute_percent=float(np.mean(np.abs(errors))),
        physical=least_squares.physical,
        cautions=(*_cautions(law, least_squares, found, data), *held_out_caution),
        fit=least_squares,
        evidence=found,
        coordinates=coordinates,
    )


def _held_out(law: Law, data: Observations) -> tuple[float, tuple[str, ...]]:
    """Held-out error in per cent, or NaN with the reason."""
    if len(data.sweeps) < 2:
        return np.nan, ("one level: nothing to hold out",)
    try:
        return root_mean_square(held_out_errors(law, data)), ()
    except AnalysisError:
        return np.nan, ("with a level left out it cannot carry the other forces",)


def _coefficients(coordinates: Coordinates, least_squares: Fit, found: Evidence) -> tuple[Coefficient, ...]:
    """Rows of the coefficient table: least squares beside the credible interval."""
    draws = coordinates.parameters(found.draws)
    tail = 50.0 * (1.0 - INTERVAL)
    kinked = {name for name, shape in coordinates.law.free_shapes.items() if not shape.smooth}
    rows = []
    for name, value, error, t in zip(
        least_squares.names, least_squares.values, least_squares.std_errors, least_squares.t_ratios, strict=True
    ):
        low, high = np.percentile(draws[name], [tail, 100.0 - tail])
        force, _, shape = name.partition(" ")
        if name in kinked:  # least squares has a kink at every measured amplitude: the posterior's spread instead
            error = np.std(draws[name])
            t = value / error
        rows.append(Coefficient(force, shape, float(value), float(error), float(t), float(low), float(high)))
    return tuple(rows)


def _cautions(law: Law, least_squares: Fit, found: Evidence, data: Observations) -> tuple[str, ...]:
    """What a reader of the row should know, in words."""
    said = []
    for name, value in zip(law.components, least_squares.values, strict=False):
        if value < 0.0:
            said.append(f"coefficient of {name} is negative: not a damping force; left out of the weights")
    freedom = least_squares.rows - least_squares.parameters
    if freedom < 3:
        points = f"{least_squares.rows} point{'s' * (least_squares.rows != 1)}"
        said.append(f"{points}, {_degrees(freedom)}: standard errors rest on the stated scatter")
    if np.isnan(least_squares.std_errors).any():
        said.append("the data cannot tell its parameters apart")
    fitted = dict(zip(least_squares.names, least_squares.values, strict=True))
    for name, shape in law.free_shapes.items():
        edges = shape.prior.range if shape.prior else None
        if edges is not None and not edges[0] + EDGE < fitted[name] < edges[1] - EDGE:
            said.append(f"{name} is at the edge of its range")
    if len(data.sweeps) < 3:
        said.append(f"{len(data.sweeps)} force level{'s' * (len(data.sweeps) > 1)}: amplitude dependence hardly tested")
    if found.effective_draws < 200:
        said.append(f"marginal likelihood uncertain by {200 * found.standard_error:.0f} % (2 standard errors)")
    return tuple(said)


def _degrees(freedom: int) -> str:
    return f"{freedom} degree{'s' * (freedom != 1)} of freedom" if freedom >= 0 else "more parameters than points"
