"""Effects and columns that the generator of blind cases does not integrate, held to closed forms and other methods."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from scipy.special import gamma

from damping.effects import CATALOGUE, FOREIGN, with_effects
from damping.effects.contract import Drive, Terms
from damping.effects.forces import joint_force
from damping.effects.moving import _Envelope, _integrate
from damping.effects.rig import clipping, compressing, integrate_third, recorded_third
from damping.effects.terms import predict, third_harmonic
from damping.errors import AnalysisError, InputError
from damping.forces import make
from damping.forces.joints import Slip
from damping.gap.corrected import describe_effects, effect_intervals, effect_values, refitted_values
from damping.gap.diagnose import diagnose, explain
from damping.gap.problem import exclude_effects, setting
from damping.gap.search import Search
from damping.gap.simulator import Simulator
from damping.predict.steady import resonant_amplitude
from damping.predict.sweep_rate import envelope
from damping.records.mode import Rig, Tolerance, Units
from damping.records.record import Record
from damping.report.forms import gap_form
from damping.report.gap import describe_diagnosis
from damping.result import DiagnosisResult
from damping_pipelines.gap import _describe_model
from damping_validation.generator.laws import Partner
from tests.gap.limited import limited

pytestmark = pytest.mark.usefixtures("no_folds")
OMEGA = 2 * np.pi * 3.0
MASS = 10.0
XI = 0.01
VISCOUS = 2 * XI * MASS * OMEGA
TERMS = Terms(MASS, OMEGA, (make("viscous", coefficient=VISCOUS),), 1)


def receptance(omega, terms=TERMS, **drive):
    """Predicted phasor over force of terms that do not depend on amplitude."""
    found = predict(terms, np.zeros(len(omega)), Drive(np.ones(len(omega)), omega, **drive)).P
    return np.exp(found)[0] if found.ndim == 2 else np.exp(found)


def simulate(force, frequency, *, stiffness=(MASS * OMEGA**2, 0.002), damping=(VISCOUS, 0.05)):
    """The mode as a user's own function."""
    omega = 2 * np.pi * frequency
    Y = stiffness - MASS * omega**2 + 1j * damping * omega
    return force / np.abs(Y), np.angle(Y)


def altered(lab, name, table, seed=3, **drive):
    """The record of viscous damping with one effect as a model file's table has it, with noise."""
    rows = lab.bench(levels=4, points=14).rows
    time = np.linspace(-0.5, 0.5, len(rows.force))
    own = Drive(rows.force, rows.omega, sweep=1.0 + rows.sweep, **{"time": time} | drive)
    effect = CATALOGUE[name]
    terms = effect.simulate(TERMS, effect.complete(table))
    u = np.log(lab.linear(rows).amplitude)
    for _ in range(60):  # the reading that the terms predict at itself
        P = predict(terms, u, own).P
        u = np.ravel(P.real)
    return lab.record(rows, lab.cells(np.exp(u), -np.ravel(P.imag)), seed)


def test_a_frequency_that_moves_is_the_envelope_integrated():
    """Against the envelope of the swept motion, integrated step by step from far below."""
    hertz = np.linspace(2.85, 3.15, 61)
    rate = 3.0 * XI**2 * 3.0**2  # Hz/s: three tenths of what a resonance can follow
    octaves = rate / (3.0 * np.log(2.0)) * 60.0
    a = envelope(hertz, octaves, 1.0, MASS, 3.0, XI)
    H = receptance(2 * np.pi * hertz, rate=2 * np.pi * rate)
    # octaves a minute are a rate that changes by 10 % over the band, and the envelope leaves out a''
    np.testing.assert_allclose(np.abs(H), np.abs(a), rtol=0.03, atol=0.0)


def test_a_swept_motion_remembers_the_damping_of_the_rows_before():
    """Octaves at twelve times what a resonance can follow, damping that triples with amplitude: the motion in full."""
    omega, rate = OMEGA * np.linspace(0.9, 1.1, 31), 12.0 * XI**2 * OMEGA  # rad/s of each rad/s
    own, growth = VISCOUS / MASS, 2.0 / 0.2  # the damping is three times as large at an amplitude of 0.2

    def follow(t, y):
        w, (a, v) = omega[0] * 0.85 * np.exp(rate * t), y
        loss = own * (1.0 + growth * abs(a))
        return [v, 2.0 - loss * (v + 1j * w * a) - (OMEGA**2 - w * w + 1j * rate * w) * a - 2j * w * v]

    times = np.log(omega / (0.85 * omega[0])) / rate
    start = [2.0 / (OMEGA**2 - (0.85 * omega[0]) ** 2), 0.0]
    a = solve_ivp(follow, (0.0, times[-1]), np.array(start, complex), t_eval=times, rtol=1e-8, atol=1e-10).y[0]
    damping = make("displacement-velocity", coefficient=1.0)
    A = np.abs(a)
    per_loss = damping.quadrature(1.0, OMEGA) / OMEGA  # of c q' with c = A, which the law is on average
    terms = TERMS._replace(forces=(*TERMS.forces, replace(damping, coefficient=VISCOUS * growth / per_loss)))
    drive = Drive(np.full(31, 2.0 * MASS), omega, sweep=np.ones(31), rate=rate * omega)
    P = np.ravel(predict(terms, np.log(A), drive).P)
    # the amplitude is read off at 31 rows and taken to change evenly between them
    np.testing.assert_allclose(np.exp(P), a, rtol=0.0, atol=0.004 * A.max())


def test_a_slow_sweep_is_a_steady_state():
    omega = OMEGA * np.linspace(0.9, 1.1, 21)
    # of first order in the rate over the squared half-bandwidth, here 1e-6
    np.testing.assert_allclose(receptance(omega, rate=1e-6 * (XI * OMEGA) ** 2), receptance(omega), rtol=1e-5, atol=0.0)


@pytest.mark.parametrize("over", [0.5, 1.0, 1.3, 2.0])
def test_clipping_is_the_fundamental_of_a_clipped_sine(over):
    theta = 2 * np.pi * (np.arange(20_000) + 0.5) / 20_000
    fundamental = 2 * np.mean(np.clip(over * np.sin(theta), -1.0, 1.0) * np.sin(theta))
    reading = clipping(1.0)
    value, _ = reading.read(np.array([np.log(over)]))
    np.testing.assert_allclose(np.exp(value), fundamental, rtol=1e-4, atol=0.0)  # the table has 400 points
    back, _ = reading.unread(value)
    np.testing.assert_allclose(back, np.log(over), rtol=0.0, atol=5e-3)  # the same table


