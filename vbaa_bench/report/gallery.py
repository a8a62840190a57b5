"""Drawing of the truth and the estimates on frames."""

import base64
from collections.abc import Mapping, Sequence
from typing import Final

import cv2
import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.centreline import Flag
from vbaa_bench.report import palette
from vbaa_bench.scoring.overlay import Overlay

# BGR, of `palette`.
TRUTH: Final = palette.bgr(palette.TRUTH)
POINTS: Final = palette.bgr(palette.POINTS)
TIP: Final = palette.bgr(palette.TIP)
# Expected positions of the beam without a measured point, by reason.
REJECTED: Final = {flag: palette.bgr(palette.FLAGS[flag.name.lower()]) for flag in Flag}
_FRACTION_BITS = 4


Colours = Mapping[str, tuple[int, int, int]]


def colours_of(methods: Sequence[str]) -> dict[str, tuple[int, int, int]]:
    """Return the colour of each method, by its name: bright, as images are dark."""
    return {name: palette.bgr(style.dark) for name, style in palette.styles(methods).items()}


def strip(overlay: Overlay, colours: Colours, scale: int = 2, margin_px: int = 14) -> np.ndarray:
    """Draw the beam's part of the frame, enlarged: truth, and a ring for each method's contact.

    Of the measured centreline only rejected points and the tip are drawn: other points would cover
    the beam.
    """
    _, low = overlay.centreline.min(axis=0)
    _, high = overlay.centreline.max(axis=0)
    last = overlay.image.shape[0] - 1
    top = int(np.clip(low - margin_px, 0, last))
    bottom = int(np.clip(high + margin_px, top, last))
    view = _View(overlay.image, (0, top), (overlay.image.shape[1], bottom - top + 1), scale)
    view.line(overlay.centreline, TRUTH, offset_px=3)
    view.line(overlay.centreline, TRUTH, offset_px=-3)
    _rejected(view, overlay, radius_px=0.6)
    _contacts(view, overlay, colours, radius_px=4)
    return view.canvas


def whole(overlay: Overlay, scale: int) -> np.ndarray:
    """Draw the whole frame, enlarged, with the truth; `overlay` must contain no estimates."""
    return strip(overlay, {}, scale, margin_px=max(overlay.image.shape))


