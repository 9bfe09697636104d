"""Time histories as a file has them, to motion in one system of units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selection.arrays import FloatArray
from selection.errors import InputError
from selection.records.imports.conversion import conversion
from selection.records.imports.series import Series, Stated
from selection.records.imports.summary import Summary


@dataclass(frozen=True)
class TimeHistory:
    """A motion against time: ``t`` (n,) in s, ``signal`` (n,) the ``order``-th time derivative of displacement."""

    label: str
    t: FloatArray
    signal: FloatArray
    order: int


def time_histories(series: Sequence[Series], stated: Stated, file: str | Path, summary: Summary) -> list[TimeHistory]:
    """The motions of some series.

    Raises:
        InputError: a series that is no time history of a motion, values that are no numbers, or a type or unit that
            neither the file nor the user says.
    """
    if stated.labels and len(stated.labels) != len(series):
        raise InputError(f"{len(stated.labels)} labels", file=file, expected=f"{len(series)}, one a time history")
    histories = []
    for k, one in enumerate(series):
        if not one.is_time:
            raise InputError(f"{one.label!r} is no time history", file=file, expected="a signal against time")
        to = conversion(one.found, stated, str(file), summary)
        if to.per_force:
            raise InputError("a time history is no ratio to force", file=file, expected="--response acceleration")
        if not (np.isfinite(one.abscissa).all() and np.isfinite(one.response).all()):
            raise InputError(f"{one.label!r} holds values that are no numbers", file=file, expected="finite numbers")
        signal = np.asarray(one.response, dtype=np.float64) * to.response
        label = stated.labels[k] if stated.labels else one.label
        histories.append(TimeHistory(label, np.asarray(one.abscissa, dtype=np.float64), signal, to.order))
    return histories
