"""Errors of the rig: gain, lag, delay, saturation, a background signal, a sensor with a resonance of its own."""

from collections.abc import Callable, Mapping
from itertools import chain
from math import log

import numpy as np

from damping.arrays import ComplexArray, FloatArray, Floats, differs
from damping.effects.contract import Drive, Effect, Form, FormVariable, Instrument, Reading, Scales, Terms, add_parts
from damping.effects.structure import spread_distance
from damping.effects.terms import third_harmonic
from damping.forces.shapes import FORCE, LENGTH, TIME, TURN, Shape

_DELAY = 0.25  #: prior odds of a delay against a phase lag, nearly equal in the narrow band of one mode: 1 to 4
#: ln(amplitude over the clipping level) ...
_OVER = np.linspace(0.0, 5.0, 400)
_A = np.exp(_OVER)
#: ... and ln of the fundamental of a sine of amplitude a clipped at 1: (2/pi)(a asin(1/a) + sqrt(1 - 1/a^2)).
_CLIPPED = np.log((2.0 / np.pi) * (_A * np.arcsin(1.0 / _A) + np.sqrt(np.maximum(1.0 - _A**-2.0, 0.0))))
#: Least slope of a characteristic that is inverted.
_LEAST_SLOPE = 0.05
_CLIPPED_SLOPE = np.maximum(np.gradient(_CLIPPED, _OVER), 0.0)
_TURN = int(np.argmax(_CLIPPED_SLOPE < _LEAST_SLOPE))
#: Nodes and weights of the integral over a/A from 0 to 1: right to 1e-4 for compression up to a power of 8.
_GAUSS = np.polynomial.legendre.leggauss(16)
_PARTS = 0.5 * (_GAUSS[0] + 1.0)
_WEIGHTS = 0.5 * _GAUSS[1]


AMPLITUDE_SCALE: Effect = Effect(
    name="amplitude-scale",
    kind="instrument",
    sentence="all amplitudes are off by one factor (sensor gain)",
    # strength: |ln(factor)|, at most that of a factor 3, above or below 1
    forms=lambda scales: AMPLITUDE_SCALE.either_sign(
        lambda size: {"factor": np.exp(size)},
        change=lambda terms, size: terms._replace(gain=terms.gain + size),
        largest=log(3.0),
    ),
    simulate=lambda terms, table: terms._replace(gain=terms.gain + log(table["factor"])),
    shapes=(Shape("factor", above=0.0),),
)


def list_states(scales: Scales) -> range:
    """Numbers, from 1, of states whose readings may differ: of several states with more sweeps than states."""
    return range(1, scales.states + 1) if 1 < scales.states < scales.sweeps else range(0)


LARGEST_LAG = 1.0  #: rad, of all phases at resonance: a larger one belongs to another quantity, as that of a velocity


