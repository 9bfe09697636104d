"""What files of other programs look like: one test for each way that users of such importers report."""

from __future__ import annotations

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
THREE = np.array([1 + 2j, 3 + 4j, 5 + 6j])


def test_as_the_format_says(read: Read):
    found = read(header() + SINGLE + END)
    np.testing.assert_array_equal(found.abscissa, [5.0, 6.0, 7.0])
    np.testing.assert_array_equal(found.response, THREE)
    assert found.facts.response == "accelerance"
    assert dict(found.facts.units) == {"response": "m/s^2", "force": "N"}


def test_a_last_line_filled_up_with_zeros(read: Read):
    """More values than the number of points: two, of which the file holds three."""
    found = read(
        header(points=2) + "  1.00000E+00  2.00000E+00  3.00000E+00  4.00000E+00  0.00000E+00  0.00000E+00\n" + END
    )
    np.testing.assert_array_equal(found.response, THREE[:2])


def test_more_values_than_the_header_says_are_no_padding(read: Read):
    with pytest.raises(InputError, match="more values than the 4 of the header"):
        read(header(points=2) + SINGLE + END)


def test_a_last_line_that_is_not_full(read: Read):
    found = read(
        header(points=4, ordinate=4, spacing=1, function=12)
        + "".join(f"{v:20.12E}" for v in (1, 2, 3))
        + "\n"
        + f"{4.0:20.12E}\n"
        + END
    )
    np.testing.assert_array_equal(found.response, [1.0, 2.0, 3.0, 4.0])


def test_a_line_shorter_than_six_values_padded_with_blanks(read: Read):
    found = read(header(points=2) + SINGLE[:52] + " " * 26 + "\n" + END)
    np.testing.assert_array_equal(found.response, THREE[:2])


def test_separators_filled_to_80_characters(read: Read):
    found = read(
        (header() + SINGLE + END)
        .replace("    -1\n", "    -1" + " " * 74 + "\n")
        .replace("    58\n", "    58" + " " * 74 + "\n")
    )
    np.testing.assert_array_equal(found.response, THREE)


@pytest.mark.parametrize("title", ["    -1", "-1", "shaker at     -1", "    -1    -1"])
def test_a_separator_in_an_id_line(read: Read, title: str):
    np.testing.assert_array_equal(read(header(title=title) + SINGLE + END).response, THREE)


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_line_ends_of_other_systems(read: Read, end: str):
    np.testing.assert_array_equal(read((header() + SINGLE + END).replace("\n", end)).response, THREE)


def test_letters_d_in_exponents(read: Read):
    body = (header(first="  5.00000D+00", step="  1.00000d+00") + SINGLE + END).replace("E+00", "D+00")
    found = read(body)
    np.testing.assert_array_equal(found.abscissa, [5.0, 6.0, 7.0])
    np.testing.assert_array_equal(found.response, THREE)


def test_exponents_of_three_digits_without_a_letter(read: Read):
    """Fortran writes 1.5E-101 as 1.50000-101."""
    found = read(header(points=1) + "  1.50000-101  2.50000+002\n" + END)
    np.testing.assert_array_equal(found.response, [1.5e-101 + 250j])


def test_columns_that_touch(read: Read):
    """Negative numbers with exponents of three digits fill all of the 13 characters."""
    body = "".join(f"{v:13s}" for v in ("-5.48363E-004", "-7.51019E-004", "-6.07967E-004", "-1.03712E-003"))
    found = read(header(points=2) + body + "\n" + END)
    np.testing.assert_array_equal(found.response, [-5.48363e-4 - 7.51019e-4j, -6.07967e-4 - 1.03712e-3j])


def test_columns_that_touch_without_a_sign(read: Read):
    body = "1.000000E+002" + "2.000000E+002" + "3.000000E+002" + "4.000000E+002"
    np.testing.assert_array_equal(read(header(points=2) + body + "\n" + END).response, [100 + 200j, 300 + 400j])


def test_an_abscissa_as_wide_as_the_ordinate(read: Read):
    """Real, double precision, uneven: the format has 13 characters for the abscissa, some programs write 20."""
    body = "".join(f"{x:20.12E}{y:20.12E}\n" for x, y in ((0.1, 1.0), (0.2, 2.0), (0.4, 3.0)))
    found = read(header(function=12, ordinate=4, spacing=0) + body + END)
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
    kind = f"    58b{1 if order == '<' else 2:6d}{2:6d}{11:12d}{len(values):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    found = read(header(kind=kind, ordinate=ordinate).encode() + values + end + END.encode())
    np.testing.assert_array_equal(found.response, THREE)


