"""Run the command line as a user does, in this process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from damping_pipelines.cli import main
from damping_reed1970.tables import data_folder


@dataclass(frozen=True)
class Run:
    code: int
    out: str
    err: str


@pytest.fixture
def damping(capsys: pytest.CaptureFixture[str]) -> Callable[..., Run]:
    """``damping(*words)`` gives exit code, standard output and standard error."""

    def run(*words: object) -> Run:
        with pytest.raises(SystemExit) as stopped:
            main([str(word) for word in words])
        captured = capsys.readouterr()
        return Run(int(stopped.value.code or 0), captured.out, captured.err)

    return run


@pytest.fixture(scope="session")
def saturn_data() -> Path:
    return data_folder() / "saturn-v"
