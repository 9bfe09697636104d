"""Damping models from vibration tests: which law, how sure, how large at the design load.

``import damping as dp``: the names in ``__all__`` are the public interface; each is loaded at its first use.
"""

import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

#: Where each name of the interface lives.
_HOMES = {
    name: module
    for module, names in {
        "damping.api": ("check", "condition", "curve", "diagnose", "extrapolate", "rank", "regress", "sweep"),
        "damping.errors": ("AnalysisError", "InputError", "Refused"),
        "damping.infer.law": ("Law",),
        "damping.records.mode": ("Mode", "read_mode"),
        "damping.records.reading": ("read_record",),
        "damping.records.record": ("Record",),
    }.items()
    for name in names
}
__all__ = sorted(_HOMES)

# The matrices are small: threads of the linear algebra cost more than they save, and work is spread over records and
# laws instead. One thread also makes results independent of the number of cores. numpy reads these variables when it
# loads; where it is already loaded (a notebook), each public function limits the threads while it runs.
if "numpy" not in sys.modules:
    for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(_name, "1")


if TYPE_CHECKING:  # a type checker follows no __getattr__
    from damping.api import check as check
    from damping.api import condition as condition
    from damping.api import curve as curve
    from damping.api import diagnose as diagnose
    from damping.api import extrapolate as extrapolate
    from damping.api import rank as rank
    from damping.api import regress as regress
    from damping.api import sweep as sweep
    from damping.errors import AnalysisError as AnalysisError
    from damping.errors import InputError as InputError
    from damping.errors import Refused as Refused
    from damping.infer.law import Law as Law
    from damping.records.mode import Mode as Mode
    from damping.records.mode import read_mode as read_mode
    from damping.records.reading import read_record as read_record
    from damping.records.record import Record as Record
else:

    def __getattr__(name: str) -> Any:
        """Load a name of the public interface."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """The public interface, whichever parts of it are loaded."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__") and name.endswith("__"))})
