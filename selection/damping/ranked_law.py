"""A law of a ranking as an object: its results, and draws of its posterior."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError, check_whole
from damping.extrapolation import sample_candidate
from damping.infer.chains import Posterior
from damping.infer.checks import inference_data
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.progress import undisturbed
from damping.ranking import Candidate
from damping.ranking.candidates import INTERVAL
from damping.records.summary import Summarised
from damping.records.text import format_share

_CONTENT = f"{100.0 * INTERVAL:g} % interval"  #: the intervals of parameters, as titles name them


@dataclass(frozen=True, eq=False, repr=False)
class LawSample(Summarised):
    """Posterior draws of a law: ``posterior`` with its convergence diagnostics, and the fitted rows ``data``."""

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
        """The law, and the number of draws."""
        ensembles, kept = self.posterior.x.shape[:2]
        return f"{self.posterior.coordinates.law.name}: {ensembles} x {kept} draws, low to high the {_CONTENT}"

    @property
    def shown(self) -> pd.DataFrame:
        """One row for each parameter: ``median, low, high``, R-hat and effective size."""
        draws = self.draws
        low, median, high = np.percentile([values.ravel() for values in draws.values()], [5.0, 50.0, 95.0], axis=1)
        table = pd.DataFrame({"parameter": list(draws), "median": median, "low": low, "high": high})
        known = {diagnosis.name: (diagnosis.r_hat, diagnosis.effective_size) for diagnosis in self.posterior.diagnoses}
        table[["r_hat", "effective_size"]] = [known.get(name, (np.nan, np.nan)) for name in draws]
        return table

    @property
    def remarks(self) -> tuple[str, ...]:
        """Why the draws are unreliable; empty if they are reliable."""
        return tuple(filter(None, [self.posterior.failure]))


@dataclass(frozen=True, eq=False, repr=False)
class RankedLaw(Summarised):
    """A law of a ranking: its row ``candidate``, and the fitted rows ``data``."""

    candidate: Candidate
    data: Observations

    @property
    def law(self) -> Law:
        """The law."""
        return self.candidate.law

    @undisturbed
    def sample(self, seed: int = 1) -> LawSample:
        """Markov chains of the law's posterior, run until every parameter has converged.

        Raises:
            InputError: an invalid seed, or a law that could not be fitted.
        """
        check_whole(seed=seed)
        if self.candidate.evidence is None:
            raise InputError(f"{self.law.name} could not be fitted", expected="a law with a rank")
        return LawSample(sample_candidate(self.candidate, self.data, self.data.tested_force, seed), self.data)

    def to_arviz(self, seed: int = 1) -> Any:
        """Posterior draws of the law as an arviz ``InferenceData``."""
        return self.sample(seed).to_arviz()

    @property
    def title(self) -> str:
        """The law, its rank and its weight."""
        rank = "not fitted" if self.candidate.rank is None else f"rank {self.candidate.rank}"
        return f"{self.law.name}: {rank}, weight {format_share(self.candidate.weight)}, low to high the {_CONTENT}"

    @property
    def shown(self) -> pd.DataFrame:
        """One row for each coefficient and shape: ``median, low, high``."""
        rows = [(c.parameter, c.value, c.low, c.high) for c in self.candidate.coefficients]
        rows = rows or [(name, np.nan, np.nan, np.nan) for name in self.law.components]
        return pd.DataFrame(rows, columns=["parameter", "median", "low", "high"])

    @property
    def remarks(self) -> tuple[str, ...]:
        """Cautions on the fit."""
        return self.candidate.cautions
