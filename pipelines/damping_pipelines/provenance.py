"""What a result depends on beside its inputs: versions of packages, and the source of this one."""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from damping import __version__

#: Packages whose numbers results rest on.
PACKAGES = ("numpy", "scipy", "pandas", "statsmodels", "emcee", "arviz", "matplotlib")
#: The houses of the project: a result may depend on any module of them.
HOUSES = ("damping", "damping_pipelines", "damping_reed1970", "damping_validation")


def versions() -> dict[str, str]:
    """Versions a result depends on, as shown beside it."""
    found = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"damping-selection": __version__, "Python": platform.python_version(), **found}


@cache
def digest_source() -> str:
    """SHA-256 of every module of the project, as this process found them when it asked first."""
    found = hashlib.sha256()
    for house in HOUSES:
        spec = find_spec(house)
        for folder in map(Path, spec.submodule_search_locations or ()) if spec else ():
            for path in sorted(folder.rglob("*.py")):
                content = path.read_bytes()
                found.update(f"{house}/{path.relative_to(folder).as_posix()} {len(content)}\n".encode() + content)
    return found.hexdigest()


def describe_code() -> dict[str, str]:
    """Versions and the digest of the source: two processes that agree in it compute the same results."""
    return {**versions(), "source": digest_source()}


def digest_code() -> str:
    """SHA-256 of :func:`describe_code`, which is in the key of every result."""
    return hashlib.sha256(repr(sorted(describe_code().items())).encode()).hexdigest()
