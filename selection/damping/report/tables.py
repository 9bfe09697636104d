"""The results of one record as tables, for the page and the CSV files.

Numbers are in the units of the record; intervals of parameters have the content :data:`INTERVAL`, those of predictions
the level of the study. A number that does not exist is NaN.
"""

import numpy as np
import pandas as pd

from damping import report as words
from damping.arrays import RAD_S_PER_HZ
from damping.extrapolation.curve import Curve
from damping.extrapolation.prediction import Loads
from damping.infer.law import Law
from damping.ranking import Candidate
from damping.ranking.candidates import INTERVAL
from damping.ranking.sharing import tabulate_rows
from damping.records.mode import Units
from damping.report import forms
from damping.report.results import RecordResult, posterior_draws, prior_draws

#: Attributes that are columns of the same name: of a posterior, of the convergence of a quantity, of a power law.
_CHAIN = ("converged", "failure", "steps", "acceptance", "log_z")
_CONVERGENCE = ("mean", "sd", "monte_carlo_error", "r_hat", "effective_size", "autocorrelation", "lengths")
_POWER_LAW = ("form", "p", "std_error", "degrees_of_freedom", "level", "p_low", "p_high")
_ENDS = ("low", "median", "high")
_TAILS = (50.0 * (1.0 - INTERVAL), 50.0, 50.0 * (1.0 + INTERVAL))


def record_tables(result: RecordResult) -> dict[str, pd.DataFrame]:
    """All tables of a record by name; those that would be empty are left out."""
    tables = {
        "ranking": forms.tabulate_candidates(result.ranking),
        "coefficients": tabulate_coefficients(result),
        "posteriors": tabulate_posteriors(result),
        "checks": tabulate_checks(result),
        "convergence": tabulate_convergence(result),
        "design_loads": tabulate_study_loads(result.design),
        "design_loads_by_model": forms.tabulate_loads_by_model(result.design) if result.design else pd.DataFrame(),
        "power_laws": tabulate_power_laws(result),
        "predictive_check": tabulate_predictive_check(result),
        "observations": tabulate_observations(result),
        "deviations": tabulate_deviations(result),
    }
    return {name: table for name, table in tables.items() if not table.empty}


def tabulate_coefficients(result: RecordResult) -> pd.DataFrame:
    """Posterior median, standard deviation and their ratio, and the interval, of each parameter of each candidate."""
    return pd.DataFrame(
        {
            "law": candidate.name,
            "parameter": c.parameter,
            "unit": words.format_parameter_unit(c.parameter, result.mode.units),
            "value": c.value,
            "std_error": c.std_error,
            "t_ratio": c.t_ratio,
            "credible_low": c.low,
            "credible_high": c.high,
        }
        for candidate in result.ranking.candidates
        for c in candidate.coefficients
    )


def tabulate_posteriors(result: RecordResult) -> pd.DataFrame:
    """Prior and posterior median and interval of each parameter; no posterior where the chain failed."""
    rows = []
    for sampled in result.posteriors:
        of_prior = prior_draws(sampled.posterior.coordinates)
        converged = sampled.posterior.converged
        for name, draws in posterior_draws(sampled).items():
            known = np.percentile(draws, _TAILS) if converged else np.full(3, np.nan)
            prior = np.percentile(of_prior[name], _TAILS)
            rows.append(
                {
                    "law": sampled.law.name,
                    "weight": sampled.weight,
                    "parameter": name,
                    "unit": words.format_parameter_unit(name, result.mode.units),
                    **{f"prior_{end}": value for end, value in zip(_ENDS, prior, strict=True)},
                    **dict(zip(_ENDS, known, strict=True)),
                    "converged": converged,
                }
            )
    return pd.DataFrame(rows)


