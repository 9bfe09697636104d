"""Parameters of a user's own simulation beyond their tolerances, alone or beside effects: rivals of an explanation."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from damping.effects.contract import Effect
from damping.errors import DampingError
from damping.gap.hypotheses import Hypothesis, leaves_noise
from damping.gap.recentring import expand_about
from damping.gap.search import Search
from damping.gap.simulation import MOST_TOLERANCES, within_tolerance
from damping.gap.simulator import Simulator

#: Least departure of a parameter that stands for an effect, in tolerances: near ``MOST_TOLERANCES`` the search, which
#: bends values there, may prefer the effect.
_INSTEAD = 2.0
#: Most widths tried of the prior of a freed parameter, and largest |ln| of its departure over that width: within a
#: factor of 1.5 of each other, by which ln evidence changes by less than 0.6.
_MOST_WIDTHS = 6
_ALIKE = 0.4
_MOST_CENTRES = 4  #: most expansions of the simulator about the fits with one width; each is repeated until it is exact


def free_parameters(search: Search, leading: Hypothesis) -> Iterator[tuple[str, float]]:
    """Each parameter of a simulator at any value, alone or else with effects of the leading explanation.

    In words, with the log odds against that explanation; a parameter counts as an effect. Only where its value is
    beyond its tolerance, or nearly so in the place of an effect, and the fit leaves no more than noise.
    """
    simulator = search.problem.simulation.simulator
    if simulator is None:
        return
    further = {name: search.effects[name] for name in leading.effects}
    for name, tolerance in simulator.tolerances.items():
        for effects in ({}, further)[: 1 + bool(further)]:
            by, freed = _free_parameter(search, simulator, name, effects)
            if freed is None or not leaves_noise(freed):
                continue
            if abs(by) > (_INSTEAD if freed.key < leading.key else MOST_TOLERANCES) * tolerance:
                value = f"{simulator.values[name] * np.exp(by):.4g} ({np.expm1(by):+.1%})"
                beside = f" beside {' and '.join(freed.effects)}" if freed.effects else ""
                # the first effect of an explanation has no price: alone, the parameter is that
                log_p = freed.log_posterior - np.log(search.choices + 1.0) if beside else freed.log_evidence
                yield f"a {name} of {value} in the simulator{beside}", float(log_p - leading.log_posterior)
                break


def _free_parameter(
    search: Search, simulator: Simulator, name: str, effects: Mapping[str, Effect]
) -> tuple[float, Hypothesis | None]:
    """ln of a parameter over its stated value, fitted freely with any of ``effects``; and that fit.

    The prior is about as wide as the two are apart, like that of a strength. Fits begin on either side of the stated
    value, where the resonances are in another order. None where they come to no rest.
    """
    place = search.problem.simulation.names.index(name, -len(simulator.values))
    least = by = MOST_TOLERANCES * simulator.tolerances[name]
    for _ in range(_MOST_WIDTHS if by else 0):
        wider = simulator.freed(name, by)
        sides = [wider.about({**wider.centre, name: side}) for side in (-by, by)]
        fits = [fit for fit in (_fit_about(search, side, effects) for side in sides) if fit is not None]
        if not fits:
            break
        best = max(fits, key=lambda fit: fit.log_posterior)
        fitted = float(within_tolerance(best.best.y[place])) * by
        if abs(np.log(abs(fitted) / by)) < _ALIKE:
            return fitted, best
        if abs(fitted) < by == least:
            break
        by = max(abs(fitted), least)
    return 0.0, None


def _fit_about(search: Search, simulator: Simulator, effects: Mapping[str, Effect]) -> Hypothesis | None:
    """The best fit with any of ``effects``, from the simulator expanded about its centre until it is exact at the fit.

    None where that comes to no rest, or the simulator does not answer.
    """
    problem = search.problem
    own = replace(problem.simulation, simulator=simulator)
    freed = Search(replace(problem, simulation=own), effects, search.unknown, choices=search.choices)
    try:
        freed.run()
        for _ in range(_MOST_CENTRES):
            exact = expand_about(freed.leading.best)
            if exact is None:
                return freed.leading
            freed = freed.refit(replace(problem, simulation=exact), search.unknown)
            if not freed.hypotheses:
                return None
    except DampingError:  # it need not answer there, nor have a steady state
        pass
    return None
