"""Beam extractors, by name."""

from collections.abc import Callable, Sequence
from typing import Final

from solver.centreline.area_weighted import learn_area_weighted
from solver.centreline.background_subtracted import learn_centroid
from solver.centreline.extractor import Extractor, learn_profile_fit
from solver.centreline.guide import Guide
from solver.instrument.arrays import Grey
from solver.instrument.by_name import find_by_name

# Learns an extractor from images (height, width) at rest.
LearnExtractor = Callable[[Sequence[Grey], Guide], Extractor]
EXTRACTORS: Final[dict[str, LearnExtractor]] = {
    "profile_fit": learn_profile_fit,
    "background_subtracted": learn_centroid,
    "area_weighted": learn_area_weighted,
}


def find_extractor(name: str) -> LearnExtractor:
    """Return what learns an extractor, by its name in EXTRACTORS or as package.module:function.

    Raises InputError.
    """
    return find_by_name("centreline", name, EXTRACTORS)
