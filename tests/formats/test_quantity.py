"""Units as text against their definitions, and any text as a unit."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damping.errors import InputError
from damping.formats.quantity import unit

# by definition, m, N, m/s^2
INCH = 0.0254
LBF = 4.4482216152605
G = 9.80665


@pytest.mark.parametrize(
    ("text", "powers", "factor"),
    [
        ("N", (1, 0, 0), 1.0),
        ("m/s^2", (0, 1, -2), 1.0),
        ("m/s²", (0, 1, -2), 1.0),
        ("m/s2", (0, 1, -2), 1.0),
        ("m s^-2", (0, 1, -2), 1.0),
        ("m*s**-2", (0, 1, -2), 1.0),
        ("m/s/s", (0, 1, -2), 1.0),
        ("g", (0, 1, -2), G),
        ("G", (0, 1, -2), G),
        *(("mg", (0, 1, -2), 1e-3 * G), ("µg", (0, 1, -2), 1e-6 * G), ("mg/N", (-1, 1, -2), 1e-3 * G)),
        *(("ips", (0, 1, -1), INCH), ("microns", (0, 1, 0), 1e-6)),
        ("mm", (0, 1, 0), 1e-3),
        ("µm", (0, 1, 0), 1e-6),
        ("μm", (0, 1, 0), 1e-6),
        ("in/s^2", (0, 1, -2), INCH),
        ("INCH", (0, 1, 0), INCH),
        ("(m/s^2)/N", (-1, 1, -2), 1.0),
        ("m/s^2/N", (-1, 1, -2), 1.0),
        ("m/(s^2*N)", (-1, 1, -2), 1.0),
        ("m/(N.s)", (-1, 1, -1), 1.0),
        ("g/lbf", (-1, 1, -2), G / LBF),
        ("in/lb", (-1, 1, 0), INCH / LBF),
        ("1/kg", (-1, 1, -2), 1.0),
        ("lbf s^2/in", (1, -1, 2), LBF / INCH),
        ("mN", (1, 0, 0), 1e-3),
        ("kN", (1, 0, 0), 1e3),
        ("J", (1, 1, 0), 1.0),
        *(("uN", (1, 0, 0), 1e-6), ("µN", (1, 0, 0), 1e-6), ("nN", (1, 0, 0), 1e-9), ("MN", (1, 0, 0), 1e6)),
        *(("pm", (0, 1, 0), 1e-12), ("nm", (0, 1, 0), 1e-9), ("km", (0, 1, 0), 1e3), ("mrad", (0, 0, 0), 1e-3)),
        *(("Nm", (1, 1, 0), 1.0), ("mN m", (1, 1, 0), 1e-3), ("rad/(N m)", (-1, -1, 0), 1.0)),
    ],
)
def test_units_by_definition(text: str, powers: tuple[int, int, int], factor: float):
    found = unit(text)
    assert found.powers == powers
    assert found.factor == pytest.approx(factor, rel=1e-14)  # a few roundings


@pytest.mark.parametrize(
    "text", ["", " ", "V", "dB", "m/", "/m", "(m", "m)", "m^^2", "m^", "furlong", "m/s^2.5", "()", "2m", "M"]
)
def test_what_is_no_unit(text: str):
    with pytest.raises(InputError, match="is not understood; expected a unit such as N"):
        unit(text)


@settings(max_examples=200)
@given(st.text(max_size=80) | st.text(alphabet="mNsgin()/*^ .-²0123456789", max_size=70))
def test_any_text_is_a_unit_or_an_error(text: str):
    with contextlib.suppress(InputError):
        assert unit(text).factor > 0.0
