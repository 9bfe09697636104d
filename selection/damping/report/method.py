"""How the numbers were made, what the rows of a record are, and every caution with the records it holds for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from damping.extrapolation.draws import AVERAGE_DRAWS
from damping.forces import CATALOGUE, component
from damping.infer.chains import Settings
from damping.infer.doubt import DOUBT_LOG_SD, DOUBT_MEDIAN, LENGTH, SLOPES
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN, TOTAL_LOG_SD
from damping.ranking import INTERVAL
from damping.report import count, format_quantity, number
from damping.report.page import Block, Callout, Heading, List, Table, Text
from damping.report.results import RecordResult, StudyResult, list_failed_chains, weighted
from damping.report.screens import find_largest


def build_method(study: StudyResult) -> list[Block]:
    """The method in words."""
    return [
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
        _build_laws(study),
        Heading("Priors"),
        List(_list_priors()),
        Heading("Ranking, sampling, prediction"),
        *(Text(text) for text in _list_steps(study)),
    ]


def _build_laws(study: StudyResult) -> Table:
    """Every force that takes part in a candidate, with its formula."""
    names = [name for r in study.records for c in r.ranking.candidates for name in c.law.components]
    parts = [component(name) for name in dict.fromkeys(names)]
    table = pd.DataFrame(
        {
            "force": [part.name for part in parts],
            "what it is": [part.example.label for part in parts],
            "formula": [part.example.formula for part in parts],
            "free beside the coefficient": [", ".join(shape.name for shape in part.free_shapes) for part in parts],
        }
    )
    return Table(table, "Forces of the candidate laws; q is the modal displacement, q' its velocity.")


def _list_priors() -> list[str]:
    shapes = dict.fromkeys(shape for name in CATALOGUE for shape in component(name).free_shapes)
    return [
        "Each parameter is a known function of a standard normal variable, so the prior of any law is a product of "
        "N(0, 1).",
        "Total damping force at the reference (geometric means of the tested resonances): the measured force there "
        f"times exp(N(0, {TOTAL_LOG_SD:g}²)).",
        "Share of each force in that total: uniform over all divisions, so coefficients are at least 0 and no force is "
        "favoured.",
        " ".join(f"{(shape.label or shape.name).capitalize()}: {shape.prior.text}." for shape in shapes if shape.prior),
        f"Relative scatter of a row, and of a level: log-normal, median {SCATTER_MEDIAN:g}, standard deviation "
        f"{SCATTER_LOG_SD:g} of its logarithm.",
    ]


def _list_steps(study: StudyResult) -> list[str]:
    run, content, level = Settings(), f"{100 * INTERVAL:g}", f"{100 * study.level:g}"
    return [
        "Weights: predictions average the laws by their probability on the rows near resonance, where those of the "
        "ranking rest on every row.",
        "Ranking: the score is −2 ln Z, Z the marginal likelihood by importance sampling with coefficients at least "
        "0. Weights are Z times a prior in which each further term is half as probable; a candidate "
        "whose least-squares coefficient is negative is a simpler law with a force that is not there, and gets "
        "none. AIC, AICc and BIC come from the relative residuals with the scatter as one more parameter, and do "
        "not exist where there are too few points.",
        "Held-out error: each level's resonant amplitude is predicted by the law fitted to the other levels only, "
        "because points within a sweep share its error.",
        f"Sampling: {run.ensembles * run.walkers} independent walkers of emcee, each choosing at every step among "
        f"{run.tries} draws of the proposal that the marginal likelihood was found with, run until every reported "
        f"quantity has R-hat at most {run.r_hat:g}, an effective size of at least {run.effective_size:g} and a "
        f"length of at least {run.lengths:g} autocorrelation times, or {run.budget:g} steps; a chain that does not "
        f"get there is reported as failed and used nowhere. Intervals of parameters hold {content} per cent.",
        "Prediction: each posterior draw is solved for its resonant amplitude at the frequency of the largest "
        "tested level (credible band). The predictive band adds, draw by draw and in ln A, the noise of a level and of "
        "a reading, and how far the slope d ln A/d ln F strays from the law's: an Ornstein-Uhlenbeck process in ln F "
        f"that forgets itself over {LENGTH:g}, its standard deviation in proportion to |d ln A/d ln F − 1|, log-normal "
        f"about {DOUBT_MEDIAN:g} of it with standard deviation {DOUBT_LOG_SD:g} of its logarithm, learnt from levels "
        "with the law's parameters; "
        f"slopes stay within {SLOPES[0]:.2g} and {SLOPES[1]:g}. Models are averaged "
        f"by {AVERAGE_DRAWS // 1000} 000 draws in proportion to the weights shown with them. Bands hold {level} per "
        "cent.",
        "Linear prediction: the viscous coefficient of the sweep with the largest tested force, so amplitude in "
        "proportion to force; its excess is 100 (linear/expected − 1), with the ends of the predictive band for its "
        "interval.",
    ]


def describe_record(result: RecordResult) -> str:
    """The record and its mode in sentences."""
    record, mode, units = result.record, result.mode, result.mode.units
    columns = record.table.columns
    energy = (
        "The energy per cycle is the record's own column."
        if "energy" in columns
        else "The energy per cycle is π F A sin φ from the recorded phases."
        if record.has_phase
        else "No phases were recorded: the largest amplitude of a sweep is taken as phase resonance, energy π F A."
    )
    left_out = len(record) - len(result.data.A)
    unused = f" {count(left_out, 'row')} away from resonance without phase or energy are not used." if left_out else ""
    mass_unit = f"{units.force}·{units.time}²/{units.length}" if units.force and units.time and units.length else ""
    tolerance = mode.tolerance
    return (
        f"{mode.name}: {count(len(record), 'point')} in {count(len(record.sweeps), 'sweep')} from "
        f"{Path(record.source).name}. {energy}{unused} The simulation assumes "
        f"{format_quantity(mode.frequency, 'Hz', 4)} "
        f"and a generalized mass of {format_quantity(mode.mass, mass_unit, 4)}, known to "
        f"{number(100 * tolerance.frequency, 2)} and {number(100 * tolerance.mass, 2)} per cent, and its viscous "
        f"damping to {number(100 * tolerance.viscous, 2)} per cent."
    )


#: Cautions of laws with less weight change nothing.
LEAST_WEIGHT = 0.01

STANDING = (
    "The weights compare the candidates listed and no others; a law that nobody proposed has no weight.",
    "An extrapolation holds while the same sources of damping act in the same proportion. A joint that begins to "
    "slip, or a crack, is in no band.",
    "Credible bands hold the uncertainty of the parameters and of the choice among the candidates; predictive bands "
    "add the scatter of one more test. Neither holds an error of mode shape, generalized mass or force calibration.",
    "Laws with the same power of amplitude cannot be told apart by steady tests of one mode, whose frequency hardly "
    "changes.",
)


def build_cautions(study: StudyResult) -> list[Block]:
    """Every caution, with the records it holds for."""
    said: dict[str, list[str]] = {}
    for result in study.records:
        for caution in dict.fromkeys(_of(result)):
            said.setdefault(caution, []).append(result.title)
    failed = [f"{result.title}: {failure}" for result in study.records for failure in list_failed_chains(result)]
    blocks: list[Block] = [Text("What no number on this page knows:"), List(STANDING)]
    if failed:
        blocks.append(Callout("Chains that failed; nothing here rests on them", failed))
    if said:
        blocks += [
            Heading("Of these records"),
            List([_describe_sentence(caution, titles) for caution, titles in said.items()]),
        ]
    return blocks


def _of(result: RecordResult) -> Iterator[str]:
    """Findings of the audit, cautions of the laws that carry weight, of their checks, and of the predictions."""
    yield from map(str, result.findings)
    for candidate in weighted(result):
        if candidate.weight > LEAST_WEIGHT:
            yield from candidate.cautions
    rough = [s for s in result.posteriors if s.leave_one_out.caution]
    if rough:
        yield f"PSIS-LOO is rough, by arviz's own warning, for {len(rough)} of {count(len(result.posteriors), 'law')}"
    i = find_largest(result.design)
    if result.design is not None:
        yield from result.design.cautions[len(result.design.cautions) - 1 if i is None else i]


def _describe_sentence(caution: str, titles: list[str]) -> str:
    return f"{caution[:1].upper()}{caution[1:]} ({'; '.join(titles)})."
