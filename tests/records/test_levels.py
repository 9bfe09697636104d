"""Levels against each other and the mode file: wrong gains, forces, structures, of modes in closed form."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pandas as pd
import pytest
from audit_cases import Bench, clean, measured, record_of

import damping as dp
from damping.records import audit
from damping.records.check_levels import DEEP_FALL, FALLEN, FALLING, FORCE_STEP, _find_fall

FORCES = {"L1": 0.5, "L2": 1.5, "L3": 3.0, "L4": 4.5}
#: Friction as well as viscous damping: resonant amplitudes grow faster than the force.
MODE = dp.Mode(name="m", frequency=18.0, mass=0.12, damping={"viscous": 0.1086})


def sweeps(forces: dict[str, float] = FORCES, phase: bool = True) -> pd.DataFrame:
    """F = |K - M omega^2 + i (c omega + D/A)| A with D of 0.1 N: A = (-D S + root(F^2 - (D X)^2))/.. in closed form."""
    omega = 2.0 * np.pi * np.linspace(17.6, 18.4, 33)
    spring = 0.12 * ((2.0 * np.pi * 18.0) ** 2 - omega**2)
    quadrature = 0.1086 * omega
    rng, tables = np.random.default_rng(4), []
    for sweep, F in forces.items():
        # |X A + i (q A + D)| = F is a quadratic in A
        a, b, c = spring**2 + quadrature**2, 2.0 * quadrature * 0.1, 0.01 - F**2
        A = (-b + np.sqrt(b**2 - 4.0 * a * c)) / (2.0 * a)
        noisy = A * np.exp(0.01 * rng.normal(size=len(A)))
        table = {"sweep": sweep, "force": F, "frequency": omega / (2.0 * np.pi), "amplitude": noisy}
        lag = np.arctan2(quadrature * A + 0.1, spring * A) + 0.01 * rng.normal(size=len(A))
        tables.append(pd.DataFrame(table | ({"phase": lag} if phase else {})))
    return pd.concat(tables, ignore_index=True)


@pytest.mark.parametrize("phase", [True, False])
def test_levels_of_one_gain_are_right(phase):
    assert audit(record_of(sweeps(phase=phase)), MODE).verdict == "ok"


@pytest.mark.parametrize("phase", [True, False])
@pytest.mark.parametrize("level", FORCES)
@pytest.mark.parametrize("gain", [0.1, 0.5, 2.0, 10.0])
def test_a_level_of_another_gain_is_named(level, gain, phase):
    table = sweeps(phase=phase)
    table.loc[table["sweep"] == level, "amplitude"] *= gain
    (found,) = audit(record_of(table), MODE).findings
    assert found.check in ("level-offset", "amplitude-falls")
    assert found.sweeps == (level,)
    # a parabola, without phases, is up to 6 % off the lowest level, half of whose damping is friction
    factor = float(found.what.split("its readings are ")[1].split(" times")[0])
    assert factor == pytest.approx(max(gain, 1.0 / gain), rel=0.1 if not phase else 0.05)
    assert ("times too large, or its force" in found.what) == (gain > 1.0)
    assert found.verdict == "refuse" or gain in (0.5, 2.0)  # what leaves no law to be found, or falls


@pytest.mark.parametrize("pair", [("L2", "L3"), ("L1", "L4"), ("L3", "L4")])
def test_forces_of_two_levels_that_are_exchanged(pair):
    table = sweeps()
    exchanged = FORCES | {pair[0]: FORCES[pair[1]], pair[1]: FORCES[pair[0]]}
    (found,) = audit(record_of(table.assign(force=table["sweep"].map(exchanged))), MODE).findings
    assert (found.check, found.verdict) == ("amplitude-falls", "refuse")
    assert set(found.sweeps) == set(pair)
    assert "exchanged" in found.advice


@pytest.mark.parametrize("steps", [1, 2, 4])
def test_small_readings_of_an_instrument_with_few_steps_are_no_gain(steps):
    """The lowest level is read in ``steps`` steps of an instrument, the highest in 12 times as many."""
    table = sweeps()
    step = table["amplitude"][table["sweep"] == "L1"].max() / steps
    whole = np.maximum(np.round(table["amplitude"] / step), 1.0)
    rng = np.random.default_rng(6)
    read = table.assign(amplitude=whole * step * np.exp(0.01 * rng.normal(size=len(table))))
    assert "level-offset" not in [one.check for one in audit(record_of(read), MODE).findings]


def test_a_parabola_through_a_bent_resonance_is_of_no_gain():
    """Without phases a joint that falls by three half-bandwidths implies 0.4 of the mass at its highest level."""
    bent = {"law": "slip", "zeta": 0.02, "levels": 4, "rows": 13, "span": (-8.0, 2.0), "bend": -3.0, "down": True}
    for seed in range(6):
        bench = Bench(**bent, phase=False, noise=0.008, seed=seed)
        found = audit(record_of(measured(clean(bench), bench)), bench.mode)
        assert "level-offset" not in [one.check for one in found.findings]


@pytest.mark.parametrize(("mode", "sure"), [(MODE, True), (None, False)])
def test_of_two_levels_the_mode_file_tells_which_is_wrong(mode, sure):
    table = sweeps({"A": 1.5, "B": 3.0})
    table.loc[table["sweep"] == "B", "amplitude"] *= 1.5
    (found,) = audit(record_of(table), mode).findings
    assert (found.check, found.verdict) == ("level-offset", "caution")
    assert ("or those of the other level" in found.what) != sure
    assert found.sweeps == ("B",) or not sure


def test_a_level_far_off_is_refused_but_where_it_can_be_named():
    """Readings of 2.5 times the others' gain: no law can be ranked on them, and a diagnosis names the level."""
    table = sweeps({"A": 1.0, "B": 2.0, "C": 4.0})
    table.loc[table["sweep"] == "C", "amplitude"] *= 2.5
    findings = audit(record_of(table), MODE)
    assert [(one.check, one.verdict) for one in findings.findings] == [("level-offset", "refuse")]
    with pytest.raises(dp.Refused, match="sweep C implies a mass"):
        findings.require()
    assert findings.require(diagnosed=True) is findings


