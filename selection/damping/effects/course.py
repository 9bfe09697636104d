"""Changes in the course of a test: the structure drifts, one level is off, the frequency moves too fast."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from math import log

import numpy as np
from scipy.special import expit

from damping.arrays import RAD_S_PER_HZ, BoolArray, Floats, differs
from damping.effects.contract import Drive, Effect, Form, FormVariable, Scales, Terms
from damping.effects.rig import list_states
from damping.forces.shapes import TIME, Shape

_SETTLING = FormVariable.between(0.05, 1.0, starts=(0.0,))  #: Settling time over the duration of the record.
#: Number of warming and cooling cycles over a record, and their phase at its middle, rad.
_CYCLES = FormVariable.between(0.75, 6.0, starts=(-1.0, -0.35, 0.15, 0.6, 1.0))
_PHASE = FormVariable(0.0, 1.8, starts=(-1.3, -0.45, 0.45, 1.3), linear=True)
#: Moment when a joint gives way, and how long it takes, of the record; fits start slow, where the moment has a slope.
_MOMENT = FormVariable(0.5, 0.25, starts=(-1.6, -1.2, -0.8, -0.4, 0.0, 0.4, 0.8, 1.2, 1.6), linear=True)
_GIVING_WAY = FormVariable.between(0.0005, 0.02, starts=(1.0,))
_SLOWLY = 0.01  #: The duration where a model file gives none.
#: Largest relative change of frequency of one structure; largest |ln| of a factor on damping.
_MOST_DRIFT = 0.1
_MOST_WARMING = 2.0
_USUAL_DAMPING = 0.2  #: Natural |ln| of actual over stated damping of a state: it is known to a fifth.
_USUAL_MASS = 0.05  #: That of its mass, which is known to a twentieth.
_MOST_MASS = 1.5  #: Largest |ln| of actual over stated mass of a state: a factor of 4.5 is beyond all sense.
#: Drifts over their natural size from which fits start: linear gains do not see a resonance moved by a bandwidth.
_DRIFTS = (0.5, 1.0, 2.0, 4.0, 8.0)
_MOST_JUMPS = 8  #: Most sweeps for which each may have its own frequency.
_MANY_SWEEPS = 6  #: With more, only errors of the reading are tried: those of the force differ in second order only.
#: Prior of ``law``, ``ringing``, ``begun`` and ``held`` of `Terms`: each about 0 to 1.
BETWEEN = FormVariable(0.5, 0.5, starts=(-1.0, 1.0), linear=True)
#: Rates over the squared bandwidth from which fits start; largest one, beyond which the resonance is hardly visible.
_RATES = (0.1, 0.4, 1.5, 5.0, 15.0)
_MOST_RATE = 30.0


def drift_forms(scales: Scales) -> tuple[Form, ...]:
    """The frequency drifts linearly, settles, steps, cycles, or differs in one sweep or in each; damping drifts too."""
    sweeps = range(1, scales.sweeps + 1) if scales.sweeps > 2 else ()
    return (
        *((_jumping_form(scales),) if 2 < scales.sweeps <= _MOST_JUMPS else ()),
        *_drift_side("frequency", scales.bandwidth, _MOST_DRIFT),
        *_drift_side("damping", 0.2, _MOST_WARMING),
        *_drift_side("settling", scales.bandwidth, _MOST_DRIFT, settling=_SETTLING),
        *_drift_side("moment", scales.bandwidth, _MOST_DRIFT, moment=_MOMENT, duration=_GIVING_WAY),
        _drift_side("cycles", scales.bandwidth, _MOST_DRIFT, cycles=_CYCLES, phase=_PHASE)[0],
        *chain.from_iterable(_drift_side("frequency", scales.bandwidth, _MOST_DRIFT, sweep=k) for k in sweeps),
    )


def _jumping_form(scales: Scales) -> Form:
    """Each sweep has its own frequency. Strength: their root mean square deviation. Shapes: each deviation over it."""
    patterns = (-0.7, 0.7) if scales.sweeps <= 4 else (0.5,)
    shapes = tuple(FormVariable(0.0, 1.0, patterns, linear=True) for _ in range(scales.sweeps))

    def report(size: Floats, *jumps: Floats) -> dict[str, Floats]:
        return {f"frequency_{sweep}": size * jump for sweep, jump in enumerate(jumps, 1)}

    sizes = tuple(scales.bandwidth * share for share in _DRIFTS)
    return DRIFT.form(report, scales.bandwidth, shapes=shapes, largest=_MOST_DRIFT, sizes=sizes)


def _drift_side(kind: str, natural: float, most: float, sweep: int = 0, **shapes: FormVariable) -> tuple[Form, Form]:
    quantity = "damping" if kind == "damping" else "frequency"

    def report(size: Floats, *values: Floats) -> dict[str, Floats]:
        table = {quantity: size} | dict(zip(shapes, values, strict=True))
        return table | ({"sweep": float(sweep)} if sweep else {})

    mirror = f"{kind} of sweep {sweep}" if sweep else kind
    sizes = () if sweep else tuple(natural * share for share in _DRIFTS)
    variables = tuple(shapes.values())
    return DRIFT.either_sign(report, mirror, natural=natural, shapes=variables, largest=most, sizes=sizes)


def simulate_drift(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """The drift of a table: ln of omega_n and of damping change by ``frequency`` and ``damping`` over the record.

    The course may be linear, settling, a step at a moment, cycles, or one ``sweep`` only. ``frequency_1``, ``_2``, ...:
    the change of omega_n in each sweep.
    """

    def course(drive: Drive) -> Floats:
        if differs(table["sweep"], 0.0):
            return drive.sweep == table["sweep"]
        if differs(table["settling"], 0.0):
            return 1.0 - np.exp(-(drive.time + 0.5) / table["settling"])
        if differs(table["cycles"], 0.0):
            return np.sin(2.0 * np.pi * table["cycles"] * drive.time + table["phase"])
        if differs(table["moment"], 0.0):
            return np.asarray(expit((drive.time + 0.5 - table["moment"]) / table["duration"]))
        return drive.time

    for quantity, field in (("frequency", "detuned"), ("damping", "damped")):
        if differs(table[quantity], 0.0):
            terms = terms.plus(**{field: lambda drive, size=table[quantity]: size * course(drive)})
    jumps = [(sweep, table[f"frequency_{sweep}"]) for sweep in range(1, _MOST_JUMPS + 1)]
    if any(differs(jump, 0.0) for _, jump in jumps):
        terms = terms.plus(detuned=lambda drive: sum(jump * (drive.sweep == sweep) for sweep, jump in jumps))
    return terms


DRIFT = Effect(
    name="drift",
    kind="structure",
    sentence="the structure changes during the test",
    forms=drift_forms,
    simulate=simulate_drift,
    shapes=(
        Shape("frequency", default=0.0),
        Shape("damping", default=0.0),
        Shape("settling", least=0.0, default=0.0, label="settling (its time over the duration of the record)"),
        Shape("cycles", least=0.0, default=0.0, label="cycles (during the record)"),
        Shape("phase", default=0.0, label="phase (of the cycles at the middle of the record)"),
        # before the record where the fit has it change at once
        Shape("moment", default=0.0, label="moment (of the change, as a share of the record)"),
        Shape("duration", above=0.0, default=_SLOWLY, label="duration (of that change, share of the record)"),
        Shape("sweep", least=0.0, default=0.0),
        *(Shape(f"frequency_{sweep}", default=0.0) for sweep in range(1, _MOST_JUMPS + 1)),
    ),
    need="sweep",
    passing=True,
)


def offset_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |ln(factor)| of the readings or the force of one sweep or state, or of the readings from a sweep on."""
    if scales.sweeps < 2:
        return ()
    channels = (False,) if scales.sweeps > _MANY_SWEEPS else (False, True)
    places = [*(("sweep", k) for k in range(1, scales.sweeps + 1)), *(("state", k) for k in list_states(scales))]
    sides = [_offset_side(*place, force) for place in places for force in channels]
    sides += [_offset_side("onward", k, force=False) for k in range(3, scales.sweeps) if len(channels) > 1]
    return tuple(chain.from_iterable(sides))


