"""Answers for a record: the ranking of laws, the loads they predict, and the curve of damping ratio."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from damping.errors import InputError, describe_nearest
from damping.extrapolation import Extrapolation
from damping.extrapolation.cautions import BEYOND_TEST
from damping.extrapolation.curve import Curve, list_drawn_amplitudes, predict_forces, trace_loads
from damping.extrapolation.prediction import Loads
from damping.extrapolation.prepared import PreparedRecord
from damping.ranked_law import RankedLaw
from damping.ranking import Candidate, Ranking
from damping.records.mode import Mode
from damping.records.summary import MOST_SHOWN
from damping.records.text import AGREED, Disagreement
from damping.report import forms
from damping.result import Result, complete_form

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class RankingResult(Result):
    """Candidate damping laws of a record, best first, with the rows they were fitted to."""

    ranking: Ranking
    prepared: PreparedRecord
    against: Disagreement = AGREED  #: where no law fits, how the diagnosis contradicts that

    @property
    def mode(self) -> Mode | None:
        """The mode of the rows that were ranked, where one was given."""
        return self.prepared.measured.mode

    def __getitem__(self, law: str) -> RankedLaw:
        """The law by its text in the column ``law``, or that of an equivalent law; its forces may be in any order."""
        if candidate := self._find(law):
            return RankedLaw(candidate, self.ranking.data)
        nearest = describe_nearest(str(law), [candidate.name for candidate in self.ranking.candidates])
        raise InputError(f"no law {law!r}", expected=f"{nearest} or another of the column law")

    def __contains__(self, law: object) -> bool:
        """Whether there is a law of this text, as in ``ranking[law]``."""
        return self._find(law) is not None

    def _find(self, law: object) -> Candidate | None:
        asked = set(str(law).split(" + "))
        named = ((own, (own.name, *own.equivalents)) for own in self.ranking.candidates)
        return next((own for own, names in named if asked in [set(name.split(" + ")) for name in names]), None)

    def __iter__(self) -> Iterator[RankedLaw]:
        return (RankedLaw(candidate, self.ranking.data) for candidate in self.ranking.candidates)

    def __len__(self) -> int:
        return len(self.ranking.candidates)

    @property
    def table(self) -> pd.DataFrame:
        """One row for each law, best first: ``rank, law, weight, score, held_out_error, ...``; errors in per cent."""
        table = forms.tabulate_candidates(self.ranking)
        first = ["rank", "law", "weight", "score", "held_out_error"]
        return table[[*first, *table.columns.drop(first)]]

    @property
    def headlines(self) -> tuple[str, ...]:
        """Sentences to show before the ranking: the verdict on the fit; empty if it is good."""
        return tuple(filter(None, [self.ranking.fit.sentence]))

    @property
    def cautions(self) -> tuple[str, ...]:
        """Objections of the diagnosis, headlines, notes on the preparation of the rows, and doubts about the mode."""
        of_mode = forms.list_mode_cautions(self.ranking.data, self.mode) if self.mode else ()
        return (*self.against, *self.headlines, *self.prepared.notes, *of_mode)

    def to_json(self) -> dict[str, Any]:
        """The form ``rank/1``."""
        return complete_form(forms.rank_form(self.ranking), self.prepared.findings, self.cautions)

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Weights as bars; without ``ax`` the figure also shows the errors of each law."""
        from damping.plots.fits import ranking  # noqa: PLC0415 - only drawing needs matplotlib

        figure = ranking(self.table, axes=ax)
        return ax or figure

    @property
    def title(self) -> str:
        """What this is, in a line."""
        return f"Damping laws, best first: {self.ranking.criterion}"

    @property
    def shown(self) -> pd.DataFrame:
        """The best ``MOST_SHOWN`` laws."""
        columns = ["rank", "law", "weight", "score", "held_out_error", "average_absolute_percent"]
        return self.table[columns].head(MOST_SHOWN)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Findings of the audit, cautions about the ranking, and how many candidates are not shown."""
        hidden = len(self) - MOST_SHOWN
        return (
            *map(str, self.prepared.findings.findings),
            *self.cautions,
            *([f"{hidden} further candidates in .table"] if hidden > 0 else []),
        )


@dataclass(frozen=True, eq=False, repr=False)
class PredictedResult(Result):
    """Predictions from a record, with the data behind them."""

    extrapolation: Extrapolation
    prepared: PreparedRecord
    against: Disagreement = AGREED  #: where the diagnosis disagrees

    @property
    def mode(self) -> Mode:
        """The mode of the rows that predictions rest on."""
        return self.prepared.mode

    @property
    def headlines(self) -> tuple[str, ...]:
        """Sentences to show before the predictions: loads that the diagnosis disputes, and the verdict on the fit."""
        return (*self.against.on_loads, *filter(None, [self.extrapolation.plan.fit.sentence]))

    @property
    def measured_in(self) -> dict[str, Any]:
        """Keys of a form that name the drive quantity and the units."""
        return {"drive": self.mode.units.drive, "units": vars(self.mode.units)}

    @property
    def cautions(self) -> tuple[str, ...]:
        """Objections of the diagnosis, headlines, notes on the preparation of the rows, and doubts about the mode."""
        of_mode = forms.list_mode_cautions(self.extrapolation.plan.data, self.mode)
        return tuple(dict.fromkeys((*self.against, *self.headlines, *self.prepared.notes_of_loads, *of_mode)))


@dataclass(frozen=True, eq=False, repr=False)
class LoadsResult(PredictedResult):
    """Resonant amplitudes at forces beyond the test."""

    @property
    def loads(self) -> Loads:
        """The predictions: amplitudes at forces, or forces for amplitudes."""
        return replace(self.extrapolation.loads, cautions=self.curve.cautions)

    @cached_property
    def curve(self) -> Curve:
        """Frequency and damping ratio of each prediction."""
        return trace_loads(self.extrapolation.loads, self.prepared.backbone, self.extrapolation.plan.data)

    @property
    def table(self) -> pd.DataFrame:
        """One row for each prediction, with the keys of the form; NaN where it is refused, ``cautions`` say why."""
        return forms.tabulate_loads(self.loads, self.curve)

    def to_json(self, *, whole: bool = True) -> dict[str, Any]:
        """The form ``loads/1``; if ``whole``, at given forces also the sensitivity to priors and the next level."""
        form = forms.loads_form(self.loads, self.extrapolation.plan, self.curve)
        if whole and self.loads.amplitude is None:
            further = self.extrapolation.next_level
            form["sensitivity"] = self.extrapolation.with_other_priors.to_dict("records")
            form["next_level"] = further and {**vars(further), "others": further.others.to_dict("records")}
        return complete_form({**form, **self.measured_in}, self.prepared.findings, self.cautions)

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Bands, medians of the laws, the linear prediction and the tested points, against force."""
        from damping.plots.curves import design_loads  # noqa: PLC0415 - as above
        from damping.plots.given import check_axes  # noqa: PLC0415 - as above

        check_axes(ax)
        force, units, data = self.loads.force[np.isfinite(self.loads.force)], self.mode.units, self.prepared.data
        bands = self.extrapolation.predict_drawn(data.tested_force)
        design = self.loads if self.loads.amplitude is None else self.extrapolation.predict_at(force)
        about = (units.force, units.length, bands.limit)
        tables = (forms.tabulate_loads(bands), forms.tabulate_tested(data), forms.tabulate_loads(design))
        figure = design_loads(*tables, self.loads.level, *about, axes=ax)
        return ax or figure

    @property
    def title(self) -> str:
        """What this is, in a line."""
        by_force, units = self.loads.amplitude is None, self.mode.units
        label, unit = ("resonant amplitude", units.length) if by_force else (f"{units.drive} at resonance", units.force)
        content = f"{100.0 * self.loads.level:g} % predictive band"
        return f"{self.mode.name}: {label}{f' ({unit})' if unit else ''}, low to high the {content}"

    @property
    def shown(self) -> pd.DataFrame:
        """The most useful columns."""
        given = "force" if self.loads.amplitude is None else "amplitude"
        columns = [given, "extrapolation_ratio", "median", "low", "high", "linear", "frequency"]
        return self.table[[*columns, "damping_ratio", "damping_ratio_low"]]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Findings of the audit and cautions, each once."""
        found = map(str, self.prepared.findings.findings)
        return tuple(dict.fromkeys([*found, *self.cautions, *(c for caution in self.loads.cautions for c in caution)]))


@dataclass(frozen=True, eq=False, repr=False)
class CurveResult(PredictedResult):
    """Damping ratio, Q and frequency against amplitude and force."""

    curve: Curve = field(kw_only=True)

    @property
    def table(self) -> pd.DataFrame:
        """One row for each resonance, columns as in the form; the ends of a band are ``NAME_low, NAME_high``."""
        return self.curve.table

    def to_json(self) -> dict[str, Any]:
        """The form ``curve/1``; ``laws`` with their weights is an extra key."""
        laws = [{"name": member.name, "weight": member.weight} for member in self.extrapolation.members]
        form = {**forms.curve_form(self.curve), "laws": laws, **self.measured_in}
        return complete_form(form, self.prepared.findings, self.cautions)

    def plot(self, ax: Axes | None = None) -> Axes | Figure:
        """Damping ratio and Q against amplitude; the range beyond the test is hatched."""
        from damping.plots.curves import damping_curve  # noqa: PLC0415 - as above
        from damping.plots.given import check_axes  # noqa: PLC0415 - as above

        check_axes(ax)
        amplitudes = list_drawn_amplitudes(self.curve.amplitude.median, self.prepared.data)
        loads = predict_forces(self.extrapolation, amplitudes, each=False) if amplitudes.size else None
        drawn = trace_loads(loads, self.prepared.backbone, self.prepared.data) if loads else self.curve
        figure = damping_curve(drawn.table, self.curve.level, self.mode.units.length, axes=ax)
        return ax or figure

    @property
    def title(self) -> str:
        """What this is, in a line."""
        return f"{self.mode.name}: damping of the resonance, low to high the {100.0 * self.curve.level:g} % band"

    @property
    def shown(self) -> pd.DataFrame:
        """The most useful columns."""
        columns = ["amplitude", "force", "frequency", "damping_ratio", "damping_ratio_low", "damping_ratio_high", "q"]
        return self.table[[*columns, "tested"]]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Findings and cautions, each once; those on rows beyond the test are left to the column ``tested``."""
        found = map(str, self.prepared.findings.findings)
        of_rows = (c for caution in self.curve.cautions for c in caution if not c.startswith(BEYOND_TEST))
        return tuple(dict.fromkeys([*found, *self.cautions, *of_rows]))
