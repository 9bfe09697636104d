"""A user's own function as the simulation under test, expanded in its parameters about the nominal or fitted values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from inspect import isclass, iscoroutinefunction, signature, unwrap
from numbers import Real
from pathlib import Path
from traceback import extract_tb
from typing import NamedTuple

import numpy as np

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray
from damping.effects.contract import Drive, OfDrive, Terms
from damping.effects.terms import complex_stiffness
from damping.errors import InputError
from damping.records.mode import Mode
from damping.records.text import describe_shortened

#: Step of the slopes about fitted parameters, over a tolerance: they are near the answer, and a tenth of a tolerance of
#: 1 % is still a thousand times what an iterative solution may be off.
_NEAR_STEP = 0.1

#: A user's own simulation: force (n,), frequency in Hz (n,) and its parameters by name in, amplitude and phase lag out.
Simulate = Callable[..., tuple[FloatArray, FloatArray]]


_EXPECTED_DEFAULT = "a default (value, tolerance), tolerance 0 where the value is exact"


class Expansion(NamedTuple):
    """Z less that of the mode about parameters c, at n rows."""

    at_centre: ComplexArray  #: its value at c, (n,)
    by_parameter: ComplexArray  #: derivatives by ln(parameter), (parameters, n)
    missed: ComplexArray  #: its value at the nominal parameters less what the others give there, (n,)


@dataclass(frozen=True)
class Simulator:
    """A user's own simulation, as the difference of its complex stiffness from that of the mode that stands for it.

    The function is of the first state without added mass; masses and further states change Z as they change the mode's.

    Z = F exp(i phase)/A is smooth in the parameters even where the resonance is not. Z is evaluated at the nominal
    values and, for differences, one tolerance away in each. About fitted parameters c (``centre``) Z is
    Z(c) + Z'(c) (d - c) + (1 - s)^2 times what that misses at the nominal values, s from 0 there to 1 at c.
    """

    function: Simulate  #: the simulation
    #: ``values``, ``tolerances``: of its parameters by name, tolerances relative
    values: Mapping[str, float]
    tolerances: Mapping[str, float]
    mode: Mode  #: stands for it where an effect needs a mass, a frequency, a damping
    centre: Mapping[str, float] = field(default_factory=dict)  #: ln deviations about which Z is expanded, others 0
    _known: dict[tuple[bytes, bytes], Expansion] = field(default_factory=dict, compare=False)

    @staticmethod
    def read(function: Simulate, mode: Mode) -> Simulator:
        """The simulator of a function whose keyword parameters have defaults (value, relative tolerance).

        InputError: another signature, a value that is not finite or varies as a share of 0, a tolerance below 0.
        """
        if not callable(function):
            given = f"the simulator is of type {type(function).__name__}"
            raise InputError(given, expected="a function of force, frequency")
        for kind, is_of in (("class", isclass), ("coroutine", iscoroutinefunction)):
            if is_of(unwrap(function)):
                raise InputError(f"the simulator is a {kind}", expected="a function, def simulate(force, frequency)")
        try:
            every = signature(function).parameters.values()
        except ValueError:  # some functions of Python itself tell none
            raise InputError("the simulator tells no parameters", expected="a function of force, frequency") from None
        parameters = [p for p in every if p.kind is p.KEYWORD_ONLY]
        if [p.name for p in every][:2] == ["frequency", "force"]:
            raise InputError("the simulator takes frequency before force", expected="force, then frequency")
        if len(every) > len(parameters) + 2:
            raise InputError(
                "the simulator takes more than force and frequency by position",
                expected="keyword-only parameters: def simulate(force, frequency, *, mass=(2.0, 0.05))",
            )
        values, tolerances = {}, {}
        for parameter in parameters:
            pair = parameter.default
            if not (isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(v, Real) for v in pair)):
                given = "no default" if pair is parameter.empty else f"the default {describe_shortened(repr(pair), 40)}"
                raise InputError(f"parameter {parameter.name} of the simulator has {given}", expected=_EXPECTED_DEFAULT)
            value, tolerance = map(float, pair)
            if not np.isfinite(value) or (value == 0.0 and tolerance > 0.0):
                what = f"parameter {parameter.name} of the simulator is {value:g}"
                expected = "a finite number" if value else "another number, or tolerance 0: a share of 0 is 0"
                raise InputError(what, expected=expected)
            if not 0.0 <= tolerance < np.inf:
                what = f"the tolerance of parameter {parameter.name} of the simulator is {tolerance:g}"
                raise InputError(what, expected="a relative standard uncertainty, 0 or more")
            values[parameter.name], tolerances[parameter.name] = value, tolerance
        return Simulator(function, values, tolerances, mode)

    def freed(self, name: str, by: float) -> Simulator:
        """The simulator with another tolerance of one parameter."""
        centre = {other: at for other, at in self.centre.items() if other != name}
        return replace(self, tolerances={**self.tolerances, name: by}, centre=centre, _known={})

    def about(self, deviations: Mapping[str, float]) -> Simulator:
        """The simulator expanded about ln deviations of its parameters."""
        free = {name: at for name, at in deviations.items() if self.tolerances[name] != 0.0 and at != 0.0}
        return replace(self, centre=free, _known={})

    def beside(self, deviation: FloatArray, bare: Terms) -> OfDrive:
        """Z less that of the ``bare`` mode, at ln deviations (batch, parameters, 1) of the parameters."""
        centre = np.array([self.centre.get(name, 0.0) for name in self.values])[:, np.newaxis]
        moved = deviation - centre
        weighed = centre / np.array([by**2 or 1.0 for by in self.tolerances.values()])[:, np.newaxis]
        short = -np.sum(moved * weighed, axis=1) / (np.sum(centre * weighed) or 1.0)  # 1 - s

        def part(drive: Drive) -> ComplexArray:
            at_centre, by_parameter, missed = self._expand(drive, bare)
            return np.asarray(at_centre + np.sum(moved * by_parameter, axis=1) + short**2 * missed)

        return part

    def _expand(self, drive: Drive, bare: Terms) -> Expansion:
        """Z less that of the ``bare`` mode about the centre; evaluated once for each drive."""
        key = (drive.F.tobytes(), drive.omega.tobytes())
        if key not in self._known:
            A, Z = self._stiffness(drive, self.centre)
            steps = {name: by * (_NEAR_STEP if name in self.centre else 1.0) for name, by in self.tolerances.items()}
            slopes = [
                (self._stiffness(drive, {**self.centre, name: self.centre.get(name, 0.0) + step})[1] - Z) / step
                if step
                else np.zeros_like(Z)
                for name, step in steps.items()
            ]
            by_parameter = np.asarray(slopes).reshape(-1, len(Z))
            missed = np.zeros_like(Z)
            if self.centre:
                missed = self._stiffness(drive, {})[1] - Z
                missed += sum(self.centre.get(name, 0.0) * slope for name, slope in zip(steps, slopes, strict=True))
            alone = Drive(drive.F, drive.omega)  # the function knows no state: what a state adds stays
            self._known[key] = Expansion(Z - complex_stiffness(bare, A, alone)[0][0], by_parameter, missed)
        return self._known[key]

    def _stiffness(self, drive: Drive, deviations: Mapping[str, float]) -> tuple[FloatArray, ComplexArray]:
        """Amplitude and Z of the simulation at ln deviations of some parameters; errors as of `answer`."""
        changed = {name: self.values[name] * float(np.exp(by)) for name, by in deviations.items()}
        A, phase = self.answer(drive.F, drive.omega / RAD_S_PER_HZ, changed)
        return A, np.asarray(drive.F * np.exp(1j * phase) / A)

    def answer(
        self, force: FloatArray, frequency: FloatArray, changed: Mapping[str, float]
    ) -> tuple[FloatArray, FloatArray]:
        """Amplitude and phase of the simulation with some parameters changed, at forces and frequencies in Hz (n,).

        InputError: the function fails, or does not return an amplitude and a phase for every row.
        """
        expected = "(amplitude, phase), one number each per row"
        named = ", ".join(f"{name} = {value:.6g}" for name, value in changed.items())
        moved = f" with {named}" if named else ""
        try:  # copies: a function may work in place
            answer = self.function(force.copy(), frequency.copy(), **{**self.values, **changed})
            parts = [_as_array(part) for part in answer] if isinstance(answer, tuple) else []
        except (Exception, SystemExit) as error:
            *_, at = extract_tb(error.__traceback__)
            where = "" if at.filename == __file__ else f" in line {at.lineno} of {Path(at.filename).name}"
            raise InputError(f"the simulator{moved} ends with {error!r}{where}", expected=expected) from error
        if len(parts) != 2:
            count = f" of {len(answer)}" if isinstance(answer, tuple) else ""
            raise InputError(f"the simulator{moved} returns a {type(answer).__name__}{count}", expected=expected)
        for name, part in zip(("amplitude", "phase"), parts, strict=True):
            returned = f"the {name} that the simulator{moved} returns"
            if part.dtype.kind not in "iuf" or part.shape != force.shape:
                given = f"is of type {part.dtype} and shape {part.shape}, for {force.size} rows"
                raise InputError(f"{returned} {given}", expected=expected)
            if len(bad := np.flatnonzero(~(np.isfinite(part) & ((part > 0) | (name == "phase"))))):
                row = f"at force {force[bad[0]]:.4g} and {frequency[bad[0]]:.5g} Hz"
                raise InputError(f"{returned} is {part[bad[0]]:g} {row}", expected=f"{expected}; amplitudes > 0")
        A, phase = (part.astype(np.float64) for part in parts)
        return A, phase


def _as_array(returned: object) -> np.ndarray:
    """What a simulator returns as an array; what a mask hides is NaN, so that it is no answer."""
    masked = np.ma.is_masked(returned)
    return np.ma.filled(np.ma.asarray(returned, np.float64), np.nan) if masked else np.asarray(returned)
