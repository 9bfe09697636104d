"""A record and a mode as a problem: rows, simulation, the scales of both, what is known of noise and repeatability.

Also, before any fit: cautions about what a record cannot say, and errors for inputs that are plainly wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.effects.contract import Effect, Scales
from damping.errors import AnalysisError
from damping.forces import Viscous, from_damping
from damping.gap.fit import ModelFit
from damping.gap.model import Problem, Scatter
from damping.gap.rows import UNSEEN, PhasorRows, join_states, on_base, read_rows
from damping.gap.simulation import NO_SCATTER, Simulation, list_of_states
from damping.gap.simulator import Simulate, Simulator
from damping.gap.unknowns import FIRST_GUESS, Unknowns, is_stated, list_unknowns, roughness, stated_noise
from damping.records.mode import Mode
from damping.records.record import Record

MOST_ROWS = 5_000  #: most rows of a diagnosis, so that it takes minutes, not hours
NOISE_ERROR = 0.2  #: least standard deviation of the ln of a noise that was estimated from roughness
_ANOTHER_MODE = 0.12  #: a resonance at a larger relative distance from the simulated one is that of another mode
#: It is not where the response between the two stays above this share of the largest, as of one heavily damped mode.
_BROAD = 0.5
_BROAD_ROWS = 2  #: that response must be measured at more rows than this
_FEW_ROWS = 3  #: fewest rows of a sweep that can show a resonance
_CONSTANT = 0.05  #: Largest range of ln amplitude of a sweep that a controller held at constant amplitude.


@dataclass(frozen=True)
class Setting:
    """A problem with its noise and repeatability."""

    problem: Problem
    scatter: Scatter | None  #: repeatability from sweep to sweep as stated; None where it is to be estimated
    #: ``amplitude_noise``, ``phase_noise``: whether the record states them
    amplitude_noise: bool
    phase_noise: bool
    dispersion: float = 1.0  #: residuals of the best explanation over noise, 1 where it fits

    @property
    def noise_error(self) -> float:
        """Standard deviation of the ln of the noise; one estimated from n rows is known to sqrt(2/n) at best."""
        rows = self.problem.rows
        of_rows = 0.0 if rows.of_peaks else float(np.sqrt(2.0 / len(rows)))  # of single rows it is a mere guess
        return 0.0 if self.noise_known else max(NOISE_ERROR, of_rows)

    @property
    def unknowns(self) -> Unknowns:
        """Candidates of repeatability and noise."""
        return list_unknowns(self.scatter, self.problem.scales.bandwidth, self.noise_error, self.dispersion)

    @property
    def noise_known(self) -> bool:
        """Whether the noise of all measured quantities is stated."""
        return self.amplitude_noise and (self.phase_noise or not self.problem.rows.has_phase)

    def with_noise_of(self, reference: ModelFit) -> Setting:
        """The setting with unstated noise estimated from the roughness of a fit's residuals.

        The fit absorbs part of the noise: with k variables determined by m values the mean square residual is 1 - k/m
        of it.
        """
        rows, n = reference.model.problem.rows, len(reference.model.problem.rows)
        factor = reference.model.scatter.factor * np.sqrt(reference.measured.size / reference.freedom)
        if not self.amplitude_noise:
            rows = replace(rows, sd_amplitude=roughness(rows, reference.r[:n] * rows.sd_amplitude * factor))
        if rows.has_phase and not self.phase_noise:
            rough = roughness(rows, reference.r[n : 2 * n] * rows.sd_phase * factor)
            rows = replace(rows, sd_phase=np.where(rows.sd_phase < UNSEEN, rough, UNSEEN))
        return replace(self, problem=replace(self.problem, rows=rows))

    def has_noise_of(self, other: Setting) -> bool:
        """Whether the noise is that of another setting within `noise_error`, over which the evidence integrates."""
        a, b = self.problem.rows, other.problem.rows
        changes = np.log([a.sd_amplitude / b.sd_amplitude, a.sd_phase / b.sd_phase])
        return bool(np.sqrt(np.mean(changes**2)) < self.noise_error)


State = tuple[Record, Mode]  #: a further state of the structure: its record and the mode that simulates it


def setting(
    record: Record,
    mode: Mode,
    states: Sequence[State] = (),
    simulate: Simulate | None = None,
    shaken: Sequence[FloatArray] = (),
    groups: tuple[tuple[int, ...], ...] = (),
) -> Setting:
    """The setting of a record and the mode that simulates it; noise that is not stated is a first guess.

    Args:
        states: further states of the same structure, whose effects are shared.
        simulate: the user's own simulation.
        shaken, groups: of each state, see `damping.gap.states.Driven`; empty where forces drive all.

    AnalysisError: states that simulate different damping forces.
    """
    rows = [stated_noise(read_rows(measured, state)) for measured, state in ((record, mode), *states)]
    if shaken:
        rows = [on_base(of_state, masses[of_state.row]) for of_state, masses in zip(rows, shaken, strict=True)]
    joined = join_states(list(zip(rows, (mode, *(state for _, state in states)), strict=True)))
    simulator = None if simulate is None else Simulator.read(simulate, mode)
    swept: tuple[str, ...] = ()
    if np.any(joined.rate):  # a column of rates needs no law, and a force that stays no course between rows
        wanders = any(np.ptp(joined.F[run]) > 0.0 for run in joined.runs)
        swept = ("ringing", "begun", *["law"] * bool(mode.rig.rate), *["held"] * wanders)
    simulation = Simulation(mode, list_of_states(joined), swept, simulator, groups)
    problem = Problem(joined, simulation, scales(joined, mode))
    stated = [is_stated(measured) for measured, _ in ((record, mode), *states)]
    given = mode.repeatability
    scatter: Scatter | None = Scatter(given.amplitude or NO_SCATTER, given.frequency or NO_SCATTER)
    if given.amplitude is None and given.frequency is None and len(joined.sweeps) > 1:  # one sweep shows none
        scatter = None
    return Setting(problem, scatter, *(all(part) for part in zip(*stated, strict=True)))


def exclude_effects(effects: Mapping[str, Effect], mode: Mode, rows: PhasorRows) -> dict[str, Effect]:
    """The library without effects that the rig is known not to have, or whose parameter the record itself gave."""
    on_one_base = bool(rows.shaken.all()) and not np.ptp(rows.state) and not rows.added.any()
    known = {
        "amplitude-scale": on_one_base,  # a gain is equivalent to the participation, estimated from the rows
        "planar-coupling": mode.rig.planes == 1,
        "force-dropout": mode.rig.force == "measured",
        "sweep-rate": mode.rig.rate is not None or bool(np.any(rows.rate != 0.0)),
        "viscous-coefficient": mode.tolerance.from_record and Viscous.name in mode.damping,
        "natural-frequency": mode.tolerance.from_record,
    }
    return {name: effect for name, effect in effects.items() if not known.get(name, False)}


def scales(rows: PhasorRows, mode: Mode) -> Scales:
    """The scales of a problem."""
    A_high = float(rows.A.max())
    stiffness = mode.mass * mode.omega_n**2
    simulated = float(from_damping(mode.damping).quadrature(A_high, mode.omega_n)) / A_high
    measured = float((rows.F / rows.A).min())  # at resonance the dynamic stiffness is C/A
    return Scales(
        A_low=float(np.quantile(rows.A, 0.1)),
        A_high=A_high,
        omega_n=mode.omega_n,
        M=mode.mass,
        viscous=mode.damping.get(Viscous.name, {}).get("coefficient", 0.0),
        bandwidth=0.5 * (simulated or measured) / stiffness,
        reach=float(np.abs(rows.omega / mode.omega_n - 1.0).max()),
        frequency=mode.tolerance.frequency,
        damping=mode.tolerance.viscous,
        sweeps=len(rows.sweeps),
        states=1 + int(rows.state.max()),
        simulated=mode.damping,
        rate=float(np.abs(rows.rate).max()),
    )


def refuse_rows(states: Sequence[State]) -> None:
    """AnalysisError for more than ``MOST_ROWS`` rows, or a record of another mode than its model's."""
    count = sum(len(record) for record, _ in states)
    if count > MOST_ROWS:
        kept = f"keep one row in {-(-count // MOST_ROWS)}"
        raise AnalysisError(f"{states[0][0].source}: {count} rows; at most {MOST_ROWS} can be diagnosed: {kept}")
    for record, mode in states:
        _refuse_other_mode(read_rows(record, mode), mode)


