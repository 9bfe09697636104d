"""Universal files that pyuff writes are read back, whatever the function, the form and the spacing."""

from __future__ import annotations

import numpy as np
import pytest
import pyuff

from damping.errors import InputError
from damping.formats import read_file
from damping.formats.motions import time_histories
from damping.formats.series import Stated

ORDERS = {"receptance": (0, 8, "m"), "mobility": (1, 11, "m/s"), "accelerance": (2, 12, "m/s^2")}


def ratio(truth, name: str) -> dict[str, object]:
    """The receptance as one of the three frequency responses."""
    order, code, unit = ORDERS[name]
    w = 2 * np.pi * truth.f
    return {
        "x": truth.f.copy(),
        "data": truth.H * (1j * w) ** order,
        "ordinate_spec_data_type": code,
        "ordinate_axis_units_lab": unit,
    }


def close(record, truth, rtol: float) -> None:
    assert len(record) == len(truth.f)
    np.testing.assert_allclose(record.column("frequency"), truth.f, rtol=min(rtol, 1e-5))
    np.testing.assert_allclose(record.column("force"), truth.F, rtol=1e-11)  # a measured one has 12 digits in text
    np.testing.assert_allclose(record.column("amplitude"), truth.amplitude, rtol=rtol)
    np.testing.assert_allclose(record.column("phase"), truth.lag, rtol=0, atol=rtol)


@pytest.mark.parametrize("even", [1, 0])
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("name", ORDERS)
def test_frequency_responses_of_pyuff(truth, by_pyuff, imported, name, binary, even):
    path = by_pyuff(ratio(truth, name) | {"binary": binary, "abscissa_spacing": even})
    found = imported(path, forces=(truth.F,))
    # text has 12 digits of the ordinate and 6 of the abscissa, whose rounding of 5e-6 goes in twice (omega^2); bytes
    # all of both, but the first abscissa and the step are text where the spacing is even
    close(found.record, truth, 3e-5 if even or not binary else 1e-12)
    assert ("response", name, "found in the file") in found.summary.rows
    assert found.record.sweeps == ("level 1",)


@pytest.mark.parametrize(("even", "binary"), [(1, 0), (0, 0), (1, 1), (0, 1)])
def test_single_precision_is_stated(truth, by_pyuff, imported, even, binary):
    """Text of six digits; bytes, of which pyuff writes those of double precision all the same."""
    path = by_pyuff(
        ratio(truth, "receptance") | {"abscissa_spacing": even, "binary": binary, "ord_data_type": 5},
        force_double=False,
    )
    close(imported(path, forces=(truth.F,)).record, truth, 1e-5)  # 6 digits of each part


def test_several_sweeps_keep_their_levels(truth, by_pyuff, imported):
    sets = [ratio(truth, "accelerance") | {"id1": f"level {k}"} for k in (1, 2, 3)]
    found = imported(by_pyuff(*sets), forces=(1.0, 2.0, 4.0))
    assert found.record.sweeps == ("level 1", "level 2", "level 3")
    for label, force in zip(found.record.sweeps, (1.0, 2.0, 4.0), strict=True):
        one = found.record.of(label)
        np.testing.assert_allclose(one.column("force"), force, rtol=1e-14)
        # 6 digits of the abscissas in text
        np.testing.assert_allclose(one.column("amplitude"), np.abs(truth.H) * force, rtol=3e-5)


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("even", [0, 1])
def test_time_histories_in_bytes(by_pyuff, even, single):
    """A motion and the force beside it, with their units, as the samples that were written."""
    t, x = np.arange(2000) / 512.0, np.random.default_rng(1).standard_normal((2, 2000))
    common = {"x": t, "func_type": 1, "abscissa_spec_data_type": 17, "abscissa_axis_units_lab": "s", "binary": 1}
    common |= {"orddenom_spec_data_type": 0, "abscissa_spacing": even, "ord_data_type": 2 if single else 4}
    force = {"data": x[1], "id1": "hammer", "ordinate_spec_data_type": 13, "ordinate_axis_units_lab": "N"}
    path = by_pyuff(common | {"data": x[0], "id1": "tip"}, common | force, force_double=not single)
    stated = Stated()
    series, summary = read_file(path, stated)
    (motion,) = time_histories(series, stated, summary)
    assert (motion.label, motion.order) == ("tip", 2)
    np.testing.assert_array_equal(motion.signal, x[0])
    np.testing.assert_array_equal(motion.force, x[1])
    np.testing.assert_allclose(motion.t, t, rtol=5e-6)  # the step of even spacing is text of six digits


