"""The conditioning chain: against superposed modes solved directly, and against the report's Tables 3.I and 3.III."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from damping.arrays import wrap_lag
from damping.errors import AnalysisError
from damping.signals import PrincipalPlanes, energy_loss, plane_motion
from damping.signals.chain import ConditioningStep, condition
from damping.signals.description import Description
from damping.signals.reading import list_doubts
from damping_reed1970 import data_folder, load_table
from damping_reed1970.chapter_3.study import saturn_steps, tabulate_conditioned

HZ = 2.0 * np.pi
F = np.linspace(900.0, 960.0, 9)
HERTZ = np.linspace(1.7, 1.95, 9)
#: phi at the node, phi at the drive, mass, frequency in Hz, damping; the second mode is the one looked for.
MODES = [
    (0.084, -0.03, 62.9, 1.106, 0.0),
    (-0.041, 0.05, 21.0, 1.813, 2.3),
    (0.028, 0.02, 23.5, 2.577, 0.0),
    (0.0, 0.07, 40.0, 3.0, 0.0),
]
R2_OVER_I = -1.9e-4
OMEGA_R = 0.8


def motion() -> np.ndarray:
    """Phasor of the node: every mode and a rigid body, superposed."""
    omega = HZ * HERTZ
    modes = [a * b * F / (M * ((HZ * f) ** 2 - omega**2) + 1j * c * omega) for a, b, M, f, c in MODES]
    return np.sum(modes, axis=0) + R2_OVER_I * F / (OMEGA_R**2 - omega**2)


def description(**changes: Any) -> Description:
    """The test of ``motion``: acceleration per unit of force in units of 9.81, phase in degrees."""
    (phi, drive, *_), others = MODES[1], [MODES[0], *MODES[2:]]
    modes = [
        {"name": str(k), "phi": a, "phi_drive": b, "mass": M, "frequency": f}
        for k, (a, b, M, f, _) in enumerate(others)
    ]
    content = {
        "units": {"phase": "degrees"},
        "raw": {"frequency": "f", "force": "F", "sweep_label": "A", "keep": ["note"]},
        "sensors": [
            {"name": "node", "column": "a", "quantity": "acceleration", "factor": 0.1, "unit": 9.81, "per_force": True}
        ],
        "node": {"sensor": "node", "phase": "lag", "lag": 7.0},
        "mode": {"phi": phi, "phi_drive": drive},
        "modes": modes,
        "rigid_body": {"frequency": OMEGA_R / HZ, "r2_over_i": R2_OVER_I},
    }
    return Description.model_validate({**content, **changes})


def raw() -> pd.DataFrame:
    x = motion()
    acceleration = np.abs(x) * (HZ * HERTZ) ** 2 / 9.81 / F / 0.1
    lag = np.degrees(-np.angle(x)) + 7.0
    return pd.DataFrame({"f": HERTZ, "F": F, "a": acceleration, "lag": lag, "note": list("abcdefghi")})


def by_name(steps: tuple[ConditioningStep, ...]) -> dict[str, ConditioningStep]:
    return {step.name: step for step in steps}


def test_a_mode_is_recovered_from_a_node_that_is_not_driven() -> None:
    """Force elsewhere, negative mode factors, lag of the instruments, degrees and Hz: nothing but the mode is left."""
    record = condition(raw(), description())[-1].after
    phi, drive, M, f, c = MODES[1]
    omega = HZ * HERTZ
    alone = abs(drive) * F / (M * ((HZ * f) ** 2 - omega**2) + 1j * c * omega)
    # taking off what was added, a few times the mode where it is smallest: rounding
    assert_allclose(record["amplitude"] * np.exp(-1j * record["phase"]), alone, rtol=1e-12)
    assert_allclose(record["force"], abs(drive) * F, rtol=1e-15)
    assert_allclose(record["frequency"], HERTZ, rtol=1e-15)
    assert list(record["note"]) == list("abcdefghi")
    assert set(record["sweep"]) == {"A"}
    assert phi < 0 < drive  # what the test is about


def test_what_a_step_removed_is_the_difference_it_made() -> None:
    for step in condition(raw(), description()):
        if step.name in ("rigid body", "adjacent modes"):
            before, after = (t["amplitude"] * np.exp(-1j * t["phase"]) for t in (step.before, step.after))
            assert_allclose(before - after, step.removed.sum(axis=1), rtol=0, atol=1e-13)  # sums of motions of order 1


def test_the_order_of_the_steps_and_their_tables() -> None:
    steps = condition(raw(), description())
    names = ["displacement", "node", "mode factor", "rigid body", "adjacent modes", "modal force", "record"]
    assert [step.name for step in steps] == names
    for earlier, later in pairwise(steps):
        pd.testing.assert_frame_equal(earlier.after, later.before)
    assert_allclose(by_name(steps)["node"].removed["lag"], np.radians(7.0), rtol=1e-15)


def test_velocity_and_displacement_readings_say_the_same() -> None:
    omega = HZ * HERTZ
    table = raw().assign(v=np.abs(motion()) * omega, d=np.abs(motion()) / F)
    expected = condition(table, description())[-1].after
    for sensor in ({"column": "v", "quantity": "velocity"}, {"column": "d", "per_force": True}):
        found = condition(table, description(sensors=[{"name": "node", **sensor}]))[-1].after
        assert_allclose(found["amplitude"], expected["amplitude"], rtol=1e-12)  # conversions: rounding


def test_known_corrections_do_what_modes_and_body_do() -> None:
    steps = by_name(condition(raw(), description()))
    total = -sum(steps[name].removed.sum(axis=1) for name in ("rigid body", "adjacent modes"))
    table = raw().assign(C=total.to_numpy())
    known = description(modes=[], rigid_body=None, correction={"column": "C"})
    assert_allclose(condition(table, known)[-1].after["amplitude"], steps["record"].after["amplitude"], rtol=1e-12)
    identified = description(rigid_body={"frequency": OMEGA_R / HZ, "identify_from": "C"})
    step = by_name(condition(table, identified))["rigid body"]
    assert_allclose(step.constants["r2_over_i"], R2_OVER_I, rtol=1e-11)  # noise-free: rounding in a difference


def test_without_a_phase_there_is_an_amplitude_at_least() -> None:
    plain = description(node={"sensor": "node"}, modes=[], rigid_body=None)
    record = condition(raw(), plain)[-1].after
    assert "phase" not in record
    assert_allclose(record["amplitude"], np.abs(motion()) / 0.041, rtol=1e-13)


def test_a_mode_inside_the_sweep_cannot_be_removed() -> None:
    inside = [{"name": "x", "phi": 0.1, "mass": 1.0, "frequency": 1.8}]
    with pytest.raises(AnalysisError, match="'x' lies inside the swept frequencies"):
        condition(raw(), description(modes=inside))
    rigid = {"frequency": 1.8, "r2_over_i": 1e-4}
    with pytest.raises(AnalysisError, match="rigid-body rotation lies inside the swept frequencies"):
        condition(raw(), description(modes=[], rigid_body=rigid))


def test_a_negative_r2_over_i_is_refused_where_the_node_is_driven() -> None:
    table = raw().assign(C=-0.05)
    driven = description(mode={"phi": 0.041}, modes=[], rigid_body={"frequency": OMEGA_R / HZ, "identify_from": "C"})
    with pytest.raises(AnalysisError, match="not positive"):
        condition(table, driven)


PLANES = PrincipalPlanes(1.0, 21.0, HZ * 1.81, HZ * 1.84, np.radians(28.0))


def principal(branch: str, **more: float) -> dict[str, Any]:
    named = {"theta": 28.0, "mass": 21.0, "frequency_pitch": 1.81, "frequency_yaw": 1.84, "branch": branch}
    return {**named, **more}


@pytest.fixture(scope="module")
def two_planes() -> pd.DataFrame:
    """Modal readings whose energy is that of two planes at xi = .005, and one row of more energy than any xi loses."""
    energy = energy_loss(PLANES, F, HZ * HERTZ, 0.005)
    amplitude = np.array(energy) / np.pi / F  # phase pi/2: all of the motion takes energy
    amplitude[0] *= 1e4
    return pd.DataFrame({"f": HERTZ, "F": F, "X": amplitude, "lag": 90.0, "note": "n"})


def modal(**changes: Any) -> Description:
    sensors = [{"name": "node", "column": "X"}]
    same = {"sensors": sensors, "mode": {"phi": 1.0}, "modes": [], "rigid_body": None}
    return description(**same, node={"sensor": "node", "phase": "lag"}, **changes)


def test_principal_planes_of_a_known_damping(two_planes: pd.DataFrame) -> None:
    steps = condition(two_planes, modal(principal=principal("near", xi=0.005)))
    record, step = steps[-1].after, by_name(steps)["principal planes"]
    assert len(record) == len(two_planes) - 1  # the first row has no root
    assert np.isnan(step.removed["yaw energy"].iloc[0])
    assert_allclose(record["xi"], 0.005, rtol=1e-9)  # roots of a polynomial of fourth degree, well apart
    expected = plane_motion(PLANES, F[1:], HZ * HERTZ[1:], 0.005)
    assert_allclose(record["amplitude"], expected.A_p, rtol=1e-8)  # as the roots
    assert_allclose(record["energy"], expected.E_p, rtol=1e-8)
    assert_allclose(record["energy"] + step.removed["yaw energy"][1:], step.removed["input energy"][1:], rtol=1e-9)
    assert_allclose(record["force"], F[1:] * np.cos(np.radians(28.0)), rtol=1e-14)
    assert "phase" not in record


def test_branches_lie_on_either_side(two_planes: pd.DataFrame) -> None:
    low, high = (
        condition(two_planes, modal(principal=principal(branch, largest=10.0)))[-1].after["xi"]
        for branch in ("low", "high")
    )
    assert np.all(low <= 0.005 * (1 + 1e-9))
    assert np.all(high >= 0.005 * (1 - 1e-9))
    assert np.all(high > low)


def test_a_branch_that_changes_sides_is_told() -> None:
    """One xi = .005 lies on the high side near the frequencies of the planes, and on the low side away from them."""
    near = np.linspace(1.78, 1.87, len(F))
    reading = np.asarray(energy_loss(PLANES, F, HZ * near, 0.005)) / np.pi / F  # phase pi/2: all of it takes energy
    table = pd.DataFrame({"f": near, "F": F, "X": reading, "lag": 90.0, "note": "n"})
    for branch, xi in (("low", None), ("high", None), ("near", 0.005)):
        chosen = modal(principal=principal(branch, largest=10.0) | ({} if xi is None else {"xi": xi}))
        steps = condition(table, chosen)
        wrong = not np.allclose(steps[-1].after["xi"], 0.005, rtol=1e-6)  # roots of a polynomial, well apart
        doubts = " ".join(list_doubts(table, chosen, steps))
        assert wrong == (branch != "near") == (f"the {branch} roots run from" in doubts)


def test_no_row_with_a_damping_factor(two_planes: pd.DataFrame) -> None:
    with pytest.raises(AnalysisError, match="damping factor"):
        condition(two_planes.iloc[:1], modal(principal=principal("low")))


@pytest.fixture(scope="module")
def saturn() -> pd.DataFrame:
    return tabulate_conditioned(saturn_steps()).set_index("point")


def test_table_3_i(saturn: pd.DataFrame) -> None:
    """Tip displacements as a slide rule reads (erratum E3I-5: .62 per cent at most), tail yaw to the printed digits."""
    for name in ("tip_pitch", "tip_yaw"):
        assert_allclose(saturn[name], saturn[f"{name}_printed"], rtol=0.0062)
    file = data_folder() / "saturn-v" / "tables" / "table_3_I.csv"
    printed = pd.read_csv(file, dtype=str)["tail_yaw_disp_in_e2"]
    unit = np.array([10.0 ** -len(text.partition(".")[2]) for text in printed])
    # half a unit, and at point 15 a hair more: .53749, printed .538
    assert np.all(np.abs(saturn["tail_yaw_e2"] - saturn["tail_yaw_e2_printed"]) <= 0.52 * unit)


def test_table_3_i_where_the_errata_are() -> None:
    """The computed column differs from the print at the cells of E3I-2, E3I-3 and E3I-4 and agrees once corrected."""
    printed = load_table("3_I").set_index("point")["tip_yaw_disp_in"]
    found = tabulate_conditioned(saturn_steps()).set_index("point")["tip_yaw"]
    off = np.abs(found / printed - 1.0) > 0.0062
    assert list(off[off].index) == [2, 6, 14]


def test_table_3_iii_with_the_printed_corrections() -> None:
    """phi_2 and A_2 where C_t2 is taken from the table and not computed."""
    motion = load_table("3_I")
    table = load_table("3_III", "corrected").assign(omega=motion["omega_rad_s"], F=motion["force_lb"])
    printed_corrections = Description.model_validate(
        {
            "units": {"frequency": "rad/s"},
            "raw": {"frequency": "omega", "force": "F", "sweep_label": "I"},
            "sensors": [{"name": "tail", "column": "tail_amplitude_in"}],
            "node": {"sensor": "tail", "phase": "tail_phase_rad"},
            "mode": {"phi": 0.041},
            "correction": {"column": "correction_Ct2_in"},
        }
    )
    record = condition(table, printed_corrections)[-1].after
    # one unit of the last digit: the inputs of the arc tangent are rounded, and so is the result
    assert_allclose(record["phase"], table["modal_phase_rad"], rtol=0, atol=0.00105)
    # slide rule: every printed amplitude is larger, by .33 per cent at most (point 9)
    assert_allclose(record["amplitude"], table["modal_amplitude_A2_in"], rtol=0.0034)


def test_table_3_iii_with_computed_corrections(saturn: pd.DataFrame) -> None:
    """C_t2 within 1.25 per cent (one R^2/I for 15 corrections that scatter), and what that leaves in phi_2 and A_2."""
    assert_allclose(saturn["C_t2"], saturn["C_t2_printed"], rtol=0.0125)
    difference = np.abs(saturn["C_t2"] - saturn["C_t2_printed"])
    # a correction moves the amplitude by at most itself and the phase by at most itself over the amplitude;
    # the rest is that of the printed corrections
    assert np.all(np.abs(saturn["A_2"] - saturn["A_2_printed"]) <= difference + 0.0034 * saturn["A_2"])
    assert np.all(np.abs(saturn["phi_2"] - saturn["phi_2_printed"]) <= difference / saturn["A_2"] + 0.00105)


def test_r2_over_i_of_the_vehicle() -> None:
    """Not printed; 1.9216e-4 in/(lb s^2) fits Table 3.III as printed, point 15 corrected moves it by .1 per cent."""
    step = by_name(saturn_steps())["rigid body"]
    assert_allclose(step.constants["r2_over_i"], 1.9216e-4, rtol=0.0015)


def test_a_lag_is_wrapped_to_where_noise_does_not_make_it_jump():
    inside = np.array([-0.5 * np.pi, -0.1, 0.0, 0.1, np.pi, 1.5 * np.pi - 1e-9])
    assert_array_equal(wrap_lag(inside), inside)  # every digit
    for turns in (-2, 1):
        assert_allclose(wrap_lag(inside + 1e-12 + 2.0 * np.pi * turns), inside, rtol=0.0, atol=1e-11)
