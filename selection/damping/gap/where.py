"""Where the gap lies: cells of contiguous rows of one sweep, by residual and by footprint of the explanation.

Local estimates are natural frequency and damping ratio from each row alone, averaged by sweep and band of amplitude.
A row with a phase and an added mass m measures Y = F exp(i phase)/A = K - (M + m) omega^2 + (S + i C)/A. With the
simulation's mass it gives, of the structure without m,

    omega_local^2 = (Re Y)/M + (1 + m/M) omega^2,    zeta_local = Im Y/(2 M omega omega_n)

for any law. Constant zeta is viscous damping; zeta ~ A^p is a force C ~ A^(p + 1), and likewise for the stiffness:
p = -1 friction, 1 velocity squared, 2 q^2 q' or a cubic spring.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray, IntArray, wrap_lag
from damping.effects.contract import Drive
from damping.effects.terms import complex_stiffness
from damping.gap.fit import ModelFit
from damping.gap.model import steady
from damping.gap.rows import PhasorRows
from damping.gap.size import fitted_terms, nominal_residuals, regular_values
from damping.records.mode import Mode
from damping.records.text import per_cent

MOST_CELLS = 8  #: most cells of a sweep
FEWEST_ROWS = 4  #: fewest rows of a cell
VISIBLE = 1.0  #: change of the prediction, in units of noise, beyond which a row is in the footprint of an explanation
RESONANCE_FOUND = 0.1  #: standard uncertainty of the phase pi/2 of a row taken at phase resonance, rad
BANDS = 4  #: bands of amplitude in every sweep
FEW = 6  #: with fewer values only power 1 is tried
#: Standard deviations from the median beyond which a value is left out of a local mean: one in 16 000 by chance.
FAR = 4.0
#: Least share of the chi-square of a constant that a power of amplitude removes where a trend is reported: half.
TREND_FITS = 0.5
#: Chi-square (2 degrees of freedom: power and size) above which a trend is reported: one in a thousand by chance.
SIGNIFICANT_TREND = 13.8
LEAST_MOVE = 5e-5  #: relative change of a resonance that no test reads
POWERS = np.array([-1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0])  #: powers of amplitude that are tried


@dataclass(frozen=True)
class RowSpan:
    """Contiguous rows of one sweep and one quantity; frequencies in Hz."""

    sweep: str
    frequency_low: float
    frequency_high: float
    quantity: str


@dataclass(frozen=True)
class ResidualCell(RowSpan):
    """``share`` of the squared residual at nominal parameters; ``z`` = (sum of squares - n)/sqrt(2 n)."""

    share: float
    z: float


@dataclass(frozen=True)
class FootprintCell(RowSpan):
    """``size``: root mean square change of the prediction, in units of noise."""

    size: float


def residual_cells(leading: ModelFit) -> tuple[ResidualCell, ...]:
    """All cells by share of the squared residual of the nominal simulation, largest first; shares add to 1.

    Outliers are left out.
    """
    rows = leading.model.problem.rows
    regular = regular_values(leading).astype(float)
    squares = by_quantity(rows, nominal_residuals(leading) ** 2 * regular)
    counts = by_quantity(rows, regular)
    total = max(sum(float(values.sum()) for values in squares.values()), 1e-300)
    parts = [np.array_split(run, min(MOST_CELLS, max(1, len(run) // FEWEST_ROWS))) for run in rows.runs]
    cells = []
    for quantity, values in squares.items():
        for cell_rows in chain.from_iterable(parts):
            n, sum_of_squares = counts[quantity][cell_rows].sum(), values[cell_rows].sum()
            z = (sum_of_squares - n) / np.sqrt(2.0 * max(n, 1.0))
            cells.append(ResidualCell(*_place(rows, cell_rows, quantity), float(sum_of_squares / total), float(z)))
    return tuple(sorted(cells, key=lambda cell: -cell.share))


def footprint(leading: ModelFit) -> dict[str, FloatArray]:
    """Change of the prediction by the explanation, all else equal, in units of noise, (n,) by quantity."""
    rows = leading.model.problem.rows
    with_effects = steady(fitted_terms(leading), rows, rows.u)
    without = steady(fitted_terms(leading, effects=False), rows, with_effects.u)
    changes = {"amplitude": (with_effects.u - without.u) / rows.sd_amplitude}
    if rows.has_phase:
        changes["phase"] = wrap_lag(with_effects.phase - without.phase, -np.pi) / rows.sd_phase
    return changes


def footprint_cells(leading: ModelFit) -> tuple[FootprintCell, ...]:
    """Contiguous rows that the explanation changes visibly, largest first; none without an explanation."""
    if not leading.model.parts:
        return ()
    rows = leading.model.problem.rows
    cells = []
    for quantity, change in footprint(leading).items():
        visible = np.abs(change) > VISIBLE
        cuts = [np.split(run, np.flatnonzero(np.diff(visible[run].astype(int))) + 1) for run in rows.runs]
        for cell_rows in (part for part in chain.from_iterable(cuts) if len(part) and visible[part[0]]):
            size = float(np.sqrt(np.mean(change[cell_rows] ** 2)))
            cells.append(FootprintCell(*_place(rows, cell_rows, quantity), size))
    return tuple(sorted(cells, key=lambda cell: -cell.size))


def by_quantity(rows: PhasorRows, values: FloatArray) -> dict[str, FloatArray]:
    """Values (m,) split into amplitude and, where measured, phase."""
    names = ["amplitude", *(["phase"] if rows.has_phase else [])]
    return dict(zip(names, values.reshape(-1, len(rows)), strict=False))


def _place(rows: PhasorRows, cell_rows: IntArray, quantity: str) -> tuple[str, float, float, str]:
    hertz = rows.omega[cell_rows] / RAD_S_PER_HZ
    return rows.sweeps[rows.sweep[cell_rows[0]]], float(hertz.min()), float(hertz.max()), quantity


@dataclass(frozen=True)
class LocalEstimate:
    """Mean of the rows of one sweep in one band of amplitude, with standard errors; frequency in Hz."""

    sweep: str
    amplitude: float
    frequency: float
    frequency_sd: float
    damping: float
    damping_sd: float


@dataclass(frozen=True)
class PowerTrend:
    """Dependence of an estimate on amplitude, as A^``power``."""

    power: float
    gain: float  #: chi-square of a constant less that of the power
    change: float  #: of the estimate from the smallest to the largest amplitude
    share: float = 1.0  #: gain over the chi-square of a constant

    @property
    def significant(self) -> bool:
        """Whether the estimates change with amplitude beyond noise."""
        return self.gain > SIGNIFICANT_TREND

    @property
    def fits(self) -> bool:
        """Whether the power is most of that change."""
        return self.share >= TREND_FITS


def local_estimates(rows: PhasorRows, mode: Mode) -> tuple[LocalEstimate, ...]:
    """Estimates by sweep and amplitude band, smallest amplitude first within a sweep; none without phases.

    A row at phase resonance has the phase pi/2 within `RESONANCE_FOUND`.
    """
    if not (rows.has_phase or rows.at_resonance):
        return ()
    sd_phase = rows.sd_phase if rows.has_phase else np.full(len(rows), RESONANCE_FOUND)
    M = mode.mass * rows.mass
    size = rows.F / rows.A
    Y = size * np.exp(1j * rows.phase)
    squared, zeta = Y.real / M + (1.0 + rows.added / M) * rows.omega**2, Y.imag / (2.0 * M * rows.omega * mode.omega_n)
    cos, sin = np.cos(rows.phase), np.sin(rows.phase)
    sd_real = size * np.hypot(cos * rows.sd_amplitude, sin * sd_phase)
    sd_imaginary = size * np.hypot(sin * rows.sd_amplitude, cos * sd_phase)
    estimates = []
    for sweep, run in zip(rows.sweeps, rows.runs, strict=True):
        for band in np.array_split(run[np.argsort(rows.u[run])], min(BANDS, max(1, len(run) // 4))):
            omega2, omega2_sd, _ = _mean(squared[band], (sd_real / M)[band])
            damping, damping_sd, weights = _mean(
                zeta[band], (sd_imaginary / (2.0 * M * rows.omega * mode.omega_n))[band]
            )
            omega = float(np.sqrt(max(omega2, 0.0)))
            frequency_sd = omega2_sd / max(2.0 * omega, 1e-300) / RAD_S_PER_HZ
            amplitude = float(weights @ rows.A[band] / weights.sum())  # weighted as the damping is
            estimates.append(LocalEstimate(sweep, amplitude, omega / RAD_S_PER_HZ, frequency_sd, damping, damping_sd))
    return tuple(estimates)


def trend(amplitude: FloatArray, value: FloatArray, sd: FloatArray) -> PowerTrend | None:
    """The best of `POWERS` for values (n,) by weighted least squares on 1 and A^p; None below 3 values."""
    if len(value) < 3:
        return None
    relative = amplitude / amplitude.max()
    constant = _chi_square(np.ones((len(value), 1)), value, sd)[0]
    total = constant or np.inf  # equal values: the share is 0
    trends = []
    for power in POWERS if len(value) >= FEW else [1.0]:
        chi_square, coefficients = _chi_square(np.column_stack([np.ones(len(value)), relative**power]), value, sd)
        change = coefficients[1] * float(relative.max() ** power - relative.min() ** power)
        trends.append(PowerTrend(float(power), constant - chi_square, float(change), (constant - chi_square) / total))
    return max(trends, key=lambda trend: trend.gain)


def _mean(values: FloatArray, sd: FloatArray) -> tuple[float, float, FloatArray]:
    """Weighted mean, its sd and the weights; outliers, beyond ``FAR`` sd from the median, are left out."""
    near = np.abs(values - np.median(values)) < FAR * np.hypot(sd, np.median(sd))
    weights = np.where(near | ~near.any(), np.maximum(sd, 1e-12 * np.abs(values)) ** -2.0, 0.0)
    return float(weights @ values / weights.sum()), float(weights.sum() ** -0.5), weights


def _chi_square(design: FloatArray, value: FloatArray, sd: FloatArray) -> tuple[float, FloatArray]:
    scaled = design / sd[:, np.newaxis]
    coefficients = np.linalg.lstsq(scaled, value / sd)[0]
    return float(np.sum((value / sd - scaled @ coefficients) ** 2)), np.asarray(coefficients)


def trend_of(local: Sequence[LocalEstimate], quantity: str) -> PowerTrend | None:
    """Trend of local estimates of a quantity with amplitude."""
    columns = ("amplitude", quantity, f"{quantity}_sd")
    return trend(*(np.array([getattr(estimate, column) for estimate in local]) for column in columns))


def trace_local(fit: ModelFit, A: FloatArray) -> FloatArray:
    """Natural frequency (Hz) and damping ratio (2, n) of the first plane of a fit at amplitudes (n,)."""
    terms = fitted_terms(fit, deviations=False)
    M, omega_n = float(np.ravel(terms.M)[0]), float(np.ravel(terms.omega_n)[0])
    drive = Drive(np.ones(len(A)), np.full(len(A), omega_n))
    Z = complex_stiffness(terms._replace(M=M, omega_n=omega_n, beside=(), damped=()), A, drive)[0][0]
    frequency = np.sqrt(np.maximum(Z.real / M + omega_n**2, 0.0)) / RAD_S_PER_HZ
    return np.array([frequency, Z.imag / (2.0 * M * omega_n**2)])


def describe_resonances(leading: ModelFit, local: Sequence[LocalEstimate]) -> list[str]:
    """Caution: measured resonance frequencies move with amplitude as the explanation does not.

    Rows at phase resonance are compared by the balance of force and damping; their frequencies are not in the fit.
    """
    if not leading.model.problem.rows.at_resonance or len(local) < 3:
        return []
    A, measured, sd = np.array([(each.amplitude, each.frequency, each.frequency_sd) for each in local]).T
    predicted = trace_local(leading, A)[0]
    rest = trend(A, measured / predicted, sd / predicted)
    if rest is None or not (rest.significant and rest.fits):
        return []
    smallest, largest = int(np.argmin(A)), int(np.argmax(A))
    of_model = float(predicted[largest] / predicted[smallest] - 1.0)
    of_rows = of_model + rest.change
    other = abs(of_rows) > abs(of_model) and of_rows * of_model >= 0.0
    doubt = "something else changes the stiffness too" if other else "its change of stiffness is not the measured one"
    return [
        f"from the smallest amplitude to the largest the resonance {_describe_move(of_rows)}, but with the leading "
        f"explanation it {_describe_move(of_model)}: {doubt}"
    ]


def _describe_move(change: float) -> str:
    """A relative change of frequency in words."""
    size = f"{per_cent(100.0 * abs(change))} %"
    return "stays" if abs(change) < LEAST_MOVE else f"{'rises' if change > 0.0 else 'falls'} by {size}"
