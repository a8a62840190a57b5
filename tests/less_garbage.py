"""Plugin of mypy: collect garbage less often, which takes a sixth of its time."""

import gc
from typing import Final

from mypy.plugin import Plugin

# Objects that are created before a collection. Measured: mypy's own number, a tenth of it, takes
# 47 s and 0.96 GB for this project; this one 39 s and 1.13 GB; none at all 33 s and 2.2 GB.
_OBJECTS: Final = 2_000_000


def plugin(_version: str) -> type[Plugin]:
    """Return a plugin that changes nothing else."""
    gc.set_threshold(_OBJECTS, 30, 1000)
    return Plugin
