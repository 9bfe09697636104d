"""Settings, files, progress and the command line; everything that computes is in ``damping``."""

from contextvars import ContextVar

import damping  # noqa: F401 - before numpy: it keeps the linear algebra to one thread

#: Whether progress is kept to oneself: ``damping --quiet``.
QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