def tabulate_checks(result: RecordResult) -> pd.DataFrame:
    """One row for each sampled law: the state of its run, PSIS-LOO with its caution, posterior predictive p-value."""
    return pd.DataFrame(
        {
            "law": sampled.law.name,
            "weight": sampled.weight,
            "of_source": sampled.of_source,
            **{name: getattr(sampled.posterior, name) for name in _CHAIN},
            "elpd_loo": sampled.leave_one_out.elpd,
            "elpd_standard_error": sampled.leave_one_out.standard_error,
            "p_loo": sampled.leave_one_out.p,
            "largest_pareto_k": float(np.max(sampled.leave_one_out.pareto_k)),
            "unit_left_out": sampled.leave_one_out.unit,
            "caution": sampled.leave_one_out.caution,
            "predictive_p_value": sampled.check.p_value,
        }
        for sampled in result.posteriors
    )


def tabulate_convergence(result: RecordResult) -> pd.DataFrame:
    """One row for each sampled law and reported quantity."""
    return pd.DataFrame(
        {"law": sampled.law.name, "quantity": d.name, **{name: getattr(d, name) for name in _CONVERGENCE}}
        for sampled in result.posteriors
        for d in sampled.posterior.diagnoses
    )


def tabulate_study_loads(loads: Loads | None) -> pd.DataFrame:
    """One row for each force, empty without loads; linear overprediction under its short names in files."""
    if loads is None:
        return pd.DataFrame()
    table = forms.tabulate_loads(loads)
    return table.set_axis([name.removeprefix("linear_").removesuffix("_percent") for name in table.columns], axis=1)


def tabulate_by_model(design: Loads, unit: str) -> pd.DataFrame:
    """One row for each model, one column for each force: median and predictive interval."""
    columns = {"model": [band.name for band in design.by_model]}
    for i, force in enumerate(design.force):
        columns[f"at {words.format_force_text(force, unit)}"] = [
            f"{words.number(band.median[i])} ({words.format_between(band.low[i], band.high[i])})"
            for band in design.by_model
        ]
    return pd.DataFrame(columns)


def tabulate_power_laws(result: RecordResult) -> pd.DataFrame:
    """One row for each form of power law: regression of ln F on ln A beside the posterior of the same exponent."""
    rows = []
    for law in result.power_laws:
        low, median, high = np.full(3, np.nan)  # of the power law alone, without a converged posterior
        for sampled in result.posteriors:
            if sampled.law == Law((law.form,)) and sampled.posterior.converged:
                low, median, high = np.percentile(posterior_draws(sampled)[f"{law.form} exponent"], _TAILS)
        rows.append(
            {
                **{name: getattr(law, name) for name in _POWER_LAW},
                "posterior_p": median,
                "posterior_p_low": low,
                "posterior_p_high": high,
                "factor": law.factor,
                "alpha": law.alpha,
                "std_error_alpha": law.std_error_alpha,
                **{f"alpha_{sweep}": a for sweep, a in zip(result.data.sweeps, law.alphas, strict=True)},
                "r_squared_centred": law.r_squared_centred,
            }
        )
    return pd.DataFrame(rows)


def tabulate_predictive_check(result: RecordResult) -> pd.DataFrame:
    """Predictive resonant amplitude of each tested sweep, per cent of the measured; laws whose chain converged."""
    parts = []
    for sampled in result.posteriors:
        if sampled.posterior.converged:
            part = forms.tabulate_tested(result.data)[["sweep", "force", "amplitude"]]
            part.insert(0, "law", sampled.law.name)
            parts.append(part.assign(median=sampled.check.median, low=sampled.check.low, high=sampled.check.high))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def tabulate_observations(result: RecordResult) -> pd.DataFrame:
    """The rows with information on damping, with their energy per cycle and the columns that a joint fit needs."""
    data, rows = result.data, tabulate_rows(result.data)
    rows.insert(1, "point", _label_points(result))
    rows.insert(3, "omega", data.omega)
    rows.insert(6, "energy", np.pi * data.A * data.D)
    return rows