def _refuse_other_mode(rows: PhasorRows, mode: Mode) -> None:
    """AnalysisError for a record that is plainly of another mode.

    Its frequencies, or the largest amplitudes per force of all its sweeps, lie far from the mode's frequency, and no
    response as broad as a heavily damped resonance joins the two.
    """
    # frequency of the row without its added mass
    hertz = rows.omega / RAD_S_PER_HZ * np.sqrt(1.0 + rows.added / mode.mass)
    response = rows.A / rows.F
    peak = float(hertz[np.argmax(response)])
    inside = hertz.min() * (1.0 - _ANOTHER_MODE) < mode.frequency < hertz.max() * (1.0 + _ANOTHER_MODE)
    edge = peak in (hertz.min(), hertz.max())
    between = (hertz - peak) * (hertz - mode.frequency) <= 0.0
    broad = len(np.unique(hertz[between])) > _BROAD_ROWS and bool(response[between].min() > _BROAD * response.max())
    # one sweep near it is enough: joints and rubber move the resonance of other levels far
    of_sweeps = np.array([hertz[run[np.argmax(response[run])]] for run in rows.runs])
    if inside and (edge or broad or np.abs(of_sweeps / mode.frequency - 1.0).min() < _ANOTHER_MODE):
        return
    raise AnalysisError(
        f"model and record are of different modes: simulated resonance {mode.frequency:g} Hz, "
        f"record {hertz.min():g} to {hertz.max():g} Hz with its largest response at {peak:g} Hz"
    )


