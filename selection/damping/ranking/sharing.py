"""Does one law hold on several records (modes, configurations)? The question of section 6.3 of the report.

One law L in all records shares its name and its shape parameters without dimension (an exponent), with coefficients,
slip limits and scatters of each record's own, against a law of its own for each:

    sum_L m_L Z_L  /  prod_i sum_L m_L Z_iL.

With the weight w of a law on a record and its prior mass m there, w/m is in proportion to its evidence Z_iL. Laws that
predict the same on a record share one prior mass and have its evidence in common. Where nothing is shared but the name,
Z_L = prod_i Z_iL; a shared shape s couples the records, and they are fitted jointly:

    Z_L = int p(s) prod_i Z_iL(s) ds,

Z_iL(s) the evidence of record i with the shape held, on nodes over the range of its prior and between them by a spline
through ln Z_iL.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator
from scipy.special import logsumexp, ndtri

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.errors import AnalysisError, InputError
from damping.forces.shapes import PURE
from damping.infer.balanced import Balanced
from damping.infer.best_fit import fit_law
from damping.infer.evidence import find_modes, list_starts, start_at
from damping.infer.importance import BRIEF_DRAWS, importance
from damping.infer.law import Coordinates, Law
from damping.infer.likelihood import log_prior
from damping.infer.observations import Observations
from damping.ranking import prior_masses

#: Laws of a record that predict the same, the one that was listed first, and their weight.
Groups = Sequence[tuple[tuple[str, ...], float]]
#: Prior probabilities at which a shape is held: the range in equal parts, and nodes about what was found there.
NODES = np.linspace(0.5, 15.5, 16) / 16.0
#: Further nodes, about where the records together put the shape, this far apart from others at least.
CLOSER_NODES = 8
APART = 1e-3
#: Prior probabilities between nodes, of the integrals.
FINE = np.linspace(0.5, 3999.5, 4000) / 4000.0
#: Probability left out on either side of the intervals of a shape.
TAIL = 0.05


@dataclass(frozen=True)
class SharedShape:
    """A shape parameter of a law that all records share.

    Attributes:
        name: of the parameter. pooled: median and ends of the 90 % interval where it is shared. each: the same of every
            record alone. log_odds: ln of the evidence for one value over that for a value of each record's own.
    """

    name: str
    pooled: tuple[float, float, float]
    each: tuple[tuple[float, float, float], ...]
    log_odds: float


#: Columns of the table of a joint fit, by the field of `Observations` that they hold: of rows, and of their sweeps.
_OF_ROWS = {
    "amplitude": "A",
    "damping_force": "D",
    "force_in_phase": "R",
    "amplitude_sd": "sd_amplitude",
    "force_sd": "sd_force",
    "phase_sd": "sd_phase",
}
_OF_SWEEPS = ("tested_force", "tested_amplitude")


def tabulate_rows(data: Observations) -> pd.DataFrame:
    """What a joint fit needs of a record, one row for each observation; :func:`read_rows` is the way back."""
    return pd.DataFrame(
        {"sweep": [data.sweeps[s] for s in data.sweep], "frequency": data.omega / RAD_S_PER_HZ}
        | {name: getattr(data, field) for name, field in _OF_ROWS.items()}
        | {name: getattr(data, name)[data.sweep] for name in _OF_SWEEPS}
        | {"tested_frequency": data.tested_omega[data.sweep] / RAD_S_PER_HZ, "decay": float(data.amplitude_is_input)}
    )


def read_rows(table: pd.DataFrame) -> Observations:
    """Observations from the columns of :func:`tabulate_rows`. KeyError for one that is missing."""
    labels = table["sweep"].astype(str)
    of_sweep = table.groupby(labels, sort=False)[[*_OF_SWEEPS, "tested_frequency"]].first().astype(float)
    number = {label: i for i, label in enumerate(of_sweep.index)}
    return Observations(
        omega=RAD_S_PER_HZ * table["frequency"].to_numpy(float),
        sweep=labels.map(number).to_numpy(np.int64),
        sweeps=tuple(map(str, of_sweep.index)),
        tested_omega=RAD_S_PER_HZ * of_sweep["tested_frequency"].to_numpy(),
        amplitude_is_input=bool(table["decay"].any()),
        **{field: table[name].to_numpy(float) for name, field in _OF_ROWS.items()},
        **{name: of_sweep[name].to_numpy() for name in _OF_SWEEPS},
    )


def share_shapes(records: Sequence[Groups], data: Sequence[Observations]) -> dict[str, SharedShape]:
    """The joint fits, by law, of all laws of the records that have one shape without dimension to share."""
    laws = {name: _parse(name) for groups in records for names, _ in groups for name in names if _is_known(name)}
    found = {}
    for name, law in laws.items():
        shapes = [shape for shape, of in law.free_shapes.items() if of.unit == PURE]  # the same on any record
        if len(shapes) == 1:
            with suppress(AnalysisError):  # a record that the law cannot carry shares nothing with it
                found[name] = fit_jointly(law, shapes[0], data)
    return found


def fit_jointly(law: Law, name: str, data: Sequence[Observations]) -> SharedShape:
    """Records fitted with one value of a shape parameter of the law, coefficients and scatters of each its own.

    Raises:
        AnalysisError: the law cannot carry the forces of a record.
    """
    held = [_hold_shape(law, name, one) for one in data]
    nodes, values = NODES, np.array([[log_z(p) for p in NODES] for log_z in held])
    lines = np.array([_interpolate(nodes, own) for own in values])
    _, low, high = _find_quantiles(lines.sum(axis=0))
    margin = max(high - low, 0.5 / len(NODES))
    closer = np.linspace(max(low - margin, FINE[0]), min(high + margin, FINE[-1]), CLOSER_NODES)
    closer = closer[np.abs(closer[:, None] - nodes).min(axis=1) > APART]
    order = np.argsort(np.append(nodes, closer))
    values = np.hstack([values, [[log_z(p) for p in closer] for log_z in held]])
    lines = np.array([_interpolate(np.append(nodes, closer)[order], own[order]) for own in values])
    together = lines.sum(axis=0)
    means = [float(logsumexp(line) - np.log(len(FINE))) for line in (together, *lines)]
    shape, tested = law.free_shapes[name], Coordinates.of(law, data[0]).tested
    quantiles = shape.prior_value(ndtri([_find_quantiles(line) for line in (together, *lines)]), tested)
    pooled, *each = ((float(median), float(low), float(high)) for median, low, high in quantiles)
    return SharedShape(name, pooled, tuple(each), means[0] - sum(means[1:]))


def _interpolate(nodes: FloatArray, values: FloatArray) -> FloatArray:
    """Values over ``FINE``, without overshoot between the nodes and level beyond them."""
    return np.asarray(PchipInterpolator(nodes, values)(np.clip(FINE, nodes[0], nodes[-1])))


def _find_quantiles(log_density: FloatArray) -> tuple[float, float, float]:
    """Prior probabilities at the median, the low end and the high end of a density over ``FINE``."""
    mass = np.cumsum(np.exp(log_density - log_density.max()))
    median, low, high = np.interp((0.5, TAIL, 1.0 - TAIL), mass / mass[-1], FINE)
    return float(median), float(low), float(high)


def _hold_shape(law: Law, name: str, data: Observations) -> Callable[[float], float]:
    """ln of a record's evidence as a function of the prior probability at which the shape is held."""
    own = Coordinates.of(law, data)
    posterior = Balanced(own.scaled(data.reference), data.scaled())
    place = own.names.index(name)
    starts = [np.delete(points, place, axis=1) for points in list_starts(posterior, start_at(fit_law(law, data), own))]

    def log_z(probability: float) -> float:
        held = float(ndtri(probability))

        def density(z: FloatArray) -> FloatArray:
            return posterior.log_density(np.insert(z, place, held, axis=-1)) - log_prior(np.array([[held]]))

        return importance(density, *find_modes(density, *starts), seed=0, wanted=BRIEF_DRAWS).log_z

    return log_z


