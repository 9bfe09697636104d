"""The phase resonance of every sweep: where it is passed, or jumped over at a fold.

It rests on the force per unit of displacement that a row measures, Z = F exp(i phase)/A. For first-harmonic averages
S (in phase) and C (in quadrature) of the restoring and damping forces beyond the linear spring,

    Z = K - M omega^2 + (S + i C)/A,

so Re Z = 0 at phase pi/2: phase resonance, where the force balances the damping alone (report, section 4.1).
"""

from dataclasses import asdict, dataclass
from math import pi

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, BoolArray, ComplexArray, FloatArray, IntArray
from damping.records.record import Record
from damping.records.runs import order_rows

#: Rows between the half-power points (|cot phase| <= 1) that make a fit of them better than two neighbours.
ROWS_FOR_FIT = 5
#: Largest |cot phase| of the rows of a fit: a force that drops near resonance is fitted over ever fewer of them.
WINDOWS = (1.0, 0.5, 0.25, 0.125)
#: What a fit leaves of a force that drops: root mean square, relative, and correlation of the motion's rest with it.
LEAVES = 0.01
FOLLOWS = 0.7
#: Two neighbours on either side of resonance are interpolated if one is within 60 degrees of it (|cot phase| <= 1.73).
NEIGHBOUR = 3.0**0.5
#: Pairs of rows across resonance count as of one amplitude in proportion to a Gaussian of this width in ln A.
SAME_AMPLITUDE = 0.1
ROWS_ASIDE = 4  #: rows that a phase offset needs on either side of resonance
#: Phase offset, rad, beyond which none is believed: another quantity measured gives 90 degrees, a sensor reversed 180.
LARGEST_OFFSET = pi / 4
#: Damping ratio up to which every offset is taken: a false one, of a ratio at most, moves the frequency of resonance by
#: the ratio squared, 0.25 %.
SMALL_DAMPING = 0.05
_MOST_ROWS_ASIDE = 300  # a longer sweep is thinned: pairs grow with the square
ROWS_BENT = 8  #: rows on one side of a resonance that tell whether it is bent
#: A sweep jumps where the resonance itself moves by this between two rows, in half-widths (1: damping ratio times
#: frequency): a resonance that stays moves by noise, and one that is bent little from row to row.
JUMP = 1.0
#: |cot phase| of the nearer row up to which a jump past resonance is read as a passage: F/Im Z is then 3 % more than
#: its amplitude at most.
JUMP_AT_RESONANCE = 0.25
FEWEST_BESIDE = 2  #: steps from row to row, beside the one past resonance, that tell whether that is a jump
_TELLING = 1e-6  # least sin(phase) of a row that is told from one that noise carries beyond 0..pi
_FAR = 0.2  #: change of frequency^2 beyond which rows on one side say nothing of where the resonance is
SAME_LEVEL = 0.10  #: relative difference of tested forces up to which two sweeps are repeats of one level


@dataclass(frozen=True)
class Resonance:
    """Phase resonance of one sweep.

    ``force``, ``frequency`` (Hz) and ``amplitude`` there; ``phase_offset`` (rad) is what was taken off the phases of
    the sweep; ``method`` is ``row`` (the sweep has no other), ``interpolated`` (phase pi/2 between rows), ``beside``
    (damping alone at the row of largest amplitude, where phases do not reach pi/2 or jump past it) or ``peak`` (that
    row, taken for resonance); ``row`` is the row of the record at or nearest to it.
    """

    sweep: str
    force: float
    frequency: float
    amplitude: float
    phase_offset: float
    method: str
    row: int


def tabulate_resonances(record: Record) -> pd.DataFrame:
    """Phase resonance of each sweep, a row each in order of appearance with the columns of ``Resonance``."""
    rows = [find_resonance(str(sweep), table) for sweep, table in record.frame.groupby("sweep", sort=False)]
    return pd.DataFrame([asdict(row) for row in rows], columns=list(Resonance.__dataclass_fields__))


def number_levels(force: FloatArray) -> IntArray:
    """Force level of each sweep by its force at resonance (sweeps,), lowest 0; repeats of one level share a number.

    A level begins at its lowest force and holds every sweep up to ``SAME_LEVEL`` above it. Shakers hold a force to
    some per cent, more loosely at a resonance, where the structure draws the force down; levels that are meant to
    differ are mostly chosen a quarter or more apart (a third-octave or half-decade ladder). The margin is taken from
    the lowest force of the level and not from the neighbour, so that a ladder of small steps is never one level.
    """
    order = np.argsort(force, kind="stable")
    number = np.zeros(len(force), dtype=np.int64)
    level, lowest = 0, force[order[0]]
    for sweep in order:
        if force[sweep] > (1.0 + SAME_LEVEL) * lowest:
            level, lowest = level + 1, force[sweep]
        number[sweep] = level
    return number


