"""The ground without the beam, from images that were taken before the beam was mounted.

Their mean shows what the beam hides at rest. To mount a beam may move the camera a little, and the
light may change: the mean is brought to the place and the brightness of another image.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from solver.centreline.noise import Noise, mean_image
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.medians import SIGMA_OVER_MAD

# Half the width [px] of Lanczos's interpolation (Duchon 1979). Chosen: with 4, structure of three
# pixels and more is interpolated to a hundredth of its contrast.
_LOBES: Final = 4
# Margin [px] of the image's border without pixels of a lattice: they are shifted and interpolated.
_EDGE: Final = 2 * _LOBES
# Largest shift [px] that is removed, and the largest step towards it. Chosen: mounting a beam moves
# a camera by less; and a gradient holds within half a pixel.
MAX_SHIFT_PX, _STEP_PX = 2.0, 0.5
# Rounds of the shift, and of the weights in each. Chosen: four steps reach the largest shift.
_ROUNDS, _WEIGHINGS = 8, 3
# Number of pixels on which an image is compared with the ground: the noise of a median is then 2 %.
LATTICE: Final = 4000
# Fewest such pixels of a ground with structure. Chosen: fewer may be an edge of the clamp.
MIN_PIXELS: Final = 100
# Blur [px] of the ground that represents a ground without structure.
SMOOTH_PX: Final = 8.0
# Largest scatter, over the noise, on the ground of the rest images. Chosen, as for landmarks: it
# allows for compression and changed light.
MAX_SCATTER: Final = 4.0

Pattern = npt.NDArray[np.float32]
Index = npt.NDArray[np.int64]


class Lattice(NamedTuple):
    """Pixels at `rows` and `columns` (n,) on which images are compared with a ground."""

    rows: Index
    columns: Index


class Match(NamedTuple):
    """How an image shows a known ground: `gain` of its light and `shift` (2,) [px] in u and v.

    `sigma` (2,) [px] is that of the shift, `scatter` that of the pixels' deviations, in sigmas.
    """

    gain: float
    shift: Floats
    sigma: Floats
    scatter: float

    @property
    def is_shifted(self) -> bool:
        """Whether the shift is significant."""
        return bool((np.abs(self.shift) > 3 * self.sigma).any())


class GroundAtRest(NamedTuple):
    """How the rest images show the ground of `images` distinct images without the beam.

    `ground` has their place and brightness; it is None if it has no structure, and if it `differs`
    from that of the rest images. `match` is None without structure, and without a match.
    """

    images: int
    ground: "BareGround | None" = None
    match: Match | None = None
    differs: bool = False

    @property
    def problem(self) -> str:
        """Why the images of a ground with structure are not used; "" if they are."""
        if not self.differs:
            return ""
        return (
            "the images in ground/ do not show the ground of the rest images, and are not used: "
            "take them before the beam is mounted, with the same camera, place and light"
        )


class BareGround(NamedTuple):
    """Mean `gray` (height, width) of `images` distinct images of the ground without the beam."""

    gray: Pattern
    images: int

    def at_rest(self, mean: Floats, noise: Noise, images: int) -> GroundAtRest:
        """Register the ground to the `mean` (height, width) of so many rest images."""
        lattice = structured(self.gray, noise)
        if len(lattice.rows) < MIN_PIXELS:
            return GroundAtRest(self.images)
        found = match(mean, self.gray, lattice, noise, 1 / self.images, 1 / images)
        if found is None or found.scatter > MAX_SCATTER:
            return GroundAtRest(self.images, match=found, differs=True)
        gray = shifted(self.gray, found.shift) if found.is_shifted else self.gray
        ground = BareGround(np.asarray(found.gain * gray, np.float32), self.images)
        return GroundAtRest(self.images, ground, found)


def bare_ground(images: Sequence[Grey]) -> BareGround | None:
    """Average images (height, width) of the ground; copies count once. Return None without any."""
    distinct: list[Grey] = []
    for image in images:
        if not any(np.array_equal(image, earlier) for earlier in distinct):
            distinct.append(image)
    if not distinct:
        return None
    return BareGround(np.asarray(mean_image(distinct), np.float32), len(distinct))


def structured(gray: Pattern, noise: Noise) -> Lattice:
    """Choose pixels that differ by more than noise from a smooth ground (height, width)."""
    blurred = cv2.GaussianBlur(gray, (0, 0), SMOOTH_PX)
    distinct: Mask = (gray - blurred) ** 2 > noise.variance(gray.astype(np.float64))
    inside = np.zeros_like(distinct)
    inside[_EDGE:-_EDGE, _EDGE:-_EDGE] = True
    return thinned(distinct & inside)


def thinned(where: Mask) -> Lattice:
    """Choose about LATTICE of the pixels in a mask (height, width), evenly."""
    rows, columns = np.nonzero(where)
    step = max(len(rows) // LATTICE, 1)
    # For another layout, functions would be compiled again.
    return Lattice(*(np.ascontiguousarray(index[::step]) for index in (rows, columns)))


def shifted(gray: Pattern, shift: Floats) -> Pattern:
    """Shift gray values (height, width) by `shift` (2,) [px] towards larger u and v."""
    along, down = (_kernel(float(one)) for one in shift)
    moved = cv2.sepFilter2D(gray, cv2.CV_32F, along, down, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.float32)


def _kernel(shift: float) -> Pattern:
    """Compute Lanczos's weights of the pixels about one, for a shift [px]."""
    reach = _LOBES + int(np.ceil(abs(shift)))
    x = np.arange(-reach, reach + 1) + shift
    weights = np.where(np.abs(x) < _LOBES, np.sinc(x) * np.sinc(x / _LOBES), 0.0)
    return np.asarray(weights / weights.sum(), np.float32)


