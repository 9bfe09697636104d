"""Every refusal of a CSV file, with its line and column, in one line; and what is accepted."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damping.errors import InputError
from damping.records.keys import REQUIRED_COLUMNS
from damping.records.reading import DEFAULT_MAX_SIZE, read_record, read_table
from damping.records.record import Record
from tests.files import outcome

HEAD = "sweep,force,frequency,amplitude,phase\n"
ROW = "A,1,10,0.5,1.5\n"
NEEDED = "expected columns sweep, force, frequency, amplitude, separated by commas"
DEGREES = "expected radians within -2 pi..2 pi (phases in degrees?)"


def told(row: str, column: str, said: str, last: str = "phase") -> tuple[str, str]:
    """A record of a right row and this one, and what is said of it; ``last``: its last column."""
    return HEAD.replace("phase", last) + ROW + row + "\n", f", line 3, column {column}: {said}"


FINITE = "expected a finite number"
LEAVE_OUT = f"empty cell; {FINITE}: leave out the rows that have none, or the column for all"
MAGNITUDE = "expected a magnitude of 1e-50 to 1e+50"
# content, and what the error says after the name of the file
REFUSED = {
    "empty": ("", ": the file is empty; expected a file with contents"),
    "white": ("\ufeff \n\t\n", ": the file is empty; expected a file with contents"),
    "blank cells": (
        "\n\n   \n \x0b x",
        f", line 4: missing columns {', '.join(REQUIRED_COLUMNS)} among x "
        f"(damping import reads other tables); {NEEDED}",
    ),
    "header only": (HEAD, ": no data rows; expected at least one row below the header"),
    "missing": (
        "sweep,Force,frequency\nA,1,2\n",
        f", line 1: missing columns force, amplitude (is 'Force' meant?); {NEEDED}",
    ),
    "missing one": (
        "sweep,force,frequency,x\nA,1,2,3\n",
        f", line 1: missing column amplitude among sweep, force, frequency, x; {NEEDED}",
    ),
    "semicolons": (
        "sweep;force;frequency;amplitude\nA;1;2;3\n",
        f", line 1: missing columns sweep, force, frequency, amplitude "
        f"(the header is separated by semicolons or tabs: damping import reads such files); {NEEDED}",
    ),
    "doubled": (
        "\n" + HEAD.replace("phase", "force"),
        ", line 2, column force: occurs twice; expected each column once",
    ),
    "nameless": (HEAD.replace("phase", " "), ", line 1: column 5 has no name; expected a name in each cell"),
    "short row": (HEAD + ROW + "A,1,10,0.5\n", ", line 3: 4 cells in the row; expected 5 as in the header"),
    "long row": (HEAD + ROW + ROW[:-1] + ",\n", ", line 3: 6 cells in the row; expected 5 as in the header"),
    "text": told("A,1,ten,0.5,1", "frequency", "'ten' is not a number; " + FINITE),
    "code": told(
        "A,1,__import__('os').system('true'),1,1",
        "frequency",
        "\"__import__('os').system('tr...\" is not a number; " + FINITE,
    ),
    "decimal comma": told('A,"1,5",10,0.5,1', "force", "'1,5' is not a number; " + FINITE),
    "empty cell": told("A,1,11,,1", "amplitude", "empty cell; " + FINITE),
    "empty phase": told("A,1,11,1, ", "phase", LEAVE_OUT),
    "empty uncertainty": told("A,1,11,1,", "amplitude_sd", LEAVE_OUT, "amplitude_sd"),
    "no label": told(" ,1,11,1,1", "sweep", "empty cell; expected text"),
    "zero force": told("A,0,10,0.5,1", "force", "0; expected a force amplitude > 0"),
    "negative": told("A,1,11,-3,1", "amplitude", "-3; expected a displacement amplitude > 0"),
    "underflow": told("A,1,11,1e-999,1", "amplitude", "0; expected a displacement amplitude > 0"),
    "too small": told("A,1e-60,1,1,1", "force", "1e-60; " + MAGNITUDE),
    "too large": told("A,1,1,1e60,1", "amplitude", "1e+60; " + MAGNITUDE),
    "frequency": told("A,1,-10,3,1", "frequency", "-10; expected a frequency in Hz > 0"),
    "degrees": told("A,1,10,0.5,90", "phase", "90; " + DEGREES),
    "negative degrees": told("A,1,10,0.5,-90", "phase", "-90; " + DEGREES),
    "third harmonic": (
        HEAD.replace("phase", "amplitude_3,phase_3") + "A,1,10,0.5,0.1,7.1\n",
        ", line 2, column phase_3: 7.1; " + DEGREES + ", less whole turns",
    ),
    "energy": told("A,1,10,0.5,0", "energy", "0; expected an energy per cycle > 0", "energy"),
    "mass": told("A,1,10,0.5,-2", "mass", "-2; expected a generalized mass > 0", "mass"),
    "sd": told("A,1,10,0.5,-0.1", "force_sd", "-0.1; expected a standard uncertainty >= 0", "force_sd"),
    "identical": (
        HEAD + ROW + "A,1,11,0.5,1\n\nA,1.0,10.0,5e-1,1.50\n",
        ", line 5: identical in every column to line 2; expected each measured state once",
    ),
    "open quote": (
        HEAD + ROW + '"A,1,10,0.5,1\n' + ROW,
        ', line 3: a quote that is opened and never closed; expected "..."',
    ),
    "text after quote": (
        HEAD + ROW + '"A"b,1,10,0.5,1\n',
        ", line 3: not CSV: ',' expected after '\"'; expected cells separated by commas",
    ),
    "latin-1": (
        HEAD.encode() + ROW.encode() + "Prüfling,1,10,0.5,1\n".encode("latin-1"),
        ", line 3: byte 0xfc at byte 3 of the line is not UTF-8 text; expected text in UTF-8",
    ),
    "nul": (
        HEAD.encode() + ROW.encode() + b"A,1,\0,1,1\n",
        ", line 3: a NUL byte at byte 5 of the line is not UTF-8 text; expected text in UTF-8",
    ),
    "gzip": (
        b"\x1f\x8b\x08\0" + bytes(range(256)),
        ", line 1: is compressed; expected the file itself, as gunzip unpacks it",
    ),
    "workbook": (
        b"PK\3\4\x14\0\6\0\10\0\0\0!\0" + bytes(range(256)),
        ", line 1: is no text; expected text, CSV or TOML (damping import and campaign read XLSX, MAT, HDF5, TDMS and "
        "UFF files)",
    ),
    "utf-16": (
        (HEAD + ROW).encode("utf-16"),
        f", line 1: byte 0x{'ff' if 'a'.encode('utf-16')[0] == 0xFF else 'fe'} at byte 1 of the line is not UTF-8 text "
        "(the file looks like UTF-16); expected text in UTF-8",
    ),
    "long cell": (
        HEAD + ROW + "A,1,10,0.5," + "1" * 200_000 + "\n",
        ", line 3: not CSV: field larger than field limit (131072); expected cells separated by commas",
    ),
    # the first problem in file order, whatever its kind
    "range before text": (HEAD + "A,1,10,0.5,90\nA,x,10,1,1\n", ", line 2, column phase: 90; " + DEGREES),
    "range before encoding": ((HEAD + "A,1,10,0.5,90\n").encode() + b"\xff", ", line 2, column phase: 90; " + DEGREES),
    "range before ragged": (HEAD + "A,1,10,0.5,90\nA,1\n", ", line 2, column phase: 90; " + DEGREES),
    "left before right": (HEAD + "A,1,-10,x,90\n", ", line 2, column frequency: -10; expected a frequency in Hz > 0"),
    "encoding in a quote": (
        (HEAD + ROW + '"A\n').encode() + b"\xff",
        ", line 4: byte 0xff at byte 1 of the line is not UTF-8 text; expected text in UTF-8",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line_that_names_the_place(case, scratch):
    content, said = REFUSED[case]
    path = scratch(content)
    with pytest.raises(InputError) as caught:
        read_record(path)
    assert str(caught.value) == f"{path}{said}"
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("cell", ["nan", "NaN", "inf", "-Infinity", "1e999", "1_000", "٣"])
def test_numbers_are_finite_and_written_plainly(cell, scratch):
    said = r"line 2, column force: .* is not a finite number written with the digits 0-9"
    with pytest.raises(InputError, match=said):
        read_record(scratch(f"{HEAD}A,{cell},10,0.5,1\n"))


def test_quoted_line_ends_are_counted(scratch):
    content = HEAD.replace("phase", "note") + 'A,1,10,0.5,"one\ntwo, and\nthree"\nA,1,11,0.5,\nA,1,-12,0.5,x\n'
    with pytest.raises(InputError) as caught:
        read_record(scratch(content))
    assert (caught.value.line, caught.value.column) == (6, "frequency")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends_and_byte_order_mark(end, scratch):
    content = "\ufeff" + (HEAD + ROW + "\n" + "A,1,11,0.6,x\n").replace("\n", end)
    with pytest.raises(InputError) as caught:
        read_record(scratch(content))
    assert (caught.value.line, caught.value.column) == (4, "phase")
    assert read_record(scratch(content.replace("x", "2"))).table["phase"].tolist() == [1.5, 2.0]


def test_files_that_cannot_be_read(tmp_path, scratch):
    said = {
        tmp_path / "absent.csv": "no such file",
        tmp_path: "is a folder; expected a file",
        Path("a\0b"): "cannot be read: embedded null byte",
        tmp_path / ("n" * 300): "cannot be read: File name too long",
    }
    for path, text in said.items():
        with pytest.raises(InputError, match=text):
            read_record(path)
    path = scratch(HEAD + ROW)
    size = path.stat().st_size
    assert len(read_record(path, max_size=size)) == 1
    expected = f"larger than {size - 1} bytes; expected a smaller file or a larger --max-size"
    with pytest.raises(InputError, match=expected):
        read_record(path, max_size=size - 1)
    assert DEFAULT_MAX_SIZE == 200_000_000


def test_a_mode_in_the_place_of_a_record_is_named(tmp_path):
    """Its first line, a comment or ``[mode]``, was taken for the names of columns."""
    path = tmp_path / "mode.toml"
    path.write_text("[mode]\n")
    with pytest.raises(InputError, match=r"mode\.toml: a TOML file in the place of a record; expected RECORD\.csv"):
        read_record(path)


def test_what_is_data_is_kept(scratch):
    content = (
        "note, order ,phase,sweep,force,frequency,amplitude,amplitude_sd,mass\n"
        '"a, b",007,-0.1,1, 2.5,10,+5e-1,0,\n'
        f"=1+1,008,{2 * pi!r},1,2.5,10,.5,0.1,3\n"  # the same point again, with another phase
        "c,009,3.2,B,2.5,9,5.,0.1,4\n"
    )
    record = read_record(scratch(content))
    table = record.table
    numbers = ["force", "frequency", "amplitude", "amplitude_sd", "mass"]
    assert list(table.columns) == ["note", "order", "phase", "sweep", *numbers]
    assert table.index.tolist() == [0, 1, 2]
    assert table["note"].tolist() == ["a, b", "=1+1", "c"]
    assert table["order"].tolist() == ["007", "008", "009"]
    assert table["amplitude"].tolist() == [0.5, 0.5, 5.0]
    assert record.sweeps == ("1", "B")
    assert record.has_phase
    np.testing.assert_array_equal(record.masses(7.0), [7.0, 3.0, 4.0])
    assert all(table[name].dtype == np.float64 for name in ("phase", *numbers))


def test_a_table_has_numbers_where_all_cells_are(scratch):
    path = scratch("y,x,label,code\n1,2,a,1\n3,,=b,2\n")
    table = read_table(path, required=["y", "label"], text_columns=["label"])
    assert table["y"].tolist() == [1.0, 3.0]
    assert table["x"].tolist() == ["2", ""]
    assert table["label"].tolist() == ["a", "=b"]
    assert table["code"].tolist() == [1.0, 2.0]
    with pytest.raises(InputError, match="line 3, column x: empty cell; expected a finite number"):
        read_table(path, required=["x"])
    with pytest.raises(InputError, match=r"line 1: missing column labels \(is 'label' meant\?\)"):
        read_table(path, required=["labels"])
    assert read_table(scratch("y\n1\n\n2\n1\n"), required=["y"])["y"].tolist() == [1.0, 2.0, 1.0]


CELLS = st.sampled_from(
    ["", "A", "1", "-1", "0", "nan", "1e999", '"', '"a\nb"', "\r", "\0", "é", "=1", "90", "1_0", " 2 "]
)
LINES = st.lists(st.lists(CELLS, max_size=6).map(",".join), max_size=6).map("\n".join)


@settings(deadline=None, max_examples=150)
@given(
    content=st.one_of(st.binary(max_size=200), LINES.map(str.encode), LINES.map(lambda rows: (HEAD + rows).encode()))
)
def test_anything_is_a_record_or_bad_input(content, scratch):
    path = scratch(content)
    record, error = outcome(read_record, path)
    if error is None:
        assert isinstance(record, Record)
        assert len(record) >= 1
        assert (record.table[["force", "frequency", "amplitude"]].to_numpy() > 0.0).all()
    else:
        assert len(str(error).splitlines()) == 1
    table, error = outcome(read_table, path)
    assert len(str(error).splitlines()) == 1 if table is None else len(table) >= 1
