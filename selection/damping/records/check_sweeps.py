"""Checks of single sweeps: outliers, labels, several modes, and a rate that the resonance cannot follow.

Other modes may bend the phases of a run as a fast sweep does, or a part may split the mode: neither is then reported.
"""

from dataclasses import replace
from math import log, pi

import numpy as np

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray
from damping.records.implied import NEAR, fit_ratio, measure_miss
from damping.records.outliers import ISOLATED
from damping.records.phase_kinds import INCOHERENT
from damping.records.runs import Run, count_beats, find_run_peaks
from damping.records.view import Finding, NamedFinding, View, label_sweeps, name_sweeps, take_median


def check_outlier(view: View) -> Finding | None:
    """Single readings far from the course of the neighbouring rows.

    They stay in the fits of laws: in one of a hundred coarse sweeps such a reading is right, at the resonance.
    """
    table = view.record.frame
    largest = table.groupby("sweep", sort=False)["amplitude"].transform("max")
    beats = view.detected_rate is not None  # after a peak passed too fast the response falls to zero between beats
    outliers = [row for row in sorted(view.outliers) if not (beats and table["amplitude"][row] < NEAR * largest[row])]
    if not outliers:
        return None
    beside = [row for row in outliers if row in view.isolated and row not in view.misplaced]
    shown = ("amplitude", "phase") if view.record.has_phase else ("amplitude",)
    readings = [
        f"{', '.join(f'{name} {table[name][row]:g}' for name in shown)} at row {row + 1} "
        f"({table['frequency'][row]:g} Hz, sweep {view.outliers[row]})"
        for row in beside[:3]
    ]
    peaks = table.groupby("sweep", sort=False)["amplitude"].idxmax().tolist()
    taken = not view.record.has_phase and any(row in peaks for row in (*beside, *view.misplaced))
    what = [f"{'; '.join(readings)}: far from the neighbouring rows"] if readings else []
    advice = "every law is fitted to it (gap names what it sets aside): correct that reading (gain range, tracking), "
    advice += "or run again without the row"
    for row, sweep in view.misplaced.items():
        frequency = f"frequency {table['frequency'][row]:g} at row {row + 1}"
        what.append(f"{frequency} departs from the order of sweep {sweep}, which the reading keeps")
        advice = "correct that frequency, or run again without the row"
    if view.odd:
        what.append(str(view.odd))
        by_frequency, off = view.odd.quantity == "frequency", abs(view.odd.off)
        taken |= off > NO_RERUN if by_frequency else off > log(ISOLATED) and not view.record.has_phase
        advice = "every fit includes it: correct that reading, or run again without the row"
        lowest = any(run.F[0] == table["force"].min() for run in view.odd.runs)
        if lowest and not by_frequency and view.odd.off < 0.0:
            advice += "; if friction holds the structure at that force, the reading is right: leave that level out"
    sweeps = tuple(dict.fromkeys(view.outliers[row] for row in outliers))
    return Finding("outlier", "refuse" if taken else "caution", "; ".join(what), advice, sweeps)


#: Largest shift of frequency (ln) of a structure that is set up again, warms or loosens between two levels.
NO_RERUN = 0.05


FEWEST_OF_SWEEP = 5  #: fewest rows at one force, with lags on both sides of resonance, that are a sweep
BESIDE_RESONANCE = 0.25 * pi  #: least distance of these lags from pi/2, rad: that of the half-power points


def check_unlabelled(view: View) -> Finding | None:
    """Rows with a label each that are sweeps: at one force their lags turn through resonance."""
    table = view.record.frame
    if "phase" not in table or table["sweep"].nunique() < len(table):
        return None
    turns = table.groupby("force")["phase"].agg(["size", "min", "max"])
    passes = (turns["min"] < 0.5 * pi - BESIDE_RESONANCE) & (turns["max"] > 0.5 * pi + BESIDE_RESONANCE)
    sweeps = int(np.sum(passes & (turns["size"] >= FEWEST_OF_SWEEP)))
    if not sweeps:
        return None
    what = f"every row has a label of its own, though rows at one force turn through resonance ({sweeps} such forces)"
    advice = "give the rows of one sweep one label: with its own, each row counts as a level"
    return Finding("mixed-levels", "caution", what, advice, view.record.sweeps)


