"""How the numbers were made, with the constants that made them."""

from __future__ import annotations

import numpy as np
import pandas as pd

from selection.arrays import FloatArray
from selection.compare.ranking import INTERVAL
from selection.loads.discrepancy import KAPPA_LOG_SD, KAPPA_MEDIAN
from selection.loads.prediction import AVERAGE_DRAWS
from selection.posterior.law import (
    EXPONENT_RANGE,
    LIMIT_RANGE,
    SCATTER_LOG_SD,
    SCATTER_MEDIAN,
    TOTAL_LOG_SD,
    Component,
    component,
)
from selection.posterior.sampling import Settings
from selection.report.page import Block, Heading, List, Section, Table, Text
from selection.report.results import StudyResult


def method(study: StudyResult) -> Section:
    """The section."""
    blocks: list[Block] = [
        Heading("What is compared"),
        Text(
            "At a steady state the damping force in phase with velocity, C(A, ω), balances the applied force in "
            "quadrature, D = E/(π A) = F sin φ. Each candidate law is a sum of forces g(q, q̇); C is its "
            "first-harmonic average over a cycle of amplitude A and frequency ω, so that its energy per cycle is π "
            "A C and its resonant amplitude under a force F solves C(A, ω) = F."
        ),
        Text(
            "Likelihood: the residual of a row is n = (D − C)/√(g² + R²) with g = dC/d ln A and R = F cos φ, the "
            "relative error of amplitude at resonance and the error of phase far from it. It is normal with the "
            "row's relative scatter, the record's own uncertainties added in quadrature; where sweeps have several "
            "rows, a scatter common to a sweep is added, so that rows of one sweep share it."
        ),
        _laws(study),
        Heading("Priors"),
        List(_priors()),
        Heading("Ranking, sampling, prediction"),
        *(Text(text) for text in _steps(study)),
    ]
    return Section("method", "Method", blocks)


def _laws(study: StudyResult) -> Table:
    """Every force that takes part in a candidate, with its formula."""
    names = [name for r in study.records for c in r.ranking.candidates for name in c.law.components]
    parts = [component(name) for name in dict.fromkeys(names)]
    units = [part.unit(_shapes(part)) for part in parts]
    table = pd.DataFrame(
        {
            "force": [part.name for part in parts],
            "what it is": [unit.label for unit in units],
            "formula": [unit.formula for unit in units],
            "free beside the coefficient": [", ".join(part.shapes) for part in parts],
        }
    )
    return Table(table, "Forces of the candidate laws; q is the modal displacement, q' its velocity.")


def _shapes(part: Component) -> dict[str, FloatArray]:
    return dict.fromkeys(part.shapes, np.ones(()))


def _priors() -> list[str]:
    low, high = EXPONENT_RANGE
    return [
        "Each parameter is a known function of a standard normal variable, so the prior of any law is a product of "
        "N(0, 1).",
        "Total damping force at the reference (geometric means of the tested resonances): the measured force there "
        f"times exp(N(0, {TOTAL_LOG_SD:g}²)).",
        "Share of each force in that total: uniform over all divisions, so coefficients are at least 0 and no force is "
        "favoured.",
        f"Exponent of velocity: uniform from {low:g} to {high:g}. Slip limit: log-uniform from {LIMIT_RANGE[0]:g} "
        f"times the smallest to {LIMIT_RANGE[1]:g} times the largest tested amplitude.",
        f"Relative scatter of a row, and of a level: log-normal, median {SCATTER_MEDIAN:g}, standard deviation "
        f"{SCATTER_LOG_SD:g} of its logarithm.",
    ]


def _steps(study: StudyResult) -> list[str]:
    run, content, level = Settings(), f"{100 * INTERVAL:g}", f"{100 * study.level:g}"
    return [
        "Ranking: the score is −2 ln Z, Z the marginal likelihood by importance sampling with coefficients at least "
        "0. Weights are Z over the sum of Z, all candidates being equally probable before the test; a candidate "
        "whose least-squares coefficient is negative is a simpler law with a force that is not there, and gets "
        "none. AIC, AICc and BIC come from the relative residuals with the scatter as one more parameter, and do "
        "not exist where there are too few points.",
        "Held-out error: each level's resonant amplitude is predicted by the law fitted to the other levels only, "
        "because points within a sweep share its error.",
        f"Sampling: {run.ensembles} independent emcee ensembles of {run.walkers} walkers run until every reported "
        f"quantity has R-hat at most {run.r_hat:g}, an effective size of at least {run.effective_size:g} and a "
        f"length of at least {run.lengths:g} autocorrelation times, or {run.budget:g} steps; a chain that does not "
        f"get there is reported as failed and used nowhere. Intervals of parameters hold {content} per cent.",
        "Prediction: each posterior draw is solved for its resonant amplitude at the frequency of the largest "
        "tested level (credible band). The predictive band adds, draw by draw and in ln A, the scatter from level "
        "to level, the noise of a reading, and what the law errs beyond its data: normal, with standard deviation κ "
        f"|ln(F/F_nearest)| from the nearest tested force, κ log-normal about {KAPPA_MEDIAN:g} with standard "
        f"deviation {KAPPA_LOG_SD:g} of its logarithm, updated where levels could be held out. Models are averaged "
        f"by {AVERAGE_DRAWS // 1000} 000 draws in proportion to the weights shown with them. Bands hold {level} per "
        "cent.",
        "Linear prediction: the viscous coefficient of the sweep with the largest tested force, so amplitude in "
        "proportion to force; its excess is 100 (linear/expected − 1), with the ends of the predictive band for its "
        "interval.",
    ]
