"""Conversion of file values to displacement and force in one system: response type, units, scaling.

Statements of the user take precedence over the file; missing facts are asked for.
"""

from dataclasses import dataclass

from damping.errors import InputError
from damping.formats.headers import NAMES, lower_name
from damping.formats.quantity import SYSTEMS, Unit, find_powers, unit
from damping.formats.series import FileFacts, Stated, Summary

#: Response types: order of the time derivative of displacement, and whether the response is per unit of force.
RESPONSES: dict[str, tuple[int, bool]] = {
    name: (kind["order"], kind["per_force"]) for name, kind in NAMES["response"].items()
}
#: Scalings of an amplitude, with factors to the amplitude of the sine.
SCALINGS: dict[str, float] = {"peak": 1.0, "rms": 2.0**0.5, "peak-to-peak": 0.5}
VOLTS = ("V", "mV", "uV", "µV", "μV")  #: units of signals before they are multiplied by a sensitivity
# Origin of a value, in the summary of an import.
_STATED = "stated"
_FOUND = "found in the file"
_FOLLOWS = "follows"
_OF_ROLE = "usual for such data, or found in the file"
#: A unit of each response type.
_EXAMPLES: dict[str, str] = {name: kind["unit"] for name, kind in NAMES["response"].items()}


@dataclass(frozen=True)
class Conversion:
    """Conversion of values to displacement and force of the system."""

    order: int  #: of the time derivative
    per_force: bool  #: whether the response is a ratio to force
    response: float  #: factor to the unit of the system
    force: float | None  #: factor to the unit of the system; None: its unit is unknown


@dataclass(frozen=True)
class Statements:
    """The file's ``facts`` on a series and the user's statements, which take precedence; ``summary`` collects rows."""

    facts: FileFacts
    stated: Stated
    summary: Summary

    @property
    def response(self) -> str | None:
        """Name of the response type."""
        return self.stated.response or self.facts.response

    @property
    def scaling(self) -> str | None:
        """Name of the scaling of amplitudes."""
        return self.stated.scaling or self.facts.scaling

    @property
    def is_ratio(self) -> bool:
        """Whether the response is known to be a ratio to force."""
        powers, name = find_powers(self.unit_of("response")), self.response  # a unit not understood is asked for later
        return bool(self.facts.per_force or (name in RESPONSES and RESPONSES[name][1]) or (powers and powers[0] == -1))

    def unit_of(self, what: str) -> str:
        """Text of a unit, '' if neither states it."""
        return self.stated.units.get(what) or self.facts.units.get(what) or ""

    def add_unit(self, what: str) -> None:
        """Add a unit and its origin to the summary, and note another in the file that no factor explains."""
        stated, found = self.stated.units.get(what), self.facts.units.get(what)
        if stated and found and what not in self.stated.scale and not _is_same_unit(stated, found):
            both = f"the file says {found} and {stated} is stated as the unit of {what}"
            self.summary.note(f"caution: {both}, without --scale")
        self.summary.add(f"unit of {what}", self.unit_of(what), _STATED if self.stated.units.get(what) else _FOUND)


def _is_same_unit(text: str, other: str) -> bool:
    try:
        return unit(text).agrees_with(unit(other))
    except InputError:  # of a voltage, say
        return text == other