def weigh_sharing(
    records: Sequence[Groups], shapes: Mapping[str, SharedShape] | None = None
) -> tuple[float, pd.DataFrame]:
    """Odds of one law in all records against one each, and the probability of each law if it is one.

    Args:
        shapes: joint fits of the laws that share a shape.

    Returns:
        The odds, NaN where a record has no law that is known; ``law, weight``, best first.
    """
    each = [_list_evidence(groups) for groups in records]
    laws = sorted({name for own in each for name in own})
    nothing = pd.DataFrame({"law": pd.Series(dtype=str), "weight": pd.Series(dtype=float)})
    if not all(each):
        return float("nan"), nothing
    prior = np.array(prior_masses([_parse(name) for name in laws]))
    evidence = np.array([[own.get(name, 0.0) for name in laws] for own in each])
    jointly = np.exp([shapes[name].log_odds if shapes and name in shapes else 0.0 for name in laws])
    together = prior * np.prod(evidence, axis=0) * jointly
    if not together.sum() > 0.0:
        return 0.0, nothing
    table = pd.DataFrame({"law": laws, "weight": together / together.sum()})
    odds = float(together.sum() / np.prod(evidence @ prior))
    return odds, table.sort_values("weight", ascending=False, kind="stable", ignore_index=True)


def _list_evidence(groups: Groups) -> dict[str, float]:
    """Evidence of each law of a record, up to a factor common to all of them."""
    known = [(names, weight) for names, weight in groups if _is_known(names[0])]
    masses = prior_masses([_parse(names[0]) for names, _ in known])
    return {
        name: weight / mass
        for (names, weight), mass in zip(known, masses, strict=True)
        for name in names
        if _is_known(name)
    }


def _parse(name: str) -> Law:
    return Law(tuple(name.split(" + ")))


def _is_known(name: str) -> bool:
    """Whether a law of a file is one of the library."""
    try:
        _parse(name)
    except InputError:
        return False
    return True