def close_up(overlay: Overlay, colours: Colours, scale: int = 10, half_px: int = 24) -> np.ndarray:
    """Draw the surroundings of the contact, strongly enlarged, with all measured points."""
    half_px = min(half_px, (min(overlay.image.shape) - 1) // 2)
    middle = overlay.centreline[-1] if overlay.contact is None else overlay.contact
    u, v = np.rint(middle).astype(int)
    left = int(np.clip(u - half_px, 0, overlay.image.shape[1] - 2 * half_px - 1))
    top = int(np.clip(v - half_px, 0, overlay.image.shape[0] - 2 * half_px - 1))
    size = 2 * half_px + 1
    view = _View(overlay.image, (left, top), (size, size), scale)
    view.line(overlay.centreline, TRUTH)
    if overlay.measured is not None:
        for point in overlay.measured.points:
            view.dot(point, POINTS)
    _rejected(view, overlay, radius_px=0.2)
    _contacts(view, overlay, colours, radius_px=1.6)
    return view.canvas


def overlay_png(frame: Overlay, colours: Colours) -> bytes:
    """Draw a frame and its enlarged contact side by side, as PNG."""
    parts = (strip(frame, colours), close_up(frame, colours, scale=6))
    height = max(map(len, parts))
    canvases = []
    for part in parts:
        padded = np.full((height, part.shape[1], 3), 255, np.uint8)
        padded[: len(part)] = part
        canvases.append(padded)
    gap = np.full((height, 8, 3), 255, np.uint8)
    _, picture = cv2.imencode(".png", np.hstack([canvases[0], gap, canvases[1]]))
    return bytes(picture)


def webp_uri(canvas: np.ndarray) -> str:
    """Encode an image (height, width) or (height, width, 3) as a data URI."""
    _, data = cv2.imencode(".webp", canvas, [cv2.IMWRITE_WEBP_QUALITY, 80])
    return "data:image/webp;base64," + base64.b64encode(bytes(data)).decode("ascii")


def display(image: np.ndarray) -> np.ndarray:
    """Apply the gamma of a display: linear sensor values appear too dark on a screen."""
    return np.asarray(np.rint(255 * (image / 255.0) ** (1 / 2.2)), np.uint8)


def _contacts(view: "_View", overlay: Overlay, colours: Colours, radius_px: float) -> None:
    if overlay.contact is not None:
        view.cross(overlay.contact, TRUTH, radius_px)
    for name, position in overlay.estimates.items():
        view.ring(position, colours[name], radius_px)


def _rejected(view: "_View", overlay: Overlay, radius_px: float) -> None:
    """Draw the rejected points, and the tip as a small square."""
    measured = overlay.measured
    if measured is None:
        return
    for point, flag in zip(measured.rejected, measured.flags, strict=True):
        view.dot(point, REJECTED[Flag(int(flag))], radius_px)
    if measured.tip is not None:
        view.square(measured.tip, TIP, 4 * radius_px)


class _View:
    """Part of an image, enlarged by a whole factor; coordinates are the image's own pixels."""

    def __init__(
        self, image: np.ndarray, corner: tuple[int, int], size: tuple[int, int], scale: int
    ) -> None:
        (left, top), (width, height) = corner, size
        part = image[top : top + height, left : left + width]
        large = cv2.resize(display(part), None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
        self.canvas = cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)
        self._corner, self._scale = np.array(corner), scale

    def _place(self, pixels: Floats) -> np.ndarray:
        """Map pixels to the canvas; a pixel's centre is the centre of its enlarged square."""
        large = (np.asarray(pixels) - self._corner + 0.5) * self._scale - 0.5
        return np.asarray(np.rint(large * 2**_FRACTION_BITS), dtype=np.int32)

    def line(self, pixels: Floats, colour: tuple[int, int, int], offset_px: float = 0.0) -> None:
        shifted = pixels + np.array([0.0, offset_px])
        path = [self._place(shifted)]
        cv2.polylines(self.canvas, path, False, colour, 1, cv2.LINE_AA, _FRACTION_BITS)

    def dot(self, pixel: Floats, colour: tuple[int, int, int], radius_px: float = 0.12) -> None:
        self._circle(pixel, radius_px * self._scale, colour, -1)

    def square(self, pixel: Floats, colour: tuple[int, int, int], half_px: float) -> None:
        corners = half_px * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        path = [self._place(pixel + corners)]
        cv2.polylines(self.canvas, path, True, colour, 2, cv2.LINE_AA, _FRACTION_BITS)

    def ring(self, pixel: Floats, colour: tuple[int, int, int], radius_px: float) -> None:
        self._circle(pixel, radius_px * self._scale, colour, 2)

    def cross(self, pixel: Floats, colour: tuple[int, int, int], radius_px: float) -> None:
        for arm in ((1, 1), (1, -1)):
            ends = np.array([pixel - radius_px * np.array(arm), pixel + radius_px * np.array(arm)])
            path = [self._place(ends)]
            cv2.polylines(self.canvas, path, False, colour, 1, cv2.LINE_AA, _FRACTION_BITS)

    def _circle(
        self, pixel: Floats, radius: float, colour: tuple[int, int, int], thickness: int
    ) -> None:
        u, v = (int(c) for c in self._place(pixel))
        large_radius = round(radius * 2**_FRACTION_BITS)
        cv2.circle(
            self.canvas, (u, v), large_radius, colour, thickness, cv2.LINE_AA, _FRACTION_BITS
        )
