"""What the resonance frequencies of levels say of a mode's state: bistable or not, a joint that slips, and the mass."""

import numpy as np

from damping.arrays import FloatArray
from damping.infer.doubt import JointEvidence, find_joint
from damping.infer.observations import Observations
from damping.records.mode import Mode

#: Shift of the resonance, in half-power bandwidths, of a bistable mode: at 0.77 a cubic spring makes the response curve
#: vertical (4/(3 sqrt(3))); the rest is for the error of the mass.
BISTABLE = 1.0
#: What is said then, with the shift in bandwidths: of measured resonances, and of a predicted one.
OF_LEVELS = (
    "the resonance moved by {:.1f} half-power bandwidths over the levels: the mode is bistable at high drive "
    "and its amplitude depends on how it is driven there"
)
OF_PREDICTED = (
    "the resonance is predicted to move by {:.1f} half-power bandwidths from that of the lowest level: the mode is "
    "bistable there, and a sweep may jump before it reaches this amplitude"
)


def read_resonances(data: Observations, mode: Mode) -> tuple[str, JointEvidence]:
    """What the levels' resonance frequencies say: a caution of bistability, and whether a joint slips.

    Mass that was added is known. Masses that the record gives of its sweeps err by the mode's tolerance each; where
    the mode was taken from the record (``from_record``) they are estimates of one and the same, which is the mode's.
    """
    error, tested = mode.tolerance.mass, (data.tested_amplitude, data.tested_force, data.tested_omega)
    added, top = 0.0 if data.added_mass is None else data.added_mass, data.top
    state = mode.find_states(data.tested_mass, len(data.sweeps)) + added
    width = data.tested_force[top] / (state[top] * data.tested_omega[top] * data.tested_amplitude[top])
    bistable = describe_bistability(data.tested_omega * np.sqrt(state / state[top]), float(width))
    mass = mode.mass + added * np.ones(len(data.sweeps))
    if data.tested_mass is None or mode.tolerance.from_record:
        return bistable, find_joint(*tested, mass, error)
    own = np.where(np.isnan(data.tested_mass), mode.mass, data.tested_mass)
    return bistable, find_joint(*tested, mass - mode.mass + own, error, apart=error)


def describe_state(data: Observations, mode: Mode) -> str:
    """For which of several masses predictions hold; empty where all levels had one."""
    mass, top = mode.find_states(data.tested_mass, len(data.sweeps)), data.top
    known = f"levels of masses {mass.min():.4g} to {mass.max():.4g}: frequencies and damping ratios hold for"
    return f"{known} {mass[top]:.4g}, that of the largest level" if np.ptp(mass) > 0.0 else ""


def describe_bistability(omega: FloatArray, width: float, said: str = OF_LEVELS) -> str:
    """``said`` where two stable amplitudes are likely to belong to one force and frequency; else empty.

    ``omega``: resonances of one mass, rad/s. ``width``: the half-power bandwidth 2 zeta omega = F/(M omega A) of the
    one of largest amplitude. A cubic spring that moves the resonance by 4/(3 sqrt(3)) of it makes the response curve
    vertical somewhere.
    """
    moved = float(np.ptp(omega)) / width
    return said.format(moved) if moved >= BISTABLE else ""
