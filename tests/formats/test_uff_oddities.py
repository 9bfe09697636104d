"""What files of other programs look like: a case for each way that users of such importers report."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from damping.errors import InputError
from damping.formats import read_file
from damping.formats.series import Series, Stated, Summary
from damping.formats.uff import read_functions

Read = Callable[..., Series]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """The only series of a file of these bytes."""

    def run(content: bytes | str, **stated: object) -> Series:
        path = tmp_path / "file.unv"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        series, _ = read_file(path, Stated(**stated))
        assert len(series) == 1
        return series[0]

    return run


def header(
    *,
    kind: str = "    58",
    title: str = "a title",
    function: int = 4,
    ordinate: int = 5,
    points: int = 3,
    spacing: int = 1,
    first: str = "  5.00000E+00",
    step: str = "  1.00000E+00",
    abscissa: str = "        18    0    0    0 Frequency            Hz",
    numerator: str = "        12    0    0    0 Acceleration         m/s^2",
    denominator: str = "        13    0    0    0 Force                N",
    directions: tuple[int, int] = (3, 3),
) -> str:
    """Lines from the opening -1 to the values."""
    along, against = directions
    lines = [
        "    -1",
        kind,
        title,
        *["NONE"] * 4,
        f"{function:5d}{0:10d}{0:5d}{0:10d} {'NONE':10s}{1:10d}{along:4d} {'NONE':10s}{1:10d}{against:4d}",
        f"{ordinate:10d}{points:10d}{spacing:10d}{first}{step}  0.00000E+00",
        abscissa,
        numerator,
        denominator,
        "         0    0    0    0 NONE                 NONE",
    ]
    return "\n".join(lines) + "\n"


SINGLE = "  1.00000E+00  2.00000E+00  3.00000E+00  4.00000E+00  5.00000E+00  6.00000E+00\n"
END = "    -1\n"
WHOLE = header() + SINGLE + END
THREE = np.array([1 + 2j, 3 + 4j, 5 + 6j])


def head_of_bytes(count: int, order: int = 1, points: int = 3, **fields: int) -> bytes:
    """Lines up to ``count`` bytes of values, of double precision if nothing else is said."""
    kind = f"    58b{order:6d}{2:6d}{11:12d}{count:12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    return header(kind=kind, points=points, **{"ordinate": 6} | fields).encode()


def test_as_the_format_says(read: Read):
    found = read(WHOLE)
    np.testing.assert_array_equal(found.abscissa, [5.0, 6.0, 7.0])
    np.testing.assert_array_equal(found.response, THREE)
    assert found.facts.response == "accelerance"
    assert dict(found.facts.units) == {"response": "m/s^2", "force": "N"}


REAL_DOUBLE = {"function": 12, "ordinate": 4}
#: Test systems write geometry, units and the coherence beside each frequency response.
NODES = "    -1\n    15\n         1         0         0         8  0.00000E+00  0.00000E+00 -1.00000E+00\n    -1\n"
COHERENCE = header(function=6, ordinate=2) + "  9.00000E-01  9.00000E-01  9.00000E-01\n" + END
FILLED = "  1.00000E+00  2.00000E+00  3.00000E+00  4.00000E+00  0.00000E+00  0.00000E+00\n"


LOOKS_LIKE_SEPARATORS = b"\n    -1\n" * 6
#: A file, and its values.
SAME = {
    "a last line filled up with zeros": (header(points=2) + FILLED + END, THREE[:2]),
    "a last line that is not full": (
        header(points=4, **REAL_DOUBLE) + "".join(f"{v:20.12E}" for v in (1, 2, 3)) + f"\n{4.0:20.12E}\n" + END,
        [1.0, 2.0, 3.0, 4.0],
    ),
    "a shorter line padded with blanks": (header(points=2) + SINGLE[:52] + " " * 26 + "\n" + END, THREE[:2]),
    "separators filled up to 80 characters": (re.sub("(?m)^    (-1|58)$", lambda at: f"{at[0]:80s}", WHOLE), THREE),
    "a title that is a separator": (header(title="    -1") + SINGLE + END, THREE),
    "a title of -1": (header(title="-1") + SINGLE + END, THREE),
    "a title that ends as a separator": (header(title="shaker at     -1") + SINGLE + END, THREE),
    "a title of two separators": (header(title="    -1    -1") + SINGLE + END, THREE),
    "line ends of Windows": (WHOLE.replace("\n", "\r\n"), THREE),
    "line ends of an old Macintosh": (WHOLE.replace("\n", "\r"), THREE),
    "exponents with D": ((header(step="  1.00000d+00") + SINGLE + END).replace("E+00", "D+00"), THREE),
    # Fortran writes 1.5E-101 as 1.50000-101
    "exponents without a letter": (header(points=1) + "  1.50000-101  2.50000+002\n" + END, [1.5e-101 + 250j]),
    # negative numbers with exponents of three digits fill all of the 13 characters
    "columns that touch": (
        header(points=2) + "-5.48363E-004-7.51019E-004-6.07967E-004-1.03712E-003\n" + END,
        [-5.48363e-4 - 7.51019e-4j, -6.07967e-4 - 1.03712e-3j],
    ),
    "columns that touch without a sign": (
        header(points=2) + "".join(f"{k}.000000E+002" for k in (1, 2, 3, 4)) + "\n" + END,
        [100 + 200j, 300 + 400j],
    ),
    "no last separator": (header() + SINGLE, THREE),
    "other data sets beside the response": (NODES + COHERENCE + WHOLE + COHERENCE, THREE),
    "bytes that read as a separator": (
        head_of_bytes(48) + LOOKS_LIKE_SEPARATORS + END.encode(),
        np.frombuffer(LOOKS_LIKE_SEPARATORS, "<c16"),
    ),
    # some writers count real values where the data are complex, or leave 0
    "no number of bytes": (head_of_bytes(0) + THREE.tobytes() + END.encode(), THREE),
    "half the number of bytes": (head_of_bytes(24) + THREE.tobytes() + END.encode(), THREE),
    "a number of bytes far too large": (head_of_bytes(999999) + THREE.tobytes() + END.encode(), THREE),
}


@pytest.mark.parametrize(("content", "expected"), SAME.values(), ids=SAME)
def test_values_are_the_same_however_programs_write_them(read: Read, content: str | bytes, expected: np.ndarray):
    np.testing.assert_array_equal(read(content).response, expected)


def test_an_abscissa_as_wide_as_the_ordinate(read: Read):
    """Real, double precision, uneven: the format has 13 characters for the abscissa, some programs write 20."""
    body = "".join(f"{x:20.12E}{y:20.12E}\n" for x, y in ((0.1, 1.0), (0.2, 2.0), (0.4, 3.0)))
    found = read(header(spacing=0, **REAL_DOUBLE) + body + END)
    np.testing.assert_array_equal(found.abscissa, [0.1, 0.2, 0.4])
    np.testing.assert_array_equal(found.response, [1.0, 2.0, 3.0])


@pytest.mark.parametrize("label", ["m/s²".encode(), "m/s²".encode("latin-1")])
def test_labels_that_are_not_ascii(read: Read, label: bytes):
    content = (header(title="Prüfstand") + SINGLE + END).encode("latin-1").replace(b"m/s^2", label)
    assert read(content).facts.units["response"] == "m/s²"


@pytest.mark.parametrize("end", [b"", b"\n", b"\r\n"])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("ordinate", [5, 6])
def test_bytes_of_either_order_with_and_without_a_line_end(read: Read, ordinate: int, order: str, end: bytes):
    """58b: the closing -1 follows the bytes at once, or after a line end that should not be there."""
    values = THREE.astype(f"{order}c{8 if ordinate == 5 else 16}").tobytes()
    head = head_of_bytes(len(values), order=1 if order == "<" else 2, ordinate=ordinate)
    found = read(head + values + end + END.encode())
    np.testing.assert_array_equal(found.response, THREE)


def test_bytes_with_an_abscissa_of_single_precision(read: Read):
    """The abscissa is of single precision in the format, of double in most files."""
    table = np.array([(1.0, 1 + 2j), (2.0, 3 + 4j), (4.0, 5 + 6j)], dtype=[("x", "<f4"), ("y", "<c16")])
    found = read(head_of_bytes(table.nbytes, spacing=0) + table.tobytes() + END.encode())
    np.testing.assert_array_equal(found.abscissa, [1.0, 2.0, 4.0])
    np.testing.assert_array_equal(found.response, THREE)


def of_form(fields: str) -> bytes:
    return header(kind=f"    58b{fields}", ordinate=6).encode() + THREE.tobytes() + END.encode()


MAGNITUDES = header(ordinate=2) + "  9.00000E-01  9.00000E-01  9.00000E-01\n" + END
STIFFNESS = {
    "numerator": "        13    0    0    0 Force                N",
    "denominator": "         8    0    0    0 X  m",
}


#: What is said, and of which file.
REFUSED = {
    "more values than the 4 of the header": header(points=2) + SINGLE + END,
    "line 2: byte order 0": of_form(f"{0:6d}{2:6d}"),
    "byte order 0; expected 1 (little endian)": of_form(""),
    "floating-point format 1": of_form(f"{1:6d}{1:6d}"),
    "4 values where the header needs 6 (the file is cut off)": header() + SINGLE[:52],
    "not followed by the end": head_of_bytes(48) + THREE.tobytes()[:40],
    "ends in the header": header()[:200],
    **{f"line 9: ordinate data type {k}; expected 2 or 4": header(ordinate=k) + SINGLE + END for k in (0, 3, 7)},
    **{f"line 9: {n} points; expected at least one": header(points=n) + SINGLE + END for n in (0, -3)},
    "fewer values; expected 2000000000": header(points=10**9) + SINGLE + END,
    "abscissa from 5 with increment 0": header(step="  0.00000E+00") + SINGLE + END,
    "line 15: a value is not a number": header(points=6) + SINGLE + SINGLE.replace("3.00000E+00", "*" * 11) + END,
    "not a number": header(points=6) + "1.0 " * 400_000 + "\n" + END,  # and no crash
    "no data set 58 (it has 151, 15)": "    -1\n   151\nmodel\n    -1\n    -1\n    15\n         1\n    -1\n",
    "a response: data set 1 is a ratio of force to displacement": header(**STIFFNESS) + SINGLE + END,
    # whose type is one that is expected
    "a response: data set 1 is a frequency response of real values": MAGNITUDES,
}


@pytest.mark.parametrize(("message", "content"), REFUSED.items(), ids=REFUSED)
def test_what_is_wrong_is_named(read: Read, message: str, content: str | bytes):
    with pytest.raises(InputError, match=re.escape(message)):
        read(content)


def test_the_line_is_that_of_the_data_set_named(read: Read):
    """The second set, of 15 lines as the first, starts at its number in line 17."""
    with pytest.raises(InputError, match=r"line 17: data set 2 is coherence"):
        read(COHERENCE * 2, datasets=(2, 1))


def test_missing_quantities_are_asked_for(read: Read, tmp_path: Path, imported):
    """Ordinate types 0 (unknown): neither the motion nor what it is divided by is in the file."""
    blank = "         0    0    0    0 NONE                 NONE"
    found = read(header(numerator=blank, denominator=blank) + SINGLE + END)
    assert found.facts.response is None
    path = tmp_path / "file.unv"
    said = "neither in the file nor stated: type of the response, unit of the response"
    with pytest.raises(InputError, match=said) as caught:
        imported(path, forces=(1.0,))
    assert caught.value.expected.count("--") == 3  # one message names an option for each of the three
    with pytest.raises(InputError, match="neither in the file nor stated: unit of the response and unit of the force"):
        imported(path, forces=(1.0,), response="mobility")
    with pytest.raises(InputError, match="unit of the force is neither"):
        imported(path, forces=(1.0,), response="mobility", units={"response": "m/s/N"})
    with pytest.raises(InputError, match="is a ratio to force and velocity is stated"):
        imported(path, forces=(1.0,), response="velocity", units={"response": "m/s", "force": "N"})
    record = imported(path, forces=(1.0,), response="mobility", units={"response": "m/s", "force": "N"}).record
    expected = np.abs(THREE) / (2 * np.pi * record.column("frequency"))
    np.testing.assert_allclose(record.column("amplitude"), expected, rtol=1e-14)


def test_the_unit_tells_the_type_where_the_codes_do_not(tmp_path: Path, imported):
    path = tmp_path / "file.unv"
    ordinate = "         0    0    0    0 NONE                 (m/s^2)/N"
    path.write_text(header(numerator=ordinate, denominator=ordinate.replace("(m/s^2)/N", "N")) + SINGLE + END)
    assert ("response", "accelerance", "follows from its unit") in imported(path, forces=(1.0,)).summary.rows


UNITS_164 = (
    "    -1\n   164\n{code:10d}{name:20s}{two:10d}\n"
    + 3 * "  1.00000000000000000D+00"
    + "\n  2.73160000000000025D+02\n    -1\n"
)


@pytest.mark.parametrize(
    ("code", "length", "force"), [(1, "m", "N"), (5, "mm", "mN"), (7, "in", "lbf"), (10, "mm", "N")]
)
def test_units_of_data_set_164_where_labels_are_blank(read: Read, code: int, length: str, force: str):
    blank = {"numerator": "        12    0    0    0", "denominator": "        13    0    0    0"}
    found = read(UNITS_164.format(code=code, name="units", two=2) + header(**blank) + SINGLE + END)
    assert dict(found.facts.units) == {"response": f"{length}/s^2", "force": force}


@pytest.mark.parametrize("code", [0, 9, 4711])
def test_units_code_that_names_no_units(read: Read, tmp_path: Path, imported, code: int):
    blank = {"numerator": "        12    0    0    0", "denominator": "        13    0    0    0"}
    found = read(UNITS_164.format(code=code, name="units", two=2) + header(**blank) + SINGLE + END)
    assert not found.facts.units
    with pytest.raises(InputError, match="neither in the file nor stated: unit of the response and unit of the force"):
        imported(tmp_path / "file.unv", forces=(1.0,))


def test_labels_go_before_units_codes(read: Read):
    found = read(UNITS_164.format(code=7, name="Inch", two=2) + header() + SINGLE + END)
    assert dict(found.facts.units) == {"response": "m/s^2", "force": "N"}


@pytest.mark.parametrize(
    ("function", "name"),
    [
        (2, "auto spectrum"),
        (3, "cross spectrum"),
        (5, "transmissibility"),
        (6, "coherence"),
        (9, "power spectral density"),
        (27, "of function type 27"),
    ],
)
def test_functions_that_are_no_response(read: Read, function: int, name: str):
    content = header(function=function) + SINGLE + END
    with pytest.raises(InputError, match="no data set is a response"):
        read(content)
    with pytest.raises(InputError, match=f"data set 1 is {name}"):
        read(content, datasets=(1,))
    if function != 5:  # a campaign reads ratios to its control
        with pytest.raises(InputError, match=f"no data set is a response: the first is {name}"):
            read_functions(content.encode(), Summary())


def test_a_spectrum_beside_a_frequency_response_says_the_same_twice(read: Read):
    spectrum = header(function=12, denominator="         0    0    0    0") + SINGLE + END
    assert read(spectrum + header(title="ratio") + SINGLE + END).label == "ratio"


def test_a_frequency_response_of_real_values_has_lost_its_phase(read: Read):
    with pytest.raises(InputError, match="phase is lost"):
        read(header(ordinate=2, points=6) + SINGLE + END, datasets=(1,))


def test_responses_at_several_points_are_not_taken_for_levels(tmp_path: Path, imported):
    path = tmp_path / "file.unv"
    other = header(title="b").replace(f"{1:10d}   3 NONE", f"{2:10d}   3 NONE", 1)
    path.write_text(WHOLE + other + SINGLE + END)
    with pytest.raises(InputError, match="responses at 2 points"):
        imported(path, forces=(1.0,))
    assert len(imported(path, forces=(1.0,), datasets=(2,)).record) == 3


def test_a_line_at_0_hz(tmp_path: Path, imported):
    path = tmp_path / "file.unv"
    path.write_text(header(first="  0.00000E+00") + SINGLE + END)
    found = imported(path, forces=(1.0,))
    np.testing.assert_array_equal(found.record.column("frequency"), [1.0, 2.0])
    assert any("at 0 Hz" in note for note in found.summary.notes)


def test_a_sensor_mounted_against_the_force(truth, by_pyuff, imported):
    w = 2 * np.pi * truth.f
    path = by_pyuff({"x": truth.f.copy(), "data": w**2 * truth.H, "rsp_dir": -3, "binary": 1, "abscissa_spacing": 0})
    with pytest.raises(InputError, match=r"returns energy.*--reverse"):
        imported(path, forces=(truth.F,))
    turned = imported(path, forces=(truth.F,), reverse=True)
    np.testing.assert_allclose(turned.record.column("phase"), truth.lag, rtol=0, atol=1e-12)  # a few roundings
    assert any("directions are opposite" in note for note in turned.summary.notes)


def test_abscissas_in_rad_per_second_and_rpm(read: Read):
    for text, factor in (("rad/s", 2 * np.pi), ("rpm", 60.0), ("kHz", 1e-3)):
        axis = f"        18    0    0    0 Frequency            {text}"
        np.testing.assert_allclose(read(header(abscissa=axis) + SINGLE + END).abscissa * factor, [5, 6, 7], rtol=1e-15)
    with pytest.raises(InputError, match="frequency in 'orders'"):
        read(header(abscissa="        18    0    0    0 Frequency            orders") + SINGLE + END)


def test_more_rows_than_a_record_may_have(tmp_path: Path, imported):
    """A band about the mode is chosen, not all of a spectrum of a hundred and fifty thousand lines."""
    points, path = 150_000, tmp_path / "file.unv"
    head = head_of_bytes(8 * points, points=points, ordinate=5)
    path.write_bytes(head + np.ones(points, "<c8").tobytes() + END.encode())
    with pytest.raises(InputError, match="150000 rows; expected at most 100000: choose --band"):
        imported(path, forces=(1.0,))
    assert len(imported(path, forces=(1.0,), band=(100.0, 200.0)).record) == 101


def test_more_data_sets_than_sweeps_can_be(tmp_path: Path, imported):
    path = tmp_path / "file.unv"
    path.write_text(WHOLE * 1001)
    with pytest.raises(InputError, match="1001 responses; expected --dataset"):
        imported(path, forces=(1.0,))
    assert imported(path, forces=(1.0,), datasets=(7, 1001)).record.sweeps == ("set 7", "set 1001")


def test_junk_between_data_sets(read: Read):
    found = read("made by a rig\n\n" + END + WHOLE + "the end\n", format="uff")
    np.testing.assert_array_equal(found.response, THREE)