def test_compression_is_undone():
    reading = compressing(2.0, 1.7)
    v = np.log([0.01, 0.5, 2.0, 4.0])
    value, slope = reading.read(v)
    back, inverse = reading.unread(value)
    np.testing.assert_allclose(back, v, rtol=0.0, atol=1e-12)  # closed forms, rounding
    np.testing.assert_allclose(slope * inverse, 1.0, rtol=1e-12, atol=0.0)


def harmonics_of(law, A):
    """Amplitudes of sin theta and of sin 3 theta in law(A sin theta), A (n,): means over a cycle."""
    theta = 2 * np.pi * (np.arange(4_000) + 0.5) / 4_000
    response = law(A[:, np.newaxis] * np.sin(theta))
    return tuple(2 * np.mean(response * np.sin(order * theta), axis=1) for order in (1, 3))


def test_the_third_harmonic_of_an_instrument_follows_from_its_first():
    """For the hyperbolic tangent, from its first harmonic; and for clipping the closed form. Both over a cycle."""
    ln_A = np.linspace(-6.0, 2.0, 4_000)
    ln_R = np.log(harmonics_of(np.tanh, np.exp(ln_A))[0])
    slope = np.gradient(ln_R, ln_A)
    third = integrate_third(lambda v: (np.interp(v, ln_A, ln_R), np.interp(v, ln_A, slope)))
    A = np.array([0.3, 1.0, 3.0])
    expected = harmonics_of(np.tanh, A)[1]
    np.testing.assert_allclose(third(np.log(A)), expected, rtol=1e-3, atol=0.0)  # the table and 16 nodes
    A = np.array([1.05, 1.5, 4.0])
    expected = harmonics_of(lambda q: np.clip(q, -1.0, 1.0), A)[1]
    np.testing.assert_allclose(clipping(1.0).third(np.log(A)), expected, rtol=1e-4, atol=0.0)  # edges between points


def test_a_compressing_sensor_reads_the_third_harmonic_of_a_law_without_memory():
    """A third of A^3/4 for small readings of power 2, as of A sin - (A sin)^3/3; a square wave's level for large ones.

    The square wave of first harmonic 1 has the third 1/3.
    """
    small, large = compressing(2.0, 2.0), compressing(1.0, 8.0)
    A = 0.01
    lost = A - np.exp(small.read(np.log([A]))[0])
    np.testing.assert_allclose(small.third(np.log([A])), lost / 3.0, rtol=1e-4, atol=0.0)  # next power of A/2
    np.testing.assert_allclose(large.third(np.log([30.0])), 1.0 / 3.0, rtol=1e-3, atol=0.0)  # (1/30)^3 is left out


@pytest.mark.parametrize("bounded", [0.0, 1.0])
@pytest.mark.parametrize("kappa", [0.5, 1.0, 1.4])
def test_many_joints_are_the_sum_of_each(kappa, bounded):
    """20 000 joints of limits at quantiles of their distribution, one by one; amplitudes over four decades."""
    A, share = np.geomspace(1e-3, 10.0, 40), (np.arange(20_000) + 0.5) / 20_000
    limit = (share if bounded else -np.log(1.0 - share)) ** (1.0 / kappa)
    expected = [np.sum(part, axis=0) for part in Slip(65.0 / 20_000, 0.3 * limit[:, None]).averages(0.3 * A, OMEGA)]
    force = joint_force({"stiffness": 65.0, "limit": 0.3, "kappa": kappa, "bounded": bounded})
    for own, of_each in zip(force.averages(0.3 * A, OMEGA), expected, strict=True):
        # eight points, of an integrand with a root where the largest limits begin to slip, and a logarithm beyond
        np.testing.assert_allclose(own, of_each, rtol=2e-3, atol=1e-3 * np.max(np.abs(of_each)))


def test_joints_far_beyond_their_limits_all_slip():
    """C tends to 4/pi of the sum of the slip forces, whose mean limit is limit Gamma(1 + 1/kappa)."""
    force = joint_force({"stiffness": 65.0, "limit": 0.3, "kappa": 60.0})
    # eight points in the place of an integral
    assert force.quadrature(1e12, OMEGA) == pytest.approx(4.0 / np.pi * 65.0 * 0.3 * gamma(1.0 + 1.0 / 60.0), rel=2e-3)


def test_many_joints_change_with_amplitude_as_they_say():
    force = joint_force({"stiffness": np.array([[40.0], [25.0]]), "limit": np.array([[0.1], [0.3]]), "kappa": 1.4})
    A = np.geomspace(1e-3, 1.0, 60)[np.newaxis]
    (C, slope, S, in_phase_slope), (C_next, _, S_next, _) = (force.averages(A * by, OMEGA) for by in (1.0, 1.0001))
    # eight points in the place of an integral
    np.testing.assert_allclose((C_next - C) / np.log(1.0001), slope, rtol=0.0, atol=2e-3 * np.max(C))
    np.testing.assert_allclose((S_next - S) / np.log(1.0001), in_phase_slope, rtol=0.0, atol=2e-3 * np.max(-S))


def test_many_joints_of_a_batch_are_those_of_each():
    """Neighbours that differ in nothing, stiffness, limit, kappa or amplitude alone; each by itself is the truth."""
    stiffness, limit, kappa, size = np.array(
        [(1, 1, 1, 1), (1, 1, 1, 1), (2, 1, 1, 1), (2, 3, 1, 1), (2, 3, 1.4, 1), (2, 3, 1.4, 2), (1, 3, 1.4, 2)], float
    ).T[..., np.newaxis]
    A, omega = size * np.geomspace(0.1, 10.0, 30), np.full(30, OMEGA)
    every = joint_force({"stiffness": stiffness, "limit": limit, "kappa": kappa}).averages(A, omega)
    for k in range(len(A)):
        alone = joint_force({"stiffness": stiffness[k], "limit": limit[k], "kappa": kappa[k]}).averages(A[k], omega)
        for own, of_each in zip(every, alone, strict=True):
            np.testing.assert_allclose(own[k], of_each, rtol=1e-12, atol=1e-15)  # rounding of sums of eight


