"""Files are whole or not there; JSON holds no NaN."""

import json
import os

import numpy as np
import pytest

from damping.errors import InputError
from damping_pipelines.store import check_outputs, plain, refuse_inputs, to_json, write_bytes, write_json, write_text


def test_replaces_whole(tmp_path):
    path = tmp_path / "deep" / "file.txt"
    write_text(path, "one")
    write_text(path, "two")
    assert path.read_text() == "two"
    assert os.listdir(path.parent) == ["file.txt"]


def test_failure_leaves_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / "file.txt"
    write_text(path, "earlier")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left"):
        write_bytes(path, b"later")
    assert path.read_text() == "earlier"
    assert os.listdir(tmp_path) == ["file.txt"]


def test_inputs_are_no_outputs(tmp_path):
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    other.symlink_to(one)
    for target in (one, str(tmp_path / "." / "one.csv"), other):
        with pytest.raises(InputError, match=r"--out is one of the inputs.*expected another file"):
            refuse_inputs("--out", target, tmp_path / "else.csv", one)
    for target in (None, "-", tmp_path / "two.csv"):
        refuse_inputs("--out", target, one)


def test_outputs_are_different_files(tmp_path):
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    other.symlink_to(one)
    for target in (str(tmp_path / "." / "one.csv"), other):
        with pytest.raises(InputError, match=r"--json is the file of --out; expected another file for each output"):
            check_outputs({"--out": one, "--page": None, "--json": target})
    check_outputs({"--out": one, "--page": None, "--json": tmp_path / "two.csv"})
    check_outputs({"--out": one, "--page": None, "--json": "-", "--report": None})
    with pytest.raises(InputError, match=r"--out - is no file; only --json writes to standard output"):
        check_outputs({"--out": "-", "--json": "-"})


def test_plain_data(capsys):
    value = {"a": np.float64("nan"), "b": np.array([1.0, np.inf]), "c": (np.int64(3), True, None), 4: "ü"}
    assert json.loads(to_json(value)) == {"a": None, "b": [1.0, None], "c": [3, True, None], "4": "ü"}
    assert plain(np.bool_(True)) is True
    write_json("-", {"x": 1})
    assert json.loads(capsys.readouterr().out) == {"x": 1}
