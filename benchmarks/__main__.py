"""Run benchmarks and write their tables: ``python -m benchmarks [--out DIR] [NAME ...]``, by default all of ``SPEED``.

Each one writes its own table; the page is made of all tables that are there. (The other modules of this folder are
programs of their own.)
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy starts its threads: ours and peers have one each

SPEED = ("commands", "subsets", "best_subset", "steady_states", "posterior", "cost", "gap_cases")


def main() -> None:
    """Measure, write a table each, then the page with its figure."""
    from benchmarks import _page  # noqa: PLC0415 - after the threads are set

    options = argparse.ArgumentParser(prog="python -m benchmarks")
    options.add_argument("--out", type=Path, default=Path("results/benchmarks"))
    options.add_argument(
        "--page", action="store_true", help="make the page of the tables that are there, measure nothing"
    )
    options.add_argument("--guard", action="store_true", help="fail where a command is 1.5 times slower than it was")
    options.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SPEED))
    chosen = options.parse_args()
    if chosen.guard:
        from benchmarks import commands  # noqa: PLC0415 - as above

        raise SystemExit(0 if commands.guard() else 1)
    chosen.out.mkdir(parents=True, exist_ok=True)
    names = [] if chosen.page else chosen.names or SPEED
    start = perf_counter()
    for number, name in enumerate(names, start=1):
        print(f"[{perf_counter() - start:4.0f} s] {number}/{len(names)} {name}", file=sys.stderr, flush=True)
        found = importlib.import_module(f"benchmarks.{name}").measure()
        if name == "cost":
            table = _page.cost_table(found)
        else:
            table = _page.rows_table(found)
            for row in found:
                print(*asdict(row).values(), row.ratio, row.met, sep=" | ", flush=True)
        table.to_csv(chosen.out / f"{name}.csv", index=False, float_format="%.6g")
    _page.write(chosen.out, SPEED)
    print(f"{chosen.out / 'README.md'} written")


if __name__ == "__main__":
    main()