def _label_points(result: RecordResult) -> list[str]:
    """A short label for each row: its sweep, and its number there where a sweep has several rows.

    A colon stands between them where a sweep is labelled by a number: row 11 of sweep 1 is not row 1 of sweep 11.
    """
    data = result.data
    number = pd.Series(data.sweep).groupby(data.sweep).cumcount() + 1
    if len(data.sweeps) == 1:
        return [str(n) for n in number]
    several = data.rows_per_sweep[data.sweep] > 1
    numbers = [str(n) if many else "" for n, many in zip(number, several, strict=True)]
    between = ":" if any(label[-1:].isdigit() for label in data.sweeps) else ""
    return [data.sweeps[s] + (between + n if n else "") for s, n in zip(data.sweep, numbers, strict=True)]


def tabulate_deviations(result: RecordResult) -> pd.DataFrame:
    """Energy per cycle of each row against each law as fitted; percent = 100 (E - fitted)/E."""
    observed = tabulate_observations(result)[["sweep", "point", "frequency", "amplitude", "energy"]]
    parts = []
    for candidate in result.ranking.candidates:
        if candidate.rank is None:  # it could not be fitted
            continue
        fitted = np.pi * result.data.A * candidate.fitted.force.quadrature(result.data.A, result.data.omega)
        deviation = observed["energy"] - fitted
        percent = 100.0 * deviation / observed["energy"].where(observed["energy"] != 0.0)
        columns = observed.assign(fitted=fitted, deviation=deviation, percent=percent)
        columns.insert(0, "law", candidate.name)
        parts.append(columns)
    return pd.concat(parts, ignore_index=True)


def describe_coefficients(candidate: Candidate, units: Units) -> str:
    """Posterior medians of every parameter of a law in one line, with units if known."""
    return "; ".join(
        f"{c.parameter} {words.format_quantity(c.value, words.format_parameter_unit(c.parameter, units))}"
        for c in candidate.coefficients
    )


def tabulate_design(design: Loads, curve: Curve | None, units: Units) -> pd.DataFrame:
    """Amplitude and damping at each design force, one row each, formatted for pages except ``times tested``.

    All lengths are in one unit, that of the largest median.
    """
    average = design.average
    factor, length = words.choose_length(units.length, average.median.max(initial=0.0, where=average.median > 0.0))
    table = pd.DataFrame(
        {
            "force": [words.format_force_text(force, units.force) for force in design.force],
            "times tested": design.ratio,
            "median": [words.format_quantity(value, length) for value in factor * average.median],
            "band": [
                words.format_between(*ends, length)
                for ends in zip(factor * average.low, factor * average.high, strict=True)
            ],
            "linear": [
                words.format_quantity(value, length) + (f" ({words.format_signed(over)})" if np.isfinite(over) else "")
                for value, over in zip(factor * design.linear, design.overprediction, strict=True)
            ],
        }
    )
    if curve is None:
        return table
    ratio, frequency = curve.damping_ratio, curve.frequency.median
    table["damping ratio"] = [words.format_percent_ratio(value) for value in ratio.median]
    table["low end"] = [words.format_percent_ratio(value) for value in ratio.low]
    table["frequency"] = [words.format_quantity(value, "Hz", 4) for value in frequency]
    motions = {"peak acceleration": design.average.median}
    if units.drive != "force":  # at phase resonance the motion relative to the base is in quadrature with the base's
        absolute = np.hypot(design.average.median, design.force / (RAD_S_PER_HZ * frequency) ** 2)
        motions = {
            "peak acceleration, absolute": absolute,
            "peak acceleration, relative to the base": design.average.median,
        }
    for name, amplitudes in motions.items():
        pairs = zip(amplitudes, frequency, strict=True)
        gravities = [words.format_gravity(amplitude, hertz, units.length) for amplitude, hertz in pairs]
        if any(text != words.NOTHING for text in gravities):
            table.insert(3, name, gravities)
    return table