def test_many_joints_of_a_frequency_each():
    """An amplitude for all of them, and the resonance under each of several forces with its own frequency."""
    force, omega = joint_force({"stiffness": 65.0, "limit": 0.3, "kappa": 1.4}), OMEGA * np.array([0.9, 1.0, 1.1])
    same = force.quadrature(0.2, OMEGA)  # none of it is viscous; rounding of a sum in another order
    np.testing.assert_allclose(force.quadrature(0.2, omega), np.full(3, same), rtol=1e-14)
    A = resonant_amplitude(force, np.array([1.0, 3.0, 5.0]), omega)
    np.testing.assert_allclose(force.quadrature(A, omega), [1.0, 3.0, 5.0], rtol=1e-9)  # Newton's last step


def test_joints_of_evenly_spread_limits():
    """Limits evenly up to 1: below it C = 2 k A^2/(3 pi) and S = -k A^2/2, integrals of one joint's over them."""
    A = np.array([0.002, 0.02, 0.1, 0.3, 0.7])
    C, _, S, _ = joint_force({"stiffness": 1.0, "limit": 1.0, "kappa": 1.0, "bounded": 1.0}).averages(A, OMEGA)
    np.testing.assert_allclose(C, 2.0 * A**2 / (3.0 * np.pi), rtol=1e-12)  # eight points integrate a parabola exactly
    np.testing.assert_allclose(S, -0.5 * A**2, rtol=1e-3)  # and what is none to a thousandth


K3, K = 700.0, 40.0


