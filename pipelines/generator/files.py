"""Texts of the two files of a case."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipelines.generator.bench import Bench


def data_text(columns: Mapping[str, list[str]]) -> str:
    """CSV of columns of text."""
    lines = [",".join(columns), *(",".join(row) for row in zip(*columns.values(), strict=True))]
    return "\n".join(lines) + "\n"


def model_text(name: str, bench: Bench) -> str:
    """The simulation as given, its tolerances, and the scatter from sweep to sweep where it is declared."""
    nominal, (frequency, mass, viscous) = bench.nominal, bench.tolerance
    lines = [
        "[mode]",
        f'name = "{name}"',
        f"frequency = {nominal.omega / (2 * np.pi):.9g}   # Hz, undamped natural frequency",
        f"mass = {nominal.mass:.6g}",
        "",
        "[mode.tolerance]   # relative standard uncertainty of what the simulation assumes",
        f"frequency = {frequency:.3g}",
        f"mass = {mass:.3g}",
        f"viscous = {viscous:.3g}",
    ]
    if bench.scatter_declared:
        lines += [
            "",
            "[repeatability]   # relative, from sweep to sweep",
            f"amplitude = {bench.scatter[0]:.3g}",
            f"frequency = {bench.scatter[1]:.3g}",
        ]
    lines += ["", "[damping]", f"viscous = {nominal.viscous:.6g}"]
    lines += [f"{force} = {coefficient:.6g}" for force, coefficient in bench.base]
    return "\n".join(lines) + "\n"
