"""Coefficients of a law as a table: posterior medians, standard deviations and intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from damping.arrays import FloatArray
from damping.infer.law import Coordinates

INTERVAL = 0.90  #: content of the credible interval of a coefficient in the table
#: Standard deviation of a coefficient, over that of a normal posterior with its interval, from which a few extreme
#: draws dominate it (that of a power law was 20 or 140 by the seed).
LONG_TAIL = 2.0


@dataclass(frozen=True)
class Coefficient:
    """One parameter of a law: posterior median, standard deviation, their ratio, and the ``INTERVAL`` interval."""

    force: str
    shape: str  #: empty for the coefficient of a force, else the name of the parameter (``exponent``, ``limit``)
    value: float
    std_error: float
    t_ratio: float
    low: float
    high: float


def tabulate_coefficients(coordinates: Coordinates, x: FloatArray) -> tuple[Coefficient, ...]:
    """Posterior median, standard deviation and interval of every parameter except doubt and scatters, of draws x."""
    tail, values = 50.0 * (1.0 - INTERVAL), coordinates.force_parameters(x)
    drawn = np.array([*values.values()])
    quantiles = np.percentile(drawn, [tail, 50.0, 100.0 - tail], axis=1)
    rows = []
    for name, (low, value, high), error in zip(values, quantiles.T.tolist(), drawn.std(axis=1).tolist(), strict=True):
        force, _, shape = name.partition(" ")
        rows.append(Coefficient(force, shape, value, error, value / error if error > 0.0 else np.nan, low, high))
    # coefficients first, then shapes
    return tuple(sorted(rows, key=lambda c: bool(c.shape)))


def describe_tails(coefficients: Sequence[Coefficient]) -> list[str]:
    """Cautions about coefficients whose standard deviation is far above that of their interval."""
    width = 2.0 * float(ndtri(0.5 * (1.0 + INTERVAL)))
    long = [f"{c.force} {c.shape}".strip() for c in coefficients if width * c.std_error > LONG_TAIL * (c.high - c.low)]
    return [f"a few extreme draws dominate the standard error of {name}: use its interval" for name in long]
