"""Tables hold the results, number by number, and what is computed here agrees with a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from damping.arrays import RAD_S_PER_HZ
from damping.extrapolation.backbone import Backbone
from damping.forces import CubicStiffness, Sum, Viscous
from damping.forces.powers import EXPONENT
from damping.infer.checks import inference_data
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN, Law
from damping.ranking.sharing import read_rows, tabulate_rows
from damping.records.mode import Units
from damping.records.resonance import tabulate_resonances
from damping.report import (
    count,
    format_between,
    format_force_text,
    format_gravity,
    format_joined,
    format_length,
    format_length_band,
    format_parameter_label,
    format_parameter_unit,
    format_percent,
    format_share,
    format_signed,
    number,
    start_sentence,
)
from damping.report.figures import draw_design_loads, leading, record_figures, trace_sweep
from damping.report.results import PRIOR_DRAWS, RecordResult, StudyResult, prior_draws
from damping.report.study import render
from damping.report.tables import record_tables, tabulate_design, tabulate_observations
from damping_pipelines.study_files import add_damping_ratio
from damping_reed1970 import LABELS

POUND = Units("lb", "in", "s")


@pytest.fixture(scope="module")
def tables(peaks: RecordResult) -> dict[str, pd.DataFrame]:
    return record_tables(peaks)


def test_all_tables_are_there(tables: dict[str, pd.DataFrame], sweep: RecordResult) -> None:
    loads = {"design_loads", "design_loads_by_model", "power_laws"}
    assert set(tables) == {
        *("ranking", "coefficients", "posteriors", "checks", "convergence", "predictive_check"),
        *("observations", "deviations"),
        *loads,
    }
    assert set(record_tables(sweep)) == set(tables) - loads


def test_ranking_is_the_ranking(peaks: RecordResult, tables: dict[str, pd.DataFrame]) -> None:
    table = tables["ranking"]
    for row, candidate in zip(table.itertuples(), peaks.ranking.candidates, strict=True):
        assert row.law == candidate.name
        assert row.cautions == "; ".join(candidate.cautions)
        assert pd.isna(row.rank) if candidate.rank is None else row.rank == candidate.rank
        for name in ("weight", "score", "held_out_error", "average_absolute_percent"):
            np.testing.assert_array_equal(getattr(row, name), getattr(candidate, name))
    assert table["law"].iloc[-1] == "coulomb"  # cannot be fitted, is listed with its reason
    assert table["cautions"].iloc[-1]


def test_coefficients_are_those_of_the_candidates(peaks: RecordResult, tables: dict[str, pd.DataFrame]) -> None:
    expected = [(c.name, x.value, x.t_ratio, x.low, x.high) for c in peaks.ranking.candidates for x in c.coefficients]
    columns = ["law", "value", "t_ratio", "credible_low", "credible_high"]
    assert list(tables["coefficients"][columns].itertuples(index=False, name=None)) == expected


def test_design_loads_are_the_predictions(peaks: RecordResult, tables: dict[str, pd.DataFrame]) -> None:
    design, table = peaks.design, tables["design_loads"]
    assert design is not None
    for name in ("median", "low", "high", "credible_low", "credible_high"):
        np.testing.assert_array_equal(table[name], getattr(design.average, name))
    for name in ("force", "linear", "overprediction", "overprediction_low", "overprediction_high"):
        np.testing.assert_array_equal(table[name], getattr(design, name))
    for name, values in design.parts.items():
        np.testing.assert_array_equal(table[f"sd_percent_{name}"], values)
    by_model = tables["design_loads_by_model"]
    for band in design.by_model:
        np.testing.assert_array_equal(by_model[by_model["law"] == band.name]["median"], band.median)


def test_convergence_and_checks_are_those_of_the_chains(peaks: RecordResult, tables: dict[str, pd.DataFrame]) -> None:
    expected = [(p.law.name, d.name, d.r_hat, d.lengths) for p in peaks.posteriors for d in p.posterior.diagnoses]
    columns = ["law", "quantity", "r_hat", "lengths"]
    assert list(tables["convergence"][columns].itertuples(index=False, name=None)) == expected
    assert list(tables["checks"]["converged"]) == [True, False]
    assert list(tables["checks"]["elpd_loo"]) == [p.leave_one_out.elpd for p in peaks.posteriors]


def test_predictive_check_leaves_failed_chains_out(peaks: RecordResult, tables: dict[str, pd.DataFrame]) -> None:
    table = tables["predictive_check"]
    assert set(table["law"]) == {peaks.posteriors[0].law.name}
    np.testing.assert_array_equal(table["median"], peaks.posteriors[0].check.median)


def test_deviations_of_viscous_damping_are_its_energy_formula(
    peaks: RecordResult, tables: dict[str, pd.DataFrame]
) -> None:
    """Energy of case I is pi C A^2 omega (Table 2.II), C of the best fit."""
    C = float(peaks.ranking.find(Law(("viscous",))).fit.coefficients[0])
    rows = tables["deviations"].query("law == 'viscous'")
    fitted = np.pi * C * peaks.data.A**2 * peaks.data.omega
    # two orders of the same products: rounding
    np.testing.assert_allclose(rows["fitted"], fitted, rtol=1e-13)
    measured = np.pi * peaks.data.A * peaks.data.D
    # a difference of nearly equal numbers, per cent: 1e-13 of 100
    np.testing.assert_allclose(rows["percent"], 100.0 * (measured - fitted) / measured, rtol=0.0, atol=1e-11)


def test_priors_have_their_closed_forms(peaks: RecordResult) -> None:
    """One force: coefficient F/(A omega) exp(N(0,1)); exponent uniform; scatter log-normal."""
    z = norm.ppf([0.05, 0.5, 0.95])
    viscous = next(c for c in peaks.ranking.candidates if c.name == "viscous")
    A, omega, force = peaks.data.reference
    drawn = prior_draws(viscous.coordinates)
    # standard error of a 5 % quantile of n normal draws: sqrt(.05 .95/n)/phi(1.645) = 2.1/sqrt(n); five of them
    tolerance = 5.0 * 2.1 / np.sqrt(PRIOR_DRAWS)
    quantiles = np.quantile(drawn["viscous"], [0.05, 0.5, 0.95])
    np.testing.assert_allclose(np.log(quantiles * A * omega / force), z, rtol=0.0, atol=tolerance)
    scatter = np.log(np.quantile(drawn["scatter"], [0.05, 0.5, 0.95]) / SCATTER_MEDIAN)
    np.testing.assert_allclose(scatter, SCATTER_LOG_SD * z, rtol=0.0, atol=SCATTER_LOG_SD * tolerance)
    power = next(c for c in peaks.ranking.candidates if c.name == "velocity-power")
    low, high = EXPONENT.prior.range
    exponent = np.quantile(prior_draws(power.coordinates)["velocity-power exponent"], [0.25, 0.75])
    # standard error of a quartile of a uniform: sqrt(3/16/n) of its range; five of them
    uniform = 5.0 * np.sqrt(3.0 / 16.0 / PRIOR_DRAWS) * (high - low)
    np.testing.assert_allclose(exponent, low + np.array([0.25, 0.75]) * (high - low), rtol=0.0, atol=uniform)


def test_power_law_row_is_the_fit(peaks: RecordResult, tables: dict[str, pd.DataFrame]) -> None:
    row = tables["power_laws"].iloc[0]
    # p of the first mode and its standard error, erratum E43-1: 1.6515 +- 0.0389, to the digits given
    np.testing.assert_allclose([row["p"], row["std_error"]], [1.6515, 0.0389], rtol=0.0, atol=5e-5)
    assert np.isnan(row["posterior_p"])  # the chain of the power law failed: nothing of it is used
    assert [row[f"alpha_{s}"] for s in "ABC"] == list(peaks.power_laws[0].alphas)


def test_figures_are_those_the_results_can_fill(peaks: RecordResult, sweep: RecordResult) -> None:
    common = {"damping_curve", "fitted", "ranking", "corner", "predictive_check"}
    assert set(record_figures(peaks, 0.9)) == common | {"design_loads"}
    assert set(record_figures(sweep, 0.9)) == common


def test_fitted_curve_of_a_hardening_mode_goes_through_its_rows(swept) -> None:
    """Rows made by the balance at a phase, of a cubic spring that bends the curve over: no curve of one stiffness."""
    force = np.array([0.2, 0.4, 0.8])
    record = swept(Sum((Viscous(0.05), CubicStiffness(1.0))), force, rows=61)
    peaks = tabulate_resonances(record)
    omega = RAD_S_PER_HZ * peaks["frequency"].to_numpy()
    bone = Backbone(peaks["amplitude"].to_numpy(), omega, np.full(3, 0.5), 0.0)
    for _, rows in record.table.groupby("sweep"):
        f, A = trace_sweep(Viscous(0.05), bone, 0.5, rows.sort_values("frequency"))
        # the backbone is learnt from three peaks: to 0.2 % of frequency; points of the curve lie 3 % of it apart
        apart = np.hypot(
            (rows["frequency"].to_numpy()[:, None] / f - 1.0) / 0.004,
            (rows["amplitude"].to_numpy()[:, None] / A - 1.0) / 0.06,
        )
        assert apart.min(axis=1).max() < 1.0


def test_fitted_curve_reaches_its_resonance_where_no_row_is() -> None:
    """Viscous damping: the largest amplitude is F/(c omega_n), at f_n, though the largest row lies beside it."""
    force, c, mass = 0.4, 0.5, 0.5
    f_n = 2.0 / RAD_S_PER_HZ
    bone = Backbone(np.array([0.1, 0.2, 0.4]), np.full(3, 2.0), np.full(3, mass), 0.0)
    for peak in (0.97, 1.03):  # damping of a quarter: the curve is flat there
        frequency = f_n * peak * np.array([0.9, 1.0, 1.1])
        rows = pd.DataFrame({"force": force, "frequency": frequency, "amplitude": [0.3, 0.4, 0.3]})
        f, A = trace_sweep(Viscous(c), bone, mass, rows)
        np.testing.assert_allclose(A.max(), force / (c * 2.0), rtol=1e-9, atol=0.0)
        # the backbone is known by bisection; a square root of that on either side of the top
        np.testing.assert_allclose(f[A.max() == A], f_n, rtol=1e-5, atol=0.0)


def test_a_response_held_at_one_amplitude_is_drawn_at_it() -> None:
    """The force that the balance asks for, smallest at resonance: a law that is exact goes through every row."""
    c, mass, f_n, held = 0.04, 1.0, 1.0, 2.0
    w_n = RAD_S_PER_HZ * f_n
    bone = Backbone(np.array([1.0, 2.0, 3.0]), np.full(3, w_n), np.full(3, mass), 0.0)
    f = np.linspace(0.9, 1.1, 41)
    w = RAD_S_PER_HZ * f
    force = held * np.hypot(mass * (w_n**2 - w**2), c * w)
    rows = pd.DataFrame({"frequency": f, "amplitude": held * (1.0 - 0.01 * np.abs(f - 0.9)), "force": force})
    drawn_f, drawn = trace_sweep(Viscous(c), bone, mass, rows)
    np.testing.assert_array_equal(drawn_f, f)
    # the balance is read off a grid in ln A by straight lines, 1 % apart: their error is a part of its square
    np.testing.assert_allclose(drawn, held, rtol=1e-4, atol=0.0)


def test_names_keep_their_letters_where_a_sentence_begins() -> None:
    assert start_sentence("three levels say little") == "Three levels say little"
    assert start_sentence("decay_0: the decay after 141 s is not used") == "decay_0: the decay after 141 s is not used"
    assert start_sentence("run.csv: a gap") == "run.csv: a gap"


def test_lengths_are_said_as_people_say_them() -> None:
    assert format_length(0.00219, "m") == "2.19 mm"
    assert format_length(3.1e-6, "m") == "3.10 µm"
    assert format_length(0.3, "m") == "0.300 m"
    assert format_length(0.002, "in") == "0.00200 in"
    assert format_length_band(0.0009, 0.011, "m") == "0.900 to 11.0 mm"
    # 1 mm at 50 Hz: (2 pi 50)^2 0.001/9.80665 = 10.064; 0.1 in at 10 Hz: (2 pi 10)^2 0.00254/9.80665 = 1.0225
    assert format_gravity(0.001, 50.0, "m") == "10.1 g"
    assert format_gravity(0.1, 10.0, "in") == "1.02 g"
    assert format_gravity(0.1, 10.0, "") == "–"
    assert format_gravity(0.1, 10.0, "N") == "–"


def test_lengths_of_a_table_are_in_one_unit(peaks: RecordResult) -> None:
    """8 and 24 mm in metres: a column that mixes mm and m hides a factor of a thousand."""
    design = peaks.design
    assert design is not None
    size = np.linspace(0.008, 0.024, len(design.force))
    band = replace(design.average, median=size, low=0.9 * size, high=1.1 * size)
    table = tabulate_design(replace(design, average=band, linear=2.0 * size), None, Units("N", "m", "s"))
    assert list(table["median"])[:: len(size) - 1] == ["0.00800 m", "0.0240 m"]
    assert table["band"][0] == "0.00720 to 0.00880 m"
    assert table["linear"][0].startswith("0.0160 m (")


def test_points_of_numbered_sweeps_are_told_apart(sweep: RecordResult) -> None:
    """Row 11 of sweep 1 and row 1 of sweep 11 are two points of a table with a column for each."""
    rows = tabulate_rows(sweep.data)
    numbered = read_rows(rows.assign(sweep=np.where(rows.index < 12, "1", "11")))
    points = list(tabulate_observations(replace(sweep, data=numbered))["point"])
    assert (points[0], points[10], points[12]) == ("1:1", "1:11", "11:1")
    assert len(set(points)) == len(points)


def test_peak_accelerations_under_a_base_are_told_apart(peaks: RecordResult) -> None:
    """At phase resonance q = -i A, driven by a base of a: |a - omega^2 q| = sqrt(a^2 + omega^4 A^2)."""
    design, curve, force_driven = peaks.design, peaks.design_curve, peaks.mode.units
    assert design is not None
    assert curve is not None
    assert "peak acceleration" in tabulate_design(design, curve, force_driven)
    table = tabulate_design(design, curve, force_driven.of_base_drive)
    assert "peak acceleration" not in table
    relative = (RAD_S_PER_HZ * curve.frequency.median) ** 2 * design.average.median
    both = np.abs(design.force - 1j * relative)
    for name, inches in (("relative to the base", relative), ("absolute", both)):
        assert list(table[f"peak acceleration, {name}"]) == [f"{number(a * 0.0254 / 9.80665)} g" for a in inches]


def test_a_record_without_posteriors_still_renders(study: StudyResult, peaks: RecordResult) -> None:
    nothing = dict.fromkeys(("bands", "design", "curve", "design_curve", "backbone"))
    bare = replace(peaks, posteriors=(), power_laws=(), **nothing)
    assert leading(bare) is None
    out = render(replace(study, records=(bare,), exhibits=()))
    assert set(out.figures) == {"config-2-mode-1-ranking", "config-2-mode-1-fitted"}
    assert "At the design load" not in out.html


@pytest.mark.parametrize("force", LABELS["units"])
def test_units_are_those_of_the_report(force: str) -> None:
    ours = format_parameter_unit(force, POUND).replace("²", "^2").replace("³", "^3").replace("·", " ")
    assert ours == LABELS["units"][force]


def test_other_units_and_labels() -> None:
    said = [
        format_parameter_unit(name, POUND) for name in ("displacement", "coulomb", "slip", "slip limit", "A^3*omega^2")
    ]
    # E = a A^3 omega^2 in lb in: a in lb s^2/in^2
    assert said == ["lb/in", "lb", "lb/in", "in", "lb·s²/in²"]
    assert format_parameter_unit("velocity-power exponent", POUND) == format_parameter_unit("scatter", POUND) == ""
    assert format_parameter_unit("viscous", Units()) == ""
    assert format_parameter_label("viscous", POUND) == "viscous (lb·s/in)"
    assert format_parameter_label("viscous", Units()) == "viscous"


def test_numbers_as_people_write_them() -> None:
    numbers = [2.9, 0.8654, 28.98, 1234.5, 1.25e6, -3.1e-7, 0.0, float("nan"), 0.0999999]
    written = ["2.90", "0.865", "29.0", "1234", "1.25×10⁶", "−3.10×10⁻⁷", "0", "–", "0.100"]
    assert [number(x) for x in numbers] == written
    small, smaller = "<\N{NO-BREAK SPACE}0.01", "<\N{NO-BREAK SPACE}0.001"
    assert [format_share(x) for x in (1.0, 0.23, 0.0049, 1e-9, 0.0)] == ["1.00", "0.23", "0.005", smaller, "0"]
    assert [format_percent(x) for x in (67.6, -9.96, 1.234, 1e-9, float("inf"))] == ["68", "−10", "1.2", small, "–"]
    assert [format_signed(x) for x in (67.6, -3.2, 0.0)] == ["+68 %", "−3.2 %", "0 %"]
    assert format_between(2.587, 3.2557, "in") == "2.59 to 3.26 in"
    assert format_joined(["a", "b", "c"]) == "a, b and c"
    assert format_joined(["a, b", "c", "d"]) == "a, b; c and d"
    assert [count(n, "sweep") for n in (1, 3)] == ["1 sweep", "3 sweeps"]


def test_sizes_far_from_one_in_words() -> None:
    assert [number(x) for x in (583127.0, 99999.9, 12345.0)] == ["583000", "100000", "12300"]
    assert [format_force_text(x, "N") for x in (8e-9, 1e7, 90.0)] == ["8×10⁻⁹ N", "1×10⁷ N", "90 N"]
    assert [format_length(x, "m") for x in (2.5e-9, 2.5e-6, 2.5e-3)] == ["2.50 nm", "2.50 µm", "2.50 mm"]


def test_posterior_files_hold_the_damping_ratio(peaks: RecordResult) -> None:
    law = peaks.posteriors[0]
    data = add_damping_ratio(inference_data(law.posterior, peaks.data), law.posterior, peaks.data, peaks.backbone)
    ratio = data.posterior["damping_ratio"]
    assert ratio.dims == ("chain", "draw", "sweep")
    assert ratio.attrs["law"] == law.law.name
    # the law fits three resonances: its ratio there is F/(2 M omega^2 A) of Table 4.II to the scatter, some per cent
    mass = peaks.record.column("mass")
    measured = peaks.data.tested_force / (2.0 * mass * peaks.data.tested_omega**2 * peaks.data.tested_amplitude)
    np.testing.assert_allclose(ratio.median(("chain", "draw")), measured, rtol=0.05)


def test_the_text_of_design_loads_leaves_no_gap_where_a_unit_or_a_prediction_is_missing(peaks: RecordResult) -> None:
    assert peaks.design is not None
    refused = replace(peaks.design.average, median=np.append(peaks.design.average.median[:-1], np.nan))
    design = replace(peaks.design, average=refused, linear=np.append(peaks.design.linear[:-1], np.nan))
    drawn = draw_design_loads("Mode", peaks.data, Units(), design, peaks.bands)
    assert drawn is not None
    assert not any(gap in drawn.description for gap in ("  ", " ;", " ,", " ."))
    drawn = draw_design_loads("Mode", peaks.data, POUND, peaks.design, peaks.bands)
    assert drawn is not None
    low, median = (number(values[0]) for values in (peaks.data.tested_force, peaks.design.average.median))
    assert f"Tested from {low} to " in drawn.description
    assert f"median {median} in (" in drawn.description
