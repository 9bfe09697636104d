"""A summary of an object for notebook and terminal: a title, a short table and remarks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

MOST_SHOWN = 12  #: most rows of a ranking or of a record in a summary


class Summarised(ABC):
    """An object with a summary."""

    @property
    @abstractmethod
    def title(self) -> str:
        """One line that names the result."""

    @property
    @abstractmethod
    def shown(self) -> pd.DataFrame:
        """The columns and rows of a table that a summary shows."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes and cautions to show after the table."""
        return ()

    def __repr__(self) -> str:
        text = self.shown.to_string(index=False, float_format=_format_number, na_rep="-")
        return "\n".join([self.title, text, *(f"- {remark}" for remark in self.remarks)])

    def _repr_html_(self) -> str:
        table = self.shown.to_html(index=False, float_format=_format_number, na_rep="-", border=0)
        listed = "".join(f"<li>{escape(remark)}</li>" for remark in self.remarks)
        return f"<div><p><b>{escape(self.title)}</b></p>{table}{f'<ul>{listed}</ul>' if listed else ''}</div>"


def _format_number(value: float) -> str:
    return f"{value:.4g}"
