"""Make the records of the examples: ``python examples/generate.py`` (about two minutes).

Each ``truth.toml`` is integrated in time to its steady state at every force and frequency of its plan, and read by
an imperfect rig: 1 per cent of amplitude and 0.015 rad of phase from row to row, 1 per cent of amplitude from level
to level. The two-plane mode is two oscillators, one in each principal plane, driven and read along one direction
between them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.forces import Force, from_damping
from damping.predict.integrate import sweep_in_time
from damping.records.mode import Mode, read_mode
from damping.records.record import record_to_csv
from damping_pipelines.store import write_text

FOLDER = Path(__file__).parent
#: Relative scatter of amplitude from row to row and from level to level, and scatter of phase, rad.
ROW = 0.01
LEVEL = 0.01
PHASE = 0.015
#: Phasors q of one sweep over frequencies, Hz, at a force.
Phasors = Callable[[Mode, float, FloatArray], FloatArray]


@dataclass(frozen=True)
class Plan:
    """Forces and frequencies (Hz) of a test, how the structure answers, and the seed of the rig."""

    forces: tuple[float, ...]
    frequencies: FloatArray
    phasors: Phasors
    seed: int


def one_plane(mode: Mode, F: float, hertz: FloatArray) -> FloatArray:
    """A exp(-i phase) of one mode."""
    return _phasors(from_damping(mode.damping), F, hertz, mode.mass, mode.omega_n)


def two_planes(mode: Mode, F: float, hertz: FloatArray, angle: float, ratio: float) -> FloatArray:
    """Driven and read at ``angle`` (rad) to the first plane; the second has ``ratio`` of its frequency.

    The planes take F cos(angle) and F sin(angle), and their motions add in the direction of the drive.
    """
    damping = from_damping(mode.damping)
    planes = ((np.cos(angle), mode.omega_n), (np.sin(angle), ratio * mode.omega_n))
    return sum(share * _phasors(damping, F * share, hertz, mode.mass, omega_n) for share, omega_n in planes)


def _phasors(damping: Force, F: float, hertz: FloatArray, mass: float, omega_n: float) -> FloatArray:
    states = sweep_in_time(damping, F, RAD_S_PER_HZ * hertz, mass, omega_n, "up")
    return np.array([state.amplitude * np.exp(-1j * state.phase) for state in states])


PLANS = {
    "bolted-joint": Plan((6.0, 10.0, 16.0, 24.0), np.linspace(17.45, 18.05, 13), one_plane, 1),
    "tank": Plan((2.0, 4.0, 8.0, 12.0), np.linspace(0.782, 0.818, 13), one_plane, 2),
    "two-plane-mode": Plan(
        (10.0, 20.0, 40.0), np.linspace(5.7, 6.4, 29), partial(two_planes, angle=np.radians(25.0), ratio=1.025), 3
    ),
}


def record(name: str, forces: Iterable[float] | None = None, frequencies: FloatArray | None = None) -> pd.DataFrame:
    """The record of an example; with other forces or frequencies a shorter one, without the rig's imperfection."""
    plan, mode = PLANS[name], read_mode(FOLDER / name / "truth.toml")
    hertz = plan.frequencies if frequencies is None else frequencies
    rig = np.random.default_rng(plan.seed)
    tables = []
    for label, F in zip("ABCDEFGH", plan.forces if forces is None else forces, strict=False):
        q = plan.phasors(mode, F, hertz)
        if frequencies is None:
            gain = np.exp(LEVEL * rig.standard_normal() + ROW * rig.standard_normal(hertz.size))
            q = q * gain * np.exp(1j * PHASE * rig.standard_normal(hertz.size))
        columns = {"sweep": label, "force": F, "frequency": hertz, "amplitude": np.abs(q), "phase": -np.angle(q)}
        tables.append(pd.DataFrame(columns))
    table = pd.concat(tables, ignore_index=True)
    return table.round({"frequency": 4, "phase": 4}).assign(amplitude=[float(f"{A:.5g}") for A in table["amplitude"]])


def main() -> None:
    """Write every record, or those of the examples named."""
    for name in sys.argv[1:] or PLANS:
        write_text(FOLDER / name / "record.csv", record_to_csv(record(name)))


if __name__ == "__main__":
    main()
