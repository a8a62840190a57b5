"""Entities in the image: the frame, the true beam, and true and estimated contacts."""

import cv2
import numpy as np

from vbaa_bench.report import palette
from vbaa_bench.report.gallery import display
from vbaa_bench.viewer.contact import estimated_contact
from vbaa_bench.viewer.frames import ViewedFrame
from vbaa_bench.viewer.log import Log, present

IMAGE = "space/camera"
# From OpenCV's pixels, whose centres have integer coordinates, to those of rerun.
_HALF_PIXEL = np.array([0.5, 0.5])


def write_picture(log: Log, frame: ViewedFrame, colours: dict[str, str]) -> None:
    """Write the image of a frame, brightened for display, and what is drawn on it."""
    overlay = frame.overlay
    success, png = cv2.imencode(".png", display(overlay.image))
    assert success
    image = log.rr.EncodedImage(contents=bytes(png), media_type="image/png")
    log.write(f"{IMAGE}/image", image)
    log.lines(f"{IMAGE}/beam", [overlay.centreline + _HALF_PIXEL], palette.TRUTH, 0.7)
    contact = None if overlay.contact is None else overlay.contact + _HALF_PIXEL
    log.points(f"{IMAGE}/contact", present(contact), palette.TRUTH, 5.0, "true contact")
    for method, colour in colours.items():
        position = overlay.estimates.get(method)
        shifted = None if position is None else position + _HALF_PIXEL
        log.points(f"{IMAGE}/estimates/{method}", present(shifted), colour, 3.0, method)
        estimate = estimated_contact(frame, method)
        outline = None if estimate is None else estimate.ellipse
        strips = [] if outline is None else [frame.truth.camera.project(outline) + _HALF_PIXEL]
        log.lines(f"{IMAGE}/estimates/{method}/ellipse", strips, colour)