def check_mixed_levels(view: View) -> Finding | None:
    """Several force levels under one label: their rows alternate over the same frequencies, or are single peaks.

    The record is refused if the levels would be taken for one sweep without a resonance.
    """
    mixed = view.mixed_levels
    resonant = {leg.run.sweep for leg in view.legs if leg.resonant}
    if not mixed or view.record.is_decay:
        return None
    levels = next(iter(mixed.values()))
    forces = ", ".join(f"{force:.4g}" for force in levels[:6])
    what = f"{name_sweeps(mixed)}: forces of {len(levels)} levels under one label ({forces})"
    advice = "give every level a label of its own"
    uses_all_rows = view.record.has_phase or "energy" in view.record.frame
    advice += "" if uses_all_rows else ": of one label only the largest amplitude is used"
    blind = any(leg.lag is None and leg.run.sweep in mixed.keys() - resonant for leg in view.legs)
    return Finding("mixed-levels", "refuse" if blind else "caution", what, advice, tuple(mixed))


SPLIT = 1.03  #: a simulated mode farther than this factor from both of two peaks is neither of them
SEPARATE = 1.08  #: peaks farther apart than this ratio of frequencies certainly belong to different modes


def _find_further_peaks(view: View) -> list[tuple[Run, FloatArray]]:
    peaks = [(run, run.omega[find_run_peaks(run)] / RAD_S_PER_HZ) for run in view.runs]
    return [(run, peaks) for run, peaks in peaks if len(peaks) > 1]


def check_several_modes(view: View) -> Finding | None:
    """More than one resonance in the range; of a mode that a tuned part splits, a diagnosis names the second mode."""
    further = _find_further_peaks(view)
    if not further:
        return None
    run, peaks = max(further, key=lambda pair: len(pair[1]))
    apart = any(float(p.max() / p.min()) > SEPARATE for _, p in further)
    most = len(further) >= 0.5 * len(view.record.sweeps)
    what = f"{len(peaks)} resonances in sweep {run.sweep}: at {', '.join(f'{p:.4g}' for p in peaks[:6])} Hz"
    advice = "keep the rows of one mode only" if apart else "is it two close modes, or one in two planes? see gap"
    sweeps, kind, mode = label_sweeps(run for run, _ in further), Finding, view.mode
    if apart and mode is not None and peaks.min() * SPLIT < mode.frequency < peaks.max() / SPLIT:
        split = sum(len(p) == 2 and is_split(own, view.stated_mass, mode.omega_n) for own, p in further)
        kind, by = (NamedFinding, "") if 2 * split > len(further) else (Finding, " with --despite several-modes")
        advice = f"the mode file's {mode.frequency:.4g} Hz lies between them: if a part tuned to it splits the mode "
        advice += f"(an absorber, a fluid), or the force drops, cut nothing; damping gap{by} decides"
    return kind("several-modes", "refuse" if apart and most else "caution", what, advice, sweeps)


#: Sweep rate (df/dt)/(2 zeta f)^2, bandwidths swept in the reciprocal of the bandwidth, beyond which a sweep is not a
#: steady state: peaks differ by more than some per cent.
FAST = 0.3
SLOW = 0.1  #: rate that is advised: peaks lose amplitude about as its square, so a tenth of that at ``FAST``
#: Rate beyond which no result holds: the damping of an integrated linear mode, with the mass taken from the sweep, is
#: 6 % off at 1.7, and 12 % off, beyond the band, at 2.1.
TOO_FAST = 2.0


def check_sweep_rate(view: View) -> Finding | None:
    """Sweeps faster than the resonance can follow: by their rate if it is known, else by beats after the peak."""
    rates = view.rates
    fast = {sweep: eta for sweep, eta in rates.items() if eta > FAST}
    if fast:
        sweep = max(fast, key=lambda label: fast[label])
        what = f"{name_sweeps(fast)}: the frequency moves {fast[sweep]:.2g} half-power bandwidths in the time one takes"
        verdict = "refuse" if fast[sweep] > TOO_FAST else "caution"
        advice = f"sweep {fast[sweep] / SLOW:.0f} times slower, or dwell"
        return Finding("sweep-rate", verdict, what, advice, tuple(fast))
    if rates:
        return None
    middle = take_median(view.implied["frequency"])
    width = 2.0 * take_median(view.implied["damping_ratio"]) * middle
    apart = any(float(p.max() / p.min()) > SEPARATE for _, p in _find_further_peaks(view))
    rate = view.detected_rate
    if rate is not None and not apart and abs(rate) * middle > FAST * width**2:
        what = f"the phases turn late, as in a sweep of {abs(rate) * 60.0 / log(2.0):.2g} octaves a minute"
        advice = "sweep slower, or dwell; peaks are corrected: state sweep_rate (Hz/s) to be sure"
        return Finding("sweep-rate", "caution", what, advice, view.record.sweeps)
    beats = {run.sweep: count_beats(run) for run in view.runs}
    curved = [
        (run, turn)
        for run, turn in view.turns
        if turn and turn.both_sides and DRAGGED < abs(turn.offset) < OPPOSED and CURVED < turn.miss < INCOHERENT
    ]
    turned = label_sweeps(run for run, turn in curved if not is_of_other_modes(run, turn.miss))
    ringing = {sweep: count for sweep, count in beats.items() if count or sweep in turned}
    if len(ringing) < 0.5 * len(view.record.sweeps):
        return None
    what = f"the response of {name_sweeps(ringing)} "
    what += "beats after its peak" if any(ringing.values()) else "lags ever more behind the frequency"
    sure = max(ringing.values()) > 1 or bool(turned)
    what += ": the sweep was faster than the mode could follow"
    what += "" if sure else ", or a second mode stands beside it"
    verdict = "refuse" if sure else "caution"
    return Finding("sweep-rate", verdict, what, "sweep slower, or dwell; state sweep_rate (Hz/s)", tuple(ringing))


