"""Settings, files, progress and the command line; everything that computes is in ``damping``."""

import os
from contextvars import ContextVar

# The matrices here are small: threads of the linear algebra cost more than they give, and work is spread over records
# and laws instead. One thread also makes results independent of the number of cores.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

#: Whether progress is kept to oneself: ``damping --quiet``.
QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
