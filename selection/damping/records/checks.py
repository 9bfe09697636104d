"""Checks of the audit: each a function from what a record shows to a finding, or None.

They are listed in ``CHECKS`` in the order in which causes explain each other: a record in which force and response
are exchanged has no resonance either, and is not told so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from math import log, pi

import numpy as np
import pandas as pd

from damping.arrays import POUND_FORCE_N, RAD_S_PER_HZ, STANDARD_GRAVITY_M_S2, STANDARD_GRAVITY_REPORT_IN_S2, FloatArray
from damping.records.implied import (
    FEWEST_ROWS,
    WHITE,
    Implied,
    Run,
    beats_of,
    has_resonance,
    implied_by,
    mass_without_phase,
    peaks_of,
    quarter_turns,
    runs_of,
    whiteness,
    wild_rows,
)
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.resonance import energy_per_cycle, resonances

#: Factors by which a quantity in a wrong unit is off, and what they mean.
UNIT_FACTORS: dict[str, float] = {
    "N for lb": POUND_FORCE_N,
    "kgf for N, or g for m/s^2": STANDARD_GRAVITY_M_S2,
    "g for in/s^2": STANDARD_GRAVITY_REPORT_IN_S2,
    "g for ft/s^2": 32.174,
    "lb for kg": 2.20462,
    "mm for in": 25.4,
    "in for m": 39.3701,
    "in for ft": 12.0,
    "m for ft": 3.28084,
    "mm for m, or another factor of 1000": 1000.0,
    "um for m, or another factor of a million": 1.0e6,
    "g for mm/s^2": 1000.0 * STANDARD_GRAVITY_M_S2,
    "rad/s for Hz squared": (2.0 * pi) ** 2,
}
#: Factors within one system of units: their finding is a caution.
SCALING_FACTORS = {"rms for peak": 2.0**0.5, "peak-to-peak for peak": 2.0, "peak-to-peak for rms": 2.0 * 2.0**0.5}
#: Factors between frequencies.
FREQUENCY_FACTORS = {"rad/s for Hz": 2.0 * pi, "1/min for Hz": 60.0, "kHz for Hz": 1000.0}


@dataclass(frozen=True)
class Finding:
    """One cause: the ``check`` that found it, ``verdict`` caution or refuse, what was seen, what to do, where."""

    check: str
    verdict: str
    what: str
    advice: str
    sweeps: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.check} ({self.verdict}): {self.what}; {self.advice}"


@dataclass(frozen=True)
class View:
    """A record, with the mode where one is given, and what its rows imply; computed once for all checks."""

    record: Record
    mode: Mode | None

    @cached_property
    def raw(self) -> list[Run]:
        """The runs as they are."""
        return runs_of(self.record)

    @cached_property
    def wild(self) -> dict[int, str]:
        """Rows of the record whose amplitude is off by more than ``WILD``, with their sweep."""
        return {int(run.rows[k]): run.sweep for run in self.raw for k in wild_rows(run, WILD)} | self._wild_peaks()

    def _wild_peaks(self) -> dict[int, str]:
        """Among sweeps of one row: the one whose amplitude does not go with its force as the others' do."""
        single = [run for run in self.raw if len(run) == 1]
        if len(single) < FEWEST_ROWS:
            return {}
        x, y = (np.array([np.log(getattr(run, name)[0]) for run in single]) for name in ("F", "A"))
        for k, run in enumerate(single):
            others = np.arange(len(single)) != k
            line = (
                np.polyfit(x[others], y[others], 1) if np.ptp(x[others]) > 0.05 else np.array([0.0, y[others].mean()])
            )
            left = y - np.polyval(line, x)
            if abs(left[k]) > log(WILD) and np.abs(left[others]).max() < 0.2 * abs(left[k]):
                return {int(run.rows[0]): run.sweep}
        return {}

    @cached_property
    def runs(self) -> list[Run]:
        """The runs without wild rows, as they are."""
        left_out = np.array(sorted(self.wild), dtype=np.int64)
        kept = [run.without(left_out) for run in self.raw] if len(left_out) else self.raw
        return [run for run in kept if len(run)]

    @cached_property
    def turns(self) -> list[Implied | None]:
        """What each run implies, phases as they are."""
        return [implied_by(run) for run in self.runs]

    @cached_property
    def curve(self) -> bool:
        """Whether the amplitudes are a curve and not white noise."""
        white = whiteness(self.runs)
        return white is None or white < WHITE

    @cached_property
    def incoherent(self) -> tuple[str, ...]:
        """Sweeps whose phases have nothing to do with their amplitudes."""
        return _labels(
            run for run, turn in zip(self.runs, self.turns, strict=True) if turn and _is_incoherent(run, turn)
        )

    @cached_property
    def wrong_sign(self) -> dict[str, str]:
        """Sweeps whose phase is no lag of the displacement, and what it is instead."""
        found: dict[str, str] = {}
        for run, turn in zip(self.runs, self.turns, strict=True):
            if run.sweep in self.incoherent or run.phase is None:
                continue
            if turn is None:
                sine = float(np.mean(np.sin(run.phase)))
                kind = "" if sine > -0.5 else "negated"
            else:
                kind = _kind_of_phase(turn)
            if kind:
                found[run.sweep] = kind
        return found

    @cached_property
    def lags(self) -> list[FloatArray | None]:
        """Phase of every run as the lag that it should have been; None where there is none or it is incoherent."""
        found: list[FloatArray | None] = []
        for run, turn in zip(self.runs, self.turns, strict=True):
            kind = self.wrong_sign.get(run.sweep, "")
            if run.phase is None or run.sweep in self.incoherent:
                found.append(None)
                continue
            offset = turn.offset if turn and turn.both_sides and not kind and abs(turn.offset) < 0.25 * pi else 0.0
            lag = _AS_LAG[kind](run.phase - offset)
            found.append(np.angle(np.exp(1j * (lag - 0.5 * pi))) + 0.5 * pi)
        return found

    @cached_property
    def resonant(self) -> list[bool]:
        """Whether each run holds a resonance; a run of few rows is taken at its word."""
        return [
            len(run) < FEWEST_ROWS or has_resonance(run, lag) for run, lag in zip(self.runs, self.lags, strict=True)
        ]

    @cached_property
    def right(self) -> Record:
        """The record without wild rows, with lags where its phases were others; without phases where they are noise."""
        rows = np.concatenate([run.rows for run in self.runs])
        table = self.record.table.loc[np.sort(rows)].copy()
        if "phase" in table.columns:
            if any(lag is None for lag in self.lags):
                table = table.drop(columns="phase")
            else:
                for run, lag in zip(self.runs, self.lags, strict=True):
                    if run.sweep in self.wrong_sign and lag is not None:
                        table.loc[run.rows, "phase"] = lag
        return Record(table.reset_index(drop=True), self.record.source)

    @cached_property
    def masses(self) -> FloatArray:
        """Mass that each run implies, (runs,); NaN where it does not."""
        return np.array([mass for mass, _ in self._masses])

    @cached_property
    def straight(self) -> bool:
        """Whether the implied masses rest on phases or on resonances that are not bent."""
        known = [straight for mass, straight in self._masses if np.isfinite(mass)]
        return float(np.mean(known)) > 0.5 if known else False

    @cached_property
    def _masses(self) -> list[tuple[float, bool]]:
        found = []
        for run, turn, lag in zip(self.runs, self.turns, self.lags, strict=True):
            if turn is not None and lag is not None:
                sure = turn.both_sides and turn.scatter < SURE
                found.append((abs(turn.mass) if sure else float("nan"), True))
            else:
                found.append(mass_without_phase(run) or (float("nan"), False))
        return found

    @cached_property
    def implied(self) -> pd.DataFrame:
        """A row a sweep: its resonance, mass, damping ratio and phase offset as the rows imply them."""
        table = _with_steady_amplitudes(resonances(self.right), self.right)
        mass: dict[str, list[float]] = {}
        for run, value in zip(self.runs, self.masses, strict=True):
            mass.setdefault(run.sweep, []).append(value)
        found = table[["sweep", "frequency", "force", "amplitude", "phase_offset"]].copy()
        found["mass"] = [_median(mass.get(sweep, [])) for sweep in table["sweep"]]
        stated = self.mode.mass if self.mode else np.nan
        used = self.right.masses(stated)[table["row"].to_numpy()] if len(table) else np.array([])
        used = np.where(np.isnan(used), found["mass"], used)
        omega = RAD_S_PER_HZ * found["frequency"]
        found["damping_ratio"] = found["force"] / (2.0 * used * omega**2 * found["amplitude"])
        return found.reset_index(drop=True)

    @cached_property
    def mass_ratio(self) -> float:
        """Mass that the rows imply over that of the mode (or of the rows' own column); NaN where they imply none."""
        if self.mode is None:
            return float("nan")
        own = self.record.masses(self.mode.mass)
        stated = np.array([float(np.median(own[run.rows])) for run in self.runs])
        if getattr(self.mode, "drive", "force") == "base":
            stated = np.ones(len(self.runs))
        return _median(self.masses / stated)


