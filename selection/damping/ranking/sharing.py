"""Does one law hold on several records (modes, configurations)? Weighed from the rankings of each (report, 6.3).

With the weight w of a law on a record and its prior mass m, w/m is in proportion to its evidence there. One law L in
all records against a law of its own for each, coefficients free on every record either way, has the odds

    sum_L m_L prod_i (w_iL/m_iL)  /  prod_i sum_L m_L (w_iL/m_iL).

Laws that predict the same on a record share one prior mass and have its evidence in common.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from damping.errors import InputError
from damping.infer.law import Law
from damping.ranking import prior_masses

#: Laws of a record that predict the same, the one that was listed first, and their weight.
Groups = Sequence[tuple[tuple[str, ...], float]]


def weigh_sharing(records: Sequence[Groups]) -> tuple[float, pd.DataFrame]:
    """Odds of one law in all records against one each, and the probability of each law if it is one.

    Returns:
        The odds, NaN where a record has no law that is known; ``law, weight``, best first.
    """
    each = [_list_evidence(groups) for groups in records]
    laws = sorted({name for own in each for name in own})
    nothing = pd.DataFrame({"law": pd.Series(dtype=str), "weight": pd.Series(dtype=float)})
    if not all(each):
        return float("nan"), nothing
    prior = np.array(prior_masses([_parse(name) for name in laws]))
    evidence = np.array([[own.get(name, 0.0) for name in laws] for own in each])
    together = prior * np.prod(evidence, axis=0)
    if not together.sum() > 0.0:
        return 0.0, nothing
    table = pd.DataFrame({"law": laws, "weight": together / together.sum()})
    odds = float(together.sum() / np.prod(evidence @ prior))
    return odds, table.sort_values("weight", ascending=False, kind="stable", ignore_index=True)


def _list_evidence(groups: Groups) -> dict[str, float]:
    """Evidence of each law of a record, up to a factor common to all of them."""
    known = [(names, weight) for names, weight in groups if _is_known(names[0])]
    masses = prior_masses([_parse(names[0]) for names, _ in known])
    return {
        name: weight / mass
        for (names, weight), mass in zip(known, masses, strict=True)
        for name in names
        if _is_known(name)
    }


def _parse(name: str) -> Law:
    return Law(tuple(name.split(" + ")))


def _is_known(name: str) -> bool:
    """Whether a law of a file is one of the library."""
    try:
        _parse(name)
    except InputError:
        return False
    return True
