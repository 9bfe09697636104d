"""Candidate tests: what rows they would measure, and what they change in structure or instruments."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from selection.arrays import FloatArray
from selection.gap.model import Problem
from selection.gap.rows import Rows
from selection.gap.terms import Terms

#: Rows of a sweep that does not repeat a measured one.
_ROWS = 40
#: Mass added for the second state, as a share of the modal mass.
ADDED_MASS = 0.2


@dataclass(frozen=True)
class Design:
    """A test that could be made next: what it is, why it tells, its rows (amplitudes yet unknown).

    ``change`` is what it does to the terms of any hypothesis. ``downwards``: rows are met from the top frequency down.
    """

    what: str
    why: str
    rows: Rows
    change: Callable[[Terms], Terms] = lambda terms: terms
    downwards: bool = False


def designs(problem: Problem) -> Iterator[Design]:
    """All tests that can be simulated row by row."""
    rows, scales = problem.rows, problem.scales
    top = highest_sweep(rows)
    low = rows.where(rows.sweep == np.flatnonzero(rows.level == rows.level.min())[0])
    yield Design("a sweep at twice the highest force", "effects grow apart with amplitude", _at(top, 2.0))
    yield Design("a sweep at half the lowest force", "effects part where amplitudes are small", _at(low, 0.5))
    band = np.linspace(-2.0, 2.0, _ROWS) * scales.reach
    yield Design(
        "a sweep of twice the band at the highest force",
        "other paths and other powers of frequency show far from resonance",
        _over(top, scales.omega_n * (1.0 + np.maximum(band, -0.8))),
    )
    near = scales.omega_n * (1.0 + np.linspace(-2.0, 2.0, _ROWS) * min(scales.bandwidth, scales.reach))
    yield Design("40 more points near resonance at the highest force", "damping decides there", _over(top, near))
    yield Design(
        "the highest sweep once more, downwards", "a bent resonance jumps at other places", top, downwards=True
    )
    if not rows.has_phase:
        noise = replace(rows, has_phase=True, sd_phase=rows.sd_amplitude)
        yield Design("the same sweeps with phase", "phase parts conservative from dissipative", noise)
    yield Design(
        "the highest sweep with another sensor", "errors of gain and phase stay with the sensor", top, without_sensor
    )
    heavier = _over(top, top.omega / sqrt(1.0 + ADDED_MASS))
    yield Design(
        f"a second state with a known mass of {ADDED_MASS:.0%} of the modal mass added",
        "it fixes the modal mass, and with it every factor on force and amplitude",
        heavier,
        with_mass(ADDED_MASS * scales.M),
    )


def highest_sweep(rows: Rows) -> Rows:
    """Rows of a sweep of the highest level."""
    return rows.where(rows.sweep == np.flatnonzero(rows.level == rows.level.max())[0])


def without_sensor(terms: Terms) -> Terms:
    """The terms read with a sensor that has neither the gain nor the lag of this one."""
    return replace(terms, gain=0.0 * np.asarray(terms.gain), lag=0.0 * np.asarray(terms.lag))


def with_mass(added: float) -> Callable[[Terms], Terms]:
    """The change of terms by a known mass that is added; the stiffness stays."""

    def change(terms: Terms) -> Terms:
        M = terms.M + added
        return replace(terms, M=M, omega_n=terms.omega_n * np.sqrt(terms.M / M))

    return change


def _at(rows: Rows, factor: float) -> Rows:
    """The rows at another force; amplitudes are a first guess."""
    return replace(rows, F=rows.F * factor, u=rows.u + np.log(factor))


def _over(rows: Rows, omega: FloatArray) -> Rows:
    """A sweep over other frequencies at the median force and with the median noise of rows."""
    n = len(omega)

    def middle(values: FloatArray) -> FloatArray:
        return np.full(n, float(np.median(values)))

    return Rows(
        row=np.arange(n),
        sweep=np.zeros(n, dtype=np.int64),
        sweeps=rows.sweeps[:1],
        level=rows.level[:1],
        F=middle(rows.F),
        omega=omega,
        u=np.interp(omega, rows.omega, rows.u),
        phase=np.zeros(n),
        mass=middle(rows.mass),
        sd_amplitude=middle(rows.sd_amplitude),
        sd_phase=middle(rows.sd_phase),
        has_phase=rows.has_phase,
    )
