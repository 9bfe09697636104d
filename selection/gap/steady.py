"""Steady states that terms predict: from the measured amplitude, or along a sweep from state to state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from selection.arrays import FloatArray
from selection.gap.fit import Fit
from selection.gap.model import FOLD, Model, deviated
from selection.gap.rows import Rows
from selection.gap.terms import Terms, predict

_MOST_STEPS, _LONGEST, _SETTLED = 40, 0.5, 1e-10


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


def fitted_terms(one: Fit, effects: bool = True, deviations: bool = True) -> Terms:
    """Terms of a fit, values (1, n): with or without its effects, with or without each sweep's own deviation."""
    model = one.model if effects else Model(one.model.problem, (), one.model.scatter)
    k = len(one.model.problem.simulation.names)
    x = one.y[: one.model.size] if effects else np.where(_replaced(one, k), 0.0, one.y[:k])
    z = one.y[one.model.size :] * float(deviations)
    return deviated(model.terms(x[np.newaxis]), one.model.problem.rows, z[np.newaxis], one.model.scatter)


def _replaced(one: Fit, k: int) -> FloatArray:
    """Variables of the simulation that an effect took the place of."""
    names = one.model.problem.simulation.names[:k]
    return np.array([any(part.form.replaces == name for part in one.model.parts) for name in names])
