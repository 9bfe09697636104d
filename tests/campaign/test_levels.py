"""What a campaign says of its levels against closed forms and motions integrated here: decays, a level read wrongly."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from damping.campaign import analyse
from damping.extrapolation import predict_record
from damping.extrapolation.curve import predict_forces, trace_loads
from damping.progress import silent
from damping.records import audit

G = 9.80665
M, HERTZ, ZETA, K3 = 40.0, 25.0, 0.008, 2e10


def hardening(path, start, kind):
    """A decay with viscous damping on a spring that hardens with A^2, read as displacement or acceleration."""
    w, t = 2 * np.pi * HERTZ, np.arange(0.0, 3.0, 1 / 1024)

    def accelerate(x, v):
        return -(w**2) * x - 2 * ZETA * w * v - K3 * x**3 / M

    y = solve_ivp(lambda _, y: [y[1], accelerate(*y)], (0, 3), [start, 0], t_eval=t, rtol=1e-9, atol=1e-12).y
    x = 1e3 * y[0] if kind == "mm" else accelerate(*y)
    x = x + 3e-4 * np.max(np.abs(x)) * np.random.default_rng(2).normal(size=len(t))
    np.savetxt(path, np.column_stack([t, x]), delimiter=",", header=f"time [s],tip [{kind}]", comments="")
    return path


def backbone(A):
    """Frequency of the fundamental, Hz: omega^2 = omega_n^2 + (3/4) k3 A^2/m."""
    return np.sqrt((2 * np.pi * HERTZ) ** 2 + 0.75 * K3 * A**2 / M) / (2 * np.pi)


@pytest.mark.parametrize("kind", ["mm", "m/s^2"])
def test_decays_that_change_in_frequency(tmp_path, kind):
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
        findings, asked = audit(mode.record, mode.mode), [2.0 * mode.record.table["amplitude"].max()]
        predicted, rests = predict_record(mode.record, mode.mode, findings, np.empty(0), (2.0,), 0.9, 1970, silent)
        told = trace_loads(predict_forces(predicted, asked, each=False), rests.backbone, rests.data)
        beyond = mode.places[-1]
        assert beyond.frequency == pytest.approx(told.frequency.median[0], rel=1e-6)
        assert beyond.ratio[0] == pytest.approx(told.damping_ratio.median[0], rel=2e-3)


def test_a_level_that_is_read_wrongly_is_named(tmp_path):
    """One mode of 1 %: the peak is |1 + H| in closed form, of which one run reads 1.1 times."""
    f = np.geomspace(35.0, 46.0, 300)
    w, w_n, rng = 2 * np.pi * f, 2 * np.pi * 40.0, np.random.default_rng(4)
    steady = 1 + 1.2 * w**2 / (w_n**2 - w**2 + 0.02j * w_n * w)
    for name, wrong in (("right", 1.0), ("wrong", 1.1)):
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            for level in (0.1, 0.2, 0.4, 0.8):
                run = file.create_group(f"run_{level}g")
                run["frequency"], run["control"] = f, np.full(len(f), level, complex)
                read = level * steady * (wrong if level == 0.4 else 1.0) * (1 + 0.005 * rng.normal(size=len(f)))
                run["accelerations"] = read[np.newaxis]
                run["accelerations"].attrs["units"] = "g"
        answer = analyse([tmp_path / f"{name}.h5"], [1.6])
        for at in answer.modes[0].places:
            if at.tested:
                factor = wrong if at.level == 0.4 else 1.0
                assert at.response[0].band[0] == pytest.approx(factor * at.level * np.max(np.abs(steady)), rel=0.01)
            said = any("0.4 g is farthest off" in caution for caution in at.cautions)
            assert said == (name == "wrong")
        assert any("0.4 g is farthest off" in note for note in answer.to_json()["notes"]) == (name == "wrong")
