"""Plausible corruption of right records: what is wrong is named and refused, what a laboratory does by right is not.

Each right record is drawn over laws, sizes, noise and spans (``audit_cases``), each corruption with a strength of its
own. The audit is judged over all draws; the commands are run on one record of each corruption that refuses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from audit_cases import Bench, clean, measured, record_of, right_benches

from damping.records import audit
from damping.records.check_units import UNIT_FACTORS
from damping.records.mode import Mode, describe_mode_to_toml
from damping_pipelines.store import write_text

Change = Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]
#: Records drawn for each corruption.
DRAWS = 5


def scaled(column: str) -> Change:
    """One quantity in another unit than the mode's."""

    def change(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        factor = rng.choice(sorted(UNIT_FACTORS.values())) ** rng.choice([-1.0, 1.0])
        return table.assign(**{column: table[column] * factor})

    return change


def times_ten(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """One reading in another gain range."""
    wild = table.copy()
    wild.loc[int(rng.integers(len(table))), "amplitude"] *= 10.0 ** rng.choice([-1.0, 1.0])
    return wild


def copied(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """A sweep twice, under a second label."""
    own = table[table["sweep"] == rng.choice(table["sweep"].unique())]
    return pd.concat([table, own.assign(sweep="again")], ignore_index=True)


def cut(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Every sweep stopped before its resonance, phases lost."""
    kept = [rows[rows["phase"] < rng.uniform(0.3, 0.9)] for _, rows in table.groupby("sweep", sort=False)]
    return pd.concat([rows for rows in kept if len(rows) > 3] or [table], ignore_index=True).drop(columns="phase")


def fallen(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Forces written in the wrong order of levels."""
    labels = list(table["sweep"].unique())
    force = dict(zip(labels, table.groupby("sweep", sort=False)["force"].first().to_numpy()[::-1], strict=True))
    return table.assign(force=table["sweep"].map(force))


def held(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """An instrument that holds its last value over five rows of a flank."""
    wrong, size = table.copy(), int((table["sweep"] == "A").sum())
    first = int(rng.integers(size // 5, size // 3))
    for name in ("amplitude", "phase"):
        wrong.loc[first : first + 4, name] = wrong.loc[first, name]
    return wrong


def pasted(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Six rows of one level entered again at other frequencies of another level."""
    wrong, size = table.copy(), int((table["sweep"] == "A").sum())
    first = int(rng.integers(size // 5, size // 3))
    readings = wrong.loc[first : first + 5, ["amplitude", "phase"]].to_numpy()
    wrong.loc[size + first + 2 : size + first + 7, ["amplitude", "phase"]] = readings
    return wrong


def one_level_in_rad(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The frequencies of one level in rad/s."""
    own = table["sweep"] == rng.choice(table["sweep"].unique())
    return table.assign(frequency=table["frequency"].where(~own, 2.0 * np.pi * table["frequency"]))


def mistyped(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The frequency of one row near resonance ten times too large, or a tenth off."""
    wrong, size = table.copy(), int((table["sweep"] == "A").sum())
    wrong.loc[int(rng.integers(size // 3, 2 * size // 3)), "frequency"] *= rng.choice([10.0, 1.1, 0.9])
    return wrong


def taken_again(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Every sweep ends with its largest row taken again, read within a thousandth of before."""
    tops = table.loc[table.groupby("sweep", sort=False)["amplitude"].idxmax()]
    tops = tops.assign(amplitude=tops["amplitude"] * (1.0 + 1e-3 * rng.standard_normal(len(tops))))
    return pd.concat([table, tops]).sort_values("sweep", kind="stable", ignore_index=True)


def run_again(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The first level run again at a force within a hundredth, every reading with two digits."""
    again = table[table["sweep"] == "A"].assign(sweep="again")
    again = again.assign(**{name: 1.004 * again[name] for name in ("force", "amplitude")})
    again["amplitude"] *= 1.0 + 3e-3 * rng.standard_normal(len(again))
    both = pd.concat([table, again], ignore_index=True)
    return both.assign(amplitude=[float(f"{value:.2g}") for value in both["amplitude"]], phase=both["phase"].round(2))


#: What goes wrong, by the check that is to name it, and whether it is to be refused.
WRONG: dict[str, tuple[str, bool, Change]] = {
    "amplitude in another unit": ("units", True, scaled("amplitude")),
    "force in another unit": ("units", True, scaled("force")),
    "frequency in rad/s": ("units", True, lambda t, _: t.assign(frequency=2.0 * np.pi * t["frequency"])),
    "exchanged": ("units", True, lambda t, _: t.rename(columns={"force": "amplitude", "amplitude": "force"})),
    "negated": ("phase-sign", True, lambda t, _: t.assign(phase=-t["phase"])),
    "half a turn off": ("phase-sign", True, lambda t, _: t.assign(phase=t["phase"] - np.pi)),
    "modulo pi": ("phase-sign", True, lambda t, _: t.assign(phase=np.arctan(np.tan(t["phase"])))),
    "a lead, modulo 2 pi": ("phase-sign", True, lambda t, _: t.assign(phase=np.mod(-t["phase"], 2.0 * np.pi))),
    "degrees, wrapped": ("phase-unit", True, lambda t, _: t.assign(phase=np.degrees(t["phase"]) % (2.0 * np.pi))),
    "turns": ("phase-unit", True, lambda t, _: t.assign(phase=t["phase"] / (2.0 * np.pi))),
    "a delay": ("phase-offset", False, lambda t, rng: t.assign(phase=t["phase"] + rng.uniform(0.12, 0.5))),
    "cut below": ("edge-of-sweep", True, cut),
    "levels exchanged": ("amplitude-falls", True, fallen),
    "ten times": ("outlier", False, times_ten),
    "a copy": ("repeated-sweep", False, copied),
    "readings held": ("repeated-sweep", False, held),
    "rows pasted": ("repeated-sweep", False, pasted),
    "one level in rad/s": ("units", True, one_level_in_rad),
    "a mistyped frequency": ("outlier", False, mistyped),
    "one label": ("mixed-levels", False, lambda t, _: t.assign(sweep="all").sort_values("frequency")),
}
#: What a laboratory may do with a right record.
RIGHT: dict[str, Change] = {
    "rows in any order": lambda t, rng: t.iloc[rng.permutation(len(t))],
    "columns in any order": lambda t, rng: t[rng.permutation(t.columns.to_numpy())],
    "other labels": lambda t, _: t.assign(sweep=t["sweep"].map(lambda label: f"Lauf {ord(label)}")),
    "downwards": lambda t, _: t.iloc[::-1],
    "every second row": lambda t, _: t.iloc[::2],
    "no phases": lambda t, _: t.drop(columns="phase"),
    "another column": lambda t, _: t.assign(temperature=21.0),
    "one level fewer": lambda t, _: t[t["sweep"] != t["sweep"].iloc[-1]],
    "a point taken again": taken_again,
    "a level run again": run_again,
    "two digits": lambda t, _: t.assign(
        amplitude=[float(f"{value:.2g}") for value in t["amplitude"]], phase=t["phase"].round(2)
    ),
    "five digits": lambda t, _: t.assign(amplitude=[float(f"{value:.5g}") for value in t["amplitude"]]),
}


@cache
def right(number: int) -> tuple[Bench, pd.DataFrame]:
    """A right record of three levels or four whose sweeps pass their resonance on both sides."""
    rng = np.random.default_rng(1000 + number)
    bench = right_benches(16, seed=number)[number % 7]
    bench = replace(bench, levels=3 + number % 2, rows=int(rng.choice([21, 41])), phase=True, bend=0.0)
    bench = replace(bench, span=(-6.0, 6.0), offset=0.0, noise=min(bench.noise, 0.02))
    return bench, measured(clean(bench), bench)


def draw(number: int) -> tuple[Bench, pd.DataFrame, np.random.Generator]:
    """A right record and the chance by which it is corrupted."""
    return *right(number), np.random.default_rng(number)


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named_and_refused_where_due(name):
    check, refuse, change = WRONG[name]
    missed = []
    for number in range(DRAWS):
        bench, table, rng = draw(number)
        found = audit(record_of(change(table, rng)), bench.mode)
        if check not in [finding.check for finding in found.findings] or (refuse and found.verdict != "refuse"):
            missed.append(f"{bench}: {found}")
    assert not missed


@pytest.mark.parametrize("name", RIGHT)
def test_what_is_done_by_right_is_neither_refused_nor_called_a_copy(name):
    refused = []
    for number in range(DRAWS):
        bench, table, rng = draw(number)
        found = audit(record_of(RIGHT[name](table, rng)), bench.mode)
        copied = any(finding.check == "repeated-sweep" or "departs" in finding.what for finding in found.findings)
        if found.verdict == "refuse" or copied:
            refused.append(f"{bench}: {found}")
    assert not refused


def test_levels_in_a_large_unit_of_length_are_no_copies():
    """Amplitudes of less than a nanometre, in metres."""
    table = draw(0)[1].drop(columns="phase")
    small = table.assign(amplitude=1e-9 * table["amplitude"] / table["amplitude"].max())
    assert "repeated-sweep" not in [finding.check for finding in audit(record_of(small)).findings]


def words(command: str, folder, record, mode) -> tuple[object, ...]:
    """A command on a record."""
    if command == "study":
        entry = f'[[records]]\nname = "r"\nrecord = "{record.name}"\nmode = "{mode.name}"\ndesign_forces = [8.0]\n'
        write_text(folder / "STUDY.toml", f'title = "t"\nseed = 1\n{entry}')
        return ("study", folder / "STUDY.toml", "--out", folder / "out")
    if command == "fleet":
        for path in (record, mode):
            write_text(folder / "cases" / f"case{path.suffix}", path.read_text())
        return ("fleet", folder / "cases", "--out", folder / "out", "--fast", "--workers", "0")
    return {
        "check": ("check", record, "--mode", mode),
        "rank": ("rank", record, "--mode", mode),
        "extrapolate": ("extrapolate", record, "--mode", mode, "--force", "8"),
        "gap": ("gap", mode, record, "--no-posterior"),
    }[command]


COMMANDS = ("rank", "extrapolate", "gap", "study", "fleet")


@pytest.mark.parametrize(("place", "name"), list(enumerate(WRONG)))
def test_every_command_refuses_what_is_refused(place, name, tmp_path, damping):
    """Before any work: nothing is written, and the check is named by ``check``, which cautions too, and by others."""
    check, refuse, change = WRONG[name]
    bench, table, rng = draw(1)
    record, mode = tmp_path / "record.csv", tmp_path / "mode.toml"
    write_text(record, change(table, rng).to_csv(index=False))
    write_text(mode, describe_mode_to_toml(bench.mode))
    for command in ("check", COMMANDS[place % len(COMMANDS)])[: 2 if refuse else 1]:
        run = damping(*words(command, tmp_path, record, mode))
        said = " ".join((run.out + run.err).split())
        assert run.code == refuse, f"{command}: {said}"
        assert f"{check} ({'refuse' if refuse else 'caution'})" in said, f"{command}: {said}"
        assert command in ("check", "fleet") or not (tmp_path / "out").exists()


def test_a_record_without_a_mode_is_refused_too():
    assert isinstance(draw(0)[0].mode, Mode)
    _, table, rng = draw(0)
    assert audit(record_of(WRONG["negated"][2](table, rng))).verdict == "refuse"
