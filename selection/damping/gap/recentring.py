"""The search with a user's own simulation, expanded about the fitted parameters until the expansion is exact there."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from damping.effects.contract import Effect
from damping.errors import InputError
from damping.gap.fit import ModelFit, fit_model
from damping.gap.model import Model
from damping.gap.problem import Setting
from damping.gap.search import Search, search_hypotheses
from damping.gap.simulation import Simulation, within_tolerance
from damping.progress import nothing

#: Largest change of the residuals at a fit, as a root sum of squares, by an expansion about it: parameters that miss by
#: as much are a fifth of their standard error off.
_EXACT = 0.2
_MOST_MOVES = 8  #: most moves of the expansion in turn; each leaves about a tenth of the last


def search_about_fit(
    setting: Setting, effects: Mapping[str, Effect], done: Callable[[str], None] = nothing
) -> tuple[Setting, Search, tuple[str, ...]]:
    """`search_hypotheses`, repeated with the simulator expanded about the leading fit; cautions where it is not exact.

    Without a simulator, or where its expansion about the nominal values is exact at the leading fit, it is one search.
    """
    known, search = search_hypotheses(setting, effects, done)
    try:
        simulation = expand_about(search.leading.best)
        if simulation is None:
            return known, search, ()
        problem = replace(setting.problem, simulation=simulation)
        known, search = search_hypotheses(replace(setting, problem=problem), effects, done)
        for _ in range(_MOST_MOVES):
            moved = _move(search.leading.best)
            if moved is None:
                return known, search, ()
            about = replace(known, problem=replace(known.problem, simulation=moved.problem.simulation))
            again = search.refit(about.problem, about.unknowns)
            if not again.hypotheses:
                break
            known, search = about, again
    except InputError as error:
        return known, search, (_describe_extrapolation(f"it fails about them ({error})"),)
    return known, search, (_describe_extrapolation("fits about them did not come to rest"),)


def _describe_extrapolation(why: str) -> str:
    """A caution on parameters at which the simulation was not evaluated."""
    what = "the corrected parameters of the simulator were extrapolated from its answers near the stated values"
    return f"{what}, since {why}: run it with the corrected ones before they are trusted"


def expand_about(fit: ModelFit) -> Simulation | None:
    """The simulation with the simulator expanded about a fit, repeated there; None if that changes nothing.

    InputError: as of `damping.gap.simulator.Simulator.answer`.
    """
    expanded = None
    for _ in range(_MOST_MOVES):
        model = _move(fit)
        if model is None:
            break
        expanded = model.problem.simulation
        again = fit_model(model, fit.y[np.newaxis, : model.size], fit.y[np.newaxis, model.size :])
        if not again:
            break
        fit = again[0]
    return expanded


def _move(fit: ModelFit) -> Model | None:
    """The model of a fit with the simulator expanded about it; None where the present expansion is exact there.

    InputError: as of `damping.gap.simulator.Simulator.answer`.
    """
    model, simulation = fit.model, fit.model.problem.simulation
    simulator = simulation.simulator
    if simulator is None:
        return None
    x = fit.y[: len(simulation.names)]
    at = dict(zip(simulation.names, within_tolerance(x) * simulation.tolerance, strict=True))
    about = simulator.about({name: float(at[name]) for name in simulator.values})
    problem = replace(model.problem, simulation=replace(simulation, simulator=about))
    moved = replace(model, problem=problem)
    before, after = (of_model.residuals(fit.y[np.newaxis]).r[0] for of_model in (model, moved))
    change = (after - before)[model.problem.rows.measured]
    return None if float(np.linalg.norm(change)) < _EXACT else moved
