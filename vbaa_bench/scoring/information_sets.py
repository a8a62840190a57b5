"""Information sets: what a method may use, and so the limit with which it is compared.

A method's process imports this module, which needs no table.
"""

from typing import Any, Final

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
# The set of each method of the solver. Others use "image", unless they declare another one.
_OF_METHOD: Final = {
    "two_point": "planar",
    "three_point": "image",
    "moment_sensor": "moment",
    "stiffness": "push",
    "linear_fit": "planar",
    "exact_fit": "planar",
    "exact_fit_3d": "image",
    "exact_fit_learned": "learned",
    "two_contact_fit": "planar",
    "hung_weight": "planar",
    "push_fit": "push",
    "push_fit_friction": "push",
    "force_sensor": "force",
}
# Methods that use a moment sensor where there is one.
_WITH_SENSOR: Final = ("exact_fit_3d",)


def information_of(method: str, scene: dict[str, Any]) -> str:
    """Return the information set of a method by its name, of which the centreline is no part."""
    name = method.partition("@")[0]
    if name in _WITH_SENSOR and scene.get("moment_sensor") is not None:
        return "moment"
    return _OF_METHOD.get(name, "image")


def check_information(name: str, source: str) -> None:
    """Raise InputError unless `name`, which `source` declares, is an information set."""
    if name not in SETS:
        raise InputError(
            f"{source}: information {quoted(name)} is unknown, allowed is one of {', '.join(SETS)}"
        )
