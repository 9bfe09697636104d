"""One linear mode measured in every way that a file may hold it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import pyuff

from damping.formats import read_file
from damping.formats.series import Stated, Summary
from damping.formats.steady import steady_record
from damping.records.record import Record


@dataclass(frozen=True)
class Truth:
    """What a record of the mode holds at force ``F``: frequencies f, receptance H, amplitude, lag."""

    f: np.ndarray
    H: np.ndarray
    F: float

    @property
    def amplitude(self) -> np.ndarray:
        return np.abs(self.H) * self.F

    @property
    def lag(self) -> np.ndarray:
        return -np.angle(self.H)


@pytest.fixture(scope="session")
def truth() -> Truth:
    """M = 2 kg, 10 Hz, 2 % of critical damping, driven by 3 N; closed form of the receptance."""
    M, omega_n, zeta = 2.0, 2 * np.pi * 10.0, 0.02
    f = np.linspace(8.0, 12.0, 41)
    w = 2 * np.pi * f
    return Truth(f, 1.0 / (M * (omega_n**2 - w**2 + 2j * zeta * omega_n * w)), 3.0)


class Imported(NamedTuple):
    """A record and what was understood on the way."""

    record: Record
    summary: Summary


@pytest.fixture
def imported() -> Callable[..., Imported]:
    """``imported(path, **stated)``: the record of a file."""

    def run(path: Path, **stated: object) -> Imported:
        said = Stated(**stated)
        series, summary = read_file(path, said)
        return Imported(steady_record(series, said, path, summary), summary)

    return run


@pytest.fixture
def by_pyuff(tmp_path: Path) -> Callable[..., Path]:
    """Writes data sets with pyuff: ``by_pyuff({...}, {...}, force_double=True)`` gives the path."""

    def write(*sets: dict[str, object], name: str = "file.uff", force_double: bool = True) -> Path:
        path = tmp_path / name
        writer = pyuff.UFF(str(path))
        writer.write_sets([frf_set() | one for one in sets], "add", force_double=force_double)
        return path

    return write


def frf_set() -> dict[str, object]:
    """A data set 58 as pyuff takes it: accelerance in (m/s^2)/N, text, even spacing."""
    return {
        "type": 58,
        "binary": 0,
        "func_type": 4,
        "id1": "level 1",
        "rsp_node": 1,
        "rsp_dir": 3,
        "ref_node": 1,
        "ref_dir": 3,
        "abscissa_spacing": 1,
        "abscissa_spec_data_type": 18,
        "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz",
        "ordinate_spec_data_type": 12,
        "ordinate_axis_lab": "Acceleration",
        "ordinate_axis_units_lab": "m/s^2",
        "orddenom_spec_data_type": 13,
        "orddenom_axis_lab": "Force",
        "orddenom_axis_units_lab": "N",
    }