@pytest.mark.parametrize("count", [0, 24, 999999])
def test_a_wrong_number_of_bytes_in_the_header(read: Read, count: int):
    """Some writers count real values where the data are complex, or leave 0."""
    kind = f"    58b{1:6d}{2:6d}{11:12d}{count:12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    found = read(header(kind=kind, ordinate=6).encode() + THREE.tobytes() + END.encode())
    np.testing.assert_array_equal(found.response, THREE)


def test_bytes_with_an_abscissa_of_single_precision(read: Read):
    """The abscissa is of single precision in the format, of double in most files."""
    table = np.array([(1.0, 1 + 2j), (2.0, 3 + 4j), (4.0, 5 + 6j)], dtype=[("x", "<f4"), ("y", "<c16")])
    kind = f"    58b{1:6d}{2:6d}{11:12d}{table.nbytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    found = read(header(kind=kind, ordinate=6, spacing=0).encode() + table.tobytes() + END.encode())
    np.testing.assert_array_equal(found.abscissa, [1.0, 2.0, 4.0])
    np.testing.assert_array_equal(found.response, THREE)


def test_separators_among_the_bytes(read: Read):
    """Bytes that happen to read as a separator are values."""
    values = b"\n    -1\n" * 6
    kind = f"    58b{1:6d}{2:6d}{11:12d}{len(values):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    found = read(header(kind=kind, ordinate=6).encode() + values + END.encode())
    np.testing.assert_array_equal(found.response, np.frombuffer(values, "<c16"))


@pytest.mark.parametrize(
    ("fields", "reason"),
    [(f"{0:6d}{2:6d}", "byte order 0"), (f"{1:6d}{1:6d}", "floating-point format 1"), ("", "byte order 0")],
)
def test_bytes_of_unknown_form(read: Read, fields: str, reason: str):
    with pytest.raises(InputError, match=reason):
        read(header(kind=f"    58b{fields}", ordinate=6).encode() + THREE.tobytes() + END.encode())


def test_a_file_cut_off(read: Read):
    with pytest.raises(InputError, match=r"4 values where the header needs 6 \(the file is cut off\)"):
        read(header() + SINGLE[:52])
    kind = f"    58b{1:6d}{2:6d}{11:12d}{48:12d}"
    with pytest.raises(InputError, match="not followed by the end"):
        read(header(kind=kind, ordinate=6).encode() + THREE.tobytes()[:40])
    with pytest.raises(InputError, match="ends in the header"):
        read(header()[:200])


def test_a_missing_last_separator(read: Read):
    np.testing.assert_array_equal(read(header() + SINGLE).response, THREE)


@pytest.mark.parametrize("ordinate", [0, 3, 7])
def test_an_ordinate_type_that_does_not_exist(read: Read, ordinate: int):
    with pytest.raises(InputError, match=f"line 9: ordinate data type {ordinate}; expected 2 or 4"):
        read(header(ordinate=ordinate) + SINGLE + END)


def test_missing_quantities_are_asked_for(read: Read, tmp_path: Path, imported):
    """Ordinate types 0 (unknown): neither the motion nor what it is divided by is in the file."""
    blank = "         0    0    0    0 NONE                 NONE"
    found = read(header(numerator=blank, denominator=blank) + SINGLE + END)
    assert found.facts.response is None
    path = tmp_path / "file.unv"
    with pytest.raises(
        InputError, match="neither in the file nor stated: type of the response, unit of the response"
    ) as caught:
        imported(path, forces=(1.0,))
    assert caught.value.expected.count("--") == 3  # one message names an option for each of the three
    with pytest.raises(InputError, match="neither in the file nor stated: unit of the response and unit of the force"):
        imported(path, forces=(1.0,), response="mobility")
    with pytest.raises(InputError, match="unit of the force is neither"):
        imported(path, forces=(1.0,), response="mobility", units={"response": "m/s/N"})
    with pytest.raises(InputError, match="is a ratio to force and velocity is stated"):
        imported(path, forces=(1.0,), response="velocity", units={"response": "m/s", "force": "N"})
    record = imported(path, forces=(1.0,), response="mobility", units={"response": "m/s", "force": "N"}).record
    np.testing.assert_allclose(
        record.column("amplitude"), np.abs(THREE) / (2 * np.pi * record.column("frequency")), rtol=1e-14
    )


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


