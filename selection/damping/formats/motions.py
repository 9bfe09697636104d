"""Time histories of motions in one system of units, and where a force drives them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.conversion import SCALINGS, Statements, ask, conversion
from damping.formats.series import Series, Stated, Summary, require_finite

#: Largest rms of a force after a blow or release, over its peak: noise of a sensor has some 1 %, a random force 20 to
#: 30 %, a sine or a chirp 70 %.
DRIVEN = 0.1


@dataclass(frozen=True)
class TimeHistory:
    """A motion against time: ``t`` (n,) in s, ``signal`` (n,) the ``order``-th time derivative of displacement.

    ``force`` (n,) in the unit of the file, None if it has none.
    """

    label: str
    t: FloatArray
    signal: FloatArray
    order: int
    force: FloatArray | None = None

    def is_driven(self, start: float, end: float) -> bool:
        """Whether a force acts in a part of the time, s: its rms is more than ``DRIVEN`` of its largest value."""
        if self.force is None:
            return False
        part = self.force[(self.t >= start) & (self.t <= end) & np.isfinite(self.force)]
        rest = np.median(part) if len(part) else 0.0  # a load that is held is no drive
        largest = float(np.nanmax(np.abs(self.force - rest)))
        return bool(len(part)) and float(np.sqrt(np.mean((part - rest) ** 2))) > DRIVEN * largest

    def list_free(self, least: float) -> list[tuple[float, float]]:
        """Start and end, s, of every part that no force drives for ``least`` s after one did; empty without a force.

        A force acts where it is more than ``DRIVEN`` of its largest value away from that at the end of the record.
        """
        if self.force is None:
            return []
        size = np.abs(self.force - np.nanmedian(self.force[-(len(self.force) // 10 + 1) :]))
        acts = np.flatnonzero(~(size <= DRIVEN * np.nanmax(size)))
        starts = self.t[np.minimum(acts + 1, len(size) - 1)]
        ends = self.t[np.append(acts[1:], len(size))[: len(acts)] - 1]
        return [(float(a), float(b)) for a, b in np.column_stack([starts, ends])[ends - starts >= least]]


def time_histories(series: Sequence[Series], stated: Stated, summary: Summary) -> list[TimeHistory]:
    """The motions of some series.

    InputError: a series that is not a time history of a motion, values that are not finite, or a type or unit that is
    neither in the file nor stated.
    """
    if stated.labels and len(stated.labels) != len(series):
        raise InputError(f"{len(stated.labels)} labels", expected=f"{len(series)}, one for each time history")
    histories = []
    for k, row in enumerate(series):
        known = Statements(row.facts, stated, summary)
        if not row.is_time:
            raise InputError(f"{row.label!r} is no time history", expected="a signal against time")
        ask(known, force=None)
        to = conversion(known)
        if to.per_force:
            raise InputError("a time history is no ratio to force", expected="--response acceleration")
        for values in (row.abscissa, row.response):
            require_finite(row.label, values)
        signal = np.asarray(row.response, dtype=np.float64)
        _warn_of_scaling(row, known)
        signal = signal if to.response == 1.0 else signal * to.response  # of a large file, without a copy
        label = stated.labels[k] if stated.labels else row.label
        force = None if row.force is None else np.asarray(row.force, dtype=np.float64)
        histories.append(TimeHistory(label, np.asarray(row.abscissa, dtype=np.float64), signal, to.order, force))
    return histories


def _warn_of_scaling(row: Series, known: Statements) -> None:
    """Add a caution where the file says that samples are rms or peak-to-peak, if no factor is stated.

    InputError: values that are never negative: they are no motion.
    """
    scaling = known.facts.scaling
    if scaling in (None, "peak"):
        return
    if np.min(row.response, initial=0.0) >= 0.0:
        raise InputError(f"{row.label!r} holds {scaling} values against time", expected="the motion itself")
    if "response" not in known.stated.scale:
        factor = f"--scale response={SCALINGS[scaling]:.4g}"
        said = f"the file says {scaling}, of which a motion against time has none: its values are taken as they are"
        known.summary.note(f"caution: {said} ({factor} if they are too small or large by it, else response=1)")
