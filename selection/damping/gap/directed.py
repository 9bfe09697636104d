"""Directed tests (Rao 1948) for more than noise in the residuals of a fit, and free-form curves that show it.

Each test asks whether a free-form addition to the fitted model, with a few linear coefficients a, improves it. With
columns D, the change of the residuals r by a, projected free of the fitted variables,

    2 gain = g^T M^-1 g,   g = D^T W r,   M = D^T W D - D^T W J H^-1 J^T W D,

which under noise alone is chi-square with as many degrees of freedom as coefficients. Families: stiffness k(A) and
damping c(A); a second path, any smooth complex function of frequency; gain and phase of the instrument with amplitude
or with frequency; drift in the order of measurement. Two tests have no columns: of windows of frequency (a local
disturbance) and of neighbours.

The free-form curves are natural frequency and damping over amplitude: those of the fit plus quadratic splines of ln A,
to first order. The coefficients are a = -M^-1 g with covariance M^-1. The fitted variables y move with them by -K a,
K = H^-1 J^T W D, so a curve c(y) + B a changes by B - c'(y) K with a. A change that a variable and a spline can both
make therefore adds no uncertainty to the curve.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, ndtr

from damping.arrays import ComplexArray, FloatArray
from damping.effects.contract import Effect
from damping.gap.fit import ModelFit, decorrelate
from damping.gap.unknowns import CLIP

#: An alarm is given where the smallest p-value under noise alone, times the number of tests, is below this.
ALARM = 0.003
#: Most missing forces that an explanation may blame; more can imitate a law that is not in the library.
MOST_FORCES = 2
SPLINES = 6  #: splines of stiffness, and of damping, with amplitude
_WINDOWS = (4, 8, 16)  #: rows in a window of frequency
#: The family of a natural frequency (relative change) and a damping ratio that change with amplitude in free form.
FREE = "stiffness and damping with amplitude"
_SEEN = 1e-4  #: least information of a spline combination that is kept, over that of the best determined one
_MOST_UNSEEN = 0.1  #: largest share of a curve in combinations left out at which it is drawn
_STEP = 1e-4  #: step of a fitted variable (prior standard deviation 1) for the slope of a curve
_DRAWN = 80  #: Amplitudes at which a curve of free form is drawn.


@dataclass(frozen=True)
class Test:
    """One test: what it looks for, its chi-square gain, degrees of freedom, and probability under noise alone."""

    __test__ = False  # not a pytest class

    name: str
    gain: float
    freedom: int
    p_value: float


def directed_tests(fit: ModelFit) -> list[Test]:
    """All tests of the residuals of a fit, in no particular order."""
    white = _whiten(fit)
    tests = [_test_columns(white, name, _whiten_columns(columns, fit)) for name, columns in list_columns(fit).items()]
    return [*tests, _test_windows(white), _test_neighbours(white)]


def _whiten(fit: ModelFit) -> ModelFit:
    """The fit with residuals and Jacobian decorrelated along sweeps, as its covariance is."""
    r, J = (decorrelate(part, fit.model, fit.model.scatter.correlation)[0] for part in (fit.r, fit.J))
    return replace(fit, r=r, J=J)


def _whiten_columns(D: FloatArray, fit: ModelFit) -> FloatArray:
    """Columns (coefficients, m) decorrelated along sweeps."""
    return decorrelate(D.T, fit.model, fit.model.scatter.correlation)[0].T


def smallest_p(tests: Sequence[Test]) -> float:
    """The smallest p-value, times the number of tests."""
    return min(1.0, len(tests) * min(test.p_value for test in tests))


def basis(x: FloatArray, size: int, at: FloatArray | None = None) -> FloatArray:
    """``size`` quadratic B-splines over the range of x with knots at its quantiles, (size, n); they add to 1.

    ``at``: points of evaluation, x if not given.
    """
    inner = np.quantile(x, np.linspace(0.0, 1.0, size - 1))
    span = max(float(np.ptp(x)), 1e-12)
    inner = np.maximum.accumulate(inner + np.linspace(0.0, 1e-6, len(inner)) * span)
    knots = np.concatenate([[inner[0]] * 2, inner, [inner[-1]] * 2])
    place = np.clip(x if at is None else at, inner[0], inner[-1])
    interval = np.clip(np.searchsorted(inner, place, side="right"), 1, size - 2) + 1  # knots[interval] <= place
    values = [np.ones(len(place))]
    for degree in (1, 2):  # Cox and de Boor; scipy.interpolate takes a fifth of a second to import
        raised = [np.zeros(len(place))]
        for k, spline in enumerate(values):
            low, high = knots[interval + k + 1 - degree], knots[interval + k + 1]
            share = spline / np.maximum(high - low, np.finfo(float).tiny)  # 0 between coincident knots
            raised[k] = raised[k] + share * (high - place)
            raised.append(share * (place - low))
        values = raised
    splines = np.zeros((size, len(place)))
    splines[interval + np.array([[-2], [-1], [0]]), np.arange(len(place))] = values
    return splines


def motion(fit: ModelFit) -> FloatArray:
    """ln amplitudes at which the fit takes its predictions, so that columns are free of the noise of the residuals."""
    return fit.model.problem.rows.u if fit.model.at is None else fit.model.at


def _add_imaginary(shape: ComplexArray | FloatArray) -> ComplexArray:
    """Real and imaginary multiples of shapes (k, n): (2 k, n)."""
    return np.concatenate([shape, 1j * shape])


def list_columns(fit: ModelFit) -> dict[str, FloatArray]:
    """Columns of every family at a fit, (coefficients, m): derivatives of the residuals by its coefficients."""
    rows, residuals = fit.model.problem.rows, fit.model.residuals(fit.y[np.newaxis])
    columns, by_frequency = residuals.sensitivity.columns, residuals.prediction.by_frequency
    of_amplitude = basis(motion(fit), SPLINES)
    stiffness, damping = columns(of_amplitude * by_frequency), columns(1j * of_amplitude * by_frequency)
    compliance = basis(rows.omega, 7) * np.exp(np.log(rows.F) - residuals.prediction.P)
    gain = basis(motion(fit), 4)
    within = np.zeros(len(rows))
    for run in rows.runs:
        within[run] = (rows.time[run] - rows.time[run].mean()) / max(float(np.ptp(rows.time[run])), 1e-9)
    time = np.stack([rows.time, within])  # over the record and within sweeps
    return {
        "stiffness with amplitude": stiffness,
        "damping with amplitude": damping,
        FREE: np.concatenate([stiffness, damping]),
        "second path": columns(_add_imaginary(compliance)),
        "gain with amplitude": columns(gain.astype(complex)),
        "instrument with amplitude": columns(_add_imaginary(gain)),
        "instrument with frequency": columns(_add_imaginary(basis(rows.omega, 6))),
        "drift": columns(np.concatenate([time * by_frequency, time.astype(complex)])),
    }


def information(fit: ModelFit, D: FloatArray) -> tuple[FloatArray, FloatArray]:
    """M and g of columns D (coefficients, m): their information and gradient beside the fitted variables."""
    W = fit.weights
    weighted = fit.J * W[:, np.newaxis]
    along = D @ weighted
    M = (D * W) @ D.T - along @ fit.covariance @ along.T
    g = (D * W) @ fit.r - along @ fit.covariance @ (weighted.T @ fit.r + fit.y)
    return np.asarray(M), np.asarray(g)


def _test_columns(fit: ModelFit, name: str, D: FloatArray) -> Test:
    norms = np.sqrt(np.sum(D**2 * fit.weights, axis=1))
    seen = norms > 1e-9 * norms.max()
    M, g = information(fit, D[seen] / norms[seen, np.newaxis])
    values, vectors = np.linalg.eigh(M)
    seen = values > 1e-4  # the fitted variables can do nearly all of the rest
    gain = float(np.sum((vectors[:, seen].T @ g) ** 2 / values[seen]))
    freedom = int(seen.sum())
    return Test(name, gain, freedom, float(chdtrc(freedom, gain)) if freedom else 1.0)


def _test_windows(fit: ModelFit) -> Test:
    """The most disturbed window of frequency over all sweeps; window sums are nearly normal."""
    rows = fit.model.problem.rows
    quantities = 1 + rows.has_phase
    x = np.linspace(-8.0, 8.0, 4001)
    p = np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi) * (x[1] - x[0])
    clipped = np.minimum(x * x, CLIP**2)
    mean = float(p @ clipped)  # of clipped squares under noise
    sd = float(np.sqrt(p @ clipped**2 - mean**2))
    squares = np.minimum(fit.r**2, CLIP**2)[: quantities * len(rows)]
    # noise that is larger in some rows is no local disturbance: mean and spread are at least those of all rows
    excess = (squares - max(mean, squares.mean())) / max(sd, squares.std())
    excess = excess.reshape(-1, len(rows)).sum(axis=0)
    excess = excess[np.argsort(rows.omega)]
    total = np.concatenate([[0.0], np.cumsum(excess)])
    best, tried = 0.0, 1
    for width in _WINDOWS:
        if width < len(rows):
            z = (total[width:] - total[:-width]) / np.sqrt(width * quantities)
            best, tried = max(best, float(z.max())), tried + 2 * len(z) // width
    freedom = min(_WINDOWS) * quantities
    p = chdtrc(freedom, freedom + best * np.sqrt(2.0 * freedom))  # a sum of ``freedom`` squares is skew
    return Test("local disturbance", best**2, 1, float(min(1.0, tried * p)))


def _test_neighbours(fit: ModelFit) -> Test:
    """Whether residuals of neighbours along a sweep, where both are measured, are positively correlated."""
    r = np.clip(fit.r, -CLIP, CLIP)
    product = (r[1:] * r[:-1])[fit.model.problem.rows.follows[1:]]
    z = float(product.sum() / np.sqrt(max(product.size, 1)))
    return Test("neighbours alike", max(z, 0.0) ** 2, 1, float(ndtr(-z)))


def unexplained(fit: ModelFit, tests: Sequence[Test], effects: Mapping[str, Effect]) -> bool:
    """Whether a fit leaves more than noise, or avoids it only by being a free-form curve itself.

    It leaves more where the smallest p-value of all tests together is below ``ALARM``, or outliers are too many. It is
    a free-form curve with more than ``MOST_FORCES`` missing forces: together they can imitate a law that is not in the
    library.
    """
    forces = sum(effects[name].kind == "force" for name in fit.effects)
    return smallest_p(tests) < ALARM or forces > MOST_FORCES or fit.has_outlier_pattern


@dataclass(frozen=True)
class FreeForm:
    """Natural frequency (Hz) and damping ratio over amplitude A, (n,), and their sds; NaN where undetermined."""

    A: FloatArray
    frequency: FloatArray
    frequency_sd: FloatArray
    damping: FloatArray
    damping_sd: FloatArray


def free_form(fit: ModelFit, trace: Callable[[ModelFit, FloatArray], FloatArray]) -> FreeForm:
    """The free-form curves beside a fit, over the amplitudes of the record.

    ``trace``: natural frequency and damping ratio (2, n) of a fit at amplitudes (n,).
    """
    D, u, white = _whiten_columns(list_columns(fit)[FREE], fit), motion(fit), _whiten(fit)
    M, g = information(white, D)
    values, vectors = np.linalg.eigh(M)
    seen = values > _SEEN * values.max()
    covariance = (vectors[:, seen] / values[seen]) @ vectors[:, seen].T
    weighted = white.J * fit.weights[:, np.newaxis]
    follow = fit.covariance @ (D @ weighted).T
    settled = fit.covariance @ (weighted.T @ white.r + fit.y)
    at = np.linspace(u.min(), u.max(), _DRAWN)
    A, B = np.exp(at), basis(u, SPLINES, at).T
    curves, parts = trace(fit, A), []
    moved = [trace(replace(fit, y=fit.y + step), A) - curves for step in _STEP * np.eye(len(fit.y))]
    slopes = np.moveaxis(np.array(moved), 0, -1) / _STEP
    of_splines = np.hstack([curves[0, :, np.newaxis] * B, 0.0 * B]), np.hstack([0.0 * B, B])
    for curve, slope, added in zip(curves, slopes, of_splines, strict=True):
        by = added - slope @ follow
        sd = np.sqrt(np.sum((by @ covariance) * by, axis=1) + np.sum((slope @ fit.covariance) * slope, axis=1))
        unseen = np.sum((by @ vectors[:, ~seen]) ** 2, axis=1) > _MOST_UNSEEN * np.sum(by**2, axis=1)
        estimate = curve - slope @ settled - by @ covariance @ g
        parts += [np.where(unseen, np.nan, value) for value in (estimate, sd)]
    return FreeForm(A, *parts)
