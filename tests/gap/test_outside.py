"""Causes without a name that imitate one with a name, and what a new state or a third harmonic says of them."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from damping.arrays import RAD_S_PER_HZ
from damping.effects import CATALOGUE
from damping.effects.contact import Contact, LooseDashpot, Rub
from damping.effects.contract import Drive, Terms
from damping.effects.foreign import DisplacementPower, FallingFriction, SqueezedFilm
from damping.effects.masses import OTHER_ADDED_MASS, VaryingMass
from damping.effects.terms import predict
from damping.forces import make
from damping.gap.diagnose import diagnose, explain
from damping.gap.next_test import _predict_runs
from damping.gap.outside import Rival, weigh_library
from damping.gap.rows import read_rows
from damping.gap.unknowns import stated_noise
from damping.records.mode import Rig
from damping.records.record import Record
from damping_validation.generator.refit import applied
from damping_validation.generator.steady import true_record
from tests.gap.limited import limited

pytestmark = pytest.mark.usefixtures("no_folds")
THETA = 2.0 * np.pi * (np.arange(20_000)[:, np.newaxis] + 0.5) / 20_000


@pytest.mark.parametrize("power", [0.5, 2.0])
def test_hysteresis_of_any_power_has_the_averages_of_its_force(power):
    """C and the third harmonic of R |q|^m sgn q' in closed form: the latter is 1 - 4 (m + 1)/(m + 3) of C, times i."""
    force, A, omega = DisplacementPower(0.7, power), np.array([0.3, 1.3]), 1.7 * np.ones(2)
    C, slope, S, _ = force.averages(A, omega)
    assert not np.any(S)
    np.testing.assert_allclose(C, (4.0 / np.pi) * 0.7 * A**power / (power + 1.0), rtol=1e-12)
    np.testing.assert_allclose(slope, power * C, rtol=1e-12)
    # 24 points of half a cycle: 1 % of a force that jumps
    third = 1j * C * (1.0 - 4.0 * (power + 1.0) / (power + 3.0))
    np.testing.assert_allclose(np.ravel(force.third(A, omega)), third, rtol=0.01)


@pytest.mark.parametrize(("odds", "beyond"), [(0.5, 0), (-2.0, 1)])
def test_a_second_state_says_nothing_against_a_cause_outside_that_explains_it_as_well(lab, odds, beyond, monkeypatch):
    """Log odds above 0: the second state did not tell the explanation from that cause, and so does not support it."""
    rows = lab.bench(levels=2, points=12).rows
    states = [("a", rows, 0.0), ("b", rows, 0.2 * lab.mass)]
    record = make_record(lab, states, lambda A, omega: 1j * omega * lab.viscous)
    found = limited(("viscous-coefficient",), explain, record, lab.mode())
    monkeypatch.setattr("damping.gap.outside.weigh_outside", lambda *_: ((Rival("a film", odds),), ()))
    verdict = weigh_library(found.search, found.hypotheses, found.tests, 1.0, unexplained=False, brief=False)
    assert verdict.beyond == beyond


def test_hysteresis_of_the_square_of_displacement_is_told_by_its_third_harmonic(lab, among):
    """R q^2 sgn q' in closed form of the harmonics: "|q| q' + a second plane + |q| sgn q', .86" before."""
    loss = 2.0 * lab.viscous * lab.omega / lab.A  # three times the damping at the largest amplitude
    stiff = lab.mass * lab.omega**2

    def third(A, omega):
        return 1j * loss * A**2 * (1.0 - 12.0 / 5.0) / (9.0 * lab.mass * omega**2 - stiff)

    states = [("a", lab.bench(levels=3, points=20).rows, 0.0)]
    record = make_record(lab, states, lambda A, omega: 1j * loss * A, third, floor=0.0005)
    found = limited(among("displacement-velocity", "quadratic-displacement"), explain, record, lab.mode())
    assert found.in_library < 0.5
    assert any("another power of velocity or displacement explains" in caution for caution in found.cautions)


FORCES = {
    "a contact": (Contact(40.0, 0.02), {"rtol": 1e-6, "atol": 1e-9}, None),  # corners, within a step of the cycle
    # these jump at the clearance, within a step of 3e-4 of the cycle: 40 times 3e-4, and times the speed
    "a rub": (Rub(40.0, 0.02), {"atol": 0.02}, {"atol": 0.02}),
    "a loose dashpot": (LooseDashpot(40.0, 0.02), {"atol": 0.01}, {"atol": 0.01}),
    "falling friction": (FallingFriction(3.0, 0.5), {"rtol": 1e-7}, None),  # the jump of cos, (pi/n)^2
    "a squeezed film": (SqueezedFilm(2.0, 0.5), {"rtol": 1e-9, "atol": 1e-12}, {"rtol": 1e-9, "atol": 1e-12}),  # smooth
}


