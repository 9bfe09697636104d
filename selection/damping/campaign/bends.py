"""Modes whose stiffness changes with amplitude: their residues and the background of their bands, without a law.

A fit of one frequency for a level makes up for a resonance that bends by its residues and by the motion around it, then
not those of the mode. Both are of the linear structure and the same at all levels. In the band of a mode

    H_s = c_s + e_s w^2 + r_s p + (other modes, by the residues of their own bands),
    p = sign w^2/(K(A) - w^2 + i w L(A)),

whatever its stiffness K and loss L at the amplitude A = |p| drive/w^2 (describing functions of a mode by itself). Rows
below and above a resonance, and rows of several levels, have one amplitude. With splines for K and L, this fixes what
the sensors alone leave open: a scale of r and a share of c and e that moves as the mode does. K of a level may lie off
by a constant: between runs resonances drift with temperature and as joints settle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from damping.arrays import BoolArray, ComplexArray, FloatArray
from damping.campaign.modal_fit import MOVED, RELATIVE, Level, evaluate_sd
from damping.campaign.projection import solve_residues
from damping.campaign.sensors import find_bad_sensors

WIDE = 4.0  #: half of the range about a resonance, in half-power half-widths
STEP = 1.6  #: ratio of amplitudes between knots of K and L; 1.3 and 2 do as well
#: Least fall of the squared misfit, over its mean per degree of freedom, to take the residues of a bent mode. Of 146
#: modes of 56 random campaigns 46 of 47 that soften by 1 to 4.5 % reach it, from 300 to 200000, and 13 of 99 others.
PAYS = 250.0
FARTHEST = 0.2  #: largest change of a residue, in ln: a bend changes it by up to .06, a mode that is two by any factor
_PASSES = 2  # between the motion and the residues: more change nothing
_CUBIC = 3  # degree of the splines
_FEWEST = 30  # rows of all levels
_SMALLEST = 1e-9  # motion over the largest that is told from 0


@dataclass(frozen=True)
class _BandRows:
    """Rows of all levels about a mode: frequencies and the drive (n,), H and its noise (sensors, n)."""

    level: FloatArray  #: 1 at the rows of a level (n, levels)
    f: FloatArray
    drive: FloatArray
    H: ComplexArray
    sd: FloatArray
    columns: ComplexArray  #: of the fits (n, 2 + modes)
    sign: float
    least: float  #: square of the least noise over that of the fits


@dataclass(frozen=True)
class _BentMotion:
    """The motion p (n,) by which K and L have one value at an amplitude; ``pays``: see ``PAYS``."""

    p: ComplexArray
    change: float  #: of the residues, in ln
    sd: float  #: standard error of that
    pays: float


def unbend(levels: Sequence[Level]) -> list[Level]:
    """The levels with the residues of bent modes, and the coefficients of their bands, common to all.

    Sensors that are left out of all modes keep their own.
    """
    bad, fits = find_bad_sensors(levels), [level.fit for level in levels]
    usable = np.array([name not in bad for name in levels[0].run.names])
    for k in range(len(fits[0].frequency)) if usable.any() else ():
        found = _find_residues(levels, k, usable)
        if found is None:
            continue
        coefficients, sd = found
        for n, fit in enumerate(fits):
            local, residues, errors = fit.local.copy(), fit.residues.copy(), fit.residues_sd.copy()
            local[k, usable], residues[usable, k] = coefficients[usable], coefficients[usable, 2 + k]
            common = sd * np.sqrt(len(fits)) * np.abs(residues[usable, k])  # it does not fall in a mean over levels
            errors[usable, k] = np.hypot(errors[usable, k], common)
            fits[n] = replace(fit, local=local, residues=residues, residues_sd=errors)
    return [replace(level, fit=fit) for level, fit in zip(levels, fits, strict=True)]


def _find_residues(levels: Sequence[Level], k: int, usable: BoolArray) -> tuple[FloatArray, float] | None:
    """Coefficients (sensors, 2 + modes) of the band of mode ``k``, and the relative error of its residues.

    None unless the mode is bent, or if it moved by more than ``MOVED`` from level to level: that may be another peak.
    """
    frequency = np.array([level.fit.frequency[k] for level in levels])
    if np.any(np.abs(np.diff(np.log(frequency))) > MOVED):
        return None
    band, modes = _join_rows(levels, k), len(levels[0].fit.frequency)
    if len(band.f) < _FEWEST:
        return None
    cluster = next(cluster for cluster in levels[0].fit.clusters if k in cluster)
    far = 2 + np.setdiff1d(np.arange(modes), cluster)
    coefficients, columns = np.zeros((len(band.H), 2 + modes)), band.columns.copy()
    weights = np.array([level.fit.residues_sd for level in levels]).clip(min=1e-300) ** -2.0
    residues = np.array([level.fit.residues for level in levels])
    coefficients[:, far] = (np.sum(weights * residues, axis=0) / np.sum(weights, axis=0))[:, far - 2]
    near, others = np.setdiff1d(np.arange(2 + modes), far), np.arange(2 + modes) != 2 + k
    H, sd = band.H - coefficients[:, far] @ columns[:, far].T, 0.0
    for number in range(_PASSES):
        coefficients[:, near] = solve_residues(columns[:, near], H, band.sd)[0]
        r = coefficients[usable, 2 + k, np.newaxis] / band.sd[usable]
        rest = (band.H - coefficients[:, others] @ columns[:, others].T)[usable] / band.sd[usable]
        square = np.sum(r**2, axis=0)
        balance = _balance(band, np.sum(r * rest, axis=0) / square, 1.0 / np.sqrt(square))
        if (number == 0 and balance.pays < PAYS) or abs(balance.change) >= FARTHEST:
            return None
        columns[:, 2 + k], sd = balance.p, balance.sd
    coefficients[:, near] = solve_residues(columns[:, near], H, band.sd)[0]
    return coefficients, sd


def _join_rows(levels: Sequence[Level], k: int) -> _BandRows:
    """Rows of all levels within ``WIDE`` of mode ``k``, and in the band of its cluster."""
    parts = []
    for level in levels:
        fit = level.fit
        rows = fit.rows_about(level.f, next(cluster for cluster in fit.clusters if k in cluster))
        at = level.f[rows] / fit.frequency[k]
        rows = rows[np.abs(at - 1.0 / at) <= 2.0 * WIDE * fit.ratio[k]]
        H = level.H[:, rows]
        sd, columns = evaluate_sd(H, fit.noise), fit.columns(level.f[rows]).T
        parts.append((level.f[rows], level.steady_drive[rows], H, sd, columns))
    f, drive, H, sd, columns = (np.concatenate(of, axis=-1) for of in zip(*parts, strict=True))
    least = RELATIVE / max(float(level.fit.noise[0]) for level in levels)
    of_level = np.repeat(np.eye(len(parts)), [len(part[0]) for part in parts], axis=0)
    return _BandRows(of_level, f, drive, H, sd, columns.T, levels[0].fit.sign, least**2)


def _balance(band: _BandRows, p: ComplexArray, error: FloatArray) -> _BentMotion:
    """The motion p (n,) of standard error ``error`` less a share of the background and scaled.

    K - w^2 + i w L = sign w^2 s/(p - a - b w^2), with s, a and b such that splines of ln A leave least.
    """
    w, largest = 2.0 * np.pi * band.f, float(np.abs(p).max())
    p = np.where(np.abs(p) > _SMALLEST * largest, p, _SMALLEST * largest)
    middle = np.median(w)
    weight, off = np.abs(p) ** 2 / error / w**2, (w / middle) ** 2 - 1.0
    splines = _list_splines(np.abs(p) * band.drive / w**2)
    of_loss, of_stiffness = (
        np.linalg.qr(base * weight[:, np.newaxis])[0] for base in (splines, np.hstack([splines, band.level[:, 1:]]))
    )

    def move(x: FloatArray) -> ComplexArray:
        return np.asarray((p - largest * (x[1] + x[2] * off)) * np.exp(-x[0]))

    def misfit(x: FloatArray) -> FloatArray:
        moved = move(x)
        stiffness = band.sign * w**2 * np.conj(moved) / np.maximum(np.abs(moved), _SMALLEST * largest) ** 2
        elastic, loss = (stiffness.real + w**2) * weight, stiffness.imag * middle / w * weight
        elastic, loss = elastic - of_stiffness @ (of_stiffness.T @ elastic), loss - of_loss @ (of_loss.T @ loss)
        return np.concatenate([elastic, loss])

    start = np.zeros(3)
    before = float(np.sum(misfit(start) ** 2))
    optimum = least_squares(misfit, start, bounds=(-FARTHEST, FARTHEST), x_scale="jac", max_nfev=30)
    freedom = max(len(optimum.fun) - of_stiffness.shape[1] - of_loss.shape[1] - 3, 1)
    mean = max(2.0 * optimum.cost / freedom, band.least)
    jacobian = np.asarray(optimum.jac)
    sd = float(np.sqrt(mean * np.linalg.pinv(jacobian.T @ jacobian)[0, 0]))
    return _BentMotion(move(optimum.x), float(optimum.x[0]), sd, (before - 2.0 * optimum.cost) / mean)


def _list_splines(A: FloatArray) -> FloatArray:
    """Cubic splines (n, splines) of ln A (n,), with knots ``STEP`` apart over its range."""
    along = np.log(A / A.min()) / log(STEP)
    last = max(float(np.ceil(along.max())), 1.0)
    knots = np.r_[np.zeros(_CUBIC), np.arange(last + 1.0), np.full(_CUBIC, last)]
    return np.asarray(BSpline.design_matrix(along.clip(0.0, last), knots, _CUBIC).toarray())
