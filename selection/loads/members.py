"""The laws of a plan sampled: posterior draws of each, ready to be averaged by weight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from selection.compare.ranking import Candidate
from selection.errors import AnalysisError
from selection.loads.plan import Plan, Planned
from selection.loads.prediction import Member, amplitude_draws
from selection.posterior.observations import Observations
from selection.posterior.sampling import Checkpoint, Posterior, Settings, sample

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
