"""``damping gap`` never writes over its input."""

from __future__ import annotations

import pytest

from damping.records.mode import describe_mode_to_toml
from damping_pipelines.cli import main


@pytest.mark.parametrize(("option", "target"), [("--model-out", 0), ("--report", 1), ("--json", 1)])
def test_inputs_are_never_written_over(lab, tmp_path, capsys, option, target):
    files = tmp_path / "model.toml", tmp_path / "data.csv"
    files[0].write_text(describe_mode_to_toml(lab.mode()))
    lab.measured("phase-lag", points=12).table.to_csv(files[1], index=False)
    before = [path.read_text() for path in files]
    with pytest.raises(SystemExit) as stopped:
        main(["gap", *map(str, files), "--no-posterior", option, str(files[target])])
    assert stopped.value.code == 2
    assert "one of the inputs" in capsys.readouterr().err
    assert [path.read_text() for path in files] == before
