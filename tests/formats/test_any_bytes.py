"""Any bytes give series or one line of error, whatever the format is taken to be."""

from __future__ import annotations

import contextlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from damping.errors import InputError
from damping.formats import read_file
from damping.formats.series import Stated
from damping.formats.steady import steady_record

HEADER = (
    "    -1\n{kind}\nt\nNONE\nNONE\nNONE\nNONE\n"
    "    4         0    0         0 NONE               1   3 NONE               1   3\n"
    "{form}\n        18    0    0    0 F                    Hz\n        12    0    0    0 A                    m/s^2\n"
    "        13    0    0    0 F                    N\n         0    0    0    0\n"
)
FORM = "{ordinate:10d}{points:10d}{spacing:10d}  1.00000E+00  1.00000E+00  0.00000E+00"
TEXT = HEADER.format(kind="    58", form=FORM.format(ordinate=5, points=3, spacing=1))
BYTES = HEADER.format(
    kind="    58b     1     2          11          48     0     0           0           0",
    form=FORM.format(ordinate=6, points=3, spacing=1),
)
SEEDS = (
    (TEXT + "  1.00000E+00  2.00000E+00  3.00000E+00  4.00000E+00  5.00000E+00  6.00000E+00\n    -1\n").encode(),
    BYTES.encode() + np.arange(6.0).tobytes() + b"    -1\n",
    b"    -1\n   164\n         1units                       2\n  1.0D+00\n    -1\n",
    b"sweep,frequency [Hz],amplitude [mm],lag_deg,force [N]\na,1,2.5,10,3\na,2,2.6,20,3\n",
    b"frequency,x,y,force\n1,0.5,-0.5,2\n2,0.25,-1e-3,2\n",
)
STATED = Stated(response="accelerance", units={"response": "m/s^2/N", "force": "N"}, forces=(1.0,), scaling="rms")


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A valid file with a few bytes, lines or numbers changed, cut off, or several put together."""
    data = bytearray(b"".join(draw(st.lists(st.sampled_from(SEEDS), min_size=1, max_size=3))))
    for _ in range(draw(st.integers(0, 6))):
        place = draw(st.integers(0, max(len(data) - 1, 0)))
        change = draw(st.sampled_from(("byte", "text", "cut", "line")))
        if change == "byte":
            data[place : place + 1] = draw(st.binary(min_size=1, max_size=2))
        elif change == "text":
            data[place : place + 4] = draw(
                st.sampled_from((b"-1", b"58b", b"1e999", b"nan", b"\n", b" ", b"999999999", b"0"))
            )
        elif change == "cut":
            del data[place:]
        else:
            end = data.find(b"\n", place) + 1
            data[end:end] = data[place:end]
    return bytes(data)


def tried(path: Path, data: bytes, kind: str) -> None:
    """Read and convert; an InputError is an answer, anything else a mistake of ours."""
    path.write_bytes(data)
    for stated in (Stated(format=kind), STATED):
        with contextlib.suppress(InputError):
            series, summary = read_file(path, stated)
            record = steady_record(series, stated, path, summary)
            assert np.isfinite(record.column("amplitude")).all()


@pytest.mark.parametrize("kind", ["auto", "uff", "csv", "lock-in"])
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.one_of(st.binary(max_size=300), damaged()))
def test_bytes_as_text_formats(tmp_path: Path, kind: str, data: bytes):
    tried(tmp_path / "file", data, kind)


def mat_and_hdf5(folder: Path) -> list[bytes]:
    """A MAT file, packed and not, and an HDF5 file."""
    scipy.io.savemat(folder / "a.mat", {"frequency": np.arange(1.0, 9.0), "response": np.exp(1j * np.arange(8.0))})
    scipy.io.savemat(folder / "b.mat", {"frequency": np.arange(1.0, 9.0)}, do_compression=True)
    with h5py.File(folder / "c.h5", "w") as file:
        file["frequency"] = np.arange(1.0, 9.0)
        file.create_dataset("response", data=np.exp(1j * np.arange(8.0)), compression="gzip", chunks=(4,))
    return [(folder / name).read_bytes() for name in ("a.mat", "b.mat", "c.h5")]


@pytest.mark.parametrize("seed", range(9))
def test_bytes_as_arrays(tmp_path: Path, seed: int):
    """Each starts a process, so there are few here; the fuzzer tries thousands."""
    random = np.random.default_rng(seed)
    data = bytearray(mat_and_hdf5(tmp_path)[seed % 3])
    for place in random.integers(0, len(data), 1 + seed // 3 * 3):
        data[place] = random.integers(256)
    (tmp_path / "damaged").write_bytes(data)
    with contextlib.suppress(InputError):
        read_file(tmp_path / "damaged", STATED)
