"""The tables of the report, as printed, corrected, and as used by its own computation; records and modes made of them.

Source: R. R. Reed, *Determination of Modal Damping for Launch Vehicles Using Experimental Data*, NASA contract
NAS8-21110. The files and the meaning of every column are described in ``data/saturn-v/README.md``.

The files ``data/saturn-v/records/NAME.csv`` and ``data/saturn-v/modes/NAME.toml`` are the texts returned here; a test
compares them. Units are lb, in, s.
"""

from __future__ import annotations

from functools import lru_cache
from math import cos, pi, radians
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping_pipelines.exhibits import shipped_folder

Version = Literal["printed", "corrected", "used"]
Run = Literal["E3", "E4"]

TABLE_NAMES = (
    "2_I", "2_II", "3_I", "3_II", "3_III", "3_IV", "4_I", "4_II", "4_III", "4_IV", "4_V",
    "5_I", "5_II", "5_III", "5_IV",
)  # fmt: skip


def data_folder() -> Path:
    """Folder with ``saturn-v``: the packaged copy where there is one, else the repository's.

    Raises:
        InputError: neither exists (an incomplete installation).
    """
    return shipped_folder(Path(__file__).resolve().parent, "saturn-v").parent


def load_table(name: str, version: Version = "printed", run: Run = "E4") -> pd.DataFrame:
    """One table of the report; columns carry their units in their names.

    Args:
        name: ``"3_I"``, ``"3.I"`` or ``"table_3_I"``; see ``TABLE_NAMES``.
        version: ``"printed"``: every digit as printed. ``"corrected"``: cells that are wrong replaced.
            ``"used"``: what the report's own computation used: where that is known to differ from the print it is
            taken (Table 5.III and 5.IV: the recovered inputs), else the corrected cell, else the printed one.
        run: of Table 5.IV as used, the inputs of the two-term run ``"E3"`` (Eq. 5.3.14) or of the one-term runs
            ``"E4"`` (Eq. 5.3.15 and the viscous one of section 5.3): the report changed one energy between them.

    Raises:
        InputError: unknown name, version or run; the message lists the choices.
    """
    key = _choose(name.removeprefix("table_").replace(".", "_"), TABLE_NAMES, "table of the report")
    _choose(version, get_args(Version), "version of a table")
    _choose(run, get_args(Run), "run of Table 5.IV")
    return _load(key, version, run).copy()


@lru_cache
def _load(key: str, version: Version, run: Run) -> pd.DataFrame:
    """A table, read once."""
    table = _read(f"tables/table_{key}.csv")
    if version != "printed":
        table = _tabulate_corrected(table, key, version, run)
    return _tabulate_numeric(table)


def load_corrections() -> pd.DataFrame:
    """Cells that are wrong or that the report did not use as printed; all columns are text as written."""
    return _read("corrections.csv")


def load_errata() -> pd.DataFrame:
    """Misprints, misreadings and derivation errors: ``id, severity, kind, where, as_printed, should_be, proof``.

    ``severity`` is A where results change, B where numbers change, C for minor ones.
    """
    return _read("errata.csv")


def load_printed_results() -> pd.DataFrame:
    """Every printed result that can be recomputed: ``id, where, printed`` (text), ``erratum, reason, recipe``."""
    return _read("printed_results.csv")


def load_force_laws() -> pd.DataFrame:
    """Damping forces summarised in section 6.1, one row a term, coefficients as printed (lb, in, s)."""
    return _tabulate_numeric(_read("tables/section_6_1.csv"), text=("equation",))


def load_recovered_inputs(name: str) -> pd.DataFrame:
    """Inputs of Table ``"5_III"`` or ``"5_IV"`` recovered from the table's own fitted values and deviations.

    Raises:
        InputError: there is no such file for the table; the message lists the choices.
    """
    key = _choose(name.replace(".", "_"), ("5_III", "5_IV"), "table with recovered inputs")
    return _tabulate_numeric(_read(f"table_{key}_recovered_inputs.csv"))


def _read(path: str) -> pd.DataFrame:
    """A CSV of the Saturn V folder, every cell as the text that is there (empty where nothing is)."""
    return pd.read_csv(data_folder() / "saturn-v" / path, dtype=str, keep_default_na=False)


def _tabulate_numeric(table: pd.DataFrame, text: tuple[str, ...] = ()) -> pd.DataFrame:
    """Turn the columns that hold only numbers and blanks into floats or integers (blank: NaN)."""
    return table.apply(lambda column: column if column.name in text else _convert_column(column))


