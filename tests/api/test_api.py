"""The two functions of the shortest way give what the commands give."""

from __future__ import annotations

import json

import numpy as np
import pytest

import damping
from damping import api, extrapolate, rank, read_mode, read_record
from damping import ranking as compare_ranking
from damping.infer.law import Law
from damping_pipelines import rank as extrapolate_command
from damping_pipelines import rank as rank_command
from damping_pipelines.cli import main
from damping_reed1970.tables import data_folder

SATURN = data_folder() / "saturn-v"
RECORD, MODE = SATURN / "records" / "config-2-mode-1.csv", SATURN / "modes" / "config-2-mode-1.toml"


def command(capsys, *words: object) -> dict:
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in (*words, "--json", "-")])
    assert not stopped.value.code
    return json.loads(capsys.readouterr().out)


@pytest.fixture(autouse=True)
def few_laws(monkeypatch):
    """What stands for all candidates: the way is tested here, not the laws."""
    laws = (Law(("viscous",)), Law(("viscous", "velocity-squared")), Law(("velocity-power",)))
    for module in (compare_ranking, rank_command):
        monkeypatch.setattr(module, "candidate_laws", lambda data: laws)
    for module in (api, extrapolate_command):
        monkeypatch.setattr(module, "load_candidates", lambda data: laws[1:])


def test_rank_is_the_command(capsys):
    table = rank(read_record(RECORD))
    models = command(capsys, "rank", RECORD, "--mode", MODE)["models"]
    assert list(table["law"]) == [model["name"] for model in models]
    # the same numbers; JSON keeps every digit
    np.testing.assert_allclose(table["weight"], [model["weight"] for model in models], rtol=1e-12, atol=0.0)


@pytest.mark.sampling
def test_extrapolate_is_the_command(capsys):
    table = extrapolate(read_record(RECORD), read_mode(MODE), [60.0, 90.0], level=0.8)
    wanted = command(capsys, "extrapolate", RECORD, "--mode", MODE, "--force", 60, "--force", 90, "--level", 0.8)[
        "predictions"
    ]
    for column, key in (("median", "median"), ("low", "low"), ("high", "high"), ("linear", "linear")):
        # the same numbers; JSON keeps every digit
        np.testing.assert_allclose(table[column], [one[key] for one in wanted], rtol=1e-12, atol=0.0)
    assert [said.split("; ") if said else [] for said in table["cautions"]] == [one["cautions"] for one in wanted]


def test_other_names_are_unknown():
    with pytest.raises(AttributeError, match="no attribute 'guess'"):
        _ = damping.guess