def find_resonance(sweep: str, table: pd.DataFrame) -> Resonance:
    """Phase resonance of one sweep by its rows in the table of a record, which keep their index.

    A constant phase offset is taken off first (``phase_offset``). Force, frequency and 1/Im Z at phase pi/2, Re Z = 0,
    then come from a fit of 1, cot(phase) and 1/sin(phase) - 1 to the rows between the half-power points, or to those
    nearer by (``WINDOWS``) where the force drops within them. It is exact for a linear mode under constant force or at
    constant amplitude, averages noise, and minds neither order, direction nor repeated points. With fewer than
    ``ROWS_FOR_FIT`` rows there, two neighbours are interpolated to Re Z = 0, exact for a linear mode under constant
    force; where the sweep jumps from a row at resonance that one decides. The amplitude is force / Im Z. Without phases
    or a passage (:func:`find_jump`), the row of largest amplitude is taken.
    """
    table, _ = order_rows(table)
    rows = table.index.to_numpy(dtype=np.int64)
    force, frequency, amplitude = (table[name].to_numpy(float) for name in ("force", "frequency", "amplitude"))
    offset = 0.0
    if len(rows) > 1 and "phase" in table.columns:
        phase = table["phase"].to_numpy(dtype=np.float64)
        offset = phase_offset(force, frequency, amplitude, phase)
        passage = _at_resonance(force, frequency, amplitude, phase - offset)
        if passage is not None:
            row = int(rows[np.argmin(np.abs(np.cos(phase - offset)) + (np.sin(phase - offset) < 0.0))])
            return Resonance(sweep, *passage, offset, "interpolated", row)
        if (told := _beside_resonance(force, frequency, amplitude, phase - offset)) is not None:
            return Resonance(sweep, *told, offset, "beside", int(rows[np.argmax(amplitude)]))
    peak = int(np.argmax(amplitude))
    F, f, A = (float(column[peak]) for column in (force, frequency, amplitude))
    return Resonance(sweep, F, f, A, offset, "row" if len(rows) == 1 else "peak", int(rows[peak]))


def phase_offset(force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray) -> float:
    """Constant offset of the phases of one sweep, rad; all arguments (n,), frequency in Hz, phase in rad.

    Two rows of equal amplitude on either side of resonance have equal S and, with damping that depends on frequency
    as viscous damping does, equal C/omega, whatever the dependence on amplitude. Their Y = F exp(i phase)/(A omega)
    then differ by a real number, M (omega_2 - omega_1) (1 + omega_n^2/(omega_1 omega_2)), so the argument of the
    difference is the offset. The result is the median over all pairs of rows on either side of the largest A/F,
    weighted by likeness of amplitude and by the distance of the two Y relative to their size. Damping that grows with
    another power n of frequency displaces it by 1 - n damping ratios C/(2 M omega_n^2 A) of the pairs, n from 0 (of
    displacement) to 2 (of velocity squared): by one ratio at most.

    0 where fewer than ``ROWS_ASIDE`` rows on a side have a like on the other (one wing only, or a bistable mode), where
    the result is beyond ``LARGEST_OFFSET``, or where it is within that displacement and the ratio above
    ``SMALL_DAMPING``.
    """
    omega = RAD_S_PER_HZ * frequency
    Y = force / (amplitude * omega) * np.exp(1j * phase)
    i, j, weight = like_pairs(omega, amplitude, Y, amplitude / force)
    if len(weight) == 0:
        return 0.0
    apart = Y[i] - Y[j]
    offset = weighted_median(np.angle(apart), weight)
    middle = np.imag(0.5 * (Y[i] + Y[j]) * np.exp(-1j * offset)) / np.abs(apart)  # C/omega over 2 M (omega_2 - omega_1)
    ratio = weighted_median(middle * (omega[j] - omega[i]) / np.sqrt(omega[i] * omega[j]), weight)
    doubtful = ratio > SMALL_DAMPING and abs(offset) < ratio
    return offset if abs(offset) <= LARGEST_OFFSET and not doubtful else 0.0


