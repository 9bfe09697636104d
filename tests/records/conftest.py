"""Files to read: a scratch folder that is written to many times, and the measured records beside the project."""

from collections.abc import Callable
from pathlib import Path

import pytest

REAL = Path(__file__).parents[3] / "shared" / "real"


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Callable[[bytes | str, str], Path]:
    """Writes bytes or text to a file of the given name and returns its path; the next call may overwrite it."""
    folder = tmp_path_factory.mktemp("records")

    def write(content: bytes | str, name: str = "record.csv") -> Path:
        path = folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


@pytest.fixture(scope="session")
def real() -> Path:
    """Folder of the measured records, which are not part of the project."""
    if not REAL.is_dir():
        pytest.skip("the folder of measured records is absent: their licences keep them out of the project")
    return REAL
