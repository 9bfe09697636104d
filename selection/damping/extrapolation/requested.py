"""Forces or amplitudes for which a prediction is requested, and the content of its bands, checked before any work."""

from collections.abc import Sequence

import numpy as np

from damping.arrays import FloatArray, Numbers, is_number, to_python
from damping.errors import InputError
from damping.records.keys import LARGEST, SMALLEST

#: Names of the quantities in messages.
_AMPLITUDES = {"force": "a force amplitude", "amplitude": "an amplitude"}


def check_loads(forces: Sequence[float] | np.ndarray, level: float, what: str = "force") -> np.ndarray:
    """The forces (or amplitudes, as named by ``what``) as an array (forces,).

    InputError: no force, a force that is not a number from ``SMALLEST`` to ``LARGEST``, or a level not within 0 and 1.
    """
    if _count_axes(forces) != 1 or len(forces) == 0:
        raise InputError(f"no list of {what}s", expected=f"{_AMPLITUDES[what]} > 0, or several")
    for given in forces:
        force = to_python(given)  # in single precision the bounds overflow
        if not (is_number(force) and SMALLEST <= force <= LARGEST):
            beyond = f", of a magnitude of {SMALLEST:g} to {LARGEST:g}" if is_number(force) and force > 0.0 else ""
            raise InputError(f"{what} {_quote(force)}", expected=f"{_AMPLITUDES[what]} > 0{beyond}")
    _check_level(level)
    return np.array(forces, dtype=float)


def list_asked(values: Numbers, what: str, level: float) -> FloatArray:
    """Any number of forces or amplitudes, as named by ``what``, or a single one; InputError as `check_loads`."""
    _check_level(level)
    values = to_python(values)
    values = [values] if isinstance(values, int | float | np.number) else values
    return check_loads(values, level, what) if _count_axes(values) != 1 or len(values) else np.empty(0)


def _count_axes(values: Numbers) -> int:
    try:
        return np.ndim(values)
    except ValueError:  # lists of unlike lengths
        return 2


def _check_level(level: float) -> None:
    if not (is_number(level) and 0.0 < level < 1.0):
        raise InputError(f"level {_quote(level)}", expected="a probability between 0 and 1, such as 0.9")


def _quote(value: object) -> str:
    """The value in a message; what is no number as it is written, as "5" in quotes."""
    return f"{value}" if is_number(value) else repr(value)
