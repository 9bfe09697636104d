"""Tables as CSV text: shortest decimal numbers that read back to the last digit, and text no spreadsheet executes."""

from __future__ import annotations

import math
import re

import numpy as np
import pandas as pd

from selection.records.record import Record
from selection.records.text import guarded

_BLOCK = 20_000  # rows that are written together
_QUOTED = re.compile(r'[,"\r\n]')  # the csv module leaves a lone carriage return bare


def record_to_csv(record: Record | pd.DataFrame) -> str:
    """A record or any table as CSV: UTF-8 text, commas, LF line ends, no index; NaN and None are empty cells.

    Floats are written as the shortest decimals that read back to the same number, integers without a point. A text
    cell or column name that begins with ``=``, ``+``, ``-``, ``@``, tab or carriage return, which a spreadsheet may
    execute, gets a leading apostrophe unless it is a plain number; ``read_table`` and ``read_record`` take it off.
    """
    table = record.table if isinstance(record, Record) else record
    parts = [",".join(_cell(str(name)) for name in table.columns) + "\n"]
    for start in range(0, len(table), _BLOCK):
        block = table.iloc[start : start + _BLOCK]
        columns = [[_cell(value) for value in block.iloc[:, i].tolist()] for i in range(block.shape[1])]
        parts.append("".join(",".join(row) + "\n" for row in zip(*columns, strict=True)))
    return "".join(parts)


def _cell(value: object) -> str:
    if isinstance(value, str):
        return _quoted(guarded(value))
    if value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float | np.floating):
        return repr(float(value))
    return _quoted(str(value))


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if _QUOTED.search(text) else text
