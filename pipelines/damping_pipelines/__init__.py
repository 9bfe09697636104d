"""Settings, files, progress and the command line; everything that computes is in ``damping``."""

import damping  # noqa: F401 - before numpy: it keeps the linear algebra to one thread
