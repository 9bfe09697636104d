"""A law of a ranking as an object: its results, and draws of its posterior."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError, check_seed
from damping.extrapolation import sample_candidate
from damping.infer.chains import Posterior
from damping.infer.checks import inference_data
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.progress import single_threaded
from damping.ranking import INTERVAL, Candidate
from damping.records.text import format_share
from damping.result import Summarised

#: The intervals of parameters.
_CONTENT = f"{100.0 * INTERVAL:g} % interval"


@dataclass(frozen=True, eq=False, repr=False)
class LawSample(Summarised):
    """Posterior draws of a law: ``posterior`` with its diagnoses, and the rows ``data`` it was given."""

    posterior: Posterior
    data: Observations

    @property
    def draws(self) -> dict[str, FloatArray]:
        """Draws of each physical parameter, (ensembles, kept)."""
        return self.posterior.parameters()

    def to_arviz(self) -> Any:
        """The draws as an arviz ``InferenceData``; chains are the independent ensembles."""
        return inference_data(self.posterior, self.data)

    @property
    def title(self) -> str:
        """Of which law, and how many draws."""
        ensembles, kept = self.posterior.x.shape[:2]
        return f"{self.posterior.coordinates.law.name}: {ensembles} x {kept} draws, low to high the {_CONTENT}"

    @property
    def shown(self) -> pd.DataFrame:
        """One row for each parameter: ``median, low, high``, R-hat and effective size."""
        draws = self.draws
        low, median, high = np.percentile([own.ravel() for own in draws.values()], [5.0, 50.0, 95.0], axis=1)
        table = pd.DataFrame({"parameter": list(draws), "median": median, "low": low, "high": high})
        known = {diagnosis.name: (diagnosis.r_hat, diagnosis.effective_size) for diagnosis in self.posterior.diagnoses}
        table[["r_hat", "effective_size"]] = [known.get(name, (np.nan, np.nan)) for name in draws]
        return table

    @property
    def remarks(self) -> tuple[str, ...]:
        """Why the draws are not to be relied on, where they are not."""
        return tuple(filter(None, [self.posterior.failure]))


@dataclass(frozen=True, eq=False, repr=False)
class RankedLaw(Summarised):
    """A law of a ranking: its row ``candidate``, and the rows ``data`` it was fitted to."""

    candidate: Candidate
    data: Observations

    @property
    def law(self) -> Law:
        """The law itself."""
        return self.candidate.law

    @single_threaded
    def sample(self, seed: int = 1) -> LawSample:
        """Chains of the law's posterior, run until every parameter is known.

        Raises:
            InputError: a seed that is none, or a law that could not be fitted: there is nothing to sample.
        """
        check_seed(seed)
        if self.candidate.evidence is None:
            raise InputError(f"{self.law.name} could not be fitted", expected="a law with a rank")
        return LawSample(sample_candidate(self.candidate, self.data, self.data.tested_force, seed), self.data)

    def to_arviz(self, seed: int = 1) -> Any:
        """Its sample as an arviz ``InferenceData``."""
        return self.sample(seed).to_arviz()

    @property
    def title(self) -> str:
        """Which law, and what it is worth."""
        rank = "not fitted" if self.candidate.rank is None else f"rank {self.candidate.rank}"
        return f"{self.law.name}: {rank}, weight {format_share(self.candidate.weight)}, low to high the {_CONTENT}"

    @property
    def shown(self) -> pd.DataFrame:
        """One row for each coefficient and shape: ``median, low, high``."""
        rows = [(f"{c.force} {c.shape}".rstrip(), c.value, c.low, c.high) for c in self.candidate.coefficients]
        rows = rows or [(name, np.nan, np.nan, np.nan) for name in self.law.components]
        return pd.DataFrame(rows, columns=["parameter", "median", "low", "high"])

    @property
    def remarks(self) -> tuple[str, ...]:
        """Cautions."""
        return self.candidate.cautions
