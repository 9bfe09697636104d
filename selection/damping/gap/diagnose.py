"""The diagnosis of a record: hypotheses are searched, weighed and doubted, and the answers form one result."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damping.arrays import FloatArray
from damping.effects import CATALOGUE
from damping.effects.contract import Effect
from damping.errors import AnalysisError
from damping.forces import Viscous
from damping.gap import readings, size, weighing
from damping.gap.corrected import corrected_mode, describe_gain, describe_shortfall, list_ends
from damping.gap.directed import Test, directed_tests, unexplained
from damping.gap.hypotheses import Hypothesis
from damping.gap.next_test import NextTest, name_command, rank_tests
from damping.gap.outside import describe_outside, weigh_library
from damping.gap.problem import Setting, State, exclude_effects, list_unread, record_cautions, refuse_rows, setting
from damping.gap.search import Search
from damping.gap.simulation import Simulate
from damping.gap.states import as_given, drive_by_forces, list_crossing, list_repeated, refuse_states
from damping.gap.unknowns import spread
from damping.gap.weighing import Explanation, Group
from damping.gap.where import (
    FootprintCell,
    LocalEstimate,
    PowerTrend,
    ResidualCell,
    footprint_cells,
    local_estimates,
    residual_cells,
    trend_of,
)
from damping.records.mode import Mode, Units
from damping.records.record import Record

#: Excess of the spread over noise, in its standard errors 0.8/sqrt(n), from which noise is enlarged; most times.
DISPERSED = 4.0
MOST_DISPERSIONS = 3
#: With fewer rows, noise that is not stated is not enlarged to the residuals of the best explanation.
FEW_ROWS = 40
#: Most times that noise which is not stated is estimated anew from the residuals of the leading explanation.
MOST_NOISES = 3
#: Most probable explanations by several effects at one noise estimate that are fitted at the next one too.
MOST_CARRIED = 8


@dataclass(frozen=True)
class Explained:
    """The weighed hypotheses about a gap.

    Attributes:
        record, mode: what is compared, as driven by forces, in a ``unit`` of mass. setting: noise and repeatability as
            taken. search: the finished search.
        library: effects that were tried. hypotheses: all that were fitted, with probabilities, most probable first.
        tests: directed tests of the leading hypothesis's residuals. doubts: see `weighing.describe_doubts`.
        in_library: probability that the library holds the cause. unexplained: whether more than noise is left.
        unexplained_rows: whether it is left in the rows, not only in the scatter of the levels. understated: scatter of
            the rows where the stated noise is too small and nothing else is left; ``in_library`` then ignores it.
        imitations: explanations by causes outside the library that the record does not tell from the leading one.
        cautions: what the record cannot say. states, simulate: see `explain`.
    """

    record: Record
    mode: Mode
    setting: Setting
    search: Search
    library: Mapping[str, Effect]
    hypotheses: tuple[Explanation, ...]
    tests: tuple[Test, ...]
    doubts: FloatArray
    in_library: float
    unexplained: bool
    unexplained_rows: bool
    understated: readings.RowScatter | None
    imitations: tuple[Hypothesis, ...]
    cautions: tuple[str, ...]
    states: tuple[State, ...]
    simulate: Simulate | None
    unit: float

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
    """The complete diagnosis of a gap.

    Attributes:
        explanations: the most probable hypotheses, as few as reach ``COVER``.
        groups: effects that cannot be told apart.
        levels: deviations of the sweeps that were taken as repeatability. gap, held_out: see `damping.gap.size`. where,
            footprint: see `damping.gap.where`. local: estimates by amplitude, with the trends of damping and frequency
            (None where they cannot be seen).
    """

    explanations: tuple[Explanation, ...]
    groups: tuple[Group, ...]
    levels: tuple[size.LevelDeviation, ...]
    gap: size.Gap
    where: tuple[ResidualCell, ...]
    footprint: tuple[FootprintCell, ...]
    held_out: size.HeldOut | None
    local: tuple[LocalEstimate, ...]
    damping_trend: PowerTrend | None
    frequency_trend: PowerTrend | None

    @cached_property
    def next_tests(self) -> tuple[NextTest, ...]:
        """Candidate tests, the most discriminating first; none where none is needed."""
        command = name_command([(self.record, self.mode), *self.states], self.simulate)
        columns = self.record.frame.columns
        return rank_tests(
            self.explanations, self.hypotheses, self.in_library, command, self.unit, columns, self.imitations
        )

    @property
    def next_test(self) -> NextTest | None:
        """The first candidate test if it is expected to settle the case; else None."""
        return next((test for test in self.next_tests[:1] if test.probability >= weighing.COVER), None)


@np.errstate(all="ignore")  # a search passes through impossible models; their results are not finite
def explain(
    record: Record,
    mode: Mode,
    effects: Mapping[str, Effect] | None = None,
    states: Sequence[State] = (),
    simulate: Simulate | None = None,
    *,
    brief: bool = False,
) -> Explained:
    """Fit and weigh every hypothesis about the gap between a simulation and a record.

    Args:
        effects: the library, by name; all of `CATALOGUE` where not given.
        states: records of further states of the structure with their modes; effects are shared.
        simulate: the user's own simulation in the place of the mode, see `damping.gap.simulation.Simulator`.
        brief: skip causes outside the library where more than noise is left and the probability of a cause in the
            library is already below ``KNOWN``; weighing them could only lower it.

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
        message = "no damping is simulated, and so no resonance that these rows, all of them at resonance, part from"
        raise AnalysisError(f"{mode.source}: {message}: simulate some in [damping]; damping rank tells which law fits")
    if start.problem.simulation.simulator is not None:
        start.problem.simulation.simulator.require_sense(record)
    library = exclude_effects(CATALOGUE if effects is None else effects, mode, rows)
    of_states = (*list_repeated(given), *list_crossing(given), *list_unread(given))
    cautions = [*driven.notes, *of_states, *record_cautions(rows, record, stated)]
    if unused := ", ".join(stated.damping.keys() - mode.damping.keys()):
        cautions.append(f"{unused} of the mode file is not simulated: the damping is that of the simulator")
    known, search = search_hypotheses(start, library)
    hypotheses = weighing.weigh_hypotheses(search.ranked())
    leading = hypotheses[0].hypothesis
    tests = tuple(directed_tests(leading.best))
    understated = readings.measure_scatter(known, leading.best, tests, library)
    in_rows = unexplained(leading.best, tests, library) or known.dispersion > 1.0
    of_levels = bool(size.describe_repeatability(known, leading.best))
    by_scatter = readings.stands_above(understated, leading.best)
    dispersion, rest = 1.0 if by_scatter else known.dispersion, of_levels or (in_rows and not by_scatter)
    enough = brief and (in_rows or of_levels)
    outside, imitations, doubts, beyond, in_library = weigh_library(search, hypotheses, tests, dispersion, rest, enough)
    cautions += describe_outside(outside, leading)
    if weighing.hides_state(leading.best):
        in_library = min(in_library, weighing.UNCONFIRMED)
        cautions.append("what is off in one sweep is off in the only one of its state: a second one there would tell")
    blended = weighing.blend_probabilities(hypotheses, in_library, beyond)
    weighed = weighing.order_by_probability(blended)
    results = (known, search, library, weighed, tests, doubts, in_library, in_rows or of_levels, in_rows, understated)
    return Explained(record, mode, *results, imitations, tuple(cautions), tuple(states), simulate, driven.unit)