DRAGGED = 0.5  #: phase offset, rad, that together with ``CURVED`` only a sweep faster than the mode can follow has
OPPOSED = 0.75 * pi  #: phase offset, rad, from which a phase is of opposite sign rather than late
CURVED = 0.25  #: misfit of Y by a straight line, relative to |Y|, together with that offset


_RESIDUALS = np.linspace(-0.9, 0.9, 37)  #: trial compliances of other modes, over the largest of the run
#: If modes far off cause the misfit of Y by a straight line, allowing for them leaves at most this share of it; of a
#: fast sweep's misfit it leaves three fifths.
OF_FAR_MODES = 0.3
#: The same for one close mode. Of 155 runs of one mode swept fast, each integrated, allowing for a second mode leaves
#: .08 or more; of 47 and 28 runs of two close modes, in closed form, at least three quarters and a quarter are below.
OF_CLOSE_MODE = 0.075
#: Largest departures (ln) of mass and frequency of a mode from those that a record implies in which a part splits it: a
#: simulation may hold the part, up to a tenth of the mass, at rest on it. Of 37 split modes in closed form, masses are
#: within .1 and frequencies within .04; of 49 pairs of separate modes, the second with a fifth to three times the
#: compliance of the first and of either sign, the mode file between them, masses are off by .2 or more. Of a fresh
#: draw 72 of 79 split modes and none of 55 pairs pass.
OFF_MASS = 0.15
OFF_FREQUENCY = 0.05


def is_of_other_modes(run: Run, miss: float) -> bool:
    """Whether other modes, far or close, explain the median misfit ``miss`` of Y by a straight line, relative to Y."""
    return measure_miss_beside_modes(run) <= OF_FAR_MODES * miss or measure_miss_of_two(run) <= OF_CLOSE_MODE * miss


def measure_miss_beside_modes(run: Run) -> float:
    """The least median misfit of Y by a straight line if other modes add a compliance R: 1/Y - R in place of 1/Y."""
    assert run.phase is not None
    compliance = run.A / run.F * np.exp(-1j * run.phase)
    of_mode = [compliance - share * np.abs(compliance).max() for share in _RESIDUALS]
    return min(measure_miss(replace(run, A=run.F * np.abs(H), phase=-np.angle(H))) for H in of_mode)


def measure_miss_of_two(run: Run) -> float:
    """Median misfit, relative to it, of the compliance by two modes and a constant: a ratio of squares in omega^2."""
    return _fit_two(run)[2]


def is_split(run: Run, mass: float, omega_n: float) -> bool:
    """Whether the two modes of a run are the mode of that ``mass`` and ``omega_n``, split by a part tuned to it.

    Far above both, the part moves no more and the compliance is -1/(M omega^2); far below, it moves along, and the
    compliance is 1/(M omega_n^2). Two modes of a mass each imply the mass 1/(1/M_1 + 1/M_2).
    """
    if run.phase is None:
        return False
    (far, b, c, d, e), (middle, unit), _ = _fit_two(run)
    own = np.array([b - far * d, c - far * e])  # of the modes alone, without the constant
    below = -middle / unit
    implied = -1.0 / (own[0] * unit).real
    static = ((own[0] * below + own[1]) / (below**2 + d * below + e)).real
    if not (implied > 0.0 and static > 0.0):
        return False
    off_frequency = 0.5 * log(1.0 / (implied * static)) - log(omega_n)
    return abs(log(implied / mass)) < OFF_MASS and abs(off_frequency) < OFF_FREQUENCY


def _fit_two(run: Run) -> tuple[FloatArray | ComplexArray, tuple[float, float], float]:
    """The ratio of `fit_ratio` in x = (omega^2 - middle)/unit fitted to the compliance; middle and unit; the misfit."""
    assert run.phase is not None
    middle = float(np.mean(run.omega**2))
    unit = float(np.abs(run.omega**2 - middle).max())
    ratio, miss = fit_ratio((run.omega**2 - middle) / unit, run.A / run.F * np.exp(-1j * run.phase))
    return ratio, (middle, unit), miss
