"""Records of several states of one structure that repeat one another."""

from collections.abc import Sequence
from itertools import combinations

from damping.errors import InputError
from damping.gap.problem import State
from damping.records.record import Record

#: Columns of a row that two measurements do not share to the last digit, and the share of rows that do where one is a
#: copy: rounded peaks may agree once.
_MEASURED = ("force", "frequency", "amplitude", "phase")
_COPIED = 0.5


def refuse_copies(states: Sequence[State]) -> None:
    """InputError for states all rows of which are those of another, identical in every column."""
    for (j, (one, _)), (k, (two, _)) in combinations(enumerate(states, 1), 2):
        columns = one.frame.columns.tolist()
        if columns == two.frame.columns.tolist() and _share_rows(one, two, columns) == min(len(one), len(two)):
            message = f"the rows of states {j} and {k} are identical in every column"
            raise InputError(message, file=two.source or None, expected="each measured state once")


def list_repeated(states: Sequence[State]) -> list[str]:
    """States that share rows to the last digit, which no measurement does."""
    cautions = []
    for (j, (one, _)), (k, (two, _)) in combinations(enumerate(states, 1), 2):
        columns = [name for name in _MEASURED if name in one.frame and name in two.frame]
        shared, fewer = _share_rows(one, two, columns), min(len(one), len(two))
        if shared >= _COPIED * fewer:
            which = "the rows" if shared == fewer else f"{shared} rows"
            cautions.append(
                f"{which} of states {j} and {k} are identical, as those of two measurements never are: they count twice"
            )
    return cautions


def _share_rows(one: Record, two: Record, columns: list[str]) -> int:
    """How many rows two records share to the last digit of ``columns``."""
    tables = (record.frame[columns].astype(str) for record in (one, two))  # an empty cell equals an empty cell
    first, second = (set(table.itertuples(index=False, name=None)) for table in tables)
    return len(first & second)
