"""Records and modes from one consistent system of units to another: SI (N, m, kg) or US (lbf, in, lbf s^2/in)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import pandas as pd

from selection.errors import AnalysisError, InputError
from selection.records.imports.quantity import SYSTEMS, unit
from selection.records.mode import Mode, Units
from selection.records.record import Record

#: Powers of (force, length) of the columns of a record; all times are in s. Other columns stay as they are.
_COLUMNS = {
    "force": (1, 0),
    "force_sd": (1, 0),
    "amplitude": (0, 1),
    "amplitude_sd": (0, 1),
    "energy": (1, 1),
    "mass": (1, -1),
}
_WITHOUT_UNIT = ("sweep", "frequency", "phase", "phase_sd", "time", "damping_ratio")
#: Powers of force and length of the coefficient of each damping force (Table 2.I), without its exponent.
_COEFFICIENTS: dict[str, tuple[float, float]] = {
    "viscous": (1, -1),
    "displacement": (1, -1),
    "velocity-squared": (1, -2),
    "displacement-velocity": (1, -2),
    "quadratic-displacement": (1, -3),
    "coulomb": (1, 0),
}
_CUBIC = ("stiffness-hardening", "stiffness-softening")


@dataclass(frozen=True)
class Factors:
    """What a number in the old system is multiplied by, for one unit of force and one of length."""

    force: float
    length: float

    def of(self, force: float, length: float) -> float:
        """Factor of a quantity with these powers of force and length."""
        return self.force**force * self.length**length


def factors(units: Units, to: str, *, source: str) -> Factors:
    """Factors from the named units to a system of ``SYSTEMS``.

    Raises:
        InputError: units that are not named or not understood, a time that is not in s, or no such system.
    """
    if to not in SYSTEMS:
        raise InputError(f"--units {to!r} is unknown", expected=" or ".join(SYSTEMS))
    for what, name in (("force", units.force), ("length", units.length)):
        if not name:
            raise InputError(f"the unit of {what} is not known", file=source, expected="[units] of a mode, or --from")
    if units.time not in ("", "s", "sec"):
        raise InputError(f"time in {units.time!r}", file=source, expected="s")
    old = unit(units.force, what="unit of force"), unit(units.length, what="unit of length")
    if old[0].powers != (1, 0, 0) or old[1].powers != (0, 1, 0):
        raise InputError(f"{units.force} and {units.length} are no units of force and length", file=source)
    new = tuple(unit(name).factor for name in SYSTEMS[to])
    return Factors(old[0].factor / new[0], old[1].factor / new[1])


def convert_record(record: Record, by: Factors) -> tuple[Record, list[str]]:
    """The record in the new system, and notes on columns whose unit is not known."""
    table = record.table.copy()
    for name, powers in _COLUMNS.items():
        if name in table:
            table[name] = table[name] * by.of(*powers)
    kept = [name for name in table if name not in _COLUMNS and name not in _WITHOUT_UNIT]
    notes = [f"column {name} is kept as it is: its unit is not known" for name in kept]
    return Record(table, record.source), notes


def convert_loads(table: pd.DataFrame, by: Factors) -> pd.DataFrame:
    """Predictions (a row for each design force and law) in the new system: force, and amplitudes."""
    changed = {name: table[name] * by.of(0, 1) for name in ("median", "low", "high", "linear")}
    return table.assign(force=table["force"] * by.of(1, 0), **changed)


def convert_mode(mode: Mode, by: Factors, to: str) -> Mode:
    """The mode in the new system, its damping coefficients with it.

    Raises:
        AnalysisError: an effect whose parameters have units that are not known.
    """
    other = next((name for name in mode.effects if name not in _CUBIC), None)
    if other is not None:
        raise AnalysisError(f"{mode.source}: the units of effect {other!r} are not known, so it cannot be converted")
    force, length = SYSTEMS[to]
    damping = {name: _damping(name, parameters, by) for name, parameters in mode.damping.items()}
    effects = {
        name: {key: value * by.of(1, -3) for key, value in parameters.items()}
        for name, parameters in mode.effects.items()
    }
    return replace(
        mode, mass=mode.mass * by.of(1, -1), units=Units(force, length, "s"), damping=damping, effects=effects
    )


def _damping(name: str, parameters: Mapping[str, float], by: Factors) -> dict[str, float]:
    """Parameters of one force."""
    if name == "slip":
        return {"stiffness": parameters["stiffness"] * by.of(1, -1), "limit": parameters["limit"] * by.of(0, 1)}
    powers = _COEFFICIENTS.get(name)
    if powers is None:  # a power p of velocity, times displacement in the second law
        p = parameters["exponent"]
        powers = (1.0, -p if name == "velocity-power" else -1.0 - p)
    return {**parameters, "coefficient": parameters["coefficient"] * by.of(*powers)}
