"""Commands of the validation: options in, one stage function called; each imports what it needs when it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from damping_pipelines.cli_files import DEFAULT_SEED, MOST_PROCESSES, Seed


def blind(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where results go.")] = Path("results/blind"),
    cases: Annotated[int, typer.Option("--cases", max=100_000, help="Number of cases.")] = 2000,
    seed: Annotated[int | None, typer.Option("--seed", help="Seed; without it the one kept for blind cases.")] = None,
    jobs: Annotated[int | None, typer.Option("--jobs", min=1, max=MOST_PROCESSES, help="Processes.")] = None,
    follow: Annotated[bool, typer.Option("--next", help="Make every test that is proposed, diagnose again.")] = False,
) -> None:
    """Check the diagnosis on generated data whose effect is withheld."""
    from damping_validation.blind import blind as run

    run(out, cases, seed, jobs, follow)


def bands(
    records: Annotated[Path, typer.Argument(metavar="FOLDER", help="NAME/record.csv with NAME/mode.toml.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where results go.")],
    seed: Seed = DEFAULT_SEED,
) -> None:
    """Page of design-load bands on the records of a folder, with higher levels left out as a check."""
    from damping_validation.bands import bands_page as run

    run(records, out, seed)


def calibrate(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where results go.")],
    quick: Annotated[bool, typer.Option("--quick", help="A tenth of the trials, to try it.")] = False,
    seed: Seed = DEFAULT_SEED,
    jobs: Annotated[int | None, typer.Option("--jobs", min=1, max=MOST_PROCESSES, help="Processes.")] = None,
) -> None:
    """Check on known structures that bands and posteriors hold what they say."""
    from damping_validation.calibrate import calibrate as run

    run(out, quick, seed, jobs)


COMMANDS = {"blind": blind, "bands": bands, "calibrate": calibrate}