def _median(values: Iterable[float]) -> float:
    known = np.array([value for value in values if np.isfinite(value)])
    return float(np.median(known)) if len(known) else float("nan")


def _with_steady_amplitudes(table: pd.DataFrame, record: Record) -> pd.DataFrame:
    """Resonances with those of sweeps at one amplitude and without phases where the force is least."""
    found = table.copy()
    for place in np.flatnonzero(table["method"] == "peak"):
        own = record.table[record.table["sweep"] == table["sweep"][place]]
        if np.ptp(np.log(own["amplitude"])) < 0.5 * np.ptp(np.log(own["force"])):
            row = (own["force"] / own["amplitude"]).idxmin()
            for name in ("force", "frequency", "amplitude"):
                found.loc[place, name] = own[name][row]
            found.loc[place, "row"] = row
    return found


def _labels(runs: Iterable[Run]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(run.sweep for run in runs))


def _named(sweeps: Iterable[str], most: int = 5) -> str:
    labels = list(sweeps)
    more = f" and {len(labels) - most} more" if len(labels) > most else ""
    return f"sweep{'s' * (len(labels) != 1)} {', '.join(labels[:most])}{more}"


#: Relative scatter beyond which the mass of pairs of rows is not known.
SURE = 0.2
#: An amplitude is wild where its neighbours say less than a third or more than three times as much.
WILD = 3.0
#: Phases miss a straight line in Y by so much of |Y| (median) where they have nothing to do with the amplitudes.
INCOHERENT = 0.5
#: Mean cosine of the steps of phase from row to row below which they are no curve.
SMOOTH = 0.75
#: More radians than a phase can pass in a sweep over a few modes; degrees pass 180.
MOST_RADIANS = 6.0 * pi
#: A mean sine of the phase is below 0 where it is so many standard errors.
CERTAIN = 4.0


