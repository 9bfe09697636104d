"""The diagnosis of a record: hypotheses are searched, weighed and doubted, and the answers form one result."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np

from damping.arrays import FloatArray
from damping.effects import CATALOGUE
from damping.errors import AnalysisError
from damping.forces import Viscous
from damping.gap import readings, scatter, size, weighing
from damping.gap.ambiguities import list_ambiguities
from damping.gap.corrected import corrected_mode, list_ends
from damping.gap.directed import Test, directed_tests, unexplained
from damping.gap.hypotheses import Hypothesis
from damping.gap.next_test import NextTest, name_command, rank_tests
from damping.gap.outside import Rival, describe_outside, weigh_library
from damping.gap.problem import Setting, State, exclude_effects, record_cautions, refuse_rows, setting
from damping.gap.recentring import search_about_fit
from damping.gap.search import Search
from damping.gap.simulator import Simulate
from damping.gap.simulator_checks import check_simulator
from damping.gap.states import as_given, drive_by_forces, list_crossing, list_repeated, list_unread, refuse_states
from damping.gap.weighing import Explanation, Group
from damping.gap.where import (
    FootprintCell,
    LocalEstimate,
    PowerTrend,
    ResidualCell,
    describe_resonances,
    footprint_cells,
    local_estimates,
    residual_cells,
    trend_of,
)
from damping.progress import Progress, nothing, silent, undisturbed, unknown_length
from damping.records.mode import Mode, Units
from damping.records.record import Record

HYPOTHESES = 60  #: Fitted in a usual diagnosis, about; progress is half way there.


@dataclass(frozen=True)
class Explained:
    """The weighed hypotheses about the gap between a simulation and a record."""

    record: Record  #: what is compared, as driven by forces
    mode: Mode  #: the simulation likewise
    states: tuple[State, ...]  #: see `explain`
    simulate: Simulate | None  #: see `explain`
    unit: float  #: of mass, in which both are
    setting: Setting  #: noise and repeatability as taken
    search: Search  #: the finished search
    hypotheses: tuple[Explanation, ...]  #: all that were fitted, with probabilities, most probable first
    tests: tuple[Test, ...]  #: directed tests of the leading hypothesis's residuals
    doubts: FloatArray  #: see `weighing.describe_doubts`
    in_library: float  #: probability that the library holds the cause
    unexplained: bool  #: whether more than noise is left
    unexplained_rows: bool  #: whether it is left in the rows, not only in the scatter of the levels
    #: scatter of the rows where the stated noise is too small and nothing else is left; ``in_library`` then ignores it
    understated: readings.RowScatter | None
    outside: tuple[Rival, ...]  #: causes outside the library, those of the rig first
    imitations: tuple[Hypothesis, ...]  #: explanations by causes outside the library that the record does not exclude
    cautions: tuple[str, ...]  #: limits of record and explanation

    @property
    def leading(self) -> Hypothesis:
        """The most probable hypothesis."""
        return self.hypotheses[0].hypothesis

    @property
    def corrected(self) -> Mode:
        """The simulation corrected by the leading hypothesis, in the units of these records."""
        corrected = as_given(corrected_mode(self.leading.best), self.unit, self.setting.problem.simulation.shaken)
        return corrected if corrected.drive == "base" else replace(corrected, units=self.units)

    @property
    def units(self) -> Units:
        """Of the answer's numbers: where a base shakes the first state, its accelerations are the forces."""
        rows = self.setting.problem.rows
        return self.mode.units.of_base_drive if np.any(rows.shaken[rows.state == 0.0]) else self.mode.units


