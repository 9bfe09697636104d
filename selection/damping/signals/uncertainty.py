"""Standard uncertainties of the readings through the chain, to first order, into those of the record.

Every row of a record comes from one row of the raw table. Each stated uncertainty is therefore carried by moving its
column, in all rows at once, a small part of the uncertainty up and down, and running the whole chain again: a central
difference of the record, so that a force that is in a reading per unit of force, in the corrections and in the modal
force counts in all three. Contributions of independent readings add as squares (JCGM 100:2008, Eq. 10).

Included are those of force, sensors and phase as they are stated row by row. Mode factors, masses, frequencies, the
angle of the planes, known corrections and R^2/I (held at the value identified) are taken as exact: their errors are
common to all rows, and a record has no place for such. Where amplitude or phase have been corrected, their errors are
correlated, which a record does not say either. Near a point without a damping factor (Eq. 3.2.15) first order is poor.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.signals.chain import ConditioningStep, condition
from damping.signals.description import Description

#: Part of an uncertainty by which a column is moved: errors of the difference are of the square of it.
_PART = 1e-3


def condition_steps(raw: pd.DataFrame, description: Description) -> tuple[ConditioningStep, ...]:
    """All steps of a test with the uncertainties that the raw table states; the last one's ``after`` is the record."""
    return with_uncertainties(condition(raw, description), raw, description)


def with_uncertainties(
    steps: tuple[ConditioningStep, ...], raw: pd.DataFrame, description: Description
) -> tuple[ConditioningStep, ...]:
    """The steps with one more, that adds ``NAME_sd`` to the record; unchanged where no uncertainty is stated.

    ``force_sd``, ``amplitude_sd`` and ``phase_sd`` are there where the uncertainty of that reading is stated, and 0
    (none) in rows in which it is stated as 0; ``energy_sd`` and ``xi_sd`` go with ``amplitude_sd``.

    Args:
        steps: of ``condition(raw, description)``. raw: the raw table, uncertainties >= 0.

    Raises:
        AnalysisError: a damping factor that is lost as soon as a reading is moved.
    """
    stated = description.uncertainties
    if not stated:
        return steps
    record = steps[-1].after
    held = _with_r2_over_i_held(description, steps)
    owners = {name: column for name, column in _owners(description) if column in stated and name in record}
    squares = {name: np.zeros(len(record)) for name in owners}
    for column, sd in stated.items():
        step = _PART * raw[sd]
        up, down = (condition(raw.assign(**{column: raw[column] + sign * step}), held)[-1].after for sign in (1, -1))
        for name in owners:
            squares[name] += (_difference(name, record, up, down) / (2.0 * _PART)) ** 2
    given = {
        f"{name}_sd": np.where(raw.loc[record.index, stated[column]] > 0.0, np.sqrt(squares[name]), 0.0)
        for name, column in owners.items()
    }
    after = record.assign(**given)
    return (*steps, ConditioningStep("uncertainties", "first order", record, after, pd.DataFrame(index=record.index)))


def _owners(description: Description) -> Iterator[tuple[str, str | None]]:
    """Columns of the record with the raw column that they stand for."""
    node = next(sensor.column for sensor in description.sensors if sensor.name == description.node.sensor)
    yield "force", description.raw.force
    yield "phase", description.node.phase
    for name in ("amplitude", "energy", "xi"):
        yield name, node


def _with_r2_over_i_held(description: Description, steps: tuple[ConditioningStep, ...]) -> Description:
    found = next((step.constants["r2_over_i"] for step in steps if "r2_over_i" in step.constants), None)
    if description.rigid_body is None or found is None:
        return description
    rigid = description.rigid_body.model_copy(update={"r2_over_i": found, "identify_from": None})
    return description.model_copy(update={"rigid_body": rigid})


def _difference(name: str, record: pd.DataFrame, up: pd.DataFrame, down: pd.DataFrame) -> FloatArray:
    """Change from down to up, (rows,); twice that of one side where the other side has no damping factor."""
    middle = record[name].to_numpy(float)
    above, below = (table[name].reindex(record.index).to_numpy(float) for table in (up, down))
    above, below = (np.where(np.isnan(a), 2.0 * middle - b, a) for a, b in ((above, below), (below, above)))
    change = above - below
    if np.isnan(change).any():
        row = int(np.isnan(change).argmax()) + 1
        raise AnalysisError(f"row {row} of the record loses its damping factor as soon as a reading is moved")
    return (change + np.pi) % (2.0 * np.pi) - np.pi if name == "phase" else change
