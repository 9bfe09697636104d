"""Uncertainties through the chain: against repeated noisy tests, and against implicit differentiation."""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from damping.errors import AnalysisError
from damping.records.keys import read_toml
from damping.records.reading import read_table
from damping.signals import PrincipalPlanes, plane_motion, reading
from damping.signals.chain import condition
from damping.signals.description import Description
from damping.signals.reading import condition_steps, list_doubts
from damping_reed1970 import data_folder

#: Acceleration per unit of force, lag in degrees, another mode and a rigid body that are removed.
OTHERS: dict[str, Any] = {
    "modes": [{"name": "1", "phi": 0.6, "phi_drive": -0.9, "mass": 3.0, "frequency": 0.9}],
    "rigid_body": {"frequency": 0.1, "identify_from": "C"},
}


def description(sds: tuple[str, ...] = ("force", "sensor", "phase"), **more: Any) -> Description:
    sensor = {"name": "node", "column": "a", "quantity": "acceleration", "unit": 9.81, "per_force": True}
    return Description.model_validate(
        {
            "units": {"phase": "degrees"},
            "raw": {"frequency": "f", "force": "F", "sweep": "run", **({"force_sd": "dF"} if "force" in sds else {})},
            "sensors": [{**sensor, **({"sd": "da"} if "sensor" in sds else {})}],
            "node": {"sensor": "node", "phase": "lag", **({"phase_sd": "dlag"} if "phase" in sds else {})},
            "mode": {"phi": -0.7, "phi_drive": 0.4},
            **more,
        }
    )


def raw(rows: int = 5) -> pd.DataFrame:
    """A sweep through the resonance at 1.5 Hz, uncertainties that differ from row to row."""
    part = np.linspace(0.0, 1.0, rows)
    return pd.DataFrame(
        {
            "run": "A",
            "f": 1.4 + 0.2 * part,
            "F": 10.0 + part,
            "a": 0.3 + 0.2 * np.sin(np.pi * part),
            "lag": 20.0 + 140.0 * part,
            "C": -0.02 * (1.0 + part),
            "dF": 0.02 + 0.02 * part,
            "da": 0.002 * (2.0 - part),
            "dlag": 0.2 + 0.3 * part,
        }
    )


def record(table: pd.DataFrame, described: Description) -> pd.DataFrame:
    return condition_steps(table, described)[-1].after


def test_stated_uncertainties_are_those_of_repeated_tests() -> None:
    table, described = raw(), description(**OTHERS)
    steps = condition(table, described)
    stated = record(table, described)
    # R^2/I, common to all rows, is held: the repeated tests are conditioned with that of this one
    r2_over_i = next(step.constants["r2_over_i"] for step in steps if step.constants)
    held = description(**{**OTHERS, "rigid_body": {"frequency": 0.1, "r2_over_i": r2_over_i}})
    repeats, rng = 20_000, np.random.default_rng(0)
    many = table.loc[np.repeat(table.index, repeats)].reset_index(drop=True)
    for column, sd in (("F", "dF"), ("a", "da"), ("lag", "dlag")):
        many[column] += many[sd] * rng.standard_normal(len(many))
    found = condition(many, held)[-1].after
    for name in ("force", "amplitude", "phase"):
        scatter = found[name].to_numpy().reshape(len(table), repeats).std(axis=1)
        # a standard deviation of 20 000 values is known to 0.5 per cent: four of these
        assert_allclose(stated[f"{name}_sd"], scatter, rtol=0.02, atol=0.0)


def test_without_corrections_they_follow_from_the_units() -> None:
    """x = a F unit/omega^2: relative uncertainties of reading and force add as squares."""
    table = raw()
    found = record(table, description())
    relative = np.hypot(table["da"] / table["a"], table["dF"] / table["F"])
    # central differences of a product: errors of the square of the step, 1e-6 of 1e-2 squared
    assert_allclose(found["amplitude_sd"], relative * found["amplitude"], rtol=1e-8, atol=0.0)
    assert_allclose(found["force_sd"], 0.4 * table["dF"], rtol=1e-8, atol=0.0)
    assert_allclose(found["phase_sd"], np.radians(table["dlag"]), rtol=1e-8, atol=0.0)


