"""Results as objects: a table, its JSON form, a plot, and a summary for notebook and terminal.

Results of fitted laws (ranking, loads, curve) are in :mod:`damping.answers`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from damping import report as words
from damping.arrays import plain
from damping.records import Audit
from damping.records.summary import Summarised
from damping.records.text import AGREED, Disagreement, count
from damping.report import forms

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from damping.gap.corrected import EffectPosterior
    from damping.gap.diagnose import Diagnosis
    from damping.records.record import Record
    from damping.regression.program import Regression
    from damping.signals.chain import ConditioningStep


class Result(Summarised):
    """Base of every result of the library."""

    @property
    @abstractmethod
    def table(self) -> pd.DataFrame:
        """The result as a table."""

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """The JSON form as plain Python values; missing numbers are None."""

    @abstractmethod
    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Draw on ``ax`` and return it; without ``ax`` return a new figure."""

    @property
    def shown(self) -> pd.DataFrame:
        """The columns and rows of the table that a summary shows."""
        return self.table


def complete_form(form: dict[str, Any], audit: Audit | None, cautions: Iterable[str]) -> dict[str, Any]:
    """A form as plain Python values, with the findings of the audit and the cautions."""
    findings = audit.list_findings() if audit else []
    completed: dict[str, Any] = plain({**form, "audit": findings, "cautions": list(cautions)})
    return completed


@dataclass(frozen=True, eq=False, repr=False)
class AuditResult(Audit):
    """An audit together with the ``record`` it checked."""

    record: Record

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Amplitude against frequency, by sweep; sweeps named in a finding are drawn with crosses."""
        from damping.plots.fits import sweeps  # noqa: PLC0415 - only drawing needs matplotlib

        doubted = {sweep for finding in self.findings for sweep in finding.sweeps}
        figure = sweeps(self.record.frame, doubted, axes=ax)
        return ax or figure


@dataclass(frozen=True, eq=False, repr=False)
class DiagnosisResult(Result):
    """Why a test departs from its simulation."""

    diagnosis: Diagnosis
    posterior: EffectPosterior | None = None  #: of the leading explanation, if it was sampled
    audit: Audit | None = None
    against: Disagreement = AGREED  #: where the ranked laws disagree; shown first if it concerns a load

    @property
    def table(self) -> pd.DataFrame:
        """One row for each explanation, most probable first: ``effects`` joined by + (or none), ``probability``."""
        rows = [(" + ".join(e.effects) or "none", e.probability) for e in self.diagnosis.explanations]
        return pd.DataFrame(rows, columns=["effects", "probability"])

    def to_json(self) -> dict[str, Any]:
        """The form ``gap/1``."""
        form = forms.gap_form(self.diagnosis, self.posterior)
        return complete_form(form, self.audit, (*self.against, *self.diagnosis.cautions))

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Probabilities of the explanations."""
        from damping.plots.gap import gap_probabilities  # noqa: PLC0415 - only drawing needs matplotlib
        from damping.report.gap import MOST_BARS, tabulate_hypotheses  # noqa: PLC0415 - other results need no diagnosis

        figure = gap_probabilities(tabulate_hypotheses(self.diagnosis).head(MOST_BARS), axes=ax)
        return ax or figure

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict, size, refit and place of the gap, doubts, how far the gap shrinks, and what to test next."""
        from damping.report.gap import describe_diagnosis, order_cautions  # noqa: PLC0415 - other results need none

        described = describe_diagnosis(self.diagnosis)
        first, further = order_cautions(self.against, self.diagnosis.cautions)
        cautions = (f"Caution: {words.end_sentence(caution)}" for caution in further)
        topics = ("verdict", "sizes", "refit", "place", "doubts", "reach", "following")
        units = f"Units: {self.diagnosis.units}."
        return (*first, *(sentence for topic in topics for sentence in described[topic]), *cautions, units)

    @property
    def title(self) -> str:
        """The verdict, in one line."""
        return self.sentences[0]

    @property
    def remarks(self) -> tuple[str, ...]:
        """The other sentences."""
        return self.sentences[1:]


@dataclass(frozen=True, eq=False, repr=False)
class RegressionResult(Result):
    """The output of the regression program for one response of one table."""

    regression: Regression

    @property
    def table(self) -> pd.DataFrame:
        """One row for each term of the selected model: ``name, coefficient, std_error, t_ratio, p_value``."""
        from damping.regression.fit import tabulate_terms  # noqa: PLC0415 - other results need no regression

        return tabulate_terms(self.regression.selected.fit)

    def to_json(self) -> dict[str, Any]:
        """The form ``regress/1``."""
        from damping.regression.program import regress_form  # noqa: PLC0415 - as above

        return regress_form(self.regression)

    def printout(self) -> str:
        """The print-out of the program of 1970."""
        from damping.regression.program import printout  # noqa: PLC0415 - as above

        return printout(self.regression)

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Deviations against the fitted response."""
        from damping.plots.fits import deviations_figure  # noqa: PLC0415 - only drawing needs matplotlib

        fit, response = self.regression.selected.fit, self.regression.design.response
        labels = {"x_label": f"fitted {response}", "response": response}
        figure = deviations_figure(fit.fitted, fit.deviations, fit.percent, **labels, axes=ax)
        return ax or figure

    @property
    def title(self) -> str:
        """The response, the size of the fit and its rms error."""
        fit = self.regression.selected.fit
        of = f"{count(fit.k, 'term')}, {count(fit.n, 'row')}"
        return f"{self.regression.design.response}: {of}, rms error {fit.rms_error:.4g}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes of the program."""
        return self.regression.notes


