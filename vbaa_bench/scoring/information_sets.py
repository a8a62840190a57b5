"""Names of information sets, which a method's process imports without any table."""

from typing import Final

from solver.instrument.errors import InputError, quoted

# Information sets, as in the table of limits, in words.
SETS: Final = {
    "planar": "the image and the known plane",
    "learned": "the image, the known plane and the pushes to learn from",
    "image": "the image",
    "moment": "the image and the moment sensor",
    "force": "the image and the force sensor",
    "push": "the images of the push",
}


def check_information(name: str, source: str) -> None:
    """Raise InputError unless `name`, which `source` declares, is an information set."""
    if name not in SETS:
        raise InputError(
            f"{source}: information {quoted(name)} is unknown, allowed is one of {', '.join(SETS)}"
        )