@pytest.mark.parametrize("added", [0.06, 0.0])
def test_a_level_with_an_added_mass_is_not_to_be_left_out(added):
    """The force that reaches the structure is 1/1.5 at the frequency of the heavier state: no fault of its readings."""
    table = sweeps({"A": 1.0, "B": 2.0, "M": 2.0})
    heavier = table["sweep"] == "M"
    table.loc[heavier, "frequency"] /= np.sqrt(1.0 + added / MODE.mass)
    table.loc[heavier, "amplitude"] /= 1.5
    (found,) = audit(record_of(table.assign(added_mass=np.where(heavier, added, 0.0))), MODE).findings
    assert (found.check, found.sweeps) == ("level-offset", ("M",))
    assert ("the force path depends on frequency or the mass is not as stated" in found.what) == (added > 0.0)
    assert ("leave it out" in found.advice) == (added == 0.0)


def test_masses_that_the_record_states_of_each_level_are_no_gain():
    """Half of the levels move twice the mass of the mode file, and say so in the column."""
    omega = 2.0 * np.pi * np.linspace(17.0, 19.0, 41)
    rng, tables = np.random.default_rng(5), []
    for sweep, mass in (("A", 1.0), ("B", 1.0), ("C", 2.0), ("D", 2.0)):
        Z = mass * ((2.0 * np.pi * 18.0) ** 2 - omega**2 + 2j * 0.01 * 2.0 * np.pi * 18.0 * omega)
        table = {"sweep": sweep, "force": 1.0, "frequency": omega / (2.0 * np.pi), "amplitude": 1.0 / np.abs(Z)}
        table["amplitude"] *= np.exp(0.01 * rng.normal(size=41))
        tables.append(pd.DataFrame(table | {"phase": np.angle(Z), "mass": mass}))
    whole = pd.concat(tables, ignore_index=True)
    mode = dp.Mode(name="m", frequency=18.0, mass=1.0)
    assert audit(record_of(whole), mode).verdict == "ok"
    assert [one.check for one in audit(record_of(whole.drop(columns="mass")), mode).findings] != []