def record_cautions(rows: PhasorRows, record: Record, mode: Mode, *, simulated: bool = False) -> list[str]:
    """Cautions about what this record cannot say; ``simulated``: the mode only stands for a user's own simulation."""
    cautions = []
    if rows.at_resonance:
        cautions.append(
            "each sweep is one row without a phase: it is taken to be at phase resonance, where the force balances the "
            "damping; effects that only shift the resonance cannot be identified"
        )
    elif not rows.has_phase:
        cautions.append(
            "no phase: only the shape of the amplitudes separates phase lag, conservative and dissipative forces"
        )
    if rows.level_count < 2:
        cautions.append(
            "one force level: dependence on amplitude is visible only along the sweep, and no level can be held out"
        )
    of_sweeps = zip(rows.sweeps, rows.runs, strict=True)
    if few := [sweep for sweep, run in of_sweeps if len(run) < _FEW_ROWS and not rows.resonant[run].all()]:
        cautions.append(f"fewer than {_FEW_ROWS} rows in sweep {', '.join(few[:5])}: too few to show a resonance")
    cautions += _list_resonance_cautions(rows)
    if mode.repeatability.amplitude is None and mode.repeatability.frequency is None and len(rows.sweeps) < 3:
        cautions.append("repeatability is not stated and cannot be estimated from so few sweeps")
    cautions += _list_noise_cautions(rows, record)
    if not mode.damping and not simulated:
        cautions.append("the simulation has no damping")
    if mode.tolerance.from_record:
        cautions.append(
            "frequency, mass and damping of the simulation were taken from this record (from_record): they are "
            "free, and errors in them cannot be detected"
        )
    return cautions


def _list_noise_cautions(rows: PhasorRows, record: Record) -> list[str]:
    """Cautions about noise that the record does not state, or states as 0, which no measurement has."""
    cautions, zero = [], {name: record.column(name, 1.0) == 0.0 for name in ("amplitude_sd", "phase_sd")}
    of_rows = "estimated from the roughness along each sweep"
    if not is_stated(record)[0]:
        taken = f"assumed to be {100.0 * FIRST_GUESS:g} % of each amplitude" if rows.of_peaks else of_rows
        cautions.append(
            f"noise is not stated{' (amplitude_sd is 0)' if zero['amplitude_sd'].all() else ''}: it was {taken}"
        )
    for name, is_zero in zero.items():
        if is_zero.any() and not is_zero.all():
            of_others = "the median of the other rows is used there"
            cautions.append(f"{name} is 0 in {is_zero.sum()} of {len(record)} rows, which states no noise: {of_others}")
        elif is_zero.all() and name == "phase_sd":
            taken = f"assumed to be {FIRST_GUESS:g} rad" if rows.of_peaks else of_rows
            cautions.append(f"phase_sd is 0, which states no noise: it was {taken}")
    return cautions


def _list_resonance_cautions(rows: PhasorRows) -> list[str]:
    """Cautions about sweeps of constant amplitude, and those that do not reach resonance."""
    constant, off_resonance = [], []
    for sweep, run in zip(rows.sweeps, rows.runs, strict=True):
        if len(run) < _FEW_ROWS:
            continue
        if np.ptp(rows.u[run]) < _CONSTANT:
            constant.append(sweep)
        peak = int(np.argmax((rows.u - np.log(rows.F))[run]))
        passed = rows.has_phase and rows.phase[run].min() < 0.5 * pi < rows.phase[run].max()
        if peak in (0, len(run) - 1) and not passed:
            off_resonance.append(sweep)
    cautions = []
    if constant:
        why = "its peak is in the force, not the amplitude"
        cautions.append(f"constant amplitude in sweep {', '.join(constant)}: {why}")
    if off_resonance:
        cautions.append(f"sweep {', '.join(off_resonance)} does not reach resonance: it hardly shows damping")
    return cautions
