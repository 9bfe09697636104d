"""The conditioning of a test as a chain of steps, from raw readings to a record of one mode (chapter III).

A step is a pure function of a table. It returns the table before and after the step, and what was removed. The working
table has the columns ``sweep``, ``omega`` (rad/s), ``force`` (at the point of application), one for each sensor, the
kept columns, and from the step ``node`` on ``amplitude`` and ``phase`` (lag behind the force, rad): first of the node's
motion, then of the mode's.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import radians

import numpy as np
import pandas as pd

from damping import signals
from damping.arrays import RAD_S_PER_HZ, FloatArray, wrap_lag
from damping.errors import AnalysisError
from damping.signals import NodeMode
from damping.signals.description import Description

#: Names of the steps that remove motion in phase with the force.
IN_PHASE = RIGID_BODY, ADJACENT_MODES, KNOWN_CORRECTION = "rigid body", "adjacent modes", "known correction"


@dataclass(frozen=True)
class ConditioningStep:
    """One step of the conditioning."""

    name: str  #: what the step does
    equation: str  #: its place in the report
    before: pd.DataFrame  #: the working table
    after: pd.DataFrame  #: the working table, rows in the same order (a step may leave rows out)
    #: removed motion, one column per part, on the rows of ``before``; no columns if the step only converts. Motion in
    #: phase with the force is signed: positive with it, negative against it.
    removed: pd.DataFrame
    constants: Mapping[str, float] = field(default_factory=dict)  #: numbers identified by the step


def condition(raw: pd.DataFrame, description: Description) -> tuple[ConditioningStep, ...]:
    """All steps of a test; the last one's ``after`` is the record.

    Args:
        raw: the raw table; the columns named in the description hold numbers in range.

    AnalysisError: another mode inside the swept frequencies, an identified R^2/I that is not positive, or no row with a
    damping factor.
    """
    d = description
    actions = [
        to_displacements,
        *([to_yaw] if d.yaw else []),
        to_node,
        to_mode,
        *([remove_rigid_body] if d.rigid_body else []),
        *([remove_modes] if d.modes else []),
        *([remove_correction] if d.correction else []),
        to_modal_force,
        *([to_principal] if d.principal else []),
        to_record,
    ]
    steps: list[ConditioningStep] = []
    table = tabulate_working(raw, d)
    for action in actions:
        steps.append(action(table, raw, d))
        table = steps[-1].after
    return tuple(steps)


def tabulate_working(raw: pd.DataFrame, description: Description) -> pd.DataFrame:
    """Readings in the units of the description: ``sweep, omega, force``, one column per sensor, and kept columns."""
    d = description
    label = raw[d.raw.sweep].astype(str) if d.raw.sweep else d.raw.sweep_label
    columns = {
        "sweep": label,
        "omega": d.units.rad_s * raw[d.raw.frequency].to_numpy(float),
        "force": raw[d.raw.force].to_numpy(float),
        **{sensor.name: sensor.factor * raw[sensor.column].to_numpy(float) for sensor in d.sensors},
        **{name: raw[name] for name in d.raw.keep},
    }
    return pd.DataFrame(columns, index=raw.index)


def to_displacements(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """Displacement amplitudes: unit a F/omega^2 from an acceleration (Table 3.I), unit v F/omega from a velocity."""
    omega = _column(table, "omega")
    moved = {}
    for sensor in description.sensors:
        force = _column(table, "force") if sensor.per_force else np.ones(len(table))
        reading = _column(table, sensor.name)
        as_acceleration = {"acceleration": reading, "velocity": reading * omega, "displacement": reading * omega**2}
        moved[sensor.name] = signals.displacement(as_acceleration[sensor.quantity], omega, force, sensor.unit)
    return _step("displacement", "section 3.1, Table 3.I", table, table.assign(**moved))


def to_yaw(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """Yaw displacements of nodes measured in pitch only (Eq. 3.1.1).

    At one frequency the ratio of the tip's accelerations is that of its displacements.
    """
    readings = {n.name: (n.tip_yaw, n.tip_pitch, n.pitch) for n in description.yaw}
    yaw = {name: signals.yaw_displacement(*(_column(table, c) for c in columns)) for name, columns in readings.items()}
    return _step("yaw from pitch", "Eq. 3.1.1", table, table.assign(**yaw))


def to_node(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """Amplitude and phase of the node that represents the mode (Eq. 3.1.21), without the known instrument lag."""
    node = description.node
    after = table.assign(amplitude=_column(table, node.sensor))
    if node.phase is None:
        return _step("node", "Eq. 3.1.21", table, after)
    lag = description.units.rad * node.lag
    after["phase"] = wrap_lag(description.units.rad * raw.loc[table.index, node.phase].to_numpy(float) - lag)
    return _step("node", "Eq. 3.1.21", table, after, {"lag": np.full(len(table), lag)} if lag else None)


def to_mode(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """Node to modal displacement, X/phi (Eqs. 3.1.2-3.1.5); a negative phi turns the phase by pi."""
    phi = description.mode.phi
    after = table.assign(amplitude=_column(table, "amplitude") / abs(phi))
    return _step("mode factor", "Eqs. 3.1.2-3.1.5", table, _turn(after, phi))


def remove_rigid_body(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """Remove rigid-body rotation (Eqs. 3.1.16-3.1.18, 3.1.22, 3.1.23).

    Where R^2/I is not given, it is the one that fits the known total corrections best: ``constants["r2_over_i"]``.

    AnalysisError: its frequency lies inside the swept ones, where it resonates and is not in phase with the force.
    """
    rigid = description.rigid_body
    assert rigid is not None  # else the step is not in the chain
    mode, others, F = _node_modes(table, description)
    omega, omega_r = _column(table, "omega"), description.units.rad_s * rigid.frequency
    _require_outside(omega, omega_r, "rigid-body rotation")
    r2_over_i = rigid.r2_over_i
    if r2_over_i is None:
        C_t = raw.loc[table.index, rigid.identify_from].to_numpy(float)
        r2_over_i = signals.identify_r2_over_i(mode, others, F, omega, omega_r, C_t)
        if not r2_over_i > 0.0 and description.mode.phi_drive is None:  # force and node at one place
            raise AnalysisError(f"R^2/I identified from column {rigid.identify_from} is {r2_over_i:.3g}, not positive")
    part = signals.node_correction(mode, [], F, omega, r2_over_i, omega_r).rigid_body
    step = _in_phase(RIGID_BODY, "Eqs. 3.1.16-3.1.18", table, {"rigid body": part})
    return replace(step, constants={"r2_over_i": r2_over_i})


def remove_modes(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """Remove other modes as undamped, in phase with the force or opposite (Eqs. 3.1.13-3.1.15, 3.1.22, 3.1.23).

    AnalysisError: one of them lies inside the swept frequencies, where its damping cannot be neglected.
    """
    mode, others, F = _node_modes(table, description)
    omega = _column(table, "omega")
    for named, other in zip(description.modes, others, strict=True):
        _require_outside(omega, other.omega, f"mode {named.name!r}")
    correction = signals.node_correction(mode, others, F, omega)
    parts = {f"mode {m.name}": part for m, part in zip(description.modes, correction.adjacent, strict=True)}
    return _in_phase(ADJACENT_MODES, "Eqs. 3.1.13-3.1.15", table, parts)


def remove_correction(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """Add a known total correction C_t in phase with the force (Eqs. 3.1.19, 3.1.22, 3.1.23)."""
    assert description.correction is not None  # else the step is not in the chain
    C_t = raw.loc[table.index, description.correction.column].to_numpy(float)
    return _in_phase(KNOWN_CORRECTION, "Eq. 3.1.19", table, {"total": C_t})


def to_modal_force(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """F_e = phi F (Eqs. 2.2.3, 3.1.11); a negative phi at the drive turns the phase by pi."""
    phi = description.mode.drive
    after = table.assign(force=abs(phi) * _column(table, "force"))
    return _step("modal force", "Eqs. 2.2.3, 3.1.11", table, _turn(after, phi))


def to_principal(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """Motion and energy in the principal pitch plane, with xi of Eq. 3.2.15 point by point (section 3.2).

    Removes the motion in the yaw plane, and rows at which no xi balances the energy. The remaining amplitude and energy
    are those of the linear oscillator with that xi: regressing one on the other adds no information beyond xi.

    AnalysisError: no row is left.
    """
    principal = description.principal
    assert principal is not None  # else the step is not in the chain
    planes, energy, points = _solve_planes(table, description)
    F, omega = _column(table, "force"), _column(table, "omega")
    if principal.xi is None:
        xi = signals.branch(points, 0 if principal.branch == "low" else -1, principal.largest)
    else:  # that is, branch "near"
        xi = signals.nearest_roots(points, principal.xi, principal.largest)
    kept = np.isfinite(xi)
    if not kept.any():
        raise AnalysisError("at no point is there a damping factor that balances the energy (Eq. 3.2.15)")
    motion = signals.plane_motion(planes, F, omega, xi)
    pitch = F * np.cos(planes.theta)
    after = table.drop(columns="phase").assign(force=pitch, amplitude=motion.A_p, energy=motion.E_p, xi=xi)
    removed = {"yaw amplitude": np.asarray(motion.A_y), "yaw energy": np.asarray(motion.E_y), "input energy": energy}
    return _step("principal planes", "Eqs. 3.2.1-3.2.15", table, after[kept], removed)


def find_nearer_root(table: pd.DataFrame, xi: FloatArray, description: Description) -> FloatArray:
    """The root of Eq. 3.2.15 nearest to the median of the ``xi`` taken, at each row of the working table in two planes.

    A plane loses most energy at one damping factor; "low" and "high" are the roots on either side of it at each row.
    """
    assert description.principal is not None  # else there are no roots
    return signals.nearest_roots(
        _solve_planes(table, description)[2], float(np.median(xi)), description.principal.largest
    )


def _solve_planes(
    table: pd.DataFrame, description: Description
) -> tuple[signals.PrincipalPlanes, FloatArray, list[signals.DampingRoots]]:
    """The principal planes, and the input energy (3.2.9) of each row with the damping factors that balance it."""
    principal = description.principal
    assert principal is not None  # else there are no planes
    omega_p, omega_y = (description.units.rad_s * f for f in (principal.frequency_pitch, principal.frequency_yaw))
    planes = signals.PrincipalPlanes(1.0, principal.mass, omega_p, omega_y, radians(principal.theta))
    F, omega = _column(table, "force"), _column(table, "omega")
    energy = np.asarray(signals.input_energy(_column(table, "amplitude"), F, _column(table, "phase")))
    rows = zip(F.tolist(), omega.tolist(), energy.tolist(), strict=True)
    return planes, energy, [signals.damping_roots(planes, *row) for row in rows]


def to_record(table: pd.DataFrame, raw: pd.DataFrame, description: Description) -> ConditioningStep:
    """The columns of a record (frequency in Hz), energy and xi if present, then the kept columns."""
    columns = {"sweep": table["sweep"], "force": table["force"], "frequency": _column(table, "omega") / RAD_S_PER_HZ}
    names = [name for name in ("amplitude", "phase", "energy", "xi") if name in table]
    columns |= {name: table[name] for name in (*names, *description.raw.keep)}
    return _step("record", "", table, pd.DataFrame(columns))


def _node_modes(table: pd.DataFrame, description: Description) -> tuple[NodeMode, list[NodeMode], FloatArray]:
    """The mode and the other modes at the node, and the force.

    A force at another point (phi_drive) excites a mode as if its mass were M phi/phi_drive.
    """
    d = description
    others = []
    for m in d.modes:
        mass = m.mass * m.phi / m.drive if m.phi * m.drive != 0.0 else np.inf
        others.append(NodeMode(m.phi, mass, d.units.rad_s * m.frequency))
    return NodeMode(d.mode.phi, np.nan, np.nan), others, _column(table, "force")


def _require_outside(omega: FloatArray, resonance: float, what: str) -> None:
    if omega.min() <= resonance <= omega.max():
        raise AnalysisError(f"{what} lies inside the swept frequencies: it cannot be removed undamped")


def _in_phase(name: str, equation: str, table: pd.DataFrame, parts: Mapping[str, FloatArray]) -> ConditioningStep:
    """Add corrections in phase with the force (Eqs. 3.1.22, 3.1.23 with phi = 1); ``removed`` has the opposite sign."""
    A, phi = _column(table, "amplitude"), _column(table, "phase")
    C_t = np.sum(list(parts.values()), axis=0)
    after_phi = signals.modal_phase(A, phi, C_t, 1.0)
    amplitude = signals.modal_amplitude(A, phi, C_t, 1.0, after_phi)
    after = table.assign(amplitude=amplitude, phase=wrap_lag(np.asarray(after_phi)))
    return _step(name, equation, table, after, {part: -C for part, C in parts.items()})


def _turn(table: pd.DataFrame, phi: float) -> pd.DataFrame:
    """The table with its phase, if there is one, turned by pi if ``phi`` is negative."""
    turned = phi < 0.0 and "phase" in table
    return table.assign(phase=wrap_lag(_column(table, "phase") + np.pi)) if turned else table


def _step(
    name: str, equation: str, before: pd.DataFrame, after: pd.DataFrame, removed: Mapping[str, FloatArray] | None = None
) -> ConditioningStep:
    return ConditioningStep(name, equation, before, after, pd.DataFrame(removed or {}, index=before.index))


def _column(table: pd.DataFrame, name: str) -> FloatArray:
    return table[name].to_numpy(dtype=np.float64)
