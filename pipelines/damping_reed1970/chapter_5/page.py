"""Chapter V in the report: energy as a polynomial (5.1), the check-out run and the regressions (5.3)."""

from __future__ import annotations

import pandas as pd

from damping.report.page import Block, Heading, Table, Text
from damping.report.words import between, count, joined, number, percent
from damping_reed1970.chapter_5.circularity import ROUTES, Circularity
from damping_reed1970.chapter_5.false_terms import FARTHER, METHODS, FalseTerms
from damping_reed1970.chapter_5.figures import chapter_5_figures
from damping_reed1970.chapter_5.nine_terms import NineTerms
from damping_reed1970.chapter_5.regressions import EnergySurface
from damping_reed1970.common import (
    Figures,
    ReportPart,
    agreement_text,
    figure,
    folded,
    known_table,
    of_chapter,
    part,
    row,
    table,
)
from damping_reed1970.studies import ReportResults, Studies

#: A coefficient comes out where it is this close to the print, relative.
CLOSE = 0.005


def chapter_5(results: ReportResults) -> ReportPart:
    """The part: energy surface, regressions from three kinds of inputs, and which terms the data carry."""
    found, tables, every = results.studies, results.tables, results.studies.tables()
    drawn = chapter_5_figures(found.surface, found.nine, found.false, found.circular)
    figures = {one.name: one for one in drawn}
    blocks: list[Block] = [
        Text(
            "Chapter V writes the energy loss per cycle as a polynomial in amplitude and frequency, each term the "
            "energy of a damping force (Table 5.I), fits it to fifteen points of Configuration I by least squares, "
            "and drops the terms of least T-ratio."
        ),
        Text(agreement_text(of_chapter(tables["reproduction"], 5))),
        Heading("5.1: the energy surface"),
        Text(_surface(results.studies.surface)),
        figure(figures, "configuration-1-energy", 5),
        Heading("5.3: regressions from printed, corrected and recovered inputs"),
        Text(_coefficients(tables["regressions"])),
        Text(_check_out(tables["regressions"])),
        Table(
            regression_rows(tables["regressions"]), _REGRESSIONS, headings={"T-ratio": "its T-ratio"}, key="regressions"
        ),
        *known_table("regressions", tables["regressions"]),
        *known_table("regression_deviations", tables["regression_deviations"]),
        *term_blocks(results.studies, figures),
    ]
    own = {name: every[name] for name in TERM_TABLES}
    return part(5, "Chapter V: energy as a polynomial", blocks, own)


_REGRESSIONS = (
    "Coefficients of the energy polynomials: as printed, and by least squares from each kind of input; T-ratio of the "
    "last."
)


def regression_rows(regressions: pd.DataFrame) -> pd.DataFrame:
    """A row a fit and term: printed coefficient beside those from printed, corrected and recovered inputs.

    The check-out data have no recovered inputs but the law that made them.
    """
    rows = []
    for (fit, equation, term), found in regressions.groupby(["fit", "equation", "term"], sort=False):
        values, last = found.set_index("inputs")["coefficient"], found.iloc[-1]
        rows.append(
            {
                "fit": fit,
                "equation": equation,
                "term": term,
                "printed": last["printed"],
                "from printed inputs": values["printed"],
                "from corrected": values["corrected"],
                "from recovered or made": last["coefficient"],
                "T-ratio": last["t_ratio"],
            }
        )
    return pd.DataFrame(rows)


def _surface(surface: EnergySurface) -> str:
    """What a fit with nine terms does between its points."""
    largest = surface.points["energy_in_lb"].max()
    return (
        "The data of Fig. 5.1 are not printed; its counterpart is the energy of Configuration I. All nine terms of "
        f"Eq. 5.3.6 fit the {len(surface.points)} points to {number(surface.rms_errors[1], 2)} in-lb root mean square, "
        f"and give energies below 0 on {percent(100.0 * surface.negative_share)} per cent of the surface, down to "
        f"{number(surface.lowest)} in-lb where the largest measured one is {number(largest)}. The best law with all "
        f"coefficients above 0, {joined(surface.law)}, fits to {number(surface.rms_errors[0], 2)} in-lb and is "
        "positive everywhere. A fit “with zero error” is no evidence for its terms."
    )


