"""Every study of chapters II, IV and V: computed once, its tables by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from damping.infer.observations import observe
from damping.records.reading import read_record
from damping_reed1970.chapter_2 import HysteresisLoops, SlipEquivalent, hysteresis_loops, slip_equivalent
from damping_reed1970.chapter_3.study import Chapter3
from damping_reed1970.chapter_4.amplitude_frequency import AmplitudeFrequency, amplitude_frequency, section_4_2_points
from damping_reed1970.chapter_4.levels import LevelMethods, level_methods, masses, tabulate_chance_of_exponent
from damping_reed1970.chapter_4.lines import (
    CoefficientLines,
    ForceAmplitudeLines,
    coefficient_lines,
    force_amplitude_lines,
)
from damping_reed1970.chapter_5.circularity import Circularity, circularity
from damping_reed1970.chapter_5.false_terms import FalseTerms, false_terms
from damping_reed1970.chapter_5.nine_terms import NineTerms, nine_terms
from damping_reed1970.chapter_5.regressions import EnergySurface, energy_surface
from damping_reed1970.gaps import Gaps
from damping_reed1970.tables import data_folder

MODES = (1, 2)


@dataclass(frozen=True)
class Studies:
    """Results of the chapters.

    Attributes:
        loops, slip: section 2.4. lines: section 4.1, a mode each. curves: section 4.2. levels: Tables 4.IV and 4.V as
            methods, by mode and what is held (``xi``, ``coefficient``). force_lines: section 4.3, a mode each.
        nine, false, circular, surface: chapter V.
    """

    loops: HysteresisLoops
    slip: SlipEquivalent
    lines: tuple[CoefficientLines, ...]
    curves: AmplitudeFrequency
    levels: dict[tuple[int, str], LevelMethods]
    force_lines: tuple[ForceAmplitudeLines, ...]
    nine: NineTerms
    false: FalseTerms
    circular: Circularity
    surface: EnergySurface

    def tables(self) -> dict[str, pd.DataFrame]:
        """Tidy tables by name."""
        return {
            "hysteresis_loops": self.loops.areas,
            "slip_equivalent": self.slip.energies,
            "response_points": section_4_2_points(self.curves),
            "response_widths": self.curves.widths,
            "level_coefficients": self._levels("coefficients"),
            "level_variations": self._levels("variations"),
            "level_predictions": self._levels("predictions"),
            "chance_of_exponent": tabulate_chance_of_exponent(),
            "nine_terms": self.nine.full,
            "nine_terms_summary": self.nine.summary,
            "nine_terms_elimination": self.nine.elimination,
            "nine_terms_best": self.nine.best,
            "nine_terms_by_size": self.nine.by_size,
            "false_terms": self.false.selection,
            "false_terms_frequency": self.false.frequency,
            "false_terms_inflation": self.false.inflation,
            "circular_laws": self.circular.laws,
            "circular_claims": self.circular.claims,
        }

    def _levels(self, name: str) -> pd.DataFrame:
        """One table of the level methods over modes and what is held."""
        parts = [
            getattr(found, name).assign(mode=mode, kept=held, picked=found.picked)
            for (mode, held), found in self.levels.items()
        ]
        result: pd.DataFrame = pd.concat(parts, ignore_index=True)
        return result


def compute_studies(seed: int = 0, replicates: tuple[int, int] = (1000, 500)) -> Studies:
    """Compute everything; ``seed`` and ``replicates`` are of the simulations, false terms and circularity."""
    return Studies(
        loops=hysteresis_loops(),
        slip=slip_equivalent(),
        lines=tuple(coefficient_lines(mode) for mode in MODES),
        curves=amplitude_frequency(),
        levels={(mode, held): _level_methods(mode, held) for mode in MODES for held in ("xi", "coefficient")},
        force_lines=tuple(force_amplitude_lines(mode) for mode in MODES),
        nine=nine_terms(),
        false=false_terms(replicates=replicates[0], seed=seed),
        circular=circularity(replicates=replicates[1], seed=seed),
        surface=energy_surface(),
    )


def _level_methods(mode: int, held: str) -> LevelMethods:
    """The methods on a mode of Configuration II, with xi held as in the report or with the coefficient itself."""
    record = read_record(data_folder() / "saturn-v" / "records" / f"config-2-mode-{mode}.csv")
    data = observe(record)
    return level_methods(data, masses(record, data, 1.0) if held == "xi" else None, (1.0, 100.0))


@dataclass(frozen=True)
class ReportResults:
    """The report recomputed.

    Attributes:
        studies: of chapters II, IV and V.
        chapter_3: of chapter III.
        tables: of the report beside ours, by name.
        gaps: two gaps between simulation and test, diagnosed.
    """

    studies: Studies
    chapter_3: Chapter3
    tables: Mapping[str, pd.DataFrame]
    gaps: Gaps
