"""Damping models from vibration tests: which law, how sure, how large at the design load."""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

#: What ``from damping import ...`` gives, and where it lives: loaded when asked for, since it takes a second.
_SHORTCUTS = {
    "read_record": "damping.records.reading",
    "read_mode": "damping.records.mode",
    "InputError": "damping.errors",
    "Refused": "damping.errors",
    "check": "damping.api",
    "rank": "damping.api",
    "extrapolate": "damping.api",
}


def __getattr__(name: str) -> Any:
    """One of the shortcuts, loaded now."""
    if name not in _SHORTCUTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_SHORTCUTS[name]), name)
