"""Pairs of rows of like amplitude on either side of a resonance, and the phase offset of a sweep that they imply."""

from math import pi

import numpy as np

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray, IntArray

#: Pairs of rows across resonance are weighted by a Gaussian of this width in the difference of ln A.
SAME_AMPLITUDE = 0.1
ROWS_ASIDE = 4  #: fewest rows on either side of resonance for a phase offset
#: Largest accepted phase offset, rad: another measured quantity gives 90 degrees, a reversed sensor 180.
LARGEST_OFFSET = pi / 4
#: Damping ratio up to which every offset is accepted: a false one moves the frequency by the ratio squared, 0.25 %.
SMALL_DAMPING = 0.05
FEIGNED = 1.25  #: room in a feigned offset for the second order (16 % at a ratio of 0.2) and the scatter of readings
_MOST_ROWS_ASIDE = 300  # longer sweeps are thinned: the number of pairs grows with the square


def phase_offset(force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray) -> float:
    """Constant offset of the phases of one sweep, rad; all arguments (n,), frequency in Hz, phase in rad.

    Two rows of equal amplitude on either side of resonance have equal S and, with damping that depends on frequency
    as viscous damping does, equal C/omega, whatever the dependence on amplitude. Their Y = F exp(i phase)/(A omega)
    then differ by a real number, M (omega_2 - omega_1) (1 + omega_n^2/(omega_1 omega_2)), so the argument of the
    difference is the offset. The result is the median over all pairs of rows across the largest A/F, weighted by
    similarity of amplitude and by the distance of the two Y relative to their size. Damping that grows with another
    power n of frequency displaces it by 1 - n damping ratios C/(2 M omega_n^2 A) of the pairs, n from 0 (of
    displacement) to 2 (of velocity squared): by at most one ratio to first order.

    0 if fewer than ``ROWS_ASIDE`` rows on a side have a partner on the other (one wing only, or a bistable mode), if
    the result is beyond ``LARGEST_OFFSET``, or if it is within that displacement and the ratio above ``SMALL_DAMPING``.
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
    doubtful = ratio > SMALL_DAMPING and abs(offset) < FEIGNED * ratio
    return offset if abs(offset) <= LARGEST_OFFSET and not doubtful else 0.0


def like_pairs(
    omega: FloatArray, amplitude: FloatArray, Y: ComplexArray, compliance: FloatArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Pairs (below, above) of rows of similar amplitude across the largest ``compliance``, and their weights.

    All arguments (n,), the results (pairs,): empty if fewer than ``ROWS_ASIDE`` rows on a side have a partner.
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
    """At most ``_MOST_ROWS_ASIDE`` of the rows, evenly spaced."""
    if len(rows) <= _MOST_ROWS_ASIDE:
        return rows
    return rows[np.linspace(0, len(rows) - 1, _MOST_ROWS_ASIDE).astype(np.int64)]


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """The value below which half of the weight lies; arguments (n,)."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])