@pytest.mark.parametrize(
    ("terms", "third", "off"),
    [
        # k3 (A sin)^3 = k3 A^3 (3 sin theta - sin 3 theta)/4
        (with_effects(TERMS, {"stiffness-hardening": {"coefficient": K3}}), K3 * 0.05**3 / 4.0, 1e-10),  # rounding
        # k |A sin theta| sgn(cos theta) = (2 k A/pi)(cos theta - cos 3 theta + ..): 24 points of a jump
        (Terms(MASS, OMEGA, (make("displacement", coefficient=K),), 1), 2j * K * 0.05 / np.pi, 0.01),
    ],
    ids=["a cubic spring", "damping in proportion to displacement"],
)
def test_third_harmonic_of_the_motion_is_that_of_the_force_over_the_stiffness(terms, third, off):
    A, phase, omega = 0.05, 0.7, np.array([1.01 * OMEGA])
    found = third_harmonic(terms, np.array([A]), np.array([phase]), Drive(np.ones(1), omega))
    expected = third / (MASS * (OMEGA**2 - 9.0 * omega**2)) * np.exp(-3j * phase)
    np.testing.assert_allclose(np.ravel(found), expected, rtol=off, atol=0.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_constant_restoring_force_is_named_by_the_sense_of_its_stiffness(lab, sign):
    """A preload that rocks, F0 sgn q, gives 4 F0/(pi A) of stiffness, which falls with amplitude; play takes as much.

    At a force F and an amplitude A, |K - M w^2 + i c w| = F/A is quadratic in w^2: both sides of the resonance.
    """
    preload = sign * XI * MASS * OMEGA**2 * 0.05
    rows = list[tuple[str, float, float, float, float]]()
    for sweep, top in (("A", 0.0125), ("B", 0.025), ("C", 0.05)):
        F = VISCOUS * OMEGA * top
        A = top * np.array([0.3, 0.5, 0.7, 0.85, 0.95])
        K = MASS * OMEGA**2 + 4.0 * preload / (np.pi * A)
        half = K / MASS - 0.5 * (VISCOUS / MASS) ** 2
        for side in (-1.0, 1.0):
            square = half + side * np.sqrt(half**2 - (K / MASS) ** 2 + (F / A / MASS) ** 2)
            phase = np.arctan2(VISCOUS * np.sqrt(square), K - MASS * square)
            rows += zip([sweep] * 5, [F] * 5, np.sqrt(square) / (2 * np.pi), A, phase, strict=True)
    table = pd.DataFrame(rows, columns=["sweep", "force", "frequency", "amplitude", "phase"])
    record = Record(table.assign(amplitude_sd=0.01 * table.amplitude, phase_sd=0.01))
    start = setting(record, lab.mode())
    names = ("stiffness-softening", "stiffness-hardening")
    search = Search(start.problem, {name: CATALOGUE[name] for name in names}, start.unknowns)
    first, second = search.run().ranked()[:2]
    assert first.effects == (names[0 if sign > 0.0 else 1],)
    assert first.log_evidence > second.log_evidence + 6.0  # odds of 400: a change in the other sense does not fit


@pytest.mark.parametrize(
    ("tables", "show", "lag", "off"),
    [
        ({"sensor-saturation": {"level": 0.04}}, lambda q: np.clip(q, -0.04, 0.04), 0.0, 1e-3),
        # compression that is slight: q - q^3/(2 a^2) loses 3/8 A^3/a^2 of the first, A - A^3/(2 level^2) as much
        (
            {"sensor-saturation": {"level": 0.2 / 3.0**0.5, "power": 2.0}},
            lambda q: q / np.hypot(1.0, q / 0.1),
            0.0,
            0.1,
        ),
        ({"amplitude-scale": {"factor": 1.3}, "phase-lag": {"lag": 0.2}}, lambda q: 1.3 * q, 0.2, 1e-9),
        ({"time-delay": {"delay": 0.01}}, lambda q: q, 0.0, 1e-9),
    ],
)
def test_a_third_harmonic_is_read_through_the_instrument(tables, show, lag, off):
    """A cycle of a cubic spring's motion through a sensor, its harmonics by quadrature, later by lag and delay."""
    k3, A, phase, omega = 7000.0, 0.05, 0.7, np.array([1.01 * OMEGA])
    truth = with_effects(TERMS, {"stiffness-hardening": {"coefficient": k3}})
    drive, theta = Drive(np.ones(1), omega), 2.0 * np.pi * np.arange(4096) / 4096
    third = third_harmonic(truth, np.array([A]), np.array([phase]), drive).item()
    shown = show(A * np.sin(theta - phase)) + (third * np.exp(3j * theta)).imag * show(1e-9) / 1e-9
    later = [-1j * (lag + order * omega * tables.get("time-delay", {}).get("delay", 0.0)) for order in (1, 3)]
    X, X3 = (2j * np.mean(shown * np.exp(-1j * n * theta)) * np.exp(of) for n, of in zip((1, 3), later, strict=True))
    found = recorded_third(with_effects(truth, tables), np.log(np.abs(X)), -np.angle(X), drive)
    np.testing.assert_allclose(np.ravel(found), X3, rtol=off, atol=0.0)


@pytest.mark.parametrize(("kappa", "off"), [(0.0, 1e-6), (1.3, 0.02)])
def test_third_harmonic_of_joints_is_that_of_their_loops(kappa, off):
    """The closed form beside 20 000 points of half a cycle, from joints that stick to some that slip all the way.

    In time 32 joints stand for all of many: a part of one range of limits is missed or too much.
    """
    force = joint_force({"stiffness": 3.0, "limit": 0.1, "kappa": kappa})
    A, theta = np.array([[0.05, 0.11, 0.3, 5.0]]), np.pi * (np.arange(20_000) + 0.5).reshape(-1, 1, 1) / 20_000
    loops = np.asarray(force.cycle(theta, A, np.full(4, OMEGA)))
    expected = 2j * np.mean(loops * np.exp(-3j * theta), axis=0)
    # corners of the loop lie between points: errors of the square of their distance
    np.testing.assert_allclose(force.third(A, np.full(4, OMEGA)), expected, rtol=off, atol=1e-8)


CASES = (
    ("second-mode", {"compliance": 2e-5, "frequency_ratio": 1.02, "loss": 0.03}),
    ("drift", {"frequency": 0.006, "sweep": 3.0}),
    ("drift", {"frequency": 0.004, "cycles": 2.0, "phase": 0.4}),
    ("drift", {"frequency": -0.006, "moment": 0.4}),
    ("drift", {"frequency": -0.006, "moment": 0.4, "duration": 0.001}),  # between two rows
    ("level-offset", {"factor": 0.9, "sweep": 2.0}),
    ("sensor-saturation", {"level": 0.02}),
    ("background", {"amplitude": 0.002, "angle": 0.8}),
    ("sweep-rate", {"rate": 5e-4}),
    ("slip", {"stiffness": 200.0, "limit": 0.01, "smooth": 1.0}),
    ("slip", {"stiffness": 200.0, "limit": 0.01, "smooth": 1.0, "relief": 2.0}),
)
ONWARD = "level-offset", {"factor": 0.96, "sweep": 0.0, "onward": 3.0}


@pytest.mark.parametrize(("name", "table"), [*CASES, pytest.param(*ONWARD, marks=pytest.mark.slow)])
def test_an_effect_is_found_and_sized(lab, name, table, among, no_rivals):
    record = altered(lab, name, table)
    # a step of readings is no scatter of levels, even where their repeatability is not stated
    found = limited(among(name), diagnose, record, lab.mode(*((None, None) if "onward" in table else (0.0, 0.0))))
    assert found.leading.effects == (name,)
    values, intervals = effect_values(found.leading.best)[name], effect_intervals(found.leading.best)[name]
    for key, true in table.items():
        if key in intervals:
            low, high = intervals[key]
            # the interval holds 90 %; twice its width about its middle all but a few in a thousand
            assert abs(true - 0.5 * (low + high)) < high - low, (key, true, intervals[key])
        else:
            assert values[key] == true  # which sweep it is
    if "sweep" in values:  # a label is no parameter: it is told in words
        form = gap_form(found)
        assert set(form["parameters"][name]) == set(form["intervals"][name]) == {next(iter(table))}
        place = form["places"][name]
        # a linear mode does not tell a reading from the force
        offset = {"readings from sweep C on"} if "onward" in table else {"readings of sweep B", "force of sweep B"}
        assert set(place.split(" or ")) == ({"frequency of sweep C"} if name == "drift" else offset)
        assert place in describe_diagnosis(found)["verdict"][0]
    (sizes,) = describe_diagnosis(found)["sizes"]
    assert not re.search(r"[0-9] ?1?/", sizes)  # no unit of a mode that names none
    assert name != "sweep-rate" or "ringing (reading: 0 of the motion, 1 of its envelope)" in sizes
    assert name != "slip" or sizes.endswith("slip: yields gradually (Bouc and Wen).")
    again = with_effects(TERMS, {name: values})
    assert isinstance(again, Terms)  # a corrected model holds it


def test_what_is_known_of_the_rig_is_not_asked(lab):
    rows = setting(lab.measured("phase-lag"), lab.mode()).problem.rows
    mode = lab.mode(rig=Rig(1, "measured", 0.0))
    left = exclude_effects(CATALOGUE, mode, rows)
    assert set(CATALOGUE) - set(left) == {"planar-coupling", "force-dropout", "sweep-rate"}
    mode = lab.mode(tolerance=Tolerance(from_record=True))
    left = exclude_effects(CATALOGUE, mode, rows)
    assert set(CATALOGUE) - set(left) == {"viscous-coefficient", "natural-frequency"}


def test_values_taken_from_the_record_do_not_hold_it(lab, among):
    """A simulation identified from the very rows, 15 % off in damping: no finding, since it claims no knowledge."""
    rows = lab.bench().rows
    record = lab.record(rows, lab.linear(rows, viscous=1.4 * lab.viscous), 3)
    assert limited(among(), diagnose, record, lab.mode()).leading.effects == ("viscous-coefficient",)
    found = limited(among(), diagnose, record, lab.mode(tolerance=Tolerance(from_record=True)))
    assert found.leading.effects == ()
    assert "within their tolerance" not in describe_diagnosis(found)["verdict"][0]
    assert any("errors in them cannot be detected" in caution for caution in found.cautions)


@pytest.mark.parametrize("factor", [1 / 3, 64.0])
def test_a_damping_many_times_wrong_is_sized(lab, factor, among, no_rivals):
    rows = lab.bench(levels=3, points=14).rows
    wide = replace(rows, omega=lab.omega * np.tile(np.linspace(0.5, 1.5, 14), 3))
    record = lab.record(wide, lab.linear(wide, viscous=factor * lab.viscous), 3)
    found = limited(among(), diagnose, record, lab.mode())
    assert found.leading.effects == ("viscous-coefficient",)
    # 1 % noise of 84 values of which a few see the damping: known to a few per cent
    relative = effect_values(found.leading.best)["viscous-coefficient"]["relative"]
    np.testing.assert_allclose(1.0 + relative, factor, rtol=0.1)


def heavier(lab, added, viscous, seed=5):
    """Viscous damping with a known mass added; the sweep follows the resonance."""
    rows = lab.bench(levels=2, points=12).rows
    omega = rows.omega / np.sqrt(1.0 + added / lab.mass)
    Y = lab.mass * lab.omega**2 - (lab.mass + added) * omega**2 + 1j * viscous * omega
    return lab.record(replace(rows, omega=omega), lab.cells(rows.force / np.abs(Y), np.angle(Y)), seed)


@pytest.mark.parametrize(
    ("effect", "true"),
    [("", {}), ("level-offset", {"factor": 0.88, "state": 2.0}), ("phase-lag", {"lag": 0.12, "state": 2.0})],
)
def test_a_state_that_is_read_otherwise_and_files_that_differ_within_their_tolerance(
    lab, effect, true, among, no_rivals
):
    """Three masses, one damping, which their files state 3 and 4 % apart: tolerance 5 %; a sensor mounted anew."""
    added, stated = (0.0, 2.0, 5.0), np.array([1.04, 1.0, 1.01]) * lab.viscous
    records = [heavier(lab, mass, lab.viscous, seed) for seed, mass in enumerate(added)]
    table = records[1].table
    table["amplitude"] *= true.get("factor", 1.0)
    table["phase"] += true.get("lag", 0.0)
    records[1] = Record(table)
    modes = [
        replace(
            lab.mode(damping={"viscous": {"coefficient": c}}),
            mass=lab.mass + mass,
            frequency=3.0 / np.sqrt(1.0 + mass / lab.mass),
        )
        for mass, c in zip(added, stated, strict=True)
    ]
    found = limited(
        among("level-offset"), explain, records[0], modes[0], states=list(zip(records[1:], modes[1:], strict=True))
    )
    assert found.leading.key == {effect} - {""}
    values, places = describe_effects(found.leading.best)
    for name, value in true.items():  # 1 % noise of 48 values of that state, four standard errors, and the mass beside
        np.testing.assert_allclose(values[effect][name], value, rtol=0.0, atol=0.02)
    what = ("phases",) if effect == "phase-lag" else ("readings", "force")  # which a linear mode does not tell
    assert places.keys() == found.leading.key
    assert places.get(effect) in (None, *(f"{word} of state 2" for word in what))
    if effect:  # in a corrected model of the first state it changes nothing
        rows = lab.bench(levels=2, points=12).rows
        drive = Drive(rows.force, rows.omega)
        alone = with_effects(TERMS, effect_values(found.leading.best))
        own, plain = (predict(terms, np.zeros(24), drive).P for terms in (alone, TERMS))
        np.testing.assert_allclose(own, plain, rtol=1e-14)


def test_a_state_that_is_not_damped_as_stated_is_told(lab, among):
    """A tenth more damping with the mass than its file says; two effects of the rig or structure imitate it."""
    rows = lab.bench(levels=2, points=24).rows
    plain, state = lab.record(rows, lab.linear(rows), 4), heavier(lab, 2.0, 1.1 * lab.viscous)
    other = replace(lab.mode(), mass=12.0, frequency=3.0 / np.sqrt(1.2))
    found = limited(among("level-offset"), explain, plain, lab.mode(), states=[(state, other)])
    assert found.in_library < 0.5
    assert any("a state whose mass, damping or frequency differs" in caution for caution in found.cautions)


def test_states_share_what_is_wrong(lab, among, no_rivals):
    """A mass added is known as a column, or as a state with its own model: the same answer."""
    rows = lab.bench(levels=2, points=12).rows
    plain = lab.record(rows, lab.linear(rows, viscous=1.5 * lab.viscous), 4)
    state = heavier(lab, 2.0, 1.5 * lab.viscous)
    column = pd.concat(
        [plain.table.assign(added_mass=0.0), state.table.assign(added_mass=2.0, sweep="m" + state.table["sweep"])]
    )
    other = replace(lab.mode(), mass=12.0, frequency=3.0 / np.sqrt(1.2))
    both = [
        limited(among("level-offset"), diagnose, Record(column), lab.mode()),
        limited(among("level-offset"), diagnose, plain, lab.mode(), states=[(state, other)]),
    ]
    for one in both:
        assert one.leading.effects == ("viscous-coefficient",)
        relative = effect_values(one.leading.best)["viscous-coefficient"]["relative"]
        np.testing.assert_allclose(relative, 0.5, rtol=0.0, atol=0.02)  # 1 % noise, 96 values
    assert any(sweep.startswith("2: ") for sweep in both[1].setting.problem.rows.sweeps)


def test_states_of_different_forces_are_refused_by_the_names_of_both(lab):
    rows = lab.bench(levels=2, points=12).rows
    plain, corrected = lab.record(rows, lab.linear(rows), 4), {"viscous": VISCOUS, "velocity-squared": 20.0}
    said = "simulates viscous, but .* simulates viscous, velocity-squared; .* give each model the same ones"
    with pytest.raises(AnalysisError, match=said):
        explain(plain, lab.mode(damping=corrected), states=[(heavier(lab, 2.0, VISCOUS), lab.mode())])


def test_states_of_other_units_are_refused(lab):
    rows = lab.bench(levels=2, points=12).rows
    plain = lab.record(rows, lab.linear(rows), 4)
    first, other = (lab.mode(units=Units("N", length, "s")) for length in ("m", "mm"))
    with pytest.raises(InputError, match="state 2 has its length in mm, the first in m; expected states in the same"):
        explain(plain, first, states=[(heavier(lab, 2.0, VISCOUS), other)])
    unnamed = replace(lab.mode(), mass=12.0, frequency=3.0 / np.sqrt(1.2))  # of one system with the first
    pair = [(heavier(lab, 2.0, VISCOUS), unnamed)]
    assert limited({}, explain, plain, first, states=pair).leading.effects == ()


@pytest.mark.parametrize(("share", "told"), [(0.3, True), (0.01, False)])
def test_motion_across_one_plane_is_told(lab, share, told):
    rows = lab.bench(levels=2, points=12).rows
    table = lab.record(rows, lab.linear(rows), 4).table
    table = table.assign(amplitude_y=share * table["amplitude"], phase_y=table["phase"])
    found = limited({}, explain, Record(table), lab.mode(rig=Rig(planes=1)))
    said = [caution.partition(",")[0] for caution in found.cautions if "amplitude_y" in caution]
    assert said == (["amplitude_y reaches 30 % of the amplitude"] if told else [])


def test_a_simulation_of_the_users_own(lab):
    """A mode as a function, off in one of its parameters by two tolerances, and read with a wrong lag."""

    rows = lab.bench(levels=2, points=14).rows
    cells = lab.linear(rows, omega=lab.omega * np.sqrt(1.004))
    record = lab.record(rows, replace(cells, phase=cells.phase + 0.08), 2)
    start = setting(record, lab.mode(), simulate=simulate)
    assert start.problem.simulation.names == ("frequency", "mass", "viscous", "stiffness", "damping")
    search = Search(start.problem, {"phase-lag": CATALOGUE["phase-lag"]}, start.unknowns)
    best = search.run().ranked()[0].best
    assert best.effects == ("phase-lag",)
    np.testing.assert_allclose(effect_values(best)["phase-lag"]["lag"], 0.08, rtol=0.0, atol=0.005)  # 56 values at 1 %
    np.testing.assert_allclose(best.y[3], 2.0, rtol=0.0, atol=0.2)  # the stiffness, in tolerances


def test_a_parameter_of_a_simulator_may_have_the_name_of_one_of_the_mode(lab):
    """An effect on the viscous damping of the mode does not remove the simulator's own ``viscous`` from the answer."""

    def named(force, frequency, *, viscous=(VISCOUS, 0.001)):
        return simulate(force, frequency, stiffness=MASS * OMEGA**2, damping=viscous)

    rows = lab.bench(levels=2, points=14).rows
    record, library = lab.record(rows, lab.linear(rows, viscous=1.5 * VISCOUS), 4), "viscous-coefficient"
    result = DiagnosisResult(limited({library: CATALOGUE[library]}, diagnose, record, lab.mode(), simulate=named))
    assert result.diagnosis.leading.effects == (library,)
    head = re.search(r"give it viscous = ([0-9]+[.][0-9]+)", _describe_model(result).replace("\n# ", " "))
    np.testing.assert_allclose(float(head.group(1)), VISCOUS, rtol=0.005)  # five tolerances
    assert result.diagnosis.corrected.effects[library]["relative"] > 0.3  # that of the effect


@pytest.mark.parametrize("states", [False, True])
def test_a_mass_on_the_structure_of_a_simulator_is_in_the_prediction(lab, states):
    """The function knows no added mass: F/|k - (M + m) omega^2 + i c omega| still follows, in closed form."""

    def bare(force, frequency, *, stiffness=(MASS * OMEGA**2, 0.001)):
        return simulate(force, frequency, stiffness=stiffness, damping=VISCOUS)

    added, rows = 0.2 * MASS, lab.bench(levels=2, points=14).rows
    moved = replace(rows, omega=rows.omega / np.sqrt(1.2))
    Y = MASS * OMEGA**2 - (MASS + added) * moved.omega**2 + 1j * VISCOUS * moved.omega
    light = lab.record(rows, lab.linear(rows), 2)
    heavy = lab.record(moved, lab.cells(moved.force / np.abs(Y), np.angle(Y)), 3)
    if states:
        mode = replace(lab.mode(), mass=MASS + added, frequency=lab.mode().frequency / np.sqrt(1.2))
        start = setting(light, lab.mode(), states=[(heavy, mode)], simulate=bare)
    else:
        tables = light.frame.assign(added_mass=0.0), heavy.frame.assign(added_mass=added, sweep=heavy.frame.sweep + "m")
        start = setting(Record(pd.concat(tables, ignore_index=True)), lab.mode(), simulate=bare)
    best = Search(start.problem, {}, start.unknowns).run().ranked()[0].best
    assert np.sqrt(np.mean(best.r**2)) < 1.2  # noise alone


@pytest.mark.parametrize(
    ("pair", "said"),
    [
        ((1.0, -0.1), "the tolerance of {} is -0.1; expected a relative standard uncertainty"),
        ((1.0, np.nan), "the tolerance of {} is nan"),
        ((1.0, np.inf), "the tolerance of {} is inf"),
        ((np.nan, 0.1), "{} is nan; expected a finite number"),
        ((-np.inf, 0.1), "{} is -inf"),
    ],
)
def test_parameters_of_a_simulator_that_are_none(lab, pair, said):
    def scaled(force, frequency, *, k=pair):
        return k * force, frequency

    with pytest.raises(InputError, match=said.format("parameter k of the simulator")):
        Simulator.read(scaled, lab.mode())


def test_a_parameter_of_a_simulator_without_a_tolerance_is_fixed(lab):
    def held(force, frequency, *, stiffness=(MASS * OMEGA**2, 0.002), damping=(VISCOUS, 0.0)):
        return simulate(force, frequency, stiffness=stiffness, damping=damping)

    rows = lab.bench(levels=2, points=14).rows
    start = setting(lab.record(rows, lab.linear(rows), 2), lab.mode(), simulate=held)
    best = Search(start.problem, {}, start.unknowns).run().ranked()[0].best
    assert np.isfinite(best.r).all()
    others = {name: str(value) for name, value in refitted_values(best).items() if name != "stiffness"}
    assert others == dict.fromkeys(("frequency", "mass", "viscous", "damping"), "0.0")  # and no rounding of 1, no -0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda A, phase: (A, -phase), "the simulator's answer: the phase falls through -pi/2.*negate it"),
        (lambda A, phase: (A, phase - np.pi), "the simulator's answer: the phase runs from -pi to 0"),
        (lambda A, phase: (A, np.degrees(phase)), "the simulator's answer, column phase.*radians.*in degrees"),
        (lambda A, phase: (A, phase / (2.0 * np.pi)), "the simulator's answer: the phases .* are they turns"),
        (lambda A, phase: (A / 1000.0, phase), "the simulator's answer: the rows imply 1000 times the mass.*mm for m"),
        (lambda A, phase: (A * 25.4, phase), "the simulator's answer: the rows imply 0.03937 times .*mm for in"),
        (lambda A, phase: (A / 9.80665, phase), "the simulator's answer: the rows imply 9.8.*kgf for N"),
        (lambda A, phase: (0.0 * A, phase), "the amplitude that the simulator returns is 0 at force .* amplitudes > 0"),
    ],
)
def test_an_answer_of_a_simulator_that_is_none_is_refused_as_of_a_record(lab, wrong, said):
    def misread(force, frequency, *, stiffness=(MASS * OMEGA**2, 0.002), damping=(VISCOUS, 0.05)):
        return wrong(*simulate(force, frequency, stiffness=stiffness, damping=damping))

    with pytest.raises(InputError, match=said):
        limited({}, explain, lab.measured("phase-lag"), lab.mode(), simulate=misread)


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (lambda A: [A, A], "the simulator returns a list"),
        (lambda A: (A, A, A), "the simulator returns a tuple of 3"),
        (lambda A: (A, 1.0), "the phase that the simulator returns is of type float64 and shape .., for 24 rows"),
        (lambda A: (A * 1j, A), "the amplitude that the simulator returns is of type complex128"),
        (lambda A: (A, ["?"] * len(A)), "the phase that the simulator returns is of type <U1"),
        (lambda A: (A, np.where(np.arange(24) == 3, np.nan, 1.0)), r"the phase .* is nan at force \S+ and 2.9\d+ Hz"),
        (lambda A: A["no key"], r"the simulator ends with IndexError.* in line \d+ of test_further_effects.py"),
    ],
)
def test_an_answer_of_a_simulator_that_is_none_names_its_fault(lab, answer, said):
    rows = lab.bench(levels=2, points=12).rows
    force, frequency = rows.force, rows.omega / (2 * np.pi)
    with pytest.raises(InputError, match=f"{said}.*one number each per row"):
        Simulator.read(lambda force, frequency: answer(force * frequency), lab.mode()).answer(force, frequency, {})


