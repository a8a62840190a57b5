"""A plain ridge detector with OpenCV, the baseline: the ridge is followed from the start."""

from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats

# Standard deviation of the blur over the width: the response to a bar is then largest.
_BLUR_WIDTHS: Final = 12**-0.5
_HALF_STRIP: Final = 0.2
# Most pixels across per pixel along. Chosen: a slope of 45 degrees.
_STEP: Final = 1


def ridge_points(image: npt.NDArray[np.uint8], start: Floats, end: Floats, width: float) -> Floats:
    """Follow the ridge of a bright or dark line of known width [px] from start to end: (n, 2) [px].

    The gray image is turned so that the line from start to end is a row; in each column the
    second difference of the blurred image has its largest size, next to the place before.
    """
    gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.float32)
    chord = end - start
    length = float(np.linalg.norm(chord))
    along = chord / length
    across = np.array([-along[1], along[0]])
    half = int(_HALF_STRIP * length + 16)
    corner = start - half * across
    turn = np.vstack([np.column_stack([along, across, corner]), [0.0, 0.0, 1.0]])
    size = (int(length) + 1, 2 * half + 1)
    strip = cv2.warpAffine(gray, np.linalg.inv(turn)[:2], size, borderMode=cv2.BORDER_REPLICATE)
    blurred = np.asarray(cv2.GaussianBlur(strip, (0, 0), _BLUR_WIDTHS * width))
    response = np.zeros_like(blurred)
    response[1:-1] = 2 * blurred[1:-1] - blurred[:-2] - blurred[2:]
    column = response[half - 8 : half + 9, :8].sum(axis=1)
    sign = 1.0 if column.max() > -column.min() else -1.0
    response = sign * response
    place, places = half - 8 + int(np.argmax(response[half - 8 : half + 9, 0])), []
    for x in range(size[0]):
        low = max(place - _STEP, 1)
        place = low + int(np.argmax(response[low : min(place + _STEP, 2 * half - 1) + 1, x]))
        before, here, after = response[place - 1 : place + 2, x]
        curvature = before - 2 * here + after
        shift = 0.5 * (before - after) / curvature if curvature < 0 else 0.0
        places.append(place + float(np.clip(shift, -0.5, 0.5)))
    return np.asarray(
        corner + np.arange(size[0])[:, None] * along + np.array(places)[:, None] * across
    )
