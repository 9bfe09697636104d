"""From what a file holds to displacement and force in one system: response type, units, scaling.

What the user states goes before what the file says; what neither says is asked for.

Time histories as a file has them, to motion in one system of units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.quantity import SYSTEMS, Unit, unit
from damping.formats.series import RESPONSES, SCALINGS, Found, Series, Stated, Summary

# Where a value came from, as the summary of an import says it.
_STATED = "stated"
_FOUND = "found in the file"
_FOLLOWS = "follows"
_OF_ROLE = "of the role, or found in the file"


@dataclass(frozen=True)
class Conversion:
    """How values become displacement and force of the system.

    ``order`` of the time derivative, ``per_force`` whether the response is a ratio; ``response`` and ``force`` are
    factors to units of the system (``force`` None: its unit is unknown).
    """

    order: int
    per_force: bool
    response: float
    force: float | None


def conversion(found: Found, stated: Stated, file: str, summary: Summary) -> Conversion:
    """Response type and factors of a series.

    Raises:
        InputError: type or unit neither stated nor found, not understood, or at odds with each other.
    """
    texts = {what: stated.units.get(what) or found.units.get(what) for what in ("response", "force")}
    units = (
        {} if stated.consistent else {what: unit(text, what=f"unit of {what}") for what, text in texts.items() if text}
    )
    name = _describe_response_type(found, stated, units, file)
    order, per_force = RESPONSES[name]
    whence = _STATED if stated.response else _FOUND if found.response else _FOLLOWS
    summary.add("response", name, f"{whence} from its unit" if whence == _FOLLOWS else whence)
    if found.response and found.response != name:
        summary.note(f"the file says {found.response}, {name} is stated")
    if stated.consistent:
        summary.add("units", "one consistent system, values as they are", _STATED)
        return Conversion(order, per_force, stated.scale.get("response", 1.0), stated.scale.get("force", 1.0))
    for what in units:
        summary.add(f"unit of {what}", texts[what] or "", _STATED if stated.units.get(what) else _FOUND)
    whole = _response_unit(name, units, file)
    force, length = (unit(text) for text in SYSTEMS[stated.system])
    angular = whole.powers == (0, 0, -order)  # a rotation in rad: its force is a moment, its mass one of inertia
    if angular:
        summary.note(f"a rotation: amplitudes in rad, forces in {force.text} {length.text}")
    arm = length.factor if angular else 1.0
    per = force.factor * arm if per_force else 1.0
    of_force = units["force"].factor / (force.factor * arm) if "force" in units else None
    return Conversion(
        order,
        per_force,
        whole.factor / (1.0 if angular else length.factor) * per * stated.scale.get("response", 1.0),
        None if of_force is None else of_force * stated.scale.get("force", 1.0),
    )


def _describe_response_type(found: Found, stated: Stated, units: dict[str, Unit], file: str) -> str:
    """Name of the response type: stated, found, or the only one that has the unit."""
    name = stated.response or found.response
    if name is not None:
        if name not in RESPONSES:
            raise InputError(f"response type {name!r}", expected=", ".join(RESPONSES))
        if found.per_force is not None and found.per_force != RESPONSES[name][1]:
            kind = "a ratio to force" if found.per_force else "no ratio to force"
            raise InputError(
                f"the response is {kind} and {name} is stated", file=file, expected=_describe_choices(found)
            )
        return name
    if "response" in units:
        powers = units["response"].powers
        fits = [n for n in _list_fitting(found) if powers in (_powers(n), (0, 0, -RESPONSES[n][0]))]
        fits = [n for n in fits if not RESPONSES[n][1]] if powers[:2] == (0, 0) else fits
        if not fits and found.per_force and "force" in units:
            fits = [
                name for name in _list_fitting(found) if _powers(name) == units["response"].per(units["force"]).powers
            ]
        if len(fits) == 1:
            return fits[0]
    raise InputError(
        "the type of the response is neither in the file nor stated",
        file=file,
        expected=f"--response {_describe_choices(found)}",
    )


def _list_fitting(found: Found) -> list[str]:
    return [name for name, (_, per) in RESPONSES.items() if found.per_force is None or per == found.per_force]


def _describe_choices(found: Found) -> str:
    return " or ".join(_list_fitting(found))


def _powers(name: str) -> tuple[int, int, int]:
    """Powers of force, length and time of a response type."""
    order, per_force = RESPONSES[name]
    return (-1 if per_force else 0), 1, -order


def _response_unit(name: str, units: dict[str, Unit], file: str) -> Unit:
    """The unit of the response, put together from that of the motion and that of the force where needed."""
    if "response" not in units:
        raise InputError(
            "the unit of the response is neither in the file nor stated",
            file=file,
            expected=f"--unit response={_EXAMPLES[name]}, or --consistent",
        )
    found = units["response"]
    if found.powers != _powers(name) and RESPONSES[name][1] and "force" in units:
        found = found.per(units["force"])
    if found.powers not in (_powers(name), (0, 0, -RESPONSES[name][0])):
        raise InputError(
            f"{units['response'].text} is no unit of {name}", file=file, expected=f"such as {_EXAMPLES[name]}"
        )
    return found


_EXAMPLES = {
    "receptance": "m/N",
    "mobility": "(m/s)/N",
    "accelerance": "(m/s^2)/N",
    "displacement": "mm",
    "velocity": "m/s",
    "acceleration": "m/s^2",
}


def ask(found: Found, stated: Stated, file: str, *, force: bool | None) -> None:
    """One InputError that names everything that neither the file nor the user says, where that is more than one thing.

    Args:
        force: whether a force is there, None where none is wanted (a free decay).
    """
    missing: dict[str, str] = {}
    texts = {what: stated.units.get(what) or found.units.get(what) for what in ("response", "force")}
    typed = stated.response or found.response
    if typed is None and (stated.consistent or not texts["response"]):
        missing["type of the response"] = f"--response {_describe_choices(found)}"
    if not stated.consistent:
        units = [what for what in texts if not texts[what] and (what == "response" or force is not None)]
        for what in units:
            example = _EXAMPLES.get(typed or "", "m/s^2") if what == "response" else "N"
            missing[f"unit of the {what}"] = f"--unit {what}={example}"
    if force is False:
        missing["force"] = "--force AMPLITUDE of each sweep"
    ratio = found.per_force or (stated.response in RESPONSES and RESPONSES[stated.response][1])
    if force is not None and not ratio and not (stated.scaling or found.scaling):
        missing["scaling of amplitudes"] = f"--scaling {' or '.join(SCALINGS)}"
    if len(missing) > 1:
        *first, last = missing
        message = f"neither in the file nor stated: {', '.join(first)} and {last}"
        raise InputError(message, file=file, expected=" ".join(missing.values()))


def scaling(found: Found, stated: Stated, file: str, summary: Summary, *, of_force: bool = False) -> float:
    """Amplitudes of the sine in one unit of what was recorded; a force of real numbers has a scaling of its own.

    Raises:
        InputError: neither stated nor found.
    """
    name = stated.scaling or found.scaling
    if of_force and (stated.force_scaling or found.force_scaling):
        name = stated.force_scaling or found.force_scaling
        if name != found.scaling or stated.scaling:
            summary.add("amplitudes of force", name or "", _STATED if stated.force_scaling else _OF_ROLE)
            if stated.scaling not in (None, name) and not stated.force_scaling:
                summary.note(f"--scaling is that of the response; the force is {name} (--scaling force=... to say so)")
        return SCALINGS[name or "peak"]
    if name is None:
        raise InputError(
            "whether amplitudes are peak or rms is neither in the file nor stated",
            file=file,
            expected=f"--scaling {' or '.join(SCALINGS)}",
        )
    if name not in SCALINGS:
        raise InputError(f"scaling {name!r}", expected=" or ".join(SCALINGS))
    summary.add("amplitudes", name, _STATED if stated.scaling else _OF_ROLE)
    return SCALINGS[name]


def other_factor(
    what: str, powers: tuple[int, int, int], found: Found, stated: Stated, file: str, summary: Summary
) -> float:
    """Factor of ``energy`` or ``mass`` to the system.

    Raises:
        InputError: a unit neither stated nor found, or of another kind.
    """
    if stated.consistent:
        return 1.0
    text = stated.units.get(what) or found.units.get(what)
    if not text:
        raise InputError(
            f"the unit of {what} is neither in the file nor stated", file=file, expected=f"--unit {what}=..."
        )
    of = unit(text, what=f"unit of {what}")
    if of.powers != powers:
        raise InputError(f"{of.text} is no unit of {what}", file=file)
    summary.add(f"unit of {what}", text, _STATED if stated.units.get(what) else _FOUND)
    force, length = (unit(name) for name in SYSTEMS[stated.system])
    return of.factor / (force.factor ** powers[0] * length.factor ** powers[1])


@dataclass(frozen=True)
class TimeHistory:
    """A motion against time: ``t`` (n,) in s, ``signal`` (n,) the ``order``-th time derivative of displacement."""

    label: str
    t: FloatArray
    signal: FloatArray
    order: int


def time_histories(series: Sequence[Series], stated: Stated, file: str | Path, summary: Summary) -> list[TimeHistory]:
    """The motions of some series.

    Raises:
        InputError: a series that is no time history of a motion, values that are no numbers, or a type or unit that
            neither the file nor the user says.
    """
    if stated.labels and len(stated.labels) != len(series):
        raise InputError(f"{len(stated.labels)} labels", file=file, expected=f"{len(series)}, one a time history")
    histories = []
    for k, one in enumerate(series):
        if not one.is_time:
            raise InputError(f"{one.label!r} is no time history", file=file, expected="a signal against time")
        ask(one.found, stated, str(file), force=None)
        to = conversion(one.found, stated, str(file), summary)
        if to.per_force:
            raise InputError("a time history is no ratio to force", file=file, expected="--response acceleration")
        if not (np.isfinite(one.abscissa).all() and np.isfinite(one.response).all()):
            raise InputError(f"{one.label!r} holds values that are no numbers", file=file, expected="finite numbers")
        signal = np.asarray(one.response, dtype=np.float64) * to.response
        label = stated.labels[k] if stated.labels else one.label
        histories.append(TimeHistory(label, np.asarray(one.abscissa, dtype=np.float64), signal, to.order))
    return histories
