"""State of a mode from the resonance frequencies of its levels: bistability, a joint that slips, and the mass."""

import numpy as np

from damping.arrays import FloatArray
from damping.infer.doubt import JointEvidence, find_joint
from damping.infer.observations import Observations
from damping.records.mode import Mode

#: Shift of the resonance, in half-power bandwidths, from which a mode counts as bistable: at 0.77, 4/(3 sqrt(3)), a
#: cubic spring makes the response curve vertical; the margin is for the error of the mass.
BISTABLE = 1.0
#: Cautions of bistability, with the shift in bandwidths: for measured resonances, and for a predicted one.
OF_LEVELS = (
    "the resonance moved by {:.1f} half-power bandwidths over the levels: the mode is bistable at high drive "
    "and its amplitude depends on how it is driven there"
)
OF_PREDICTED = (
    "the resonance is predicted to move by {:.1f} half-power bandwidths from that of the lowest level: the mode is "
    "bistable there, and a sweep may jump before it reaches this amplitude"
)


def read_resonances(data: Observations, mode: Mode) -> tuple[str, JointEvidence]:
    """A caution of bistability, and the evidence for a slipping joint, from the levels' resonance frequencies.

    Added mass is taken as exact. Each mass that the record gives for a sweep has the mode's tolerance as its error. If
    the mode was taken from the record (``from_record``), these masses are estimates of one mass, the mode's.
    """
    error, tested = mode.tolerance.mass, (data.tested_amplitude, data.tested_force, data.tested_omega)
    added, top = 0.0 if data.added_mass is None else data.added_mass, data.top
    state = mode.find_states(data.tested_mass, len(data.sweeps)) + added
    width = data.tested_force[top] / (state[top] * data.tested_omega[top] * data.tested_amplitude[top])
    bistable = describe_bistability(data.tested_omega * np.sqrt(state / state[top]), float(width))
    mass = mode.mass + added * np.ones(len(data.sweeps))
    if data.tested_mass is None or mode.tolerance.from_record:
        return bistable, find_joint(*tested, mass, error)
    swept_mass = np.where(np.isnan(data.tested_mass), mode.mass, data.tested_mass)
    return bistable, find_joint(*tested, mass - mode.mass + swept_mass, error, apart=error)


def describe_state(data: Observations, mode: Mode) -> str:
    """The mass for which predictions hold, if the levels had several; else empty."""
    mass, top = mode.find_states(data.tested_mass, len(data.sweeps)), data.top
    known = f"levels of masses {mass.min():.4g} to {mass.max():.4g}: frequencies and damping ratios hold for"
    return f"{known} {mass[top]:.4g}, that of the largest level" if np.ptp(mass) > 0.0 else ""


def describe_bistability(omega: FloatArray, width: float, caution: str = OF_LEVELS) -> str:
    """The ``caution`` if one force and frequency probably has two stable amplitudes; else empty.

    ``omega``: resonances at one mass, rad/s. ``width``: half-power bandwidth 2 zeta omega = F/(M omega A) of the
    resonance of largest amplitude. A cubic spring that moves the resonance by 4/(3 sqrt(3)) bandwidths makes the
    response curve vertical somewhere.
    """
    moved = float(np.ptp(omega)) / width
    return caution.format(moved) if moved >= BISTABLE else ""