def _is_incoherent(run: Run, turn: Implied) -> bool:
    assert run.phase is not None
    if np.abs(run.phase).max() > MOST_RADIANS:
        return True
    if len(run) < 6:
        return False
    smooth = float(np.mean(np.cos(np.diff(run.phase))))
    if np.ptp(np.unwrap(run.phase)) > MOST_RADIANS:
        return True
    return turn.miss > INCOHERENT and smooth < SMOOTH


_AS_LAG: dict[str, Callable[[FloatArray], FloatArray]] = {
    "": lambda phase: phase,
    "negated": lambda phase: -phase,
    "minus pi": lambda phase: phase + pi,
    "acceleration": lambda phase: pi - phase,
}


def _kind_of_phase(turn: Implied) -> str:
    """What a phase is that is no lag: negated, minus pi, the lead of the acceleration; nothing where it may be one."""
    half = quarter_turns(turn.offset) == 2
    if turn.taken < -CERTAIN:
        return "acceleration" if half else "negated"
    return "minus pi" if half and turn.taken > CERTAIN else ""


def check_exchange(view: View) -> Finding | None:
    """Force and response exchanged: the force has a maximum where force per response, the dynamic stiffness, has it."""
    seen = []
    for run in view.raw:
        if len(run) < 5:
            continue
        F, g = np.log(run.F), -run.compliance
        top = int(np.argmax(F))
        inside = 0 < top < len(run) - 1 and min(F[top] - F[0], F[top] - F[-1]) > 0.7 * log(2.0)
        steady = np.ptp(np.log(run.A)) < 0.3 * np.ptp(F)
        if inside and steady and g[top] > np.quantile(g, 0.9) and np.corrcoef(F, g)[0, 1] > 0.95:
            seen.append(run)
    if len(seen) < max(1, 0.5 * sum(len(run) >= 5 for run in view.raw)):
        return None
    what = f"the force passes through a maximum in {_named(_labels(seen))} while the response stays the same"
    return Finding("units", "refuse", what, "are the columns force and amplitude exchanged?", _labels(seen))


def check_noise(view: View) -> Finding | None:
    """Amplitudes that jump from row to row as much as over the whole sweep: no resonance at all."""
    if view.curve:
        return None
    smooth = [run for run in view.runs if run.phase is not None and np.mean(np.cos(np.diff(run.phase))) > SMOOTH]
    if len(smooth) == len(view.runs):
        return None
    return Finding(
        "edge-of-sweep",
        "refuse",
        "amplitudes jump from row to row as much as over the whole sweep: there is no resonance in this record",
        "check the channel and the tracking filter, or take a band with a resonance",
        view.record.sweeps,
    )


