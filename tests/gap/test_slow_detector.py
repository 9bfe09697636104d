"""A detector that averages while the frequency moves: closed forms, and records integrated in time."""

import numpy as np
import pandas as pd
import pytest

from damping.arrays import RAD_S_PER_HZ
from damping.effects import FOREIGN
from damping.effects.contract import Drive, Terms
from damping.effects.detector import averaged
from damping.effects.terms import predict
from damping.forces import make
from damping.gap.diagnose import explain
from damping.records.mode import Rig
from damping.records.record import Record
from tests.gap.limited import limited

pytestmark = pytest.mark.usefixtures("no_folds")
RATE = 0.3  #: rad/s^2
TIME = 2.0  #: s


def drive(rows=41, way=1.0, width=3.0):
    """A sweep about 20 rad/s, its rows by frequency."""
    omega = 20.0 + np.linspace(-width, width, rows)
    return Drive(np.ones(rows), omega, rate=way * RATE, up=way)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_steady_ramp_is_read_one_time_constant_late(way):
    """y' = (x - y)/T of x = t from a dwell: y = t - T (1 - exp(-t/T)), in both directions."""
    swept = drive(way=way)
    t = (swept.omega - swept.omega[0] if way > 0.0 else swept.omega[-1] - swept.omega) / RATE
    y = averaged((100.0 + t)[np.newaxis].astype(complex), TIME, way * RATE, swept, begun=1.0)
    # slopes are those of 1/x: (step/x)^2 of them at inner rows, step/x at the two ends
    np.testing.assert_allclose(y[0], 100.0 + t - TIME * (1.0 - np.exp(-t / TIME)), rtol=1e-4, atol=0.0)


def test_a_fast_detector_changes_nothing_nor_does_a_slow_one_at_a_dwell():
    """T to 0, and no rate: the reading is the motion."""
    x = 1.0 / (1j + np.linspace(-6.0, 6.0, 41))[np.newaxis]
    np.testing.assert_allclose(averaged(x, 1e-9, RATE, drive()), x, rtol=1e-8, atol=0.0)
    np.testing.assert_allclose(averaged(x, TIME, 0.0, drive()), x, rtol=1e-14, atol=0.0)  # rounding


def integrated(omega, way, alpha, time, pole):
    """Motions and readings at ``omega`` of a' = 1/(2 i) - (pole + i (omega - 20)) a, y' = (a - y)/time.

    From a dwell at the first row; a step is so short that all change evenly in it.
    """
    count = 40_000
    path = np.linspace(omega[0], omega[-1], count)[:: int(way)]
    step = (omega[-1] - omega[0]) / alpha / (count - 1)
    p = pole + 1j * (path - 20.0)
    a = np.empty(count, complex)
    y = np.empty(count, complex)
    a[0] = y[0] = 0.5 / (1j * p[0])
    for k in range(1, count):
        mean, g = 0.5 * step * (p[k] + p[k - 1]) / 2.0, -0.5j * step
        a[k] = (a[k - 1] * (1.0 - mean) + g) / (1.0 + mean)
        half = 0.5 * step / time
        y[k] = (y[k - 1] * (1.0 - half) + half * (a[k] + a[k - 1])) / (1.0 + half)
    order = np.argsort(path)
    return [np.interp(omega, path[order], part[order]) for part in (a, y)]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_swept_resonance_is_averaged_as_integrated(way):
    """A pole of .2 rad/s swept at half its square, averaged over half the half-power width; rows at a half of it."""
    swept = drive(rows=61, width=2.4)._replace(rate=way * 0.02, up=way)
    a, y = integrated(swept.omega, way, 0.02, 10.0, 0.2)
    read = averaged(a[np.newaxis], 10.0, way * 0.02, swept, begun=1.0)
    # cubics of rows .4 of the half-width apart: .4^4/384 times the fourth derivative, 24, of the largest
    np.testing.assert_allclose(read[0], y, rtol=0.0, atol=0.002 * np.abs(y).max())


@pytest.mark.parametrize("rectified", [0.0, 1.0])
def test_derivatives_of_an_averaged_reading_are_those_of_its_prediction(rectified):
    """What averaging adds to the derivative by ln omega_n, against a difference of whole predictions."""
    swept = drive(rows=21)

    def predicted(time, omega_n=20.0):
        terms = Terms(10.0, omega_n, (make("viscous", coefficient=8.0),), 1)
        if time:
            terms = FOREIGN["slow-detector"].simulate(terms, {"time": time, "rectified": rectified})
        return predict(terms, np.zeros((1, 21)), swept)

    def measured(time):
        return (predicted(time, 20.0 * np.exp(1e-5)).P - predicted(time, 20.0 * np.exp(-1e-5)).P) / 2e-5

    added = measured(TIME) - measured(0.0)
    own = predicted(TIME).by_frequency - predicted(0.0).by_frequency
    np.testing.assert_allclose(own, added, rtol=0.0, atol=0.01 * np.abs(added).max())


def test_a_slow_detector_is_told_where_the_rate_is_known(lab):
    """Up at a tenth of the squared half-bandwidth, a fifth of the pass late: "planar-coupling" before, and no flag."""
    unit = lab.xi * lab.omega
    alpha, time = 0.1 * unit**2, 0.2 * 2.0 / (0.1 * unit)
    rows = lab.bench(levels=2, points=26).rows
    tables, rng = [], np.random.default_rng(3)
    for number in range(2):
        own = rows.sweep == number
        omega, force = rows.omega[own], rows.force[own]
        # the part that turns with the drive, about 20 rad/s as in `integrated`
        y = integrated(20.0 + omega - lab.omega, 1.0, alpha, time, unit)[1] * force / (lab.mass * lab.omega)
        y = y + force / (4.0 * lab.mass * lab.omega**2)  # the one that turns against it, to 1/K
        A = np.abs(y) * (1.0 + 0.01 * rng.normal(size=26))
        table = {"sweep": f"s{number}", "force": force, "frequency": omega / RAD_S_PER_HZ, "amplitude": A}
        table |= {"phase": -np.angle(y) + 0.01 * rng.normal(size=26), "amplitude_sd": 0.01 * A, "phase_sd": 0.01}
        tables.append(pd.DataFrame(table))
    record = Record(pd.concat(tables, ignore_index=True))
    library = ("planar-coupling", "natural-frequency", "viscous-coefficient")
    found = limited(library, explain, record, lab.mode(rig=Rig(rate=alpha / RAD_S_PER_HZ)))
    assert found.leading.effects
    assert found.in_library < 0.5
    assert any("a detector or filter that averages the reading" in caution for caution in found.cautions)