@pytest.mark.parametrize("phase", [True, False])
@pytest.mark.parametrize(("frequency", "mass", "both"), [
    (18.0, 0.12, False), (18.0, 0.13, False), (17.0, 0.12, False), (17.0, 0.122, False), (17.0, 0.14, True),
    (19.5, 0.104, True),
])  # fmt: skip
def test_a_mode_file_of_another_structure_is_doubted_by_frequency_and_mass(frequency, mass, both, phase):
    """A mass alone may be of a gain; a frequency that no level moves towards is of no joint, with a mass or without."""
    mode = dp.Mode(name="m", frequency=frequency, mass=mass, damping=MODE.damping)
    found = audit(record_of(sweeps(phase=phase)), mode).findings
    assert [(finding.check, finding.verdict) for finding in found] == [("beyond-model", "caution")] * (
        frequency != 18.0
    )
    both &= phase  # without phases a mass is known to a factor only
    for one in found:
        assert f"resonance at 18 Hz, {frequency:g} Hz" in one.what
        # 0.12 but for the noise of 1 %
        assert (f"a mass of 0.1202, {mass:g} there" if both else "half-power bandwidths away") in one.what
    loose = dp.Mode(name="m", frequency=frequency, mass=mass, tolerance={"frequency": 0.03, "mass": 0.05})
    assert audit(record_of(sweeps(phase=phase)), loose).verdict == "ok"


@pytest.mark.parametrize("law", ["linear", "velocity-squared", "friction"])
@pytest.mark.parametrize("gain", [1.0, 2.0**-0.5])
def test_levels_without_phases_that_agree_on_a_mass_tell_of_a_gain(law, gain):
    """(F/A)^2 = (K - M omega^2)^2 + h^2 in closed form: a parabola where h is of no amplitude."""
    M, omega_n, tables, rng = 2.0, 2.0 * np.pi * 30.0, [], np.random.default_rng(6)
    for F in (1.0, 2.0, 4.0):
        if law == "velocity-squared":  # h A of 0.02 K A^2/a, so that the resonant amplitude is root(F a/(0.02 K))
            A = np.sqrt(F * 0.0005 / (0.02 * M * omega_n**2)) * np.linspace(0.3, 0.999, 20)
            h = 0.02 * M * omega_n**2 * A / 0.0005
        elif law == "friction":
            A = (F - 0.6) / (0.01 * M * omega_n**2) * np.linspace(0.3, 0.999, 20)
            h = 0.01 * M * omega_n**2 + 0.6 / A
        else:
            A = F / (0.02 * M * omega_n**2) * np.linspace(0.3, 0.999, 20)
            h = np.full(20, 0.02 * M * omega_n**2)
        spring = np.sqrt((F / A) ** 2 - h**2)
        for side in (-1.0, 1.0):
            frequency = np.sqrt(omega_n**2 + side * spring / M) / (2.0 * np.pi)
            noisy = gain * A * np.exp(0.002 * rng.normal(size=20))
            tables.append(pd.DataFrame({"sweep": f"{F}", "force": F, "frequency": frequency, "amplitude": noisy}))
    mode = dp.Mode(name="plate", frequency=30.0, mass=M)
    whole = pd.concat(tables).sort_values(["force", "frequency"], ignore_index=True)
    found = [str(one) for one in audit(record_of(whole), mode).findings]
    # a parabola that is none gives a mass to a factor: 0.91 of it here at every level, 1.5 to 1.05 of it with friction
    assert ["times its mass (rms for peak?)" in one for one in found] == [True] * (gain < 1.0 and law != "friction")


@pytest.mark.parametrize(("frequency", "hertz", "named"), [
    (7.4, [7.3, 7.3, 7.3], False),  # 0.7 bandwidths
    (7.55, [7.3, 7.3, 7.3], True),
    (7.05, [7.3, 7.3, 7.3], True),
    (8.0, [7.302, 7.3, 7.301], True),
    (7.55, [7.3, 7.25, 7.2], False),  # softens: at less than the lowest level it may be there
    (7.05, [7.3, 7.35, 7.4], False),  # hardens
    (8.0, [7.3, 7.28, 7.26], True),  # 15 times what it moved
    (7.55, [7.3, 7.32, 7.34], True),  # hardens away from it; the highest is 1.4 bandwidths short
    (7.55, [7.2, 7.35, 7.5], False),  # comes near it
    (7.55, [7.3], False),  # of one level nothing tells whether it moves
    (7.8, [7.3], True),
])  # fmt: skip
def test_a_frequency_that_no_level_nears_or_moves_towards_is_doubted(frequency, hertz, named):
    """Peaks of a mode of 1 % damping: bandwidths are 2 %, the mode file's tolerance is 0.1 %."""
    force = 10.0 * 2.0 ** np.arange(len(hertz))
    amplitude = force / (2.0 * 250.0 * 0.01 * (2.0 * np.pi * np.array(hertz)) ** 2)
    labels = [f"F{k}" for k in range(len(hertz))]
    peaks = pd.DataFrame({"sweep": labels, "force": force, "frequency": hertz, "amplitude": amplitude})

    def doubt(**known):
        found = audit(record_of(peaks), dp.Mode(name="m", frequency=frequency, mass=250.0, **known)).findings
        return [(finding.check, finding.verdict) for finding in found]

    assert doubt() == [("beyond-model", "caution")] * named
    assert doubt(tolerance={"frequency": 0.1 / 5.0}) == []  # which five times reach 8 Hz
    assert doubt(tolerance={"from_record": True}) == []
    assert doubt(damping={"slip": {"stiffness": 1e5, "limit": 1e-3}}) == []  # the frequency is that of the stuck state


