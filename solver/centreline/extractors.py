"""Beam extractors, by name."""

from collections.abc import Callable, Sequence
from typing import Final

from solver.centreline import Extractor
from solver.centreline.area_weighted import area_weighted
from solver.centreline.background_subtracted import learn_centroid
from solver.centreline.extractor import learn_beam
from solver.centreline.guide import Guide
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError


def learn_area_weighted(images: Sequence[Grey], guide: Guide) -> Extractor:
    """Return the paper's extractor, which learns nothing from images of the beam at rest.

    It detects only a bright beam that runs from left to right. Raises InputError where there is
    none.
    """
    if not guide.scans_columns or not all(len(area_weighted(image).points) for image in images):
        raise InputError(
            "the rest images show no bright beam that runs from left to right, "
            "as area_weighted requires"
        )
    return area_weighted


EXTRACTORS: Final[dict[str, Callable[[Sequence[Grey], Guide], Extractor]]] = {
    "profile_fit": learn_beam,
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
