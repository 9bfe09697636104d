"""Objects that users hold: what they gave does not change under a result, and they are shown, compared and sent."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
import re
from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest

import damping as dp
from damping.effects import CATALOGUE, FOREIGN, list_forms
from damping.effects.contract import Scales
from damping_reed1970 import data_folder

SATURN = data_folder() / "saturn-v"
RECORD = SATURN / "records" / "config-2-mode-1.csv"
SCALES = Scales(0.2, 2.0, 10.0, 3.0, 0.5, 0.01, 0.1, 0.001, 0.05, simulated={"viscous": {"coefficient": 0.5}}, rate=0.1)


def send(value: object) -> object:
    """The value as another process has it."""
    return pickle.loads(pickle.dumps(value))  # what it reads was written in this very line


def spoil(record: dp.Record) -> pd.DataFrame:
    """What a user may write to the table of a record."""
    table = record.table
    table["frequency"] *= 1.05
    table.loc[1, "amplitude"] = np.nan
    return table


@pytest.mark.sampling
@pytest.mark.usefixtures("few_laws")
def test_a_table_that_is_written_to_is_another_than_the_records(record, mode):
    """Parts of a result are computed when they are asked for: all of the rows that were checked."""
    before, loads = record.table, dp.extrapolate(record, mode, [60.0])
    spoilt = spoil(record)
    pd.testing.assert_frame_equal(record.table, before)
    pd.testing.assert_frame_equal(loads.table, dp.extrapolate(dp.Record(before), mode, [60.0]).table)
    assert dp.rank(record).table["weight"].sum() == pytest.approx(1.0)
    with pytest.raises(dp.InputError, match="column amplitude: 'nan' in row 1"):
        dp.Record(spoilt)


@pytest.mark.parametrize("name", ["table", "frame"])
def test_a_record_does_not_change(record, name):
    before, column = record.table.copy(), record.column("amplitude")
    for made in (record, dp.Record(before)):
        rows = getattr(made, name)
        rows.loc[:, "amplitude"] *= 2.0
        rows["further"] = 1.0
        pd.testing.assert_frame_equal(getattr(made, name), before)
        np.testing.assert_array_equal(made.column("amplitude"), column)


def test_records_are_equal_whose_rows_are(record):
    again = dp.read_record(RECORD)
    assert record == again == send(record) == copy.deepcopy(record)
    assert record != dp.Record(record.table.assign(force=2.0 * record.table["force"]), record.source)
    assert record != "a record"
    assert dataclasses.replace(record, table=record.table) == record
    with pytest.raises(dataclasses.FrozenInstanceError):
        record.table = record.table
    with pytest.raises(TypeError, match="table"):
        dp.Record()
    assert dp.check(record) != dp.check(again)  # results are themselves alone, and no ValueError of pandas


def test_a_sweep_is_the_record_of_its_rows(mode):
    swept = dp.sweep(mode, force=20.0, frequency=[1.6, 1.7]).record
    assert dp.Record(swept.table, swept.source) == swept


def test_a_regression_is_of_the_record_it_was_given(record):
    asked = {"response": "amplitude", "terms": "force"}
    assert dp.regress(record, **asked).to_json()["data"] == "config-2-mode-1.csv"
    assert dp.regress(record.table, **asked).to_json()["data"] == "table"
    assert dp.regress(record, **asked, source="x/y.csv").to_json()["data"] == "y.csv"


def test_objects_are_shown_in_a_few_lines(record, mode):
    for shown in (record, mode, dp.check(record, mode)):
        assert len(repr(shown)) < 1000
    many = dp.Record(pd.concat([record.table.assign(force=record.table["force"] * k) for k in range(1, 40)]), "many")
    assert repr(many).startswith(f"many: {len(many)} rows in {len(many.sweeps)} sweeps")
    assert len(repr(many).splitlines()) < 20


@pytest.mark.usefixtures("few_laws")
def test_a_notebook_shows_what_the_audit_finds(record, mode):
    """A record in other units than its mode was ranked and predicted without a word, unless the form was asked for."""
    heavy = dataclasses.replace(mode, mass=1e3 * mode.mass, damping={})
    given = dp.Record(record.table.drop(columns="mass")), heavy
    (finding,) = map(str, dp.check(*given).findings)
    assert "damping ratio" in finding
    for result in (dp.rank(*given), dp.extrapolate(*given, [60.0]), dp.curve(*given, [1.0])):
        assert result.remarks[0] == finding
        assert repr(result).count(finding) == 1


@pytest.mark.sampling
@pytest.mark.usefixtures("few_laws")
def test_a_law_and_its_sample_are_shown_in_a_few_lines(record):
    """Its coefficients with their intervals as the form has them, and of a sample R-hat."""
    result = dp.rank(record)
    law = result["viscous + velocity-squared"]
    forces = next(model for model in result.to_json()["models"] if model["name"] == law.law.name)["forces"]
    for force, row in zip(forces, law.shown.to_dict("records"), strict=True):
        assert [row[key] for key in ("parameter", "median", "low", "high")] == [
            force[key] for key in ("name", "coefficient", "low", "high")
        ]
    sample = law.sample(seed=1)
    shown = sample.shown.set_index("parameter")
    draws = sample.draws["viscous"]
    assert shown.loc["viscous", "median"] == np.median(draws)
    assert pytest.approx(np.mean(draws < shown.loc["viscous", "low"]), abs=1e-3) == 0.05
    assert pytest.approx(shown.loc["viscous", "r_hat"], abs=0.011) == 1.0  # as it must be of a sample that converged
    for own in (law, sample):
        assert repr(own).startswith("viscous + velocity-squared: ")
        assert len(repr(own)) < 1000
        assert "<table" in own._repr_html_()


@pytest.mark.parametrize("effect", [*CATALOGUE.values(), *FOREIGN.values()], ids=lambda effect: effect.name)
def test_forms_of_effects_are_sent_by_what_makes_them(effect):
    assert send(effect) is effect
    for form in list_forms(effect, SCALES):
        for own in filter(None, (form, form.twin)):
            sent = send(own)
            values = [0.3, *(shape.centre for shape in own.shapes)]
            assert sent.report(*values) == own.report(*values)
            assert dataclasses.replace(sent, change=own.change, report=own.report, twin=own.twin) == own


def test_a_diagnosis_is_sent_and_copied(record, mode, few_laws):
    found = dp.diagnose(record, mode)
    for again in (send(found), copy.deepcopy(found)):
        assert again.to_json() == found.to_json()
        assert repr(again) == repr(found)
        assert again.diagnosis.corrected == found.diagnosis.corrected


def test_a_mode_does_not_change():
    given = {"viscous": 2.0, "slip": {"stiffness": 1.0, "limit": 0.1}}
    effects = {"stiffness-hardening": {"coefficient": 4.0}}
    mode = dp.Mode(name="m", frequency=2.0, mass=3.0, damping=given, effects=effects)
    given["viscous"] = 5.0
    for again in (mode, send(mode), copy.deepcopy(mode)):
        for table in (again.damping, again.damping["viscous"], again.effects, again.effects["stiffness-hardening"]):
            for change in (
                lambda t: t.update(viscous=3.0),
                lambda t: t.__setitem__("coefficient", 3.0),
                lambda t: t.clear(),
                lambda t: t.popitem(),
            ):
                with pytest.raises(TypeError, match="a mode does not change"):
                    change(table)
        assert again == mode
        assert hash(again) == hash(mode)
        assert again.damping["viscous"] == {"coefficient": 2.0}
    assert json.loads(json.dumps(mode.damping)) == dataclasses.asdict(mode)["damping"] == mode.damping
    assert dataclasses.replace(mode, damping={**mode.damping, "viscous": 5.0}).damping["viscous"]["coefficient"] == 5.0


def test_a_law_is_of_a_tuple_whatever_list_it_is_made_of():
    laws = {dp.Law(["viscous", "slip"]), dp.Law(("viscous", "slip"))}
    assert len(laws) == 1
    for wrong in ("viscous", 3, [3]):
        with pytest.raises(dp.InputError, match=f"components {re.escape(repr(wrong))}; expected names of forces"):
            dp.Law(wrong)


@pytest.mark.parametrize("despite", [3, None, "outlier"])
def test_checks_to_pass_over_are_a_list(record, despite):
    with pytest.raises(dp.InputError, match=f"despite is {despite!r}; expected a list"):
        dp.rank(record, despite=despite)


@pytest.mark.parametrize(
    ("progress", "said"),
    [
        (3, "progress is of type int"),
        (lambda title, total: None, "progress returned None"),
        (lambda title, total: nullcontext(), "progress yields None"),
        (lambda: None, "progress does not take a title"),
        (lambda title: None, "progress does not take a title"),
        (lambda title, total: nullcontext(lambda: None), "what progress yields does not take"),
        (lambda title, total: nullcontext(lambda what: None), "what progress yields does not take"),
    ],
)
def test_what_shows_progress_is_checked_before_any_law(record, mode, monkeypatch, progress, said):
    for work in ("damping.api.rank_laws", "damping.extrapolation.plan_loads"):
        monkeypatch.setattr(work, lambda *_: pytest.fail("laws were weighed"))
    for ask in (
        lambda: dp.rank(record, progress=progress),
        lambda: dp.extrapolate(record, mode, [60.0], progress=progress),
        lambda: dp.sweep(mode, force=2.0, frequency=[1.6, 1.7], progress=progress),
    ):
        with pytest.raises(dp.InputError, match=f"{said}.*; expected a function of a title"):
            ask()


def test_a_row_is_named_by_its_label_too(record):
    table = record.table.set_index(10 * np.arange(len(record)) + 7)
    table.loc[27, "amplitude"] = -1.0
    with pytest.raises(dp.InputError, match=r"-1 in row 2 \(labelled 27\); expected a displacement amplitude > 0"):
        dp.Record(table)
    with pytest.raises(dp.InputError, match=r"'x' in row 2 \(labelled 27\)"):
        dp.Record(table.astype({"force": object}).assign(force=["1", "2", "x", *"4" * (len(table) - 3)]))
