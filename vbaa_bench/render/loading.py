"""Loading of Mitsuba's objects in a fixed order."""

from typing import Any

import mitsuba as mi


def load(description: dict[str, Any]) -> Any:
    """Load an object and its parts, one after the other.

    Mitsuba's threads would number the parts in any order. The kernels depend on these numbers, so
    that Dr.Jit would compile them again instead of taking them from its cache.
    """
    return mi.load_dict(description, parallel=False)
