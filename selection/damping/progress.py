"""Progress reports of long computations, and what the caller has set that must not disturb them."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import wraps
from inspect import signature
from threading import Lock
from typing import ParamSpec, Protocol, TypeVar

from threadpoolctl import threadpool_limits

from damping.errors import InputError


class Advance(Protocol):
    """Call it when a part is done."""

    def __call__(self, what: str, parts: int = 1) -> None:
        """Report that ``parts`` more are done; ``what`` names the last."""


#: A function of a title and a number of parts that returns a context; its value is called after each part.
Progress = Callable[[str, int], AbstractContextManager[Advance]]


@contextmanager
def silent(title: str, total: int) -> Iterator[Advance]:
    """Progress that is not shown."""
    yield lambda what, parts=1: None


def nothing(what: str) -> None:
    """Report of a part that is not shown."""


@contextmanager
def unknown_length(progress: Progress, title: str, usual: int) -> Iterator[Callable[[str], None]]:
    """Progress in per cent of work of unknown length, a half after ``usual`` parts; what is left when it ends."""
    with progress(title, 100) as advance:
        done = shown = 0

        def report(what: str) -> None:
            nonlocal done, shown
            done += 1
            now = 100 * done // (done + usual)
            advance(what, now - shown)
            shown = now

        yield report
        advance("done", 100 - shown)


def watch(progress: object) -> Progress:
    """A user's ``progress``, checked; InputError if it cannot be called so, or when it does not return a context."""
    if not callable(progress):
        raise InputError(f"progress is of type {type(progress).__name__}", expected=_EXPECTED)
    if not _takes(progress, "", 1):
        raise InputError("progress does not take a title and a number of parts", expected=_EXPECTED)

    @contextmanager
    def opened(title: str, total: int) -> Iterator[Advance]:
        context = progress(title, total)
        if not isinstance(context, AbstractContextManager):
            raise InputError(f"progress returned {context!r}", expected=_EXPECTED)
        with context as advance:
            if not callable(advance):
                raise InputError(f"progress yields {advance!r}", expected=_EXPECTED)
            if not (_takes(advance, "") and _takes(advance, "", 1)):
                raise InputError("what progress yields does not take (what, parts=1)", expected=_EXPECTED)
            yield advance

    return opened


def _takes(function: Callable[..., object], *arguments: object) -> bool:
    """Whether a function can be called with these arguments; built-in ones, whose signature is unknown, pass."""
    try:
        known = signature(function)
    except (TypeError, ValueError):
        return True
    try:
        known.bind(*arguments)
    except TypeError:
        return False
    return True


#: What messages expect of a ``progress``.
_EXPECTED = "a function of a title and a number of parts: a contextlib.contextmanager that yields what each part calls"

Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")


def undisturbed(work: Callable[Parameters, Returned]) -> Callable[Parameters, Returned]:
    """Run ``work`` with one thread of linear algebra and numpy's usual handling of overflows, whatever the caller set.

    The matrices are small: threads cost more than they save, and sums in another order would make results depend on
    the number of cores. Weights that are too small for a number are 0, where the caller has ``np.seterr(all="raise")``
    too.
    """

    @wraps(work)
    def worked(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Returned:
        import numpy as np  # noqa: PLC0415 - commands that compute nothing load no numpy

        with _one_thread(), np.errstate(divide="warn", over="warn", under="ignore", invalid="warn"):
            return work(*args, **kwargs)

    return worked


_LOCK = Lock()
_LIMITS: list[threadpool_limits] = []  # the limit in force, once for each call that runs


@contextmanager
def _one_thread() -> Iterator[None]:
    """One thread of linear algebra in this process: the first of simultaneous calls sets the limit, the last lifts it.

    A limit of each call would outlast them all: the second would restore that of the first.
    """
    with _LOCK:
        _LIMITS.append(_LIMITS[0] if _LIMITS else threadpool_limits(limits=1))
    try:
        yield
    finally:
        with _LOCK:
            limits = _LIMITS.pop()
            if not _LIMITS:
                limits.restore_original_limits()