def match(
    image: npt.NDArray[Any],
    gray: Pattern,
    lattice: Lattice,
    noise: Noise,
    of_ground: float,
    of_image: float = 1.0,
) -> Match | None:
    """Fit gain and shift of a ground `gray` (height, width) to an image, on a lattice of pixels.

    The variance of a pixel of both is that of `noise`, times `of_ground` and `of_image`. Pixels
    that show something else, such as the beam, do not count. Return None if the shift exceeds
    MAX_SHIFT_PX.
    """
    rows, columns = lattice
    values = np.asarray(image[rows, columns], np.float64)
    sigma = np.sqrt(noise.variance(values) * (of_ground + of_image))
    shift, moved = np.zeros(2), gray
    for _ in range(_ROUNDS):
        found = _small_shift(values, sigma, moved, lattice)
        shift = shift + np.clip(found.shift, -_STEP_PX, _STEP_PX)
        if (np.abs(shift) > MAX_SHIFT_PX).any():
            return None
        if (np.abs(found.shift) < found.sigma).all():
            break
        moved = shifted(gray, shift)
    return found._replace(shift=shift)


def _small_shift(values: Floats, sigma: Floats, gray: Pattern, lattice: Lattice) -> Match:
    """Fit gain and a small shift to `values` (n,), with `sigma` (n,), on a lattice."""
    rows, columns = lattice
    known = gray[rows, columns].astype(np.float64)
    along = (gray[rows, columns + 1] - gray[rows, columns - 1]) / 2
    down = (gray[rows + 1, columns] - gray[rows - 1, columns]) / 2
    gain = float(np.median(values / np.maximum(known, 1.0)))
    design = np.column_stack([known, -gain * along, -gain * down]) / sigma[:, None]
    whitened, solution = values / sigma, np.array([gain, 0.0, 0.0])
    for _ in range(_WEIGHINGS):
        residual = whitened - design @ solution
        scatter = SIGMA_OVER_MAD * float(np.median(np.abs(residual)))
        cut = THRESHOLDS.tukey_cut * max(scatter, 1.0)
        weight = np.clip(1 - (residual / cut) ** 2, 0.0, 1.0) ** 2
        inverse = np.linalg.pinv(design.T @ (weight[:, None] * design), hermitian=True)
        solution = inverse @ (design.T @ (weight * whitened))
    deviation = np.sqrt(np.diag(inverse)[1:]) * max(scatter, 1.0)
    return Match(float(solution[0]), solution[1:], deviation, scatter)