def conversion(known: Statements) -> Conversion:
    """Response type and factors of a series.

    InputError: type or unit neither stated nor found, not understood, or contradicting each other.
    """
    facts, stated, summary = known.facts, known.stated, known.summary
    texts = {what: known.unit_of(what) for what in ("response", "force") if known.unit_of(what)}
    units = {} if stated.consistent else {what: _read_unit(what, text) for what, text in texts.items()}
    name = _find_response_type(known, units)
    order, per_force = RESPONSES[name]
    source = _STATED if stated.response else _FOUND if facts.response else f"{_FOLLOWS} from its unit"
    summary.add("response", name, source)
    if facts.response and facts.response != name:
        summary.note(f"the file says {facts.response}, {name} is stated")
    if stated.consistent:
        summary.add("units", "one consistent system, values as they are", _STATED)
        return Conversion(order, per_force, stated.scale.get("response", 1.0), stated.scale.get("force", 1.0))
    for what in units:
        known.add_unit(what)
    whole = _response_unit(name, units)
    force, length = (unit(text) for text in SYSTEMS[stated.system])
    angular = whole.powers != _powers(name)  # a rotation in rad: its force is a moment, its mass one of inertia
    if angular:
        summary.note(f"a rotation: amplitudes in rad, forces in {force.text} {length.text}")
    arm = length.factor if angular else 1.0
    per = force.factor * arm if per_force else 1.0
    of_response = whole.factor / (1.0 if angular else length.factor) * per * stated.scale.get("response", 1.0)
    by_base = "force" in units and units["force"].powers == (0, 1, -2)
    if by_base:
        summary.note(
            f"the drive is an acceleration: force in {length.text}/s^2, for a mode with drive = base, and the "
            "amplitude must be the motion relative to the base (damping campaign takes absolute motions too)"
        )
    of_force = units["force"].factor / (length.factor if by_base else force.factor * arm) if "force" in units else None
    scaled = None if of_force is None else of_force * stated.scale.get("force", 1.0)
    return Conversion(order, per_force, of_response, scaled)


def _read_unit(what: str, text: str) -> Unit:
    if text in VOLTS:
        expected = f"--unit {what}=UNIT of the quantity, and --scale {what}=VALUE of one {text} in it"
        raise InputError(f"unit of {what} {text!r} is not understood: it is a voltage", expected=expected)
    return unit(text, what=f"unit of {what}", option=f"--unit {what}=UNIT")


def _find_response_type(known: Statements, units: dict[str, Unit]) -> str:
    """Name of the response type: stated, found, or the only one with the unit."""
    facts, name = known.facts, known.response
    if name is not None:
        if facts.per_force is not None and facts.per_force != RESPONSES[name][1]:
            kind = "a ratio to force" if facts.per_force else "no ratio to force"
            raise InputError(f"the response is {kind} and {name} is stated", expected=" or ".join(_list_fitting(facts)))
        return name
    if "response" in units:
        powers, possible = units["response"].powers, _list_fitting(facts)
        fits = [n for n in possible if powers in (_powers(n), (0, 0, -RESPONSES[n][0]))]
        fits = [n for n in fits if not RESPONSES[n][1]] if powers[:2] == (0, 0) else fits
        if not fits and facts.per_force and "force" in units:
            ratio = units["response"].per(units["force"]).powers
            fits = [n for n in possible if _powers(n) == ratio]
        if len(fits) == 1:
            return fits[0]
    expected = f"--response {' or '.join(_list_fitting(facts))}"
    raise InputError("the type of the response is neither in the file nor stated", expected=expected)


def _list_fitting(facts: FileFacts) -> list[str]:
    return [name for name, (_, per) in RESPONSES.items() if facts.per_force is None or per == facts.per_force]


def _powers(name: str) -> tuple[int, int, int]:
    """Powers of force, length and time of a response type."""
    order, per_force = RESPONSES[name]
    return (-1 if per_force else 0), 1, -order


def _response_unit(name: str, units: dict[str, Unit]) -> Unit:
    """The unit of the response, if needed as the quotient of those of motion and force."""
    if "response" not in units:
        expected = f"--unit response={_EXAMPLES[name]}, or --consistent"
        raise InputError("the unit of the response is neither in the file nor stated", expected=expected)
    whole = units["response"]
    if whole.powers != _powers(name) and RESPONSES[name][1] and "force" in units:
        whole = whole.per(units["force"])
    order, per_force = RESPONSES[name]
    angular = [(0, 0, -order), *([(-1, -1, -order)] if per_force else [])]  # rad, and rad per moment
    if whole.powers not in (_powers(name), *angular):
        raise InputError(f"{units['response'].text} is no unit of {name}", expected=f"such as {_EXAMPLES[name]}")
    return whole