def test_damping_of_the_mode_file_excludes_no_effect_of_a_simulator(lab):
    """The mode file names a force that the user's function does not simulate, and the structure has it."""

    named = {"viscous": {"coefficient": VISCOUS}, "velocity-squared": {"coefficient": 1.0}}
    effects = {name: CATALOGUE[name] for name in ("velocity-squared", "quadratic-displacement", "stiffness-hardening")}
    found = limited(effects, explain, lab.measured("velocity-squared"), lab.mode(damping=named), simulate=simulate)
    assert found.leading.effects == ("velocity-squared",)
    assert any("velocity-squared of the mode file is ignored" in caution for caution in found.cautions)


def remembered(p, alpha, omega, sweep, begun=0.0, F=1.0, held=0.0):
    drive = SimpleNamespace(omega=np.asarray(omega), F=F * np.ones(len(omega)), sweep=np.asarray(sweep))
    return _integrate(_Envelope.of(np.asarray(p, dtype=complex), np.asarray(alpha, dtype=float), begun, held), drive)


def test_a_dwell_remembers_nothing():
    """Beside a sweep that moves, with damping that doubles from row to row: J = 1/p at every row of the dwell."""
    p = np.array([1.0 - 2.0j, 1.0 - 1.0j, 1.0, 0.5, 1.0, 2.0])
    motion = remembered(p, [0.5, 0.5, 0.5, 0.0, 0.0, 0.0], [10.0, 11.0, 12.0, 12.0, 12.0, 12.0], [0, 0, 0, 1, 1, 1])
    np.testing.assert_allclose(motion[3:], 1.0 / p[3:], rtol=1e-12)