def test_coherence_and_other_sets_beside_the_response(read: Read):
    """Test systems write geometry, units and the coherence beside each frequency response."""
    nodes = "    -1\n    15\n         1         0         0         8  0.00000E+00  0.00000E+00 -1.00000E+00\n    -1\n"
    coherence = header(function=6, ordinate=2) + "  9.00000E-01  9.00000E-01  9.00000E-01\n" + END
    found = read(nodes + coherence + header() + SINGLE + END + coherence)
    np.testing.assert_array_equal(found.response, THREE)


def test_a_spectrum_beside_a_frequency_response_says_the_same_twice(read: Read):
    spectrum = header(function=12, denominator="         0    0    0    0") + SINGLE + END
    assert read(spectrum + header(title="ratio") + SINGLE + END).label == "ratio"


def test_dynamic_stiffness_is_no_receptance(read: Read):
    swapped = {
        "numerator": "        13    0    0    0 Force                N",
        "denominator": "         8    0    0    0 X  m",
    }
    with pytest.raises(InputError, match="no data set is a response: data set 1 is a ratio of force to displacement"):
        read(header(**swapped) + SINGLE + END)


def test_a_frequency_response_of_magnitudes_is_named(read: Read):
    """It is of a type that is expected, so the type alone says nothing."""
    magnitudes = header(ordinate=2) + "  9.00000E-01  9.00000E-01  9.00000E-01\n" + END
    with pytest.raises(InputError, match="a response: data set 1 is a frequency response of real values"):
        read(magnitudes)


def test_a_frequency_response_of_real_values_has_lost_its_phase(read: Read):
    with pytest.raises(InputError, match="phase is lost"):
        read(header(ordinate=2, points=6) + SINGLE + END, datasets=(1,))


def test_responses_at_several_points_are_not_taken_for_levels(tmp_path: Path, imported):
    path = tmp_path / "file.unv"
    other = header(title="b").replace(f"{1:10d}   3 NONE", f"{2:10d}   3 NONE", 1)
    path.write_text(header() + SINGLE + END + other + SINGLE + END)
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


def test_even_spacing_without_a_step(read: Read):
    with pytest.raises(InputError, match="abscissa from 5 with increment 0"):
        read(header(step="  0.00000E+00") + SINGLE + END)


@pytest.mark.parametrize("points", [0, -3, 10**9])
def test_a_number_of_points_that_cannot_be(read: Read, points: int):
    with pytest.raises(InputError, match=r"points|fewer values"):
        read(header(points=points) + SINGLE + END)


def test_something_that_is_no_number_names_its_line(read: Read):
    with pytest.raises(InputError, match=r"line 15: a value is not a number"):
        read(header(points=6) + SINGLE + SINGLE.replace("3.00000E+00", "***********") + END)


def test_no_universal_file(read: Read):
    with pytest.raises(InputError, match=r"no data set 58 \(it has 151, 15\)"):
        read("    -1\n   151\nmodel\n    -1\n    -1\n    15\n         1\n    -1\n")


def test_a_line_of_a_hundred_thousand_values_is_no_crash(read: Read):
    with pytest.raises(InputError, match="not a number"):
        read(header(points=6) + "1.0 " * 400_000 + "\n" + END)


def test_more_rows_than_a_record_may_have(tmp_path: Path, imported):
    """A band about the mode is chosen, not all of a spectrum of a hundred and fifty thousand lines."""
    points = 150_000
    kind = f"    58b{1:6d}{2:6d}{11:12d}{8 * points:12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    path = tmp_path / "file.unv"
    path.write_bytes(header(kind=kind, points=points).encode() + np.ones(points, "<c8").tobytes() + END.encode())
    with pytest.raises(InputError, match="150000 rows; expected at most 100000: choose --band"):
        imported(path, forces=(1.0,))
    assert len(imported(path, forces=(1.0,), band=(100.0, 200.0)).record) == 101


def test_more_data_sets_than_sweeps_can_be(tmp_path: Path, imported):
    path = tmp_path / "file.unv"
    path.write_text((header() + SINGLE + END) * 1001)
    with pytest.raises(InputError, match="1001 responses; expected --dataset"):
        imported(path, forces=(1.0,))
    assert imported(path, forces=(1.0,), datasets=(7, 1001)).record.sweeps == ("set 7", "set 1001")


def test_junk_between_data_sets(read: Read):
    found = read("made by a rig\n\n" + END + header() + SINGLE + END + "the end\n", format="uff")
    np.testing.assert_array_equal(found.response, THREE)
