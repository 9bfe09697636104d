"""Where a sweep passes phase resonance, or jumps past it over a fold."""

import numpy as np

from damping.arrays import FloatArray

#: A sweep jumps where the resonance itself moves by this between two rows, in half-widths (1: damping ratio times
#: frequency): a resonance that stays moves by noise, and one that is bent little from row to row.
JUMP = 1.0
#: |cot phase| of the nearer row up to which a jump past resonance is read as a passage: F/Im Z is then 3 % more than
#: its amplitude at most.
JUMP_AT_RESONANCE = 0.25
FEWEST_BESIDE = 2  #: steps from row to row, beside the one past resonance, that tell whether that is a jump
_TELLING = 1e-6  # least sin(phase) of a row that is told from one that noise carries beyond 0..pi


def find_jump(force: FloatArray, frequency: FloatArray, amplitude: FloatArray, phase: FloatArray) -> int | None:
    """The row (of n in the order of the sweep, phases freed of their offset) after which it jumps past its resonance.

    Re Z/M = omega_r^2 - omega^2 tells the resonance omega_r at the amplitude of each row, M being the median of
    -d Re Z/d omega^2 from row to row. Of a resonance that stays it is the same on either side of phase pi/2, however
    far apart the rows are; over a fold it leaps with the amplitude. None where it moves by less than ``JUMP``
    half-widths Im Z of the nearer row, or half as far as the frequency (a coarse sweep with noise), or where that row
    is at resonance (``JUMP_AT_RESONANCE``).
    """
    if len(phase) < 2:
        return None
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
