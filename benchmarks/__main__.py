"""Run every benchmark: ``python -m benchmarks``; each prints its lines."""

from __future__ import annotations

import importlib
from pathlib import Path


def main() -> None:
    """Run the benchmarks of this folder in order of name."""
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if not path.stem.startswith("_"):
            importlib.import_module(f"benchmarks.{path.stem}").main()


if __name__ == "__main__":
    main()
