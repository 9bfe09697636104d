"""Tables as CSV text: shortest decimal numbers that read back to the last digit, and text no spreadsheet executes."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
import pandas as pd

from selection.records.record import Record
from selection.records.text import guarded


def record_to_csv(record: Record | pd.DataFrame) -> str:
    """A record or any table as CSV: UTF-8 text, commas, LF line ends, no index; NaN and None are empty cells.

    Floats are written as the shortest decimals that read back to the same number, integers without a point. A text
    cell or column name that begins with ``=``, ``+``, ``-``, ``@``, tab or carriage return, which a spreadsheet may
    execute, gets a leading apostrophe unless it is a plain number; ``read_table`` and ``read_record`` take it off.
    """
    table = record.table if isinstance(record, Record) else record
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([_cell(str(name)) for name in table.columns])
    writer.writerows(zip(*(_cells(table.iloc[:, i]) for i in range(table.shape[1])), strict=True))
    return stream.getvalue()


def _cells(column: pd.Series) -> list[str]:
    return [_cell(value) for value in column.tolist()]


def _cell(value: object) -> str:
    if isinstance(value, str):
        return guarded(value)
    if value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float | np.floating):
        return repr(float(value))
    return str(value)
