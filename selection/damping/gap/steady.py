"""Steady states that terms predict: from the measured amplitude, or along a sweep from state to state.

Steady-state sweeps of a model with effects: all states that its terms predict, and those that a sweep passes.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from damping.arrays import FloatArray, IntArray
from damping.effects import with_effects
from damping.effects.terms import Drive, Prediction, Terms, predict
from damping.gap.fit import ModelFit
from damping.gap.model import FOLD, Model, Simulation, deviated
from damping.gap.rows import Rows
from damping.predict.branches import Branches, brackets, by_row, finely, followed
from damping.predict.steady import SteadyState, bracketed_newton
from damping.records.mode import Mode

_MOST_STEPS = 40
_LONGEST = 0.5
_SETTLED = 1e-10


class Motion(NamedTuple):
    """ln of the amplitude and the phase lag (rad) of a steady state, (n,) each."""

    u: FloatArray
    phase: FloatArray


def steady(terms: Terms, rows: Rows, u: FloatArray) -> Motion:
    """The steady states nearest to ln amplitudes u, (n,): Newton's method on u = Re P(u), steps bounded.

    ``terms`` holds values (1, 1) or (1, n). Where there is none near, the amplitude of least misfit on the way.
    """
    best, least = u.copy(), np.full(len(u), np.inf)
    for _ in range(_MOST_STEPS):
        found = predict(terms, u, rows.drive)
        misfit = u - found.P.real[0]
        closer = np.abs(misfit) < least
        best, least = np.where(closer, u, best), np.where(closer, np.abs(misfit), least)
        if np.all(least < _SETTLED):
            break
        d = 1.0 - found.by_u.real[0]
        u = u - np.clip(misfit * d / (d * d + FOLD**4), -_LONGEST, _LONGEST)
    return Motion(best, -predict(terms, best, rows.drive).P.imag[0])


def fitted_terms(one: ModelFit, effects: bool = True, deviations: bool = True) -> Terms:
    """Terms of a fit, values (1, n): with or without its effects, with or without each sweep's own deviation."""
    model = one.model if effects else Model(one.model.problem, (), one.model.scatter)
    k = len(one.model.problem.simulation.names)
    x = one.y[: one.model.size] if effects else np.where(_replaced(one, k), 0.0, one.y[:k])
    z = one.y[one.model.size :] * float(deviations)
    return deviated(model.terms(x[np.newaxis]), one.model.problem.rows, z[np.newaxis], one.model.scatter)


def _replaced(one: ModelFit, k: int) -> FloatArray:
    """Variables of the simulation that an effect took the place of."""
    names = one.model.problem.simulation.names[:k]
    return np.array([any(part.form.replaces == name for part in one.model.parts) for name in names])


#: Amplitudes searched: 8 decades about the static deflection, 50 points in each.
_GRID = np.linspace(-3.0, 5.0, 401) * np.log(10.0)


def swept(mode: Mode, F: float, omega: FloatArray, direction: Literal["up", "down"] = "up") -> SteadyState:
    """The readings of a slow sweep of a mode with its effects at ``omega`` (increasing, rad/s, (n,)), with its jumps.

    Force F is the recorded one. NaN where there is no stable steady state.

    Raises:
        InputError: an effect that is not known, or its table is not.
    """
    simulation = Simulation(mode)
    terms = with_effects(simulation.terms(np.zeros((1, len(simulation.names)))), mode.effects)
    fine, between = finely(np.asarray(omega, dtype=float))
    return followed(states(terms, F, fine), between, direction)


def states(terms: Terms, F: float, omega: FloatArray) -> Branches:
    """All roots of u = Re P(u), u = ln A, at each frequency; stable where the left side grows faster."""
    u = np.log(F / (float(np.ravel(terms.M)[0]) * float(np.ravel(terms.omega_n)[0]) ** 2)) + _GRID

    def found(points: FloatArray, rows: IntArray) -> Prediction:
        at = np.broadcast_to(omega[rows], np.broadcast_shapes(points.shape, rows.shape))
        return predict(terms, np.broadcast_to(points, at.shape), Drive(np.full(at.shape, F), at))

    def level(points: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        shape = np.broadcast_shapes(points.shape, rows.shape)
        one = found(points, rows)
        return (points - one.P.real).reshape(shape), (1.0 - one.by_u.real).reshape(shape)

    with np.errstate(all="ignore"):
        value, derivative = level(u, np.arange(omega.size)[:, np.newaxis])
        row, low, high = brackets(level, u, value, derivative)
        roots = bracketed_newton(lambda points: level(points, row), low, high)
    order = np.lexsort((roots, row))
    row, roots = row[order], roots[order]
    phase, slope = -found(roots, row).P.imag.ravel(), level(roots, row)[1]
    tables = [by_row(row, values, omega.size) for values in (np.exp(roots), phase, slope)]
    return Branches(omega, tables[0], tables[1], np.nan_to_num(tables[2], nan=-1.0) > 0.0)