@np.errstate(all="ignore")  # as for `explain`
def diagnose(
    record: Record,
    mode: Mode,
    effects: Mapping[str, Effect] | None = None,
    states: Sequence[State] = (),
    simulate: Simulate | None = None,
) -> Diagnosis:
    """Diagnose the gap between a simulation and a record; arguments and errors as of `explain`.

    Adds doubts, levels held out, places and trends to what `explain` finds.
    """
    explained = explain(record, mode, effects, states, simulate)
    known, hypotheses, leading = explained.setting, explained.hypotheses, explained.leading
    held_out = size.hold_levels_out(known, explained.search, leading.best)
    gap = size.measure_gap(leading.best)
    apart = size.describe_repeatability(known, leading.best)
    doubts = [
        *apart,
        *size.describe_scatter(known, leading.best),
        *readings.describe_far_readings(leading.best),
        *readings.describe_noise(known, leading.best, explained.understated),
        *list_ends(leading.best),
        *describe_gain(leading.best),
        *describe_shortfall(leading.best),
        *size.describe_held_out(leading, gap, held_out),
    ]
    local = local_estimates(known.problem.rows.where(known.problem.rows.state == 0.0), explained.mode)
    return Diagnosis(
        **(vars(explained) | {"cautions": (*explained.cautions, *doubts)}),
        explanations=weighing.cover_probability(hypotheses),
        groups=weighing.group_equivalent_effects(
            [explanation.hypothesis for explanation in hypotheses], explained.library
        ),
        levels=size.list_levels(leading.best),
        gap=gap,
        where=residual_cells(leading.best),
        footprint=footprint_cells(leading.best),
        held_out=held_out,
        local=local,
        damping_trend=trend_of(local, "damping"),
        frequency_trend=trend_of(local, "frequency"),
    )


def search_hypotheses(start: Setting, effects: Mapping[str, Effect]) -> tuple[Setting, Search]:
    """The finished search of a setting, and the setting with its noise (where not stated) and its dispersion.

    Where even the best explanation misses by more than noise, all are compared again with noise enlarged to its
    residuals. If no explanation is the whole truth, the one with the smallest residuals should lead, not one that
    happens to agree with a part of the rows.
    """
    known, search = _with_noise(start, effects)
    if not known.noise_known and len(known.problem.rows) < FEW_ROWS:
        return known, search  # the noise prior of so few rows is wide enough
    for _ in range(MOST_DISPERSIONS):
        r = search.ranked()[0].best.measured
        excess = spread(r)
        if excess < 1.0 + DISPERSED * 0.8 / np.sqrt(len(r)):
            break
        known = replace(known, dispersion=known.dispersion * excess)
        search = search.again(known.problem, known.unknowns, larger=excess**2)
    return known, search


def _with_noise(start: Setting, effects: Mapping[str, Effect]) -> tuple[Setting, Search]:
    """A search with the stated noise; else with noise from its leading explanation's residuals, iterated to stability.

    The first estimate is from the simulation alone, too large if that is wrong; the next from the best single effect.
    """
    if start.noise_known:
        return start, Search(start.problem, effects, start.unknowns).run()
    for _ in range(2):
        start = start.with_noise_of(Search(start.problem, {}, start.unknowns).run().ranked()[0].best)
    search, combined = Search(start.problem, effects, start.unknowns), False
    search.singles()
    for _ in range(MOST_NOISES):
        better = start.with_noise_of(search.ranked()[0].best)
        if not better.has_noise_of(start):
            several = [hypothesis for hypothesis in search.ranked() if len(hypothesis.effects) > 1][:MOST_CARRIED]
            start, search = better, Search(better.problem, effects, better.unknowns)
            search.singles()
            for hypothesis in several:
                search.adopt(hypothesis)
        elif combined:
            break
        search.combine()
        combined = True
    return start, search
