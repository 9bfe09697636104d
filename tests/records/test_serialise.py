"""Writing tables: what is read back is what was written, to the last digit."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damping.records.reading import read_record, read_table
from damping.records.record import Record, record_to_csv


def test_numbers_text_and_what_a_spreadsheet_would_execute():
    table = pd.DataFrame(
        {
            "name": ["=1+1", "@a", "-x", "+5", "-5e-3", "a,b", 'c"d', "two\nlines"],
            "=f": [0.1, 1 / 3, -1.0, 1e-300, 1e22, np.nan, 100.0, 5e-324],
            "n": range(8),
            "ok": [True, None, False, True, True, True, True, True],
        }
    )
    assert record_to_csv(table) == (
        "name,'=f,n,ok\n"
        "'=1+1,0.1,0,True\n"
        "'@a,0.3333333333333333,1,\n"
        "'-x,-1.0,2,False\n"
        "+5,1e-300,3,True\n"
        "-5e-3,1e+22,4,True\n"
        '"a,b",,5,True\n'
        '"c""d",100.0,6,True\n'
        '"two\nlines",5e-324,7,True\n'
    )


LABELS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=8).filter(
    lambda text: text == text.strip()
) | st.sampled_from(["=A1", "'=A1", "'", "''-", "-5", "'-5", "@", "a,b", '"'])
POSITIVE = st.floats(min_value=1e-50, max_value=1e50)
ROWS = st.lists(
    st.tuples(LABELS, POSITIVE, POSITIVE, POSITIVE, st.floats(-6.28, 6.28)), min_size=1, max_size=5, unique=True
)


@settings(deadline=None, max_examples=50)  # each is checked as a record twice: 20 ms
@given(rows=ROWS)
def test_any_record_is_read_back_as_it_was_written(rows, scratch):
    table = pd.DataFrame(rows, columns=["sweep", "force", "frequency", "amplitude", "phase"]).astype({"sweep": object})
    record = Record(table, "made")
    path = scratch(record_to_csv(record))
    assert path.read_bytes().startswith(b"sweep,force,frequency,amplitude,phase\n")
    again = read_record(path)
    pd.testing.assert_frame_equal(again.table, table, check_exact=True)
    assert record_to_csv(again) == record_to_csv(record)


def test_empty_cells_stay_empty(scratch):
    content = "sweep,force,frequency,amplitude,mass,note\nA,1.0,2.0,3.0,,x\nA,1.0,2.5,3.0,7.0,\n"
    assert record_to_csv(read_record(scratch(content))) == content
    assert record_to_csv(read_table(scratch("a,b\n1.0,x\n"))) == "a,b\n1.0,x\n"


@pytest.mark.parametrize("kind", [object, "string"])
def test_text_of_either_kind(kind):
    assert record_to_csv(pd.DataFrame({"a": pd.Series(["x", None], dtype=kind), "b": [1, 2]})) == "a,b\nx,1\n,2\n"