def test_planes_by_implicit_differentiation() -> None:
    """xi balances pi X F sin(phi); amplitude and energy follow xi (Eqs. 3.2.12-3.2.15)."""
    place = data_folder() / "saturn-v"
    principal = {"theta": 28.0, "mass": 21.0, "frequency_pitch": 11.40, "frequency_yaw": 11.50, "branch": "low"}
    content = dict(read_toml(place / "condition.toml").values, principal=principal)
    content["sensors"][2]["sd"] = "sd"
    described = Description.model_validate(content)
    table = read_table(place / "raw" / "config-1-mode-2.csv")
    table["sd"] = 1e-3 * table["tail_pitch_disp_in_e2"]  # small: at some points two roots are close together
    steps = condition(table, described)
    found = condition_steps(table, described)[-1].after
    modal = next(step.after for step in steps if step.name == "modal force").loc[found.index]
    F, omega, A, phi = (modal[name].to_numpy(float) for name in ("force", "omega", "amplitude", "phase"))
    # of the modal motion A exp(-i phi), that of the node turned by phi_x moves the part out of phase, A sin(phi)
    node = next(step.after for step in steps if step.name == "mode factor").loc[found.index]
    d_energy = np.pi * F * 1e-3 * (node["amplitude"] * np.sin(node["phase"])).to_numpy(float)
    assert_allclose(A * np.sin(phi) * 1e-3 * np.pi * F, d_energy, rtol=1e-12)
    planes, xi = PrincipalPlanes(1.0, 21.0, 11.40, 11.50, radians(28.0)), found["xi"].to_numpy(float)
    low, high = (plane_motion(planes, F, omega, xi * (1.0 + h)) for h in (-1e-6, 1e-6))
    d_xi = d_energy * 2e-6 * xi / np.abs(high.E_p + high.E_y - low.E_p - low.E_y)
    # differences of 1e-6: rounding of 1e-10; of the chain: the square of 1e-6 times the curvature, largest where the
    # energy is near the largest that can be lost
    assert_allclose(found["xi_sd"], d_xi, rtol=1e-4, atol=0.0)
    for name, change in (("amplitude", high.A_p - low.A_p), ("energy", high.E_p - low.E_p)):
        assert_allclose(found[f"{name}_sd"], np.abs(change) / (2e-6 * xi) * d_xi, rtol=1e-4, atol=0.0)
    assert not {"phase_sd", "force_sd"} & set(found.columns)


@pytest.mark.parametrize("sd", [1e-3, 0.02])
def test_uncertainties_that_no_first_order_holds_are_told(sd: float) -> None:
    """Close planes: the spread of xi in 50 repeated tests is within a factor 1.5 of what is stated, or it is told."""
    place = data_folder() / "saturn-v"
    planes = {"theta": 28.0, "mass": 21.0, "frequency_pitch": 11.40, "frequency_yaw": 11.50}
    content = dict(read_toml(place / "condition.toml").values, principal={**planes, "branch": "near", "xi": 0.01})
    content["sensors"][2]["sd"] = "sd"
    described = Description.model_validate(content)
    table = read_table(place / "raw" / "config-1-mode-2.csv")
    table["sd"] = sd * table["tail_pitch_disp_in_e2"]
    steps = condition_steps(table, described)
    stated = steps[-1].after["xi_sd"]
    many = pd.concat([table] * 50, ignore_index=True)
    many["tail_pitch_disp_in_e2"] += many["sd"] * np.random.default_rng(0).standard_normal(len(many))
    xi = condition(many, described)[-1].after["xi"].reindex(many.index).to_numpy(float).reshape(50, len(table))
    ratio = np.nanstd(xi[:, stated.index], axis=0) / stated.to_numpy(float)
    rough = [doubt for doubt in list_doubts(table, described, steps) if doubt.startswith("xi_sd is rough in")]
    assert bool(rough) == bool(np.any((ratio > 1.5) | (ratio < 1.0 / 1.5)))
    assert bool(rough) == (sd == 0.02)


def test_only_what_is_stated_is_given() -> None:
    table = raw()
    steps = condition(table, description(()))
    assert [step.name for step in condition_steps(table, description(()))] == [step.name for step in steps]
    assert "amplitude_sd" not in record(table, description(("force",)))
    assert list(record(table, description(("force",)))["force_sd"] > 0.0) == [True] * 5
    some = table.assign(da=[0.002, 0.0, 0.002, 0.002, 0.0])
    assert list(record(some, description(**OTHERS))["amplitude_sd"] > 0.0) == [True, False, True, True, False]


def test_a_phase_at_the_end_of_its_range_does_not_jump() -> None:
    table = raw().assign(lag=[269.99, 270.01, -89.99, -90.01, 90.0])  # a mode factor below 0 turns them by pi
    found = record(table, description())
    assert_allclose(found["phase_sd"], np.radians(table["dlag"]), rtol=1e-8, atol=0.0)


def test_one_side_stands_for_both_at_the_last_root() -> None:
    middle, up, down = (pd.DataFrame({"xi": values}) for values in ([0.1, 0.2], [np.nan, 0.21], [0.09, 0.19]))
    assert_allclose(reading._difference("xi", middle, up, down), [0.02, 0.02], rtol=1e-12)
    assert_allclose(reading._difference("xi", middle, up, down.assign(xi=[np.nan, 0.19])), [np.nan, 0.02], rtol=1e-12)


def test_a_row_without_a_damping_factor_on_either_side_is_named(monkeypatch) -> None:
    monkeypatch.setattr(reading, "_propagate", lambda *_: {"amplitude": np.array([0.1, np.nan])})
    with pytest.raises(AnalysisError, match="row 2 of the record loses its damping factor"):
        record(raw(), description())
