"""Deviations of whole sweeps that a fit ascribes to repeatability, and cautions about them."""

from dataclasses import dataclass
from math import factorial

import numpy as np

from damping.gap.fit import ModelFit
from damping.gap.problem import Setting

#: Deviation of a sweep, in units of repeatability, from which it is outlying: one in a thousand sweeps.
OUTLYING = 3.3
#: Range of deviations within each state, over that of the states' means, below which a state deviates as a whole.
AGREEING = 0.25
#: A caution says that deviations rise or fall with the force if, by chance, at most one record in this number does so.
ORDERED = 20


@dataclass(frozen=True)
class LevelDeviation:
    """Deviations of one sweep ascribed to repeatability: of gain and frequency, relative and in units of their sd."""

    sweep: str
    gain: float
    gain_sigma: float
    frequency: float
    frequency_sigma: float


def list_levels(fit: ModelFit) -> tuple[LevelDeviation, ...]:
    """The deviations of every sweep at a fit."""
    model = fit.model
    deviations = fit.y[model.size :].reshape(2, model.sweeps)
    gain, frequency = np.expm1(deviations.T * (model.scatter.amplitude, model.scatter.frequency)).T
    columns = (column.tolist() for column in (gain, deviations[0], frequency, deviations[1]))
    return tuple(LevelDeviation(*of_sweep) for of_sweep in zip(model.problem.rows.sweeps, *columns, strict=True))


def describe_repeatability(setting: Setting, fit: ModelFit) -> list[str]:
    """Cautions about deviations of sweeps: outlying levels, and estimates at the edge of their grid."""
    repeatability = [
        f"{name} deviates: its {what} by {size:+z.2%}, {sigma:.1f} sigma of repeatability"
        for what, field in (("readings", "gain"), ("frequency", "frequency"))
        for size, name, sigma in _list_deviations(fit, field)
        if sigma > OUTLYING
    ]
    hidden = "the upper limit of usual repeatability, {}: it may hide a fault of one level, or another cause"
    return repeatability + _describe_scatters(setting, fit, 1, hidden)


def _list_deviations(fit: ModelFit, field: str) -> list[tuple[float, str, float]]:
    """Size, name and |sigma| of the deviation of every sweep, smallest first; of every state if its sweeps agree."""
    levels, rows = list_levels(fit), fit.model.problem.rows
    sizes, sigmas = np.array([(getattr(level, field), getattr(level, f"{field}_sigma")) for level in levels]).T
    of_state = np.array([int(rows.state[run[0]]) for run in rows.runs])
    states = [(f"every sweep of state {number + 1}", of_state == number) for number in np.unique(of_state)]
    means = [float(sizes[own].mean()) for _, own in states]
    widest = max(float(np.ptp(sizes[own])) for _, own in states)
    if not (1 < len(states) < len(levels) and widest < AGREEING * np.ptp(means)):
        states, means = [(f"sweep {name}", np.array([k])) for k, name in enumerate(rows.sweeps)], sizes.tolist()
    return sorted(
        (mean, name, float(np.abs(sigmas[own]).max())) for mean, (name, own) in zip(means, states, strict=True)
    )


def describe_scatter(setting: Setting, fit: ModelFit) -> list[str]:
    """Cautions about repeatability of gain or frequency one step below the edge, which one rig in ten reaches."""
    taken = "{}, which was taken as repeatability; if the rig is known to repeat better, another cause is hidden there"
    return _describe_scatters(setting, fit, 2, taken)


def _describe_scatters(setting: Setting, fit: ModelFit, rank: int, ending: str) -> list[str]:
    """Cautions for gain and frequency with the ``rank``-th largest scatter tried; ``ending`` formats the span."""
    fitted, tried = fit.model.scatter, np.transpose(setting.unknowns.scatters)
    of_kinds = (("readings", "gain", fitted.amplitude), ("frequencies", "frequency", fitted.frequency))
    scatters = []
    for (what, name, scatter), sizes in zip(of_kinds, map(np.unique, tried), strict=True):
        if len(sizes) > 1 and np.isclose(scatter, sizes[-rank], rtol=1e-6):
            first, *_, last = _list_deviations(fit, name)
            span = f"from {_format_small(first[0])} in {first[1]} to {_format_small(last[0])} in {last[1]}"
            span += ", as if the mass or frequency of a state were not as stated" * first[1].startswith("every")
            side = "above" if first[0] > 0.0 else "below"
            lie = "scatter by" if first[0] * last[0] <= 0.0 else f"are all {side} the fit, with a repeatability of"
            order = _describe_order(fit, name)
            scatters.append(f"the {what} of the levels {lie} {scatter:.2%}, {ending.format(span)}{order}")
    return scatters


def _format_small(share: float) -> str:
    """A share in per cent with its sign and two decimals, or two digits where those would leave one: ``+0.0034%``."""
    return f"{share:+.2%}" if abs(share) >= 1e-3 else f"{100.0 * share:+.2g}%"


def _describe_order(fit: ModelFit, field: str) -> str:
    """Words for deviations that rise or fall with the force at every level, as 2 of the n! orders of n levels do.

    Empty for other orders, and for so few levels that chance would often give one of these.
    """
    levels = fit.model.problem.rows.levels
    sizes = np.array([getattr(level, field) for level in list_levels(fit)])
    steps = np.diff(np.bincount(levels, sizes) / np.bincount(levels))
    records = factorial(len(steps) + 1) // 2
    if records < ORDERED or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        return ""
    return (
        f"; they {'rise' if steps[0] > 0.0 else 'fall'} from level to level with the force, as chance does in one of "
        f"{records} records: a cause that depends on the level, or a drift, is likelier"
    )
