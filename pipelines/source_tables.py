"""Tables of the Saturn V report beside their recomputation, for the study of it: everything is computed elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

import pandas as pd

from selection.compare.ranking import Ranking
from selection.records.report_tables import load_errata
from selection.reproduction.force_laws import section_6_1, section_6_1_errors
from selection.reproduction.linear_coefficients import linear_coefficients
from selection.reproduction.power_laws import power_laws, section_4_3_example
from selection.reproduction.regressions import regression_deviations, regressions
from selection.reproduction.reproduce import reproduce


def source_tables(rankings: Mapping[str, Ranking]) -> dict[str, pd.DataFrame]:
    """Named tidy tables of the report's results beside ours.

    Args:
        rankings: by the names of the report's records (``config-2-mode-1`` and so on).
    """
    return {
        "reproduction": pd.DataFrame([{**asdict(r), "agreement": r.agreement} for r in reproduce()]),
        "errata": load_errata().sort_values("severity", kind="stable", ignore_index=True),
        "regressions": regressions(),
        "regression_deviations": regression_deviations(),
        "linear_coefficients": linear_coefficients(),
        "power_laws": power_laws(),
        "section_4_3_example": section_4_3_example(rankings["config-2-mode-1"]),
        "section_6_1": section_6_1(rankings),
        "section_6_1_errors": section_6_1_errors(rankings),
    }
