"""Records and modes of ``data/saturn-v``, made of the tables of the report: the texts of those files."""

from __future__ import annotations

from math import cos, pi, radians
from pathlib import Path

import pandas as pd

from damping_reed1970 import load_table

#: Tail displacement at unit modal displacement of the second mode (Eq. 3.2.16).
PHI_T2 = 0.041
#: Angle of the principal planes, rad (Eq. 3.2.16).
THETA = radians(28.0)

RECORD_NAMES = ("config-1-mode-2-rough", "config-1-mode-2-pitch", "config-2-mode-1", "config-2-mode-2")


def record_text(name: str) -> str:
    """The record ``name`` as CSV text."""
    return report_record(name).to_csv(index=False, float_format="%.10g", lineterminator="\n")


def report_record(name: str) -> pd.DataFrame:
    """The record ``name`` as a table: one row a measured steady state (force lb, frequency Hz, amplitude in)."""
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
    """The mode (simulated model) of the record ``name`` as TOML text."""
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
