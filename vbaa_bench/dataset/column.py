"""Descriptions of columns and keys: unit, frame of reference, meaning, and when they are null."""

from typing import Final, NamedTuple


class Column(NamedTuple):
    """Description of a column or key: its meaning, frame of reference, and when it is null."""

    meaning: str
    frame: str = ""
    null: str = ""


# Longest suffix first. A name without one of them is a number without unit or a text.
_UNITS: Final = {
    "_n_mm2": "N mm^2",
    "_mm_per_n": "mm/N",
    "_n_per_m": "N/m",
    "_pct_L": "% of L",
    "_n_mm": "N mm",
    "_n_m": "N/m",
    "_pct": "%",
    "_deg": "deg",
    "_mpa": "MPa",
    "_mm": "mm",
    "_px": "px",
    "_ms": "ms",
    "_n": "N",
}

CLAMP: Final = "clamp"
SIGMA_A: Final = "Sigma_a"
SIGMA_D: Final = "Sigma_d"
SIGMA_O: Final = "Sigma_o"
TABLE: Final = "table"
ALONG_X: Final = "Sigma_a, x axis"
FREE: Final = "nothing is touched"


def unit(name: str) -> str:
    """Return the unit that a name states by its suffix; empty if it states none."""
    return next((text for suffix, text in _UNITS.items() if name.endswith(suffix)), "")
