"""Colours can be read and told apart, and belong to a name."""

from itertools import combinations

import numpy as np
import pytest

from solver.instrument.centreline import Flag
from solver.lab import overlay
from solver.methods import METHODS
from vbaa_bench.report import palette

# Ottosson 2020, "A perceptual color space for image processing": linear sRGB to OKLab.
_CONES = [[0.4122, 0.5363, 0.0514], [0.2119, 0.6807, 0.1074], [0.0883, 0.2817, 0.6300]]
_LAB = [[0.2105, 0.7936, -0.0041], [1.9780, -2.4286, 0.4506], [0.0259, 0.7828, -0.8087]]


def linear(colour: str) -> np.ndarray:
    value = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def contrast(one: str, other: str) -> float:
    """Contrast ratio of WCAG 2.2."""
    low, high = sorted(float(linear(c) @ [0.2126, 0.7152, 0.0722]) for c in (one, other))
    return (high + 0.05) / (low + 0.05)


def distance(one: str, other: str) -> float:
    first, second = (np.array(_LAB) @ np.cbrt(np.array(_CONES) @ linear(c)) for c in (one, other))
    return float(np.linalg.norm(first - second))


def test_every_built_in_method_has_a_colour_and_no_two_the_same() -> None:
    assert set(palette.BUILT_IN) == set(METHODS)
    assert set(palette.FLAGS) == {flag.name.lower() for flag in Flag}
    others = [palette.TRUTH, palette.POINTS, palette.TIP, *palette.FLAGS.values()]
    light = [style.light for style in palette.BUILT_IN.values()]
    # On images, the dark scheme's colours are beside those of truth and flags.
    dark = [*(style.dark for style in palette.BUILT_IN.values()), *others]
    for colours in (light, dark):
        for one, other in combinations(colours, 2):
            assert distance(one, other) > 0.05, (one, other)


@pytest.mark.parametrize("name", [*METHODS, *"abcdefghijklmnopqrstuvwxyz"])
def test_names_can_be_read_in_both_schemes(name: str) -> None:
    style = palette.styles([name])[name]
    assert contrast(style.light, palette.LIGHT_PAGE) >= 4.5
    assert contrast(style.dark, palette.DARK_PAGE) >= 4.5


def test_a_colour_does_not_depend_on_the_other_methods() -> None:
    alone = palette.styles(["exact_fit"])["exact_fit"]
    names = ["two_point", "mine", "exact_fit", "exact_fit@area_weighted"]
    together = palette.styles(names)
    assert together["exact_fit"] == together["exact_fit@area_weighted"] == alone
    assert together["mine"] == palette.styles(["mine"])["mine"]
    six = palette.styles([f"method_{n}" for n in range(6)])
    assert len(set(six.values())) == 6


def test_colours_of_images_are_those_of_the_page() -> None:
    assert palette.bgr("#0102ff") == (255, 2, 1)


def test_the_overlays_of_the_antenna_have_the_colours_of_the_report() -> None:
    assert palette.bgr(palette.POINTS) == overlay.MEASURED
    assert palette.bgr(palette.TIP) == overlay.TIP
    for flag, colour in overlay.REJECTED.items():
        assert palette.bgr(palette.FLAGS[flag.name.lower()]) == colour
