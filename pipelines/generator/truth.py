"""The noise-free record of a true structure and rig, integrated in time to the steady state."""

from __future__ import annotations

from pipelines.generator.laws import Array
from pipelines.generator.refit import guess
from pipelines.generator.steady import steady
from pipelines.generator.structure import Complex, Rows, Structure, recorded


def guesses(structure: Structure, rows: Rows) -> tuple[Complex, Complex]:
    """Where the shooting starts: on the branch that the sweep follows, then on the other one."""
    return guess(structure, rows), guess(structure, rows, other=True)


def true_record(structure: Structure, rows: Rows) -> tuple[Array, Array]:
    """Amplitude and lag, without noise. NoSteadyStateError where no stable steady state is found."""
    return recorded(steady(structure, rows, guesses(structure, rows)), rows)
