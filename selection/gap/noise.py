"""Noise of every row: as stated, else from how roughly the residuals of a reference run along each sweep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from selection.arrays import FloatArray, IntArray
from selection.gap.rows import Rows
from selection.records.record import Record

#: What 1.4826 times the median of |x| is to a normal variable: its standard deviation.
_MAD = 1.4826
#: Noise that is assumed before anything is known: of the order of a careful sine test.
FIRST_GUESS = 0.02
#: Smallest noise that is believed, so that computed records do not divide by zero.
LEAST = 1e-6


def stated_noise(rows: Rows, record: Record) -> Rows:
    """The rows with the record's standard uncertainties; ``FIRST_GUESS`` for those that it does not state."""
    A, F = rows.A, rows.F
    relative = _filled(_column(record, "amplitude_sd", rows.row) / A)
    if "force_sd" in record.table.columns:
        relative = np.hypot(relative, _column(record, "force_sd", rows.row) / F)
    return replace(rows, sd_amplitude=relative, sd_phase=_filled(_column(record, "phase_sd", rows.row)))


def is_stated(record: Record) -> tuple[bool, bool]:
    """Whether the noise of amplitudes, and of phases, is stated."""
    names = ("amplitude_sd", "phase_sd")
    amplitude, phase = (name in record.table.columns and bool(np.any(record.column(name) > 0.0)) for name in names)
    return amplitude, phase


def roughness(rows: Rows, residual: FloatArray) -> float:
    """Standard deviation of what is random in residuals (n,) that are otherwise smooth along each sweep.

    Four neighbours are combined so that any parabola through them cancels (repeated points are neighbours too); the
    median of the sizes is not moved by a few wild points. With fewer than four rows in every sweep, neighbours are
    subtracted; with one row in each, the spread of all.
    """
    for width in (4, 2):
        found = [_combined(rows.omega[own], residual[own], width) for own in _runs(rows) if len(own) >= width]
        if found:
            return max(_MAD * float(np.median(np.abs(np.concatenate(found)))), LEAST)
    return max(float(np.std(residual)), LEAST)


def _runs(rows: Rows) -> list[IntArray]:
    return [np.flatnonzero(rows.sweep == number) for number in range(len(rows.sweeps))]


def _combined(x: FloatArray, y: FloatArray, width: int) -> FloatArray:
    """Combinations of ``width`` neighbours, of unit norm, that annul every polynomial of degree width - 2."""
    places = np.arange(len(x) - width + 1)[:, np.newaxis] + np.arange(width)
    t = x[places]
    t = (t - t.mean(axis=1, keepdims=True)) / max(float(np.ptp(x)), 1e-300)
    vandermonde = np.stack([t**k for k in range(width - 1)], axis=1)
    weights = np.linalg.svd(vandermonde)[2][:, -1, :]  # orthogonal to all rows
    return np.asarray(np.sum(weights * y[places], axis=1))


def _column(record: Record, name: str, row: IntArray) -> FloatArray:
    """A column in the order of the rows, NaN where it is absent or not above zero (none stated)."""
    if name not in record.table.columns:
        return np.full(len(row), np.nan)
    values = record.column(name)[row]
    return np.where(values > 0.0, values, np.nan)


def _filled(values: FloatArray) -> FloatArray:
    """Missing values replaced by the median of the others, or by ``FIRST_GUESS`` where there is none."""
    known = values[np.isfinite(values)]
    return np.where(np.isfinite(values), values, np.median(known) if known.size else FIRST_GUESS)
