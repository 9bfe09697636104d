"""What of a record bears on resonant amplitudes: rows near resonance, free of a constant phase offset.

Is the law changing at the top of the test? The local exponent p = d ln F/d ln A from level to level.

How much a law errs per e-fold of force beyond what it was fitted to: learnt from held-out levels, with a prior.

No law of a few terms is the structure's own. At a force F the logarithm of the resonant amplitude misses the law's by

    delta ~ N(0, (kappa d)^2),      d = |ln(F/F_nearest)| beyond the tested forces, d_1 d_2/(d_1 + d_2) between two,

beside the scatter from level to level that tests show at one force. ``kappa`` has a log-normal prior and is learnt, for
each law, from every level predicted from fewer levels below (all pairs; the pairs of one level count as one level).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from damping.arrays import BoolArray, FloatArray
from damping.infer.observations import Observations, observe
from damping.ranking.weights import HeldOut
from damping.records.record import Record
from damping.records.resonance import number_levels, resonances

#: Rows with |cot phase| up to this are near: those between the half-power points of their sweep.
NEAR = 1.0


def near_resonance(record: Record) -> Observations:
    """Observations of the rows near resonance.

    A constant phase offset rotates the energy of a row by offset times cot(phase), relative: what
    :func:`damping.records.resonance.resonances` finds of it is taken off first (not where the record has energies of
    its own). Then rows between the half-power points stay, |F cos(phase)| <= ``NEAR`` F sin(phase): beyond them the
    measured energy is mostly error of phase. A sweep without any keeps the row nearest to resonance.

    Raises:
        AnalysisError: no row says anything about damping.
    """
    data = observe(without_offset(record))
    return _rows(data, _near(data))


def without_offset(record: Record) -> Record:
    """The record with each sweep's phase offset taken off its phases; as it is where energies were recorded."""
    if not record.has_phase or "energy" in record.table.columns:
        return record
    offset = resonances(record).set_index("sweep")["phase_offset"]
    table = record.table.copy()
    table["phase"] = table["phase"] - table["sweep"].astype(str).map(offset)
    return Record.trusted(table, record.source)


def at_resonance(data: Observations) -> Observations:
    """One row a sweep: its phase resonance, with the mean uncertainties of the sweep's rows."""
    number = len(data.sweeps)

    def mean(values: FloatArray) -> FloatArray:
        return np.sqrt(np.bincount(data.sweep, values**2, number) / data.rows_per_sweep)

    return replace(
        data,
        A=data.tested_amplitude,
        omega=data.tested_omega,
        D=data.tested_force,
        R=np.zeros(number),
        sweep=np.arange(number),
        sd_amplitude=mean(data.sd_amplitude),
        sd_force=mean(data.sd_force),
        sd_phase=mean(data.sd_phase),
    )


def _near(data: Observations) -> BoolArray:
    """Which rows are near resonance, (rows,)."""
    cotangent = np.where(data.D > 0.0, data.R / np.where(data.D > 0.0, data.D, 1.0), np.inf)
    near = cotangent <= NEAR
    for sweep in range(len(data.sweeps)):
        rows = np.flatnonzero(data.sweep == sweep)
        near[rows[np.argmin(cotangent[rows])]] = True
    return np.asarray(near)


def _rows(data: Observations, keep: BoolArray) -> Observations:
    """The rows marked in ``keep``."""
    names = ("A", "omega", "D", "R", "sweep", "sd_amplitude", "sd_force", "sd_phase")
    return replace(data, **{name: getattr(data, name)[keep] for name in names})


#: Standard normal quantile (one side 5 %) beyond which a change of p is said to be one.
CHANGES = 1.64
#: Shift of the resonance, in half-power bandwidths, from which on a mode is called bistable: a cubic spring makes the
#: response curve vertical at 4/(3 sqrt(3)) = 0.77; the rest is for the error of the mass.
BISTABLE = 1.0


@dataclass(frozen=True)
class Trend:
    """Local exponents between neighbouring levels, lowest first.

    Attributes:
        force: geometric mean of the two forces, (levels - 1,). p, sd: exponent and its standard deviation by the
            scatter of resonances, (levels - 1,). z: change between the last two over its standard deviation; NaN with
            fewer than three levels.
    """

    force: FloatArray
    p: FloatArray
    sd: FloatArray
    z: float

    @property
    def rising(self) -> bool:
        """Whether p rises at the top of the test: damping grows faster than below."""
        return bool(self.z > CHANGES)

    @property
    def falling(self) -> bool:
        """Whether p falls at the top of the test: amplitudes grow faster than below."""
        return bool(self.z < -CHANGES)

    @property
    def words(self) -> str:
        """The exponents, lowest level first."""
        return ", then ".join(f"{p:.2f}" for p in self.p)


