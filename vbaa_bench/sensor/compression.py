"""Compression of gray images as JPEG."""

import cv2
import numpy as np

from solver.instrument.arrays import Grey


def jpeg(image: Grey, quality: int) -> Grey:
    """Compress an 8-bit gray image (h, w) as baseline JPEG and decode it; quality is 1 to 100.

    Motion JPEG codes every frame in this way, independently of all others, and gives the same
    gray values.
    """
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE))
