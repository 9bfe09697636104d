"""What a campaign says of its levels against closed forms and motions integrated here: decays, a level read wrongly."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from damping.campaign import analyse
from damping.campaign.decays import decay_modes
from damping.campaign.modal_fit import find_peaks_of, fit_level
from damping.campaign.records import describe_lost, fit_levels, fit_right_levels, join_modes
from damping.campaign.runs import ChannelCorrection, Corrections
from damping.campaign.sources import read_runs
from damping.campaign.values import At, Bounds, Response
from damping.errors import AnalysisError, InputError
from damping.extrapolation import predict_record
from damping.extrapolation.curve import predict_forces, trace_loads
from damping.extrapolation.prepared import prepare_record
from damping.formats.series import Summary
from damping.records import audit
from tests.campaign.linear import accelerate
from tests.campaign.spectra import write_force_runs, write_shaken, write_spectra

G = 9.80665
M, HERTZ, ZETA, K3 = 40.0, 25.0, 0.008, 2e10


def write_columns(path, head, *columns):
    """A table with columns (n,), or several (m, n), under the names of ``head``."""
    np.savetxt(path, np.vstack(columns).T, delimiter=",", header=head, comments="", fmt="%.9g")
    return path


@cache
def sweep_mode():
    """Time, force and acceleration (n,) of a viscous mode swept from rest under 1 N; four steps for each row."""
    t = np.arange(0.0, 60.0, 1 / 1024)
    F = np.sin(2 * np.pi * (23.0 * t + 0.5 * (4.0 / 60.0) * t**2))
    return t[::4], F[::4], accelerate(F, 1 / 1024, 2 * np.pi * HERTZ, ZETA, M)[::4]


@cache
def decay_on_hardening(start):
    """Time (n,), displacement and acceleration of a viscous decay on a spring that hardens with A^2, integrated."""
    w, t = 2 * np.pi * HERTZ, np.arange(0.0, 3.0, 1 / 1024)

    def accelerate(x, v):
        return -(w**2) * x - 2 * ZETA * w * v - K3 * x**3 / M

    y = solve_ivp(lambda _, y: [y[1], accelerate(*y)], (0, 3), [start, 0], "DOP853", t, rtol=1e-9, atol=1e-12).y
    return t, y[0], accelerate(*y)


def hardening(path, start, kind):
    """That decay with noise, read as displacement or acceleration."""
    t, x, a = decay_on_hardening(start)
    x = 1e3 * x if kind == "mm" else a
    x = x + 3e-4 * np.max(np.abs(x)) * np.random.default_rng(2).normal(size=len(t))
    return write_columns(path, f"time [s],tip [{kind}]", t, x)


def backbone(A):
    """Frequency of the fundamental, Hz: omega^2 = omega_n^2 + (3/4) k3 A^2/m."""
    return np.sqrt((2 * np.pi * HERTZ) ** 2 + 0.75 * K3 * A**2 / M) / (2 * np.pi)


@pytest.mark.parametrize("kind", ["mm", "m/s^2"])
def test_decays_that_change_in_frequency(tmp_path, kind, few_laws):
    """F = c omega A, so that zeta = F/(2 M omega^2 A) falls as 1/omega, at tested and at design levels."""
    starts = (1e-3, 2e-3, 3e-3)
    files = [hardening(tmp_path / f"d{k}.csv", start, kind) for k, start in enumerate(starts)]
    mode = analyse(files).modes[0]
    amplitudes = np.geomspace(1e-4, 1e-2, 2000)
    size = amplitudes * (1e3 if kind == "mm" else (2 * np.pi * backbone(amplitudes)) ** 2)
    for at in mode.places:
        f = backbone(np.interp(at.level, size, amplitudes))
        # third harmonic and what the window smears 1 % of the change at tested levels, noise of it carried on beyond
        assert abs(at.frequency / f - 1) < (0.002 if at.tested else 0.02)
        assert at.ratio[0] == pytest.approx(ZETA * HERTZ / f, rel=0.005 if at.tested else 0.03)
    if kind == "mm":  # a level is the amplitude: as a curve through the record says
        prepared = prepare_record(mode.record, mode.mode, audit(mode.record, mode.mode))
        predicted = predict_record(prepared, np.empty(0), (2.0,), 0.9, 1970)
        asked = [2.0 * mode.record.table["amplitude"].max()]
        told = trace_loads(predict_forces(predicted, asked, each=False), prepared.backbone, prepared.data)
        beyond = mode.places[-1]
        assert beyond.frequency == pytest.approx(told.frequency.median[0], rel=1e-6)
        assert beyond.ratio[0] == pytest.approx(told.damping_ratio.median[0], rel=2e-3)


def test_decays_in_two_units_and_below_the_test(tmp_path, few_laws):
    """Of m c |v| v the ratio grows by 4 c A/(3 pi), at a fifth of the smallest amplitude too; levels have one unit."""
    w, t, zeta, c = 2 * np.pi * HERTZ, np.arange(0.0, 3.0, 1 / 1024), 0.004, 40.0

    def accelerate(x, v):
        return -(w**2) * x - 2 * zeta * w * v - c * np.abs(v) * v

    files, rng = [tmp_path / f"d{k}.csv" for k in range(3)], np.random.default_rng(2)
    for path, start in zip(files, (1e-3, 2e-3, 3e-3), strict=True):
        y = solve_ivp(lambda _, y: [y[1], accelerate(*y)], (0, 3), [start, 0], "DOP853", t, rtol=1e-9, atol=1e-12).y
        a = accelerate(*y)
        mid, tip = (part * a + 3e-4 * np.max(np.abs(a)) * rng.normal(size=len(t)) for part in (0.6, 1.0))
        write_columns(path, "time [s],mid [g],tip [m/s^2]", t, mid / G, tip)
    (decay,) = decay_modes(read_runs(files, 100_000_000)[0])
    lowest = decay.record.table["amplitude"].min()
    answer = analyse(files, [0.2 * lowest * w**2 / G])
    assert answer.unit == "g"
    for at in answer.modes[0].places:
        # amplitudes are known to the noise, and frequencies are within 1e-3 of 25 Hz but for the third harmonic
        A = at.level * G / (2 * np.pi * at.frequency) ** 2
        assert at.ratio[0] == pytest.approx(zeta + 4.0 / (3.0 * np.pi) * c * A, rel=0.01)
        peaks = {peak.sensor: (peak.band[0], peak.unit) for peak in at.response}
        assert peaks["tip"] == (pytest.approx(at.level * G, rel=1e-9), "m/s^2")
        assert peaks["mid"] == (pytest.approx(0.6 * at.level, rel=1e-3), "g")
    assert not answer.modes[0].places[-1].tested
    with pytest.raises(InputError, match=r"level 1e-06 g is too far from the tested .*; expected from "):
        analyse(files, [1e-6])


@pytest.mark.slow
def test_a_level_that_is_read_wrongly_is_named(tmp_path, few_draws):
    """One mode of 1 %: the peak is |1 + H| in closed form, of which one run reads 1.1 times."""
    f = np.geomspace(35.0, 46.0, 300)
    w, w_n, rng = 2 * np.pi * f, 2 * np.pi * 40.0, np.random.default_rng(4)
    steady = 1 + 1.2 * w**2 / (w_n**2 - w**2 + 0.02j * w_n * w)
    for name, wrong in (("right", 1.0), ("wrong", 1.1)):
        gains = {0.1: 1.0, 0.2: 1.0, 0.4: wrong, 0.8: 1.0}
        noise = 1 + 0.005 * rng.normal(size=(len(gains), 1, len(f)))
        read = {level: level * steady * gain * of for (level, gain), of in zip(gains.items(), noise, strict=True)}
        answer = analyse([write_shaken(tmp_path / f"{name}.h5", f, read)], [1.6])
        for at in answer.modes[0].places:
            if at.tested:
                factor = wrong if at.level == 0.4 else 1.0
                assert at.response[0].band[0] == pytest.approx(factor * at.level * np.max(np.abs(steady)), rel=0.01)
            said = any("0.4 g deviates most" in caution for caution in at.cautions)
            assert said == (name == "wrong")
        assert any("0.4 g deviates most" in note for note in answer.to_json()["notes"]) == (name == "wrong")


def test_a_level_that_is_run_twice_is_two_sweeps(tmp_path, few_laws):
    """One viscous mode on a shaker, all in closed form: a repeat of a level changes no answer beyond its noise."""
    f = np.geomspace(35.0, 46.0, 300)
    w, w_n, rng = 2 * np.pi * f, 2 * np.pi * 40.0, np.random.default_rng(4)
    steady = 1 + 1.2 * w**2 / (w_n**2 - w**2 + 0.02j * w_n * w)
    runs = {}
    for name, level in (("run_0.1g", 0.1), ("run_0.2g", 0.2), ("repeat_0.2g", 0.2), ("run_0.4g", 0.4)):
        read = level * steady * (1 + 0.005 * rng.normal(size=len(f)))
        runs[name] = {"control": level, "acceleration": (read, "g")}
    (mode,) = analyse([write_spectra(tmp_path / "a.h5", f, runs)], [0.8]).modes
    assert mode.record.sweeps == ("0.1 g", "0.2 g", "0.2 g (2)", "0.4 g")
    assert "mixed-levels" not in [finding.check for finding in mode.findings]
    for at in mode.places:  # 21 rows of 0.5 % a level: the ratio within 1 %, and its band holds it
        assert at.ratio[0] == pytest.approx(0.01, rel=0.01)
        assert at.ratio[1] < 0.01 < at.ratio[2]
        assert at.response[0].band[0] == pytest.approx(at.level * np.max(np.abs(steady)), rel=0.01)


def test_decays_in_files_of_one_name_are_two(tmp_path, few_laws):
    """Of two folders: as many levels as under two names, each a sweep of its own."""
    for k, start in enumerate((1e-3, 3e-3)):
        (tmp_path / f"day{k}").mkdir()
        hardening(tmp_path / f"day{k}" / "d.csv", start, "mm")
    (mode,) = analyse([tmp_path / "day0" / "d.csv", tmp_path / "day1" / "d.csv"]).modes
    assert len(mode.record.sweeps) == len(mode.record)


def test_a_fast_sweep_gives_the_steady_mode(tmp_path, few_laws):
    """A viscous mode swept from rest, integrated: its ringing at the start is no mode, and tested levels are steady."""
    files, (t, F, a) = [], sweep_mode()
    for k, force in enumerate((5.0, 10.0, 20.0)):
        read = force * (a + 1e-3 * np.max(np.abs(a)) * np.random.default_rng(k).normal(size=len(t)))
        files.append(write_columns(tmp_path / f"s{k}.csv", "time [s],force [N],tip [m/s2]", t, force * F, read))
    answer = analyse(files, [40.0])
    (mode,) = answer.modes
    for at in mode.places:
        assert at.frequency == pytest.approx(HERTZ, rel=2e-4)
        assert at.ratio[0] == pytest.approx(ZETA, rel=0.02)  # what correcting 4 % by the rate leaves
        assert at.response[0].band[0] == pytest.approx(at.level / M / (2 * ZETA), rel=0.02)


def accelerations(w: float, c: float, d: float, h: float, drive: np.ndarray) -> np.ndarray:
    """x'' of x'' + c x' + d |x'| x' + w^2 x = ``drive`` (2 n + 2,), given at half steps ``h``, from rest, (n,).

    In numbers of Python: arrays of three levels take ten times as long.
    """
    x = v = 0.0
    at, found, spring = drive.tolist(), [], w**2
    for k in range(0, len(at) - 2, 2):
        a1 = at[k] - c * v - d * abs(v) * v - spring * x
        v2 = v + h / 2 * a1
        a2 = at[k + 1] - c * v2 - d * abs(v2) * v2 - spring * (x + h / 2 * v)
        v3 = v + h / 2 * a2
        a3 = at[k + 1] - c * v3 - d * abs(v3) * v3 - spring * (x + h / 2 * v2)
        v4 = v + h * a3
        a4 = at[k + 2] - c * v4 - d * abs(v4) * v4 - spring * (x + h * v3)
        x, v = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        found.append(a1)
    return np.array(found)


def test_a_fast_sweep_with_growing_damping_is_answered_at_its_level(tmp_path, few_laws):
    """Viscous and velocity-squared damping integrated (Runge-Kutta).

    At resonance F = c w A + (8/3 pi) d (w A)^2. Rows are steady under some three quarters of the force that swept them.
    """
    forces, w, h = np.array([5.0, 10.0, 20.0]), 2 * np.pi * HERTZ, 1 / 1024
    c, d, n = 2 * 0.006 * w * M, 200.0, int(60.0 / h)
    drive = np.sin(2 * np.pi * (lambda t: 23.0 * t + 0.5 * (4.0 / 60.0) * t**2)(np.arange(2 * n + 2) * h / 2))
    a = np.stack([accelerations(w, c / M, d / M, h, force / M * drive) for force in forces], axis=1)
    files, times = [], np.arange(n // 4) * 4 * h
    for k, force in enumerate(forces):
        noisy = a[::4, k] + 1e-3 * np.ptp(a[:, k]) * np.random.default_rng(k).normal(size=n // 4)
        columns = (times, force * drive[: 2 * n : 8], noisy)
        files.append(write_columns(tmp_path / f"s{k}.csv", "time [s],force [N],tip [m/s2]", *columns))
    (mode,) = analyse(files, [40.0]).modes
    quadratic = 8 / (3 * np.pi) * d
    assert mode.frequency == mode.places[0].frequency == pytest.approx(HERTZ, rel=2e-4)
    for at in mode.places[:3]:
        speed = (np.sqrt(c**2 + 4 * quadratic * at.level) - c) / (2 * quadratic)
        # what correcting some 15 % by the rate leaves; the damping of the smaller force is 1.2 % off
        assert at.response[0].band[0] == pytest.approx(w * speed, rel=0.01)


def close_modes(sign):
    """Three sensors of two modes 4 % apart on a shaker, (sensors, n) per base: one peak, ``sign`` of the second."""
    f = np.geomspace(25.0, 60.0, 600)
    w, total = 2 * np.pi * f, np.ones((3, 600), complex)
    for hertz, ratio, shape in ((40.0, 0.0125, (0.9, 0.63, -0.45)), (41.6, 0.0125, (0.24, -0.48, 0.54))):
        w_n = 2 * np.pi * hertz
        total += np.array(shape)[:, np.newaxis] * w**2 / (w_n**2 - w**2 + 2j * ratio * w_n * w)
    return f, total * np.array([1.0, sign, 1.0])[:, np.newaxis]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_only_a_reversed_sensor_is_called_so(tmp_path, sign):
    """Its real part below resonance has the sign of the base where it is mounted rightly."""
    f, motion = close_modes(sign)
    assert np.all(np.sign(motion[1, f < 35.0].real) == sign)
    noise = {level: np.random.default_rng(k).normal(size=motion.shape) for k, level in enumerate((0.1, 0.2, 0.4))}
    read = {level: level * motion * (1 + 0.005 * own) for level, own in noise.items()}
    (mode,) = join_modes(fit_levels(read_runs([write_shaken(tmp_path / "close.h5", f, read)], 10_000_000)[0]))
    assert ("reversed" in mode.left_out.get("accelerations[1]", "")) == (sign < 0)


def test_modes_that_draw_together_stay_in_their_bands():
    """Starts 16 % apart of modes 14.5 % apart, in closed form: found where they are."""
    f, true = np.geomspace(30.0, 60.0, 800), (40.0, 45.8)
    w, H = 2 * np.pi * f, np.ones((2, 800), complex)
    for hertz, shape in zip(true, ((1.0, 0.5), (0.6, -0.9)), strict=True):
        w_n = 2 * np.pi * hertz
        H += np.array(shape)[:, np.newaxis] * w**2 / (w_n**2 - w**2 + 0.02j * w_n * w)
    H *= 1 + 0.002 * np.random.default_rng(1).normal(size=H.shape)
    fit = fit_level(f, H, (39.9, 46.3), 1.0)
    np.testing.assert_allclose(fit.frequency, true, rtol=1e-4)  # 0.2 % over some 20 rows within 1 % of width
    np.testing.assert_allclose(fit.ratio, 0.01, rtol=0.01)


@pytest.mark.parametrize("upper", [19.0, 30.0])
def test_decays_tell_neighbours_apart(tmp_path, upper):
    """Modes at 12 Hz and above it in closed form, 200 samples a second: shapes, or why there is but one.

    q = 1/((1/q0 + b) exp(z w t) - b) is the amplitude of the ratio z (1 + b q).
    """
    t, shapes, files = np.arange(0.0, 80.0, 1 / 200), np.array([[1.0, 0.6], [0.5, -0.9], [-0.8, 0.4]]), []
    for k, start in enumerate((0.002, 0.004, 0.008)):
        q = []
        for hertz, ratio, growth, first in ((12.0, 0.006, 60.0, start), (upper, 0.008, 150.0, start / 3)):
            w = 2 * np.pi * hertz
            size = 1 / ((1 / first + growth) * np.exp(ratio * w * t) - growth)
            q.append(-(w**2) * size * np.cos(w * t))
        a = shapes @ np.array(q) + 0.01 * np.random.default_rng(k).normal(size=(3, len(t)))
        files.append(write_columns(tmp_path / f"d{k}.csv", "time [s],a1 [m/s2],a2 [m/s2],a3 [m/s2]", t, a))
    summary = Summary()
    modes = decay_modes(read_runs(files, 100_000_000)[0], (), summary)
    assert [round(mode.mode.frequency, 1) for mode in modes] == ([12.0, 19.0] if upper < 25.0 else [12.0])
    assert [f"peak at {upper:g} Hz" in note for note in summary.notes] == ([] if upper < 25.0 else [True])
    for mode, shape in zip(modes, shapes.T, strict=False):
        assert not mode.left_out
        # noise of 0.01 over a window of some 60 samples: 2e-3 m/s^2 beside the 20 that a decay begins with
        np.testing.assert_allclose(mode.shape, shape / shape[np.argmax(np.abs(shape))], atol=1e-3)
        assert np.all(mode.shape_sd < 5e-3)


@pytest.mark.parametrize(("upper", "size"), [(21.6, 0.45), (20.5, 1.0)])
def test_decays_of_close_modes_are_told_apart(tmp_path, upper, size):
    """Two linear modes in one peak of the averaged spectrum of 12 s, in closed form; noise is 0.05 % of the first.

    They were taken as one. If only one is named, a caution says so where the other, smaller one does not make it beat.
    """
    t, true = np.arange(0.0, 12.0, 1 / 250), ((20.0, 1.0, (1.0, 0.86, -0.55)), (upper, size, (-0.78, 1.0, -0.6)))
    motion = 0.0005 * np.random.default_rng(4).normal(size=(3, len(t)))
    for hertz, start, shape in true:
        motion += start * np.outer(shape, np.exp((1j - 0.006) * 2 * np.pi * hertz * t).real)
    runs = read_runs([write_columns(tmp_path / "d.csv", "time [s],a1 [g],a2 [g],a3 [g]", t, motion)], 10_000_000)[0]
    for mode, (hertz, _, shape) in zip(decay_modes(runs), true, strict=True):
        assert not mode.left_out
        assert mode.mode.frequency == pytest.approx(hertz, rel=1e-3)
        np.testing.assert_allclose(mode.shape, shape, atol=0.02)  # of the neighbour, in windows of 1.5 s
        rows = mode.record.frame.head()
        ratio = rows["force"] / (2.0 * (2 * np.pi * rows["frequency"]) ** 2 * rows["amplitude"])
        np.testing.assert_allclose(ratio, 0.006, rtol=0.03)
    if size < 1.0:
        (alone,) = decay_modes(runs, (20.0,))
        assert any("that of several modes: name them (--modes F1,F2,... in Hz)" in text for text in alone.cautions)
    else:
        with pytest.raises(AnalysisError, match=r"two modes that beat, .* damping campaign --modes F1,F2"):
            decay_modes(runs, (20.0,))


def test_dwells_that_begin_on_a_flank_show_every_mode():
    """Two modes under a force in closed form, at 34 dwells about them: the first rows are the motion of a mode."""
    f = np.concatenate([np.linspace(11.6, 12.4, 17), np.linspace(18.5, 19.5, 17)])
    w, H = 2 * np.pi * f, np.zeros((3, 34), complex)
    for hertz, ratio, shape in ((12.0, 0.0085, (0.125, 0.0625, -0.1)), (18.96, 0.0116, (0.072, -0.108, 0.048))):
        w_n = 2 * np.pi * hertz
        H -= np.array(shape)[:, np.newaxis] * w**2 / (w_n**2 - w**2 + 2j * ratio * w_n * w)
    peaks = find_peaks_of(f, H, -1.0)
    np.testing.assert_allclose(peaks, [12.0, 18.96], atol=0.0625)  # the space between dwells


@pytest.mark.parametrize(("shape", "found"), [((0.3, 0.6, -0.3), [24.84, 31.23]), ((-0.9, 0.27, -0.54), [31.23])])
def test_a_peak_low_on_the_flank_of_a_larger_one_is_a_mode_if_its_shape_is_another(shape, found):
    """Twice as high as the saddle in power, it was passed over without a word; of the same shape it may be ringing."""
    f = np.geomspace(17.0, 40.0, 500)
    w, H = 2 * np.pi * f, np.ones((3, 500), complex)
    for hertz, ratio, size in ((24.84, 0.026, shape), (31.23, 0.0127, (2.5, -0.75, 1.5))):
        w_n = 2 * np.pi * hertz
        H += np.array(size)[:, np.newaxis] * w**2 / (w_n**2 - w**2 + 2j * ratio * w_n * w)
    np.testing.assert_allclose(find_peaks_of(f, H, 1.0), found, atol=0.05)  # of two rows, which are 0.04 Hz apart


@pytest.mark.parametrize("start", [14.0, 27.3])
def test_a_shaken_base_swept_from_a_flank_shows_every_mode(start):
    """Rows from 7 % below the first mode read 7 times the base, as much as the second mode does at its peak."""
    f = np.concatenate([np.linspace(start, 31.0, 160), np.linspace(60.0, 68.0, 160)])
    w, H = 2 * np.pi * f, np.ones((3, 320), complex)
    for hertz, ratio, shape in ((29.3, 0.008, (0.47, 0.97, 1.3)), (64.5, 0.0168, (0.39, 0.12, -0.53))):
        w_n = 2 * np.pi * hertz
        H += np.array(shape)[:, np.newaxis] * w**2 / (w_n**2 - w**2 + 2j * ratio * w_n * w)
    np.testing.assert_allclose(find_peaks_of(f, H, 1.0), [29.3, 64.5], atol=0.15)


@pytest.mark.parametrize("changing", [False, True])
def test_a_mode_that_moves_most_where_levels_contradict_is_left_out(tmp_path, changing):
    """Of two sensors one shows the second mode at every level, but not alike; the other is near its node."""
    f = np.linspace(25.0, 34.0, 300)
    w, read = 2 * np.pi * f, {}
    for k, level in enumerate((0.1, 0.2, 0.4)):
        by = (1.0, 1.3, 1.69)[k] if changing else 1.0
        H, shapes = np.ones((2, 300), complex), ((28.0, (1.2, 0.3)), (31.0, (-0.14 * by, 0.05 * by**0.5)))
        for hertz, shape in shapes:
            w_n = 2 * np.pi * hertz
            H += np.array(shape)[:, np.newaxis] * w**2 / (w_n**2 - w**2 + 0.01j * w_n * w)
        read[level] = level * H * (1.0 + 0.002 * np.random.default_rng(k).normal(size=H.shape))
    levels = fit_levels(read_runs([write_shaken(tmp_path / "node.h5", f, read)], 10_000_000)[0], (28.0, 31.0))
    modes = join_modes(levels)
    assert [round(mode.mode.frequency) for mode in modes] == ([28] if changing else [28, 31])
    assert ["its levels do not agree" in text for text in describe_lost(levels, modes)] == [True] * changing


def test_a_sensor_in_another_unit_is_left_out_before_modes_are_sought(tmp_path, few_laws):
    """Of three on a shaker one is in m/s^2 and says g: it is named, and the answers are those of the other two."""
    f, motion = (rows[..., ::4] for rows in close_modes(1.0))
    factors, runs = np.array([[1.0], [1.0], [G]]), {}
    for k, level in enumerate((0.1, 0.4)):
        read = factors * level * motion * (1 + 0.005 * np.random.default_rng(k).normal(size=motion.shape))
        runs[f"run_{level}g"] = {"control": level} | {f"acc{s}": (row, "g") for s, row in enumerate(read)}
    write_spectra(tmp_path / "a.h5", f, runs)
    answer = analyse([tmp_path / "a.h5"], [0.8])
    two = analyse([tmp_path / "a.h5"], [0.8], corrections=Corrections(channels={"acc2": ChannelCorrection("out")}))
    assert len(answer.modes) == len(two.modes) > 0
    for mode, right in zip(answer.modes, two.modes, strict=True):
        assert "another unit" in mode.left_out["acc2"]
        assert mode.places[0].response == right.places[0].response
        assert all(peak.sensor != "acc2" for at in mode.places for peak in at.response)
    scaled = Corrections(channels={"acc2": ChannelCorrection(unit="m/s^2")})
    right, misread = fit_right_levels(read_runs([tmp_path / "a.h5"], 10_000_000, scaled)[0])
    assert not any("acc2" in mode.left_out for mode in join_modes(right, misread))


@pytest.mark.parametrize("stated", [False, True])
def test_a_clipped_sensor_is_left_out(tmp_path, stated, few_laws):
    """A viscous mode integrated; the tip stands at 40 % of its top peak there, the root does not."""
    files, (t, F, a) = [], sweep_mode()
    top, head = np.max(np.abs(a)), "time [s],force [N],tip [m/s2],root [m/s2]"
    for k, force in enumerate((5.0, 10.0, 20.0)):
        read = a + 1e-3 * top * np.random.default_rng(k).normal(size=len(t))
        tip = np.clip(read, -0.4 * top, 0.4 * top) if k == 2 else read
        columns = (t, force * F, force * tip, 0.3 * force * read)
        files.append(write_columns(tmp_path / f"s{k}.csv", head, *columns))
    corrections = Corrections(channels={"tip": ChannelCorrection("sensor")}) if stated else None
    answer = analyse(files, [40.0], corrections=corrections)
    places = answer.modes[0].places
    said = answer.to_json()
    assert any("'tip' is clipped: it stays at" in note and "'s2'" in note for note in said["notes"]) != stated
    assert all(("tip" in mode["sensors_left_out"]) != stated for mode in said["modes"])
    assert {peak.sensor for peak in places[0].response} == ({"root", "tip"} if stated else {"root"})
    if not stated:  # what correcting 4 % by the rate leaves
        assert all(at.ratio[0] == pytest.approx(ZETA, rel=0.02) for at in places)


@pytest.mark.parametrize("kind", ["clipped", "single", "held", "smooth"])
def test_a_clipped_spectrum_is_left_out(tmp_path, kind):
    """Amplitudes that stand at 60 % of the largest, of 16 digits or 7, unless the control held the response there."""
    f, motion = close_modes(1.0)
    noise, runs = 0.0 if kind == "smooth" else 0.005, {}  # without noise and limit: round tops alone
    for k, level in enumerate((0.1, 0.2, 0.4)):
        a = level * motion * (1 + noise * np.random.default_rng(k).normal(size=motion.shape))
        size = np.abs(a[0])
        limit = 0.6 * size.max() if level == 0.4 and kind != "smooth" else size.max()
        down = np.minimum(limit / size, 1.0)
        assert np.sum(down < 1.0) >= (10 if level == 0.4 and kind != "smooth" else 0)
        a = (a * down if kind == "held" else np.vstack([a[0] * down, a[1:]])).astype(complex)
        drive = (level * down if kind == "held" else np.full(len(f), level)).astype(complex)
        runs[f"run_{level}g"] = {"control": drive, "accelerations": (np.complex64(a) if kind == "single" else a, "g")}
    runs, summary = read_runs([write_spectra(tmp_path / "a.h5", f, runs)], 10_000_000)
    clipped = kind in ("clipped", "single")
    assert runs[0].names == [f"accelerations[{s}]" for s in range(clipped, 3)]
    assert any("'accelerations[0]' is clipped" in note and "'run_0.4g'" in note for note in summary.notes) == clipped


def test_modes_that_are_not_seen_are_asked_for(tmp_path):
    """Noise alone at frequencies that are stated: no mode, and what to do."""
    f, rng = np.geomspace(25.0, 60.0, 300), np.random.default_rng(3)
    path = write_shaken(tmp_path / "noise.h5", f, {0.1: 0.1 * (1 + 0.05 * rng.normal(size=(2, len(f))) + 0j)})
    levels = fit_levels(read_runs([path], 10_000_000)[0], [40.0])
    with pytest.raises(AnalysisError, match=r"sought near .* Hz none stands .*--modes F1,F2"):
        join_modes(levels)


def rubbing(f: np.ndarray, force: float) -> np.ndarray:
    """Displacement per force of a mode with Coulomb friction, averaged over a cycle: A solves a quadratic."""
    m, w_n, zeta, friction = 2.0, 2 * np.pi * 57.0, 0.004, 0.2
    w = 2 * np.pi * f
    spring, loss, constant = m * (w_n**2 - w**2), 2 * m * zeta * w_n * w, 4 * friction / np.pi
    both = spring**2 + loss**2
    A = (np.sqrt((loss * constant) ** 2 + both * (force**2 - constant**2)) - loss * constant) / both
    return 1.0 / (spring + 1j * (loss + constant / A))


@pytest.mark.slow
def test_peaks_of_a_mode_with_friction_lie_within_their_bands(tmp_path, few_draws):
    """Half the force of the lowest level is friction: damping is far from a line in the amplitude within a sweep."""
    f = np.linspace(50.0, 64.0, 600)

    def move(force):
        return -force * np.outer([1.0, -0.9], (2 * np.pi * f) ** 2 * rubbing(f, force))

    path = write_force_runs(tmp_path / "a.h5", f, (0.5, 1.0, 2.0, 4.0), move, seed=1)
    mode = analyse([path], [8.0]).modes[0]
    fine = np.linspace(56.5, 57.5, 4001)
    for at in mode.places:
        peak = at.level * np.max((2 * np.pi * fine) ** 2 * np.abs(rubbing(fine, at.level)))
        ratio = 1.0 / np.max(np.abs(rubbing(fine, at.level))) / (2 * 2.0 * (2 * np.pi * 57.0) ** 2)
        low, high = at.response[0].band[1:]
        assert low < peak < high
        assert at.ratio[1] < ratio < at.ratio[2]
        # 1 % of least spread of damping is a band of 3.3 %; twice the tested force has a tenth at most
        assert high / low < (1.05 if at.tested else 1.1)  # with damping as a line 26.2 to 27.5 was printed for 15.3


def test_too_few_rows_have_no_peak():
    """And none is looked for in the mean of nothing, which numpy warns of."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert find_peaks_of(np.array([10.0, 10.1]), np.ones((1, 2), complex)) == []


def test_the_largest_motion_is_that_whatever_the_units():
    """At 10 Hz, 1 g is 9.80665 / (20 pi)^2 = 2.484 mm, 13.3 m/s^2 1.36 g."""
    peaks = {"tip": (13.3, "m/s^2"), "root": (1.98, "g"), "mid": (4.0, "mm"), "foot": (0.2, "m/s")}
    response = tuple(Response(sensor, "", unit, Bounds(size, size, size)) for sensor, (size, unit) in peaks.items())
    assert At(1.0, True, 10.0, None, response, ()).largest == response[1]
    at = At(1.0, True, 10.0, None, (*response, Response("far", "", "mm", Bounds(5.0, 5.0, 5.0))), ())
    assert at.largest == at.response[-1]
    assert At(1.0, True, 10.0, None, (), ()).largest is None