def like_pairs(
    omega: FloatArray, amplitude: FloatArray, Y: ComplexArray, compliance: FloatArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Pairs (below, above) of rows of like amplitude on either side of the largest ``compliance``, and their weights.

    All arguments (n,), the results (pairs,): none where fewer than ``ROWS_ASIDE`` rows on a side have a like.
    """
    top = omega[np.argmax(compliance)]
    below, above = _thinned(np.flatnonzero(omega < top)), _thinned(np.flatnonzero(omega > top))
    distance = np.log(amplitude[below][:, None] / amplitude[above][None, :]) / SAME_AMPLITUDE
    like = np.abs(distance) < 1.0
    if min(like.any(axis=1).sum(), like.any(axis=0).sum()) < ROWS_ASIDE:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    first, second = np.nonzero(like)
    i, j = below[first], above[second]
    weight = np.exp(-0.5 * distance[like] ** 2) * np.abs(Y[i] - Y[j]) / (np.abs(Y[i]) + np.abs(Y[j]))
    return i, j, weight


def _thinned(rows: IntArray) -> IntArray:
    """At most ``_MOST_ROWS_ASIDE`` of the rows, evenly chosen."""
    if len(rows) <= _MOST_ROWS_ASIDE:
        return rows
    return rows[np.linspace(0, len(rows) - 1, _MOST_ROWS_ASIDE).astype(np.int64)]


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """The value below which half of the weight lies; arguments (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def _at_resonance(
    force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray
) -> tuple[float, float, float] | None:
    """Force, frequency and amplitude where the phase (freed of its offset) passes pi/2; None where it does not."""
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
        i, nearest, _ = find_passage(phase)
        if nearest > NEIGHBOUR or find_jump(force, frequency, amplitude, phase) is not None:
            return None
        pair = slice(i, i + 2)
        values = _interpolated(cosine[pair] * force[pair] / amplitude[pair], columns[pair], telling[pair])
    F, f, compliance = values
    if min(F, f, compliance) <= 0.0:  # noise alone
        return None
    return float(F), float(f), float(F * compliance)


def _beside_resonance(
    force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray
) -> tuple[float, float, float] | None:
    """The force that the damping takes at the row of largest amplitude, the frequency of resonance, and that amplitude.

    Re Z = K - M omega^2 + (3/4) k A^2, fitted to all rows, gives M (the cubic term where there are ``ROWS_BENT`` rows),
    and with it the frequency^2 of resonance at that amplitude, omega^2 + Re Z/M. It is the row's own where the fit has
    no mass, or leads far away. None where the phase is none of a driven mode.
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
    """Values of the columns (n, 3) at cot(phase) = 0, a line where repeated points allow no more; and whether the force
    leaves the fit by more than noise: the amplitude, A = F sin(phase)/Im Z, then leaves its own as the force does."""
    basis = np.column_stack([np.ones(len(columns)), cotangent, cosecant - 1.0])
    values, _, rank, _ = np.linalg.lstsq(basis, columns)
    if rank < basis.shape[1]:
        return np.asarray(np.linalg.lstsq(basis[:, :2], columns)[0][0]), False
    with np.errstate(all="ignore"):  # noise alone may take a fit through 0
        left = (columns / (basis @ values) - 1.0)[:, [0, 2]]
    force, motion = left[:, 0], left.sum(axis=1)
    size = float(np.sqrt(force @ force * (motion @ motion)))
    return np.asarray(values[0]), bool(force @ force > LEAVES**2 * len(left) and force @ motion > FOLLOWS * size)


def _interpolated(spring: FloatArray, columns: FloatArray, telling: BoolArray) -> FloatArray:
    """Values of two rows' columns (2, 3) where Re Z, ``spring`` (2,), is 0; 1/Im Z from the row that tells of it."""
    step = spring[0] - spring[1]
    at = columns[0] + (columns[1] - columns[0]) * (spring[0] / step if step else 0.5)
    if not telling.all():
        at[2] = columns[telling, 2][0]
    return np.asarray(at)


def find_jump(force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray) -> int | None:
    """The row (of n in the order of the sweep, phases freed of their offset) after which it jumps past its resonance.

    Re Z/M = omega_r^2 - omega^2 tells the resonance omega_r at the amplitude of each row, M being the median of
    -d Re Z/d omega^2 from row to row. Of a resonance that stays it is the same on either side of phase pi/2, however
    far apart the rows are; over a fold it leaps with the amplitude. None where it moves by less than ``JUMP``
    half-widths Im Z of the nearer row, or half as far as the frequency (a coarse sweep with noise), or where that row
    is at resonance (``JUMP_AT_RESONANCE``).
    """
    i, nearest, nearer = find_passage(phase)
    if not JUMP_AT_RESONANCE < nearest < np.inf:
        return None
    Z = force / amplitude * np.exp(1j * phase)
    rise, step = np.diff(Z.real), np.diff(frequency**2)
    beside = (step != 0.0) & (np.arange(len(step)) != i)
    if beside.sum() < FEWEST_BESIDE:
        return None
    slope = np.median(rise[beside] / step[beside])
    least = JUMP * max(Z.imag[nearer], -0.5 * slope * abs(step[i]))
    return i if slope < 0.0 and abs(rise[i] - slope * step[i]) > least else None


def find_cotangent(phase: FloatArray) -> FloatArray:
    """cot(phase); infinite where no row of a driven mode has the phase, though noise may carry it there."""
    sine = np.sin(phase)
    return np.divide(np.cos(phase), sine, out=np.full_like(sine, np.inf), where=sine > _TELLING)


def find_passage(phase: FloatArray) -> tuple[int, float, int]:
    """The row before phase pi/2 is passed, and |cot phase| and place of the nearer of the two; infinite: no passage."""
    cosine, size = np.cos(phase), np.abs(find_cotangent(phase))
    nearest = np.where(cosine[:-1] * cosine[1:] <= 0.0, np.minimum(size[:-1], size[1:]), np.inf)
    i = int(np.argmin(nearest))
    return i, float(nearest[i]), i + int(size[i + 1] < size[i])
