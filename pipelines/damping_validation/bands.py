"""Page of design-load bands on real structures: predictions, goals, higher levels left out, figures with citations."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from damping.errors import InputError
from damping.extrapolation import extrapolate_loads, leave_higher_levels_out
from damping.extrapolation.near import near_resonance
from damping.extrapolation.plan import Plan
from damping.extrapolation.prediction import PARTS, Loads
from damping.plots import describe_with_unit
from damping.records.mode import Mode, read_mode
from damping.records.reading import read_record
from damping.records.record import record_to_csv
from damping.records.text import read_bytes
from damping_pipelines.cli_files import MAX_SIZE
from damping_pipelines.manifest import digest, publish, sole_writer, versions
from damping_pipelines.terminal import progress
from damping_validation.calibration_plots import real_bands

LEVEL = 0.9
#: Largest high/low wanted at a ratio of force to the largest tested one.
GOALS = {1.5: 1.35, 4.0: 1.8}
RATIOS = (1.5, 2.0, 4.0)
#: Folder of a known record: the structure, and what its figures and numbers are derived from.
CITATIONS = {
    "brake-reuss-beam": (
        "Brake-Reuss beam, bolted lap joint",
        "W. Chen et al., Mech. Syst. Signal Process. 166 (2022) 108401; M. Jin et al., ibid. 108402; records "
        "mattiacenedese/BRBtesting, GPL-3.0",
    ),
    "eth-beam": (
        "Micro-beam in partial vacuum",
        "T. Brack et al., Nat. Phys. 18 (2022) 952; records haller-group/SSMLearn, AGPL-3.0",
    ),
    "sloshing-tank": (
        "Sloshing tank",
        "B. Baeuerlein & K. Avila, J. Fluid Mech. 925 (2021) A22; records haller-group/SSMLearn, AGPL-3.0",
    ),
}
#: Records whose law changes at the top of the test.
WARNED = ("sloshing-tank",)
#: Forces at which a band is drawn.
_GRID = 40
#: Dots per inch of the figure.
_DPI = 130


@dataclass(frozen=True)
class BandResult:
    """One structure: what was predicted, on a grid and at ``RATIOS``, and the check with levels left out."""

    name: str
    mode: Mode
    plan: Plan
    grid: Loads
    at: Loads
    left_out: pd.DataFrame


def bands_page(folder: Path, out: Path, seed: int) -> None:
    """Predict for every ``NAME/record.csv`` with ``NAME/mode.toml`` under ``folder``; write page, tables and figures.

    Nothing of a record is copied: only predictions, resonances derived from it and figures are written.

    Raises:
        InputError: no such records, or a bad one.
    """
    names = sorted(path.parent.name for path in folder.glob("*/record.csv"))
    if not names:
        raise InputError("no records", file=folder, expected="folders with record.csv and mode.toml")
    outputs = [f"{name}{ending}" for name in names for ending in (".png", ".csv", "-left-out.csv")]
    read = [f"{name}/{file}" for name in names for file in ("record.csv", "mode.toml")]
    inputs = {name: digest(read_bytes(folder / name, MAX_SIZE)) for name in read}
    with sole_writer(out, ["README.md", *outputs]):
        files: dict[str, bytes] = {}
        results = [result(folder / name, seed) for name in names]
        for one in results:
            files[f"{one.name}.png"] = figure(one)
            files[f"{one.name}.csv"] = record_to_csv(tabulate_loads(one.at)).encode()
            files[f"{one.name}-left-out.csv"] = record_to_csv(one.left_out).encode()
        files["README.md"] = render_page(results, seed).encode()
        publish(out, files, seed=seed, versions=versions(), inputs=inputs)
    print(f"{out / 'README.md'} written")


def result(folder: Path, seed: int) -> BandResult:
    """Everything of one structure."""
    record, mode = read_record(folder / "record.csv"), read_mode(folder / "mode.toml")
    data = near_resonance(record)
    largest = data.tested_force.max()
    predicted = extrapolate_loads(data, largest * np.array(RATIOS), LEVEL, seed, mode=mode, progress=progress)
    forces = np.geomspace(data.tested_force.min(), 1.1 * RATIOS[-1] * largest, _GRID)
    return BandResult(
        name=folder.name,
        mode=mode,
        plan=predicted.plan,
        grid=predicted.predict_at(forces),
        at=predicted.loads,
        left_out=leave_higher_levels_out(data, LEVEL, seed, mode),
    )


def tabulate_loads(loads: Loads) -> pd.DataFrame:
    """One row per force: band, linear prediction, parts in per cent, cautions."""
    band = loads.average
    return pd.DataFrame(
        {
            "force": loads.force,
            "ratio": loads.ratio,
            "median": band.median,
            "low": band.low,
            "high": band.high,
            "credible_low": band.credible_low,
            "credible_high": band.credible_high,
            "linear": loads.linear,
            "linear_over_percent": loads.overprediction,
            "linear_over_percent_low": loads.overprediction_low,
            "linear_over_percent_high": loads.overprediction_high,
            **loads.parts,
            "cautions": ["; ".join(caution) for caution in loads.cautions],
        }
    )


def figure(band: BandResult) -> bytes:
    """The figure of one structure as PNG."""
    data, units = band.plan.data, band.mode.units
    tested = pd.DataFrame({"sweep": data.sweeps, "force": data.tested_force, "amplitude": data.tested_amplitude})
    drawn = real_bands(
        tabulate_loads(band.grid),
        tested,
        band.left_out,
        describe_with_unit("force at resonance", units.force),
        describe_with_unit("resonant amplitude", units.length),
    )
    buffer = io.BytesIO()
    drawn.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
    return buffer.getvalue()


def render_page(results: list[BandResult], seed: int) -> str:
    """The page in Markdown."""
    goals = [row for one in results for row in _list_goals(one)]
    checks = pd.concat([one.left_out for one in results], ignore_index=True)
    given = checks[~checks["refused"]]
    head = _HEAD.format(
        seed=seed,
        goals="\n".join(goals),
        hits=int(given["inside"].sum()),
        given=len(given),
        refused=int(checks["refused"].sum()),
        worst=checks["linear_over_percent"].max(),
        medians=_describe_medians(given),
    )
    return head + "\n".join(_describe_section(one) for one in results)


_HEAD = """# Design-load bands on real structures

