"""Resonant amplitude beyond the test.

The laws of a plan sampled: posterior draws of each, ready to be averaged by weight.

Higher levels of a record left out and predicted from the lower ones: an honest check within the record.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from damping.errors import AnalysisError
from damping.extrapolation.plan import Plan, Planned, plan_loads
from damping.extrapolation.prediction import Member, amplitude_draws, predict
from damping.infer.chains import Checkpoint, Posterior, Settings, sample
from damping.infer.observations import Observations
from damping.ranking import Candidate
from damping.ranking.weights import FEWEST_BELOW
from damping.records.resonance import number_levels

#: Laws with less weight do not take part in the average.
LEAST_WEIGHT = 0.01
#: Steps after which a chain that has not converged is given up: minutes, where most laws take seconds.
SETTINGS = Settings(budget=5000)
#: Effective importance draws that may stand for a chain that does not converge: they give the end of a 90 % band to 7 %
#: of the standard deviation, sqrt(0.05 * 0.95 / n) / 0.103.
INSTEAD = 200


def sample_members(
    plan: Plan, forces: np.ndarray, seed: int, done: Callable[[str], None] = lambda said: None
) -> list[Member]:
    """Sample every law with weight. Where a chain does not converge, importance draws stand in or the law is left out.

    Both are said, to ``done`` and among the cautions of every prediction.

    Args:
        forces: where predictions are wanted: chains run until amplitudes there are known. done: called with each law.

    Raises:
        AnalysisError: no chain converged, and importance draws are too few.
    """
    members, left_out = [], []
    for law in (law for law in plan.laws if law.weight > LEAST_WEIGHT):
        member, said = _member(law, sample_candidate(law, plan.data, forces, seed, settings=SETTINGS))
        if member:
            members.append(member)
        else:
            left_out.append(said)
        done(said or law.name)
    if not members:
        raise AnalysisError("no chain converged: " + "; ".join(left_out))
    return [replace(member, cautions=(*member.cautions, *left_out)) for member in members]


def _member(law: Planned, posterior: Posterior) -> tuple[Member | None, str]:
    """A law with its draws, and what is to be said of them; None where there are too few."""
    if posterior.converged:
        return Member(law.name, law.weight, posterior.coordinates, posterior.draws, law.kappa), ""
    said = f"{law.name}: the chain did not converge ({posterior.failure}), "
    if law.evidence.effective_draws < INSTEAD:
        return None, said + "left out"
    said += f"importance draws worth {law.evidence.effective_draws:.0f} are used"
    return Member(law.name, law.weight, law.coordinates, law.evidence.draws, law.kappa, (said,)), said


def sample_candidate(
    law: Candidate | Planned,
    data: Observations,
    forces: np.ndarray,
    seed: int,
    checkpoint: Checkpoint | None = None,
    settings: Settings | None = None,
) -> Posterior:
    """Posterior of one law, run until its parameters and its amplitudes at ``forces`` are known."""
    assert law.coordinates is not None  # a law with a weight was fitted
    assert law.evidence is not None
    name, coordinates = law.name, law.coordinates

    def amplitudes(x: np.ndarray) -> dict[str, np.ndarray]:
        draws = amplitude_draws(Member(name, 1.0, coordinates, x), forces, data)
        return {f"amplitude at {force:g}": a for force, a in zip(forces, draws.T, strict=True) if np.isfinite(a).all()}

    return sample(coordinates, data, law.evidence, amplitudes, seed, settings, checkpoint)


def members_of(plan: Plan, least: float = 0.0) -> list[Member]:
    """Laws of a plan with a weight above ``least``, on the draws of importance sampling."""
    laws = [law for law in plan.laws if law.weight > least]
    return [Member(law.name, law.weight, law.coordinates, law.evidence.draws, law.kappa) for law in laws]


def leave_higher_levels_out(data: Observations, level: float, seed: int = 0, mass: float | None = None) -> pd.DataFrame:
    """Predict every sweep of the higher levels from the k lowest ones, for every k >= ``FEWEST_BELOW``.

    Nothing of the higher levels is used: laws are chosen, weighed and given their discrepancy on the lower ones alone.

    Returns:
        A row a number of levels and sweep predicted: ``levels, laws, sweep, ratio, force, measured, median, low, high,
        inside, refused, linear_over_percent`` (of the measured), ``exponents``.
    """
    levels = number_levels(data.tested_force)
    rows = []
    for below in range(FEWEST_BELOW, int(levels.max()) + 1):
        lower = data.keep_sweeps(levels < below)
        higher = np.flatnonzero(levels >= below)
        higher = higher[np.argsort(data.tested_force[higher], kind="stable")]
        plan = plan_loads(lower, seed=seed, mass=mass)
        loads = predict(members_of(plan), data.tested_force[higher], lower, level, seed, plan)
        measured = data.tested_amplitude[higher]
        linear = lower.tested_amplitude[lower.top] * loads.ratio
        rows.append(
            pd.DataFrame(
                {
                    "levels": below,
                    "laws": len(plan.laws),
                    "exponents": ", ".join(f"{p:.2f}" for p in plan.trend.p),
                    "sweep": [data.sweeps[i] for i in higher],
                    "force": loads.force,
                    "ratio": loads.ratio,
                    "measured": measured,
                    "median": loads.average.median,
                    "low": loads.average.low,
                    "high": loads.average.high,
                    "inside": (loads.average.low <= measured) & (measured <= loads.average.high),
                    "refused": np.isnan(loads.average.median),
                    "linear_over_percent": 100.0 * (linear / measured - 1.0),
                }
            )
        )
    return pd.concat(rows, ignore_index=True) if rows else pd.DataFrame()