@pytest.mark.parametrize("seed", range(6))
def test_the_deepest_fall_is_that_of_all_pairs(seed):
    """Pairs of levels a tenth of the force apart, one by one; falls count from 30 % of them, or with an odd level.

    Fewer are doubted if one is deep.
    """
    rng = np.random.default_rng(seed)
    F = np.sort(np.exp(rng.uniform(0.0, 1.0, 9)))
    table = pd.DataFrame({"sweep": list("abcdefghi"), "force": F, "amplitude": np.exp(rng.uniform(-0.3, 0.3, 9))})
    A = table["amplitude"].to_numpy()
    pairs = [(i, j) for i in range(9) for j in range(9) if F[j] > FORCE_STEP * F[i]]
    falls = [(i, j) for i, j in pairs if A[j] < FALLEN * A[i]]
    deepest = min(falls, key=lambda pair: A[pair[1]] / A[pair[0]], default=None)
    odd = {"a"} if seed % 2 else set()
    enough = len(falls) >= FALLING * len(pairs) or any("abcdefghi"[k] in odd for pair in falls for k in pair)
    deep = bool(falls) and A[deepest[1]] < DEEP_FALL * A[deepest[0]]
    assert _find_fall(table, odd) == (deepest if enough or deep else None, bool(falls) and enough)


def test_pairs_of_many_levels_take_little_memory():
    """Three thousand levels are four million pairs, of which a list would take 400 MB; a row of them takes 24 kB."""
    force, amplitude = np.geomspace(1.0, 100.0, 3000), np.linspace(2.0, 1.0, 3000)
    table = pd.DataFrame({"sweep": "s", "force": force, "amplitude": amplitude})
    tracemalloc.start()
    try:
        assert _find_fall(table, set()) == ((0, 2999), True)
        assert tracemalloc.get_traced_memory()[1] < 1e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("k", range(4))
def test_amplitudes_of_neighbouring_levels_exchanged_are_doubted(k):
    """One fall among ten pairs of levels by more than any scatter; three of the four were passed."""
    F = np.array([2.0, 4.0, 8.0, 12.0, 20.0])
    A = 1e-4 * F**0.8
    table = pd.DataFrame({"sweep": list("abcde"), "force": F, "frequency": 20.0, "amplitude": A})
    assert not audit(dp.Record(table)).findings
    A[[k, k + 1]] = A[[k + 1, k]]
    found = audit(dp.Record(table.assign(amplitude=A))).findings
    assert [(finding.check, finding.verdict) for finding in found] in (
        [("amplitude-falls", "caution")],
        [("outlier", "caution")],
    )


def test_two_exchanged_dwells_do_not_excuse_a_level_three_times_too_large():
    """A fall that is only doubted leaves the refusal of another level's gain as it is."""
    table = sweeps()
    lowest = table.loc[table["sweep"] == "L1", "amplitude"].max()
    table.loc[table["sweep"] == "L4", "amplitude"] *= 3.0
    dwells = pd.DataFrame({"sweep": ["D1", "D2"], "force": [0.15, 0.25], "frequency": 18.0, "phase": np.pi / 2.0})
    dwells["amplitude"] = lowest * np.array([0.6, 0.3])
    (found,) = audit(record_of(pd.concat([dwells, table], ignore_index=True)), MODE).findings
    assert (found.verdict, found.sweeps) == ("refuse", ("L4",))
    assert "its readings are 3 times too large" in found.what
