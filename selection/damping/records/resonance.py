"""The phase resonance of every sweep: where it is passed, or jumped over at a fold.

Each row measures the force per unit of displacement, Z = F exp(i phase)/A. For first-harmonic averages S (in phase) and
C (in quadrature) of the restoring and damping forces beyond the linear spring,

    Z = K - M omega^2 + (S + i C)/A,

so Re Z = 0 at phase pi/2: phase resonance, where the force balances the damping alone (report, section 4.1).
"""

from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd

from damping.arrays import BoolArray, FloatArray, IntArray
from damping.records.pairs import phase_offset
from damping.records.peaks import AT_RESONANCE, find_peak, share_in_quadrature
from damping.records.record import Record
from damping.records.runs import POWER_TURNS, estimate_power, find_between, order_rows

#: Fewest rows between the half-power points (|cot phase| <= 1) for a fit instead of interpolation.
ROWS_FOR_FIT = 5
#: Largest |cot phase| of the fitted rows: a force that drops near resonance is fitted over narrower windows.
WINDOWS = (1.0, 0.5, 0.25, 0.125)
#: Residual of the fit of a force that drops: relative root mean square, and correlation with the residual of motion.
LEAVES = 0.01
FOLLOWS = 0.7
#: Two neighbours on either side of resonance are interpolated if one is within 60 degrees of it (|cot phase| <= 1.73).
NEIGHBOUR = 3.0**0.5
ROWS_BENT = 8  #: fewest rows on one side of a resonance that show whether it is bent
#: A sweep jumps if the resonance frequency moves by this between two rows, in half-widths (damping ratio times
#: frequency): a linear resonance moves by noise only, and a bent one little from row to row.
JUMP = 1.0
#: |cot phase| of the nearer row up to which a jump past resonance counts as a passage: F/Im Z then exceeds its
#: amplitude by at most 3 %.
JUMP_AT_RESONANCE = 0.25
#: Ratio of Im Z across the passage from which that of the nearer row is taken, if it is as near as that: the other was
#: read during a jump or far from resonance. Of 6912 sweeps of bent modes with jumps, integrated in time, this
#: and `find_transitions` move 199, whose 90th percentile of error falls from 20 to 40 % to 3 to 7 %.
UNEVEN_LOSS = 1.6
FEWEST_BESIDE = 2  #: fewest steps from row to row, besides the one past resonance, to judge whether that is a jump
#: A row is read during a jump if its damping F sin(phase)/A is larger than that of both its neighbours, and its A/F
#: smaller than that of one, by more than this factor: on a branch both change evenly,
IN_TRANSITION = 3.0
TURNED = 0.5  #: and if sin(phase) is at least this, so that noise of the phase does not make that damping
_TELLING = 1e-6  # least sin(phase) of a usable row: noise may carry phases beyond 0..pi
_FAR = 0.2  #: largest relative change of frequency^2 to a resonance extrapolated from rows on one side
SAME_LEVEL = 0.10  #: relative difference of tested forces up to which two sweeps are repeats of one level


@dataclass(frozen=True)
class Resonance:
    """Phase resonance of one sweep."""

    sweep: str
    force: float
    frequency: float  #: Hz
    amplitude: float
    phase_offset: float  #: subtracted from the phases, rad
    #: ``row`` (the only row of the sweep, with its force in quadrature), ``interpolated`` (phase pi/2 between rows, or
    #: at one), ``beside`` (damping force at the row of largest amplitude, if phases do not reach pi/2 or jump past it),
    #: ``between`` (a curve through rows of a coarse sweep without phases) or ``peak`` (that row, taken for resonance,
    #: with the damping force that its energy states if that is clearly less)
    method: str
    row: int  #: of the record, at or nearest to resonance


