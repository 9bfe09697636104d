"""Captions of chapter III: their numbers are those of the results, and change with them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from damping.report.words import format_counted, format_points_text
from damping_reed1970.chapter_3 import captions as words
from damping_reed1970.chapter_3.implications import tabulate_branch
from damping_reed1970.chapter_3.planar_fits import PlanarBand
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


@pytest.mark.parametrize(("split", "found"), [(0.2, "two peaks"), (0.02, "one peak")])
def test_peaks_are_counted(measured: pd.DataFrame, split: float, found: str) -> None:
    """Two bells of width 0.05 have two tops only if they are more than two widths apart."""
    bells = sum(np.exp(-0.5 * ((OMEGA - 11.39 + sign * split / 2) / 0.05) ** 2) for sign in (-1, 1))
    text = words.describe_two_peaks(measured, fit(np.asarray(bells)))
    assert text.startswith("15 printed points with two peaks")
    assert text.endswith(f"give {found}.")


def test_side_of_the_sines(measured: pd.DataFrame) -> None:
    own = np.interp(OMEGA, measured["omega"], measured["tail_phase"])
    assert "as if all phases had been read too small" in words.describe_sines_beside_the_fit(
        measured, fit(own, own + 0.1)
    )
    text = words.describe_sines_beside_the_fit(measured, fit(own, own - 0.1))
    assert "higher on average before resonance" in text
    assert "too small" not in text


def test_distance_from_the_printed_amplitudes(measured: pd.DataFrame) -> None:
    through = np.interp(OMEGA, measured["omega"], measured["A_2_printed"])
    assert "is 0.02 in (rms) from them" in words.describe_modal_points(measured, fit(through + 0.02))
    assert "agree within 0.45 per cent" in words.describe_modal_points(measured, fit(through))


def test_what_the_steps_change() -> None:
    table = pd.DataFrame({"step": ["a"] * 3 + ["b"] * 3, "amplitude": [1.0, 4.0, 2.0, 1.5, 4.04, 2.2]})
    # 50 % of the first, 1 % of the largest
    assert words.change_by_conditioning(table) == pytest.approx((50.0, 1.0), rel=1e-12)
    assert words.describe_effect_of_steps(table).endswith("by up to 50 per cent, 1 per cent at its peak.")
    largest, at_peak = words.change_by_conditioning(tabulate_effect(saturn_steps()))
    assert at_peak < 1.0 < largest


def test_roots_that_the_report_took(measured: pd.DataFrame) -> None:
    """Erratum E3IV-1 and what it says of the branches."""
    branches = tabulate_branch()
    text = words.describe_roots_taken(branches)
    assert "low one at points 1 to 6, 14 and 15 and the high one at points 7 to 9, 11 and 12" in text
    assert text.endswith("at points 10 and 13 there is none.")
    assert words.describe_without_a_root(measured) == "points 10 and 13"
    assert "there is none" not in words.describe_roots_taken(branches.assign(roots=2))


def test_yaw_predictions_by_distance() -> None:
    yaw = pd.DataFrame({"point": [1, 2], "omega": [1.0, 2.0], "measured": [0.3, 0.4], "free": [0.35, 0.45]})
    assert words.describe_yaw_predicted(yaw).endswith("rms distance 0.05 in (free).")
