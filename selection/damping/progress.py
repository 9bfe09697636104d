"""Progress reports of long computations, and one thread of linear algebra while they run."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import wraps
from inspect import signature
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


def single_threaded(work: Callable[Parameters, Returned]) -> Callable[Parameters, Returned]:
    """Limit the linear algebra to one thread while ``work`` runs, also where numpy was loaded before this library.

    The matrices are small: threads cost more than they save, and sums in another order would make results depend on
    the number of cores.
    """

    @wraps(work)
    def worked(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Returned:
        with threadpool_limits(limits=1):
            return work(*args, **kwargs)

    return worked