def lag_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |lag|, at most ``LARGEST_LAG``, of all phases or of those of one state of several."""
    every = PHASE_LAG.either_sign(lambda lag: {"lag": lag}, largest=LARGEST_LAG)
    sides = (
        PHASE_LAG.either_sign(lambda lag, k=k: {"lag": lag, "state": float(k)}, f"of state {k}", largest=LARGEST_LAG)
        for k in list_states(scales)
    )
    return (*every, *chain.from_iterable(sides))


def simulate_lag(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """The terms with a further ``lag`` of all phases, or of those of one ``state``, from 1."""
    if not differs(table["state"], 0.0):
        return terms._replace(lag=terms.lag + table["lag"])
    return terms.plus(offset=lambda drive: -1j * table["lag"] * (np.asarray(drive.state) == table["state"] - 1.0))


PHASE_LAG: Effect = Effect(
    name="phase-lag",
    kind="instrument",
    sentence="all phases, or those of one state, are off by one constant",
    forms=lag_forms,
    simulate=simulate_lag,
    shapes=(Shape("lag", above=-TURN, below=TURN), Shape("state", least=0.0, default=0.0)),
    need="phase",
)


TIME_DELAY: Effect = Effect(
    name="time-delay",
    kind="instrument",
    sentence="the phases are off in proportion to frequency (a delay)",
    # strength: the lag at omega_n
    forms=lambda scales: TIME_DELAY.either_sign(lambda lag: {"delay": lag / scales.omega_n}, largest=LARGEST_LAG),
    simulate=lambda terms, table: terms.plus(offset=lambda drive: -1j * drive.omega * table["delay"]),
    shapes=(Shape("delay", TIME),),
    need="phase",
    prior=_DELAY,
)


def clipping(level: Floats) -> Reading:
    """Readings clipped at ``level``."""
    base = np.log(level)

    def read(v: FloatArray) -> tuple[FloatArray, FloatArray]:
        over = v - base
        value = np.where(over > 0.0, np.interp(over, _OVER, _CLIPPED), over)
        return value + base, np.where(over > 0.0, np.interp(over, _OVER, _CLIPPED_SLOPE), 1.0)

    def unread(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        value = u - base
        over = np.where(value > 0.0, np.interp(value, _CLIPPED[:_TURN], _OVER[:_TURN]), value)
        slope = np.where(value > 0.0, np.interp(over, _OVER, _CLIPPED_SLOPE), 1.0)
        return over + base, np.where(value > _CLIPPED[_TURN - 1], 0.0, 1.0 / np.maximum(slope, _LEAST_SLOPE))

    def third(v: FloatArray) -> FloatArray:
        a = np.maximum(np.exp(v - base), 1.0)
        onset = np.arcsin(1.0 / a)  # of clipping, in (4/pi) int sin 3 theta min(a sin theta, 1)
        turned = a * (0.25 * np.sin(2.0 * onset) - 0.125 * np.sin(4.0 * onset)) + np.cos(3.0 * onset) / 3.0
        return np.asarray(level * (4.0 / np.pi) * turned)

    return Reading(read, unread, third)


def compressing(level: Floats, power: Floats) -> Reading:
    """The reading A/(1 + (A/level)^power)^(1/power): linear far below ``level``, never above it."""
    base = np.log(level)

    def read(v: FloatArray) -> tuple[FloatArray, FloatArray]:
        grown = np.exp(np.clip(power * (v - base), -50.0, 50.0))
        return v - np.log1p(grown) / power, 1.0 / (1.0 + grown)

    def unread(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        grown = np.exp(np.clip(power * (u - base), -50.0, 50.0))
        slope = np.maximum(1.0 - grown, _LEAST_SLOPE)
        return u - np.log(slope) / power, np.where(slope > _LEAST_SLOPE, 1.0 / slope, 0.0)

    return Reading(read, unread, integrate_third(read))


def integrate_third(read: Instrument) -> Callable[[FloatArray], FloatArray]:
    """Amplitude T of sin 3 theta in the response of a law without memory to A sin theta, from ln A.

    R(A), the amplitude of sin theta there, determines it: T = A^-3 int_0^A a^2 (R - a dR/da) da. For q |q|^(n-1), R is
    in proportion to A^n and T = R (1 - n)/(3 + n), which is (A d/dA + 3) T = (1 - A d/dA) R for every n.
    """

    def third(v: FloatArray) -> FloatArray:
        total = np.zeros(np.shape(v))
        for part, weight in zip(_PARTS, _WEIGHTS, strict=True):
            ln_R, slope = read(v + log(part))
            total = total + weight * part**2 * np.exp(ln_R) * (1.0 - slope)
        return total

    return third


def recorded_third(terms: Terms, u: FloatArray, phase: FloatArray, drive: Drive) -> ComplexArray:
    """Phasor of the third harmonic read together with a first harmonic of ln amplitude u and lag ``phase``.

    The sum of that of the motion and that of a saturating sensor, through the instrument at 3 omega.
    """
    offset = add_parts(terms.offset, drive)
    v, lag = u - terms.gain - np.real(offset), phase - terms.lag + np.imag(offset)
    for reading in reversed(terms.readings):
        v = reading.unread(v)[0]
    third = third_harmonic(terms, np.exp(v), lag, drive)
    for reading in terms.readings:
        third, v = third + reading.third(v) * np.exp(-3j * lag), reading.read(v)[0]
    factor = terms.gain - 1j * terms.lag + add_parts(terms.offset, drive._replace(omega=3.0 * drive.omega))
    return np.asarray(third * np.exp(factor))


def saturation_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the largest reading over the saturation level. Shape, of compression alone: its power."""

    def report(size: Floats, *power: Floats) -> dict[str, Floats]:
        return {"level": scales.A_high / size} | ({"power": power[0]} if power else {})

    power = FormVariable.between(1.0, 8.0, starts=(-0.5, 0.7))
    return (
        SENSOR_SATURATION.form(report, 1.0, sizes=(0.85, 1.0, 1.2, 2.0)),
        SENSOR_SATURATION.form(report, 0.5, shapes=(power,), largest=2.0),
    )


SENSOR_SATURATION = Effect(
    name="sensor-saturation",
    kind="instrument",
    sentence="large readings are clipped or compressed",
    forms=saturation_forms,
    # clipped at ``level``, or compressed towards it where ``power`` is not 0
    simulate=lambda terms, table: terms.plus(
        readings=compressing(table["level"], table["power"]) if np.any(table["power"]) else clipping(table["level"])
    ),
    shapes=(Shape("level", LENGTH, above=0.0), Shape("power", least=0.0, default=0.0)),
    need="sweep",
)