def test_a_slow_sweep_of_few_rows_follows_a_damping_that_changes():
    """J' = 1 - p J integrated, p straight between rows of which two lie about resonance and one beyond it."""
    alpha, detuning = 0.04, np.array([-8.0, -4.0, -1.5, -0.5, 0.02, 1.5, 2.0, 3.4, 5.0])
    p = 1.0 + 0.5 / (1.0 + detuning**2) + 1j * detuning
    times = (detuning - detuning[0]) / alpha

    def slope(t, y):
        own = np.interp(t, times, p.real) + 1j * (detuning[0] + alpha * t)
        return 1.0 - own * y

    start = np.array([1.0 / p[0]])
    true = solve_ivp(slope, (0.0, times[-1]), start, t_eval=times, rtol=1e-9, atol=1e-12).y[0]
    motion = remembered(p, np.full(9, alpha), 100.0 + detuning, np.zeros(9))
    # what changes between two rows is taken at its mean: of the second order in their distance, below a sigma of 2 %
    np.testing.assert_allclose(motion, true, rtol=0.02)


def test_a_sweep_that_is_held_at_its_first_row_rings_there():
    """J' = 1 - p J integrated from J = 1/p; one that began long before is I(p) from its first row on."""
    alpha, detuning = 1.0, np.linspace(-3.0, 4.0, 15)
    p, times = 1.0 + 1j * detuning, (detuning - detuning[0]) / alpha
    start = np.array([1.0 / p[0]])
    true = solve_ivp(lambda t, y: 1.0 - (p[0] + 1j * alpha * t) * y, (0.0, 7.0), start, t_eval=times, rtol=1e-9).y[0]
    held, before = (remembered(p, np.full(15, alpha), 100.0 + detuning, np.zeros(15), begun) for begun in (1.0, 0.0))
    np.testing.assert_allclose(held, true, rtol=1e-5)  # what the integration leaves
    np.testing.assert_allclose(before, _Envelope.of(p, np.full(15, alpha)).lewis, rtol=1e-9)
    assert abs(held[1] / before[1] - 1.0) > 0.04  # four sigma of 1 %, which were taken for another effect


