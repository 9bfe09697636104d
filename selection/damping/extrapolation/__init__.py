"""Resonant amplitude beyond the test: the one chain from rows near resonance to bands at design forces.

    rows near resonance -> laws and their weights -> posterior draws of each -> prediction averaged by weight

The draws come from the importance sampling that weighed the laws, or are fresh draws of its proposal.

As a check within the record, its higher levels can be left out and predicted from the lower ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, join_rows
from damping.extrapolation.backbone import observe_backbone
from damping.extrapolation.draws import (
    LEAST_WEIGHT,
    Draws,
    Member,
    NextLevel,
    amplitude_draws,
    choose_next_level,
    find_shares,
    list_levels,
    vary_priors,
)
from damping.extrapolation.plan import ROUNDING, Plan, find_repeatability, judge_rows, plan_loads
from damping.extrapolation.prediction import REFUSED_SHARE, Loads, predict
from damping.extrapolation.prepared import PreparedRecord
from damping.extrapolation.reading import NextReading, read_members
from damping.extrapolation.requested import check_loads
from damping.infer.balanced import Balanced
from damping.infer.chains import Posterior, sample
from damping.infer.evidence import Estimate, evidence
from damping.infer.importance import LEAST_DRAWS, draw_again
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.infer.proposal import MOST_FITTED, Proposal
from damping.progress import Progress, silent, undisturbed
from damping.ranking import Candidate, Ranking
from damping.ranking.candidates import resonant_laws
from damping.records.mode import Mode

FEWEST_BELOW = 2  #: fewest levels below a held-out level
#: Fresh draws of a law for each hundredth of its weight, plus the same number once: the upper end of the Saturn V's
#: band at three times the tested force then differs by 1.0 % from seed to seed.
FRESH_DRAWS = 1536
#: Least reduction of ln(high/low) of a band by a further level: ends differ by as much from seed to seed.
LEAST_GAIN = 0.01
#: Forces predicted at once: the draws at each take up to 4 MB until their quantiles are known. Each block draws the
#: paths anew: fewer and larger ones take less time.
AT_ONCE = 16
DRAWN_FROM = 0.8  #: lower end of a drawn band over the smallest tested force: that point stands apart from the frame
DRAWN_TO = 1.05  #: upper end over the largest force that is tested or requested, for the same reason
DRAWN = 60  #: forces of a drawn band


def draw_fresh(law: Candidate, data: Observations, seed: int) -> FloatArray:
    """Fresh posterior draws (n, dimension) from the last proposal of the evidence; the evidence's draws if few count.

    The evidence stops once it has enough effective draws, so it usually misses the draws of large weight at which
    discrepancy is large: with its draws the upper end of the Saturn V's band at 90 lb was 2.6 % too low.
    """
    posterior, first = Balanced.of(law.coordinates, data), law.weighed.draws
    fitted = posterior.find_variables(first[:: max(1, len(first) // MOST_FITTED)])
    proposal, number = Proposal.through(fitted, law.weighed.effective_draws), 1 + round(100.0 * law.weight)
    fresh = draw_again(posterior.log_density, proposal, FRESH_DRAWS * number, seed)
    return posterior.find_points(fresh.draws) if fresh.effective_draws > LEAST_DRAWS else first


@dataclass(frozen=True)
class Extrapolation:
    """Predictions, with the laws, weights and draws they come from."""

    plan: Plan  #: laws and weights
    members: tuple[Member, ...]  #: the averaged laws, with draws
    loads: Loads  #: predictions at the requested forces
    mode: Mode | None  #: of the structure, None if unknown
    seed: int  #: of all draws
    #: candidate further levels, then the design force (the largest requested and allowed one); or empty
    levels: FloatArray
    readings: tuple[NextReading, ...]  #: of each member, at any force
    draws: tuple[Draws, ...]  #: of each member at the requested forces

    @undisturbed
    def predict_at(self, forces: np.ndarray, *, each: bool = False, to_invert: bool = False) -> Loads:
        """Predictions at other forces (forces,) from the same draws; ``each``, ``to_invert``: see `predict`."""
        known = self.plan.data, self.loads.level, self.seed, self.plan

        def predict_block(block: FloatArray) -> Loads:  # its draws are given back before those of the next are made
            draws = [reading.at(block) for reading in self.readings]
            return predict(self.members, block, *known, draws=draws, each=each, to_invert=to_invert)

        return join_rows([*map(predict_block, np.array_split(forces, max(1, -(-len(forces) // AT_ONCE))))])

    def predict_drawn(self, tested: FloatArray, points: int = DRAWN) -> Loads:
        """The band to draw, at ``points`` forces over the ``tested`` ones (levels,) and the requested ones."""
        asked = self.loads.force[np.isfinite(self.loads.force)]
        high = max(tested.max(), asked.max(initial=0.0))
        return self.predict_at(np.linspace(DRAWN_FROM * tested.min(), DRAWN_TO * high, points))

    @cached_property
    @undisturbed
    def with_other_priors(self) -> pd.DataFrame:
        """The predictions with other priors (:func:`damping.extrapolation.draws.vary_priors`); NaN where refused."""
        table = vary_priors(self.members, self.draws, self.loads.force, self.loads.level)
        refused = self.loads.force[np.isnan(self.loads.average.median)]
        table.loc[table["force"].isin(refused), ["median", "low", "high"]] = np.nan
        return table

    @cached_property
    @undisturbed
    def next_level(self) -> NextLevel | None:
        """The further level that would most shrink the band at the largest requested force.

        None if that force is within the test, if its prediction is refused, if the gain is below ``LEAST_GAIN``, or if
        no further levels were asked for.
        """
        if not self.levels.size:
            return None
        *tried, design = self.levels
        draws = [reading.at(self.levels[-1:]) for reading in self.readings]
        if find_shares(self.members, draws) @ ~join_rows(draws).resonates[:, -1] > REFUSED_SHARE:
            return None
        if np.isnan(self.loads.average.median[self.loads.force == design]).any():
            return None

        def choose(block: FloatArray) -> NextLevel:  # as in `predict_at`
            at_block = [reading.at(np.append(block, design)) for reading in self.readings]
            return choose_next_level(self.members, at_block, block, design, self.loads.level)

        best = [*map(choose, np.array_split(np.array(tried), -(-len(tried) // AT_ONCE)))]
        table = pd.concat([each.others for each in best]).sort_values("expected", kind="stable")
        chosen = replace(min(best, key=lambda each: each.expected), others=table)
        return chosen if np.log(chosen.width / chosen.expected) > LEAST_GAIN else None


def extrapolate_loads(
    data: Observations,
    forces: Sequence[float] | np.ndarray,
    level: float = 0.9,
    seed: int = 0,
    *,
    mode: Mode | None = None,
    laws: Sequence[Law] | None = None,
    plan: Plan | None = None,
    all_rows: Observations | None = None,
    estimate: Estimate = evidence,
    ranking: Ranking | None = None,
    fresh: bool = True,
    progress: Progress = silent,
) -> Extrapolation:
    """Predict resonant amplitudes at ``forces``; every prediction of the project comes from here.

    Args:
        data: rows near resonance (:func:`damping.extrapolation.prepared.near_resonance`).
        level: content of the bands.
        mode: its mass shows whether it is bistable; its repeatability is a lower bound of the scatter.
        laws: candidates, by default :func:`resonant_laws`.
        plan: if already made.
        all_rows: if given, laws are also judged on these.
        estimate: of marginal likelihoods.
        ranking: of these candidates, if already made (:func:`damping.extrapolation.plan.plan_loads`).
        fresh: whether to draw afresh from laws of more than ``LEAST_WEIGHT`` (:func:`draw_fresh`), and to try further
            levels (``next_level``); a fleet and a comparison need neither.

    InputError: an invalid force or level, before any work.
    AnalysisError: no candidate can carry the measured forces.
    """
    requested = check_loads(forces, level)
    if plan is None:
        candidates = resonant_laws() if laws is None else laws
        with progress("weighing laws", len(candidates)) as done:
            plan = plan_loads(data, candidates, seed, done, mode, estimate, ranking)
    plan = judge_rows(plan, all_rows, seed, estimate) if all_rows else plan
    members, backbone = [], observe_backbone(data, mode)
    with progress("sampling", len(plan.laws)) as done:
        for law in plan.laws:
            again = fresh and law.weight > LEAST_WEIGHT
            x = draw_fresh(law, plan.data, seed) if again else law.weighed.draws
            members.append(Member(law.name, law.weight, law.coordinates, x, plan.joint, backbone).thin())
            done(law.name)
    design, tested = min(float(requested.max()), plan.limit), plan.data.tested_force
    beyond = fresh and design > tested.max() * (1.0 + ROUNDING)
    levels = np.append(list_levels(tested, design), design) if beyond else np.empty(0)
    readings = read_members(members, plan.data, find_repeatability(mode), seed)
    draws = tuple(reading.at(requested) for reading in readings)
    loads = predict(members, requested, plan.data, level, seed, plan, draws=draws)
    return Extrapolation(plan, tuple(members), loads, mode, seed, levels, readings, draws)


def predict_record(
    prepared: PreparedRecord,
    forces: FloatArray,
    times: Sequence[float],
    level: float,
    seed: int,
    *,
    estimate: Estimate = evidence,
    ranking: Ranking | None = None,
    fresh: bool = True,
    progress: Progress = silent,
) -> Extrapolation:
    """Predictions at ``forces``, or, if there are none, at ``times`` the largest tested force.

    ``estimate``, ``ranking``, ``fresh``: see :func:`extrapolate_loads`.
    """
    data = prepared.data
    return extrapolate_loads(
        data,
        forces if len(forces) else np.array(times) * data.tested_force.max(),
        level,
        seed,
        mode=prepared.mode,
        all_rows=prepared.all_rows,
        estimate=estimate,
        ranking=ranking,
        fresh=fresh,
        progress=progress,
    )


def sample_candidate(law: Candidate, data: Observations, forces: np.ndarray, seed: int) -> Posterior:
    """Posterior of one law, sampled until its parameters and its amplitudes at ``forces`` have converged."""
    name, coordinates, begun = law.name, law.coordinates, law.weighed
    if begun.effective_draws < LEAST_DRAWS:  # the evidence stopped early: the law's weight is negligible
        begun = evidence(coordinates, data, seed)

    def amplitudes(x: np.ndarray) -> dict[str, np.ndarray]:
        draws = amplitude_draws(Member(name, 1.0, coordinates, x), forces, data)
        return {f"amplitude at {force:g}": a for force, a in zip(forces, draws.T, strict=True) if np.isfinite(a).all()}

    return sample(coordinates, data, begun, amplitudes, seed)


#: A table of levels left out, where there are none.
_NONE_LEFT_OUT = pd.DataFrame({"levels": 0, "laws": 0, "exponents": "", "sweep": ""}, index=[]).assign(
    **dict.fromkeys(("force", "ratio", "measured", "median", "low", "high"), 0.0),
    **{"inside": False, "refused": False, "linear_over_percent": 0.0},
)


def leave_higher_levels_out(
    data: Observations, level: float, seed: int = 0, mode: Mode | None = None, all_rows: Observations | None = None
) -> pd.DataFrame:
    """Predict every sweep of the higher levels from the k lowest levels, for every k >= ``FEWEST_BELOW``.

    Nothing of the higher levels is used: laws, weights and discrepancy come from the lower levels alone.
    ``all_rows``: every row of the sweeps of ``data``; if given, laws are also judged on these.

    Returns:
        One row for each number of levels and sweep: ``levels, laws, sweep, ratio, force, measured, median, low, high,
        inside, refused, linear_over_percent`` (of the measured), ``exponents``. None with fewer levels.
    """
    levels = data.levels
    tables = []
    for below in range(FEWEST_BELOW, int(levels.max()) + 1):
        lower, rows = data.take_sweeps(levels < below), all_rows and all_rows.take_sweeps(levels < below)
        higher = np.flatnonzero(levels >= below)
        higher = higher[np.argsort(data.tested_force[higher], kind="stable")]
        predicted = extrapolate_loads(lower, data.tested_force[higher], level, seed, mode=mode, all_rows=rows)
        loads, plan, measured = predicted.loads, predicted.plan, data.tested_amplitude[higher]
        linear = plan.data.tested_amplitude[plan.data.top] * loads.ratio
        columns = {
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
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True) if tables else _NONE_LEFT_OUT
