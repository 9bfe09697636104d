"""Results as objects: a table, the JSON form made of it, a drawing, and what a notebook and a terminal show."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, plain
from damping.errors import InputError
from damping.extrapolation import Extrapolation, sample_candidate
from damping.gap.corrected import EffectPosterior
from damping.gap.diagnose import Diagnosis
from damping.infer.chains import Posterior
from damping.infer.checks import inference_data
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.progress import single_threaded
from damping.ranking import Candidate, Ranking
from damping.records.audit import Audit
from damping.records.keys import describe_nearest
from damping.records.mode import Mode
from damping.records.record import Record
from damping.regression.form import regress_form, tabulate_terms
from damping.regression.printout import printout
from damping.regression.program import Regression
from damping.report import forms
from damping.signals.chain import ConditioningStep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Rows of the ranking or of a record that a summary shows.
MOST_SHOWN = 12
#: Points of the curves of a drawing of loads.
GRID = 60


class Result(ABC):
    """What every result of the library can do."""

    @property
    @abstractmethod
    def table(self) -> pd.DataFrame:
        """The result as a table."""

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """The JSON form as plain Python values; a number that does not exist is None."""

    @abstractmethod
    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Draw on ``ax`` and return it; without one return a figure of its own."""

    @property
    @abstractmethod
    def title(self) -> str:
        """What this is, in a line."""

    @property
    def shown(self) -> pd.DataFrame:
        """The columns and rows of the table that a summary shows."""
        return self.table

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should know beside the table."""
        return ()

    def __str__(self) -> str:
        text = self.shown.to_string(index=False, float_format=lambda value: f"{value:.4g}", na_rep="-")
        return "\n".join([self.title, text, *(f"- {remark}" for remark in self.remarks)])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        html = self.shown.to_html(index=False, float_format=lambda value: f"{value:.4g}", na_rep="-", border=0)
        remarks = "".join(f"<li>{escape(remark)}</li>" for remark in self.remarks)
        return f"<div><p><b>{escape(self.title)}</b></p>{html}{f'<ul>{remarks}</ul>' if remarks else ''}</div>"


def _list_findings(audit: Audit | None) -> list[dict[str, Any]]:
    """The findings of an audit as the forms carry them."""
    return list(audit.to_json()["findings"]) if audit else []


@dataclass(frozen=True, eq=False)
class LawSample:
    """Posterior draws of a law: ``posterior`` with its diagnoses, and the rows ``data`` it was given."""

    posterior: Posterior
    data: Observations

    @property
    def draws(self) -> dict[str, FloatArray]:
        """Draws of each physical parameter, (ensembles, kept)."""
        return self.posterior.parameters()

    def to_arviz(self) -> Any:
        """The draws as an arviz ``InferenceData``; chains are the independent ensembles."""
        return inference_data(self.posterior, self.data)


@dataclass(frozen=True, eq=False)
class RankedLaw:
    """A law of a ranking: its row ``candidate``, and the rows ``data`` it was fitted to."""

    candidate: Candidate
    data: Observations

    @property
    def law(self) -> Law:
        """The law itself."""
        return self.candidate.law

    @single_threaded
    def sample(self, seed: int = 1) -> LawSample:
        """Chains of the law's posterior, run until every parameter is known.

        Raises:
            InputError: the law could not be fitted, so there is nothing to sample.
        """
        if self.candidate.evidence is None:
            raise InputError(f"{self.law.name} could not be fitted", expected="a law with a rank")
        return LawSample(sample_candidate(self.candidate, self.data, self.data.tested_force, seed), self.data)

    def to_arviz(self, seed: int = 1) -> Any:
        """Its sample as an arviz ``InferenceData``."""
        return self.sample(seed).to_arviz()


@dataclass(frozen=True, eq=False, repr=False)
class RankingResult(Result):
    """Candidate damping laws of a record, best first; ``mode`` where one was given; ``said``: what was done before."""

    ranking: Ranking
    mode: Mode | None = None
    audit: Audit | None = None
    said: tuple[str, ...] = ()

    def __getitem__(self, law: str) -> RankedLaw:
        """The law of a row, by the text in its column ``law`` or of an equivalent, its forces in any order."""
        asked = set(str(law).split(" + "))
        for candidate in self.ranking.candidates:
            if asked in [set(name.split(" + ")) for name in (candidate.name, *candidate.equivalents)]:
                return RankedLaw(candidate, self.ranking.data)
        names = [candidate.name for candidate in self.ranking.candidates]
        raise InputError(
            f"no law {law!r}", expected=f"{describe_nearest(str(law), names)} or another of the column law"
        )

    def __len__(self) -> int:
        return len(self.ranking.candidates)

    @property
    def table(self) -> pd.DataFrame:
        """A row a law, best first: ``rank, law, weight, score, held_out_error, ...``; errors in per cent."""
        table = forms.tabulate_candidates(self.ranking)
        first = ["rank", "law", "weight", "score", "held_out_error"]
        return table[[*first, *(name for name in table.columns if name not in first)]]

    @property
    def cautions(self) -> tuple[str, ...]:
        """Whether any law fits, where none does; and what is odd about the mode beside the record."""
        verdict = self.ranking.fit.sentence
        odd = forms.list_mode_cautions(self.ranking.data, self.mode) if self.mode else ()
        return (*([verdict] if verdict else ()), *self.said, *odd)

    def to_json(self) -> dict[str, Any]:
        """The form ``rank/1``."""
        form: dict[str, Any] = plain(
            {**forms.rank_form(self.ranking), "audit": _list_findings(self.audit), "cautions": list(self.cautions)}
        )
        return form

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Weights as bars, beside the errors of each law where the figure is its own."""
        from damping.plots.fits import draw_weights, ranking  # noqa: PLC0415 - only drawing needs matplotlib

        if ax is None:
            return ranking(self.table)
        draw_weights(ax, self.table)
        return ax

    @property
    def title(self) -> str:
        """What this is, in a line."""
        return f"Damping laws, best first: {self.ranking.criterion}"

    @property
    def shown(self) -> pd.DataFrame:
        """The best laws."""
        columns = ["rank", "law", "weight", "score", "held_out_error", "average_absolute_percent"]
        return self.table[columns].head(MOST_SHOWN)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Cautions about the whole."""
        hidden = len(self) - MOST_SHOWN
        return (*self.cautions, *([f"{hidden} further candidates in .table"] if hidden > 0 else []))


@dataclass(frozen=True, eq=False, repr=False)
class LoadsResult(Result):
    """Resonant amplitudes at forces beyond the test, with what they rest on; ``data``: all rows of the record."""

    extrapolation: Extrapolation
    mode: Mode
    data: Observations
    audit: Audit | None = None
    swept: tuple[str, ...] = ()

    @property
    def table(self) -> pd.DataFrame:
        """A row a force with the keys of the form; NaN where no prediction is given, ``cautions`` say why."""
        return forms.tabulate_loads(self.extrapolation.loads)

    @property
    def cautions(self) -> tuple[str, ...]:
        """What is odd about the mode beside the record."""
        return (*self.swept, *forms.list_mode_cautions(self.extrapolation.plan.data, self.mode))

    def to_json(self) -> dict[str, Any]:
        """The form ``loads/1``."""
        form = forms.loads_form(self.extrapolation.loads, self.extrapolation.plan)
        form |= forms.what_if_keys(self.extrapolation.vary_priors(), self.extrapolation.choose_next_level())
        values: dict[str, Any] = plain({**form, "audit": _list_findings(self.audit), "cautions": list(self.cautions)})
        return values

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Bands, medians of the laws, the linear prediction and the tested points, against force."""
        from damping.plots.design_loads import design_loads, draw_design_loads  # noqa: PLC0415 - as above

        loads, units = self.extrapolation.loads, self.mode.units
        tested = pd.DataFrame(
            {"sweep": self.data.sweeps, "force": self.data.tested_force, "amplitude": self.data.tested_amplitude}
        )
        low, high = self.data.tested_force.min(), max(self.data.tested_force.max(), loads.force.max())
        bands = self.extrapolation.predict_at(np.linspace(0.8 * low, 1.05 * high, GRID))
        tables = (forms.tabulate_loads(bands), forms.tabulate_loads_by_model(bands), tested, self.table)
        about = (loads.level, units.force, units.length, bands.limit)
        if ax is None:
            return design_loads(*tables, *about)
        draw_design_loads(ax, *tables, *about)
        return ax

    @property
    def title(self) -> str:
        """What this is, in a line."""
        unit = f" ({self.mode.units.length})" if self.mode.units.length else ""
        content = f"{100.0 * self.extrapolation.loads.level:g} % predictive band"
        return f"{self.mode.name}: resonant amplitude{unit}, low to high the {content}"

    @property
    def shown(self) -> pd.DataFrame:
        """The columns of most use."""
        columns = ["force", "extrapolation_ratio", "median", "low", "high", "linear", "linear_overprediction_percent"]
        return self.table[columns]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Cautions, each once."""
        return tuple(dict.fromkeys([*self.cautions, *(c for said in self.extrapolation.loads.cautions for c in said)]))


@dataclass(frozen=True, eq=False, repr=False)
class DiagnosisResult(Result):
    """Why a test departs from its simulation; ``posterior`` of the leading explanation where it was sampled."""

    diagnosis: Diagnosis
    posterior: EffectPosterior | None = None
    audit: Audit | None = None

    @property
    def table(self) -> pd.DataFrame:
        """A row an explanation, most probable first: ``effects, probability``."""
        return forms.tabulate_explanations(self.diagnosis)

    def to_json(self) -> dict[str, Any]:
        """The form ``gap/1``."""
        form: dict[str, Any] = plain(
            {**forms.gap_form(self.diagnosis, self.posterior), "audit": _list_findings(self.audit)}
        )
        return form

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Probabilities of the explanations."""
        from damping.plots.gap import draw_probabilities, gap_probabilities  # noqa: PLC0415 - as above
        from damping.report.gap_figures import tabulate_probability  # noqa: PLC0415 - as above

        table = tabulate_probability(self.diagnosis)
        if ax is None:
            return gap_probabilities(table)
        draw_probabilities(ax, table)
        return ax

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is found, where, what stays in doubt, how far the gap shrinks, and what to test next."""
        from damping.report import gap_page as text  # noqa: PLC0415 - as above

        d = self.diagnosis
        told = [
            text.describe_verdict(d),
            text.place(d),
            *text.list_doubts(d),
            text.reach(d),
            text.describe_following(d),
        ]
        return (*told, *(f"Caution: {caution}." for caution in d.cautions))

    @property
    def title(self) -> str:
        """What is found, in a line."""
        return self.sentences[0]

    @property
    def remarks(self) -> tuple[str, ...]:
        """The other sentences."""
        return self.sentences[1:]


@dataclass(frozen=True, eq=False, repr=False)
class RegressionResult(Result):
    """Everything the regression program says of one curve on one table."""

    regression: Regression

    @property
    def table(self) -> pd.DataFrame:
        """A row a term of the selected model: ``name, coefficient, std_error, t_ratio, p_value``."""
        return tabulate_terms(self.regression.selected.fit)

    def to_json(self) -> dict[str, Any]:
        """The form ``regress/1``."""
        return regress_form(self.regression)

    def printout(self) -> str:
        """The print-out of the program of 1970."""
        return printout(self.regression)

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Deviations against the fitted response."""
        from damping.plots.fits import deviations_figure, draw_deviations  # noqa: PLC0415 - as above

        d, response = self.regression.deviations, self.regression.design.response
        label = f"fitted {response}"
        if ax is None:
            return deviations_figure(d.fitted, d.deviation, d.percent, x_label=label, response=response)
        draw_deviations(ax, d.fitted, d.deviation, x_label=label, response=response)
        return ax

    @property
    def title(self) -> str:
        """What was fitted, and how well."""
        fit = self.regression.selected.fit
        return f"{self.regression.design.response}: {fit.k} terms, {fit.n} rows, rms error {fit.rms_error:.4g}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes of the program."""
        return self.regression.notes


