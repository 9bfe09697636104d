"""Does one law hold on several records (modes, configurations)? The question of section 6.3 of the report.

The odds compare one law L for all records with a separate law for each. One law has the same forces and the same
dimensionless shape parameters (an exponent) in all records; coefficients, slip limits and scatters differ:

    sum_L m_L Z_L  /  prod_i sum_L m_L Z_iL.

With the weight w of a law on a record and its prior mass m there, w/m is proportional to its evidence Z_iL. Laws with
the same predictions on a record share one prior mass and one evidence. If only the forces are shared,
Z_L = prod_i Z_iL. A shared shape s couples the records, which are then fitted jointly:

    Z_L = int p(s) prod_i Z_iL(s) ds,

where Z_iL(s) is the evidence of record i at fixed s, on nodes over the prior and by a spline in ln Z_iL between them.
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

#: Groups of laws with the same predictions on a record, the leading one first, and the weight of each group.
Groups = Sequence[tuple[tuple[str, ...], float]]
#: Prior quantiles at which a shape is held fixed, of equal probability.
NODES = np.linspace(0.5, 15.5, 16) / 16.0
#: Number of further nodes around the joint posterior of the shape, and their least distance from others.
CLOSER_NODES = 8
APART = 1e-3
FINE = np.linspace(0.5, 3999.5, 4000) / 4000.0  #: prior quantiles for the integrals
_SAME = 1e-5  #: relative difference up to which observations are of one test: conversions keep six digits or more
TAIL = 0.05  #: probability outside either end of the intervals of a shape


@dataclass(frozen=True)
class SharedShape:
    """A shape parameter of a law that all records share."""

    name: str  #: of the parameter
    pooled: tuple[float, float, float]  #: median and ends of the 90 % interval of the shared value
    each: tuple[tuple[float, float, float], ...]  #: the same of each record alone
    log_odds: float  #: ln evidence for one shared value less that for separate values


#: Columns of the table of a joint fit with their fields of `Observations`: by row, and by sweep.
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
    """Data of a record for a joint fit, one row for each observation; :func:`read_rows` is the inverse."""
    return pd.DataFrame(
        {"sweep": [data.sweeps[s] for s in data.sweep], "frequency": data.omega / RAD_S_PER_HZ}
        | {name: getattr(data, field) for name, field in _OF_ROWS.items()}
        | {name: getattr(data, name)[data.sweep] for name in _OF_SWEEPS}
        | {"tested_frequency": data.tested_omega[data.sweep] / RAD_S_PER_HZ, "decay": float(data.amplitude_is_input)}
    )


def read_rows(table: pd.DataFrame) -> Observations:
    """Observations from the columns of :func:`tabulate_rows`. KeyError for a missing column."""
    labels = table["sweep"].astype(str)
    of_sweep = table.groupby(labels, sort=False)[[*_OF_SWEEPS, "tested_frequency"]].first().astype(float)
    number = {label: i for i, label in enumerate(of_sweep.index)}
    return Observations(
        omega=RAD_S_PER_HZ * table["frequency"].to_numpy(float),
        sweep=labels.map(number).to_numpy(np.int64),
        sweeps=tuple(map(str, of_sweep.index)),
        tested_omega=RAD_S_PER_HZ * of_sweep["tested_frequency"].to_numpy(),
        amplitude_is_input=bool(table["decay"].any()),
        read_between=False,  # only a verdict of fit asks
        together=1.0,  # only evidence asks
        **{field: table[name].to_numpy(float) for name, field in _OF_ROWS.items()},
        **{name: of_sweep[name].to_numpy() for name in _OF_SWEEPS},
    )


def is_same_test(one: Observations, other: Observations, of_force: float, of_length: float) -> bool:
    """Whether two records hold the same observations; ``of_...``: factors from the units of ``one`` to the others."""
    rows, others = (tabulate_rows(data).drop(columns="sweep") for data in (one, other))
    for name in rows.columns[~rows.columns.str.endswith("_sd")]:  # which are relative
        rows[name] *= of_force if "force" in name else of_length if "amplitude" in name else 1.0
    return rows.shape == others.shape and np.allclose(rows, others, rtol=_SAME, atol=0.0)


def share_shapes(records: Sequence[Groups], data: Sequence[Observations]) -> dict[str, SharedShape]:
    """The joint fits, by law, of all laws of the records that have exactly one dimensionless shape."""
    laws = {name: Law.named(name) for groups in records for names, _ in groups for name in names if _is_known(name)}
    joint_fits = {}
    for name, law in laws.items():
        shapes = [shape for shape, facts in law.free_shapes.items() if facts.unit == PURE]  # comparable across records
        if len(shapes) == 1:
            with suppress(AnalysisError):  # the law cannot carry the forces of some record
                joint_fits[name] = fit_jointly(law, shapes[0], data)
    return joint_fits


def fit_jointly(law: Law, name: str, data: Sequence[Observations]) -> SharedShape:
    """Records fitted with one value of a shape parameter of the law, and separate coefficients and scatters.

    AnalysisError: the law cannot carry the forces of a record.
    """
    held = [_hold_shape(law, name, record) for record in data]
    nodes, values = NODES, np.array([[log_z(p) for p in NODES] for log_z in held])
    lines = np.array([_interpolate(nodes, curve) for curve in values])
    _, low, high = _find_quantiles(lines.sum(axis=0))
    margin = max(high - low, 0.5 / len(NODES))
    closer = np.linspace(max(low - margin, FINE[0]), min(high + margin, FINE[-1]), CLOSER_NODES)
    closer = closer[np.abs(closer[:, None] - nodes).min(axis=1) > APART]
    order = np.argsort(np.append(nodes, closer))
    values = np.hstack([values, [[log_z(p) for p in closer] for log_z in held]])
    lines = np.array([_interpolate(np.append(nodes, closer)[order], curve[order]) for curve in values])
    together = lines.sum(axis=0)
    means = [float(logsumexp(line) - np.log(len(FINE))) for line in (together, *lines)]
    shape, tested = law.free_shapes[name], Coordinates.of(law, data[0]).tested
    quantiles = shape.prior_value(ndtri([_find_quantiles(line) for line in (together, *lines)]), tested)
    pooled, *each = ((float(median), float(low), float(high)) for median, low, high in quantiles)
    return SharedShape(name, pooled, tuple(each), means[0] - sum(means[1:]))


def _interpolate(nodes: FloatArray, values: FloatArray) -> FloatArray:
    """Values over ``FINE``, monotone between nodes and constant outside them."""
    return np.asarray(PchipInterpolator(nodes, values)(np.clip(FINE, nodes[0], nodes[-1])))


def _find_quantiles(log_density: FloatArray) -> tuple[float, float, float]:
    """Prior quantiles of the median, the low end and the high end of a density over ``FINE``."""
    mass = np.cumsum(np.exp(log_density - log_density.max()))
    median, low, high = np.interp((0.5, TAIL, 1.0 - TAIL), mass / mass[-1], FINE)
    return float(median), float(low), float(high)


def _hold_shape(law: Law, name: str, data: Observations) -> Callable[[float], float]:
    """ln evidence of a record as a function of the prior quantile at which the shape is fixed."""
    coordinates = Coordinates.of(law, data)
    posterior = Balanced.of(coordinates, data)
    place = coordinates.names.index(name)
    starts = [
        np.delete(points, place, axis=1) for points in list_starts(posterior, start_at(fit_law(law, data), coordinates))
    ]

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
        The odds, NaN where a record has no known law; and a table ``law, weight``, best first.
    """
    each = [_list_evidence(groups) for groups in records]
    laws = sorted({name for evidences in each for name in evidences})
    nothing = pd.DataFrame({"law": pd.Series(dtype=str), "weight": pd.Series(dtype=float)})
    if not all(each):
        return float("nan"), nothing
    prior = np.array(prior_masses([Law.named(name) for name in laws]))
    evidence = np.array([[evidences.get(name, 0.0) for name in laws] for evidences in each])
    jointly = np.exp([shapes[name].log_odds if shapes and name in shapes else 0.0 for name in laws])
    together = prior * np.prod(evidence, axis=0) * jointly
    if not together.sum() > 0.0:
        return 0.0, nothing
    table = pd.DataFrame({"law": laws, "weight": together / together.sum()})
    odds = float(together.sum() / np.prod(evidence @ prior))
    return odds, table.sort_values("weight", ascending=False, kind="stable", ignore_index=True)


def _list_evidence(groups: Groups) -> dict[str, float]:
    """Evidence of each law of a record, up to a common factor."""
    known = [(names, weight) for names, weight in groups if _is_known(names[0])]
    masses = prior_masses([Law.named(names[0]) for names, _ in known])
    return {
        name: weight / mass
        for (names, weight), mass in zip(known, masses, strict=True)
        for name in names
        if _is_known(name)
    }


def _is_known(name: str) -> bool:
    """Whether the library has all forces of a law."""
    try:
        Law.named(name)
    except InputError:
        return False
    return True
