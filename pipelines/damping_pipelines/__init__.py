"""Settings, files, progress and the command line; everything that computes is in ``damping``."""

import sys
from contextvars import ContextVar
from pathlib import Path

import damping  # noqa: F401 - before numpy: it keeps the linear algebra to one thread
from damping.errors import InputError

#: Whether progress is kept to oneself: ``damping --quiet``.
QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


def leave_pyarrow_out() -> None:
    """Keep pandas from loading pyarrow in this process, before it is loaded itself.

    Wherever pyarrow is installed pandas loads it, 40 MB and a tenth of a second, for text that is as well kept without.
    """
    sys.modules.setdefault("pyarrow", None)  # type: ignore[arg-type]  # the documented way to make an import fail


def begin_process(without_pyarrow: bool) -> None:
    """Initializer of a pool: as `end_with_parent`, and with pyarrow as the parent has it, whose tables come here."""
    if without_pyarrow:
        leave_pyarrow_out()
    from damping_pipelines.terminal import end_with_parent  # noqa: PLC0415 - loads pandas

    end_with_parent()


def shipped_folder(package: Path, name: str) -> Path:
    """Folder ``name`` of the data that a package ships: in its folder ``package``, or in ``data`` of the repository.

    InputError where there is neither (an incomplete installation).
    """
    choices = (package / "_data" / name, package.parents[1] / "data" / name)
    for folder in choices:
        if folder.is_dir():
            return folder
    raise InputError(f"the data {name} are not installed", expected=f"a folder {choices[0]} or {choices[1]}")
