"""A limit on the time that work may take in a thread of its own, where no signal reaches it."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class OutOfTimeError(BaseException):
    """The work took longer than it may; beside ``Exception``, so that no handler on its way takes it for its own."""


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
