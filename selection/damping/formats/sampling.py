"""Names of arrays that state how another array was sampled: abscissas, rates, steps and increments, by nearness."""

from collections.abc import Mapping, Sequence
from itertools import takewhile
from math import ceil, floor, prod
from operator import eq
from typing import TypeAlias

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.headers import ABSCISSAS, NAMES, ROLE_NAMES, lower_name

Shapes: TypeAlias = Mapping[str, tuple[int, ...]]  #: shape of every array in a file by name
#: Names of numbers that say how a time history was sampled.
SAMPLING = [name for key in ("rate", "step", "increment") for name in NAMES["rate"][key]]


def last_name(path: str) -> str:
    """The name of an array in lower case, without its groups or structures."""
    return split(path)[-1].lower()


def split(path: str) -> list[str]:
    """Groups or structures of an array, and its own name; a point is part of the name of a group: ``run_0.3g/acc``."""
    return path.split("/" if "/" in path else ".")


def find_abscissa(known: Shapes, main: str) -> dict[str, str]:
    """The first array named like a frequency or a time in laboratory tables, beside the response or in no group."""
    beside = [name for name in known if split(name)[:-1] in ([], split(main)[:-1])]
    several = [name for name in beside if prod(known[name]) > 1]
    several.sort(key=lambda name: len(split(name)), reverse=True)
    named = ((role, name) for role in ABSCISSAS for name in several if lower_name(split(name)[-1]) in ROLE_NAMES[role])
    role, name = next(named, ("", ""))
    return {role: name} if role else {}


def find_nearest(names: Sequence[str], to: str) -> str | None:
    """The name that shares most groups or structures with another; None if there is none.

    InputError: several equally near in different groups.
    """
    shared = {name: sum(takewhile(bool, map(eq, split(name)[:-1], split(to)))) for name in names}
    near = [name for name in names if shared[name] == max(shared.values())]
    if len({tuple(split(name)[:-1]) for name in near}) > 1:
        raise InputError(f"several sampling rates: {', '.join(near[:4])}", expected="--rate HZ, or --column time=NAME")
    return near[0] if near else None


def find_rows(span: tuple[float, float], start: float, step: float, n: float) -> tuple[int, int]:
    """First sample and end (exclusive) of the samples, of ``n``, in a ``span``, s; all if it holds fewer than two."""
    first, last = (min(max((time - start) / step, 0.0), n) for time in span)
    return (max(floor(first) - 1, 0), ceil(min(last + 2.0, n))) if last - first >= 2.0 else (0, int(n))


def list_times(name: str, number: float, n: int, first: int) -> FloatArray:
    """Times (n,) from that of sample ``first``, in s, from a rate in Hz or a step in s; that of sample 0 is 0.

    InputError: a number that is not > 0.
    """
    if not (np.isfinite(number) and number > 0.0):
        raise InputError(f"{name} = {number:g}", expected="a rate in Hz, or a step in s, > 0")
    step = 1.0 / number if last_name(name) in NAMES["rate"]["rate"] else number
    return np.asarray(step * np.arange(first, first + n), dtype=np.float64)
