"""Input of the checks of the audit: a record, its mode, and the quantities that its rows imply, each computed once."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property
from math import log, pi
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, wrap_lag
from damping.forces import damping_ratio
from damping.records.implied import Implied, Leg, detect_rate, find_implied
from damping.records.mixed_levels import find_mixed_levels
from damping.records.mode import Mode
from damping.records.odd_levels import OddLevel, find_odd_level
from damping.records.outliers import find_isolated_rows, find_misplaced_rows
from damping.records.phase_kinds import AS_LAG, CERTAIN_BESIDE, classify_phase, has_antiresonance, is_incoherent
from damping.records.record import Record
from damping.records.resonance import tabulate_resonances
from damping.records.rows import list_rates
from damping.records.runs import WHITE, Run, measure_whiteness, runs_of

#: Largest phase offset, rad, that is subtracted from the lags; a larger one means another kind of phase.
MOST_OFFSET = 0.25 * pi
MOST_NAMED = 5  #: most labels of sweeps in a message


@dataclass(frozen=True)
class Finding:
    """One cause: the ``check`` that found it, ``verdict`` caution or refuse, observation, advice, and sweeps."""

    check: str
    verdict: str
    what: str
    advice: str
    sweeps: tuple[str, ...] = ()

    #: whether a diagnosis can name the cause: a refusal then stops the ranking of laws alone
    named: ClassVar[bool] = False

    def __str__(self) -> str:
        return f"{self.check} ({self.verdict}): {self.what}; {self.advice}"

    def to_json(self) -> dict[str, Any]:
        """A finding of the form ``audit/1``."""
        return {**asdict(self), "sweeps": list(self.sweeps)}


class NamedFinding(Finding):
    """A finding whose cause is an effect of the library, of a size that a diagnosis fits."""

    named: ClassVar[bool] = True


@dataclass(frozen=True)
class View:
    """A record, the mode if given, and the quantities that its rows imply, each computed once for all checks."""

    record: Record
    mode: Mode | None

    @property
    def stated_mass(self) -> float:
        """Mass of the mode; NaN if there is none, or for a base drive, of which it is a scale."""
        return self.mode.mass if self.mode and self.mode.drive == "force" else float("nan")

    @cached_property
    def raw(self) -> list[Run]:
        """The runs as recorded."""
        return runs_of(self.record)

    @cached_property
    def outliers(self) -> dict[int, str]:
        """Outliers of every kind: row of the record, and its sweep."""
        of_levels = {int(run.rows[0]): run.sweep for run in (self.odd.runs if self.odd else ())}
        return self.isolated | of_levels | self.misplaced

    @cached_property
    def isolated(self) -> dict[int, str]:
        """Rows far from the neighbouring amplitudes or phasors, and their sweeps."""
        return {int(run.rows[k]): run.sweep for run in self.raw for k in find_isolated_rows(run)}

    @cached_property
    def misplaced(self) -> dict[int, str]:
        """Rows whose frequency departs from the order of their sweep, which their reading keeps, and their sweeps."""
        return find_misplaced_rows(self.record)

    @cached_property
    def odd(self) -> OddLevel | None:
        """Among sweeps of one row, the level off the trend of the others. Decays are not checked: their levels are not
        read one by one, and vary where two modes beat."""
        one_mass = len(set(self.record.masses(0.0) + self.record.added_masses)) == 1
        return None if self.record.is_decay else find_odd_level(self.raw, self.stated_mass, one_mass=one_mass)

    @cached_property
    def mixed_levels(self) -> dict[str, list[float]]:
        """Labels that hold several levels of force, and the forces of these."""
        return find_mixed_levels(self.record, self.stated_mass)

    @cached_property
    def runs(self) -> list[Run]:
        """The runs as recorded, without outliers."""
        left_out = np.array(sorted(self.outliers), dtype=np.int64)
        kept = [run.without(left_out) for run in self.raw] if len(left_out) else self.raw
        return [run for run in kept if len(run)]

    @cached_property
    def turns(self) -> list[tuple[Run, Implied | None]]:
        """Each run and what it implies with the phases as recorded."""
        return [(run, find_implied(run)) for run in self.runs]

    @cached_property
    def curve(self) -> bool:
        """Whether the amplitudes form a curve, and are not white noise."""
        white = measure_whiteness([run.compliance for run in self.runs])
        return white is None or white < WHITE

    @cached_property
    def incoherent(self) -> tuple[str, ...]:
        """Sweeps whose phases are unrelated to their amplitudes."""
        return label_sweeps(run for run, turn in self.turns if turn and is_incoherent(run, turn))

    @cached_property
    def wrong_sign(self) -> dict[str, str]:
        """Sweeps whose phase is not the lag of the displacement, with the kind of phase."""
        kinds: dict[str, str] = {}
        likely: dict[str, str] = {}  # kinds that sweeps have if another certainly has
        for run, turn in self.turns:
            if run.sweep in self.incoherent or run.phase is None:
                continue
            if turn is None:
                sine = float(np.mean(np.sin(run.phase)))
                kind = "" if sine > -0.5 else "negated"
            elif has_antiresonance(run):
                continue
            else:
                kind = classify_phase(run, turn)
                if may_be := classify_phase(run, turn, CERTAIN_BESIDE):
                    likely[run.sweep] = may_be
            if kind:
                kinds[run.sweep] = kind
        certain = set(kinds.values())
        return {sweep: kind for sweep, kind in likely.items() if kind in certain} | kinds

    @cached_property
    def legs(self) -> list[Leg]:
        """Every run with its phase converted to the lag of the displacement."""
        legs = []
        for run, turn in self.turns:
            kind, lag = self.wrong_sign.get(run.sweep, ""), None
            if run.phase is not None and run.sweep not in self.incoherent:
                near = turn and turn.both_sides and not kind and abs(turn.offset) < MOST_OFFSET
                lag = wrap_lag(AS_LAG[kind](run.phase - (turn.offset if turn and near else 0.0)))
            legs.append(Leg(run, turn, lag))
        return legs

    @cached_property
    def rates(self) -> dict[str, float]:
        """(df/dt)/(2 zeta f)^2 of each sweep at its resonance, if the sweep rate is stated."""
        of_rig = self.mode.rig.rate if self.mode else None
        if "sweep_rate" not in self.record.frame.columns and not of_rig:
            return {}
        width = 2.0 * (self.implied["damping_ratio"] * self.implied["frequency"])
        rates = pd.Series(np.abs(list_rates(self.record, of_rig)))
        fastest = rates.groupby(self.record.frame["sweep"].to_numpy()).max()
        etas = self.implied["sweep"].map(fastest) / width**2
        rows = zip(self.implied["sweep"], etas, width, strict=True)
        return {str(sweep): float(eta) for sweep, eta, w in rows if w > 0.0}

    @cached_property
    def detected_rate(self) -> float | None:
        """Sweep rate (d omega/dt)/omega, 1/s, that the phases show; None if they show none."""
        return detect_rate([leg.run for leg in self.legs if leg.lag is not None])

    @cached_property
    def right(self) -> Record:
        """The record without outliers, wrong kinds of phase converted to lags, and no phases if a run has no lag."""
        rows = np.concatenate([run.rows for run in self.runs])
        table = self.record.frame.loc[np.sort(rows)].copy()
        if "phase" in table.columns and any(leg.lag is None for leg in self.legs):
            table = table.drop(columns="phase")
        elif "phase" in table.columns:
            for leg in self.legs:
                if leg.run.sweep in self.wrong_sign:
                    table.loc[leg.run.rows, "phase"] = leg.lag
        return Record.trusted(table.reset_index(drop=True), self.record.source)

    @cached_property
    def resonances(self) -> pd.DataFrame:
        """The resonance of each sweep of the record ``right``."""
        return tabulate_resonances(self.right)

    @cached_property
    def straight(self) -> bool:
        """Whether most implied masses are from phases or from resonances that are not bent."""
        known = [straight for mass, straight in (leg.mass for leg in self.legs) if np.isfinite(mass)]
        return float(np.mean(known)) > 0.5 if known else False

    @cached_property
    def implied(self) -> pd.DataFrame:
        """One row for each sweep: resonance, mass, damping ratio and phase offset implied by its rows."""
        table = _replace_steady_amplitudes(self.resonances, self.right)
        mass: dict[str, list[float]] = {}
        for leg in self.legs:
            mass.setdefault(leg.run.sweep, []).append(leg.mass[0])
        implied = table[["sweep", "frequency", "force", "amplitude", "phase_offset"]].copy()
        implied["mass"] = [take_median(mass.get(sweep, [])) for sweep in table["sweep"]]
        used = self.right.masses(self.stated_mass)[table["row"].to_numpy()] if len(table) else np.array([])
        used = np.where(np.isnan(used), implied["mass"], used)
        omega = RAD_S_PER_HZ * implied["frequency"]
        implied["damping_ratio"] = damping_ratio(implied["force"], implied["amplitude"], used * omega**2)
        return implied.reset_index(drop=True)

    @property
    def paired(self) -> bool:
        """Whether every mass is of pairs of rows with phases."""
        return all(leg.paired for leg in self.legs if np.isfinite(leg.mass[0]))

    @cached_property
    def mass_ratio(self) -> float:
        """Mass that the rows imply over that of the mode (or of the column ``mass``); NaN if they imply none.

        Runs whose rows lie on a line show it, the median of them. If there is none, it is the ratio nearest to 1: a
        unit is that of every run, so that each shows its factor.
        """
        if self.mode is None:
            return float("nan")
        stated = self.record.masses(self.mode.mass)
        base = self.mode.drive == "base"
        known = [leg for leg in self.legs if leg.mass[0] > 0.0]
        ratios = [leg.mass[0] / (1.0 if base else float(np.median(stated[leg.run.rows]))) for leg in known]
        if any(leg.on_line for leg in known):
            return take_median(ratio for leg, ratio in zip(known, ratios, strict=True) if leg.on_line)
        return min(ratios, key=lambda ratio: abs(log(ratio)), default=float("nan"))


def take_median(values: Iterable[float]) -> float:
    """Median of the finite values; NaN if there is none."""
    known = np.array([value for value in values if np.isfinite(value)])
    return float(np.median(known)) if len(known) else float("nan")


def _replace_steady_amplitudes(table: pd.DataFrame, record: Record) -> pd.DataFrame:
    """Resonances; for sweeps at constant amplitude without phases, moved to the row of least force per amplitude."""
    replaced = table.copy()
    for place in np.flatnonzero(table["method"] == "peak"):
        rows = record.frame[record.frame["sweep"] == table["sweep"][place]]
        if np.ptp(np.log(rows["amplitude"])) < 0.5 * np.ptp(np.log(rows["force"])):
            row = (rows["force"] / rows["amplitude"]).idxmin()
            for name in ("force", "frequency", "amplitude"):
                replaced.loc[place, name] = rows[name][row]
            replaced.loc[place, "row"] = row
    return replaced


def label_sweeps(runs: Iterable[Run]) -> tuple[str, ...]:
    """Labels of runs, each once."""
    return tuple(dict.fromkeys(run.sweep for run in runs))


def name_sweeps(sweeps: Iterable[str]) -> str:
    """Labels for a message: the first ``MOST_NAMED``, and the number of the rest."""
    labels = list(sweeps)
    more = f" and {len(labels) - MOST_NAMED} more" if len(labels) > MOST_NAMED else ""
    return f"sweep{'s' * (len(labels) != 1)} {', '.join(labels[:MOST_NAMED])}{more}"
