"""Words of chapter III: their numbers are those of the results, and change with them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from damping.report import format_counted, format_points_text
from damping_reed1970.chapter_3 import page
from damping_reed1970.chapter_3.planar_posterior import PlanarBand
from damping_reed1970.chapter_3.study import saturn_steps, tabulate_effect, tabulate_measured

OMEGA = np.linspace(11.17, 11.61, 177)


def curve(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return values, values, values


@pytest.fixture(scope="module")
def measured() -> pd.DataFrame:
    return tabulate_measured(saturn_steps())


def fit(amplitude: np.ndarray, phase: np.ndarray | None = None) -> PlanarBand:
    return PlanarBand(OMEGA, curve(amplitude), curve(np.linspace(0.2, 3.0, OMEGA.size) if phase is None else phase))


def test_points_in_words() -> None:
    assert format_points_text([1, 2, 3, 4, 5, 6, 14, 15]) == "points 1 to 6, 14 and 15"
    assert format_points_text([10, 13]) == "points 10 and 13"
    assert format_points_text([7]) == "point 7"
    assert format_points_text([]) == "no point"
    assert [format_counted(n, "peak") for n in (0, 1, 2, 15)] == ["no peak", "one peak", "two peaks", "15 peaks"]


@pytest.mark.parametrize(("split", "peaks"), [(0.2, 2), (0.02, 1)])
def test_peaks_are_counted(measured: pd.DataFrame, split: float, peaks: int) -> None:
    """Two bells of width 0.05 have two tops only if they are more than two widths apart."""
    bells = sum(np.exp(-0.5 * ((OMEGA - 11.39 + sign * split / 2) / 0.05) ** 2) for sign in (-1, 1))
    assert page.count_peaks(np.asarray(bells)) == peaks
    assert page.count_peaks(measured["tail"]) == 2


def test_side_of_the_sines(measured: pd.DataFrame) -> None:
    """Sines of phases read too small are too small before pi/2 and too large after it."""
    own = np.interp(OMEGA, measured["omega"], measured["tail_phase"])
    before, after = page.compare_sines(measured, fit(own, own + 0.1))
    assert before < 0.0 < after
    before, _ = page.compare_sines(measured, fit(own, own - 0.1))
    assert before > 0.0


def test_distance_from_what_was_measured() -> None:
    assert page.root_mean_square(np.array([0.3, -0.4])) == pytest.approx(np.sqrt(0.125), rel=1e-12)


def test_what_the_steps_change() -> None:
    table = pd.DataFrame({"step": ["a"] * 3 + ["b"] * 3, "amplitude": [1.0, 4.0, 2.0, 1.5, 4.04, 2.2]})
    # 50 % of the first, 1 % of the largest
    assert page.change_by_conditioning(table) == pytest.approx((50.0, 1.0), rel=1e-12)
    largest, at_peak = page.change_by_conditioning(tabulate_effect(saturn_steps()))
    assert at_peak < 1.0 < largest