By `damping bands FOLDER --out DIR --seed {seed}`, FOLDER holding the records (`NAME/record.csv`, `NAME/mode.toml`). The
records are not part of the project; what stands here is derived from them.

| goal | measured | met |
|---|---|---|
{goals}

Within the records, every level with two or more below it was predicted from those below alone, with nothing of the
higher ones in the choice of laws, weights or discrepancy: the 90 % band holds {hits} of {given} resonances, and
{refused} predictions were refused (two levels are no test beyond 1.5 times). The median errs by {medians}; the goal
is 10 %. Linear damping from the same levels overpredicts by up to {worst:.0f} %. The predictions share
levels, so they are fewer checks than they seem.
"""


def _describe_medians(given: pd.DataFrame) -> str:
    """Errors of the medians, by number of levels below."""
    error = 100.0 * (given["median"] / given["measured"] - 1.0)
    parts = [
        f"{', '.join(f'{value:+.0f}' for value in rows)} % from {levels} levels"
        for levels, rows in error.groupby(given["levels"])
    ]
    return "; ".join(parts)


def _list_goals(band: BandResult) -> list[str]:
    """Widths beside the goals; a warning where one is wanted."""
    if band.name in WARNED:
        caution, refused = band.at.cautions[-1][0], bool(np.isnan(band.at.average.median).all())
        measured = caution if refused else f"a band, and before it: {caution}"
        return [f"| {_title(band)}: a warning rather than a confident band | {measured} | {_describe_yes(refused)} |"]
    rows = []
    for ratio, most in GOALS.items():
        i = RATIOS.index(ratio)
        width = band.at.average.high[i] / band.at.average.low[i]
        measured = f"{width:.2f}" if np.isfinite(width) else f"refused: {band.at.cautions[i][0]}"
        goal = f"{_title(band)}: high/low at {ratio:g} times the tested force at most {most:g}"
        rows.append(f"| {goal} | {measured} | {_describe_yes(bool(width <= most))} |")
    return rows


def _describe_yes(met: bool) -> str:
    return "yes" if met else "no"


def _describe_section(band: BandResult) -> str:
    """One structure: figure, table, what was left out, citation."""
    units, plan = band.mode.units, band.plan
    force, length = (f" ({unit})" if unit else "" for unit in (units.force, units.length))
    exponents = ", ".join(f"{p:.2f} ± {sd:.2f}" for p, sd in zip(plan.trend.p, plan.trend.sd, strict=True))
    laws = ", ".join(f"{law.name} {law.weight:.2f}" for law in plan.laws)
    said = dict.fromkeys(c for cautions in band.at.cautions for c in cautions)
    lines = [
        f"\n## {_title(band)}\n",
        f"![Bands of {band.name}]({band.name}.png)\n",
        f"| force{force} | times tested | median{length} | 90 % band | high/low | linear over by % |"
        + "".join(f" {name.replace('_', ' ')} % |" for name in PARTS),
        "|" + "---|" * (6 + len(PARTS)),
        *(_describe_row(band.at, i) for i in range(len(RATIOS))),
        f"\nLaws by weight: {laws}. Local exponent p from level to level: {exponents}.\n",
        *(f"- {caution}" for caution in said),
        f"\nDerived from: {CITATIONS[band.name][1]}." if band.name in CITATIONS else "",
    ]
    return "\n".join(lines) + "\n"


def _describe_row(loads: Loads, i: int) -> str:
    band = loads.average
    if not np.isfinite(band.median[i]):
        return f"| {loads.force[i]:.3g} | {loads.ratio[i]:g} |" + " refused |" + " |" * (3 + len(PARTS))
    low, high = loads.overprediction_low[i], loads.overprediction_high[i]
    return (
        f"| {loads.force[i]:.3g} | {loads.ratio[i]:g} | {band.median[i]:.3g} | {band.low[i]:.3g} to {band.high[i]:.3g} "
        f"| {band.high[i] / band.low[i]:.2f} | {loads.overprediction[i]:.0f} ({low:.0f} to {high:.0f}) |"
        + "".join(f" {loads.parts[name][i]:.1f} |" for name in PARTS)
    )


def _title(band: BandResult) -> str:
    return CITATIONS[band.name][0] if band.name in CITATIONS else band.mode.name