@dataclass(frozen=True, eq=False, repr=False)
class SweepResult(Result):
    """Steady-state sweeps: ``record`` holds the rows, ``name`` says of what."""

    record: Record
    name: str

    @property
    def table(self) -> pd.DataFrame:
        """The rows of the record."""
        return self.record.table.copy()

    def to_json(self) -> dict[str, Any]:
        """The rows: ``{"format": "record/1", "rows": [..]}``."""
        form: dict[str, Any] = plain({"format": "record/1", "rows": self.table.to_dict("records")})
        return form

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Amplitude against frequency, each sweep apart."""
        from damping.plots.fits import draw_sweeps, sweeps  # noqa: PLC0415 - as above

        if ax is None:
            return sweeps(self.record.table)
        draw_sweeps(ax, self.record.table)
        return ax

    @property
    def title(self) -> str:
        """What this is, in a line."""
        return f"{self.name}: {len(self.record)} rows in {len(self.record.sweeps)} sweeps"

    @property
    def shown(self) -> pd.DataFrame:
        """The first rows."""
        return self.record.table.head(MOST_SHOWN)


@dataclass(frozen=True, eq=False, repr=False)
class ConditionResult(SweepResult):
    """The record of one mode from a raw table; ``steps`` say what each step removed."""

    steps: tuple[ConditioningStep, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """The steps in order."""
        return tuple(f"{step.name} ({step.equation})" if step.equation else step.name for step in self.steps)
