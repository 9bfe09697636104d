"""The diagnosis of one record: every question in turn, one result."""

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
from damping.gap.problem import (
    Setting,
    State,
    exclude_effects,
    list_unread,
    record_cautions,
    refuse_rows,
    setting,
)
from damping.gap.search import Search
from damping.gap.simulation import Simulate
from damping.gap.states import as_given, drive_by_forces, list_repeated, refuse_copies
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
from damping.records.mode import Mode
from damping.records.record import Record

#: Standard errors of the spread (0.8/sqrt(n)) above noise from which all are compared with more noise; most times.
DISPERSED = 4.0
MOST_DISPERSIONS = 3
#: With fewer rows, noise that is not stated is not made larger by what the best explanation leaves.
FEW_ROWS = 40
#: Times that noise which is not stated is taken from what the leading explanation leaves, at most.
MOST_NOISES = 3
#: Explanations by several effects, the most probable with one noise, that are fitted with the next one too.
MOST_CARRIED = 8


@dataclass(frozen=True)
class Explained:
    """What effects can explain of a gap, before anything is said of it.

    Attributes:
        record, mode: what is compared, as driven by forces, in a ``unit`` of mass. setting: how noise and
            repeatability were taken. search: finished.
        library: effects that were tried. hypotheses: all that were fitted, with probabilities, most probable first.
        tests: directed tests of what the leading hypothesis leaves. doubts: see `weighing.describe_doubts`.
        in_library: chance that the library holds the cause at all. unexplained: more than noise is left;
            ``unexplained_rows``: in the rows, and not only in how the levels scatter. understated: how the rows scatter
            where the noise is stated too small and that is all that is left; there the chance is that of causes beside.
        imitations: explanations by causes without a name that the record does not tell from the leading one.
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
        """The simulation corrected by the leading hypothesis, as it stands beside these records."""
        corrected = corrected_mode(self.leading.best)
        return as_given(corrected, self.unit, self.setting.problem.simulation.shaken)


@dataclass(frozen=True)
class Diagnosis(Explained):
    """Everything that is said of a gap.

    Attributes:
        explanations: the shortest list of the most probable hypotheses that reaches ``COVER``.
        groups: effects that cannot be told apart.
        levels: deviations of the sweeps that were taken as repeatability. gap, where, footprint, held_out: see the
            modules of those names. local: estimates by amplitude, with the trends of damping and frequency (None where
            they cannot be seen).
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
        """Candidate tests, the one that tells the explanations apart best first; none where none is needed."""
        command = name_command([(self.record, self.mode), *self.states], self.simulate)
        columns = self.record.frame.columns
        return rank_tests(
            self.explanations, self.hypotheses, self.in_library, command, self.unit, columns, self.imitations
        )

    @property
    def next_test(self) -> NextTest | None:
        """The first of the candidate tests where it is expected to settle the case; else None."""
        return next((test for test in self.next_tests[:1] if test.probability >= weighing.COVER), None)


@np.errstate(all="ignore")  # a search passes through impossible models, which what it gives says
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
        brief: whether it is enough to know that more than noise is left and that the chance of a cause in the library
            is below ``KNOWN``, where both are so: causes that have no name only lessen it, and are then not weighed.

    Raises:
        AnalysisError: model and record are of different modes, there are too many rows, or resonances alone and a
            simulation without damping.
        InputError: a record is given twice.
    """
    given = [(record, mode), *states]
    refuse_copies(given)
    driven = drive_by_forces(given, simulated=simulate is not None)
    (record, mode), *states = driven.states
    refuse_rows(driven.states)
    stated = mode
    if simulate is not None:  # the simulated damping is its own; the viscous part alone stands for it
        own = {name: table for name, table in mode.damping.items() if name == Viscous.name}
        mode = replace(mode, damping=own)
    start = setting(record, mode, states, simulate, driven.shaken, driven.groups)
    rows = start.problem.rows
    if rows.at_resonance and not mode.damping and simulate is None:
        message = "no damping is simulated, and so no resonance that these rows, all of them at resonance, part from"
        raise AnalysisError(f"{mode.source}: {message}: simulate some in [damping]; damping rank tells which law fits")
    if start.problem.simulation.simulator is not None:
        start.problem.simulation.simulator.require_sense(record)
    library = exclude_effects(CATALOGUE if effects is None else effects, mode, rows)
    cautions = [*driven.notes, *list_repeated(given), *list_unread(given), *record_cautions(rows, record, stated)]
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
    dispersion, left = 1.0 if by_scatter else known.dispersion, of_levels or (in_rows and not by_scatter)
    enough = brief and (in_rows or of_levels)
    outside, imitations, doubts, beyond, in_library = weigh_library(search, hypotheses, tests, dispersion, left, enough)
    cautions += describe_outside(outside, leading)
    if weighing.hides_state(leading.best):
        in_library = min(in_library, weighing.UNCONFIRMED)
        cautions.append("what is off in one sweep is off in the only one of its state: a second one there would tell")
    blended = weighing.blend_probabilities(hypotheses, in_library, beyond)
    weighed = weighing.order_by_probability(blended)
    found = (known, search, library, weighed, tests, doubts, in_library, in_rows or of_levels, in_rows, understated)
    return Explained(record, mode, *found, imitations, tuple(cautions), tuple(states), simulate, driven.unit)


@np.errstate(all="ignore")  # as above
def diagnose(
    record: Record,
    mode: Mode,
    effects: Mapping[str, Effect] | None = None,
    states: Sequence[State] = (),
    simulate: Simulate | None = None,
) -> Diagnosis:
    """Diagnose the gap between a simulation and a record; arguments and errors as of `explain`.

    Beside what effects explain: doubts, levels held out, places, trends.
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
    local = local_estimates(known.problem.rows.where(known.problem.rows.state == 0.0), mode)
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

    Where even the best explanation misses by more than noise, all are compared once more with noise as large as what it
    leaves: among explanations of which none is the whole truth the one that leaves least is sought, not the one that
    happens to agree with a part of the rows.
    """
    known, search = _with_noise(start, effects)
    if not known.noise_known and len(known.problem.rows) < FEW_ROWS:
        return known, search  # what so few rows leave open of the noise is wide enough
    for _ in range(MOST_DISPERSIONS):
        r = search.ranked()[0].best.measured
        rest = spread(r)
        if rest < 1.0 + DISPERSED * 0.8 / np.sqrt(len(r)):
            break
        known = replace(known, dispersion=known.dispersion * rest)
        search = search.again(known.problem, known.unknowns, larger=rest**2)
    return known, search


def _with_noise(start: Setting, effects: Mapping[str, Effect]) -> tuple[Setting, Search]:
    """A search with the noise as stated; else with that of what its own leading explanation leaves, until it stands.

    It begins with the noise that the simulation alone leaves, too large of a wrong one, then of the best single effect.
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
