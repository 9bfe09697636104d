"""One record: the ranking of every candidate, the fits, and the posteriors behind them."""

from __future__ import annotations

import pandas as pd

from damping.report import tables
from damping.report.figures import leading
from damping.report.page import Block, Callout, Fold, Heading, List, Section, Table, Text
from damping.report.results import RecordResult, Svgs, build_figure, describe_file_stem, list_failed_chains
from damping.report.words import count, format_joined, format_percent, format_share, number

#: A table of deviations has a column for each of so many points, not of more.
MOST_POINTS = 24


def record_section(result: RecordResult, svgs: Svgs) -> Section:
    """The section of a record."""
    blocks = [*_build_ranking(result, svgs), *_build_fits(result, svgs), *_build_posteriors(result, svgs)]
    return Section(f"record-{result.name}", result.title, blocks)


def _build_ranking(result: RecordResult, svgs: Svgs) -> list[Block]:
    table = tables.tabulate_ranking(result)
    candidates = result.ranking.candidates
    notes = list(dict.fromkeys(caution for candidate in candidates for caution in candidate.cautions))
    table["cautions"] = [format_joined(str(1 + notes.index(c)) for c in candidate.cautions) for candidate in candidates]
    table.insert(2, "coefficients", [_describe_coefficients(result, law) for law in table["law"]])
    headings = {
        "coefficients": "coefficients (T-ratio)",
        "score": "−2 ln Zπ",
        "held_out_error": "held-out error (%)",
        "average_absolute_percent": "mean |%|",
    }
    formats = {
        "weight": format_share,
        "held_out_error": format_percent,
        "average_absolute_percent": format_percent,
        "score": _describe_decimals,
    }
    caption = (
        f"Every distinct law, sorted by {result.ranking.criterion} (Z is the marginal likelihood, π the prior). "
        "Coefficients are posterior medians, T-ratios their ratio to the posterior's standard deviation; held-out "
        "error: root mean square per cent error of resonant amplitude, each level predicted from the others; mean |%|: "
        "as fitted. Equivalents predict the same on this record."
    )
    blocks: list[Block] = [
        Heading("Ranking"),
        *build_figure(
            svgs,
            describe_file_stem(result, "ranking"),
            "Weight of each distinct law: its posterior probability, before the test equal for each number of terms. "
            "Hatched: with a viscous part. Right: error of the resonant amplitude at the tested forces, fitted and "
            "with the level held out.",
        ),
        Table(
            table.drop(columns="score_standard_error"),
            caption,
            formats,
            headings,
            key=describe_file_stem(result, "ranking"),
        ),
        *([Text("Cautions, by the numbers in the table:"), List(notes, numbered=True)] if notes else []),
        Fold("All coefficients with standard errors and credible intervals", [_build_coefficient_table(result)]),
    ]
    return blocks


def _describe_decimals(value: float) -> str:
    return f"{value:.1f}".replace("-", "−") if value == value else "–"


def _describe_coefficients(result: RecordResult, law: str) -> str:
    """A law's coefficients in one cell: ``viscous 0.532 (7.0)``."""
    candidate = next(c for c in result.ranking.candidates if c.name == law)
    return "; ".join(
        f"{c.force} {c.shape}".strip() + f" {number(c.value)} ({number(c.t_ratio, 2)})" for c in candidate.coefficients
    )


def _build_coefficient_table(result: RecordResult) -> Table:
    content = f"{100 * tables.INTERVAL:g} %"
    headings = {"credible_low": f"{content} low", "credible_high": f"{content} high"}
    caption = (
        "Least-squares value, standard error and T-ratio of each parameter; the credible interval is of the posterior, "
        "where coefficients are at least 0."
    )
    formats = dict.fromkeys(("value", "std_error", "t_ratio", "credible_low", "credible_high"), number)
    return Table(
        tables.tabulate_coefficients(result), caption, formats, headings, key=describe_file_stem(result, "coefficients")
    )


def _build_fits(result: RecordResult, svgs: Svgs) -> list[Block]:
    one_sweep = len(result.data.sweeps) == 1
    what = (
        "Energy per cycle of each point against frequency, and the fitted energy at the measured amplitude."
        if one_sweep
        else "Damping force (force in quadrature) against amplitude, and the curves of the laws."
    )
    blocks: list[Block] = [
        Heading("Fits"),
        *build_figure(
            svgs, describe_file_stem(result, "fits"), f"{what} Below: what is left over, in per cent of the measured."
        ),
        *build_figure(
            svgs,
            describe_file_stem(result, "deviations"),
            "Per cent deviation of the energy per cycle, point by point. A run of one sign is a shape the law does "
            "not have.",
        ),
        *build_figure(
            svgs,
            describe_file_stem(result, "energy_surface"),
            "Energy per cycle by the leading law over amplitude and frequency; the points carry the measured "
            "energy, in its colour.",
        ),
        _build_deviations(result),
    ]
    return blocks