def _coefficients(regressions: pd.DataFrame) -> str:
    """How many of the printed coefficients come out of which inputs."""
    fits = regressions[regressions["fit"].isin(["E1", "E2", "E3", "E4"]) & regressions["printed"].notna()]
    close = (fits["coefficient"] / fits["printed"] - 1.0).abs() <= CLOSE
    inputs = {name: close[fits["inputs"] == name] for name in ("printed", "corrected", "recovered")}
    said = joined(f"{int(one.sum())} from the {name} inputs" for name, one in inputs.items())
    viscous, squared = (
        row(fits, fit="E3", inputs="recovered", force=force) for force in ("viscous", "velocity-squared")
    )
    return (
        f"Of the {len(inputs['printed'])} coefficients printed for E₁ to E₄, {said} come out within "
        f"{100.0 * CLOSE:g} per cent. The recovered inputs are what the report's own columns of fitted energy and per "
        "cent deviation were computed from: its tables are not quite what it regressed (errata E5III-1, E5III-2, "
        "E5IV-1, E5IV-2). Of the two forces that the report adopts (5.3.16) the viscous one has a T-ratio of "
        f"{number(viscous['t_ratio'], 2)}, velocity-squared one of {number(squared['t_ratio'], 2)}."
    )


def _check_out(regressions: pd.DataFrame) -> str:
    """The check-out run with two and with five terms."""
    fits = ("check-out, two terms", "check-out, five terms")
    two, five = (regressions[(regressions["fit"] == fit) & (regressions["inputs"] == "corrected")] for fit in fits)
    made = regressions[(regressions["fit"] == fits[0]) & (regressions["inputs"] == "generator")]
    errors = [float(one["average_absolute_percent"].iloc[0]) for one in (two, five)]
    ratios = five["t_ratio"].abs()
    return (
        f"The check-out run (Table 5.II, {count(int(two['points'].iloc[0]), 'point')} made from a law of two terms) is "
        f"to show that the program finds the law. From the corrected table two terms give {_values(two)}, from the "
        f"generator's own energies {_values(made)}, against {_printed(two)} printed. The report says that the error "
        "with five terms is more than twice as large; least squares with more terms cannot fit worse: the average "
        f"deviation is {number(errors[0])} per cent with two terms and {number(errors[1])} with five. With five, "
        f"T-ratios of {between(ratios.min(), ratios.max(), digits=2)} leave hardly a digit of the printed coefficients "
        "determined (erratum E5II-3)."
    )


def _values(rows: pd.DataFrame) -> str:
    return joined(number(value, 4) for value in rows["coefficient"])


def _printed(rows: pd.DataFrame) -> str:
    return joined(number(value, 4) for value in rows["printed"])


TERM_TABLES = (
    "nine_terms",
    "nine_terms_summary",
    "nine_terms_elimination",
    "nine_terms_best",
    "nine_terms_by_size",
    "false_terms",
    "false_terms_frequency",
    "false_terms_inflation",
    "circular_laws",
    "circular_claims",
)
#: Noise, per cent, at which sentences speak of the simulations.
NOISE = 3.0
SUBSETS = 511


def term_blocks(studies: Studies, figures: Figures) -> list[Block]:
    """The three studies of selection."""
    return [*_nine(studies.nine, figures), *_false(studies.false, figures), *_circular(studies.circular, figures)]


def _nine(nine: NineTerms, figures: Figures) -> list[Block]:
    s = nine.summary
    return [
        Heading("5.3.6: nine terms"),
        Text(
            f"All nine terms at once fit every version of the data to R² ≥ {s['r_squared'].min():.4f}, and mean "
            f"nothing: scaled condition numbers are {_span(s['condition_number'])}, "
            f"{_span(s['negative_coefficients'], 1)} of the nine coefficients are negative, and single terms are "
            f"{_span(s['largest_term_over_energy'], 2)} times the largest energy and cancel. With coefficients held at "
            f"0 or above, {_span(s['nonnegative_terms'], 1)} terms are left at R² ≥ "
            f"{s['nonnegative_r_squared'].min():.3f}; of the {SUBSETS} subsets {_span(s['subsets_all_positive'], 2)} "
            "have every coefficient above 0."
        ),
        figure(figures, "nine-terms", 5),
        table(5, "nine_terms_summary", s, "The nine-term polynomial on each version of the data."),
        folded(
            "Coefficients, elimination and best subsets of the nine terms",
            table(5, "nine_terms", nine.full, "All nine terms, free and held at 0 or above."),
            table(5, "nine_terms_elimination", nine.elimination, "Terms dropped one after the other by least |T|."),
            table(5, "nine_terms_best", nine.best, "Best subsets by BIC, free and with all coefficients above 0."),
            table(5, "nine_terms_by_size", nine.by_size, "Least error of each number of terms."),
        ),
    ]


def _span(values: pd.Series, digits: int = 2) -> str:
    """``4 to 5``; one number where all are equal."""
    low, high = values.min(), values.max()
    return number(low, digits) if low == high else between(low, high, digits=digits)