def tabulate_resonances(record: Record) -> pd.DataFrame:
    """Phase resonance of each sweep, one row each in order of appearance, with the columns of ``Resonance``."""
    sweeps = [(str(sweep), table) for sweep, table in record.frame.groupby("sweep", sort=False)]
    rows = [find_resonance(*sweep) for sweep in sweeps]
    for _ in range(POWER_TURNS if any(row.method == "between" for row in rows) else 0):
        power = estimate_power(*(np.array([getattr(row, name) for row in rows]) for name in ("force", "amplitude")))
        rows = [find_resonance(*sweep, power) for sweep in sweeps]
    return pd.DataFrame([asdict(row) for row in rows], columns=list(Resonance.__dataclass_fields__))


def number_levels(force: FloatArray) -> IntArray:
    """Force level of each sweep by its force at resonance (sweeps,), lowest 0; repeats of one level share a number.

    A level begins at its lowest force and includes every sweep up to ``SAME_LEVEL`` above it. Shakers hold a force to
    some per cent, less well at a resonance, where the structure reduces the force; different levels are mostly a
    quarter or more apart (a third-octave or half-decade ladder). The margin counts from the lowest force of the level
    and not from the neighbour, so that a ladder of small steps is never one level.
    """
    order = np.argsort(force, kind="stable")
    number = np.zeros(len(force), dtype=np.int64)
    level, lowest = 0, force[order[0]]
    for sweep in order:
        if force[sweep] > (1.0 + SAME_LEVEL) * lowest:
            level, lowest = level + 1, force[sweep]
        number[sweep] = level
    return number


def find_resonance(sweep: str, table: pd.DataFrame, power: float = 1.0) -> Resonance:
    """Phase resonance of one sweep; ``table``: its rows in the record, with their index; ``power``: see `find_between`.

    A constant phase offset is subtracted first (``phase_offset``). Force, frequency and 1/Im Z at phase pi/2, Re Z = 0,
    then come from a fit of 1, cot(phase) and 1/sin(phase) - 1 to the rows between the half-power points, or to a
    narrower window (``WINDOWS``) if the force drops there. The fit is exact for a linear mode under constant force or
    at constant amplitude, averages noise, and does not depend on order, direction or repeated points. With fewer than
    ``ROWS_FOR_FIT`` rows there, two neighbours are interpolated to Re Z = 0, exact for a linear mode under constant
    force; 1/Im Z is that of the nearer row where it changes much between them (``UNEVEN_LOSS``), and if the sweep jumps
    from a row at resonance, that row is it. Rows read during a jump are left out (:func:`find_transitions`). The
    amplitude is force / Im Z.
    Without phases and energies a coarse sweep is read between its rows (:func:`find_between`). Else, and without a
    passage (:func:`find_jump`), the row of largest amplitude is taken, or of A/F (:func:`find_peak`).
    """
    table, _ = order_rows(table)
    rows = table.index.to_numpy(dtype=np.int64)
    force, frequency, amplitude = (table[name].to_numpy(float) for name in ("force", "frequency", "amplitude"))
    offset = 0.0
    if len(rows) > 1 and "phase" in table.columns:
        phase = table["phase"].to_numpy(dtype=np.float64)
        offset = phase_offset(force, frequency, amplitude, phase)
        settled = ~find_transitions(force, amplitude, phase - offset)
        lag = (phase - offset)[settled]
        passage = _at_resonance(force[settled], frequency[settled], amplitude[settled], lag)
        if passage is not None:
            row = int(rows[settled][np.argmin(np.abs(np.cos(lag)) + (np.sin(lag) < 0.0))])
            return Resonance(sweep, *passage, offset, "interpolated", row)
        if (beside := _beside_resonance(force, frequency, amplitude, phase - offset)) is not None:
            return Resonance(sweep, *beside, offset, "beside", int(rows[np.argmax(amplitude)]))
    peak = find_peak(force, frequency, amplitude)
    silent = not {"phase", "energy"} & set(table.columns)
    if silent and (between := find_between(force, frequency, amplitude, power)) is not None:
        return Resonance(sweep, *between, offset, "between", int(rows[peak]))
    F, f, A = (float(column[peak]) for column in (force, frequency, amplitude))
    share = share_in_quadrature(table.iloc[peak])
    F *= share if len(rows) == 1 or share < AT_RESONANCE else 1.0
    return Resonance(sweep, F, f, A, offset, "row" if len(rows) == 1 else "peak", int(rows[peak]))


