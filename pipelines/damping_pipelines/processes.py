"""Small processes that end with their parent, and work with a time limit."""

import ctypes
import multiprocessing
import os
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress


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
        os._exit(1)  # nobody is left who could be told

    threading.Thread(target=watch, daemon=True, name="end-with-parent").start()


def give_back_memory() -> None:
    """Return freed memory to the system, which the C library of Linux would keep for later."""
    with suppress(AttributeError, OSError):  # another C library
        ctypes.CDLL(None).malloc_trim(0)


class OutOfTimeError(BaseException):
    """The work exceeded its time limit; not an ``Exception``, so that no handler on the way catches it."""


@contextmanager
def limit_time(seconds: float) -> Iterator[None]:
    """Raise :class:`OutOfTimeError` in the calling thread when the block takes longer than ``seconds``.

    It is raised between two instructions of Python: a single call into native code is waited for.
    """
    thread = ctypes.c_ulong(threading.get_ident())
    over, lock = False, threading.Lock()

    def stop() -> None:
        with lock:
            if not over:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(OutOfTimeError))

    timer = threading.Timer(seconds, stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            over = True
        timer.cancel()
