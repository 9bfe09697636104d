"""Two gaps whose cause is known from the report: planar coupling of Configuration I, damping of Configuration II."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from selection.gap.diagnose import Diagnosis, diagnose
from selection.records.mode import Mode, Tolerance, Units
from selection.records.record import Record
from selection.records.report_records import PHI_T2, report_record
from selection.records.report_tables import load_table
from selection.units import RAD_S_PER_HZ


@dataclass(frozen=True)
class Gaps:
    """Both diagnoses."""

    configuration_1: Diagnosis
    configuration_2: Diagnosis


def historic_gaps() -> Gaps:
    """Both gaps diagnosed from their tables alone."""
    return Gaps(configuration_1(), configuration_2())


_UNITS = Units(force="lb", length="in", time="s")


def configuration_1() -> Diagnosis:
    """Second mode of Configuration I as Table 3.III gives it against one plane with viscous damping.

    Amplitude and phase of the mode (Table 3.III), modal force phi_t2 F and frequency (Table 3.I); simulation of Table
    3.II with the average damping of Eq. 3.2.18 (xi = 0.005), whose 15 values scatter by 12 per cent of their mean.
    """
    motion, modal = load_table("3_I"), load_table("3_III", "corrected")
    table = pd.DataFrame(
        {
            "sweep": "I",
            "force": PHI_T2 * motion["force_lb"],
            "frequency": motion["omega_rad_s"] / RAD_S_PER_HZ,
            "amplitude": modal["modal_amplitude_A2_in"],
            "phase": modal["modal_phase_rad"],
        }
    )
    mode = Mode(
        name="Configuration I, second mode, one plane",
        frequency=11.39 / RAD_S_PER_HZ,
        mass=21.0,
        tolerance=Tolerance(frequency=0.001, mass=0.02, viscous=0.12),
        units=_UNITS,
        damping={"viscous": {"coefficient": 2.30}},
        source="Table 3.II, Eq. 3.2.19",
    )
    return diagnose(Record(table, "Table 3.III"), mode)


def configuration_2() -> Diagnosis:
    """First mode of Configuration II, three levels at phase resonance, against the viscous simulation of sweep A.

    Tables 4.I and 4.II. Frequency, mass and damping are those of the lowest level, with the default tolerances of mass
    and damping and, as the resonance was read to 0.001 Hz, of 0.0006 for the frequency.
    """
    record = report_record("config-2-mode-1")
    first = record.iloc[0]
    mode = Mode(
        name="Configuration II, first mode, as sweep A",
        frequency=float(first["frequency"]),
        mass=float(first["mass"]),
        tolerance=Tolerance(frequency=0.0006),
        units=_UNITS,
        damping={"viscous": {"coefficient": float(load_table("4_II")["C1_lb_s_per_in"].iloc[0])}},
        source="Tables 4.I and 4.II, sweep A",
    )
    return diagnose(Record(record, "Tables 4.I and 4.II"), mode)
