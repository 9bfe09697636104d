"""The common style: SVG that stands alone or in a page, colours, labels."""

from __future__ import annotations

from base64 import b64decode
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from damping.forces import CATALOGUE
from damping.plots import describe_short, identifier, law_style, styled, to_svg
from damping.plots.fits import MANY, deviations_figure

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "</text><script>alert('x')</script> & \"$\\frac{1}$\" \x07 漢"

# Machado, Oliveira & Fernandes (2009), table 1, severity 1.0: linear RGB as people with the deficiency see it.
DEFICIENCIES = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


@styled
def drawing(label: str = "measured") -> Figure:
    figure = Figure(figsize=(3.0, 2.0))
    axes = figure.add_subplot()
    axes.plot([1.0, 2.0], [3.0, 5.0], "o-", label=label)
    axes.set_title(label)
    axes.legend()
    return figure


def test_equal_arguments_give_equal_svg() -> None:
    assert to_svg(drawing(), "one", "t", "d") == to_svg(drawing(), "one", "t", "d")


def test_svg_has_a_text_alternative_and_keeps_its_text() -> None:
    root = ElementTree.fromstring(to_svg(drawing("peaks"), "one", "The title", "What it shows"))
    assert root.get("role") == "img"
    named = {element.get("id"): element.text for element in root if element.get("id")}
    assert [named[key] for key in root.get("aria-labelledby", "").split()] == ["The title", "What it shows"]
    assert "peaks" in {element.text for element in root.iter(f"{SVG}text")}


def test_ids_of_two_figures_differ_and_references_stay_within_one() -> None:
    first, second = (ElementTree.fromstring(to_svg(drawing(), name, "t", "d")) for name in ("one", "two"))
    ids = [{element.get("id") for element in root.iter() if element.get("id")} for root in (first, second)]
    assert not ids[0] & ids[1]
    for root, own in zip((first, second), ids, strict=True):
        listed = [element.get("id") for element in root.iter() if element.get("id")]
        assert len(listed) == len(set(listed))
        text = ElementTree.tostring(root, encoding="unicode")
        hrefs = [e.get("{http://www.w3.org/1999/xlink}href", "") for e in root.iter()]
        used = {h.removeprefix("#") for h in hrefs if h} | {part.split(")")[0] for part in text.split("url(#")[1:]}
        assert used
        assert used <= own


def test_svg_loads_nothing_and_styles_nothing_else() -> None:
    text = to_svg(drawing(), "one", "t", "d")
    for namespace in ("http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"):
        text = text.replace(f'="{namespace}"', "")
    assert "http" not in text
    assert "<style" not in text
    assert "<!DOCTYPE" not in text


@pytest.mark.filterwarnings("error")
def test_many_deviations_are_one_picture() -> None:
    """Beyond ``MANY`` points the marks are a PNG inside the SVG (RFC 2397), all of it there; below, one mark each."""
    x = np.linspace(0.0, 1.0, MANY + 1)
    figure = deviations_figure(x, np.sin(40.0 * x), 100.0 * np.cos(40.0 * x), x_label="A", response="E")
    pictures = list(ElementTree.fromstring(to_svg(figure, "many", "Title", "Said")).iter(f"{SVG}image"))
    for picture in pictures:
        head, _, content = picture.attrib["{http://www.w3.org/1999/xlink}href"].partition(",")
        assert head == "data:image/png;base64"
        assert b64decode(content)[:8] == b"\x89PNG\r\n\x1a\n"
    few = deviations_figure(x[1:], x[1:], x[1:], x_label="A", response="E")
    marks = ElementTree.fromstring(to_svg(few, "few", "Title", "Said")).iter(f"{SVG}use")
    assert len(pictures) == 2
    assert sum(1 for _ in marks) >= 2 * MANY


def test_hostile_text_stays_text() -> None:
    root = ElementTree.fromstring(to_svg(drawing(HOSTILE), HOSTILE, HOSTILE, HOSTILE))
    assert not list(root.iter(f"{SVG}script"))
    printable = HOSTILE.replace("\x07", "\N{REPLACEMENT CHARACTER}")
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert texts.count(printable) == 2
    assert root.find(f"{SVG}title").text == printable


def test_identifier_is_a_valid_id_and_keeps_record_names() -> None:
    assert identifier("config-2_Mode") == "config-2_Mode"
    assert identifier("4 x/../") == "n-4-x"
    assert identifier("") == "n-"


def test_short_labels_and_weights() -> None:
    assert describe_short("sweep\n A") == "sweep A"
    assert describe_short("x" * 40) == "x" * 13 + "…"


def test_a_law_looks_the_same_everywhere() -> None:
    assert law_style("coulomb + A^4") == law_style("coulomb + A^4")
    for name in CATALOGUE:
        alone, pair = law_style(name), law_style(f"viscous + {name}")
        if name != "viscous":
            assert pair.colour == alone.colour
            assert pair.line != alone.line


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_forces_can_be_told_apart_by_colour(deficiency: str) -> None:
    """CIE 1976 difference of at least 10 between any two: 2.3 is just noticeable side by side (Mahy et al. 1994)."""
    seen = {name: _lab(np.array(DEFICIENCIES[deficiency]) @ _linear(law_style(name).colour)) for name in CATALOGUE}
    for one, other in combinations(seen, 2):
        assert np.linalg.norm(seen[one] - seen[other]) > 10.0, (one, other)


def _linear(colour: str) -> np.ndarray:
    c = np.array(to_rgb(colour))
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def _lab(linear: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB, white point D65 (IEC 61966-2-1)."""
    to_xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    )
    ratio = to_xyz @ np.clip(linear, 0.0, 1.0) / np.array([0.95047, 1.0, 1.08883])
    f = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])
