"""Progress reports of long computations, and one thread of linear algebra while they run."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import wraps
from typing import ParamSpec, Protocol, TypeVar

from threadpoolctl import threadpool_limits

from damping.errors import InputError


class Advance(Protocol):
    """Call it when a part is done."""

    def __call__(self, what: str, parts: int = 1) -> None:
        """Say that ``parts`` more are done; ``what`` names the last."""


#: Shows how far work is: of a title and a number of parts a context, whose value is called with each part done.
Progress = Callable[[str, int], AbstractContextManager[Advance]]


@contextmanager
def silent(title: str, total: int) -> Iterator[Advance]:
    """Progress that nobody sees."""
    yield lambda what, parts=1: None


def watch(progress: object) -> Progress:
    """A user's ``progress``; InputError where it is no function, or once it gives nothing that a ``with`` opens."""
    if not callable(progress):
        raise InputError(f"progress is of type {type(progress).__name__}", expected=_EXPECTED)

    @contextmanager
    def opened(title: str, total: int) -> Iterator[Advance]:
        context = progress(title, total)
        if not isinstance(context, AbstractContextManager):
            raise InputError(f"progress returned {context!r}", expected=_EXPECTED)
        with context as advance:
            if not callable(advance):
                raise InputError(f"progress yields {advance!r}", expected=_EXPECTED)
            yield advance

    return opened


#: What shows progress.
_EXPECTED = "a function of a title and a number of parts: a contextlib.contextmanager that yields what each part calls"

Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")


def single_threaded(work: Callable[Parameters, Returned]) -> Callable[Parameters, Returned]:
    """A function during which the linear algebra keeps to one thread, also where numpy was loaded before this library.

    The matrices here are small: threads cost more than they give, and sums in another order would make results depend
    on the number of cores.
    """

    @wraps(work)
    def worked(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Returned:
        with threadpool_limits(limits=1):
            return work(*args, **kwargs)

    return worked