@dataclass(frozen=True, eq=False, repr=False)
class SweepResult(Result):
    """Steady-state sweeps."""

    record: Record  #: the rows
    name: str  #: of the mode or the test
    left_out: tuple[str, ...] = ()  #: effects of the model that were not simulated
    of_rig: tuple[str, ...] = ()  #: simulated effects that change readings only
    natural: float | None = None  #: frequency of the model, Hz; None of a test

    @property
    def table(self) -> pd.DataFrame:
        """The rows of the record."""
        return self.record.table

    def to_json(self) -> dict[str, Any]:
        """The rows: ``{"format": "record/1", "rows": [..]}``."""
        rows = self.table.astype(object).where(self.table.notna(), None)
        form: dict[str, Any] = plain({"format": "record/1", "rows": rows.to_dict("records")})
        return form

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Amplitude against frequency, by sweep."""
        from damping.plots.fits import sweeps  # noqa: PLC0415 - only drawing needs matplotlib

        figure = sweeps(self.record.frame, axes=ax)
        return ax or figure

    @property
    def title(self) -> str:
        """The name, and the numbers of rows and sweeps."""
        return f"{self.name}: {count(len(self.record), 'row')} in {count(len(self.record.sweeps), 'sweep')}"

    @property
    def shown(self) -> pd.DataFrame:
        """The first rows."""
        return self.record.shown

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the sweeps lack of the model or its resonance, and what is in them that is not of the structure."""
        effects_by_reason = {
            "left out, because it belongs to the rig or to one test, not to the structure": self.left_out,
            "as the rig reads them, not the motion of the structure": self.of_rig,
        }
        reasons = [f"{why}: {words.format_joined(names)}" for why, names in effects_by_reason.items() if names]
        swept = self.record.column("frequency")
        if self.natural is not None and not swept.min() <= self.natural <= swept.max():
            reasons.append(f"the mode's {self.natural:g} Hz is outside the swept {swept.min():g} to {swept.max():g} Hz")
        return tuple(reasons)


@dataclass(frozen=True, eq=False, repr=False)
class ConditionResult(SweepResult):
    """The record of one mode from a raw table."""

    steps: tuple[ConditioningStep, ...] = ()  #: what each removed
    doubts: tuple[str, ...] = ()  #: cautions on the readings

    @property
    def remarks(self) -> tuple[str, ...]:
        """The steps in order, then the doubts."""
        named = (f"{step.name} ({step.equation})" if step.equation else step.name for step in self.steps)
        return (*named, *self.doubts)