def check_outlier(view: View) -> Finding | None:
    """Single amplitudes far from what the rows beside them say."""
    if not view.wild:
        return None
    table = view.record.table
    places = [f"row {row + 1} ({table['frequency'][row]:g} Hz, sweep {view.wild[row]})" for row in sorted(view.wild)]
    peaks = table.groupby("sweep", sort=False)["amplitude"].idxmax().tolist()
    taken = not view.record.has_phase and any(row in peaks for row in view.wild)
    values = ", ".join(f"{table['amplitude'][row]:g}" for row in sorted(view.wild)[:3])
    what = f"amplitude {values} at {', '.join(places[:3])}: more than {WILD:g} times off the rows beside it"
    advice = "correct the gain range of that reading, or leave the row out"
    return Finding("outlier", "refuse" if taken else "caution", what, advice, tuple(dict.fromkeys(view.wild.values())))


def check_phase_unit(view: View) -> Finding | None:
    """Phases that are no radians: they turn far more than a mode can, or have nothing to do with the amplitudes."""
    if not view.incoherent or not view.curve:
        return None
    what = (
        f"the phases of {_named(view.incoherent)} jump or turn as no lag in radians does, though the amplitudes do not"
    )
    advice = "are they degrees? divide by 57.3 (degrees taken modulo 2 pi cannot be saved: import the file anew)"
    return Finding("phase-unit", "refuse", what, advice, view.incoherent)


_KINDS = {
    "negated": ("falls through -pi/2: it is the lead of the displacement, or of force over displacement", "negate it"),
    "minus pi": (
        "runs from -pi to 0: half a turn too small, as of a sensor mounted backwards or an acceleration's lag",
        "add pi, or reverse the sensor",
    ),
    "acceleration": ("falls from pi to 0: it is the lead of the acceleration", "take pi - phase"),
}


def check_phase_sign(view: View) -> Finding | None:
    """Phases by which the structure would give energy."""
    if not view.wrong_sign:
        return None
    kinds = list(dict.fromkeys(view.wrong_sign.values()))
    what = " and ".join(f"the phase {_KINDS[kind][0]}" for kind in kinds)
    what += ", so that the structure would give energy; wanted is the lag of displacement behind force, 0 to pi"
    advice = "; ".join(dict.fromkeys(_KINDS[kind][1] for kind in kinds)) + " (lead_deg where the file is imported)"
    return Finding("phase-sign", "refuse", what, advice, tuple(view.wrong_sign))


#: A constant offset is one beyond this, rad, in the mean and in most sweeps, and beyond so many standard errors.
OFFSET, OFFSET_ERRORS = 0.04, 3.0


def check_phase_offset(view: View) -> Finding | None:
    """A constant that all phases carry: they are not pi/2 where rows of like amplitude say the resonance is."""
    turns = [(run, turn) for run, turn in zip(view.runs, view.turns, strict=True) if turn and turn.both_sides]
    turns = [(run, turn) for run, turn in turns if run.sweep not in view.wrong_sign]
    if not turns:
        return None
    offsets = np.array([turn.offset for _, turn in turns])
    middle = float(np.median(offsets))
    spread = float(np.sqrt(np.mean([turn.scatter**2 for _, turn in turns]) / len(turns)))
    other_law = float(np.median([turn.damping for _, turn in turns]))
    if (
        abs(middle) < max(OFFSET + other_law, OFFSET_ERRORS * spread)
        or np.mean(offsets * np.sign(middle) > 0.5 * OFFSET) < 0.5
    ):
        return None
    sweeps = _labels(run for run, turn in turns if abs(turn.offset) > 0.5 * OFFSET)
    way = "large" if middle > 0.0 else "small"
    what = f"the phases are {abs(middle):.3f} rad ({np.degrees(abs(middle)):.1f} degrees) too {way}"
    what += f" in {_named(sweeps)}: they are not pi/2 between rows of like amplitude"
    far = abs(middle) > 0.25 * pi
    advice = (
        f"correct the delay of the channels (lead_deg = {np.degrees(middle):.1f}), or look for a second mode beside"
    )
    return Finding("phase-offset", "refuse" if far else "caution", what, advice, sweeps)


def check_energy(view: View) -> Finding | None:
    """Energies that force and motion do not allow: E <= pi F A always, and equal to it at resonance."""
    if "energy" not in view.record.table.columns:
        return None
    table = view.record.table
    most = pi * (table["force"] * table["amplitude"]).to_numpy(dtype=np.float64)
    share = energy_per_cycle(view.record) / most
    share[[row for row in view.wild]] = np.nan
    beyond = share > ENERGY
    small = all(
        np.nanmax(share[run.rows]) < 1.0 / ENERGY_SHORT
        for run, seen in zip(view.runs, view.resonant, strict=True)
        if seen
    )
    if not beyond.any() and not (small and any(view.resonant)):
        return None
    row = int(np.nanargmax(share))
    what = f"energy {table['energy'][row]:g} at row {row + 1} is {share[row]:.3g} of pi F A, "
    what += "the most that force and motion allow"
    if not beyond.any():
        what += "; at a resonance it is all of it"
    advice = "check the unit of the energy and whether it is that of one cycle, or leave the column out"
    return Finding("energy", "refuse", what, advice, _labels(run for run in view.runs if beyond[run.rows].any()))


