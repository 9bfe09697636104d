"""Parameters of a user's own simulation beyond their tolerances, alone or beside effects: rivals of an explanation."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from damping.effects.contract import Effect
from damping.errors import InputError
from damping.gap.hypotheses import Hypothesis, leaves_noise
from damping.gap.recentring import expand_about
from damping.gap.search import Search
from damping.gap.simulation import MOST_TOLERANCES, within_tolerance
from damping.gap.simulator import Simulator

#: Most widths tried of the prior of a freed parameter, and largest |ln| of its departure over that width: within a
#: factor of 1.5 of each other, by which ln evidence changes by less than 0.6.
_MOST_WIDTHS = 6
_ALIKE = 0.4
_MOST_CENTRES = 4  #: most expansions of the simulator about the fits with one width; each is repeated until it is exact


def free_parameters(search: Search, leading: Hypothesis) -> Iterator[tuple[str, float]]:
    """Each parameter of a simulator at any value, alone or else with effects of the leading explanation.

    In words, with the log odds against that explanation; a parameter counts as an effect. Only where its value is
    beyond its tolerance and the fit leaves no more than noise.
    """
    simulator = search.problem.simulation.simulator
    if simulator is None:
        return
    further = {name: search.effects[name] for name in leading.effects}
    for name, tolerance in simulator.tolerances.items():
        for effects in ({}, further)[: 1 + bool(further)]:
            by, freed = _free_parameter(search, simulator, name, effects)
            if freed is not None and leaves_noise(freed) and abs(by) > MOST_TOLERANCES * tolerance:
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

    The prior is about as wide as the two are apart, like that of a strength. None where the fits come to no rest.
    """
    problem = search.problem
    place = problem.simulation.names.index(name, -len(simulator.values))
    least = by = MOST_TOLERANCES * simulator.tolerances[name]
    for _ in range(_MOST_WIDTHS if by else 0):
        own = replace(problem.simulation, simulator=simulator.freed(name, by))
        freed = Search(replace(problem, simulation=own), effects, search.unknown, choices=search.choices)
        try:
            freed.run()
            for _ in range(_MOST_CENTRES):
                exact = expand_about(freed.leading.best)
                if exact is None:
                    break
                freed = freed.refit(replace(problem, simulation=exact), search.unknown)
            else:
                break
        except InputError:  # it need not answer there
            break
        fitted = float(within_tolerance(freed.leading.best.y[place])) * by
        if abs(np.log(abs(fitted) / by)) < _ALIKE:
            return fitted, freed.leading
        if abs(fitted) < by == least:
            break
        by = max(abs(fitted), least)
    return 0.0, None
