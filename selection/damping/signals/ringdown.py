"""Free decays to damping: amplitude, frequency and decay rate at levels, and the force of equal energy balance.

The band-passed response and its analytic signal are one convolution, with a window w of some periods:

    z(t) = int w(tau) exp(-i omega_0 tau) x(t + tau) d tau,    int w = 2,    int tau^2 w = 0.

It is evaluated only where the window lies inside the record, so that there are no edge effects. Its zero second moment
preserves an amplitude that changes as a cubic. A decay x = A exp(-delta t) cos(omega t) gives A exp((-delta + i omega)
t) times a known constant, which is divided out. A velocity or acceleration has z = A s^n exp(i phase) with s = -delta +
i omega, so that d ln z/dt = s + n s'/s: the term n omega'/omega of the changing frequency is subtracted.

Slowly decaying free motion loses action as d/dt (M omega A^2/2) = -A C/2 (the part of the equation of motion in
quadrature), so with delta = -A'/A

    C(A, omega) = 2 M delta A (omega + d omega/d ln A/2),    d omega/d ln A = -omega'/delta,

which is the force amplitude that holds the amplitude A at phase resonance (C = F, section 4.3 of the report). The
frequency of that phase resonance is sqrt(omega^2 + delta^2), exactly with viscous damping. A slipping joint stores less
than a spring and has about 3 times the term of d omega/d ln A: twice the term is an uncertainty of the force.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, BoolArray, ComplexArray, FloatArray
from damping.errors import AnalysisError, InputError
from damping.records.check_ceiling import find_limit
from damping.signals.releases import (
    LARGEST_GROWTH,
    describe_beat,
    describe_lost,
    describe_releases,
    find_release,
    find_return,
    refuse_gaps,
    report_growth,
)
from damping.signals.windows import (
    PERIODS,
    Window,
    average_groups,
    describe_elsewhere,
    describe_flat,
    make_flat_window,
    measure_noise,
    space_evenly,
)

LEVELS = 16  #: most levels of amplitude that a decay is split into
ABOVE_NOISE = 10.0  #: least amplitude of a level, over the noise
LEAST_FALL = 0.05  #: least fall of ln A over a level: a smaller one hardly determines the slope
MOST_FALL = 0.4  #: largest fall of ln A over a level: a larger one smears the slope
WORST_SLOPE = 0.3  #: largest standard error of the slope of a level, over the slope
LARGEST_BEND = 0.15  #: largest bend of ln A over half a window: more would be smeared by the window
OF_CUBIC = 0.15  #: error of the slope of a parabola if ln A has c u^3 over a level, |u| < 1/2, in c (<u^4>/<u^2>)
SURE = 3.0  #: least cubic coefficient c, in standard errors, for which that error is added to the uncertainty
GROWN = 0.1  #: a decay grows again, and another release counts, from this share of the largest amplitude
_MEDIAN = 1.1774  # median of the modulus of complex noise, over the standard deviation of each part


@dataclass(frozen=True)
class Decay:
    """Levels of a free decay, arrays (levels,), largest amplitude first."""

    time: FloatArray  #: at the middle of each level, s
    amplitude: FloatArray  #: of displacement
    frequency: FloatArray  #: of phase resonance, Hz
    decay_rate: FloatArray  #: delta, 1/s
    force: FloatArray  #: of the energy balance
    amplitude_sd: FloatArray  #: from noise
    force_sd: FloatArray  #: from noise, and from the limits of the energy balance and of a parabola
    noise: float  #: amplitude in the unit of the signal
    notes: tuple[str, ...]  #: what was left out

    @property
    def damping_ratio(self) -> FloatArray:
        """Fraction of critical damping at each level, delta/omega."""
        return self.decay_rate / (RAD_S_PER_HZ * self.frequency)

    def table(self, label: str) -> pd.DataFrame:
        """Rows of a record: each level is one sweep, at phase resonance; ``label`` is that of the decay."""
        names = ("force", "frequency", "amplitude", "amplitude_sd", "force_sd", "time", "damping_ratio")
        labels = [f"{label} {k + 1:02d}" for k in range(len(self.time))]
        return pd.DataFrame({"sweep": labels, **{name: getattr(self, name) for name in names}, "decay": label})


def ring_down(
    t: FloatArray,
    x: FloatArray,
    *,
    order: int,
    mass: float,
    frequency: float,
    periods: float = PERIODS,
    levels: int = LEVELS,
    start: float | None = None,
    end: float | None = None,
) -> Decay:
    """Amplitude-dependent frequency and damping of one mode from its free decay.

    Args:
        t: time (n,) in s, evenly spaced.
        x: motion (n,).
        order: of the time derivative of displacement that x is.
        mass: generalized mass M.
        frequency: of the mode, Hz; that of the decay may differ by some per cent.
        periods: length of the window: a longer one rejects neighbouring modes better, and loses more of the start.
        levels: most levels of amplitude.
        start: of the part to use, s; by default the largest amplitude.
        end: of that part, s.

    InputError: times that are not evenly spaced, too few samples per period, or a part that is not in the record.
    AnalysisError: no long enough decay above the noise, one that grows again or beats, or clipped readings.
    """
    if not (periods >= 4.0 and levels >= 1):
        raise InputError("the window or the levels are too few", expected="at least 4 periods and 1 level")
    t, x = _select(np.asarray(t, dtype=np.float64), np.asarray(x, dtype=np.float64), start, end)
    _refuse_clipping(x)
    t, x, dt, jitter = space_evenly(t, x, frequency)
    t, x = average_groups(t, x, dt, frequency)
    dt = float((t[-1] - t[0]) / (len(t) - 1))  # of all samples: times printed to few decimals differ in their steps
    window = make_flat_window(frequency, periods, dt)
    if len(x) < 2 * len(window.offsets):
        has = len(x) * dt * frequency
        raise AnalysisError(f"the record has {has:.3g} periods, of which {2 * periods:g} are needed")
    x = x - np.mean(x)
    z = window.analytic(x)
    times = t[0] + (np.arange(len(z)) + len(window.offsets) // 2) * dt
    noise = measure_noise(window, x, z)
    first = 0 if start is not None else find_release(x, z, window, frequency * dt)
    last = first + int(next(iter(np.flatnonzero(np.abs(z[first:]) <= ABOVE_NOISE * noise)), len(z) - first))
    before = max(first - len(window.offsets), 0)  # the release itself: a higher one may stand elsewhere
    size, peak = float(np.abs(z[first])), before + int(np.argmax(np.abs(x[before : first + len(window.offsets)])))
    least = max(ABOVE_NOISE * noise, GROWN * size)
    others = "" if start is not None else describe_releases(times, x, z, window, frequency * dt, least)
    try:
        _refuse_growth(times[first:last], np.abs(z[first:last]))
        kept, notes = _fit_levels(times[first:last], z[first:last], levels, window, noise, order)
    except AnalysisError as error:
        blows = f"; of several blows {others} takes each" if others else ""
        raise AnalysisError(f"{error}{blows}{describe_elsewhere(x, dt, frequency)}") from None
    lost = describe_lost(float(t[peak]), float(times[first]), float(np.abs(x[peak])), size)
    if others:
        lost.append(f"of several releases only that at {times[first]:.4g} s is used; {others} takes each")
    returned = find_return(np.abs(z[first:]), ABOVE_NOISE * noise, len(window.offsets))
    if (again := returned / window.omega_0**order) > 0.0:
        stays = f"motion of amplitude {again:.3g} does not decay, such as hum, drift or a mode beside"
        doubt = f"levels below {again / GROWN:.3g} are doubtful; choose a part without, or another sensor"
        lost.append(f"caution: {stays}: {doubt}")
    shift = float(kept["omega"].iloc[0] / kept["omega"].iloc[-1]) - 1.0
    lost += describe_flat(window, x[first : last + len(window.offsets) - 1], z[first:last], order, shift)
    surely = kept[kept["A"] >= again / GROWN]
    lost += refuse_gaps(kept, surely) + describe_beat(surely)
    return _balance_energy(kept, mass, noise, [*jitter, *lost, *notes])


def _refuse_clipping(x: FloatArray) -> None:
    """AnalysisError for readings that repeatedly stay at a limit."""
    if (limit := find_limit(x)) is not None:
        why = f"the readings repeatedly stay at {limit:.4g}: they are clipped, so their amplitude and decay are lost"
        raise AnalysisError(f"{why}; choose a part without (--start), or another range")


def _refuse_growth(t: FloatArray, size: FloatArray) -> None:
    """Raise AnalysisError if the amplitude (n,) grows again: free motion of one mode only loses energy."""
    least = np.minimum.accumulate(size)
    grown = np.flatnonzero((size > LARGEST_GROWTH * least) & (size >= GROWN * size[:1]))
    if len(grown):
        raise report_growth(float(t[int(np.argmin(size[: grown[0]]))]))


def _select(t: FloatArray, x: FloatArray, start: float | None, end: float | None) -> tuple[FloatArray, FloatArray]:
    """The samples from ``start`` to ``end``. InputError: fewer than two."""
    keep: BoolArray = (t >= (-np.inf if start is None else start)) & (t <= (np.inf if end is None else end))
    if np.count_nonzero(keep) < 2:
        has = f"{t[0]:g} to {t[-1]:g} s" if len(t) else "a time history"
        raise InputError("there are no two samples between start and end", expected=has)
    return (t, x) if keep.all() else (t[keep], x[keep])


def _find_edges(amplitude: FloatArray, levels: int, least: int) -> list[int]:
    """Samples that bound levels of equal amplitude ratio, each at least ``least`` samples long."""
    edges = [0]
    if len(amplitude) == 0 or not amplitude.all():
        return edges
    depth = np.log(amplitude[0] / np.minimum.accumulate(amplitude))
    fall = min(max(float(depth[-1]) / levels, LEAST_FALL), MOST_FALL)
    while len(edges) <= levels:
        end = max(int(np.searchsorted(depth, depth[edges[-1]] + fall)), edges[-1] + max(least, 8))
        if end >= len(amplitude):
            break
        edges.append(end)
    return edges


def _fit_levels(
    t: FloatArray, z: ComplexArray, levels: int, window: Window, noise: float, order: int
) -> tuple[pd.DataFrame, list[str]]:
    """The usable levels, one row each with the columns ``_LEVEL``, and notes on the others.

    While noise hides the slope of most levels, half as many are tried, each twice as long.
    """
    while True:
        edges = _find_edges(np.abs(z), levels, len(window.offsets) // 2)
        fitted = [_fit_level(t[a:b], z[a:b], window, noise, order) for a, b in pairwise(edges)]
        cut = pd.DataFrame(fitted, columns=_LEVEL)
        kept, notes = _keep_known(cut)
        if 2 * len(kept) >= len(cut) or levels == 1:
            break
        levels //= 2
    if kept.empty:
        advice = "choose a part without what comes before the release (--start), or a sensor that shows one mode alone"
        if cut.empty:  # the decay is shorter than its first level
            notes = [f"above the noise it lasts {float(np.ptp(t)) if len(t) else 0.0:.3g} s, too short for a level"]
        raise AnalysisError("; ".join(["no level of the decay can be used", *notes, advice]))
    grown = np.flatnonzero(np.diff(kept["A"]) > 0.0)  # levels fall by more than the noise
    if len(grown):
        raise report_growth(float(kept["t"].iloc[grown[0]]))
    if len(edges) > levels:
        notes.append(f"the decay after {t[edges[-1]]:.4g} s is not used: it is cut into {levels} levels")
    return kept, notes


#: Middle of a level, amplitude, frequency, decay rate, d omega/dt, standard errors of ln A and delta, bend of ln |z|.
_LEVEL = ("t", "A", "omega", "delta", "turn", "sd_logarithm", "sd_delta", "bend")


def _fit_level(t: FloatArray, z: ComplexArray, window: Window, noise: float, order: int) -> tuple[float, ...]:
    """``_LEVEL`` by parabolas through ln |z| and the phase; errors from noise, or from larger residuals."""
    middle, length = 0.5 * (t[0] + t[-1]), t[-1] - t[0]
    u = (t - middle) / length
    logarithm = np.log(np.abs(z)) + 1j * np.unwrap(np.angle(z))
    fit = np.polynomial.polynomial.polyfit(u, logarithm, 2)
    residual = np.std((logarithm - np.polynomial.polynomial.polyval(u, fit)).real)
    rate, turn = complex(fit[1]) / length, 2.0 * float(fit[2].imag) / length**2
    s = rate - order * turn / rate.imag
    size = float(np.exp(fit[0].real))
    A = size / abs(window.gain(rate)) / abs(s) ** order
    averaged = 1.0 / np.sqrt(max(length / window.correlation, 1.0))
    sd = max(noise / _MEDIAN / size, float(residual)) * averaged
    sd_logarithm = float(1.5 * sd)  # the middle of a parabola has sqrt(9/4) times the error of a mean
    bend = float(abs(fit[2].real) * (0.5 * window.length / length) ** 2)
    # errors of the slope and of the bend of the phase, of which delta has n omega'/omega, the force half more
    sd_delta = float(sd * np.sqrt(12.0) / length * np.hypot(1.0, (order + 0.5) * np.sqrt(60.0) / (abs(s) * length)))
    # a cubic coefficient has sqrt(2800) times the error of a mean
    cubic, of_noise = abs(float(np.polynomial.polynomial.polyfit(u, logarithm.real, 3)[3])), averaged * noise / size
    if cubic > SURE * np.sqrt(2800.0) * of_noise / _MEDIAN:
        sd_delta = float(np.hypot(sd_delta, OF_CUBIC * cubic / length))
    return float(middle), A, s.imag, -s.real, turn, sd_logarithm, sd_delta, bend


def _keep_known(levels: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """Levels whose slope is known, up to the first whose decay the window would smear; and notes."""
    notes = []
    known = levels[(levels["delta"] > 0.0) & (levels["sd_delta"] <= WORST_SLOPE * levels["delta"])]
    if hidden := len(levels) - len(known):
        notes.append(f"{hidden} of {len(levels)} levels left out: their decay cannot be separated from the noise")
    bent = np.flatnonzero(known["bend"] > LARGEST_BEND)
    if not len(bent):
        return known, notes
    first = float(known["A"].iloc[bent[0]])
    notes.append(f"at amplitude {first:.4g} and below the decay changes too much within the window")
    return known.iloc[: bent[0]], notes


def _balance_energy(kept: pd.DataFrame, mass: float, noise: float, notes: list[str]) -> Decay:
    """The decay of the ``kept`` levels, with the force of the energy balance."""
    time, A, omega, delta, turn, sd, sd_delta, _ = (kept[name].to_numpy(dtype=np.float64) for name in _LEVEL)
    resonant = np.sqrt(omega**2 + delta**2)
    force = 2.0 * mass * A * (delta * resonant - 0.5 * turn)
    return Decay(
        time=time,
        amplitude=A,
        frequency=resonant / RAD_S_PER_HZ,
        decay_rate=delta,
        force=force,
        amplitude_sd=sd * A,
        force_sd=np.hypot(force * np.hypot(sd, sd_delta / delta), 2.0 * mass * A * np.abs(turn)),
        noise=noise,
        notes=tuple(notes),
    )
