"""``damping extrapolate``: resonant amplitude beyond the test, with bands (form ``loads/1``)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.progress import progress
from pipelines.rank import load, rank_record
from pipelines.store import write_json
from pipelines.tables import Notes, console, number, plain_table
from selection.compare.ranking import Candidate, Ranking
from selection.errors import AnalysisError, InputError
from selection.loads.prediction import Loads, Member, amplitude_draws, predict
from selection.posterior.observations import Observations
from selection.posterior.sampling import Checkpoint, Posterior, sample
from selection.records.mode import Mode

#: Candidates with less weight do not take part in the average.
LEAST_WEIGHT = 0.01


def extrapolate(
    record: Path, mode: Path, forces: list[float], level: float, json_out: str | None, seed: int, max_size: int
) -> None:
    """Predict resonant amplitudes at design forces, print the table and write the form."""
    check_forces(forces, level)
    data, described = load(record, mode, max_size)
    ranking = rank_record(data, seed)
    loads = predict(sample_members(ranking, np.array(forces), seed), np.array(forces), data, level, seed)
    if json_out is not None:
        write_json(json_out, loads_form(loads))
    if json_out != "-":
        _print(loads, described)


def check_forces(forces: list[float], level: float) -> None:
    """InputError unless forces are positive numbers and the level lies strictly between 0 and 1."""
    for force in forces:
        if not (math.isfinite(force) and force > 0.0):
            raise InputError(f"--force {force:g}", expected="a force amplitude > 0")
    if not 0.0 < level < 1.0:
        raise InputError(f"--level {level:g}", expected="a probability between 0 and 1, such as 0.9")


def sample_members(ranking: Ranking, forces: np.ndarray, seed: int) -> list[Member]:
    """Sample every candidate with weight; one whose chain does not converge is left out, loudly.

    Raises:
        AnalysisError: no chain converged.
    """
    candidates = ranking.weighted(LEAST_WEIGHT)
    members, failures = [], []
    with progress("sampling", len(candidates)) as done:
        for candidate in candidates:
            posterior = sample_candidate(candidate, ranking.data, forces, seed)
            if posterior.converged:
                members.append(Member(candidate.name, candidate.weight, posterior.coordinates, posterior.draws))
            else:
                failures.append(f"{candidate.name}: {posterior.failure}")
            done(candidate.name + ("" if posterior.converged else f" FAILED: {posterior.failure}"))
    if not members:
        raise AnalysisError("no chain converged: " + "; ".join(failures))
    return members


def sample_candidate(
    candidate: Candidate, data: Observations, forces: np.ndarray, seed: int, checkpoint: Checkpoint | None = None
) -> Posterior:
    """Posterior of one candidate, run until its parameters and its amplitudes at ``forces`` are known."""
    assert candidate.coordinates is not None  # a candidate with a weight was fitted
    assert candidate.evidence is not None
    coordinates = candidate.coordinates

    def amplitudes(x: np.ndarray) -> dict[str, np.ndarray]:
        draws = amplitude_draws(Member(candidate.name, 1.0, coordinates, x), forces, data)
        return {f"amplitude at {force:g}": a for force, a in zip(forces, draws.T, strict=True) if np.isfinite(a).all()}

    return sample(coordinates, data, candidate.evidence, amplitudes, seed, checkpoint=checkpoint)


def loads_form(loads: Loads) -> dict[str, Any]:
    """The form ``loads/1``; credible bands are extra keys."""
    predictions = []
    for i, force in enumerate(loads.force):
        predictions.append(
            {
                "force": force,
                "median": loads.average.median[i],
                "low": loads.average.low[i],
                "high": loads.average.high[i],
                "credible_low": loads.average.credible_low[i],
                "credible_high": loads.average.credible_high[i],
                "linear": loads.linear[i],
                "linear_overprediction_percent": loads.overprediction[i],
                "linear_overprediction_low": loads.overprediction_low[i],
                "linear_overprediction_high": loads.overprediction_high[i],
                "extrapolation_ratio": loads.ratio[i],
                "cautions": list(loads.cautions[i]),
                "by_model": [
                    {"name": b.name, "weight": b.weight, "median": b.median[i], "low": b.low[i], "high": b.high[i]}
                    for b in loads.by_model
                ],
            }
        )
    return {"format": "loads/1", "level": loads.level, "predictions": predictions}


def _print(loads: Loads, mode: Mode) -> None:
    out, notes = console(), Notes()
    length = f" [{mode.units.length}]" if mode.units.length else ""
    headings = ("force", "times tested", "median", "low", "high", "linear", "linear over by %", "notes")
    table = plain_table(f"{mode.name}: resonant amplitude{length}", headings)
    for i, force in enumerate(loads.force):
        over = f"{number(loads.overprediction[i], 3)} ({number(loads.overprediction_low[i], 3)} to "
        table.add_row(
            f"{force:g}",
            f"{loads.ratio[i]:.2f}",
            *(number(band[i]) for band in (loads.average.median, loads.average.low, loads.average.high, loads.linear)),
            over + f"{number(loads.overprediction_high[i], 3)})",
            notes.numbers(loads.cautions[i]),
        )
    out.print(table)
    out.print(f"low to high: {100 * loads.level:g} % predictive band, averaged over models by weight.", highlight=False)
    notes.show(out)
