"""How large, where, and how far it shrinks on levels that did not choose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damping.effects import CATALOGUE
from damping.gap.fit import ModelFit
from damping.gap.model import Model, Scatter
from damping.gap.problem import setting
from damping.gap.scatter import describe_repeatability
from damping.gap.search import search_hypotheses
from damping.gap.size import hold_levels_out, measure_gap, nominal_residuals, shrinkage, whitened
from damping.gap.where import footprint_cells, local_estimates, residual_cells, trend
from damping.records.record import Record
from tests.gap.limited import KINDS


@pytest.fixture(scope="module")
def honest(lab):
    """The finished search of a record of the simulation itself, with noise."""
    rows = lab.bench().rows
    return search_hypotheses(setting(lab.record(rows, lab.linear(rows), 2), lab.mode()), CATALOGUE)


def test_whitening_is_the_symmetric_root():
    rng = np.random.default_rng(3)
    r, C = rng.normal(size=12), rng.normal(size=(12, 4)) * [0.1, 1.0, 10.0, 0.0]
    values, vectors = np.linalg.eigh(np.eye(12) + C @ C.T)
    expected = vectors @ ((vectors.T @ r) / np.sqrt(values))
    np.testing.assert_allclose(whitened(r, C), expected, rtol=0.0, atol=1e-12)  # rounding of two decompositions


def test_whitened_residuals_of_scatter_and_noise_are_those_of_noise_alone():
    rng = np.random.default_rng(4)
    C = np.repeat(np.eye(3), 20, axis=0) * 5.0  # a gain of 5 sigma in each of three sweeps
    r = np.array([whitened(rng.normal(size=60) + C @ rng.normal(size=3), C) for _ in range(200)])
    # 12000 values: variance 1 within three of its standard errors, 0.013
    np.testing.assert_allclose(np.mean(r**2), 1.0, rtol=0.0, atol=0.04)


def describe_deviations(known, scatter, y):
    """What is said of the fit of a simulation whose sweeps deviate as ``y``, the last of its values, says."""
    model, nothing = Model(known.problem, (), scatter), np.zeros(0)
    full = np.zeros(model.size + 2 * model.sweeps)
    full[model.size :] = y
    return describe_repeatability(known, ModelFit(model, full, nothing, nothing, nothing, 0.0, 0.0, nothing))


@pytest.mark.parametrize(("gains", "told"), [((1.0, 1.2), "are all above the fit"), ((-0.4, 1.2), "scatter by")])
def test_levels_that_all_lie_to_one_side_are_not_said_to_scatter(lab, gains, told):
    """Gains of the largest repeatability tried: of 5.1 to 6.2 % it was said that they scatter by 5 %."""
    rows = lab.bench().rows
    known = setting(lab.record(rows, lab.linear(rows), 2), lab.mode(None, None))
    said = describe_deviations(known, Scatter(0.05, 0.0), [*np.linspace(*gains, 3), 0.0, 0.0, 0.0])
    assert [told in sentence for sentence in said] == [True]


@pytest.mark.parametrize(
    ("gains", "told"),
    [
        ((-1.0, -0.5, 0.1, 0.2, 1.2), "rise from level to level with the force, as chance does in one of 60 "),
        ((1.2, 0.2, 0.1, -0.5, -1.0), "fall from level to level with the force, as chance does in one of 60 "),
        ((-1.0, 0.1, -0.5, 0.2, 1.2), ""),
        ((-1.0, 0.2, 0.3, 1.2), ""),  # one record in 12
    ],
)
def test_scatter_in_the_order_of_the_force_is_told(lab, gains, told):
    """Of n! orders two rise or fall throughout: a force cell that reads more at large force hid in repeatability."""
    rows = lab.bench(len(gains), 8).rows
    known = setting(lab.record(rows, lab.linear(rows), 2), lab.mode(None, None))
    (said,) = describe_deviations(known, Scatter(0.05, 0.0), [*gains, *[0.0] * len(gains)])
    assert "scatter by" in said
    assert told in said
    assert ("with the force" in said) == bool(told)


@pytest.mark.parametrize(("spread", "alike"), [(0.1, True), (1.5, False)])
def test_a_state_that_deviates_as_a_whole_is_told_as_one(lab, spread, alike):
    """Frequencies of three sweeps 4 repeatabilities off, the others none: one caution, not one a sweep."""
    rows = lab.bench().rows
    heavy = replace(lab.mode(0.0, 1e-4), mass=12.0, frequency=lab.mode().frequency / np.sqrt(1.2))
    other = lab.record(replace(rows, omega=rows.omega / np.sqrt(1.2)), lab.linear(rows), 3)
    known = setting(lab.record(rows, lab.linear(rows), 2), lab.mode(0.0, 1e-4), states=[(other, heavy)])
    deviations = [*[0.0] * 9, *(4.0 + spread * np.array([0.0, 1.0, 2.0]))]
    said = describe_deviations(known, Scatter(0.0, 1e-4), deviations)
    named = [sentence.partition(" deviates: its frequency by +")[0] for sentence in said]
    assert named == (["every sweep of state 2"] if alike else ["sweep 2: A", "sweep 2: B", "sweep 2: C"])


def test_shrinkage_is_the_share_of_the_gap_that_is_explained():
    assert shrinkage(3.0, 1.0, 100) == 1.0
    assert shrinkage(3.0, 0.9, 100) == 1.0  # never above
    np.testing.assert_allclose(shrinkage(3.0, 2.0, 100), 1.0 - 3.0 / 8.0, rtol=1e-14, atol=0.0)  # rounding
    assert shrinkage(2.0, 3.0, 100) < 0.0  # worse than before
    # the mean square of n values has the standard error sqrt(2/n): 0.141 for 100, so that 1.28 is the limit
    assert shrinkage(np.sqrt(1.28), 1.0, 100) is None
    assert shrinkage(np.sqrt(1.29), 1.0, 100) == 1.0
    assert shrinkage(0.8, 1.0, 100) is None


def test_a_gap_before_and_after(lab):
    d = lab.diagnosed("velocity-squared")
    values = 2 * len(d.record)
    assert d.gap.nominal > d.gap.before > 2.0  # the refit takes a part
    # noise alone: sqrt(2/n)/2 = 0.065 is the standard error of a root mean square of 120 values; three of them
    np.testing.assert_allclose(d.gap.after, 1.0, rtol=0.0, atol=3 * 0.5 * np.sqrt(2.0 / values))
    assert d.gap.shrinkage == shrinkage(d.gap.before, d.gap.after, values)


def test_a_refit_is_no_worse_than_the_simulation_as_given(lab):
    """Readings of 0.7 where gains repeat to 0.3 %: deviations of 76 sigma, which a step of a fit is a fiftieth of."""
    rows, share = lab.bench().rows, 0.3  # of the noise of a row
    record = lab.record(rows, lab.linear(rows, gain=0.7))
    fit = search_hypotheses(setting(record, lab.mode(0.01 * share, 1e-4)), {})[1].ranked()[0].best
    nominal = float(np.sqrt(np.mean(nominal_residuals(fit) ** 2)))
    # 20 amplitudes of each sweep, off by one factor, and as many phases that are exact; ln 0.7 is no small change
    closed = np.log(0.7) / 0.01 * np.sqrt(0.5 / (1.0 + 20 * share**2))
    np.testing.assert_allclose(nominal, abs(closed), rtol=1e-3)
    gap = measure_gap(fit)
    assert 1.0 < gap.before == gap.after < nominal


def test_no_gap_has_no_shrinkage(honest):
    leading = honest[1].ranked()[0]
    assert leading.effects == ()
    found = measure_gap(leading.best)
    assert found.shrinkage is None
    np.testing.assert_allclose([found.before, found.after], 1.0, rtol=0.0, atol=0.2)  # three standard errors, as above
    assert footprint_cells(leading.best) == ()
    assert max(abs(cell.z) for cell in residual_cells(leading.best)) < 6.0  # chi-square of 5 in one of 24 cells
    setting_, search = honest
    assert hold_levels_out(setting_, search, leading.best).shrinkage is None


def test_where_shares_and_z(lab):
    d = lab.diagnosed("velocity-squared")
    np.testing.assert_allclose(sum(cell.share for cell in d.where), 1.0, rtol=0.0, atol=1e-12)  # rounding
    assert [cell.share for cell in d.where] == sorted((cell.share for cell in d.where), reverse=True)
    hertz, sweep = d.record.column("frequency"), d.record.table["sweep"].to_numpy()
    inside = [(sweep == c.sweep) & (hertz >= c.frequency_low) & (hertz <= c.frequency_high) for c in d.where]
    n = np.array([np.sum(rows) for rows in inside])
    for quantity in ("amplitude", "phase"):
        each = sum(rows for rows, cell in zip(inside, d.where, strict=True) if cell.quantity == quantity)
        np.testing.assert_array_equal(each, 1)  # every row is in one cell of each quantity
    squares = n + np.sqrt(2.0 * n) * [cell.z for cell in d.where]  # z = (sum of squares - n)/sqrt(2 n)
    shares = [cell.share for cell in d.where]
    np.testing.assert_allclose(squares / squares.sum(), shares, rtol=0.0, atol=1e-12)  # rounding
    np.testing.assert_allclose(squares.sum() / n.sum(), d.gap.nominal**2, rtol=1e-12, atol=0.0)  # rounding


def test_a_force_that_grows_with_amplitude_shows_where_amplitudes_are_large(lab):
    d = lab.diagnosed("velocity-squared")
    first = d.where[0]
    assert first.sweep == "C"  # the highest level
    assert first.frequency_low < d.mode.frequency < first.frequency_high
    assert d.footprint[0].sweep == "C"
    assert all(cell.size > 1.0 for cell in d.footprint)
    assert d.damping_trend.power in (0.5, 1.0, 1.5)  # zeta grows as A, told from its neighbours without noise only
    assert d.damping_trend.gain > 100.0  # ln p; the damping of three levels differs by tens of its standard errors
    assert d.frequency_trend.gain < 12.0  # chi-square 12 of the best of eight powers: once in 250 records


def test_local_damping_without_noise(lab):
    rows = setting(lab.record(lab.bench().rows, lab.truth("velocity-squared")), lab.mode()).problem.rows
    found = local_estimates(rows, lab.mode())
    A, zeta, sd = (np.array([getattr(one, name) for one in found]) for name in ("amplitude", "damping", "damping_sd"))
    assert trend(A, zeta, sd).power == 1.0
    # 0.6 of the viscous loss at A_top, in proportion to A; a band has one amplitude for what its rows average: 2 %
    np.testing.assert_allclose(zeta, lab.xi * (1.0 + 0.6 * A / lab.A), rtol=0.02, atol=0.0)


def test_the_local_frequency_is_that_without_an_added_mass(lab):
    """K - (M + m) omega^2 in closed form: of a linear mode it is the natural frequency at every row."""
    rows, added = lab.bench().rows, 0.2 * lab.mass
    omega = rows.omega / np.sqrt(1.2)
    Y = lab.mass * lab.omega**2 - (lab.mass + added) * omega**2 + 1j * lab.viscous * omega
    record = lab.record(replace(rows, omega=omega), lab.cells(rows.force / np.abs(Y), np.angle(Y)))
    heavy = Record(record.table.assign(added_mass=added))
    found = local_estimates(setting(heavy, lab.mode()).problem.rows, lab.mode())
    frequency, ratio = np.array([(one.frequency, one.damping) for one in found]).T
    np.testing.assert_allclose(frequency, lab.omega / (2.0 * np.pi), rtol=1e-12, atol=0.0)  # rounding
    np.testing.assert_allclose(ratio, lab.xi, rtol=1e-12, atol=0.0)


def test_held_out_shrinkage_of_a_clear_case(lab):
    for name in ("velocity-squared", "planar-coupling", "phase-lag"):
        held = lab.diagnosed(name).held_out
        # half of a sampling error of 120 values, 0.13, of a gap of 17 (4.2 sigma squared) or more is below 0.01
        assert held.shrinkage > 0.9
        assert 0.9 < held.low <= held.shrinkage <= held.high <= 1.0
        assert [fold.sweeps for fold in held.folds] == [("C",), ("B",), ("A",)]  # the highest first
        assert "highest first" in held.scheme


def test_a_level_held_out_chooses_nothing(lab):
    """Spoiling the highest level alone changes neither what the others choose nor how they predict one another."""
    record = lab.measured("velocity-squared")
    table, effects = record.table.copy(), {name: CATALOGUE[name] for name in KINDS}
    table.loc[table["sweep"] == "C", "amplitude"] *= 1.1
    table.loc[table["sweep"] == "C", "phase"] += 0.1
    known, search = search_hypotheses(setting(replace(record, table=table), lab.mode()), effects)
    spoilt = hold_levels_out(known, search, search.ranked()[0].best).folds[0]
    clean = lab.diagnosed("velocity-squared").held_out.folds[0]
    assert spoilt.sweeps == clean.sweeps == ("C",)
    assert spoilt.effects == clean.effects
    assert len(spoilt.effects) == 1  # not what the spoilt level needs: a gain and a lag
    assert spoilt.after > 50.0 * clean.after  # 10 sigma in every value, which was 1


def test_what_one_level_has_the_others_cannot_predict(lab):
    """An offset of one level: held out, the others show none of it, and the scheme says that they cannot."""
    rows, effects = lab.bench().rows, {"level-offset": CATALOGUE["level-offset"]}
    table = lab.record(rows, lab.linear(rows), 2).table
    table.loc[table["sweep"] == "B", "amplitude"] *= 1.1
    known, search = search_hypotheses(setting(Record(table), lab.mode()), effects)
    held = hold_levels_out(known, search, search.ranked()[0].best)
    assert search.ranked()[0].effects == ("level-offset",)
    assert held.shrinkage < 0.5
    assert held.scheme.endswith("; what level-offset changes in one level, the others cannot predict")


def test_one_level_can_hold_nothing_out(lab):
    rows = lab.bench(levels=1).rows
    known = setting(lab.record(rows, lab.linear(rows), 2), lab.mode())
    assert hold_levels_out(known, None, None) is None


def test_a_power_says_how_much_of_the_changes_it_takes():
    """A line of amplitude takes all; values that jump take next to nothing, though by more than noise."""
    amplitude, sd = np.linspace(1.0, 2.0, 40), np.full(40, 0.01)
    line = trend(amplitude, 1.0 + 0.3 * amplitude, sd)
    jumps = trend(amplitude, 1.0 + 0.3 * (-1.0) ** np.arange(40) - 0.05 * amplitude, sd)
    assert line.share == pytest.approx(1.0)
    assert jumps.gain > 16.0
    assert jumps.share < 0.1
