"""The examples of CONTRIBUTING.md, as they stand there: a force and an effect from one file and one catalogue line."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad

from damping.effects import CATALOGUE as EFFECTS
from damping.forces import CATALOGUE as FORCES
from damping.forces import from_damping
from damping.forces.powers import energy_per_cycle
from damping.gap.diagnose import diagnose
from damping.infer.law import Law
from damping.ranking import rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records.mode import Mode, Repeatability, Tolerance, read_mode
from damping.records.record import Record

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
FILES = dict(
    zip(re.findall(r"The file,\s`([^`]+)`", TEXT), re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL), strict=True)
)


def module(path: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The file of the page as a module."""
    made = ModuleType(path.removesuffix(".py").replace("/", "."))
    monkeypatch.setitem(sys.modules, made.__name__, made)  # dataclasses look their module up
    exec(compile(FILES[path], path, "exec"), made.__dict__)
    return made


def test_commands_and_files_of_the_page_exist():
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make (\w+)", TEXT, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    named = set(re.findall(r"`((?:selection|pipelines|tests|docs)/[\w/.]+\.(?:py|md))`", TEXT))
    assert len(named) > 6
    assert [name for name in named if not (ROOT / name).is_file() and name not in FILES] == []


@pytest.fixture
def velocity_cubed(monkeypatch):
    """The force of the page, with the lines that the page says."""
    path = next(path for path in FILES if path.startswith("selection/damping/forces"))
    force = module(path, monkeypatch).VelocityCubed
    assert f'"{force.name}": VelocityCubed,' in TEXT
    monkeypatch.setitem(FORCES, force.name, force)
    return force


def test_the_force_keeps_the_contract(velocity_cubed):
    force, A, omega = velocity_cubed(0.7), 1.3, 2.1
    averaged = quad(lambda theta: force.cycle(theta, A, omega) * np.cos(theta), 0.0, 2.0 * np.pi)[0] / np.pi
    # quadrature of a smooth function, good to rounding
    np.testing.assert_allclose(force.quadrature(A, omega), averaged, rtol=1e-10, atol=0.0)
    m, n = force.energy_exponents
    scaled = energy_per_cycle(force, 2.0 * A, 3.0 * omega) / energy_per_cycle(force, A, omega)
    np.testing.assert_allclose(scaled, 2.0**m * 3.0**n, rtol=1e-12, atol=0.0)
    np.testing.assert_allclose(force.slope(A, omega), 3.0 * force.quadrature(A, omega), rtol=1e-12, atol=0.0)


def test_the_force_is_a_candidate_and_wins_on_its_own_data(velocity_cubed, peaks, tmp_path):
    path = tmp_path / "mode.toml"
    path.write_text(
        '[mode]\nname = "m"\nfrequency = 1.0\nmass = 1.0\n[damping]\nviscous = 0.5\nvelocity-cubed = 0.02\n'
    )
    force = from_damping(read_mode(path).damping)
    A, omega = np.array([0.5, 0.8, 1.3, 2.0, 3.0]), 2.0 * np.pi
    data = peaks(A * np.exp([0.004, -0.003, 0.002, -0.004, 0.003]), force.quadrature(A, omega), omega)
    assert Law(("velocity-cubed",)) in candidate_laws(data)
    laws = (Law(("viscous",)), Law(("viscous", "velocity-squared")), Law(("viscous", "velocity-cubed")))
    best = rank_laws(data, 0, laws).candidates[0]
    assert best.law == laws[2]
    # amplitudes are off by 0.4 per cent at most, which two coefficients of five levels inherit
    np.testing.assert_allclose([c.value for c in best.coefficients], [0.5, 0.02], rtol=0.02, atol=0.0)


def test_the_effect_is_found_in_its_own_data(monkeypatch):
    path = next(path for path in FILES if path.startswith("selection/damping/gap"))
    effect = module(path, monkeypatch).FORCE_TILT
    assert f'"{effect.name}",\n' in TEXT
    M, omega_n, xi, slope, noise = 10.0, 20.0, 0.01, 4.0, 0.005
    omega = omega_n * (1.0 + np.linspace(-0.06, 0.06, 31))
    rig, tables = np.random.default_rng(4), []
    for sweep, F in zip("ABC", (1.0, 2.0, 4.0), strict=True):
        arrives = F * np.exp(slope * (omega / omega_n - 1.0))
        q = arrives / (M * (omega_n**2 - omega**2) + 2j * xi * M * omega_n * omega)
        q = q * np.exp(noise * (rig.standard_normal(31) + 1j * rig.standard_normal(31)))
        columns = {"sweep": sweep, "force": F, "frequency": omega / (2.0 * np.pi)}
        tables.append(pd.DataFrame(columns | {"amplitude": np.abs(q), "phase": -np.angle(q)}))
    table = pd.concat(tables, ignore_index=True)
    record = Record(table.assign(amplitude_sd=noise * table["amplitude"], phase_sd=noise), "tilted")
    mode = Mode(
        name="m",
        frequency=omega_n / (2.0 * np.pi),
        mass=M,
        tolerance=Tolerance(0.001, 0.02, 0.05),
        repeatability=Repeatability(0.0, 0.0),
        damping={"viscous": {"coefficient": 2.0 * xi * M * omega_n}},
    )
    library = {name: EFFECTS[name] for name in ("amplitude-scale", "phase-lag", "displacement")} | {effect.name: effect}
    found = diagnose(record, mode, library)
    assert found.leading.effects == (effect.name,)
