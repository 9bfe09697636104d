"""Sections 2.2 and 2.5: the report's example of four lumped masses, with numbers and dampers in its joints.

The report writes the matrices out for four masses driven at the fourth and gives no numbers. Here the masses are equal
and the springs between them too, both ends free like the vehicle, so that the modes are known in closed form:
omega_j = 2 sqrt(k/m) sin(j pi/8), phi_ij = cos((i - 1/2) j pi/4), j = 0 the rigid body.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from selection.response.modes import Damper, modal_force, normal_modes, subsystem_damping

MASSES = 4
#: Viscous dampers beside the springs: first joint, middle, last.
JOINTS = {"joint 1-2": 0.01, "joint 2-3": 0.02, "joint 3-4": 0.01}


def lumped_masses() -> pd.DataFrame:
    """A row a mode, with m = k = 1 and the displacement of mass 1 as modal coordinate.

    ``omega`` computed and ``omega_closed_form``; ``mass`` generalized; ``force``: modal force of a unit load at mass 4
    (Eq. 2.2.3); a column a joint: what its damper adds to the modal coefficient ``C`` (section 2.5), and ``xi``.
    """
    ends = np.ones(MASSES)
    ends[[0, -1]] = 0.5
    stiffness = 2.0 * np.diag(ends) - np.eye(MASSES, k=1) - np.eye(MASSES, k=-1)
    modes = normal_modes(np.ones(MASSES), stiffness, reference=0)
    dampers = [Damper(name, c, node, node + 1) for node, (name, c) in enumerate(JOINTS.items())]
    shares = subsystem_damping(modes, dampers)
    C = np.sum(list(shares.values()), axis=0)
    j = np.arange(MASSES)
    moving = j > 0
    omega = np.where(moving, modes.omega, 0.0)  # rounding leaves the rigid body a frequency of 1e-8
    return pd.DataFrame(
        {
            "mode": j,
            "omega": omega,
            "omega_closed_form": 2.0 * np.sin(j * np.pi / (2 * MASSES)),
            "mass": modes.masses,
            "force": modal_force(modes, MASSES - 1, 1.0),
            **{name: np.where(moving, share, 0.0).round(12) for name, share in shares.items()},  # 0 but for rounding
            "C": np.where(moving, C, 0.0),
            "xi": C / (2.0 * modes.masses * np.where(moving, omega, np.inf)),
        }
    )