def _offset_side(of: str, number: int, force: bool) -> tuple[Form, Form]:
    def change(terms: Terms, size: Floats) -> Terms:
        return in_place(terms, of, number, size, force)

    def report(size: Floats) -> dict[str, Floats]:
        values: dict[str, Floats] = {"factor": np.exp(size), "sweep": 0.0, of: float(number)}
        return values | ({"force": 1.0} if force else {})

    return LEVEL_OFFSET.either_sign(report, f"{of} {number} {force}", change, largest=log(3.0))


def in_place(terms: Terms, of: str, number: float, size: Floats, force: bool) -> Terms:
    """The terms with ln of readings or force of a sweep or state, or from a sweep on (``of``), changed by ``size``."""

    def part(drive: Drive) -> Floats:
        numbers = np.asarray(drive.state) + 1.0 if of == "state" else drive.sweep
        return np.asarray(size * (numbers >= number if of == "onward" else numbers == number))

    return terms.plus(**{"received" if force else "offset": part})


def simulate_offset(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The readings, or the ``force``, of one ``sweep`` or ``state``, or ``onward`` from a sweep, times ``factor``."""
    of = next((name for name in ("state", "onward") if table[name]), "sweep")
    return in_place(terms, of, table[of], log(table["factor"]), table["force"] != 0.0)


LEVEL_OFFSET = Effect(
    name="level-offset",
    kind="instrument",
    sentence="the readings or the force of one level, or of one state, or of all from a level on, are off by a factor",
    forms=offset_forms,
    simulate=simulate_offset,
    shapes=(
        Shape("factor", above=0.0),
        Shape("sweep", least=0.0),  # 0 where it is of a state, or from a sweep on
        *(Shape(name, least=0.0, default=0.0) for name in ("state", "force", "onward")),
    ),
    need="sweep",
    passing=True,
)


def rate_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |d omega/dt| at omega_n over the squared bandwidth, in the direction of the rows or against it.

    Shapes: ``law``, the power of frequency in the rate (0 for a constant rate, 1 for octaves), ``ringing`` and
    ``begun`` (`Terms`).
    """
    unit = (scales.bandwidth * scales.omega_n) ** 2

    def change(terms: Terms, size: Floats, law: Floats, ringing: Floats, begun: Floats) -> Terms:
        return moving(terms, size * unit, law, ringing, begun)

    def report(size: Floats, law: Floats, ringing: Floats, begun: Floats) -> dict[str, Floats]:
        return {"rate": size * unit / RAD_S_PER_HZ, "law": law, "ringing": ringing, "begun": begun}

    shapes = (BETWEEN, BETWEEN, replace(BETWEEN, starts=(0.0,)))
    return SWEEP_RATE.either_sign(report, change=change, shapes=shapes, largest=_MOST_RATE, sizes=_RATES)


def moving(terms: Terms, rate: Floats, law: Floats, ringing: Floats, begun: Floats) -> Terms:
    """The terms with the frequency moving at ``rate`` (omega/omega_n)^``law``, rad/s^2, in the order of the rows."""
    centre = terms.omega_n
    moved = terms.plus(moving=lambda drive: rate * drive.up * (drive.omega / centre) ** law)
    return moved._replace(ringing=ringing, begun=begun)


SWEEP_RATE = Effect(
    name="sweep-rate",
    kind="instrument",
    sentence="the frequency moved too fast for a steady state",
    forms=rate_forms,
    simulate=lambda terms, table: moving(
        terms, RAD_S_PER_HZ * table["rate"], table["law"], table["ringing"], table["begun"]
    ),
    shapes=(
        Shape("rate", TIME**-2.0),
        Shape("law", default=0.0, label="law (power of frequency in the rate: 0 constant, 1 octaves)"),
        Shape("ringing", default=0.0, label="ringing (reading: 0 of the motion, 1 of its envelope)"),
        Shape("begun", default=0.0, label="begun (start of each sweep: 0 long before its first row, 1 at it)"),
    ),
    need="sweep",
)


#: Angle of the complex change of the reading, rad: 0 for the gain and pi/2 for the lag.
_ANGLE = FormVariable(0.0, 1.8, starts=(-1.7, -0.9, 0.0, 0.9, 1.7), linear=True)


READING_DRIFT: Effect = Effect(
    name="reading-drift",
    kind="instrument",
    sentence="a reading whose gain or phase drifts during the test",
    # strength: |ln| of the total change of the reading
    forms=lambda scales: (
        READING_DRIFT.form(lambda size, angle: {"size": size, "angle": angle}, 0.1, shapes=(_ANGLE,), largest=1.0),
    ),
    # ln of the reading's complex factor moves by ``size`` exp(-i ``angle``) from the first row to the last
    simulate=lambda terms, table: terms.plus(
        offset=lambda drive: table["size"] * np.exp(-1j * np.asarray(table["angle"])) * drive.time
    ),
    need="sweep",
)


def state_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |ln| of actual over stated damping, frequency or mass of one of several states."""
    sizes = {
        "damping": (_USUAL_DAMPING, _MOST_WARMING),
        "frequency": (scales.bandwidth, _MOST_DRIFT),
        "mass": (_USUAL_MASS, _MOST_MASS),
    }
    return tuple(
        chain.from_iterable(
            OTHER_STATE.either_sign(
                lambda size, of=of, state=state: {of: np.expm1(size), "state": float(state)},
                f"{of} of state {state}",
                natural=natural,
                largest=most,
            )
            for state in list_states(scales)
            for of, (natural, most) in sizes.items()
        )
    )


def simulate_state(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """All ``damping``, the ``frequency`` or the ``mass`` of one ``state`` times 1 + that.

    A mass is at the frequency of its state, or, where that follows from one stiffness of all states, at that stiffness.
    """
    of, field = next((of, field) for of, field in _OF_STATE.items() if of in table)
    size = np.log1p(table[of])

    def in_state(drive: Drive) -> BoolArray:
        return np.asarray(np.asarray(drive.state) + 1.0 == table["state"])

    def free(drive: Drive) -> Floats:
        return np.asarray(size * (in_state(drive) & (np.asarray(drive.added) == 0.0)))

    def loaded(drive: Drive) -> Floats:
        more = table[of] * (terms.M * drive.mass + drive.added) * np.square(drive.omega)
        return np.asarray(-more * (in_state(drive) & (np.asarray(drive.added) != 0.0)))

    if of == "mass":
        return terms.plus(weighed=free, beside=loaded)
    return terms.plus(**{field: lambda drive: np.asarray(size * in_state(drive))})


#: Fields of `Terms` by the quantity of a state.
_OF_STATE = {"damping": "damped", "frequency": "detuned", "mass": "weighed"}
OTHER_STATE: Effect = Effect(
    name="other-state",
    kind="parameter",
    sentence="a state whose mass, damping or frequency differs from the one stated",
    forms=state_forms,
    simulate=simulate_state,
)