@pytest.mark.parametrize(("force", "off", "off_third"), FORCES.values(), ids=FORCES)
def test_a_force_without_a_name_has_the_averages_of_its_cycle(force, off, off_third):
    """C, S and the third harmonic against the mean over a sampled cycle, below and above a clearance; slopes."""
    A, w = np.array([0.01, 0.021, 0.05, 0.4]), 1.7 * np.ones(4)
    theta = 2.0 * np.pi * (np.arange(200_000)[:, np.newaxis] + 0.5) / 200_000
    g = force.g(A * np.sin(theta), np.abs(w * A * np.cos(theta)), np.sign(np.cos(theta)))
    C, slope, S, in_phase_slope = (part + 0.0 * A for part in force.averages(A, w))
    of_spring = isinstance(force, Contact)
    assert not np.any(C if of_spring else S)
    weight = np.sin(theta) if of_spring else np.cos(theta)
    np.testing.assert_allclose(S if of_spring else C, 2.0 * np.mean(g * weight, axis=0), **off)
    if off_third:
        third = 2j * np.mean(g * np.exp(-3j * theta), axis=0)
        np.testing.assert_allclose(force.third(A, w), third, **off_third)
    above, below = (force.averages(A * np.exp(step), w) for step in (1e-4, -1e-4))
    for found, part in ((slope, 0), (in_phase_slope, 2)):  # the square of the step, rounding over it
        np.testing.assert_allclose(found, (above[part] - below[part]) / 2e-4 + 0.0 * A, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("power", [2.0, 1.0])
def test_a_mass_that_varies_has_the_averages_of_its_inertia(power):
    """Of m (q^2 q'' + q q'^2), and of m |q| q'': S, dS/d ln A and the third harmonic, over a sampled cycle."""
    A, w = np.array([0.3, 1.3]), 1.7
    q, speed, acceleration = A * np.sin(THETA), A * w * np.cos(THETA), -w * w * A * np.sin(THETA)
    own = 0.7 * (q * q * acceleration + q * speed**2 if power == 2.0 else np.abs(q) * acceleration)
    C, slope, S, in_phase_slope = VaryingMass(0.7, power).averages(A, w * np.ones(2))
    assert not np.any(C)
    assert not np.any(slope)
    np.testing.assert_allclose(S, 2.0 * np.mean(own * np.sin(THETA), axis=0), rtol=1e-6)  # square of the step
    np.testing.assert_allclose(in_phase_slope, (power + 1.0) * S, rtol=1e-12)
    third = 2j * np.mean(own * np.exp(-3j * THETA), axis=0)
    np.testing.assert_allclose(VaryingMass(0.7, power).third(A, w * np.ones(2)), third, rtol=1e-6, atol=1e-9)


def respond(lab, rows, added, stiffness, stated=1.0):
    """Phasors of the rows with masses ``added`` (``stated`` times as large in the record) and Z beside the linear."""
    omega = rows.omega * np.sqrt(lab.mass / (lab.mass + added))
    Z = lab.mass * lab.omega**2 - (lab.mass + added / stated) * omega**2 + 1j * lab.viscous * omega
    A = rows.force / np.abs(Z)
    for _ in range(4000):
        before, A = A, A + 0.1 * (rows.force / np.abs(Z + stiffness(A, omega)) - A)
        if np.allclose(A, before, rtol=1e-15, atol=0.0):
            break
    return omega, rows.force / (Z + stiffness(A, omega))


def make_record(lab, states, stiffness, third=None, noise=0.01, floor=0.0015, **more):
    """The record of sweeps without and with added masses, with noise; ``third``: phasor of the third harmonic.

    The noise of that is a share of the largest amplitude of its sweep.
    """
    tables, rng = [], np.random.default_rng(7)
    for label, rows, added in states:
        omega, y = respond(lab, rows, added, stiffness, **more)
        n = len(y)
        A, top = np.abs(y), np.array([np.abs(y)[rows.sweep == own].max() for own in rows.sweep])
        table = {
            "sweep": [f"{label}{number}" for number in rows.sweep],
            "force": rows.force,
            "frequency": omega / (2.0 * np.pi),
            "amplitude": A * (1.0 + noise * rng.normal(size=n)),
            "phase": -np.angle(y) + noise * rng.normal(size=n),
            "amplitude_sd": noise * A,
            "phase_sd": noise,
            "added_mass": added,
        }
        if third is not None:
            Y = third(A, omega) * np.exp(3j * np.angle(y)) + floor * top * (
                rng.normal(size=n) + 1j * rng.normal(size=n)
            )
            table |= {"amplitude_3": np.abs(Y), "phase_3": -np.angle(Y)}
        tables.append(pd.DataFrame(table))
    return Record(pd.concat(tables, ignore_index=True))


@pytest.mark.parametrize("added", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_inertia_that_varies_is_no_spring_that_softens(lab, added, among):
    """m (q^2 q'' + q q'^2), in closed form, 3 % at the top: third harmonics at the noise, "probability 1.00"."""
    growth = 0.03 * lab.mass / lab.A**2
    stiff = lab.mass * lab.omega**2

    def third(A, omega):
        return -0.5 * growth * A**3 * omega**2 / (stiff - 9.0 * lab.mass * omega**2)

    rows = lab.bench(levels=4, points=24).rows
    states = [("a", rows, 0.0), *[("b", rows, 0.25 * lab.mass)] * added]
    record = make_record(lab, states, lambda A, omega: -0.5 * growth * (A * omega) ** 2, third)
    found = limited(among("stiffness-softening", "slip"), explain, record, lab.mode())
    assert "stiffness-softening" in found.leading.effects
    assert found.hypotheses[0].probability < 0.95
    assert any("a mass that varies with the motion explains" in caution for caution in found.cautions)
    assert not added or found.in_library < 0.5


def test_added_mass_that_is_not_as_stated_is_told(lab, among):
    """A quarter of the mass, 1.1 times as much in the record: in closed form of a linear mode."""
    rows = lab.bench(levels=3, points=24).rows
    states = [("a", rows, 0.0), ("b", rows, 0.25 * lab.mass)]
    found = limited(
        among("level-offset"), explain, make_record(lab, states, lambda A, omega: 0.0 * A, stated=1.1), lab.mode()
    )
    assert found.in_library < 0.5
    assert any(
        "an added mass that differs from the stated one explains the record better" in caution
        for caution in found.cautions
    )


def test_a_damper_beyond_a_clearance_is_no_damping_with_the_square_of_displacement(lab, among):
    """Energy of c q' beyond x A: c A omega (1 - (2/pi)(asin x + x sqrt(1 - x^2))), in closed form, at two masses."""
    clearance = 0.35 * lab.A

    def loss(A, omega):
        x = np.minimum(clearance / A, 1.0)
        part = 1.0 - (2.0 / np.pi) * (np.arcsin(x) + x * np.sqrt(1.0 - x * x))
        return 0.5j * lab.viscous * omega * part

    rows = lab.bench(levels=4, points=30).rows
    states = [("a", rows, 0.0), ("b", rows, 0.25 * lab.mass)]
    found = limited(
        among("displacement-velocity", "quadratic-displacement"), explain, make_record(lab, states, loss), lab.mode()
    )
    assert found.leading.effects
    assert found.hypotheses[0].probability < 0.95
    assert found.in_library < 0.5
    assert any("a damper that acts beyond a clearance" in caution for caution in found.cautions)


def test_a_joint_that_opens_is_no_stiffness_that_falls_with_a_power(lab, among):
    """Half of what a spring -k beyond x A has, as where one side opens: DenHartog 1931, in closed form."""
    clearance, lost = 0.2 * lab.A, 6.0 * lab.viscous * lab.omega

    def stiffness(A, omega):
        x = np.minimum(clearance / A, 1.0)
        return -0.5 * lost * (1.0 - (2.0 / np.pi) * (np.arcsin(x) + x * np.sqrt(1.0 - x * x)))

    record = make_record(lab, [("a", lab.bench(levels=3, points=30).rows, 0.0)], stiffness)
    found = limited(among("stiffness-softening", "slip"), explain, record, lab.mode())
    assert found.leading.effects
    assert found.in_library < 0.5
    assert any("a joint that opens, beyond a clearance explains the record better" in text for text in found.cautions)


@pytest.mark.parametrize("of", ["amplitude", "sweep", "record"])
def test_noise_of_a_third_harmonic_may_go_with_the_amplitude_or_with_a_range(lab, of, among):
    """A healthy linear rig: twenty times the noise at resonance was "sensor-saturation", or a cause unknown."""
    rows = lab.bench(levels=3, points=40).rows
    record = lab.record(rows, lab.linear(rows), 4)
    A, rng = record.column("amplitude"), np.random.default_rng(9)
    top = {"amplitude": A, "sweep": np.repeat([A[rows.sweep == k].max() for k in range(3)], 40), "record": A.max()}
    phasor = 0.0015 * top[of] * (rng.normal(size=len(A)) + 1j * rng.normal(size=len(A)))
    own = Record(record.table.assign(amplitude_3=np.abs(phasor), phase_3=-np.angle(phasor)))
    read = stated_noise(read_rows(own, lab.mode()))
    wanted = 0.0015 * np.broadcast_to(top[of], A.shape)[read.row]
    # two parts of 120 rows, of which the largest are left out and four are in a combination: 8 %, at three of it
    np.testing.assert_allclose(np.sqrt(np.mean((read.sd_third / wanted) ** 2)), 1.0, rtol=0.25)
    found = limited(among("sensor-saturation"), explain, own, lab.mode())
    assert found.leading.effects == ()
    assert found.in_library > 0.5
    assert not found.unexplained


def test_what_takes_up_all_that_a_new_state_says_is_no_explanation(lab, among):
    """One sweep with added mass reads a tenth less: no other there tells that it was the sweep, and not the mass."""
    rows = lab.bench(levels=3, points=24).rows
    top = lab.bench(levels=1, points=24).rows
    record = make_record(lab, [("a", rows, 0.0), ("b", top, 0.25 * lab.mass)], lambda A, omega: 0.0 * A)
    low = np.where(record.column("added_mass") > 0.0, 0.9, 1.0)
    measured = Record(record.table.assign(amplitude=low * record.column("amplitude")))
    found = limited(among("level-offset"), explain, measured, lab.mode())
    assert found.leading.effects == ("level-offset",)
    assert found.in_library < 0.5
    assert any("the only sweep of its state" in caution for caution in found.cautions)


def test_no_test_is_proposed_where_the_leading_explanation_has_no_resonance(lab, among):
    """Friction of R: below 4 R/pi none is. A new state is tested at a force of the first, to tell mass from force."""
    friction = 0.13 * lab.viscous * lab.omega * lab.A
    rows = lab.bench(levels=3, points=24).rows
    record = make_record(lab, [("a", rows, 0.0)], lambda A, omega: 4j / np.pi * friction / A)
    found = limited(
        among("coulomb-friction", "slip"), explain, Record(record.table.drop(columns="added_mass")), lab.mode()
    )
    assert found.leading.effects == ("coulomb-friction",)
    runs = [run.predicted for run in _predict_runs(found.leading.best, ())]
    assert min(float(run.F[0]) for run in runs) > 1.4 * 4.0 / np.pi * friction  # of the R that was fitted: to 5 %
    heavier = [float(run.F[0]) for run in runs if run.added[0]]
    assert heavier
    assert all(np.isclose(rows.force, force).any() for force in heavier)


def test_frequencies_of_levels_that_alternate_are_told(lab, among):
    """A fifth of a half-bandwidth to either side, the record as noisy as stated: "fits to its noise" was all."""
    rows = lab.bench(levels=5, points=16).rows
    omega = lab.omega * (1.0 + 0.0012 * np.where(rows.sweep % 2, -1.0, 1.0))
    record = lab.record(rows, lab.linear(rows, omega=omega), 3)
    found = limited(among("level-offset", "drift"), diagnose, record, lab.mode(None, None))
    assert found.leading.effects == ()
    assert any("the frequencies of the levels scatter by 0.12%" in caution for caution in found.cautions)


@pytest.mark.parametrize("shaken", [0.0, 12.0])
def test_added_mass_that_is_not_as_stated_is_that_mass(shaken):
    """A fifth more than stated is as if it were stated so, of a force and of a base whose acceleration is 2 m/s^2."""
    omega = np.linspace(2.8, 3.1, 7)
    terms = Terms(10.0, 3.2, (make("viscous", coefficient=0.6),), 1)

    def drive(added):
        return Drive(2.0 * (shaken + added if shaken else 5.0) * np.ones(7), omega, added=added, shaken=shaken)

    off = OTHER_ADDED_MASS.simulate(terms, {"relative": 0.2})
    own, stated = (predict(*pair).P for pair in ((off, np.zeros(7), drive(2.0)), (terms, np.zeros(7), drive(2.4))))
    np.testing.assert_allclose(own, stated, rtol=1e-12)


@pytest.mark.parametrize("sign", [-1.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_two_close_modes_are_no_two_causes(lab, sign, among):
    """A mode on each side, at 2.5 and 4 damping ratios: in closed form; "residual-modes + second-mode, 1.00" before."""
    loss = lab.viscous / (lab.mass * lab.omega)

    def mode(omega, place):
        return lab.mass * ((place * lab.omega) ** 2 - omega**2 + 1j * loss * place * lab.omega * omega)

    def stiffness(A, omega):
        own = mode(omega, 1.0)
        return (
            1.0 / (1.0 / own + 0.4 / mode(omega, 1.0 + 2.0 * loss) + sign * 0.4 / mode(omega, 1.0 - 1.25 * loss)) - own
        )

    record = make_record(lab, [("a", lab.bench(levels=3, points=40).rows, 0.0)], stiffness)
    found = limited(among("residual-modes", "second-mode"), explain, record, lab.mode())
    assert found.in_library < 0.5
    assert any("a close mode on each side of the simulated one explains" in caution for caution in found.cautions)


def test_a_force_cell_that_is_not_linear_is_told(lab, among):
    """The largest of four forces is 15 % above its reading, others by the square of the force: closed form."""
    rows = lab.bench(levels=4, points=20).rows
    gain = 1.0 + 0.15 * (rows.force / rows.force.max()) ** 2
    record = lab.record(rows, lab.linear(rows, gain=gain), 3)
    found = limited(among("level-offset", "sensor-saturation", "force-dropout"), explain, record, lab.mode())
    assert found.in_library < 0.5
    sentence = "a force that is read wrong in proportion to a power of itself explains"
    assert any(sentence in caution for caution in found.cautions)


@pytest.mark.parametrize(
    ("true", "stated"), [(0.0, 0.5), (0.5, -0.5), (0.5, 0.0), pytest.param(0.5, 3.0, marks=pytest.mark.slow)]
)
def test_a_sweep_rate_that_is_not_as_stated_is_told_with_what_it_was(lab, true, stated):
    """Rates in squared half-bandwidths, the motion by the generator's equations; lesser causes were blamed, or flagged.

    The rate comes out within a tenth: noise of a hundredth leaves some per cent.
    """
    unit = (lab.xi * lab.omega) ** 2
    bench = lab.bench(levels=2, points=40)
    rows = replace(bench.rows, rate=np.full(len(bench.rows.omega), true * unit))
    cells = lab.cells(*true_record(*applied((), replace(bench, rows=rows))))
    mode = lab.mode(rig=Rig(rate=stated * unit / RAD_S_PER_HZ))
    library = {name: CATALOGUE[name] for name in ("sweep-rate", "planar-coupling")}
    found = limited(library, explain, lab.record(rows, cells, 3), mode)
    told = [caution for caution in found.cautions if "stated" in caution and "explains the record better" in caution]
    assert len(told) == 1
    assert found.in_library < 0.5
    if true:
        rate = float(re.search(r"a sweep rate of (\S+) Hz/s in sweep A, in place of the stated one", told[0])[1])
        np.testing.assert_allclose(rate * RAD_S_PER_HZ, true * unit, rtol=0.1)
    else:
        assert "a test that dwelt, against the stated sweep rate, explains" in told[0]


@pytest.mark.parametrize("same", [False, True])
@pytest.mark.parametrize("factor", [1.2, pytest.param(1.0 / 1.2, marks=pytest.mark.slow)])
def test_the_mass_of_one_state_that_is_not_as_stated_is_told(lab, factor, same):
    """The second of three states weighs a fifth more or less than stated, of one stiffness or of its own."""
    given = []
    for number, (mass, ratio) in enumerate(((1.0, 1.0), (1.3, 0.9), (1.7, 0.8))):
        ratio = mass**-0.5 if same else ratio
        stated = lab.mass * mass * (factor if number == 1 else 1.0)
        actual, omega = lab.mass * mass, lab.omega * ratio
        rows = lab.bench(levels=2, points=20).rows
        rows = replace(rows, omega=rows.omega * ratio)
        Z = actual * (omega**2 - rows.omega**2) + 1j * lab.viscous * rows.omega
        hertz = (np.sqrt(lab.mass / stated) * lab.omega if same else omega) / RAD_S_PER_HZ
        measured = lab.record(rows, lab.cells(rows.force / np.abs(Z), np.angle(Z)), number)
        given.append((measured, replace(lab.mode(), frequency=hertz, mass=stated)))
    library = {name: CATALOGUE[name] for name in ("amplitude-scale", "natural-frequency", "level-offset")}
    (record, mode), *states = given
    found = limited(library, explain, record, mode, states)
    told = [caution for caution in found.cautions if "explains the record better" in caution]
    sizes = [re.search(r"\(mass ([-+.\d]+), state 2\)", caution) for caution in told]
    assert len(told) == 1
    assert sizes[0], told
    np.testing.assert_allclose(1.0 + float(sizes[0][1]), 1.0 / factor, rtol=0.02)