def _at_resonance(
    force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray
) -> tuple[float, float, float] | None:
    """Force, frequency and amplitude where the phase (without offset) passes pi/2; None if it does not."""
    cosine, sine, cotangent = np.cos(phase), np.sin(phase), find_cotangent(phase)
    telling = np.isfinite(cotangent)
    cosecant = np.divide(1.0, sine, out=np.full_like(sine, np.inf), where=telling)
    columns = np.column_stack([force, frequency, amplitude / force * np.where(telling, cosecant, 0.0)])
    for window in WINDOWS:
        near = np.abs(cotangent) <= window
        if near.sum() < ROWS_FOR_FIT or not cotangent[near].min() < 0.0 < cotangent[near].max():
            values = None
            break
        values, follows = _fitted(cotangent[near], cosecant[near], columns[near])
        if not follows:
            break
    if values is None:
        i, nearest, nearer = find_passage(phase)
        pair = slice(i, i + 2)
        low, high = sorted(columns[pair, 2])
        jumps = find_jump(force, frequency, amplitude, phase) is not None
        if nearest > NEIGHBOUR or (jumps and nearest > JUMP_AT_RESONANCE):
            return None
        values = _interpolated(cosine[pair] * force[pair] / amplitude[pair], columns[pair], telling[pair])
        if jumps:
            values = columns[nearer]
        elif nearest <= JUMP_AT_RESONANCE and high > UNEVEN_LOSS * low:
            values = np.array([*columns[nearer, :1], values[1], *columns[nearer, 2:]])
    F, f, compliance = values
    if min(F, f, compliance) <= 0.0:  # possible with noise only
        return None
    return float(F), float(f), float(F * compliance)


def _beside_resonance(
    force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray
) -> tuple[float, float, float] | None:
    """Damping force at the row of largest amplitude, frequency of resonance at that amplitude, and the amplitude.

    Re Z = K - M omega^2 + (3/4) k A^2, fitted to all rows, gives M (with the cubic term from ``ROWS_BENT`` rows on) and
    the frequency^2 of resonance at that amplitude, omega^2 + Re Z/M. The frequency is that of the row if the fit gives
    no mass or leads far away. None if the phase is impossible for a driven mode.
    """
    peak = int(np.argmax(amplitude))
    damping = float(force[peak] * np.sin(phase[peak]))
    if damping <= 0.0:
        return None
    spring, square = force * np.cos(phase) / amplitude, frequency**2
    columns = [np.ones_like(square), square / square[peak], (amplitude / amplitude[peak]) ** 2]
    columns = columns[: 3 if len(square) >= ROWS_BENT else 2]
    mass = -float(np.linalg.lstsq(np.column_stack(columns), spring)[0][1]) / square[peak]
    ahead = float(spring[peak]) / mass if mass > 0.0 else 0.0
    ahead = ahead if abs(ahead) < _FAR * square[peak] else 0.0
    return damping, float(np.sqrt(square[peak] + ahead)), float(amplitude[peak])


