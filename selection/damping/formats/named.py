"""Named arrays and columns to series, by role, for any file.

A lock-in amplifier shows X = R cos(theta), Y = R sin(theta) of a signal R cos(omega t + theta) against its reference;
X + i Y is then the phasor with exp(i omega t), and theta > 0 leads. Only the user can state whether R is rms.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import pi
from typing import cast

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray, join_complex
from damping.errors import InputError
from damping.formats.headers import ABSCISSAS, PHASES, RATES, ColumnHeader, find_abscissa_factor, refuse_decibels
from damping.formats.series import MOST_SWEEPS, FileFacts, Samples, Series, Stated, Summary, convert_angles
from damping.formats.sweeps import direct_rate, list_sweeps

_EXTRA = ("energy", "mass", "amplitude_sd", "phase_sd", "force_sd")
_TO_ABSCISSA = {"frequency": 1.0, "omega": 1.0 / RAD_S_PER_HZ, "time": 1.0}
_BEHIND_FORCE = {"phase", "lag_deg", "angle"}  #: roles of angles between the response and the force itself


def to_series(
    arrays: Mapping[str, Samples],
    labels: Sequence[str] | None,
    facts: FileFacts,
    name: str,
    summary: Summary,
    *,
    peak: bool,
) -> list[Series]:
    """One series for each sweep; a table without labels is split where the frequency restarts or the force changes.

    Args:
        arrays: array of each role. The abscissa has n values; a response is (n,), or (n, k) or (k, n) for k sweeps; a
            force is one number, (k,), (n,) or of the shape of the response.
        labels: sweep of each row (n,), or None.
        name: label of a single sweep.
        peak: whether the role ``amplitude`` is that of the sine (not so for readings of an amplifier).

    InputError: missing or redundant roles, or incompatible shapes.
    """
    arrays = convert_angles(arrays, facts, summary)
    times = _taken_times(arrays, facts.units)
    arrays = {role: values for role, values in arrays.items() if times is None or role != "time"}
    role, x = _abscissa(arrays, facts.units)
    n = len(x)
    response, phased = _response(arrays, n, role == "time")
    force = _force(arrays, n, response.shape[1])
    is_amplitude = force is not None and not np.iscomplexobj(force)
    if force is not None and _BEHIND_FORCE & set(arrays):  # against whatever reference the force has a phase
        force = np.abs(force)
    extra = ({} if times is None else {"time": times}) | _further(arrays, n)
    rates = find_rates(arrays, facts.units, x, response.shape[1])
    # by its role an amplitude is that of the sine; parts of a phasor may be rms
    of_role = peak and "amplitude" in arrays and not {"force_x", "force_y"} & set(arrays)
    known = replace(
        facts,
        response=None if "response" in facts.units else facts.response,
        scaling=facts.scaling or ("peak" if of_role else None),
        force_scaling=facts.force_scaling or ("peak" if is_amplitude else None),
        turn="angle" in arrays,
    )
    is_time, many = role == "time", response.shape[1] > 1
    if many and not is_time and force is not None and force.shape[1] == 1:
        what = f"the {response.shape[1]} columns of the response have one force and are taken as sweeps of one sensor"
        remedy = "of several sensors keep one (--column 'response=NAME(:,1)'), or damping campaign"
        summary.note(f"caution: {what}; {remedy}")
    series = []
    for k, column in enumerate(response.T):
        of_sweep = None if force is None else force[:, min(k, force.shape[1] - 1)]
        own = extra if rates is None else extra | {"sweep_rate": rates[:, k]}
        series.append(Series(f"{name} {k + 1}" if many else name, x, column, of_sweep, is_time, phased, own, known))
    return [direct_rate(row, summary) for row in (series if many else list_sweeps(series[0], labels, summary))]


def _further(arrays: Mapping[str, Samples], n: int) -> dict[str, FloatArray]:
    further = {}
    for key in (key for key in _EXTRA if key in arrays):
        columns = _real(_matrix(arrays[key], n, key), key)
        if columns.shape[1] != 1:
            raise InputError(f"array of {key} has {columns.shape[1]} columns", expected="one")
        further[key] = columns[:, 0]
    return further


def find_rates(arrays: Mapping[str, Samples], units: Mapping[str, str], f: FloatArray, k: int) -> FloatArray | None:
    """Sweep rates (n, k), Hz/s, NaN where not known; None if none is. InputError: a unit that is none of a rate."""
    if "sweep_rate" not in arrays or not np.isfinite(arrays["sweep_rate"]).any():
        return None
    text = units.get("sweep_rate", "Hz/s")
    if text.lower() not in RATES:
        expected = "--unit sweep_rate=UNIT of Hz/s, Hz/min, oct/min, oct/s, dec/min"
        raise InputError(f"sweep_rate in {text}", expected=expected)
    factor, power = RATES[text.lower()]
    rates = np.broadcast_to(_real(_spread(arrays["sweep_rate"], len(f), k, "sweep_rate"), "sweep_rate"), (len(f), k))
    return np.asarray(rates * (factor * f**power)[:, np.newaxis])


def _choose_role(arrays: Mapping[str, Samples], roles: Sequence[str], what: str, *, needed: bool) -> str | None:
    present = [role for role in roles if role in arrays]
    if len(present) > 1 or (needed and not present):
        message = f"{'both ' + ' and '.join(present[:2]) if present else 'no'} {what}"
        rate = "" if "time" not in roles or present else ", or --rate HZ of a signal without times"
        raise InputError(message, expected=f"--column {'=NAME or '.join(roles)}=NAME{rate}")
    return present[0] if present else None


def _taken_times(arrays: Mapping[str, Samples], units: Mapping[str, str]) -> FloatArray | None:
    """Time of each row, s, if there is a time beside the frequency; else None."""
    beside = next((arrays[role] for role in ("frequency", "omega") if role in arrays), None)
    if "time" not in arrays or beside is None or np.shape(beside) != np.shape(arrays["time"]):
        return None
    return _abscissa({"time": arrays["time"]}, units)[1]


def _abscissa(arrays: Mapping[str, Samples], units: Mapping[str, str]) -> tuple[str, FloatArray]:
    """Role of the abscissa, and its values in Hz or s."""
    role = cast(str, _choose_role(arrays, tuple(_TO_ABSCISSA), "abscissa", needed=True))
    values = arrays[role]
    if np.iscomplexobj(values) or values.size != max(values.shape, default=1) or not values.size:
        raise InputError(f"array of {role} has the shape {values.shape}", expected="one real number for each point")
    factor = find_abscissa_factor(role, units.get(role, ""), f"--unit {role}=UNIT of")
    return role, np.asarray(values, dtype=np.float64).reshape(-1) * (_TO_ABSCISSA[role] * factor)


def _response(arrays: Mapping[str, Samples], n: int, is_time: bool) -> tuple[Samples, bool]:
    """The response (n, sweeps) and whether its phase is known."""
    main = cast(str, _choose_role(arrays, ("response", "x", "amplitude"), "response", needed=True))
    phase = _choose_role(arrays, tuple(PHASES), "phase", needed=False)
    values = _matrix(arrays[main], n, main)
    if (main == "x") != ("y" in arrays):
        raise InputError("x and y need each other", expected="--column x=NAME and y=NAME")
    if phase and main != "amplitude":
        raise InputError(f"{phase} beside a {main}", expected="a phase only beside an amplitude")
    if main == "x":
        if is_time:
            message = "x and y against time are no parts of a complex response"
            raise InputError(message, expected="--column response=NAME of the signal")
        return join_complex(_real(values, "x"), _real(_same(arrays["y"], n, values, "y"), "y")), True
    if main == "response":
        if np.iscomplexobj(values) == is_time:
            kind = "a time history of complex values" if is_time else "a response of real values"
            expected = "a real signal" if is_time else "complex values, or the role amplitude or x"
            raise InputError(kind, expected=expected)
        return values, not is_time
    if is_time:
        raise InputError("amplitudes against time", expected="--column response=NAME of the signal")
    size = _magnitude(values, "amplitude")
    if phase is None:
        return size, False
    angle = _real(_same(arrays[phase], n, values, phase), phase) * PHASES[phase]
    return size * np.exp(1j * angle), True


def _force(arrays: Mapping[str, Samples], n: int, k: int) -> Samples | None:
    """The force (n, 1) or (n, k); None if there is none."""
    main = _choose_role(arrays, ("force", "force_x"), "force", needed=False)
    if main is None:
        return None
    values = _spread(arrays[main], n, k, main)
    if main == "force_x":
        if "force_y" not in arrays:
            raise InputError("force_x needs force_y", expected="--column force_y=NAME")
        return join_complex(_real(values, "force_x"), _real(_spread(arrays["force_y"], n, k, "force_y"), "force_y"))
    if "force_lead_deg" in arrays:
        lead = _real(_spread(arrays["force_lead_deg"], n, k, "force"), "")
        return np.asarray(_magnitude(values, "force") * np.exp(1j * pi / 180.0 * lead))
    return values if np.iscomplexobj(values) or "time" in arrays else _magnitude(values, "force")


def _spread(values: Samples, n: int, k: int, role: str) -> Samples:
    """A force for each point, from one number, from one for each sweep, or unchanged."""
    if values.size == 1:
        return np.full((n, 1), values.reshape(-1)[0])
    if values.size == k and k != n:
        return np.broadcast_to(values.reshape(1, k), (n, k))
    matrix = _matrix(values, n, role)
    if matrix.shape[1] not in (1, k):
        raise InputError(f"{matrix.shape[1]} columns of {role}", expected=f"1 or {k} like the response")
    return matrix


def _matrix(values: Samples, n: int, role: str) -> Samples:
    """An array as (n, sweeps): points along the first axis, sweeps along the second."""
    squeezed = np.atleast_1d(np.squeeze(values))
    if squeezed.ndim == 1 and n == 1:
        squeezed = squeezed.reshape(1, -1)
    if squeezed.ndim == 1 and len(squeezed) == n:
        return squeezed.reshape(n, 1)
    if squeezed.ndim == 2 and n in squeezed.shape:
        matrix = squeezed if squeezed.shape[0] == n else squeezed.T
        if matrix.shape[1] <= MOST_SWEEPS:
            return matrix
    expected = f"{n} values like the abscissa, or {n} for each of at most {MOST_SWEEPS} sweeps"
    raise InputError(f"array of {role} has the shape {tuple(values.shape)}", expected=expected)


def _same(values: Samples, n: int, like: Samples, role: str) -> Samples:
    matrix = _matrix(values, n, role)
    if matrix.shape != like.shape:
        raise InputError(f"array of {role} has the shape {matrix.shape}", expected=f"{like.shape}")
    return matrix


def _real(values: Samples, role: str) -> FloatArray:
    if np.iscomplexobj(values):
        raise InputError(f"array of {role} is complex", expected="real numbers")
    return np.asarray(values, dtype=np.float64)


def _magnitude(values: Samples, role: str) -> FloatArray:
    """Amplitudes (n, sweeps); a minus sign is refused as a mistake or an unstated phase, which would be lost."""
    sizes = _real(values, role)
    below = np.argwhere(sizes < 0.0)
    if len(below):
        row, sweep = (int(place) for place in below[0])
        where = f"row {row + 1}" + (f" of sweep {sweep + 1}" if sizes.shape[1] > 1 else "")
        raise InputError(f"{role} {sizes[row, sweep]:g} in {where}", expected=f"{role} >= 0, an amplitude")
    return sizes


#: Quantity of the unit in the header of a role's column.
UNIT_OF = (
    dict.fromkeys(("force", "force_x", "force_y"), "force")
    | dict.fromkeys(("response", "x", "y", "amplitude"), "response")
    | {role: role for role in ("energy", "mass", "amplitude_sd", "force_sd", "sweep_rate", *ABSCISSAS)}
)


def require_linear(headers: Mapping[str, ColumnHeader]) -> None:
    """Raise InputError for columns or arrays in decibels, or parts of a phasor in different units or scalings."""
    for role, header in headers.items():
        if role in UNIT_OF:
            refuse_decibels(role, header.text)
    for parts in (("x", "y"), ("force_x", "force_y")):
        both = ((role, headers[role]) for role in parts if role in headers)
        texts = {role: f"{header.unit} {header.scaling or ''}".strip() for role, header in both}
        if len({text for text in texts.values() if text}) > 1:
            raise InputError(" and ".join(f"{role} in {text}" for role, text in texts.items()), expected="one unit")


def read_facts(headers: Mapping[str, ColumnHeader], stated: Stated) -> FileFacts:
    """Angles and the first unit of each quantity in the headers by role; stated units of an abscissa go first."""
    units = {role: text for role, text in stated.units.items() if role in (*ABSCISSAS, "sweep_rate")}
    for role, header in headers.items():
        if role in UNIT_OF and header.unit:
            units.setdefault(UNIT_OF[role], header.unit)
    return FileFacts(units=units, angles={role: header.angle for role, header in headers.items() if header.angle})


def find_scaling(headers: Mapping[str, ColumnHeader], quantity: str) -> str | None:
    """The first scaling in the headers by role that are of a quantity; None if none states one."""
    return next((h.scaling for role, h in headers.items() if UNIT_OF.get(role) == quantity and h.scaling), None)


def note_unheeded_units(roles: Iterable[str], stated: Stated, summary: Summary) -> None:
    """Caution on stated units of quantities of which the file has no column or array."""
    absent = stated.units.keys() - {UNIT_OF.get(role, role) for role in roles} - {"force", "response"}
    for what in sorted(absent):
        said = f"--unit {what}={stated.units[what]} changes nothing"
        summary.note(f"caution: {said}: the file has no {what} (give --column {what}=NAME if it has)")
