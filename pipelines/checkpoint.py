"""Chains kept between blocks in emcee's HDF format, so that an interrupted run goes on where it was.

emcee's own backend writes at every step; here a file of the same layout is written after every block, whole or not at
all, and a run that goes on gives the same digits as one that was never interrupted.
"""

from __future__ import annotations

import io
from pathlib import Path

import emcee
import h5py
import numpy as np

from pipelines.store import make_folder, write_bytes
from selection.posterior.sampling import Checkpoint


def checkpoint_in(folder: Path, key: str) -> Checkpoint:
    """A checkpoint of the run ``key`` (a digest of everything its chains depend on) under ``folder``."""
    make_folder(folder)

    def path(ensemble: int) -> Path:
        return folder / f"{key}-{ensemble}.h5"

    return Checkpoint(
        load=lambda ensemble: load_chain(path(ensemble)),
        save=lambda ensemble, backend: save_chain(path(ensemble), backend),
    )


def load_chain(path: Path) -> emcee.backends.Backend | None:
    """The chain in a file as an in-memory backend that can grow, or None where there is no (readable) file."""
    if not path.exists():
        return None
    try:
        stored = emcee.backends.HDFBackend(str(path), read_only=True)
        chain, log_prob = stored.get_chain(), stored.get_log_prob()
        accepted, random_state = stored.accepted, stored.random_state
    except (OSError, KeyError, AttributeError):  # not a chain: sample again
        return None
    backend = emcee.backends.Backend()
    backend.reset(chain.shape[1], chain.shape[2])
    backend.chain, backend.log_prob, backend.iteration = chain, log_prob, len(chain)
    backend.accepted, backend.random_state = accepted, random_state
    return backend


def save_chain(path: Path, backend: emcee.backends.Backend) -> None:
    """Write the steps of an in-memory backend as a file that emcee's HDF backend reads.

    Raises:
        InputError: it cannot be written; the chain of the block before stays.
    """
    walkers, dimensions = backend.shape
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        group = file.create_group(emcee.backends.HDFBackend("").name)
        group["chain"] = backend.chain[: backend.iteration]
        group["log_prob"] = backend.log_prob[: backend.iteration]
        group["accepted"] = np.asarray(backend.accepted, dtype=float)
        group.attrs.update(
            version=emcee.__version__,
            nwalkers=walkers,
            ndim=dimensions,
            has_blobs=False,
            iteration=backend.iteration,
        )
        for i, part in enumerate(backend.random_state):
            group.attrs[f"random_state_{i}"] = part
    write_bytes(path, memory.getvalue())