def _fitted(cotangent: FloatArray, cosecant: FloatArray, columns: FloatArray) -> tuple[FloatArray, bool]:
    """Fitted values of the columns (n, 3) at cot(phase) = 0, by a line if repeated points need it. Second, whether the
    force departs from the fit by more than noise: the amplitude, A = F sin(phase)/Im Z, then departs likewise."""
    basis = np.column_stack([np.ones(len(columns)), cotangent, cosecant - 1.0])
    values, _, rank, _ = np.linalg.lstsq(basis, columns)
    if rank < basis.shape[1]:
        return np.asarray(np.linalg.lstsq(basis[:, :2], columns)[0][0]), False
    with np.errstate(all="ignore"):  # with noise only, a fit may pass through 0
        residual = (columns / (basis @ values) - 1.0)[:, [0, 2]]
    force, motion = residual[:, 0], residual.sum(axis=1)
    size = float(np.sqrt(force @ force * (motion @ motion)))
    return np.asarray(values[0]), bool(force @ force > LEAVES**2 * len(residual) and force @ motion > FOLLOWS * size)


def _interpolated(spring: FloatArray, columns: FloatArray, telling: BoolArray) -> FloatArray:
    """Columns (2, 3) of two rows interpolated to Re Z, ``spring`` (2,), = 0; 1/Im Z of one if the other has none."""
    step = spring[0] - spring[1]
    at = columns[0] + (columns[1] - columns[0]) * (spring[0] / step if step else 0.5)
    if not telling.all():
        at[2] = columns[telling, 2][0]
    return np.asarray(at)


def find_jump(force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray) -> int | None:
    """The row (n rows in the order of the sweep, phases without offset) after which a sweep jumps past its resonance.

    Re Z/M = omega_r^2 - omega^2 gives the resonance omega_r at the amplitude of each row, M being the median of
    -d Re Z/d omega^2 from row to row. A linear resonance is the same on either side of phase pi/2, however far apart
    the rows are; over a fold it leaps with the amplitude. None if it moves by less than ``JUMP`` half-widths Im Z of
    the nearer row, or by less than half the step of the frequency (a coarse sweep with noise).
    """
    i, nearest, nearer = find_passage(phase)
    if nearest == np.inf:
        return None
    Z = force / amplitude * np.exp(1j * phase)
    rise, step = np.diff(Z.real), np.diff(frequency**2)
    beside = (step != 0.0) & (np.arange(len(step)) != i)
    if beside.sum() < FEWEST_BESIDE:
        return None
    slope = np.median(rise[beside] / step[beside])
    least = JUMP * max(Z.imag[nearer], -0.5 * slope * abs(step[i]))
    return i if slope < 0.0 and abs(rise[i] - slope * step[i]) > least else None


def find_transitions(force: FloatArray, amplitude: FloatArray, phase: FloatArray) -> BoolArray:
    """Which rows of a sweep, in the order taken, were read while it jumped: on neither branch of the response.

    So is the trough of an antiresonance, which is no passage of resonance either.
    """
    compliance, damping = amplitude / force, np.abs(np.sin(phase)) * force / amplitude
    turned = np.sin(phase[1:-1]) >= TURNED
    falls = IN_TRANSITION * compliance[1:-1] < np.maximum(compliance[:-2], compliance[2:])
    damped = damping[1:-1] > IN_TRANSITION * np.maximum(damping[:-2], damping[2:])
    inner = np.flatnonzero(turned & falls & damped) + 1
    return np.isin(np.arange(len(phase)), inner)


def find_cotangent(phase: FloatArray) -> FloatArray:
    """cot(phase); infinite for phases outside 0..pi, which a driven mode has by noise only."""
    sine = np.sin(phase)
    return np.divide(np.cos(phase), sine, out=np.full_like(sine, np.inf), where=sine > _TELLING)


def find_passage(phase: FloatArray) -> tuple[int, float, int]:
    """The row before the passage of phase pi/2, and |cot phase| and index of the nearer row; infinite: no passage."""
    cosine, size = np.cos(phase), np.abs(find_cotangent(phase))
    nearest = np.where(cosine[:-1] * cosine[1:] <= 0.0, np.minimum(size[:-1], size[1:]), np.inf)
    i = int(np.argmin(nearest))
    return i, float(nearest[i]), i + int(size[i + 1] < size[i])
