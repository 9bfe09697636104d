"""Settings, files, progress and the command line; all computation is in ``damping``."""

from contextvars import ContextVar
from pathlib import Path

import damping  # noqa: F401 - before numpy: it keeps the linear algebra to one thread
from damping.errors import InputError

#: Whether progress is kept to oneself: ``damping --quiet``.
QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


def shipped_folder(package: Path, name: str) -> Path:
    """Folder ``name`` of the data that a package ships: in its folder ``package``, or in ``data`` of the repository.

    InputError where there is neither (an incomplete installation).
    """
    choices = (package / "_data" / name, package.parents[1] / "data" / name)
    for folder in choices:
        if folder.is_dir():
            return folder
    raise InputError(f"the data {name} are not installed", expected=f"a folder {choices[0]} or {choices[1]}")
