"""Steady states of the generator against closed forms, balances of energy, and a plain long dwell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from damping_validation.generator.balance import TrueRows, plain_rows, sweep_phasor
from damping_validation.generator.laws import Partner, Side, Structure, TrueJoint, TrueLaw
from damping_validation.generator.steady import STEPS, TrueMotion, TrueState, guesses, steady, steady_state

from .conftest import A_TOP, MASS, OMEGA, VISCOUS, XI

K = MASS * OMEGA**2
UNIT = 2 * XI * K  # stiffness that moves the resonance by XI
DISSIPATIVE = {
    "displacement": TrueLaw("displacement", 0.5 * VISCOUS * OMEGA),
    "velocity-squared": TrueLaw("velocity-squared", 0.5 * VISCOUS / (OMEGA * A_TOP)),
    "displacement-velocity": TrueLaw("displacement-velocity", 0.5 * VISCOUS / A_TOP),
    "quadratic-displacement": TrueLaw("quadratic-displacement", 2 * VISCOUS / A_TOP**2),
    "coulomb": TrueLaw("coulomb", 0.3),
}
ELASTIC = {
    "cubic": TrueLaw("cubic", 1.0 * UNIT / A_TOP**2),
    "softening": TrueLaw("cubic", -0.5 * UNIT / A_TOP**2),
    "odd-square": TrueLaw("odd-square", UNIT / A_TOP),
    "quintic": TrueLaw("quintic", UNIT / A_TOP**4),
    "clearance": TrueLaw("clearance", UNIT, 0.3 * A_TOP),
}
JOINTS = {
    "slip": TrueJoint("jenkins", UNIT, (0.3 * A_TOP,), (1.0,)),
    "iwan": TrueJoint("jenkins", UNIT, tuple(np.linspace(0.05, 1, 6) * A_TOP), (1 / 6,) * 6),
    "bouc-wen": TrueJoint("bouc-wen", UNIT, (0.3 * A_TOP,), (1.0,)),
}
EXTRAS = {
    **{name: {"laws": (law,)} for name, law in {**DISSIPATIVE, **ELASTIC}.items()},
    **{name: {"joints": (joint,)} for name, joint in JOINTS.items()},
}


#: Steps of a cycle where two motions of the same steps are compared.
COARSE = STEPS // 4


def phasor(structure: Structure, rows: TrueRows, steps: int = STEPS) -> np.ndarray:
    return steady(structure, rows, guesses(structure, rows), steps)[0]


def test_a_linear_mode_moves_as_its_receptance(mode, rows):
    exact = rows.force / (K - MASS * rows.omega**2 + 1j * VISCOUS * rows.omega)
    # RK4 shifts frequencies by (2 pi/256)^4/120 = 3e-9; over the half-width .01 that is 3e-7 of the response
    np.testing.assert_allclose(phasor(mode, rows), exact, rtol=1e-6, atol=0)


def test_a_drive_at_an_angle_moves_as_the_coupled_planes_of_the_report(mode, rows):
    """Equations 3.1.24 to 3.1.28: M p'' + C p' + K_p p + K_py y = F sin wt, M y'' + C y' + K_y y + K_yp p = 0."""
    angle, second = 0.5, OMEGA * 1.02
    sine, cosine = np.sin(angle), np.cos(angle)
    side = Side(second, VISCOUS / (2 * MASS * second), sine, sine, across=cosine)
    structure = replace(mode, share=cosine, across=-sine, sides=(side,))
    along, _, across = steady(structure, rows, guesses(structure, rows))
    k_p, k_y = MASS * OMEGA**2, MASS * second**2
    pp, yy = k_p * cosine**2 + k_y * sine**2, k_p * sine**2 + k_y * cosine**2
    py = (k_y - k_p) * sine * cosine
    dynamic = -MASS * rows.omega**2 + 1j * VISCOUS * rows.omega
    determinant = (pp + dynamic) * (yy + dynamic) - py**2
    np.testing.assert_allclose(
        along, rows.force * (yy + dynamic) / determinant, rtol=1e-6, atol=0
    )  # as the linear mode
    np.testing.assert_allclose(across, -py * rows.force / determinant, rtol=1e-5, atol=0)  # a sum of two receptances


def test_other_modes_add_their_receptances(mode, rows):
    side = Side(2 * OMEGA, 0.005, 1.0, 0.3)
    own = rows.force / MASS / (side.omega**2 - rows.omega**2 + 2j * side.zeta * side.omega * rows.omega)
    # each part to 1e-6 of itself (the linear mode), and their sum nowhere below a tenth of the larger
    expected = phasor(mode, rows) + 0.3 * own
    np.testing.assert_allclose(phasor(replace(mode, sides=(side,)), rows), expected, rtol=1e-5, atol=0)


@pytest.mark.parametrize("ratio", [0.7, 0.85, 1.15, 1.3])
def test_coulomb_friction_moves_as_den_hartog_found(ratio):
    """Den Hartog (1931): peak x0 = (F/k) sqrt(V^2 - (U Ff/F)^2), V = 1/(1-r^2), U = sin(pi/r)/(r (1 + cos(pi/r)))."""
    friction = 0.2
    V, U = 1 / (1 - ratio**2), np.sin(np.pi / ratio) / (ratio * (1 + np.cos(np.pi / ratio)))
    expected = np.sqrt(V**2 - (U * friction) ** 2)
    peaks = []
    for steps in (STEPS, 2 * STEPS):
        structure = Structure(1.0, 1.0, 0.0, (TrueLaw("coulomb", friction),))
        motion = TrueMotion(structure, plain_rows(np.zeros(1, int), np.ones(1), np.array([ratio])), steps)
        samples = np.empty((steps, 1))
        motion.cycle(steady_state(motion, [np.array([V - 0.2j])]), samples)
        peaks.append(float(np.max(np.abs(samples))))
    # first order: +-1.5 steps of smoothing (.04) times friction over elastic force (at most .15), over a few
    assert peaks[0] == pytest.approx(expected, rel=1.5e-3)
    # without the first order; a peak lies between samples to (pi/256)^2/2 = 7.5e-5
    assert 2 * peaks[1] - peaks[0] == pytest.approx(expected, rel=1.5e-4)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_cubic_spring_follows_its_backbone_to_the_third_harmonic(mode, rows, way):
    """|k (1 + 3/4 e A^2 + 3/128 e^2 A^4) - M w^2 + i c w| A = F with e = k3/k: Duffing's third harmonic is e A^3/32."""
    e = way * 0.5 * XI / A_TOP**2
    structure = replace(mode, laws=(TrueLaw("cubic", e * K),))
    X = phasor(structure, rows)
    A = np.abs(X)
    Z = K * (1 + 3 / 4 * e * A**2 + 3 / 128 * e**2 * A**4) - MASS * rows.omega**2 + 1j * VISCOUS * rows.omega
    # next order e^3 A^6 ~ 1e-7 over the half-width .01: 1e-5; RK4 adds 1e-6; near the bend errors of A grow tenfold
    np.testing.assert_allclose(Z * X, rows.force + 0j, rtol=2e-5, atol=0)


