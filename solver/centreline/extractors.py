"""Beam extractors, by name."""

from collections.abc import Callable, Sequence
from typing import Final

from solver.centreline.area_weighted import learn_area_weighted
from solver.centreline.background_subtracted import learn_centroid
from solver.centreline.extractor import Extractor, learn_profile_fit
from solver.centreline.guide import Guide
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError

EXTRACTORS: Final[dict[str, Callable[[Sequence[Grey], Guide], Extractor]]] = {
    "profile_fit": learn_profile_fit,
    "background_subtracted": learn_centroid,
    "area_weighted": learn_area_weighted,
}


def find_extractor(name: str) -> Callable[[Sequence[Grey], Guide], Extractor]:
    """Return the function that learns an extractor from rest images. Raises InputError."""
    if name not in EXTRACTORS:
        raise InputError(
            f"centreline '{name}' is unknown, allowed is one of {', '.join(EXTRACTORS)}"
        )
    return EXTRACTORS[name]
