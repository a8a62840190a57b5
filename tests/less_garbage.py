"""Plugin of mypy: collect garbage less often, which takes a quarter of its time."""

import gc
from typing import Final

from mypy.plugin import Plugin

# Objects that are created before a collection. Measured for this project: with mypy's own number it
# takes 0.96 GB; 2 million take a sixth less time and 1.15 GB, 8 million another 15 % less and
# 1.64 GB; without collections it takes 2.2 GB.
_OBJECTS: Final = 8_000_000


def plugin(_version: str) -> type[Plugin]:
    """Return a plugin that changes nothing else."""
    gc.set_threshold(_OBJECTS, 30, 1000)
    return Plugin
