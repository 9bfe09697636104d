"""Chapter V, which terms the data carry: the nine-term polynomial, losses that do not exist, a circular table."""

from __future__ import annotations

import pandas as pd

from selection.report.chapters.common import Figures, figure, folded, row, table
from selection.report.page import Block, Heading, Text
from selection.report.words import between, joined, number, percent
from selection.reproduction.circularity import ROUTES, Circularity
from selection.reproduction.false_terms import FARTHER, METHODS, FalseTerms
from selection.reproduction.nine_terms import NineTerms
from selection.reproduction.studies import Studies

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
