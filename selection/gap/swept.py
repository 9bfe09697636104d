"""Steady-state sweeps of a model with effects: all states that its terms predict, and those that a sweep passes."""

from __future__ import annotations

from typing import Literal

import numpy as np

from selection.arrays import FloatArray, IntArray
from selection.gap.effects.given import with_effects
from selection.gap.simulation import Simulation
from selection.gap.terms import Drive, Prediction, Terms, predict
from selection.records.mode import Mode
from selection.response.branches import Branches, brackets, by_row, finely, followed
from selection.response.ritz import SteadyState
from selection.response.roots import bracketed_newton

#: Amplitudes searched: 8 decades about the static deflection, 50 points in each.
_GRID = np.linspace(-3.0, 5.0, 401) * np.log(10.0)


def swept(mode: Mode, F: float, omega: FloatArray, direction: Literal["up", "down"] = "up") -> SteadyState:
    """The readings of a slow sweep of a mode with its effects at ``omega`` (increasing, rad/s, (n,)), with its jumps.

    Force F is the recorded one. NaN where there is no stable steady state.

    Raises:
        InputError: an effect that is not known, or its table is not.
    """
    simulation = Simulation(mode)
    terms = with_effects(simulation.terms(np.zeros((1, len(simulation.names)))), mode)
    fine, between = finely(np.asarray(omega, dtype=float))
    return followed(states(terms, F, fine), between, direction)


def states(terms: Terms, F: float, omega: FloatArray) -> Branches:
    """All roots of u = Re P(u), u = ln A, at each frequency; stable where the left side grows faster."""
    u = np.log(F / (float(np.ravel(terms.M)[0]) * float(np.ravel(terms.omega_n)[0]) ** 2)) + _GRID

    def found(points: FloatArray, rows: IntArray) -> Prediction:
        at = np.broadcast_to(omega[rows], np.broadcast_shapes(points.shape, rows.shape))
        return predict(terms, np.broadcast_to(points, at.shape), Drive(np.full(at.shape, F), at, np.ones(at.shape)))

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
