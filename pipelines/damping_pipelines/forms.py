"""The forms ``rank/1`` and ``loads/1`` read back, checked, and as tables."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import pandas as pd
from pydantic import BaseModel, ConfigDict, Field


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class _Value(_Part):
    value: float | None = None
    std_error: float | None = None
    t_ratio: float | None = None
    low: float | None = None
    high: float | None = None


class _Force(BaseModel):
    """A force of a candidate: its coefficient, and its shape parameters by name as further keys."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, _Value | float | str | None]

    name: str
    coefficient: float | None = None
    std_error: float | None = None
    t_ratio: float | None = None
    low: float | None = None
    high: float | None = None

    def parameters(self) -> dict[str, _Value]:
        """The coefficient, then the shape parameters."""
        own = _Value(value=self.coefficient, **{name: getattr(self, name) for name in _ERRORS})
        return {"coefficient": own, **{k: v for k, v in self.__pydantic_extra__.items() if isinstance(v, _Value)}}


_ERRORS = ("std_error", "t_ratio", "low", "high")


class _Candidate(_Part):
    rank: int | None
    name: str
    forces: list[_Force]
    score: float | None = None
    weight: float | None = None
    held_out_error: float | None = None
    average_absolute_percent: float | None = None
    physical: bool | None = None
    cautions: list[str] = []
    equivalents: list[str] = []


class RankForm(_Part):
    """A ranking: candidates, best first."""

    format: Literal["rank/1"]
    criterion: str
    models: Annotated[list[_Candidate], Field(min_length=1)]


class _Member(_Part):
    name: str
    weight: float | None = None
    median: float | None = None
    low: float | None = None
    high: float | None = None


class _Prediction(_Part):
    force: float
    median: float | None
    low: float | None
    high: float | None
    linear: float | None = None
    linear_overprediction_percent: float | None = None
    extrapolation_ratio: float | None = None
    cautions: list[str] = []
    by_model: list[_Member] = []


class LoadsForm(_Part):
    """Predictions at design forces."""

    format: Literal["loads/1"]
    level: float
    predictions: Annotated[list[_Prediction], Field(min_length=1)]


def tabulate_ranking_rows(form: RankForm) -> pd.DataFrame:
    """A row for each parameter of each force of each candidate."""
    rows: list[dict[str, Any]] = []
    for model in form.models:
        whole = {"model": model.name, **model.model_dump(exclude={"forces", "cautions", "name", "equivalents"})}
        found = [(force.name, *each) for force in model.forces for each in force.parameters().items()]
        for force, parameter, value in found or [("", "", _Value())]:
            part = {"force": force, "parameter": parameter, **value.model_dump()}
            rows.append({**whole, **part, "cautions": "; ".join(model.cautions)})
    return _tabulate_typed(pd.DataFrame(rows), ("model", "force", "parameter", "cautions")).assign(
        criterion=form.criterion
    )


def tabulate_loads_rows(form: LoadsForm) -> pd.DataFrame:
    """A row for each design force and law, the average over laws first (``model`` empty)."""
    rows: list[dict[str, Any]] = []
    for prediction in form.predictions:
        average = prediction.model_dump(exclude={"by_model", "cautions"})
        rows.append({"model": "", "weight": None, **average, "cautions": "; ".join(prediction.cautions)})
        rows += [
            {"model": law.name, "force": prediction.force, **law.model_dump(exclude={"name"})}
            for law in prediction.by_model
        ]
    return _tabulate_typed(pd.DataFrame(rows), ("model", "cautions")).assign(level=form.level)


def _tabulate_typed(table: pd.DataFrame, text: tuple[str, ...]) -> pd.DataFrame:
    """Columns of one type each: ``text``, whole and logical numbers that may be missing, and numbers."""
    types = {"rank": "Int64", "physical": "boolean", **dict.fromkeys(text, "str")}
    filled = table.fillna(dict.fromkeys(text, ""))
    return filled.astype({str(name): types.get(str(name), "float64") for name in table.columns})