@dataclass(frozen=True)
class Diagnosis(Explained):
    """The complete diagnosis of a gap."""

    explanations: tuple[Explanation, ...]  #: the most probable hypotheses, as few as reach ``COVER``
    groups: tuple[Group, ...]  #: effects that cannot be told apart
    levels: tuple[scatter.LevelDeviation, ...]  #: deviations of the sweeps that were taken as repeatability
    #: ``gap``, ``held_out``: see `damping.gap.size`
    gap: size.Gap
    #: ``where``, ``footprint``: see `damping.gap.where`
    where: tuple[ResidualCell, ...]
    footprint: tuple[FootprintCell, ...]
    held_out: size.HeldOut | None
    #: estimates by amplitude, with the trends of damping and frequency (None where they cannot be seen)
    local: tuple[LocalEstimate, ...]
    damping_trend: PowerTrend | None
    frequency_trend: PowerTrend | None

    @cached_property
    @undisturbed
    def next_tests(self) -> tuple[NextTest, ...]:
        """Candidate tests, the most discriminating first; none where none is needed."""
        command = name_command([(self.record, self.mode), *self.states], self.simulate)
        return rank_tests(
            self.explanations,
            self.hypotheses,
            self.in_library,
            command,
            unit=self.unit,
            columns=self.record.frame.columns,
            imitations=self.imitations,
            unexplained=self.unexplained and self.understated is None,
        )

    @property
    def next_test(self) -> NextTest | None:
        """The first candidate test if it is expected to settle the case; else None."""
        return next((test for test in self.next_tests[:1] if test.probability >= weighing.COVER), None)


@np.errstate(all="ignore")  # a search passes through impossible models; their results are not finite
def explain(
    record: Record,
    mode: Mode,
    states: Sequence[State] = (),
    simulate: Simulate | None = None,
    *,
    brief: bool = False,
    done: Callable[[str], None] = nothing,
) -> Explained:
    """Fit and weigh every hypothesis about the gap between a simulation and a record.

    Args:
        states: records of further states of the structure with their modes; effects are shared.
        simulate: the user's own simulation in the place of the mode, see `damping.gap.simulator.Simulator`.
        brief: skip causes outside the library where more than noise is left and the probability of a cause in the
            library is already below ``KNOWN``; weighing them could only lower it.
        done: reports each hypothesis that was fitted.

    Raises:
        AnalysisError: model and record are of different modes, there are too many rows, or resonances alone and a
            simulation without damping.
        InputError: a record is given twice, or states name different units.
    """
    given = [(record, mode), *states]
    refuse_states(given)
    driven = drive_by_forces(given, simulated=simulate is not None)
    (record, mode), *states = driven.states
    refuse_rows(driven.states)
    stated = mode
    if simulate is not None:  # the user's function has its damping; the viscous part of the mode stands for it
        viscous = {name: table for name, table in mode.damping.items() if name == Viscous.name}
        mode = replace(mode, damping=viscous)
    start = setting(record, mode, states, simulate, driven.shaken, driven.groups)
    rows = start.problem.rows
    if rows.at_resonance and not mode.damping and simulate is None:
        message = "the simulation has no damping, and so no resonance to compare with these rows, all at resonance"
        advice = "add a force to [damping]; damping rank finds the law"
        raise AnalysisError(f"{mode.source or mode.name}: {message}: {advice}")
    simulator = start.problem.simulation.simulator
    doubts = () if simulator is None else check_simulator(simulator, record)
    if simulator is not None and simulator.values:  # its own parameters are uncertain, and not from the record
        mode, stated = (replace(of, tolerance=replace(of.tolerance, from_record=False)) for of in (mode, stated))
    library = exclude_effects(CATALOGUE, mode, rows)
    of_states = (*list_repeated(given), *list_crossing(given), *list_unread(given))
    of_record = record_cautions(rows, record, stated, simulated=simulate is not None)
    cautions = [*doubts, *driven.notes, *of_states, *of_record]
    if unused := ", ".join(stated.damping.keys() - mode.damping.keys()):
        cautions.append(f"the damping {unused} of the mode file is ignored: the simulation has its own")
    known, search, extrapolated = search_about_fit(start, library, done)
    cautions += extrapolated
    compared = {"record": record, "mode": mode, "states": tuple(states), "simulate": simulate, "unit": driven.unit}
    return _weigh_search(known, search, cautions, brief=brief, **compared)


