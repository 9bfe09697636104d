"""Records that cannot say what is asked, or say it wrongly: a message or a caution, never a confident wrong answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from damping.errors import AnalysisError, InputError
from damping.gap.corrected import corrected_mode, describe_effects
from damping.gap.diagnose import diagnose
from damping.gap.problem import MOST_ROWS, record_cautions
from damping.gap.rows import join_states, read_rows
from damping.gap.states import list_repeated, list_unread
from damping.records.record import Record
from tests.gap.limited import limited

PLAN = {"levels": 3, "points": 12}


@pytest.fixture
def honest(lab):
    """A record of the simulation itself with some columns changed: factors, new columns, or None for none."""

    def record(plan=PLAN, keep=None, **changes):
        rows = lab.bench(**plan).rows
        table = lab.record(rows, lab.linear(rows), 4).table
        for name, change in changes.items():
            table = table.drop(columns=name) if change is None else table.assign(**{name: table[name] * change})
        return Record(table if keep is None else table[keep(table)].reset_index(drop=True), "a record")

    return record


def answer(record, mode):
    found = diagnose(record, mode)
    return found, "; ".join(found.cautions)


def highest(table):
    """Marks the row of largest amplitude of each sweep."""
    return table.index.isin(table.groupby("sweep")["amplitude"].idxmax())


def confident(found):
    """Effects that are named with a probability above 0.95 as if nothing else were left."""
    first = found.hypotheses[0]
    return () if found.unexplained or first.probability <= 0.95 else first.effects


def test_a_record_without_phases_is_asked_for_no_lag(lab, honest):
    found, said = answer(honest(phase=None, phase_sd=None), lab.mode())
    assert "no phase" in said
    assert found.leading.effects == ()
    assert not any("phase-lag" in one.effects for one in found.hypotheses)  # cannot be asked
    assert {cell.quantity for cell in found.where} == {"amplitude"}


def test_one_level_is_said_and_accuses_nobody(lab, honest):
    found, said = answer(honest({"levels": 1, "points": 20}), lab.mode(None, None))
    assert "one force level" in said
    assert "repeatability is not stated" in said
    assert found.held_out is None
    assert found.leading.effects == ()


def test_two_rows_a_sweep_name_nothing_with_confidence(lab, honest):
    found, said = answer(honest(keep=lambda table: table.index.isin([4, 7])), lab.mode())
    assert "fewer than 3 rows in sweep A" in said
    assert confident(found) == ()


def test_rows_at_resonance_only(lab, honest):
    """One row a sweep without a phase: what moves the resonance alone cannot be asked for."""
    peak = honest(
        phase=None, phase_sd=None, keep=lambda t: t.groupby("sweep")["amplitude"].transform("max") == t["amplitude"]
    )
    assert len(peak) == 3
    found, said = answer(peak, lab.mode())
    assert "one row without a phase" in said
    assert confident(found) == ()
    asked = {effect for one in found.hypotheses for effect in one.effects}
    assert not asked & {"natural-frequency", "stiffness-hardening", "planar-coupling", "phase-lag", "force-dropout"}
    beside = join_states([(read_rows(record, lab.mode()), lab.mode()) for record in (honest(), peak)])
    assert not any("fewer than" in caution for caution in record_cautions(beside, honest(), lab.mode()))


def test_a_mode_without_a_file_is_named_in_messages(lab, honest):
    peak = honest(phase=None, phase_sd=None, keep=lambda t: t["amplitude"] == t["amplitude"].max())
    undamped = replace(lab.mode(), damping={}, source="", name="wing")
    with pytest.raises(AnalysisError, match=r"^wing: the simulation has no damping"):
        answer(peak, undamped)


def test_peaks_beside_a_sweep_without_phases_stay_at_resonance(lab, honest):
    """As the page of files says of a sweep of one row, and as a further sweep is planned beside them."""
    table = honest(phase=None, phase_sd=None).table
    peaks_and_sweep = Record(table[(table["sweep"] == "C") | highest(table)], "a record")
    rows = read_rows(peaks_and_sweep, lab.mode())
    assert [sorted(set(rows.resonant[run].tolist())) for run in rows.runs] == [[True], [True], [False]]


def test_sweeps_are_numbered_as_they_began_whatever_the_order_of_the_file(lab, honest):
    """A file sorted otherwise tells the same where it has times; without times its order is what is known."""
    table = honest().table
    timed = table.assign(time=10.0 * np.arange(len(table)))
    for turned in (timed.iloc[::-1], timed.sample(frac=1.0, random_state=2)):
        one, other = (read_rows(Record(rows, "a record"), lab.mode()) for rows in (timed, turned))
        assert other.sweeps == one.sweeps == ("A", "B", "C")
        for name in ("label", "time", "u", "phase", "omega", "F", "up", "levels"):
            # the same numbers in the same order, to the bit
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name), err_msg=name)
    assert read_rows(Record(table.iloc[::-1], "a record"), lab.mode()).sweeps == ("C", "B", "A")


def test_rows_with_a_phase_all_at_the_simulated_frequency(lab, honest):
    """One row a level, all at one frequency, as a tuned test gives them: no band, and an answer all the same."""
    at = honest({"levels": 4, "points": 21}, keep=highest)
    assert np.ptp(at.column("frequency")) == 0.0
    np.testing.assert_allclose(at.column("frequency"), lab.mode().frequency, rtol=1e-12, atol=0.0)  # rounding
    found, said = answer(at, lab.mode())
    assert "fewer than 3 rows in sweep A" in said
    assert confident(found) == ()


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"amplitude_3": 1e-4}, ["amplitude_3 is without phase_3 and is not used"]),
        (
            {"phase_3": 0.1, "amplitude_y": 1e-4},
            ["phase_3 is without amplitude_3 and", "amplitude_y is without phase_y and"],
        ),
        ({"amplitude_3": 1e-4, "phase_3": 0.1, "amplitude_y": np.nan}, []),
        ({"amplitude_3": 0.0, "phase_3": 0.1}, ["amplitude_3 is 0 and is not used: an analyser never reads exactly 0"]),
    ],
)
def test_half_a_phasor_is_told_and_not_used(honest, columns, said):
    record = honest()
    one = Record(record.table.assign(**columns))
    cautions = list_unread([(one, None)])
    assert len(cautions) == len(said)
    assert all(caution.startswith(start) for caution, start in zip(cautions, said, strict=True))


def test_third_harmonics_of_zero_change_no_answer(lab, honest):
    """Their noise would be estimated as nothing, beside which no law of damping fits."""
    record = honest()
    zero = Record(record.table.assign(amplitude_3=0.0, phase_3=0.0))
    ours, theirs = (read_rows(one, lab.mode()) for one in (zero, record))
    assert ours.channels == theirs.channels == ()
    np.testing.assert_array_equal(ours.sd_third, theirs.sd_third)


def test_half_a_phasor_of_some_rows_is_told_with_its_state(lab, honest):
    record = honest()
    phase = np.where(np.arange(len(record)) < 5, np.nan, 0.1)
    partly = Record(record.table.assign(amplitude_3=1e-4, phase_3=phase))
    expected = (
        f"amplitude_3 of state 2 is without phase_3 in 5 of {len(record)} rows and is not used: a phasor needs both"
    )
    assert list_unread([(record, lab.mode()), (partly, lab.mode())]) == [expected]
    assert expected.replace(" of state 2", "") in limited({}, diagnose, partly, lab.mode()).cautions


def test_a_state_that_repeats_another_is_told(lab, honest):
    """The same record twice, its sweeps named otherwise, and a part of it; not another measurement of the same plan."""
    one, mode = honest(), lab.mode()
    renamed = Record(one.table.assign(sweep="again " + one.table["sweep"], state=2))
    part = Record(one.table.iloc[3:20].reset_index(drop=True))
    rows = lab.bench(**PLAN).rows
    other = lab.record(rows, lab.linear(rows), 5)
    assert list_repeated([(one, mode), (other, mode)]) == []
    said = "of states {} and {} are identical, unlike those of any two measurements: they count twice"
    assert list_repeated([(other, mode), (one, mode), (renamed, mode)]) == ["the rows " + said.format(2, 3)]
    assert list_repeated([(part, mode), (one, mode)]) == ["the rows " + said.format(1, 2)]
    mixed = Record(pd.concat([one.table.iloc[:20], other.table.iloc[20:]], ignore_index=True))
    assert list_repeated([(one, mode), (mixed, mode)]) == ["20 rows " + said.format(1, 2)]
    assert "the rows " + said.format(1, 2) in limited({}, diagnose, one, mode, states=[(renamed, mode)]).cautions


def test_a_record_that_is_given_twice_is_refused(lab, honest):
    """As rows that are identical in every column of one record are; empty cells are as good as equal."""
    one = honest()
    blank = Record(one.table.assign(mass=np.nan))
    for record in (one, blank, Record(one.table.iloc[3:20].reset_index(drop=True))):
        other = blank if record is blank else one
        with pytest.raises(InputError, match=r"states 1 and 2 are identical in every column; expected each .* once"):
            limited({}, diagnose, other, lab.mode(), states=[(record, lab.mode())])


def test_uncertainties_below_any_rounding_leave_no_comparison(lab, honest):
    """Residuals of 1e16 noises: no fit holds them as numbers; that is an error of the input, not of the program."""
    frame = honest().table
    stated = frame.assign(amplitude=2.0 * frame["amplitude"], amplitude_sd=1e-16 * frame["amplitude"], phase_sd=1e-16)
    with pytest.raises(AnalysisError, match="uncertainties of the rows are too small"):
        diagnose(Record(stated), lab.mode())


def test_too_many_rows(lab, honest):
    record = honest()
    times = MOST_ROWS // len(record) + 1
    many = Record.trusted(pd.concat([record.table] * times, ignore_index=True), "many.csv")
    with pytest.raises(AnalysisError, match=f"many.csv: {times * len(record)} rows; at most {MOST_ROWS}"):
        diagnose(many, lab.mode())


def test_constant_amplitude(lab):
    rows = lab.bench(**PLAN).rows
    unit = lab.linear(replace(rows, force=np.ones(rows.force.size)))
    held = replace(rows, force=np.array([0.01, 0.02, 0.04])[rows.sweep] / unit.amplitude)
    found, said = answer(lab.record(held, lab.linear(held), 4), lab.mode())
    assert "constant amplitude in sweep A, B, C" in said
    assert found.leading.effects == ()


def test_sweeps_that_never_reach_resonance(lab, honest):
    found, said = answer(honest({"levels": 3, "points": 24}, keep=lambda t: t["frequency"] < 2.97), lab.mode())
    assert "sweep A, B, C does not reach resonance" in said
    assert found.leading.effects == ()


def test_damping_that_is_hardly_seen_is_not_named_with_confidence(lab, no_folds):
    """Twice the viscous damping, seen only beside resonance where it is 1/100 of the stiffness."""
    rows = lab.bench(levels=3, points=24, half=12.0).rows
    record = lab.record(rows, lab.linear(rows, viscous=1.5 * lab.viscous), 4)
    kept = record.table[record.table["frequency"] < 2.85].reset_index(drop=True)
    found, said = answer(Record(kept, "beside"), lab.mode())
    assert "does not reach resonance" in said
    assert confident(found) in ((), ("viscous-coefficient",))


@pytest.mark.parametrize("ratio", [0.6, 1.5, 2 * np.pi])
def test_model_and_record_of_different_modes(lab, honest, ratio):
    with pytest.raises(AnalysisError, match="different modes") as refused:
        diagnose(honest(frequency=ratio), lab.mode())
    assert "simulated resonance 3 Hz" in str(refused.value)


@pytest.mark.parametrize("times", [7.0, 25.0, 50.0])
def test_damping_far_above_the_simulated_one_moves_the_peak_and_is_no_other_mode(lab, no_folds, times):
    """50 times: the largest amplitude lies 29 % below the natural frequency (1 - 2 zeta^2 = 1/2)."""
    rows = lab.bench(levels=3, points=30, half=50.0).rows
    record = lab.record(rows, lab.linear(rows, viscous=times * lab.viscous), 4)
    library = ("viscous-coefficient", "displacement", "natural-frequency", "second-mode", "planar-coupling", "drift")
    found = limited(library, diagnose, record, lab.mode())
    assert found.leading.effects == ("viscous-coefficient",)
    size = describe_effects(found.leading.best)[0]["viscous-coefficient"]["relative"]
    np.testing.assert_allclose(size, times - 1.0, rtol=0.03, atol=0.0)  # 1 % noise, 180 values


@pytest.mark.parametrize("share", [0.0, 0.2])
def test_viscous_damping_that_is_not_simulated_is_found(lab, no_folds, honest, share):
    """Where nothing is simulated, or case II: that loses 2 c A^2 (Table 2.II), viscous damping pi c omega A^2."""
    damping = {"displacement": {"coefficient": share * lab.viscous * lab.omega}} if share else {}
    found, said = answer(honest(), lab.mode(damping=damping))
    assert ("the simulation has no damping" in said) == (not damping)
    assert found.leading.effects == ("viscous-coefficient",)
    corrected = corrected_mode(found.leading.best).damping
    lost = corrected["viscous"]["coefficient"]
    lost += 2.0 / (np.pi * lab.omega) * corrected.get("displacement", {"coefficient": 0.0})["coefficient"]
    np.testing.assert_allclose(lost, lab.viscous, rtol=0.02, atol=0.0)  # 1 % noise, and 2 % tolerance of the mass


def test_resonances_alone_say_nothing_of_a_simulation_without_damping(lab):
    peaks = pd.DataFrame({"sweep": ["A", "B"], "force": [1.0, 2.0], "frequency": 3.0, "amplitude": [0.02, 0.04]})
    with pytest.raises(AnalysisError, match=r"no damping.*add a force to \[damping\]"):
        diagnose(Record(peaks), lab.mode(damping={}))


def test_noise_that_is_not_stated_is_said_and_found(lab, honest):
    found, said = answer(honest({"levels": 3, "points": 20}, amplitude_sd=None, phase_sd=None), lab.mode())
    assert "noise is not stated" in said
    assert found.leading.effects == ()
    rows = found.setting.problem.rows
    # 1 %, from 60 values each of which half are free of the fit: known to 13 per cent; three of these
    np.testing.assert_allclose([np.median(rows.sd_amplitude), np.median(rows.sd_phase)], lab.noise, rtol=0.4, atol=0.0)


def test_an_uncertainty_of_0_states_no_noise_and_is_said(lab, honest):
    """It is taken as where the column is missing, in all rows; in some as the median of the others."""
    record = honest()
    some = np.where(np.arange(len(record)) < 5, 0.0, record.table["amplitude_sd"])
    none = Record(record.table.drop(columns=["amplitude_sd", "phase_sd"]))
    zero = Record(record.table.assign(amplitude_sd=0.0, phase_sd=0.0))
    partly = Record(record.table.assign(amplitude_sd=some))
    said = [limited({}, diagnose, own, lab.mode()) for own in (none, zero, partly)]
    assert said[0].gap == said[1].gap
    estimated = "estimated from the roughness along each sweep"
    assert f"noise is not stated: it was {estimated}" in said[0].cautions
    assert f"noise is not stated (amplitude_sd is 0): it was {estimated}" in said[1].cautions
    assert f"phase_sd is 0, which states no noise: it was {estimated}" in said[1].cautions
    (told,) = [caution for caution in said[2].cautions if "amplitude_sd" in caution]
    assert told.startswith(f"amplitude_sd is 0 in 5 of {len(record)} rows")
    assert told.endswith("the median of the other rows is used there")
