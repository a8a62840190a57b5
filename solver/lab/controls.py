"""Settings of a camera before its first frame, by OpenCV."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import cv2

from solver.instrument.errors import InputError

# Value of CAP_PROP_AUTO_EXPOSURE for manual exposure: 1 with V4L2, 0 with other back ends.
_MANUAL_EXPOSURE: Final = {"V4L2": 1.0}
# Relative tolerance of the exposure: a camera sets the nearest value that it supports.
_EXPOSURE_TOLERANCE: Final = 0.05


class Adjustable(Protocol):
    """Part of OpenCV's VideoCapture used to set a camera."""

    def get(self, propId: int, /) -> float:
        """Get a property by its number; return 0 if it is unknown."""

    def set(self, propId: int, value: float, /) -> bool:
        """Set a property; return whether this succeeded."""

    def getBackendName(self) -> str:  # noqa: N802 - OpenCV's name
        """Return the name of the back end that accesses the camera."""


@dataclass(frozen=True)
class Controls:
    """Image size [px], exposure in the camera's own unit, and OpenCV's properties by number."""

    size: tuple[int, int] | None = None
    exposure: float | None = None
    properties: tuple[tuple[int, float], ...] = ()


NO_CONTROLS: Final = Controls()


def controls_of(size: str | None, exposure: float | None, control: Sequence[str]) -> Controls:
    """Read the options --size WxH, --exposure and --control NAME=VALUE. Raises InputError."""
    pixels = None
    if size is not None:
        parts = size.lower().split("x")
        if len(parts) != 2 or not all(part.isdecimal() and 0 < int(part) < 1e5 for part in parts):
            raise InputError(f"--size is '{size}', allowed is WIDTHxHEIGHT in pixels: 1280x720")
        pixels = int(parts[0]), int(parts[1])
    return Controls(pixels, exposure, tuple(map(_property, control)))


def _property(text: str) -> tuple[int, float]:
    """Parse a property such as gain=4 or fourcc=Y16; return its number and value."""
    name, _, value = text.partition("=")
    number = getattr(cv2, f"CAP_PROP_{name.strip().upper()}", None)
    if number is None:
        raise InputError(
            f"--control is '{text}', allowed is NAME=VALUE, where OpenCV has a CAP_PROP_NAME: "
            "gain=4, fourcc=Y16, convert_rgb=0"
        )
    if number == cv2.CAP_PROP_FOURCC and 0 < len(value) <= 4:
        return number, float(cv2.VideoWriter.fourcc(*value.ljust(4)))
    try:
        parsed = float(value)
    except ValueError:
        parsed = math.nan
    if not math.isfinite(parsed):
        raise InputError(f"--control is '{text}', allowed after = is a finite number")
    return number, parsed


def set_controls(capture: Adjustable | Any, controls: Controls, name: str) -> None:
    """Set a camera before its first frame. Raises InputError if it rejects a setting."""
    # The format is set first: available sizes depend on it, and exposures on both.
    for number, value in sorted(controls.properties, key=lambda p: p[0] != cv2.CAP_PROP_FOURCC):
        if not capture.set(number, value):
            raise InputError(f"{name} rejects property {number} = {value:g}")
    if controls.size is not None:
        sides = cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT
        for side, pixels in zip(sides, controls.size, strict=True):
            capture.set(side, pixels)
        width, height = (int(capture.get(side)) for side in sides)
        if (width, height) != controls.size:
            raise InputError(
                f"{name} delivers {width} x {height} px, --size is "
                f"{controls.size[0]}x{controls.size[1]}"
            )
    if controls.exposure is not None:
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL_EXPOSURE.get(capture.getBackendName(), 0.0))
        accepted = capture.set(cv2.CAP_PROP_EXPOSURE, controls.exposure)
        actual = capture.get(cv2.CAP_PROP_EXPOSURE)
        if not accepted or abs(actual - controls.exposure) > _EXPOSURE_TOLERANCE * max(
            abs(controls.exposure), 1.0
        ):
            raise InputError(
                f"{name} rejects the exposure {controls.exposure:g}, it has {actual:g}; the "
                "unit is the camera's own (on Linux 0.1 ms, on Windows a power of two of seconds)"
            )