def trend(data: Observations, scatter: float) -> Trend:
    """Local exponents of the tested resonances, repeats of a level averaged.

    Args:
        scatter: relative scatter of one sweep's resonant amplitude.
    """
    levels = number_levels(data.tested_force)
    count = np.bincount(levels)
    log_F, log_A = (np.bincount(levels, np.log(v)) / count for v in (data.tested_force, data.tested_amplitude))
    step_F, step_A = np.diff(log_F), np.diff(log_A)
    with np.errstate(divide="ignore", invalid="ignore"):
        p = np.where(step_A > 0.0, step_F / step_A, np.nan)
        slope = p / step_A  # -dp/d ln A of the upper level, dp/d ln A of the lower
    variance = scatter**2 / count
    sd = np.abs(slope) * np.sqrt(variance[:-1] + variance[1:])
    force = np.exp(0.5 * (log_F[:-1] + log_F[1:]))
    return Trend(force, p, sd, _change(p, slope, variance))


def _change(p: FloatArray, slope: FloatArray, variance: FloatArray) -> float:
    """Last p less the one before, over its standard deviation; the middle level errs both, in opposite ways."""
    if len(p) < 2:
        return np.nan
    gradient = np.array([slope[-2], slope[-2] + slope[-1], slope[-1]])
    return float((p[-1] - p[-2]) / np.sqrt(np.sum(gradient**2 * variance[-3:])))


def bistability(data: Observations, mass: float) -> str:
    """A caution where two stable amplitudes are likely to belong to one force and frequency; else empty.

    The half-power bandwidth at the largest tested force is F/(M omega A), with the generalized ``mass`` M. A cubic
    spring that moves the resonance by 4/(3 sqrt(3)) of it makes the response curve vertical somewhere.
    """
    top = data.top
    width = data.tested_force[top] / (mass * data.tested_omega[top] * data.tested_amplitude[top])
    moved = float(np.ptp(data.tested_omega) / width)
    if moved < BISTABLE:
        return ""
    return (
        f"the resonance moved by {moved:.1f} half-power bandwidths over the levels: the mode is bistable at high drive "
        "and what it reaches depends on how it is driven there"
    )


#: Prior of kappa: median and log standard deviation. 90 % lies between 1.5 % and 17 % of amplitude per e-fold of force.
KAPPA_MEDIAN, KAPPA_LOG_SD = 0.05, 0.75
#: Values of kappa, equally spaced in the logarithm over 3.5 standard deviations of the prior either way.
KAPPA = KAPPA_MEDIAN * np.exp(KAPPA_LOG_SD * np.linspace(-3.5, 3.5, 57))


def prior() -> FloatArray:
    """Prior probability of each of ``KAPPA``."""
    density = norm.pdf(np.log(KAPPA / KAPPA_MEDIAN) / KAPPA_LOG_SD)
    return np.asarray(density / density.sum())


def posterior(predictions: Sequence[HeldOut]) -> FloatArray:
    """Posterior probability of each of ``KAPPA`` from one law's predictions; the prior where there are none."""
    levels = [prediction.level for prediction in predictions]
    log_p = np.log(prior())
    for prediction in predictions:
        density = prediction.log_density(KAPPA)
        log_p = log_p + np.where(np.isfinite(density), density, 0.0) / levels.count(prediction.level)
    return np.asarray(np.exp(log_p - logsumexp(log_p)))


def log_density(prediction: HeldOut) -> float:
    """Log predictive density of a held-out level, kappa averaged over its prior."""
    return float(logsumexp(prediction.log_density(KAPPA), b=prior()))


def draw(probability: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
    """Draws of kappa (n,) from probabilities of ``KAPPA``, spread over its cells."""
    step = np.log(KAPPA[1] / KAPPA[0])
    chosen = rng.choice(len(KAPPA), size=n, p=probability)
    return np.asarray(KAPPA[chosen] * np.exp(step * (rng.random(n) - 0.5)))


def distance(force: FloatArray, tested: FloatArray) -> FloatArray:
    """Distance d of each force (forces,) from the tested ones (sweeps,) in ln F; 0 at a tested force."""
    log_F, known = np.log(force), np.unique(np.log(tested))
    above = np.searchsorted(known, log_F)
    to_lower = np.abs(log_F - known[np.maximum(above - 1, 0)])
    to_upper = np.abs(known[np.minimum(above, len(known) - 1)] - log_F)
    between = (above > 0) & (above < len(known))
    both = np.where(between, to_lower + to_upper, 1.0)
    return np.where(between, to_lower * to_upper / both, np.minimum(to_lower, to_upper))
