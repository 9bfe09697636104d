"""Two gaps whose cause is known from the report: planar coupling of Configuration I, damping of Configuration II.

The diagnosis sees the table and the simulation, nothing else; the page says what it makes of each.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees

import pandas as pd

from damping.arrays import RAD_S_PER_HZ
from damping.effects import CATALOGUE
from damping.gap.corrected import effect_values, refitted_values
from damping.gap.diagnose import Diagnosis, diagnose
from damping.records.mode import Mode, Tolerance, Units
from damping.records.record import Record
from damping.report.figures import Drawn
from damping.report.gap_figures import gap_figures
from damping.report.gap_page import describe_following, describe_verdict, list_doubts, list_trends, place, reach
from damping.report.page import Block, Heading, List, Section, Table, Text
from damping.report.words import format_share, number
from damping_reed1970.common import ReportPart, draw_block
from damping_reed1970.records import PHI_T2, report_record
from damping_reed1970.tables import load_table
from damping_validation.scorer_output import load_blind_table, tabulate_blind_rows


@dataclass(frozen=True)
class Gaps:
    """Both diagnoses."""

    configuration_1: Diagnosis
    configuration_2: Diagnosis


def diagnose_gaps() -> Gaps:
    """Both gaps diagnosed from their tables alone."""
    return Gaps(configuration_1_gap(), configuration_2_gap())


_UNITS = Units(force="lb", length="in", time="s")


def configuration_1_gap() -> Diagnosis:
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


def configuration_2_gap() -> Diagnosis:
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


#: Figures shown of each gap.
SHOWN = ("overlay", "local", "probabilities")
#: Hypotheses listed of each: more have a probability of a per cent or less.
_MOST = 8


def gaps_part(found: Gaps) -> ReportPart:
    """The part: Configuration I against one plane, Configuration II against viscous damping."""
    blocks: list[Block] = [
        Text(
            "Two gaps between simulation and test whose cause the report found by hand. The diagnosis sees the table "
            "and the simulation, nothing else."
        )
    ]
    tables: dict[str, pd.DataFrame] = {}
    for number_, (one, what) in enumerate(
        ((found.configuration_1, _list_planes), (found.configuration_2, _list_damping)), 1
    ):
        blocks += [Heading(one.mode.name), Text(describe_verdict(one), lead=True)]
        said = [place(one), *list_doubts(one), *list_trends(one), *what(one)]
        blocks.append(List([*said, reach(one), describe_following(one)]))
        for name, drawn in gap_figures(one).items():
            if name in SHOWN:
                blocks.append(draw_block(f"gap-configuration-{number_}-{name}", Drawn(*drawn)))
        key = f"gap_configuration_{number_}"
        tables[key] = tabulate_hypotheses(one)
        caption = "The most probable explanations, with the natural logarithm of their evidence"
        blocks.append(Table(tables[key].head(_MOST), caption, {"probability": format_share}, key=key))
    blocks += [
        Heading("How far such a diagnosis can be trusted"),
        Text(_TRUST),
        Table(tabulate_blind_rows(load_blind_table()), _BLIND),
    ]
    section = Section("gaps", "Two gaps between simulation and test", blocks)
    return ReportPart(section, tables)


_TRUST = (
    "The same diagnosis answered 1500 generated cases whose effect was withheld from it (the command damping blind): "
    "goals beside measured values, with 95 per cent intervals. Names of forces whose predictions a record cannot tell "
    "apart count as wrong in the strict figures of the leading class; the line below each counts them as right where "
    "the answer says so."
)
_BLIND = "Blind check of the gap diagnosis"


def tabulate_hypotheses(one: Diagnosis) -> pd.DataFrame:
    """Every hypothesis that was fitted, most probable first: ``explanation, probability, log_evidence``."""
    return pd.DataFrame(
        {
            "explanation": [" + ".join(each.effects) or "no effect" for each in one.hypotheses],
            "probability": [each.probability for each in one.hypotheses],
            "log_evidence": [each.hypothesis.log_evidence for each in one.hypotheses],
        }
    )


def _list_planes(one: Diagnosis) -> list[str]:
    """The second plane in rad/s, if that is the explanation."""
    values = effect_values(one.leading.best).get("planar-coupling")
    if values is None:
        return []
    first = one.mode.omega_n * (1.0 + refitted_values(one.leading.best)["frequency"])
    return [
        f"The second plane lies at {number(first * values['frequency_ratio'], 4)} rad/s, the first at "
        f"{number(first, 4)}, and the drive {number(degrees(values['angle']), 2)} degrees from the first. (The fit of "
        "section 3.1, which sees the phase of every node too, is in chapter III.)"
    ]


def _list_damping(one: Diagnosis) -> list[str]:
    """How probable it is that damping forces, and no other effects, are missing."""
    kinds = [{CATALOGUE[name].kind for name in each.effects} for each in one.hypotheses]
    forces = sum(each.probability for each, kind in zip(one.hypotheses, kinds, strict=True) if kind == {"force"})
    return [
        f"Missing forces that grow with amplitude, whichever they are, have probability {format_share(forces)} "
        f"together."
    ]