def _false(false: FalseTerms, figures: Figures) -> list[Block]:
    chosen = false.selection[false.selection["noise_percent"] == NOISE]
    backward, best, physical = (row(chosen, terms="nine terms (5.3.6)", method=method) for method in METHODS)
    clean = row(
        false.selection,
        terms="nine terms (5.3.6)",
        method=METHODS[0],
        noise_percent=min(false.selection["noise_percent"]),
    )
    inflation = false.inflation.set_index("terms")["over_true_terms"]
    return [
        Heading("“A danger exists in including energy losses which do not exist”"),
        Text(
            f"How large a danger: {false.replicates} sets of data of a known law of two terms are sent through "
            f"selection. With {NOISE:g} per cent noise of the energy, backward elimination among nine terms keeps at "
            f"least one term that is not there in {percent(100 * backward['share_false'])} per cent of the runs, the "
            f"best subset by BIC in {percent(100 * best['share_false'])}, the best subset with coefficients above 0 in "
            f"{percent(100 * physical['share_false'])}. What matters more is the energy at {FARTHER:g} times the "
            f"largest amplitude: wrong by {number(backward['energy_error_percent'], 2)}, "
            f"{number(best['energy_error_percent'], 2)} and {number(physical['energy_error_percent'], 2)} per cent "
            f"root mean square. Even with {clean['noise_percent']:g} per cent noise backward elimination keeps a false "
            f"term in {percent(100 * clean['share_false'])} per cent of the runs. Nine terms instead of the true two "
            f"multiply the standard deviation of the viscous coefficient by {number(inflation.iloc[-1], 2)}."
        ),
        figure(figures, "false-terms", 5),
        folded(
            "The simulation in numbers",
            table(
                5,
                "false_terms",
                false.selection,
                "Shares of runs, error of the energy at twice the amplitude, and Monte Carlo error of a share.",
            ),
            table(
                5,
                "false_terms_inflation",
                false.inflation,
                "Standard deviation of the viscous coefficient, for noise of 1 per cent of the mean energy.",
            ),
        ),
    ]


def _circular(circular: Circularity, figures: Figures) -> list[Block]:
    return [
        Heading("The circle of Table 5.IV"),
        Text(_circle(circular)),
        figure(figures, "circularity", 5),
        table(
            5,
            "circular_claims",
            _measured(circular),
            "The measured data by each route: the law selected, whether A³ω² alone fits better than A²ω alone, and the "
            "coefficients of viscous and velocity-squared damping fitted together.",
        ),
        folded(
            "Known structures sent through every route",
            table(5, "circular_claims", circular.claims, "Shares of runs in which the report's conclusions are drawn."),
            table(5, "circular_laws", circular.laws, "Laws selected: best by BIC with coefficients above 0."),
        ),
    ]


def _circle(circular: Circularity) -> str:
    """What the energies of Table 5.IV are, and what selection makes of structures that are known."""
    claims = circular.claims[circular.claims["noise_percent"] == NOISE]
    fitted = [row(claims, truth="linear, planes as fitted", route=route)["nonlinear_share"] for route in ROUTES[:2]]
    laws = _measured(circular)
    said = joined(f"{law} ({route})" for route, law in laws[["route", "law"]].to_numpy())
    return (
        "The amplitudes and energies of Table 5.IV are not measured but computed from the xi fitted point by point: "
        f"within {percent(100.0 * circular.identity)} per cent every row of Table 3.IV obeys E = 2π M ω_p ξ ω A². "
        "Regressing E on A then returns what was assumed of ξ. So structures that are known were sent the same way. "
        f"One that is linear, with the planes that fit the test and {NOISE:g} per cent noise, comes out as nonlinear "
        f"in {percent(100 * fitted[0])} per cent of {circular.replicates} runs by that route and in "
        f"{percent(100 * fitted[1])} per cent by the energy put in. Asked of the measured data, the routes select "
        f"{said}: the force depends on the route, and one sweep does not determine it."
    )


def _measured(circular: Circularity) -> pd.DataFrame:
    """The measured data by route."""
    laws = circular.laws[circular.laws["truth"] == "measured"].set_index("route")["law"]
    claims = circular.claims[circular.claims["truth"] == "measured"]
    return pd.DataFrame(
        {
            "route": claims["route"],
            "law": [laws[route] for route in claims["route"]],
            "A³ω² before A²ω": claims["cubed_share"] > 0.5,
            "C₁": claims["C_1"],
            "C₃": claims["C_3"],
        }
    )