def _build_deviations(result: RecordResult) -> Table:
    """A row a law, a column a point; for many points the mean and the largest only."""
    deviations = tables.tabulate_deviations(result)
    by_law = deviations["percent"].abs().groupby(deviations["law"], sort=False)
    many = len(result.data.A) > MOST_POINTS
    table = pd.DataFrame({"mean |%|": by_law.mean(), "largest |%|": by_law.max()})
    if not many:
        points = list(dict.fromkeys(deviations["point"]))
        table = table.join(deviations.pivot_table(index="law", columns="point", values="percent")[points])
    caption = "Per cent deviation 100 (measured − fitted)/measured of the energy per cycle of every law."
    formats = dict.fromkeys(map(str, table.columns), format_percent)
    return Table(table.rename_axis("law").reset_index(), caption, formats, key=describe_file_stem(result, "deviations"))


def _build_posteriors(result: RecordResult, svgs: Svgs) -> list[Block]:
    best = leading(result)
    if not result.posteriors:
        return []
    failed = list_failed_chains(result)
    blocks: list[Block] = [Heading("Posteriors")]
    if failed:
        blocks.append(Callout(f"{count(len(failed), 'chain')} failed and not used in any average", failed))
    if best is not None:
        content = f"{100 * tables.INTERVAL:g} per cent"
        blocks += build_figure(
            svgs,
            describe_file_stem(result, "corner"),
            f"Posterior of the leading law, {best.law.name}: each parameter with its prior density, median and "
            f"{content} interval (dashed); contours hold 50 and 90 per cent of the draws.",
        )
        blocks += build_figure(
            svgs,
            describe_file_stem(result, "prior_posterior"),
            "Prior and posterior densities of the same law over the whole width of the prior. Where they agree, the "
            "tests say nothing.",
        )
    blocks += build_figure(
        svgs,
        describe_file_stem(result, "priors"),
        "Prior (grey) and posterior (coloured) 90 per cent intervals of every parameter of every sampled law.",
    )
    blocks += build_figure(
        svgs,
        describe_file_stem(result, "predictive_check"),
        "Predictive intervals of the tested resonant amplitudes; 100 is what was measured.",
    )
    blocks.append(_build_checks(result))
    blocks += build_figure(
        svgs,
        describe_file_stem(result, "convergence"),
        "Convergence of every reported quantity. Dashed: the limit; τ is the autocorrelation time.",
    )
    return [
        *blocks,
        Fold("Posterior and convergence, number by number", [_build_intervals(result), _build_convergence(result)]),
    ]


def _build_checks(result: RecordResult) -> Table:
    table = tables.tabulate_checks(result)
    table["chain"] = ["converged" if ok else "FAILED" for ok in table["converged"]]
    columns = ["law", "weight", "chain", "steps", "elpd_loo", "elpd_standard_error", "p_loo", "largest_pareto_k"]
    columns += ["predictive_p_value", "caution"]
    headings = {"elpd_loo": "PSIS-LOO", "elpd_standard_error": "its error", "largest_pareto_k": "largest k"}
    headings |= {"predictive_p_value": "predictive p"}
    unit = format_joined(dict.fromkeys(table["unit_left_out"]))
    caption = (
        f"Sampled laws. PSIS-LOO: expected log predictive density, a {unit} left out at a time, with its standard "
        "error and effective number of parameters; k above 0.7 makes it rough. Predictive p: share of replicated "
        "data sets that fit worse than the measured one; near 0 the law does not describe its data."
    )
    formats = {"weight": format_share} | dict.fromkeys(columns[4:9], _describe_two)
    return Table(table[columns], caption, formats, headings, key=describe_file_stem(result, "checks"))


def _describe_two(value: float) -> str:
    return f"{value:.2f}".replace("-", "−") if value == value else "–"


def _build_intervals(result: RecordResult) -> Table:
    content = f"{100 * tables.INTERVAL:g} %"
    caption = f"Prior and posterior median and {content} interval of each parameter; a dash where the chain failed."
    table = tables.tabulate_posteriors(result)
    numbers = [column for column in table.columns if pd.api.types.is_float_dtype(table[column])]
    return Table(
        table,
        caption,
        dict.fromkeys(numbers, number) | {"weight": format_share},
        key=describe_file_stem(result, "posteriors"),
    )


def _build_convergence(result: RecordResult) -> Table:
    formats = {"r_hat": lambda value: f"{value:.4f}"} | dict.fromkeys(
        ("effective_size", "lengths"), lambda v: f"{v:.0f}"
    )
    headings = {"r_hat": "R-hat", "lengths": "length / τ", "autocorrelation": "τ (steps)"}
    caption = (
        "Convergence: mean, standard deviation and Monte Carlo error of each reported quantity, and what it rests on."
    )
    table = tables.tabulate_convergence(result)
    return Table(table, caption, formats, headings, key=describe_file_stem(result, "convergence"))