@pytest.mark.parametrize("binary", [0, 1])
def test_spectra_of_response_and_force(truth, by_pyuff, imported, binary):
    """General functions of frequency: an acceleration and a force, each with its own phase against the clock."""
    w, drive = 2 * np.pi * truth.f, truth.F * np.exp(0.7j)
    motion = {"data": -(w**2) * truth.H * drive, "ordinate_spec_data_type": 12, "ordinate_axis_units_lab": "m/s^2"}
    force = {"data": np.full_like(truth.H, drive), "ordinate_spec_data_type": 13, "ordinate_axis_units_lab": "N"}
    common = {"x": truth.f.copy(), "func_type": 0, "orddenom_spec_data_type": 0, "binary": binary}
    path = by_pyuff(common | motion, common | force | {"id1": "force"})
    close(imported(path, scaling="peak").record, truth, 3e-5)
    rms = imported(path, scaling="rms").record
    np.testing.assert_allclose(rms.column("force"), truth.F * 2**0.5, rtol=1e-11)  # 12 digits of text
    with pytest.raises(InputError, match="peak or rms is neither in the file nor stated"):
        imported(path)


def test_a_force_measured_beside_a_frequency_response(truth, by_pyuff, imported):
    level = 3.0 + 0.5 * np.cos(truth.f)
    force = {"x": truth.f.copy(), "data": level, "func_type": 0, "ordinate_spec_data_type": 13}
    force |= {"orddenom_spec_data_type": 0, "ordinate_axis_units_lab": "N", "id1": "drive"}
    found = imported(by_pyuff(ratio(truth, "receptance"), force), scaling="peak").record
    np.testing.assert_allclose(found.column("force"), level, rtol=1e-11)  # 12 digits
    np.testing.assert_allclose(found.column("amplitude"), np.abs(truth.H) * level, rtol=1e-5)  # 6 digits of frequency
    np.testing.assert_allclose(found.column("phase"), truth.lag, rtol=0, atol=1e-5)


def test_units_and_systems(truth, by_pyuff, imported):
    """g per lbf to SI and to inches: 1 lbf = 4.4482216152605 N, 1 in = 0.0254 m, 1 g = 9.80665 m/s^2, by definition."""
    data = ratio(truth, "accelerance")
    data |= {
        "data": data["data"] / 9.80665 * 4.4482216152605,
        "ordinate_axis_units_lab": "g",
        "orddenom_axis_units_lab": "lbf",
    }
    path = by_pyuff(data)
    si = imported(path, forces=(truth.F / 4.4482216152605,)).record
    close_but_force = np.abs(truth.H) * truth.F
    np.testing.assert_allclose(si.column("amplitude"), close_but_force, rtol=3e-5)  # 6 digits of frequency, squared
    np.testing.assert_allclose(si.column("force"), truth.F, rtol=1e-14)
    us = imported(path, forces=(10.0,), system="us").record
    np.testing.assert_allclose(us.column("force"), 10.0, rtol=1e-14)
    np.testing.assert_allclose(us.column("amplitude"), np.abs(truth.H) * 10.0 * 4.4482216152605 / 0.0254, rtol=3e-5)


def test_pyuff_reads_the_same(truth, by_pyuff, imported):
    """The reference implementation of the format agrees on its own files."""
    path = by_pyuff(ratio(truth, "receptance") | {"binary": 1, "abscissa_spacing": 0})
    theirs = pyuff.UFF(str(path)).read_sets(0)
    ours = imported(path, forces=(1.0,)).record
    np.testing.assert_array_equal(ours.column("frequency"), theirs["x"])
    np.testing.assert_allclose(ours.column("amplitude"), np.abs(theirs["data"]), rtol=1e-15)
