"""Light, and what lies under the beam."""

from typing import Literal

from vbaa_bench.spec.part import Part, Positive, Share


class LightSpec(Part):
    """A square lamp facing plane C, about the camera's axis and behind the camera."""

    side_mm: Positive = 700
    height_mm: Positive = 420


class BackgroundSpec(Part):
    """A matt sheet below plane C, wider than the camera sees; plain, or with darker squares."""

    distance_mm: Positive = 30
    reflectance: Share = 0.05
    pattern: Literal["plain", "squares"] = "plain"
    square_mm: Positive = 15
    square_reflectance: Share = 0.02
    # Fixed to the antenna's base plate, or lying in the world, where it turns past the camera.
    lies_in: Literal["antenna", "world"] = "antenna"