def test_a_motion_does_not_follow_a_force_in_no_time():
    """Rows read twice on the way, with a force that wanders: the motion J F is the same both times."""
    detuning = np.repeat(np.linspace(-3.0, 4.0, 15), 2)
    F = 1.0 + 0.03 * np.sin(7.0 * np.arange(30))
    for held in (0.0, 1.0):
        motion = F * remembered(1.0 + 1j * detuning, np.full(30, 0.5), 100.0 + detuning, np.zeros(30), F=F, held=held)
        np.testing.assert_allclose(motion[3::2], motion[2::2], rtol=1e-9)


def test_a_force_that_wanders_changes_evenly_between_rows_or_is_that_of_the_row_reached():
    """(J F)' = F(t) - p J F integrated row by row for both, which differ by more than 1 %."""
    alpha, detuning = 0.3, np.linspace(-4.0, 4.0, 41)
    F, step = 1.0 + 0.03 * np.sin(7.0 * np.arange(41)), (detuning[1] - detuning[0]) / alpha
    motions = {}
    for held in (0.0, 1.0):
        true = [F[0] / (1.0 + 1j * detuning[0])]
        for k in range(40):

            def slope(t, y, k=k, held=held):
                force = F[k + 1] - (1.0 - held) * (F[k + 1] - F[k]) * (1.0 - t / step)
                return force - (1.0 + 1j * (detuning[k] + alpha * t)) * y

            true.append(solve_ivp(slope, (0.0, step), true[-1:], rtol=1e-9, atol=1e-12).y[0, -1])
        p = 1.0 + 1j * detuning
        motion = F * remembered(p, np.full(41, alpha), 100.0 + detuning, np.zeros(41), 1.0, F, held)
        # what changes between two rows is taken at its mean: below a third of a sigma of 1 %
        np.testing.assert_allclose(motion, true, rtol=3e-3)
        motions[held] = motion
    assert np.abs(motions[1.0] / motions[0.0] - 1.0).max() > 0.01


