"""JSON forms written by commands, read and checked: ranking, loads, curve, campaign and study."""

from pathlib import Path
from typing import Annotated, Literal, Self, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from damping.errors import InputError
from damping.records.mode import Units

#: Largest form that is read, bytes (a ranking of a hundred candidates takes 50 000).
MAX_FORM_SIZE = 10_000_000
Positive = Annotated[float, Field(gt=0.0)]


class FormPart(BaseModel):
    """A part of a form: unknown keys are ignored, and no number is NaN or infinite."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


AnyForm = TypeVar("AnyForm", bound=BaseModel)


def read_form(form: type[AnyForm] | TypeAdapter[AnyForm], content: bytes, file: Path, expected: str) -> AnyForm:
    """A form, or one of several, from its JSON text. InputError for the first fault."""
    try:
        return form.validate_json(content) if isinstance(form, TypeAdapter) else form.model_validate_json(content)
    except ValidationError as error:
        first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"] if "/" not in str(part))  # the name of a form is no place
    raise InputError(f"{place}: {first['msg']}".lstrip(": "), file=file, expected=expected)


class IntervalForm(FormPart):
    """A median with its band."""

    median: float | None = None
    low: float | None = None
    high: float | None = None


class ParameterForm(FormPart):
    """A parameter of a force; the first is its coefficient."""

    value: float | None = None
    std_error: float | None = None
    t_ratio: float | None = None
    low: float | None = None
    high: float | None = None


class ForceForm(ParameterForm, extra="allow"):
    """A force of a candidate: its coefficient, and its shape parameters by name as further keys."""

    __pydantic_extra__: dict[str, ParameterForm | float | str | None]

    name: str
    coefficient: float | None = None

    def parameters(self) -> dict[str, ParameterForm]:
        """The coefficient, then the shape parameters."""
        own = self.model_dump(include={"std_error", "t_ratio", "low", "high"})
        shapes = {k: v for k, v in self.__pydantic_extra__.items() if isinstance(v, ParameterForm)}
        return {"coefficient": ParameterForm(value=self.coefficient, **own), **shapes}


class CandidateForm(FormPart):
    """A law of a ranking."""

    rank: int | None
    name: str
    forces: list[ForceForm]
    score: float | None = None
    weight: float | None = None
    held_out_error: float | None = None
    average_absolute_percent: float | None = None
    physical: bool | None = None
    cautions: list[str] = []
    equivalents: list[str] = []


class RankForm(FormPart):
    """A ranking: candidates, best first."""

    format: Literal["rank/1"]
    criterion: str
    models: Annotated[list[CandidateForm], Field(min_length=1)]


class FindingForm(FormPart):
    """A finding of the audit; ``mode``: of a campaign's mode."""

    check: str
    what: str
    mode: str = ""


class DampingForm(FormPart):
    """A form that holds damping ratios."""

    name: str = "mode"  #: of the mode, where the form holds one
    level: float
    units: Units = Units()
    drive: str = "force"
    cautions: list[str] = []
    audit: list[FindingForm] = []


class MemberForm(IntervalForm):
    """A law that contributes to a prediction."""

    name: str
    weight: float | None = None


class PredictionForm(FormPart):
    """A prediction: median and band are amplitudes at a design force, or forces for a design amplitude."""

    force: float | None = None
    amplitude: float | None = None
    median: float | None
    low: float | None
    high: float | None
    linear: float | None = None
    linear_overprediction_percent: float | None = None
    extrapolation_ratio: float | None = None
    frequency: float | None = None
    damping_ratio: IntervalForm | None = None
    cautions: list[str] = []
    by_model: list[MemberForm] = []

    @model_validator(mode="after")
    def _asks_one(self) -> Self:
        if (self.force is None) == (self.amplitude is None):
            raise PydanticCustomError("asked", "force or amplitude is required, and not both")
        return self