def _weigh_search(
    known: Setting, search: Search, cautions: Sequence[str], *, brief: bool, **compared: Any
) -> Explained:
    """Weigh and doubt the hypotheses of a finished ``search``; ``compared``: see `Explained`, ``brief``: `explain`."""
    hypotheses = weighing.weigh_hypotheses(search.ranked())
    leading = hypotheses[0].hypothesis
    tests = tuple(directed_tests(leading.best))
    understated = readings.measure_scatter(known, leading.best, tests, search.effects)
    in_rows = unexplained(leading.best, tests, search.effects) or known.dispersion > 1.0
    of_levels = bool(scatter.describe_repeatability(known, leading.best))
    by_scatter = readings.stands_above(understated, leading.best)
    verdict = weigh_library(
        search,
        hypotheses,
        tests,
        dispersion=1.0 if by_scatter else known.dispersion,
        unexplained=of_levels or (in_rows and not by_scatter),
        brief=brief and (in_rows or of_levels),
    )
    in_library, cautions = verdict.probability, [*cautions, *describe_outside(verdict.outside, leading)]
    if weighing.hides_state(leading.best):
        in_library = min(in_library, weighing.UNCONFIRMED)
        cautions.append("the effect acts on the only sweep of its state: a second sweep of that state would decide")
    blended = weighing.blend_probabilities(hypotheses, in_library, verdict.beyond)
    return Explained(
        **compared,
        setting=known,
        search=search,
        hypotheses=weighing.order_by_probability(blended),
        tests=tests,
        doubts=verdict.doubts,
        in_library=in_library,
        unexplained=in_rows or of_levels,
        unexplained_rows=in_rows,
        understated=understated,
        outside=verdict.outside,
        imitations=verdict.imitations,
        cautions=tuple(cautions),
    )


@np.errstate(all="ignore")  # as for `explain`
def diagnose(
    record: Record,
    mode: Mode,
    states: Sequence[State] = (),
    simulate: Simulate | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose the gap between a simulation and a record; arguments and errors as of `explain`.

    Adds doubts, levels held out, places and trends to what `explain` finds.
    """
    with unknown_length(progress, "diagnosing", HYPOTHESES) as report:
        explained = explain(record, mode, states, simulate, done=report)
    explained.search.done = nothing  # its part of the progress is over
    known, hypotheses, leading = explained.setting, explained.hypotheses, explained.leading
    held_out = size.hold_levels_out(known, explained.search, leading.best, progress)
    gap = size.measure_gap(leading.best)
    apart = scatter.describe_repeatability(known, leading.best)
    local = local_estimates(known.problem.rows.where(known.problem.rows.state == 0.0), explained.mode)
    doubts = [
        *apart,
        *scatter.describe_scatter(known, leading.best),
        *readings.describe_far_readings(leading.best),
        *readings.describe_noise(known, leading.best, explained.understated),
        *chain.from_iterable(readings.describe_rounding(own) for own in (record, *(state for state, _ in states))),
        *list_ends(leading.best),
        *list_ambiguities(leading.best),
        *describe_resonances(leading.best, local),
        *size.describe_held_out(leading, gap, held_out),
    ]
    return Diagnosis(
        **(vars(explained) | {"cautions": (*explained.cautions, *doubts)}),
        explanations=weighing.cover_probability(hypotheses),
        groups=weighing.group_equivalent_effects(
            [explanation.hypothesis for explanation in hypotheses], explained.search.effects
        ),
        levels=scatter.list_levels(leading.best),
        gap=gap,
        where=residual_cells(leading.best),
        footprint=footprint_cells(leading.best),
        held_out=held_out,
        local=local,
        damping_trend=trend_of(local, "damping"),
        frequency_trend=trend_of(local, "frequency"),
    )
