"""Every study of chapters II, IV and V: computed once, its tables by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import Any

import pandas as pd

from damping.arrays import RAD_S_PER_HZ
from damping.effects import CATALOGUE
from damping.gap.corrected import effect_values, refitted_values
from damping.gap.diagnose import Diagnosis, diagnose
from damping.infer.observations import observe
from damping.plots import Drawn
from damping.records.mode import Mode, Tolerance, Units
from damping.records.reading import read_record
from damping.records.record import Record
from damping.report import format_share
from damping.report.gap import describe_diagnosis, tabulate_hypotheses
from damping.report.gap_page import gap_figures
from damping.report.page import Block, List, Section, Table, Text, join_lines, write_blocks
from damping_reed1970 import DrawnBlock, ReportPart, data_folder, draw_block, load_table
from damping_reed1970.chapter_2 import HysteresisLoops, SlipEquivalent, hysteresis_loops, slip_equivalent
from damping_reed1970.chapter_3 import PLANES
from damping_reed1970.chapter_3.study import Chapter3
from damping_reed1970.chapter_4 import SWEEP_C
from damping_reed1970.chapter_4.amplitude_frequency import AmplitudeFrequency, amplitude_frequency, section_4_2_points
from damping_reed1970.chapter_4.levels import LevelMethods, level_methods, masses, tabulate_chance_of_exponent
from damping_reed1970.chapter_4.lines import SweepLines, coefficient_lines, force_amplitude_lines
from damping_reed1970.chapter_5.circularity import Circularity, circularity
from damping_reed1970.chapter_5.false_terms import FalseTerms, false_terms
from damping_reed1970.chapter_5.nine_terms import EnergySurface, energy_surface, nine_terms
from damping_validation.scorer_output import load_blind_table, tabulate_blind_rows

MODES = (1, 2)


@dataclass(frozen=True)
class Studies:
    """Results of the chapters."""

    loops: HysteresisLoops  #: section 2.4
    slip: SlipEquivalent  #: section 2.4
    lines: tuple[SweepLines, ...]  #: section 4.1, a mode each
    curves: AmplitudeFrequency  #: section 4.2
    #: Tables 4.IV and 4.V by mode and what is held (``xi``, ``coefficient``)
    levels: dict[tuple[int, str], LevelMethods]
    force_lines: tuple[SweepLines, ...]  #: section 4.3
    nine: Mapping[str, pd.DataFrame]  #: chapter V
    false: FalseTerms  #: chapter V
    circular: Circularity  #: chapter V
    surface: EnergySurface  #: chapter V

    def tables(self, chapter: int | None = None) -> dict[str, pd.DataFrame]:
        """Tidy tables by name, of a chapter or all."""
        false = self.false
        by_chapter = {
            4: {
                "response_points": section_4_2_points(self.curves),
                "response_widths": self.curves.widths,
                "level_coefficients": self._levels("coefficients"),
                "level_variations": self._levels("variations"),
                "level_predictions": self._levels("predictions"),
                "chance_of_exponent": tabulate_chance_of_exponent(),
            },
            5: {
                **self.nine,
                "false_terms": false.selection,
                "false_terms_frequency": false.frequency,
                "false_terms_inflation": false.inflation,
                "circular_laws": self.circular.laws,
                "circular_claims": self.circular.claims,
            },
        }
        chosen = by_chapter.values() if chapter is None else [by_chapter[chapter]]
        return {name: table for tables in chosen for name, table in tables.items()}

    def _levels(self, name: str) -> pd.DataFrame:
        """One table of the level methods over modes and what is held."""
        parts = [
            getattr(methods, name).assign(mode=mode, kept=held, picked=methods.picked)
            for (mode, held), methods in self.levels.items()
        ]
        return pd.DataFrame(pd.concat(parts, ignore_index=True))


def compute_studies(seed: int = 0) -> Studies:
    """Compute everything; ``seed`` is of the simulations, false terms and circularity."""
    levels = {}  # of both modes of Configuration II, with xi held as in the report and with the coefficient itself
    for mode in MODES:
        record = read_record(data_folder() / "saturn-v" / "records" / f"config-2-mode-{mode}.csv")
        data = observe(record)
        for held, mass in (("xi", masses(record, data)), ("coefficient", None)):
            levels[mode, held] = level_methods(data, mass, (1.0, 100.0))
    return Studies(
        loops=hysteresis_loops(),
        slip=slip_equivalent(),
        lines=tuple(coefficient_lines(mode) for mode in MODES),
        curves=amplitude_frequency(SWEEP_C["M"], SWEEP_C["omega_n"], SWEEP_C["F_e"], SWEEP_C["A_m"], (1.0, 100.0)),
        levels=levels,
        force_lines=tuple(force_amplitude_lines(mode) for mode in MODES),
        nine=nine_terms(),
        false=false_terms(seed=seed),
        circular=circularity(seed=seed),
        surface=energy_surface(),
    )


#: Gaps between simulation and test, diagnosed, by the number of the configuration.
Gaps = Mapping[str, Diagnosis]


@dataclass(frozen=True)
class ReportResults:
    """The report recomputed: chapters II, IV and V, chapter III, tables of the report beside ours by name, gaps."""

    studies: Studies
    chapter_3: Chapter3
    tables: Mapping[str, pd.DataFrame]
    gaps: Gaps


def diagnose_gaps() -> Gaps:
    """Both gaps diagnosed from their tables alone."""
    return {"1": configuration_1_gap(), "2": configuration_2_gap()}


_UNITS = Units(force="lb", length="in", time="s")


def configuration_1_gap() -> Diagnosis:
    """Second mode of Configuration I as Table 3.III gives it against one plane with viscous damping.

    Amplitude and phase of the mode (Table 3.III), modal force phi_t2 F and frequency (Table 3.I); simulation of Table
    3.II with the average damping of Eq. 3.2.18 (xi = 0.005): its 15 values scatter by 45 per cent, their mean by 12.
    """
    motion, modal = load_table("3_I"), load_table("3_III", "corrected")
    table = pd.DataFrame(
        {
            "sweep": "I",
            "force": PLANES.phi * motion["force_lb"],
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
    record = read_record(data_folder() / "saturn-v" / "records" / "config-2-mode-1.csv")
    first = record.table.iloc[0]
    mode = Mode(
        name="Configuration II, first mode, as sweep A",
        frequency=float(first["frequency"]),
        mass=float(first["mass"]),
        tolerance=Tolerance(frequency=0.0006),
        units=_UNITS,
        damping={"viscous": {"coefficient": float(load_table("4_II")["C1_lb_s_per_in"].iloc[0])}},
        source="Tables 4.I and 4.II, sweep A",
    )
    return diagnose(Record(record.table, "Tables 4.I and 4.II"), mode)


SHOWN = ("overlay", "probabilities", "local")  #: figures shown of each gap
_MOST = 8  #: hypotheses listed of each: more have a probability of a per cent or less


def gaps_part(diagnoses: Gaps) -> ReportPart:
    """The part: Configuration I against one plane, Configuration II against viscous damping."""
    blind = load_blind_table()
    fitted = {number: tabulate_hypotheses(diagnosis) for number, diagnosis in diagnoses.items()}
    tables = {f"gap_configuration_{number}": table.drop(columns="listed") for number, table in fitted.items()}

    def take(kind: str, name: str, caption: str) -> list[Block]:
        if kind == "blind":
            return [Table(tabulate_blind_rows(blind), caption=caption)]
        diagnosis, key = diagnoses[name], f"gap_configuration_{name}"
        if kind == "verdict":
            topics = describe_diagnosis(diagnosis)
            sentences = [*topics["place"], *topics["doubts"], *topics["trends"]]
            sentences += [join_lines(caption)] if caption else []
            return [
                Text(topics["verdict"][0], lead=True),
                List([*sentences, *topics["reach"], *topics["following"]]),
            ]
        if kind == "table":
            return [Table(tables[key].head(_MOST), {"probability": format_share}, caption=join_lines(caption), key=key)]
        drawn = gap_figures(diagnosis)
        return [_draw_gap(f"gap-configuration-{name}-{figure}", drawn[figure]) for figure in SHOWN]

    second = diagnoses["2"].hypotheses
    forces = sum(h.probability for h in second if {CATALOGUE[name].kind for name in h.effects} == {"force"})
    values: dict[str, Any] = {"titles": {number: diagnosis.mode.name for number, diagnosis in diagnoses.items()}}
    values |= {"planes": _find_planes(diagnoses["1"]), "missing_forces": format_share(forces)}
    values["cases"] = blind["cases"].max()  # a figure of all of them
    blocks = write_blocks(Path(__file__).with_name("gaps.txt"), values, take)
    return ReportPart(Section("gaps", "Two gaps between simulation and test", blocks), tables)


def _draw_gap(file: str, drawn: Drawn) -> DrawnBlock:
    return draw_block(file, drawn.title, drawn.description, lambda: drawn.figure)


def _find_planes(diagnosis: Diagnosis) -> tuple[float, float, float] | None:
    """Second and first frequency, rad/s, and angle of the drive, degrees, if a second plane is the explanation."""
    values = effect_values(diagnosis.leading.best).get("planar-coupling")
    if values is None:
        return None
    first = diagnosis.mode.omega_n * (1.0 + refitted_values(diagnosis.leading.best)["frequency"])
    return first * values["frequency_ratio"], first, degrees(values["angle"])