@pytest.mark.parametrize("name", EXTRAS)
def test_the_work_of_the_drive_is_what_is_lost_in_a_cycle(mode, rows, name):
    """The integral of F sin(wt) q' over a cycle equals that of (c q' + f) q', and elastic forces do no work."""
    structure = replace(mode, **EXTRAS[name])
    motion = TrueMotion(structure, rows)
    state = steady_state(motion, guesses(structure, rows))
    put, lost, kept = _work(motion, state)
    # sampled at 256 points: (2 pi/256)^2 ~ 6e-4 where a force has corners, a few times that where it jumps
    np.testing.assert_allclose(put, lost + kept, rtol=3e-3, atol=0)
    if name in ELASTIC:
        np.testing.assert_allclose(kept, 0.0, rtol=0, atol=1e-3 * np.max(lost))
    else:
        assert np.all(kept > -1e-3 * put)


def _work(motion: TrueMotion, state: TrueState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Work of drive, of viscous damping and of the other forces over a cycle, row by row."""
    structure, rows = motion.structure, motion.rows
    put, lost, kept = np.zeros((3, rows.omega.size))
    for n in range(STEPS):
        drive = np.sin(2 * np.pi * (n + np.array([0.0, 0.5, 1.0])) / STEPS)
        q, v, dt = state.q[0], state.v[0], 2 * np.pi / STEPS / rows.omega
        other = sum((law.force(q, v, np.sign(v)) for law in structure.laws), np.zeros_like(q))
        other = other + sum(joint.force(z, q) for joint, z in zip(structure.joints, state.z, strict=True))
        put += (rows.force * drive[0] * v * dt)[0]
        lost += (structure.viscous * v**2 * dt)[0]
        kept += (other * v * dt)[0]
        for partner, w in zip(structure.partners, state.v[1:], strict=True):
            kept += (partner_loss(partner, v, w) * dt)[0]
        state = motion.step(state, tuple(drive))
    return put, lost, kept


def partner_loss(partner: Partner, v: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Power that a partner's dashpot or resistor turns into heat."""
    share = {"absorber": partner.strength, "memory": partner.strength, "heated-spring": 0.0}.get(partner.kind, 1.0)
    stroke = w - v if partner.kind == "absorber" else w
    return MASS * share * 2 * partner.zeta * partner.omega * stroke**2


PARTNERS = {
    "absorber": Partner("absorber", 1.01 * OMEGA, 0.01, 4e-4),
    "tank": Partner("absorber", 0.99 * OMEGA, 0.01, 4e-4, cubic=-0.4 * 0.01 / (50 * A_TOP) ** 2),
    "gyroscopic": Partner("gyroscopic", 1.01 * OMEGA, 0.01, 0.01),
    "circuit": Partner("circuit", 0.99 * OMEGA, 0.02, 0.02),
    "memory": Partner("memory", 1.5 * OMEGA, 2.0, 0.02),
    "heated-spring": Partner("heated-spring", 0.03 * OMEGA, 1.0, 4 * XI * (OMEGA / A_TOP) ** 2),
}


@pytest.mark.parametrize("name", PARTNERS)
def test_the_work_of_the_drive_is_what_the_mode_and_its_partner_lose(mode, rows, name):
    structure = replace(mode, partners=(PARTNERS[name],))
    motion = TrueMotion(structure, rows)
    put, lost, kept = _work(motion, steady_state(motion, guesses(structure, rows)))
    # smooth signals sampled over whole cycles; the heated spring's temperature ripples by (.03/2)^2 and does 1e-4 work
    np.testing.assert_allclose(put, lost + kept, rtol=1e-3, atol=0)


@pytest.mark.parametrize("kind", ["absorber", "gyroscopic", "circuit", "memory"])
def test_a_linear_partner_moves_the_mode_as_its_matrices_say(mode, rows, kind):
    """(K - w^2 M + i w C) (q, x) = (F, 0), solved as two complex equations a row."""
    p, w = PARTNERS[kind], rows.omega
    own = K - MASS * w**2 + 1j * VISCOUS * w
    k, c = p.strength * MASS * p.omega**2, p.strength * MASS * 2 * p.zeta * p.omega
    partner = p.omega**2 - w**2 + 2j * p.zeta * p.omega * w  # over the main mass
    coupling, back, more = {
        "absorber": (-(k + 1j * w * c), -(k + 1j * w * c) / p.strength / MASS, k + 1j * w * c),
        "gyroscopic": (MASS * p.strength * p.omega * 1j * w, -p.strength * p.omega * 1j * w, 0.0),
        "circuit": (-k, -p.strength * p.omega**2, 0.0),
        "memory": (-k, -(p.omega**2), k),
    }[kind]
    exact = rows.force / (own + more - coupling * back / partner)
    # RK4 as for the linear mode, where the pair's resonances lie .01 apart
    np.testing.assert_allclose(phasor(replace(mode, partners=(p,)), rows), exact, rtol=3e-6, atol=0)


def test_added_mass_lowers_the_resonance_and_leaves_the_stiffness(mode, rows):
    heavier = replace(rows, added=np.full(rows.omega.size, 0.05))
    exact = rows.force / (K - (MASS + 0.05) * rows.omega**2 + 1j * VISCOUS * rows.omega)
    np.testing.assert_allclose(phasor(mode, heavier), exact, rtol=1e-6, atol=0)  # as for the linear mode


def test_the_third_harmonic_of_a_cubic_spring(mode, rows):
    """k3 A^3/4 at three times the frequency against k - 9 M w^2 + 3 i c w (first order in k3)."""
    k3 = UNIT / A_TOP**2
    structure = replace(mode, laws=(TrueLaw("cubic", k3),))
    first, third, across = steady(structure, rows, guesses(structure, rows))
    exact = k3 * np.abs(first) ** 3 / 4 / np.abs(K - 9 * MASS * rows.omega**2 + 3j * VISCOUS * rows.omega)
    # next order: 3/32 of k3 A^2/k <= .02
    np.testing.assert_allclose(np.abs(third), exact, rtol=5e-3, atol=1e-9 * A_TOP)
    np.testing.assert_array_equal(across, 0.0)


@pytest.mark.parametrize("share", [0.002, 0.5])
def test_a_moving_frequency_leaves_what_the_equation_of_motion_says(mode, share):
    """M q'' + c q' + k q = F exp(i theta(t)) integrated by another method through the whole sweep."""
    rate = share * (XI * OMEGA) ** 2
    omega = OMEGA * (1 + np.linspace(-5 * XI, 5 * XI, 9))
    rows = plain_rows(np.zeros(9, int), np.full(9, 4.0), omega)
    swept = sweep_phasor(mode, replace(rows, rate=np.full(9, rate)))
    if share < 0.01:  # so slow that it is a dwell: first order in the rate over the square of the half-width
        np.testing.assert_allclose(swept, phasor(mode, rows), rtol=2 * share, atol=0)
        return

    def moved(t, y):
        theta = omega[0] * t + rate * t**2 / 2
        return [y[1], (4.0 * np.exp(1j * theta) - VISCOUS * y[1] - K * y[0]) / MASS]

    start = 4.0 / (K - MASS * omega[0] ** 2 + 1j * VISCOUS * omega[0])
    times = (omega - omega[0]) / rate
    y = solve_ivp(moved, (0.0, times[-1]), [start, 1j * omega[0] * start], "DOP853", times, rtol=1e-8, atol=1e-12).y[0]
    exact = y * np.exp(-1j * (omega[0] * times + rate * times**2 / 2))
    # z'' dropped: z'/(2 omega z), some XI of the amplitude
    np.testing.assert_allclose(swept, exact, rtol=0, atol=2 * XI * np.max(np.abs(exact)))


@pytest.mark.parametrize("name", ["coulomb", "cubic", "slip", "bouc-wen"])
def test_shooting_finds_what_a_long_dwell_from_rest_reaches(name):
    """Twenty per cent damping: 13 cycles leave exp(-2 pi .2 13) = 8e-8 of the transient."""
    rows = plain_rows(np.zeros(5, int), np.full(5, 4.0), OMEGA * np.array([0.9, 0.97, 1.0, 1.03, 1.1]))
    structure = Structure(MASS, OMEGA, 20 * VISCOUS, **EXTRAS[name])
    structure = replace(structure, laws=tuple(replace(law, coefficient=4 * law.coefficient) for law in structure.laws))
    motion, q = TrueMotion(structure, rows, COARSE), np.zeros((1, 1, 5))
    rest = TrueState(q, q, tuple(joint.start(q[0]) for joint in structure.joints))
    state = rest
    for _ in range(13):
        state = motion.cycle(state)[0]
    dwelt = motion.harmonics(state)[0]
    # the transient, and what follows Newton's last step of at most 1e-6
    np.testing.assert_allclose(phasor(structure, rows, COARSE), dwelt, rtol=5e-6, atol=0)


@pytest.mark.parametrize("bend", ["hardening", "softening"])
def test_sweeps_stay_on_their_branch_for_as_long_as_it_exists(mode, bend):
    """Where two states are stable, the sweep that runs the way the resonance bends has the larger amplitude."""
    law = TrueLaw("cubic", (1 if bend == "hardening" else -1) * 6 * UNIT / A_TOP**2)
    structure = replace(mode, laws=(law,))
    omega = OMEGA * (1 + np.linspace(-8 * XI, 8 * XI, 33))
    one = np.zeros(33, int)
    up, down = (plain_rows(one, np.full(33, 4.0), omega[::way], up=way > 0) for way in (1, -1))
    rising, falling = (np.abs(phasor(structure, one_way, COARSE)) for one_way in (up, down))
    falling = falling[::-1]
    apart = np.abs(rising - falling) > 1e-6 * falling  # elsewhere both are the one state
    assert 1 < np.count_nonzero(apart) < 20
    assert np.all((rising > falling)[apart]) if bend == "hardening" else np.all((rising < falling)[apart])
    assert np.all(np.diff(np.flatnonzero(apart)) == 1)


def test_a_clipping_sensor_shows_the_clipped_sine(mode, rows):
    """(2/pi)(asin r + r sqrt(1 - r^2)) of the amplitude, r = clip/A."""
    clip = 0.4 * A_TOP
    A = np.abs(phasor(mode, rows))
    r = np.minimum(clip / A, 1.0)
    expected = A * 2 / np.pi * (np.arcsin(r) + r * np.sqrt(1 - r**2))
    # 256 samples of a sine with corners: (2 pi/256)^2
    np.testing.assert_allclose(np.abs(phasor(mode, replace(rows, clip=clip))), expected, rtol=6e-4, atol=0)
