"""Modes of one level of a sweep: peaks of an indicator, then poles and residues of all sensors, fitted band by band.

Motions are accelerations per unit of drive, H (sensors, n). With G_k = 1/(w_k^2 - w^2 + 2 i z_k w_k w)

    H_s = c_s + e_s w^2 + sign sum_k r_sk w^2 G_k,

sign +1 for base excitation (r = shape x participation) and -1 for a force (r = shape/modal mass); c and e represent the
motion of the base and modes outside the band. Within a level damping may change with amplitude, so that the ratios from
level to level are not forced into a law: z = z_p (1 + s (rho - 1) + t (1/rho - 1)), rho the amplitude under the drive
of the row over that at the peak. t, the share of friction, is free only if the rows demand it. Residues are linear and
solved for at every step (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares
from scipy.signal import find_peaks

from damping.arrays import ComplexArray, FloatArray
from damping.campaign.poles import Poles
from damping.campaign.projection import Projection, project, solve_residues, stack_parts
from damping.campaign.runs import CampaignRun

PROMINENCE = 1.0  #: least height of a peak of the indicator above its saddles, in ln of power: a factor e
#: The same of a low peak whose shape differs from those of the high peaks and which has, within ``MOVED``, a peak of
#: height ``PROMINENCE`` in quadrature with the drive, where the flanks of other modes add little. Chosen on 300 random
#: campaigns (one to six modes, 1 to 30 sensors, noise to 6 %); of 1053 modes of 300 others 857 have a peak, 777 without
#: this, and no peak is false.
IN_QUADRATURE = 0.35
#: Largest square of the cosine between two shapes that differ: the ringing of a mode has its shape. In 100 sweeps at up
#: to 8 octaves per minute low peaks add one of ringing to 129; those of any shape, from a height of 0.5, would add 66.
OTHER_SHAPE = 0.8
LEAST_T = 8.0  #: least residue of a mode at one sensor, in standard errors
SMALLEST_RATIO = 1e-5  #: least damping ratio of a mode
LARGEST_RATIO = 0.2  #: largest damping ratio of a mode
CONTROLLED = 0.1  #: a drive whose readings range over less than this share of their median is controlled to be constant
FEWEST_ROWS = 5  #: fewest rows in which a peak can be found
_FLOOR = 8.0  #: least motion of a peak, over the noise
_PASSES = 3  # over all clusters
_MEDIAN = 0.693  # over the mean, of an exponential variable
_CLASSES = 12  # of |H|, for the noise against |H|: two parameters, and some rows in each class of a short sweep
RELATIVE = 1e-3  #: least noise over |H|: no sensor is calibrated better
_CONSTANT = 0.05  # least square of the constant noise over the residuals' at the smallest |H|, of which it has the most
_SMALL = 0.1  # quantile of residuals that stands for those
_LARGEST_FRICTION = 0.85  #: largest share of friction: with more, a level hardly moves
_FRICTION = 0.2  # share with which a fit begins: some, so that its derivative is not 0
MOVED = 0.04  #: largest relative change of a frequency in a fit: farther is another peak
#: Range of the slope of damping with amplitude, over its peak value: at 1 small motion would be undamped.
SLOPES = (-0.9, 0.97)
_STEP = 1.5e-8  # of parameters, in differences: half of the digits
_FRICTION_PAYS = 20.0  #: least fall of the squared misfit to accept friction: e^10 in likelihood


@dataclass(frozen=True)
class ModalFit(Poles):
    """Modes of one level with their residues."""

    frequency_sd: FloatArray  #: relative (modes,)
    ratio_sd: FloatArray  #: relative (modes,)
    residues: FloatArray  #: (sensors, modes)
    residues_sd: FloatArray  #: (sensors, modes)
    local: FloatArray  #: coefficients of c, e (per Hz^2) and all modes in the band of each (modes, sensors, 2 + modes)
    noise: FloatArray  #: relative and constant part of the noise of H (2,)
    #: the delay in s of all sensors that lowers the misfit most, to first order, its standard error, and the squared
    #: misfit in its units (clusters, 3)
    delay: FloatArray

    def rest(self, f: FloatArray, H: ComplexArray, mode: int) -> ComplexArray:
        """H (sensors, n) minus all terms but one mode: its residue times sign w^2 G, and noise."""
        columns = self.columns(f)
        columns[:, 2 + mode] = 0.0
        return np.asarray(H - self.local[mode] @ columns.T)


@dataclass(frozen=True)
class Level:
    """A level as accelerations per unit of drive: ``f`` (n,), ``H`` (sensors, n), ``drive`` (n,) in SI, and its fit."""

    run: CampaignRun
    f: FloatArray
    H: ComplexArray
    drive: FloatArray
    fit: ModalFit
    third: ComplexArray | None = None  #: third harmonics per unit of drive, if tracked (sensors, n)
    name: str = ""  #: label in records, the level, unique for each of several runs at one level

    @property
    def steady_drive(self) -> FloatArray:
        """The drive (n,), see `hold_steady`."""
        return hold_steady(self.drive)


def hold_steady(drive: FloatArray) -> FloatArray:
    """The drive (n,); its median if it is controlled, as its scatter is then that of the readings."""
    middle = np.median(drive)
    return np.full_like(drive, middle) if np.ptp(drive) < CONTROLLED * middle else drive


def find_peaks_of(f: FloatArray, H: ComplexArray, sign: float = 1.0) -> list[float]:
    """Frequencies of the peaks of sum |H_s - H_s(low)|^2 over the sensors, above the noise: high ones, and low ones of
    another shape.

    H_s(low) is the motion of the base, at most 1 in size: larger first rows are the flank of a mode. Under a force
    (``sign`` -1) it is taken as 0. The noise is estimated from second differences, which are small for a smooth curve.
    """
    if len(f) < FEWEST_ROWS:
        return []
    rigid = np.median(H[:, : max(len(f) // 50, 3)].real, axis=1, keepdims=True).clip(-1.0, 1.0)
    moved = H - (rigid if sign > 0.0 else 0.0)
    rough = np.median(np.abs(np.diff(H, n=2, axis=1)), axis=1) / np.sqrt(6.0)
    floor = float(np.sum((_FLOOR * rough) ** 2))
    power, turned = (np.log(np.sum(x**2, axis=0) + floor) for x in (np.abs(moved), moved.imag))
    places, found = find_peaks(power, prominence=IN_QUADRATURE)
    turns, _ = find_peaks(turned, prominence=PROMINENCE)
    is_mode = found["prominences"] >= PROMINENCE
    beside = np.any(np.abs(f[turns][:, np.newaxis] / f[places] - 1.0) < MOVED, axis=0)
    shapes = moved.imag[:, places] / np.linalg.norm(moved.imag[:, places], axis=0).clip(min=1e-300)
    is_other = np.all((shapes[:, is_mode].T @ shapes) ** 2 < OTHER_SHAPE, axis=0)
    is_mode |= beside & is_other & is_mode.any()  # a shape is another beside that of a high peak only
    return [float(f[k]) for k in places[is_mode] if 2 <= k < len(f) - 2]


def fit_level(
    f: FloatArray,
    H: ComplexArray,
    starts: Sequence[float],
    sign: float,
    ratios: Sequence[float] = (),
    drive: FloatArray | float = 1.0,
) -> ModalFit:
    """The modes near ``starts`` (Hz), all sensors together.

    Args:
        f: (n,) Hz.
        H: (sensors, n) accelerations per unit of drive.
        sign: +1 base, -1 force.
        ratios: initial damping ratios; by default from the width of each peak.
        drive: amplitude (n,), in any unit.
    """
    frequency = np.array(sorted(starts), dtype=float)
    ratio = np.array(ratios, dtype=float) if len(ratios) else np.array([_width(f, H, at) for at in frequency])
    driven = np.array([f, hold_steady(np.broadcast_to(drive, f.shape))])
    poles = Poles(frequency, ratio, np.full(len(frequency), 0.2), np.zeros(len(frequency)), sign, driven)
    noise = np.array([0.01, 0.01 * float(np.median(np.abs(H)))])
    # clusters of the starting frequencies: a gap of about CLUSTER may open or close during the fit
    bands = [(cluster, poles.rows_about(f, cluster)) for cluster in poles.clusters]
    for _ in range(_PASSES):
        for cluster, rows in bands:
            poles = _fit_cluster(f[rows], H[:, rows], cluster, poles, noise)
        noise = _estimate_noise(f, H, poles, noise)
    for cluster, rows in bands:
        rubbed = _fit_cluster(f[rows], H[:, rows], cluster, poles, noise, friction=True)
        sd = evaluate_sd(H[:, rows], noise)
        left = (solve_residues(trial.columns(f[rows]), H[:, rows], sd)[1] for trial in (poles, rubbed))
        plain, with_it = (float(np.sum(np.abs(residual) ** 2)) for residual in left)
        poles = rubbed if plain - with_it > _FRICTION_PAYS else poles
    if poles.friction.any():
        noise = _estimate_noise(f, H, poles, noise)
    return _complete_fit(f, H, poles, noise)


def _width(f: FloatArray, H: ComplexArray, at: float) -> float:
    """Damping ratio from the half-power width of the peak of the sensor that moves most there."""
    place = int(np.argmin(np.abs(f - at)))
    largest: FloatArray = np.abs(H[int(np.argmax(np.abs(H[:, place])))])
    below = np.flatnonzero(largest <= largest[place] / np.sqrt(2.0))
    low, high = below[below <= place].max(initial=0), below[below >= place].min(initial=len(f) - 1)
    return float(np.clip((f[high] - f[low]) / (2.0 * at), 1e-4, 0.1))


def _fit_cluster(
    f: FloatArray, H: ComplexArray, cluster: Sequence[int], poles: Poles, noise: FloatArray, *, friction: bool = False
) -> Poles:
    """The poles with one cluster fitted, the others held; ``friction``: whether its share is free, else 0."""
    sd, count, parts, columns = evaluate_sd(H, noise), len(cluster), 3 + friction, poles.columns(f)
    places, copies = 2 + np.array(cluster), poles.repeat(cluster, parts)
    every, of = range(parts * count), np.tile(places, parts)  # a copy of its mode for each parameter, all at once
    last: dict[bytes, Projection] = {}  # derivatives are asked for where the misfit was

    def fit(x: FloatArray) -> Projection:
        if x.tobytes() not in last:
            columns[:, places] = poles.with_cluster(cluster, *np.split(x, parts)).motions(f, cluster).T
            last.clear()
            last[x.tobytes()] = project(columns, H, sd)
        return last[x.tobytes()]

    def misfit(x: FloatArray) -> FloatArray:
        return fit(x).rest.ravel()

    def differentiate(x: FloatArray) -> FloatArray:
        fitted, steps = fit(x), np.where(x + _STEP > high, -_STEP, _STEP)
        trials = np.tile(x.reshape(parts, 1, count), (1, parts, 1))  # (parameter, copy of the modes, mode)
        trials[range(parts), range(parts)] += steps.reshape(parts, count)
        moved = copies.with_cluster(every, *trials.reshape(parts, -1)).motions(f, every)
        return fitted.differentiate((moved - columns[:, of].T) / steps[:, np.newaxis], of, sd)

    x0 = np.concatenate(
        [np.zeros(count), np.log(poles.ratio[cluster]), poles.slope[cluster], np.full(count, _FRICTION)]
    )
    low = np.repeat([-MOVED, np.log(SMALLEST_RATIO), SLOPES[0], 0.0], count)[: parts * count]
    high = np.repeat([MOVED, np.log(LARGEST_RATIO), SLOPES[1], _LARGEST_FRICTION], count)[: parts * count]
    start = np.clip(x0[: parts * count], low + 1e-9, high - 1e-9)
    optimum = least_squares(misfit, start, differentiate, bounds=(low, high), x_scale="jac", max_nfev=40)
    return poles.with_cluster(cluster, *np.split(optimum.x, parts))


def evaluate_sd(H: ComplexArray, noise: FloatArray) -> FloatArray:
    """Standard deviation (sensors, n) of the real and of the imaginary part of H."""
    return np.asarray(np.hypot(noise[0] * np.abs(H), noise[1]))


def _estimate_noise(f: FloatArray, H: ComplexArray, poles: Poles, noise: FloatArray) -> FloatArray:
    """Relative and constant part a, b of the noise from residuals in the bands: |residual|^2 = 2 (a^2 |H|^2 + b^2)."""
    sizes, squares = [], []
    for cluster in poles.clusters:
        rows = poles.rows_about(f, cluster)
        sd = evaluate_sd(H[:, rows], noise)
        rest = solve_residues(poles.columns(f[rows]), H[:, rows], sd)[1] * sd
        sizes.append((np.abs(H[:, rows]) ** 2).ravel())
        squares.append(0.5 * (np.abs(rest) ** 2).ravel())
    size, square = np.concatenate(sizes), np.concatenate(squares)
    parts = [part for part in np.array_split(np.argsort(size), _CLASSES) if len(part)]
    means = np.array([np.mean(size[part]) for part in parts])
    levels = np.array([np.median(square[part]) / _MEDIAN for part in parts])
    weight = 1.0 / levels.clip(min=1e-30)
    design = np.column_stack([means, np.ones_like(means)]) * weight[:, None]
    squares_of_noise = np.linalg.lstsq(design, levels * weight, rcond=None)[0]
    constant = max(squares_of_noise[1], _CONSTANT * np.quantile(levels, _SMALL), 1e-20)
    return np.sqrt([max(squares_of_noise[0], RELATIVE**2), constant])


def _complete_fit(f: FloatArray, H: ComplexArray, poles: Poles, noise: FloatArray) -> ModalFit:
    """Residues and standard errors of every mode in its band, with the poles of its cluster free."""
    sensors, modes = len(H), len(poles.frequency)
    residues, residues_sd = np.zeros((sensors, modes)), np.zeros((sensors, modes))
    local, pole_sd, delays = np.zeros((modes, sensors, 2 + modes)), np.zeros((2, modes)), []
    for cluster in poles.clusters:
        rows = poles.rows_about(f, cluster)
        columns, sd = poles.columns(f[rows]), evaluate_sd(H[:, rows], noise)
        coefficients, residual = solve_residues(columns, H[:, rows], sd)
        width = columns.shape[1]
        free = 3 * len(cluster) + np.count_nonzero(poles.friction[cluster])
        freedom = max(2 * residual.size - sensors * width - free, 1)
        misfit = max(float(np.sum(np.abs(residual) ** 2)) / freedom, 1.0)
        jacobian = _stack_derivatives(f[rows], columns, coefficients, sd, cluster, poles)
        size = np.linalg.norm(jacobian, axis=0)
        size[size == 0.0] = 1.0
        inverse = np.linalg.pinv(jacobian / size, rcond=1e-10)
        deviation = np.sqrt(misfit * np.sum(inverse**2, axis=1)) / size
        delayed = stack_parts(-2j * np.pi * f[rows] * (coefficients @ columns.T) / sd).ravel()
        delayed -= jacobian @ (inverse @ delayed / size)  # what no other parameter explains
        square, rest = max(float(delayed @ delayed), 1e-300), stack_parts(residual).ravel()
        delays.append((float(delayed @ rest) / square, np.sqrt(misfit / square), float(rest @ rest) / misfit))
        for place, k in enumerate(cluster):
            residues[:, k], local[k] = coefficients[:, 2 + k], coefficients
            residues_sd[:, k] = deviation[[s * width + 2 + k for s in range(sensors)]]
            pole_sd[:, k] = deviation[sensors * width + place + np.array([len(cluster), 0])]
    parameters = (poles.frequency, poles.ratio, poles.slope, poles.friction, poles.sign, poles.drive)
    return ModalFit(*parameters, pole_sd[0], pole_sd[1], residues, residues_sd, local, noise, np.array(delays))


def _stack_derivatives(
    f: FloatArray, columns: ComplexArray, coefficients: FloatArray, sd: FloatArray, cluster: Sequence[int], poles: Poles
) -> FloatArray:
    """Derivatives by all coefficients, then by ln z, f (relative), s and t of the modes in the cluster."""
    moved = [(trial.columns(f) - columns) / step for trial, step in _list_steps(poles, cluster)]
    of_coefficients = [stack_parts(columns.T / row).T for row in sd]
    of_poles = [
        stack_parts(np.array([change @ own for change in moved]) / row)
        for own, row in zip(coefficients, sd, strict=True)
    ]
    return np.hstack([block_diag(*of_coefficients), np.hstack(of_poles).T])


def _list_steps(poles: Poles, cluster: Sequence[int]) -> Iterator[tuple[Poles, float]]:
    """The poles with one parameter of one mode changed, and the step: ratios (ln), frequencies (relative), slopes, and
    friction if it is not 0.
    """
    for which, step in {"ratio": 1e-4, "frequency": 1e-6, "slope": 1e-3, "friction": 1e-3}.items():
        for k in (k for k in cluster if which != "friction" or poles.friction[k]):
            stepped = getattr(poles, which).copy()
            stepped[k] = stepped[k] * (1.0 + step) if step < 1e-3 else stepped[k] + step
            changed: dict[str, Any] = {which: stepped}
            yield replace(poles, **changed), step
