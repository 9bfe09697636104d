"""What a record and a mode file may hold: column names, force and effect names, and the range of every number."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from math import pi
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandera.pandas as pa

#: Columns without which a table is no record; ``sweep`` is text, the others are numbers.
REQUIRED_COLUMNS = ("sweep", "force", "frequency", "amplitude")
#: Columns of a record with a meaning that may be absent.
OPTIONAL_COLUMNS = ("phase", "energy", "mass", "amplitude_sd", "phase_sd", "force_sd")
#: Columns of a record that hold text.
TEXT_COLUMNS = ("sweep",)
#: Columns of a record in which a cell may be empty: a row without ``mass`` has the mass of the mode file.
BLANK_COLUMNS = ("mass",)

#: Magnitudes that a number (other than zero) of a record or mode may have: products and powers of a few stay finite.
SMALLEST, LARGEST = 1e-50, 1e50

#: Least value of force parameters by name, and whether that value itself is allowed; of those not listed.
PARAMETER_RANGES: dict[str, tuple[float, bool]] = {
    "coefficient": (0.0, True),
    "exponent": (0.0, False),
    "stiffness": (0.0, True),
    "limit": (0.0, False),
}
ANY_PARAMETER = (0.0, True)

#: The catalogue of effects, a line each (``selection/gap/effects`` has their files): what a model file may carry in
#: ``[effects.NAME]`` and what a gap may be called, in this order.
EFFECT_NAMES: tuple[str, ...] = (
    "viscous-coefficient",
    "displacement",
    "velocity-squared",
    "displacement-velocity",
    "quadratic-displacement",
    "coulomb-friction",
    "slip",
    "stiffness-hardening",
    "stiffness-softening",
    "natural-frequency",
    "planar-coupling",
    "residual-modes",
    "amplitude-scale",
    "phase-lag",
    "force-dropout",
)


def nearest(name: str, known: Iterable[str], *, likeness: float = 0.0) -> str | None:
    """The known name most like ``name``, None where none is alike by at least ``likeness`` (0 to 1)."""
    return next(iter(difflib.get_close_matches(name, list(known), n=1, cutoff=likeness)), None)


def record_schema() -> pa.DataFrameSchema:
    """Ranges of a record's columns; each check's ``error`` says what was expected.

    Standard uncertainties may be zero: none is stated for that row. Empty cells (NaN) pass: whether a cell may be empty
    is decided where the file is read.
    """
    import pandera.pandas as pa  # noqa: PLC0415 - takes half a second and only reading a record needs it

    magnitude = pa.Check(
        lambda values: (values <= 0.0) | values.between(SMALLEST, LARGEST),  # what is no number > 0 has its own check
        error=f"a magnitude of {SMALLEST:g} to {LARGEST:g}",
    )

    def positive(meaning: str, *, required: bool = False) -> pa.Column:
        checks = [pa.Check.gt(0.0, error=f"{meaning} > 0"), magnitude]
        return pa.Column(checks=checks, nullable=True, required=required)

    def uncertainty() -> pa.Column:
        checks = [pa.Check.ge(0.0, error="a standard uncertainty >= 0"), magnitude]
        return pa.Column(checks=checks, nullable=True, required=False)

    radians = pa.Check.in_range(-2.0 * pi, 2.0 * pi, error="radians within -2 pi..2 pi (phases in degrees?)")
    return pa.DataFrameSchema(
        {
            "force": positive("a force amplitude", required=True),
            "frequency": positive("a frequency in Hz", required=True),
            "amplitude": positive("a displacement amplitude", required=True),
            "phase": pa.Column(checks=radians, nullable=True, required=False),
            "energy": positive("an energy per cycle"),
            "mass": positive("a generalized mass"),
            "amplitude_sd": uncertainty(),
            "phase_sd": uncertainty(),
            "force_sd": uncertainty(),
        }
    )