def _convert_column(column: pd.Series) -> pd.Series:
    filled = column.where(column != "")
    numbers = pd.to_numeric(filled, errors="coerce")
    return numbers if filled.notna().any() and numbers.notna().equals(filled.notna()) else column


def _tabulate_corrected(table: pd.DataFrame, name: str, version: Version, run: Run) -> pd.DataFrame:
    """Copy of a table (as text) with its corrections applied."""
    table = table.copy()
    corrections = load_corrections()
    for row in corrections[corrections["table"] == name].to_dict("records"):
        used = row["used_by_report"] if version == "used" and row["run"] in ("", run) else ""
        value = used or row["corrected"]
        if value:
            table.loc[_find_rows(table, row["key_columns"], row["key"]), row["column"]] = value
    return table


def _find_rows(table: pd.DataFrame, key_columns: str, key: str) -> pd.Series:
    """True in the row whose key columns (``a|b``) hold the key (``1|A``)."""
    parts = zip(key_columns.split("|"), key.split("|"), strict=True)
    matching = pd.Series(True, index=table.index)
    for column, value in parts:
        matching &= table[column] == value
    return matching


def _choose(value: str, choices: tuple[str, ...], what: str) -> str:
    if value not in choices:
        raise InputError(f"unknown {what} '{value}'", expected=f"one of {', '.join(choices)}")
    return value


def columns(table: pd.DataFrame, *names: str) -> tuple[FloatArray, ...]:
    """The named columns as arrays of floats."""
    return tuple(table[name].to_numpy(dtype=float) for name in names)


def by_point(name: str, values: npt.ArrayLike) -> dict[str, float]:
    """``{name[1]: first value, name[2]: second, ...}``."""
    return {f"{name}[{k}]": float(value) for k, value in enumerate(np.asarray(values), start=1)}


#: Tail displacement at unit modal displacement of the second mode (Eq. 3.2.16).
PHI_T2 = 0.041
#: Angle of the principal planes, rad (Eq. 3.2.16).
THETA = radians(28.0)

RECORD_NAMES = ("config-1-mode-2-rough", "config-1-mode-2-pitch", "config-2-mode-1", "config-2-mode-2")


def record_text(name: str) -> str:
    """The record ``name`` as CSV text.

    Raises:
        InputError: unknown name; the message lists the choices.
    """
    return report_record(name).to_csv(index=False, float_format="%.10g", lineterminator="\n")


def report_record(name: str) -> pd.DataFrame:
    """The record ``name`` as a table: one row a measured steady state (force lb, frequency Hz, amplitude in).

    Raises:
        InputError: unknown name; the message lists the choices.
    """
    _choose(name, RECORD_NAMES, "record")
    match name:
        case "config-1-mode-2-rough":
            return tabulate_configuration_1_rough()
        case "config-1-mode-2-pitch":
            return tabulate_configuration_1_pitch()
    return tabulate_configuration_2(int(name[-1]))


def tabulate_configuration_1_rough() -> pd.DataFrame:
    """Configuration I, second mode, tail motion over the mode factor (Eq. 5.3.4), nothing else removed.

    Amplitude X_t/phi_t2 (Table 3.I), modal force phi_t2 F (Eq. 2.2.3), frequency omega/(2 pi), phase of the tail
    (Table 3.III, corrected), energy as printed in Table 3.IV (not the rows that the report marks as corrected).
    """
    motion, phase, energy = load_table("3_I"), load_table("3_III", "corrected"), load_table("3_IV")
    energy = energy[energy["corrected_row"] == 0].reset_index(drop=True)
    return pd.DataFrame(
        {
            "sweep": "I",
            "force": PHI_T2 * motion["force_lb"],
            "frequency": motion["omega_rad_s"] / (2 * pi),
            "amplitude": motion["tail_pitch_disp_in_e2"] / 100 / PHI_T2,
            "phase": phase["tail_phase_rad"],
            "energy": energy["energy_input_in_lb"],
            "point": motion["point"],
        }
    )