#: Angle of a signal in proportion to the force, on either side of it. In phase, or against it, it is a residual mode,
#: and of 6 generated ones an angle as free as that of a constant signal takes a fifth of the probability.
_ACROSS = tuple(FormVariable(side * 0.5 * np.pi, 0.5, starts=(-1.0, 0.0, 1.0), linear=True) for side in (-1.0, 1.0))


def background_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the signal over the largest reading, constant or in proportion to the force. Shape: its angle."""
    free = FormVariable(0.0, 1.8, starts=(-1.4, -0.6, 0.0, 0.6, 1.4), linear=True)

    def form(angle: FormVariable, **force: float) -> Form:
        def report(size: Floats, angle: Floats) -> dict[str, Floats]:
            return {"amplitude": size * scales.A_high, "angle": angle} | force

        return BACKGROUND.form(report, 0.05, shapes=(angle,), largest=1.0)

    return form(free), *(form(angle, force=scales.loss * scales.A_high) for angle in _ACROSS)


BACKGROUND = Effect(
    name="background",
    kind="instrument",
    sentence="a signal, constant or in proportion to the force, is added to the reading (cross-talk)",
    forms=background_forms,
    # lags the force by ``angle``; where a ``force`` is given, ``amplitude`` is that at this force, else at any
    simulate=lambda terms, table: terms.plus(
        compliance=lambda drive: (
            table["amplitude"]
            * np.exp(-1j * np.asarray(table["angle"]))
            / (table["force"] if differs(table["force"], 0.0) else drive.F)
        )
    ),
    shapes=(
        Shape("amplitude", LENGTH, least=0.0),
        Shape("angle", above=-2.0 * TURN, below=2.0 * TURN),  # 7 sd of a fit's prior; one turn would be 3.5
        Shape("force", FORCE, least=0.0, default=0.0),
    ),
    need="sweep",
)


#: Largest power of frequency of a gain: three times that of an acceleration read as a displacement.
_STEEPEST = 6.0

GAIN_SLOPE: Effect = Effect(
    name="gain-slope",
    kind="instrument",
    sentence="a gain that rises or falls with frequency (a filter, an amplifier, a table that tilts)",
    # strength: |power|. Beside a resonance Y it is two effects at once: with x = omega/omega_n - 1 and the damping
    # ratio d, Y = F/(2 K (i d - x)), and power x Y = -power F/(2 K) + i d power Y, a residual mode and a phase lag
    forms=lambda scales: GAIN_SLOPE.either_sign(lambda power: {"power": power}, natural=1.0, largest=_STEEPEST),
    simulate=lambda terms, table: terms.plus(
        offset=lambda drive: table["power"] * np.log(drive.omega / terms.omega_n).astype(complex)
    ),
    need="sweep",
)


def mount_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the part that resonates over the motion. Shapes: distance of its frequency, damping ratio, angle."""
    distance = spread_distance(scales, 0.2, (-1.0, 0.0, 1.0))
    damping = FormVariable.between(0.2 * scales.bandwidth, 5.0 * scales.bandwidth, starts=(0.0,))
    angle = FormVariable(0.25 * np.pi, np.pi / 6.0, starts=(-1.5, 0.0, 1.5), linear=True)

    def side(sign: float) -> Form:
        def report(size: Floats, distance: Floats, damping: Floats, angle: Floats) -> dict[str, Floats]:
            return {"size": size, "ratio": 1.0 + sign * distance, "damping": damping, "angle": angle}

        return SENSOR_MOUNT.form(report, 0.1, shapes=(distance, damping, angle), largest=10.0)

    return side(1.0), side(-1.0)


def simulate_mount(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """The reading times 1 + ``size`` exp(-i ``angle``) 2 i d r^2/(1 - r^2 + 2 i d r), r = omega/(``ratio`` omega_n).

    d: ``damping``. A sensor on a compliant mount has the angle pi/2 and the size 1/(2 d), one that also reads the
    dashpot of its mount the angle 0; negative angles are those of a second mode, and of no mount.
    """
    centre, turned = terms.omega_n * table["ratio"], table["size"] * np.exp(-1j * np.asarray(table["angle"]))

    def part(drive: Drive) -> Floats:
        r = drive.omega / centre
        loss = 2j * table["damping"] * r
        return np.asarray(np.log(1.0 + turned * loss * r / (1.0 - r * r + loss)))

    return terms.plus(offset=part)


SENSOR_MOUNT = Effect(
    name="sensor-mount",
    kind="instrument",
    sentence="a sensor or shaker whose mount or circuit resonates near the mode",
    forms=mount_forms,
    simulate=simulate_mount,
    need="sweep",
)
