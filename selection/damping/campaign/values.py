"""Values of a campaign's results: a mode at a level, the peak of a sensor, a notch, a prediction and its outcome."""

from dataclasses import dataclass
from math import exp, isfinite, pi
from typing import NamedTuple, Self

import numpy as np

from damping.formats.quantity import find_powers, unit
from damping.records.mode import Mode, Tolerance, Units

LEAST_MASS_SD = 0.005  #: least relative standard uncertainty of a modal mass, by the calibration of the sensor


def make_mode(name: str, frequency: float, mass: float = 1.0, mass_sd: float = 0.0) -> Mode:
    """A mode in SI whose frequency (Hz), mass and the relative uncertainty ``mass_sd`` are from its own record."""
    tolerance = Tolerance(mass=max(LEAST_MASS_SD, mass_sd), from_record=True)
    return Mode(name=name, frequency=frequency, mass=mass, tolerance=tolerance, units=Units("N", "m", "s"))


class Bounds(NamedTuple):
    """A median and the ends of its 90 % band."""

    median: float
    low: float
    high: float

    @classmethod
    def about(cls, median: float, below: float, above: float | None = None) -> Self:
        """The band that reaches ``below`` and ``above`` (the same, if not given) in ln from its median."""
        return cls(median, median * exp(-below), median * exp(below if above is None else above))


@dataclass(frozen=True)
class Response:
    """Peak of a sensor: ``band`` in ``unit``."""

    sensor: str
    quantity: str
    unit: str
    band: Bounds


@dataclass(frozen=True)
class At:
    """A mode at a level, ``tested`` or a design level; ``ratio``, of damping, is None if there is no prediction.

    ``frequency_error`` (Hz) and ``ratio_error`` are standard errors, None if unknown.
    """

    level: float
    tested: bool
    frequency: float
    ratio: Bounds | None
    response: tuple[Response, ...]
    cautions: tuple[str, ...]
    reached: float | None = None  #: the input at the mode, if the run was notched there and the input is not the level
    frequency_error: float | None = None
    ratio_error: float | None = None

    @property
    def input(self) -> float:
        """The input at the mode."""
        return self.level if self.reached is None else self.reached

    @property
    def largest(self) -> Response | None:
        """The response of the largest motion: in several units, as displacement, v/omega and a/omega^2."""
        omega = 2.0 * pi * self.frequency if isfinite(self.frequency) else 1.0

        def measure(response: Response) -> float:
            powers = find_powers(response.unit)
            return response.band.median * (unit(response.unit).factor * omega ** powers[2] if powers else 1.0)

        return max(self.response, key=measure, default=None)


@dataclass(frozen=True)
class Notch:
    """The notch that the limit of a sensor requires at one mode."""

    mode: str
    sensor: str
    unit: str  #: of the sensor
    limit: float  #: in that unit
    design: float  #: level
    level: float  #: largest input that keeps the limit
    depth_db: float  #: by which it is below the design level
    low: float | None  #: frequency at which the notch begins, Hz; None if none is needed
    high: float | None  #: at which it ends
    more_db: float  #: largest step above the top level tested at this mode, dB
    tested: float  #: that level
    drive_unit: str = ""  #: of all levels

    def __str__(self) -> str:
        tested, design = (f"{level:.4g} {self.drive_unit}".rstrip() for level in (self.tested, self.design))
        more = f"at most {self.more_db:+z.1f} dB from the {tested} tested at this mode"
        if self.low is None or self.high is None:
            return f"{self.mode}, {self.sensor} <= {self.limit:g} {self.unit}: no notch; {more}"
        notch = f"notch {self.depth_db:.1f} dB from {self.low:.4g} to {self.high:.4g} Hz"
        return f"{self.mode}, {self.sensor} <= {self.limit:g} {self.unit}: {notch} below {design}; {more}"


@dataclass(frozen=True)
class Outcome:
    """A measured peak and its prediction before the run, both in ``unit``."""

    mode: str
    sensor: str
    unit: str
    level: float
    measured: float
    predicted: Bounds
    drive_unit: str = ""

    @property
    def above_db(self) -> float:
        """Measured peak over the predicted median, dB."""
        return float(20.0 * np.log10(self.measured / self.predicted.median))

    @property
    def held(self) -> bool:
        """Whether the measured peak lies in the predicted band."""
        return self.predicted.low <= self.measured <= self.predicted.high

    def __str__(self) -> str:
        median, low, high = self.predicted
        place, level = "within" if self.held else "OUTSIDE", f"{self.level:.3g} {self.drive_unit}".rstrip()
        return (
            f"{self.mode}, {self.sensor} at {level}: {self.measured:.4g} {self.unit} measured, {place} the "
            f"{median:.4g} ({low:.4g} to {high:.4g}) predicted, {self.above_db:+z.1f} dB"
        )