def tabulate_configuration_1_pitch() -> pd.DataFrame:
    """Configuration I, second mode, motion in the principal pitch plane as Table 3.IV gives it.

    Amplitude A_2p and pitch energy of Table 3.IV with its corrected rows 6+ and 9+ (as chapter V uses them), force
    phi_t2 F cos(theta) (Eq. 3.2.4). Amplitude and energy were computed in the report with a linear damping factor
    chosen point by point, so they are no independent evidence of the damping law. There is no phase: none was
    measured in this plane, and the one that the energy balance implies repeats the energy.
    """
    motion, planes = load_table("3_I"), load_table("3_IV")
    planes = planes[~planes["point"].isin(["6", "9"])].reset_index(drop=True)
    return pd.DataFrame(
        {
            "sweep": "I",
            "force": PHI_T2 * motion["force_lb"] * cos(THETA),
            "frequency": planes["omega_rad_s"] / (2 * pi),
            "amplitude": planes["A2p_in"],
            "energy": planes["energy_pitch_in_lb"],
            "point": planes["point"],
        }
    )


def tabulate_configuration_2(mode: int) -> pd.DataFrame:
    """Configuration II, first or second mode: the resonance of each of the three sweeps (phase resonance).

    Force, frequency and generalized mass of Table 4.I (force of mode 2, sweep A corrected, erratum E4I-1), amplitude
    of Table 4.II.
    """
    sweeps = load_table("4_I", "corrected").merge(load_table("4_II"), on=["mode", "sweep"], validate="1:1")
    sweeps = sweeps[sweeps["mode"] == mode]
    return pd.DataFrame(
        {
            "sweep": sweeps["sweep"],
            "force": sweeps["modal_force_lb"],
            "frequency": sweeps["modal_frequency_hz"],
            "amplitude": sweeps["Am_in"],
            "mass": sweeps["generalized_mass_lb_s2_per_in"],
        }
    )


def describe_mode_text(name: str) -> str:
    """The mode (simulated model) of the record ``name`` as TOML text.

    Raises:
        InputError: unknown name; the message lists the choices.
    """
    _choose(name, RECORD_NAMES, "record")
    if name.startswith("config-1"):
        return _describe_configuration_1_mode(pitch=name.endswith("pitch"))
    return _describe_configuration_2_mode(int(name[-1]))


def _describe_configuration_1_mode(pitch: bool) -> str:
    omega = 11.40 if pitch else load_table("3_II").query("mode == 2")["modal_omega_rad_s"].mean()
    return _mode_template().format(
        source="Saturn V, Configuration I (time point 2), second mode, pitch test",
        name="Saturn V Configuration I, second mode" + (", principal pitch plane" if pitch else ""),
        frequency=omega / (2 * pi),
        frequency_source=f"{omega:.2f} rad/s, " + ("Eq. 3.1.36" if pitch else "Table 3.II"),
        mass=21.0,
        mass_source="Table 3.II",
        why="One sweep: frequency read to 0.01 rad/s (0.001); mass 0.02 as nothing says more; viscous: the standard\n"
        "# error of the mean of the 15 damping factors of Table 3.IV is 12 per cent of the mean.",
        tolerances=(0.001, 0.02, 0.12),
        viscous="2.30",
        viscous_source="Eq. 3.2.19",
    )


def _describe_configuration_2_mode(mode: int) -> str:
    sweeps = load_table("4_I").query("mode == @mode")
    damping = load_table("4_II").query("mode == @mode")["C1_lb_s_per_in"]
    frequency, mass = sweeps["modal_frequency_hz"], sweeps["generalized_mass_lb_s2_per_in"]
    return _mode_template().format(
        source=f"Saturn V, Configuration II (time point 11), {('first', 'second')[mode - 1]} mode, yaw tests",
        name=f"Saturn V Configuration II, {('first', 'second')[mode - 1]} mode",
        frequency=frequency.mean(),
        frequency_source="mean of the three sweeps, Table 4.I",
        mass=mass.mean(),
        mass_source="mean of the three sweeps, Table 4.I",
        why="Relative standard deviation of one sweep about the mean of the three (Tables 4.I, 4.II): what the value\n"
        "# of one more sweep may differ by. It holds the drift with level too, because a linear model knows none.",
        tolerances=tuple(f"{_spread(column):.2g}" for column in (frequency, mass, damping)),
        viscous=f"{damping.mean():.3f}",
        viscous_source="mean of the three sweeps, Eq. 4.1.8",
    )


def _mode_template() -> str:
    """The text of a mode's file, with places for its numbers and where they are from."""
    return (Path(__file__).parent / "mode.txt").read_text("utf-8")


def _spread(column: pd.Series) -> float:
    return float(column.std(ddof=1) / column.mean())
