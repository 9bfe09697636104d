"""Settings, files, progress and the command line; all computation is in ``damping``.

Here is what commands share before anything heavy is loaded: the data that are shipped, and processes that end with
their parent.
"""

import ctypes
import gc
import logging
import multiprocessing
import os
import sys
import threading
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from contextvars import ContextVar
from pathlib import Path

import damping  # noqa: F401 - before numpy: it keeps the linear algebra to one thread
from damping.errors import InputError

# a failed command says one line: matplotlib adds two about its cache where the home folder is read-only
logging.getLogger("matplotlib").setLevel(logging.ERROR)

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


def leave_pyarrow_out() -> None:
    """Keep pandas from loading pyarrow in this process; call it before pandas is loaded.

    If pyarrow is installed, pandas loads it for text (40 MB and a tenth of a second), which is not needed.
    """
    sys.modules.setdefault("pyarrow", None)  # type: ignore[arg-type]  # the documented way to make an import fail


def count_jobs(jobs: int | None) -> int:
    """Number of processes: as requested, else the number of cores that this process may use."""
    return jobs or (len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)


def start_pool(jobs: int | None = None) -> ProcessPoolExecutor:
    """A pool of :func:`count_jobs` processes that end with this one and load pyarrow only if it does."""
    # "spawn": a forked copy of a process with threads (a progress bar has one) may lock up
    spawn, without_pyarrow = multiprocessing.get_context("spawn"), sys.modules.get("pyarrow", True) is None
    return ProcessPoolExecutor(count_jobs(jobs), spawn, end_with_parent, (without_pyarrow,))


def end_with_parent(without_pyarrow: bool = False) -> None:
    """Initializer of a pool: when the parent ends, even if killed, this process ends too."""
    if without_pyarrow:
        leave_pyarrow_out()
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)  # no parent is left for an error

    threading.Thread(target=watch, daemon=True, name="end-with-parent").start()


#: Objects made before a look for unused cycles among them: a figure drawn is one, of tens of thousands.
COLLECT_DRAWN = 1_000


def collect_drawn() -> None:
    """Look for unused cycles often from now on, as drawing needs, and only among what is made from now on.

    A look at everything waits until a quarter is new: of all modules loaded that is 20 MB of figures drawn.
    """
    gc.set_threshold(COLLECT_DRAWN)
    gc.freeze()


def give_back_memory() -> None:
    """Return freed memory to the system, which the C library of Linux would keep for later."""
    with suppress(AttributeError, OSError):  # another C library
        ctypes.CDLL(None).malloc_trim(0)