def ask(known: Statements, *, force: bool | None) -> None:
    """Raise one InputError that lists all missing facts, if more than one is neither in the file nor stated.

    ``force``: whether there is a force; None if none is needed (a free decay).
    """
    missing: dict[str, str] = {}
    stated, typed = known.stated, known.response
    silent = not (stated.consistent or known.unit_of("response"))
    column = stated.columns.get("response", "")
    if typed is None and silent and lower_name(column) in NAMES["signal"]["angle"]:
        expected = "--unit response=rad or deg, or --response and --unit if it is no angle"
        raise InputError(
            f"the unit of {column!r}, an angle by its name, is neither in the file nor stated", expected=expected
        )
    if typed is None and (stated.consistent or not known.unit_of("response")):
        types = [name for name in _list_fitting(known.facts) if force is not None or not RESPONSES[name][1]]
        missing["type of the response"] = f"--response {' or '.join(types)}"
    examples = {"response": _EXAMPLES.get(typed or "", "m/s^2"), **({} if force is None else {"force": "N"})}
    for what, example in examples.items():
        if not stated.consistent and not known.unit_of(what):
            missing[f"unit of the {what}"] = f"--unit {what}={example}"
    if force is False:
        missing["force"] = "--force AMPLITUDE of each sweep"
    if force is not None and not known.is_ratio and not known.scaling:
        missing["scaling of amplitudes"] = f"--scaling {' or '.join(SCALINGS)}"
    if len(missing) > 1:
        *first, last = missing
        message = f"neither in the file nor stated: {', '.join(first)} and {last}"
        raise InputError(message, expected=" ".join(missing.values()))


def scaling(known: Statements, *, of_force: bool = False) -> float:
    """Amplitude of the sine in one recorded unit; a real force may have a separate scaling.

    InputError: neither stated nor found.
    """
    facts, stated, name = known.facts, known.stated, known.scaling
    for_force = (stated.force_scaling or facts.force_scaling) if of_force else None
    if for_force:
        if for_force != facts.scaling or stated.scaling:
            known.summary.add("amplitudes of force", for_force, _STATED if stated.force_scaling else _OF_ROLE)
            if stated.scaling not in (None, for_force) and not stated.force_scaling:
                remark = f"the force is {for_force} (--scaling force=... to say so)"
                known.summary.note(f"--scaling is that of the response; {remark}")
        if "force" in facts.peak_assumed and not stated.force_scaling:
            says = f"beside a response in {facts.scaling}: the file does not say"
            known.summary.note(f"caution: the force is taken as peak, {says} (give --scaling force=rms or force=peak)")
        return SCALINGS[for_force]
    if name is None:
        message = "whether amplitudes are peak or rms is neither in the file nor stated"
        raise InputError(message, expected=f"--scaling {' or '.join(SCALINGS)}")
    if "response" in facts.peak_assumed and not stated.scaling:
        known.summary.add("amplitudes", name, "assumed: the file does not say")
        remedy = "give --scaling rms or peak-to-peak, else peak"
        known.summary.note(f"caution: peak assumed: the file does not say ({remedy})")
    else:
        known.summary.add("amplitudes", name, _STATED if stated.scaling else _OF_ROLE)
    return SCALINGS[name]


def other_factor(what: str, powers: tuple[int, int, int], known: Statements) -> float:
    """Factor of ``energy`` or ``mass`` to the system.

    InputError: a unit neither stated nor found, or of another quantity.
    """
    if known.stated.consistent:
        return 1.0
    if not known.unit_of(what):
        raise InputError(f"the unit of {what} is neither in the file nor stated", expected=f"--unit {what}=...")
    stated = unit(known.unit_of(what), what=f"unit of {what}")
    if stated.powers != powers:
        raise InputError(f"{stated.text} is no unit of {what}", expected=f"a unit of {what}")
    known.add_unit(what)
    force, length = (unit(name) for name in SYSTEMS[known.stated.system])
    return stated.factor / (force.factor ** powers[0] * length.factor ** powers[1])


def deviation_factor(what: str, quantity: str, known: Statements) -> float:
    """Factor of a standard uncertainty to the unit of its ``quantity`` (``response`` or ``force``) in the file.

    InputError: a unit of another kind.
    """
    text = known.facts.units.get(what, "")
    if known.stated.consistent or text in ("", known.facts.units.get(quantity)):
        return 1.0
    own, of_quantity = unit(text, what=f"unit of {what}"), unit(known.unit_of(quantity))
    if own.powers != of_quantity.powers:
        expected = f"the unit of its quantity, such as {of_quantity.text}"
        raise InputError(f"{what} in {text}", expected=expected)
    known.summary.add(f"unit of {what}", text, _FOUND)
    return own.factor / of_quantity.factor
