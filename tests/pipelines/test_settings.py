"""Study settings: every mistake is one line that names file, line and key."""

from concurrent.futures import Future
from typing import Any

import numpy as np
import pytest

from damping.arrays import RAD_S_PER_HZ
from damping.errors import InputError
from damping.forces import make
from damping.infer.law import Law
from damping.ranking import rank_laws
from damping.records.record import record_to_csv
from damping_pipelines.study import _record_result, read_inputs
from damping_pipelines.study_files import _summarise_record, default_study, read_settings
from tests.conftest import OMEGA_N, M

GOOD = """title = "t"
seed = 3

[[records]]
name = "a"
record = "a.csv"
mode = "a.toml"
design_forces = [1, 2.5]
laws = [["viscous", "coulomb"]]
"""


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "study.toml"
        path.write_text(text)
        return path

    return write


def test_settings_are_read_as_they_stand(write):
    settings = read_settings(write(GOOD))
    assert settings.seed == 3
    assert settings.records[0].design_forces == (1.0, 2.5)
    assert settings.records[0].laws == (("viscous", "coulomb"),)


def test_default_study_reads_all_its_files():
    path = default_study()
    settings = read_settings(path)
    assert {one.name for one in settings.records} == {
        "config-1-mode-2-rough",
        "config-1-mode-2-pitch",
        "config-2-mode-1",
        "config-2-mode-2",
    }
    assert len(read_inputs(settings, path.parent)) == 4


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("seed = 3", "sead = 3", ("line 2", "sead", "seed")),
        ("seed = 3", "seed = -1", ("line 2", "seed")),
        ("seed = 3", 'seed = "x"', ("line 2", "seed")),
        ("seed = 3", "level = 90.0", ("line 2", "level")),
        ('name = "a"', 'name = "../a"', ("line 5, column records 1, name: '../a'; expected letters, digits, - and _",)),
        ('name = "a"', "", ("line 4", "name", "missing")),
        ('mode = "a.toml"', 'modes = "a.toml"', ("line 7", "modes", "mode")),
        ("[1, 2.5]", '[1, 2.5]\ndesign_levels = ["1 g"]', ("1 design_levels of 2 design_forces",)),
        ("[1, 2.5]", "[0]", ("line 8", "design_forces")),
        ("[1, 2.5]", "[inf]", ("line 8, column records 1, design_forces 1: inf; expected a finite number",)),
        ("seed = 3", "level = 1.5", ("line 2, column level: 1.5; expected a number less than 1",)),
        ("seed = 3", "source_report = 1", ("line 2, column source_report: 1; expected true or false",)),
        ("[1, 2.5]", '"x"', ("line 8, column records 1, design_forces: 'x'; expected a list",)),
        ('"a.csv"', "7", ("line 6, column records 1, record: 7; expected text",)),
        ('["viscous", "coulomb"]', '["viscose"]', ("viscous",)),
        ('["viscous", "coulomb"]', "[]", ("line 9, column records 1, laws 1: []; expected at least one",)),
        ("title", "title title", ("not TOML", "line 1")),
    ],
)
def test_a_mistake_is_named_with_its_line_and_key(old, new, said, write):
    path = write(GOOD.replace(old, new))
    with pytest.raises(InputError) as error:
        read_settings(path)
    message = str(error.value)
    assert str(path) in message
    assert "\n" not in message
    for word in said:
        assert word in message


@pytest.mark.parametrize(("name", "called"), [("a", "'a';"), ("A", "'a' and 'A', and some file systems ignore case")])
def test_two_records_of_one_name(write, name, called):
    again = GOOD[GOOD.index("[[records]]") :].replace('name = "a"', f'name = "{name}"')
    with pytest.raises(InputError, match=f"toml, line 4, column records: two records are called {called}"):
        read_settings(write(GOOD + again))


@pytest.mark.parametrize(
    ("records", "said"),
    [("records = []", "records"), ("", r"missing table; expected \[\[records\]\]")],  # a list of tables
)
def test_a_study_without_records(write, records, said):
    with pytest.raises(InputError, match=said):
        read_settings(write(f'title = "t"\n{records}\n'))


def test_a_study_says_of_its_rows_what_single_commands_say(tmp_path, swept):
    """A removed phase offset, and that predictions weigh laws at resonance; they stood on the terminal alone."""
    record = swept(make("viscous", coefficient=1.0), np.array([1.0, 2.0, 4.0]), noise=0.01, offset=0.15)
    (tmp_path / "a.csv").write_text(record_to_csv(record.frame))
    mode = f"[mode]\nname = 'a'\nfrequency = {OMEGA_N / RAD_S_PER_HZ}\nmass = {M}\n"
    (tmp_path / "a.toml").write_text(mode)
    (tmp_path / "study.toml").write_text(GOOD)
    (asked,) = read_inputs(read_settings(tmp_path / "study.toml"), tmp_path)
    ranking = rank_laws(asked.prepared.all_rows, laws=[Law(("viscous",))], hold_out=False)
    (predicted := Future[dict[str, Any]]()).set_result({})
    result = _record_result(asked, ranking, predicted, ())
    assert "was removed" in result.remarks[0]
    assert "predictions weigh the laws on the resonances" in result.remarks[1]
    assert _summarise_record(result)["cautions"][-2:] == list(result.remarks)
