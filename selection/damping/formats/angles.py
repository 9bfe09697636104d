"""Angles in rad: by what their headers say, or by what their size and turn allow."""

from collections.abc import Mapping
from math import pi

import numpy as np

from damping.errors import InputError
from damping.formats.headers import PHASES
from damping.formats.series import FileFacts, Samples, Summary

#: An angle within 2 pi that turns by more is one in rad: a resonance turns it by pi, some degrees are none.
_TURN_IN_RADIANS = 1.5


def convert_angles(arrays: Mapping[str, Samples], facts: FileFacts, summary: Summary) -> dict[str, Samples]:
    """Angles in rad: those whose header says degrees, and an angle of unknown sense that is too large for rad.

    An uncertainty whose header says nothing is in the unit of its phase, and a phase without a number is none. Roles
    that end with ``_deg`` keep their degrees. InputError: an angle said to be in rad that is too large for it, or in
    degrees that turns as rad do.
    """
    turned, of_phase = dict(arrays), ""
    for role in PHASES:
        if role not in turned or np.iscomplexobj(turned[role]):
            continue
        values = np.asarray(turned[role], dtype=np.float64)
        if not np.isfinite(values).any():
            turned.pop("phase_sd", None)
            del turned[role]
            summary.note(f"the {role} holds no number: no phases are taken")
            continue
        of_phase = _tell_unit(role, values, facts.angles.get(role, ""))
        if of_phase == "degrees" and not role.endswith("_deg"):
            turned[role] = values * (pi / 180.0)
        if role == "angle":
            whence = "found in the file" if role in facts.angles else "follows from its size"
            summary.add("unit of angle", of_phase, whence)
    if "phase_sd" in turned:
        degrees = (facts.angles.get("phase_sd") or of_phase) == "degrees"
        if degrees:
            turned["phase_sd"] = turned["phase_sd"] * (pi / 180.0)
        whence = "found in the file" if "phase_sd" in facts.angles else "that of the phase"
        summary.add("unit of phase_sd", "degrees" if degrees else "rad", whence)
    return turned


def _tell_unit(role: str, values: Samples, said: str) -> str:
    """``degrees`` or ``rad``; ``said`` by its header. InputError where its size or turn is another's."""
    known = values[np.isfinite(values)]
    size = float(np.max(np.abs(known)))
    large = size > 2.0 * pi
    degrees = said == "degrees" or role.endswith("_deg")
    if (role in ("phase", "lead") or said == "radians") and large and not degrees:
        other = "lead_deg" if role == "lead" else "lag_deg"
        expected = f"at most 2 pi, or --column {other}=NAME for degrees"
        raise InputError(f"{role} in rad up to {size:.4g}", expected=expected)
    if degrees and not large and np.ptp(known) > _TURN_IN_RADIANS:
        message = f"{role} in degrees runs from {known.min():.3g} to {known.max():.3g}"
        raise InputError(message, expected="degrees, or --column phase=NAME (lag) or lead=NAME for rad")
    return "degrees" if degrees or large else "rad"