class LoadsForm(DampingForm):
    """Predictions at design forces, or at design amplitudes."""

    format: Literal["loads/1"]
    predictions: Annotated[list[PredictionForm], Field(min_length=1)]

    @property
    def asked(self) -> str:
        """The given quantity: ``force`` or ``amplitude``."""
        return "force" if self.predictions[0].amplitude is None else "amplitude"

    @model_validator(mode="after")
    def _asks_alike(self) -> Self:
        if len({row.amplitude is None for row in self.predictions}) > 1:
            raise PydanticCustomError("alike", "predictions at forces and at amplitudes in one form")
        return self


class CurveRowForm(FormPart):
    """A resonance; the given quantity, amplitude or force, has no band."""

    amplitude: float | None = None
    amplitude_low: float | None = None
    amplitude_high: float | None = None
    force: float | None = None
    force_low: float | None = None
    force_high: float | None = None
    frequency: float | None = None
    frequency_low: float | None = None
    frequency_high: float | None = None
    damping_ratio: IntervalForm = IntervalForm()
    q: IntervalForm = IntervalForm()
    tested: bool | None = None
    cautions: list[str] = []


class CurveForm(DampingForm):
    """Resonances within the test and beyond it."""

    format: Literal["curve/1"]
    rows: Annotated[list[CurveRowForm], Field(min_length=1)]


Answer: TypeAlias = RankForm | LoadsForm | CurveForm
ANSWER = TypeAdapter[Answer](Annotated[Answer, Field(discriminator="format")])  #: reads any of these


class PeakForm(FormPart):
    """The peak of a sensor, null if it is not known."""

    sensor: str
    quantity: str = ""
    unit: str
    median: Positive | None
    low: Positive | None
    high: Positive | None


class PeaksForm(FormPart):
    """A level of a mode with its peaks; ``input``: if it differs from the level."""

    level: float
    input: Positive | None = None
    tested: bool | None = None
    frequency: Positive | None = None
    damping_ratio: IntervalForm | None = None
    response: list[PeakForm] = []
    cautions: list[str] = []


class PeaksOfMode(FormPart):
    """A mode of a campaign with its peaks."""

    name: str
    frequency: Positive | None = None
    at: list[PeaksForm]


class CampaignForm(DampingForm):
    """The damping and the peaks of a campaign."""

    format: Literal["campaign/1"]
    level: float = 0.9  # that of every campaign
    modes: list[PeaksOfMode]
    level_name: str = "level"
    level_unit: str = ""

    @model_validator(mode="after")
    def _names_apart(self) -> Self:
        names = [mode.name for mode in self.modes]
        if twice := [name for name in names if names.count(name) > 1]:
            raise PydanticCustomError("apart", "two modes are called {name}", {"name": twice[0]})
        return self


Damped: TypeAlias = LoadsForm | CurveForm | CampaignForm  #: any of the forms that hold damping ratios
DAMPED = TypeAdapter[Damped](Annotated[Damped, Field(discriminator="format")])  #: reads any of these


class PowerLawForm(FormPart):
    """The power law of velocity, the first that a study lists."""

    p: float
    p_high: float | None = None  #: high end of its interval, which is symmetric
    level: float = 0.95  #: content of that

    @property
    def half_width(self) -> float | None:
        """Of the interval: a standard error of the few degrees of freedom that few levels leave looks too certain."""
        return None if self.p_high is None else self.p_high - self.p


class StudyRecordForm(FormPart):
    """A record of a study."""

    name: Annotated[str, Field(min_length=1, max_length=80, pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]
    title: str = ""
    units: Units = Units()
    audit: list[FindingForm] = []
    cautions: list[str] = []
    rank: RankForm
    loads: LoadsForm | None = None
    curve: CurveForm | None = None
    power_laws: list[PowerLawForm] = []


class StudyForm(FormPart):
    """``summary.json`` of a study."""

    format: Literal["study/1"]
    title: str
    seed: int
    level: float
    records: list[StudyRecordForm]
