"""Colours and marker shapes of methods: fixed by name, in a light and in a dark scheme."""

import zlib
from collections.abc import Sequence
from typing import Final, NamedTuple


class Style(NamedTuple):
    """Colours (#rrggbb) of a method on a light and on a dark page, and its marker's shape."""

    light: str
    dark: str
    shape: str


# Backgrounds of the page, as in style.css.
LIGHT_PAGE: Final = "#ffffff"
DARK_PAGE: Final = "#14171a"
# Chosen: a contrast of at least 4.5 on the page (WCAG 2.2, 1.4.3), and all colours and flags
# at least 0.05 apart in OKLab. Tests measure both.
BUILT_IN: Final = {
    "two_point": Style("#b3261e", "#ff8a80", "square"),
    "three_point": Style("#9a5b00", "#f2a73b", "triangle"),
    "moment_sensor": Style("#5c6b00", "#c3d04a", "diamond"),
    "stiffness": Style("#6b4423", "#c9a181", "circle"),
    "linear_fit": Style("#0a7a3c", "#5fd08a", "square"),
    "exact_fit": Style("#0b57d0", "#7db4ff", "circle"),
    "exact_fit_3d": Style("#00737f", "#48d1dd", "diamond"),
    "exact_fit_learned": Style("#8a6d00", "#ffd54a", "diamond"),
    "two_contact_fit": Style("#8a2be2", "#d7a6ff", "square"),
    "hung_weight": Style("#4a5a2a", "#a8c98a", "triangle"),
    "push_fit": Style("#6a1fd0", "#b99bff", "triangle"),
    "push_fit_friction": Style("#b80c7a", "#ff7fcf", "circle"),
    "force_sensor": Style("#3d4752", "#b4bfca", "square"),
}
# Methods of users.
_OTHERS: Final = (
    Style("#7a0c3e", "#ff9dbb", "diamond"),
    Style("#2c3a96", "#9aa5ff", "square"),
    Style("#1f5c4d", "#8fe0c8", "triangle"),
    Style("#7d4a8c", "#e0b0f0", "square"),
    Style("#4f5d3a", "#d6dfb8", "circle"),
    Style("#8c3b12", "#ffb59a", "diamond"),
)
# On images, which look the same in both schemes. Truth; measured points; tip.
TRUTH: Final = "#3cdc46"
POINTS: Final = "#ffe814"
TIP: Final = "#3cf5ff"
# Expected positions of the beam without a measured point, by the name of the flag.
FLAGS: Final = {"hidden": "#2f6bff", "saturated": "#ff4a00", "foreign": "#f01cf0"}


def styles(methods: Sequence[str]) -> dict[str, Style]:
    """Assign a style to each method by its name.

    A method with another centreline, such as two_point@area_weighted, has the colour of the method.
    Other names have one of six styles by their CRC-32; if two names of a report have the same, the
    alphabetically later one has the next free style.
    """
    chosen: dict[str, Style] = {}
    for base in sorted({name.partition("@")[0] for name in methods}):
        if base in BUILT_IN:
            chosen[base] = BUILT_IN[base]
            continue
        first = zlib.crc32(base.encode())
        order = [_OTHERS[(first + step) % len(_OTHERS)] for step in range(len(_OTHERS))]
        chosen[base] = next((one for one in order if one not in chosen.values()), order[0])
    return {name: chosen[name.partition("@")[0]] for name in methods}


def bgr(colour: str) -> tuple[int, int, int]:
    """Convert a colour #rrggbb to OpenCV's order."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return blue, green, red
