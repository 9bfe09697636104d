"""A section of the page together with the figures and tables that belong to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pandas as pd

from selection.report.page import Section


@dataclass(frozen=True)
class Part:
    """A further section with the figures (SVG) and tables that belong to it, by the names of their files."""

    section: Section
    figures: Mapping[str, str] = field(default_factory=dict)
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