#: Energy beyond pi F A by this factor is no noise; a resonance that takes less than 1 over that one is none.
ENERGY, ENERGY_SHORT = 1.25, 3.0


def check_edge(view: View) -> Finding | None:
    """Sweeps that hold no resonance: without a phase their last row would be taken for it."""
    beside = [(run, lag) for run, lag, seen in zip(view.runs, view.lags, view.resonant, strict=True) if not seen]
    seen = {run.sweep for run, held in zip(view.runs, view.resonant, strict=True) if held}
    beside = [(run, lag) for run, lag in beside if run.sweep not in seen]
    if not beside:
        return None
    below = all(np.argmax(run.compliance) > len(run) // 2 for run, _ in beside)
    above = all(np.argmax(run.compliance) < len(run) // 2 for run, _ in beside)
    where = "stops below its resonance" if below else "starts above its resonance" if above else "holds no resonance"
    sweeps = _labels(run for run, _ in beside)
    blind = any(lag is None for _, lag in beside)
    what = f"{_named(sweeps)}: the range {where}; the largest response stands at its edge"
    advice = "sweep on past the resonance" + (
        ", or record the phase: without it the edge would be taken for it" if blind else ""
    )
    return Finding("edge-of-sweep", "refuse" if blind else "caution", what, advice, sweeps)


#: Peaks farther apart than this ratio of frequencies are of different modes for certain.
SEPARATE = 1.08


def _further_peaks(view: View) -> list[tuple[Run, FloatArray]]:
    found = [(run, run.omega[peaks_of(run)] / RAD_S_PER_HZ) for run in view.runs]
    return [(run, peaks) for run, peaks in found if len(peaks) > 1]


def check_several_modes(view: View) -> Finding | None:
    """More than one resonance in the range."""
    further = _further_peaks(view)
    if not further:
        return None
    run, peaks = max(further, key=lambda pair: len(pair[1]))
    apart = any(float(p.max() / p.min()) > SEPARATE for _, p in further)
    most = len(further) >= 0.5 * len(view.record.sweeps)
    what = f"{len(peaks)} resonances in sweep {run.sweep}: at {', '.join(f'{p:.4g}' for p in peaks[:6])} Hz"
    advice = "keep the rows of one mode only" if apart else "is it two close modes, or one in two planes? see gap"
    sweeps = _labels(run for run, _ in further)
    return Finding("several-modes", "refuse" if apart and most else "caution", what, advice, sweeps)


#: Bandwidths squared per second, (df/dt)/(2 zeta f)^2, beyond which a sweep is no steady state; beyond which no
#: answer holds.
FAST, TOO_FAST = 0.3, 3.0


def check_sweep_rate(view: View) -> Finding | None:
    """Sweeps faster than the resonance can follow: by their rate where it is known, else by beats after the peak."""
    rates = _rates(view)
    fast = {sweep: eta for sweep, eta in rates.items() if eta > FAST}
    if fast:
        sweep = max(fast, key=lambda label: fast[label])
        what = f"{_named(fast)}: the frequency moves {fast[sweep]:.2g} half-power bandwidths in the time one takes"
        verdict = "refuse" if fast[sweep] > TOO_FAST else "caution"
        return Finding(
            "sweep-rate", verdict, what, f"sweep {fast[sweep] / 0.1:.0f} times slower, or dwell", tuple(fast)
        )
    if rates:
        return None
    beats = {run.sweep: beats_of(run) for run in view.runs}
    turned = _labels(run for run, turn in zip(view.runs, view.turns, strict=True) if turn and _is_dragged(turn))
    ringing = {sweep: count for sweep, count in beats.items() if count or sweep in turned}
    if len(ringing) < 0.5 * len(view.record.sweeps):
        return None
    what = f"the response of {_named(ringing)} "
    what += "beats after its peak" if any(ringing.values()) else "lags ever more behind the frequency"
    sure = max(ringing.values()) > 1 or bool(turned)
    what += ": the sweep was faster than the mode could follow" + (
        "" if sure else ", or a second mode stands beside it"
    )
    verdict = "refuse" if sure else "caution"
    return Finding("sweep-rate", verdict, what, "sweep slower, or dwell; state sweep_rate (Hz/s)", tuple(ringing))


#: A phase offset and a misfit of Y by a line that only a sweep faster than the mode could follow has together.
DRAGGED, CURVED = 0.5, 0.25


def _is_dragged(turn: Implied) -> bool:
    return turn.both_sides and DRAGGED < abs(turn.offset) < 0.75 * pi and CURVED < turn.miss < INCOHERENT


def _rates(view: View) -> dict[str, float]:
    """(df/dt)/(2 zeta f)^2 of each sweep at its resonance, where the rate is known."""
    table = view.record.table
    if "sweep_rate" not in table.columns:
        return {}
    implied = view.implied
    half_power = 2.0 * (implied["damping_ratio"] * implied["frequency"]).to_numpy(dtype=np.float64)
    found = {}
    for sweep, width in zip(implied["sweep"], half_power, strict=True):
        rates = np.abs(table.loc[table["sweep"] == sweep, "sweep_rate"].to_numpy(dtype=np.float64))
        rate = float(np.max(rates[np.isfinite(rates)], initial=0.0))
        if width > 0.0:
            found[str(sweep)] = rate / width**2
    return found


#: Forces of levels differ by this factor at least; of one level by less than a quarter of that (in the logarithm).
LEVEL = 1.12


def check_mixed_levels(view: View) -> Finding | None:
    """One label, several forces: rows of different levels take turns over the same frequencies."""
    mixed = {
        sweep: levels for sweep, levels in ((sweep, _levels(view, sweep)) for sweep in view.record.sweeps) if levels
    }
    if not mixed:
        return None
    levels = next(iter(mixed.values()))
    forces = ", ".join(f"{force:.4g}" for force in levels[:6])
    what = f"{_named(mixed)}: forces of {len(levels)} levels under one label ({forces})"
    return Finding("mixed-levels", "caution", what, "give every level a label of its own", tuple(mixed))


def _levels(view: View, sweep: str) -> list[float]:
    """Forces of the levels that one label holds; none where it is one level."""
    table = view.record.table[view.record.table["sweep"] == sweep].sort_values("frequency", kind="stable")
    x = np.log(table["force"].to_numpy(dtype=np.float64))
    order = np.sort(x)
    cuts = np.flatnonzero(np.diff(order) > log(LEVEL))
    groups = np.split(order, cuts + 1)
    if len(groups) < 2 or min(map(len, groups)) < 2 or max(map(np.ptp, groups)) > 0.5 * np.diff(order)[cuts].min():
        return []
    level = np.searchsorted(order[cuts], x - 1e-12)
    frequency = table["frequency"].to_numpy(dtype=np.float64)
    spans = [(frequency[level == k].min(), frequency[level == k].max()) for k in range(len(groups))]
    low, high = max(span[0] for span in spans), min(span[1] for span in spans)
    shared = (frequency >= low) & (frequency <= high)
    changes = int(np.sum(np.diff(level[shared]) != 0))
    return [float(np.exp(group.mean())) for group in groups] if changes >= max(4, len(groups)) else []


def check_repeats(view: View) -> Finding | None:
    """A sweep that is another one to the last digit, or a multiple of it: noise never repeats itself."""
    runs = [run for run in view.raw]
    copies: list[tuple[Run, Run, float]] = []
    for k, second in enumerate(runs):
        for first in runs[:k]:
            factor = _copied(first, second)
            if factor is not None and first.sweep != second.sweep:
                copies.append((first, second, factor))
                break
    if not copies:
        return None
    first, second, factor = copies[0]
    scaled = "" if abs(factor - 1.0) < 1e-9 else f" times {factor:.4g}"
    what = f"sweep {second.sweep} repeats sweep {first.sweep}{scaled} to the last digit, which no measurement does"
    same_force = all(np.allclose(a.F, b.F, rtol=1e-9) for a, b, _ in copies)
    verdict = "caution" if same_force and not scaled else "refuse"
    return Finding(
        "repeated-sweep", verdict, what, "leave the copy out: its rows would count twice", _labels(c[1] for c in copies)
    )


#: Proportional rows are a copy where their ratio is constant to so many parts, and their noise is larger than that.
COPY, NOISE_OF_COPY = 2e-4, 5.0


def _copied(first: Run, second: Run) -> float | None:
    """The factor by which the amplitudes of two runs differ, the same for all rows; None where they are no copy."""
    if len(first) != len(second) or not np.allclose(first.omega, second.omega, rtol=1e-9):
        return None
    same_phase = first.phase is None or (
        second.phase is not None and np.allclose(first.phase, second.phase, rtol=0.0, atol=1e-9)
    )
    if len(first) < FEWEST_ROWS:
        same = np.allclose(first.A, second.A, rtol=1e-12) and np.allclose(first.F, second.F, rtol=1e-12)
        return 1.0 if same and same_phase else None
    if np.allclose(first.A, second.A, rtol=1e-12) and same_phase:
        return 1.0
    ratio = np.log(second.A / first.A)
    if np.ptp(np.log(second.F / first.F)) > COPY:
        return None
    noisy = first.noise > NOISE_OF_COPY * COPY
    return float(np.exp(np.median(ratio))) if noisy and same_phase and np.ptp(ratio) < COPY else None


#: Levels are compared where their forces differ by this factor; resonant amplitude has fallen below this share.
FORCE_STEP, FALLEN = 1.1, 0.87


def check_amplitude_falls(view: View) -> Finding | None:
    """A resonant amplitude that falls with force: no passive structure does that."""
    table = view.implied[
        [
            all(seen for run, seen in zip(view.runs, view.resonant, strict=True) if run.sweep == sweep)
            for sweep in view.implied["sweep"]
        ]
    ]
    table = table.sort_values("force", kind="stable")
    F, A = table["force"].to_numpy(), table["amplitude"].to_numpy()
    pairs = [(i, j) for i in range(len(F)) for j in range(i + 1, len(F)) if F[j] > FORCE_STEP * F[i]]
    falling = [(i, j) for i, j in pairs if A[j] < FALLEN * A[i]]
    if not falling or len(falling) < 0.3 * len(pairs):
        return None
    i, j = min(falling, key=lambda pair: A[pair[1]] / A[pair[0]])
    what = f"resonant amplitude falls from {A[i]:.4g} at force {F[i]:.4g} to {A[j]:.4g} at force {F[j]:.4g}"
    advice = "check the labels and the force of each level, and whether the structure was altered between them"
    return Finding("amplitude-falls", "refuse", what, advice, tuple(table["sweep"].iloc[sorted({i, j})]))


#: Damping ratios beyond these are none of a structure that has a resonance.
LEAST_RATIO, LARGEST_RATIO = 1e-6, 0.5
#: A mass is of another system beyond this factor, or near a known one beyond 2.
OTHER_SYSTEM, NEAR_FACTOR = 3.0, 0.05
#: The same where the resonance is bent and has no phases: its parabola is off by a factor of 2 to 3.
OTHER_SYSTEM_BENT = 5.0


def check_units(view: View) -> Finding | None:
    """Record and mode that cannot be of one system of units: by the mass that the rows imply, else by the damping."""
    if view.mode is None:
        return None
    frequency = _median(view.implied["frequency"]) / view.mode.frequency
    for name, factor in FREQUENCY_FACTORS.items():
        for off in (factor, 1.0 / factor):
            if abs(log(frequency / off)) < 0.06:
                what = f"the record resonates at {frequency:.4g} times the frequency of the mode file ({name}?)"
                return Finding("units", "refuse", what, "give both in Hz", view.record.sweeps)
    ratio, zeta = view.mass_ratio, _median(view.implied["damping_ratio"])
    bent = not view.straight and ratio > 0.0 and abs(log(ratio)) < log(OTHER_SYSTEM_BENT)
    wrong = None if bent else guess_unit(ratio)
    impossible = not LEAST_RATIO < zeta < LARGEST_RATIO
    if wrong is None and not (impossible and (np.isnan(ratio) or not 0.5 < ratio < 2.0)):
        return None
    parts = [] if np.isnan(ratio) else [f"the rows imply {ratio:.4g} times the mass of the mode file"]
    parts.append(f"a damping ratio of {zeta:.3g} would follow")
    name = nearest_factor(ratio) if wrong else nearest_damping_factor(view, zeta)
    advice = "state force, amplitude, mass in one system" + (f": {name}?" if name else "")
    return Finding("units", "refuse", "; ".join(parts), advice, view.record.sweeps)


def guess_unit(ratio: float) -> float | None:
    """The factor by which force over amplitude is too large, where no structure but only a unit explains it."""
    size = abs(log(ratio)) if ratio > 0.0 else float("nan")
    if size > log(OTHER_SYSTEM) or (
        size > log(2.0) and any(abs(size - log(x)) < NEAR_FACTOR for x in UNIT_FACTORS.values())
    ):
        return ratio
    return None


def nearest_factor(ratio: float) -> str:
    """What the unit factor nearest to a ratio (or its inverse) means; nothing where none is near."""
    size = abs(log(ratio))
    names = {**UNIT_FACTORS, **SCALING_FACTORS}
    name = min(names, key=lambda key: abs(size - log(names[key])))
    return name if abs(size - log(names[name])) < 0.1 else ""


def nearest_damping_factor(view: View, zeta: float) -> str:
    """What the unit factor means that brings a damping ratio back to a structure's, by the simulated damping if any."""
    assert view.mode is not None
    viscous = view.mode.damping.get("viscous", {}).get("coefficient", 0.0)
    simulated = viscous / (2.0 * view.mode.mass * view.mode.omega_n) or 0.01
    return min(UNIT_FACTORS, key=lambda key: abs(abs(log(zeta / simulated)) - log(UNIT_FACTORS[key])))


#: Mass, frequency (of the lowest level) and damping ratio that are far from the mode file's, as factors.
FAR_MASS, FAR_FREQUENCY, FAR_DAMPING = 1.27, 1.1, 5.0
#: Without phases the mass is that of a parabola, which a bent resonance is not.
FAR_MASS_WITHOUT_PHASE = 1.8
#: Farther than this outside the rows no mode of the record is the one described.
OTHER_MODE = 1.25


def check_beyond_model(view: View) -> Finding | None:
    """Mass, frequency or damping far from the mode file's."""
    if view.mode is None or view.implied.empty:
        return None
    found = []
    table = view.implied.sort_values("force", kind="stable")
    frequency = float(table["frequency"].iloc[0])
    if abs(log(frequency / view.mode.frequency)) > log(FAR_FREQUENCY):
        found.append(f"resonance at {frequency:.4g} Hz, {view.mode.frequency:.4g} Hz in the mode file")
    far_mass = FAR_MASS if all(lag is not None for lag in view.lags) else FAR_MASS_WITHOUT_PHASE
    base = getattr(view.mode, "drive", "force") == "base"
    if not base and view.straight and view.mass_ratio > 0.0 and abs(log(view.mass_ratio)) > log(far_mass):
        name = nearest_factor(view.mass_ratio)
        found.append(f"the rows imply {view.mass_ratio:.3g} times its mass" + (f" ({name}?)" if name else ""))
    viscous = view.mode.damping.get("viscous", {}).get("coefficient", 0.0)
    simulated, zeta = viscous / (2.0 * view.mode.mass * view.mode.omega_n), float(table["damping_ratio"].iloc[0])
    if simulated and zeta > 0.0 and len(view.mode.damping) == 1 and abs(log(zeta / simulated)) > log(FAR_DAMPING):
        found.append(f"a damping ratio of {zeta:.3g}, {simulated:.3g} in the mode file")
    if not found:
        return None
    hertz = view.record.column("frequency")
    other = not hertz.min() / OTHER_MODE < view.mode.frequency < hertz.max() * OTHER_MODE
    advice = "model and record are of different modes" if other else "check the gain of the sensor and the mode file"
    return Finding("beyond-model", "refuse" if other else "caution", "; ".join(found), advice, view.record.sweeps)


#: Names of all checks.
NAMES = (
    "units", "phase-unit", "phase-sign", "phase-offset", "edge-of-sweep", "several-modes", "energy", "amplitude-falls",
    "outlier",
    "repeated-sweep", "mixed-levels", "sweep-rate", "beyond-model",
)  # fmt: skip
#: What noise and exchanged columns look like: anything but a copy.
_EVERYTHING = tuple(name for name in NAMES if name not in ("repeated-sweep", "mixed-levels"))
#: Every check, with the checks that its finding explains.
CHECKS: tuple[tuple[Callable[[View], Finding | None], tuple[str, ...]], ...] = (
    (check_exchange, _EVERYTHING),
    (check_noise, _EVERYTHING),
    (check_outlier, ("beyond-model",)),
    (check_mixed_levels, ("several-modes", "sweep-rate", "amplitude-falls")),
    (check_phase_unit, ("phase-sign", "phase-offset", "energy", "beyond-model")),
    (check_phase_sign, ("phase-offset", "energy")),
    (check_sweep_rate, ("several-modes", "phase-offset", "beyond-model", "edge-of-sweep", "units", "amplitude-falls")),
    (check_several_modes, ("phase-offset", "beyond-model", "amplitude-falls", "edge-of-sweep", "units")),
    (check_edge, ("amplitude-falls", "beyond-model", "phase-offset")),
    (check_energy, ()),
    (check_units, ("beyond-model", "amplitude-falls")),
    (check_phase_offset, ()),
    (check_repeats, ("amplitude-falls",)),
    (check_amplitude_falls, ("beyond-model",)),
    (check_beyond_model, ()),
)
