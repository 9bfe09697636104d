"""Make ``record.csv``: the test of a frame whose joint is softer than simulated, with friction of the tip's guide.

Constant friction R takes 4 R/pi off in quadrature (report, Eq. 4.3.6 with p = 0): the amplitude of each row is the root
of |Z A + 4 i R/pi| = F for the true frame's Z. One per cent of amplitude and 0.01 rad of phase are noise.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from two_beams import frame

#: True stiffness of the joint, N m/rad, simulated as 2500 within 10 %; friction of the guide, N; forces, N.
JOINT = 2150.0
FRICTION = 0.006
FORCES = (0.04, 0.08, 0.16)
NOISE = 0.01


def main() -> None:
    """Write the record beside this file."""
    rng = np.random.default_rng(1970)
    hertz = 3.62 + 0.25 * np.sinh(np.linspace(-1.6, 1.6, 25)) / np.sinh(1.6)
    rows = []
    for label, level in zip("ABC", FORCES, strict=True):
        A, phase = frame(np.ones(25), hertz, bending=140.0, joint=JOINT, loss=0.02)
        for f, Z in zip(hertz, np.exp(1j * phase) / A, strict=True):
            a = brentq(lambda a, Z=Z, F=level: abs(Z * a + 4j * FRICTION / np.pi) - F, 1e-9, 10.0 * level / abs(Z))
            lag = float(np.angle(Z * a + 4j * FRICTION / np.pi))
            rows.append(
                (label, level, f, a * (1.0 + NOISE * rng.normal()), lag + NOISE * rng.normal(), NOISE * a, NOISE)
            )
    names = ["sweep", "force", "frequency", "amplitude", "phase", "amplitude_sd", "phase_sd"]
    table = pd.DataFrame(rows, columns=names)
    table.to_csv(Path(__file__).with_name("record.csv"), index=False, float_format="%.6g")


if __name__ == "__main__":
    main()