def test_ways_of_a_sweep_do_not_remember_each_other():
    """One label that passes up and down is two sweeps, and each member of a batch has its own way."""
    omega = np.array([10.0, 11.0, 12.0])
    p = (1.0 + 0.2 * np.arange(3)) + 1j * (omega - 11.0)
    up, down = remembered(p, np.full(3, 0.5), omega, [0, 0, 0]), remembered(p, np.full(3, -0.5), omega, [0, 0, 0])
    both = remembered(np.tile(p, 2), np.repeat([0.5, -0.5], 3), np.tile(omega, 2), np.zeros(6))
    np.testing.assert_allclose(both, np.concatenate([up, down]), rtol=1e-12)
    batch = remembered(np.stack([p, p]), np.stack([np.full(3, 0.5), np.full(3, -0.5)]), omega, np.zeros(3))
    np.testing.assert_allclose(batch, np.stack([up, down]), rtol=1e-12)


def test_memory_is_a_spring_behind_a_dashpot():
    """Against the generator's fluid, whose push is solved from its own equation: a stiff and hardly damped far end."""
    omega = OMEGA * np.linspace(0.9, 1.1, 30)
    # x'' + 2 zeta w x' + w^2 x = w^2 q with w large at 2 zeta/w = tau kept: x = q/(1 + i omega tau)
    own, tau = 1e6 * OMEGA, 0.7 / OMEGA
    push = Partner("memory", own, 0.5 * own * tau, 0.2 * (OMEGA / own) ** 2).push(omega)
    stiffness = MASS * (OMEGA**2 - omega**2) + 1j * VISCOUS * omega - MASS * push
    H = receptance(omega, FOREIGN["memory"].simulate(TERMS, {"stiffness": 0.2 * MASS * OMEGA**2, "time": tau}))
    np.testing.assert_allclose(H, 1.0 / stiffness, rtol=1e-5, atol=0.0)  # (omega/w)^2, times the stiffness over loss


def test_a_sensor_on_a_mount_moves_with_it():
    """Two equations solved: a sensor far lighter than the structure, on a spring and dashpot of 1.02 times its mode."""
    omega, light, w, d = OMEGA * np.linspace(0.9, 1.1, 30), 1e-9 * MASS, 1.02 * OMEGA, 0.01
    tie = light * (w**2 + 2j * d * w * omega)
    own = MASS * (OMEGA**2 - omega**2) + 1j * VISCOUS * omega
    Z = np.moveaxis(np.array([[own + tie, -tie], [-tie, tie - light * omega**2]]), -1, 0)
    table = {"size": 0.5 / d, "ratio": 1.02, "damping": d, "angle": 0.5 * np.pi}
    H = receptance(omega, FOREIGN["sensor-mount"].simulate(TERMS, table))
    read = np.linalg.solve(Z, np.array([[1.0], [0.0]]))[:, 1, 0]
    np.testing.assert_allclose(H, read, rtol=1e-5, atol=0.0)  # its mass over both losses


def test_a_gain_slope_is_a_filter_and_beside_a_resonance_a_residual_and_a_lag():
    """A high-pass far above its corner falls by its power; beside a resonance, the algebra stated at the effect."""
    omega = OMEGA * np.linspace(0.98, 1.02, 40)
    alone, d = receptance(omega, TERMS), 0.5 * VISCOUS / (MASS * OMEGA)
    s = 1e3j * omega / OMEGA
    H = receptance(omega, FOREIGN["gain-slope"].simulate(TERMS, {"power": -2.0}))
    filtered = alone * -1e6 / (1.0 + s) ** 2  # second order: (corner/omega)^2, real to 2e-3
    np.testing.assert_allclose(H, filtered, rtol=3e-3, atol=0.0)
    H = receptance(omega, FOREIGN["gain-slope"].simulate(TERMS, {"power": 0.5}))
    two = alone * (1.0 + 0.5j * d) - 0.5 / (2.0 * MASS * OMEGA**2)
    np.testing.assert_allclose(H, two, rtol=0.0, atol=0.5 * 0.02 * np.abs(alone).max() * 0.02)  # next order in x


def test_a_partner_is_the_second_of_two_coupled_equations():
    """Against the generator's circuit, whose push is solved from its own two equations."""
    omega = OMEGA * np.linspace(0.9, 1.1, 30)  # none exactly at resonance
    table = {"coupling": 0.03, "ratio": 1.02, "damping": 0.01}
    push = Partner("circuit", 1.02 * OMEGA, 0.01, 0.03).push(omega)
    stiffness = MASS * (OMEGA**2 - omega**2) + 1j * VISCOUS * omega - MASS * push
    H = receptance(omega, FOREIGN["partner"].simulate(TERMS, table))
    np.testing.assert_allclose(H, 1.0 / stiffness, rtol=1e-10, atol=0.0)  # the same numbers in another order
