"""Background-subtracted centroid: the mean row of the signal above the local background.

The beam is detected as for the profile fit. In every column that shows it, the straight line
through the background on its two sides is subtracted; the centroid of the remainder within a window
is the centre. The method has no threshold, hence no S-curve, and needs no profile. Every pixel of
the window adds its noise in proportion to its distance from the centre, whereas the profile fit
gives no weight to the flanks, which hold no information.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from solver.centreline import Centreline, Flag
from solver.centreline.extractor import BeamExtractor, learn_beam
from solver.centreline.guide import Guide
from solver.centreline.profile_fit import MARGIN
from solver.instrument.arrays import Floats, Grey


@dataclass(frozen=True)
class Centroid:
    """Beam extractor by the centroid, in every column in which `beam` measures the beam."""

    beam: BeamExtractor

    def __call__(self, image: Grey) -> Centreline:
        """Extract the centreline of an image (height, width); empty where there is no beam.

        Columns with a pixel at full scale are rejected: its true brightness is unknown.
        """
        found, look = self.beam(image), self.beam.appearance
        upright = found.directions[:, 1] != 0
        window = _windows(image, found.points, upright, look.half)
        ends = window >= look.full_scale
        centre, variance = _centroids(window, look.half, look.noise.variance(window))
        centre += np.rint(np.where(upright, found.points[:, 1], found.points[:, 0]))
        good = ~ends.any(axis=1) & np.isfinite(centre) & np.isfinite(variance)
        points = np.array(found.points)
        points[upright, 1], points[~upright, 0] = centre[upright], centre[~upright]
        return replace(
            found,
            points=points[good],
            directions=found.directions[good],
            sigma=np.sqrt(variance[good]),
            rejected=np.vstack([found.rejected, found.points[~good]]),
            flags=np.append(
                found.flags, np.full(np.count_nonzero(~good), Flag.SATURATED, np.uint8)
            ),
        )


def learn_centroid(images: Sequence[Grey], guide: Guide) -> Centroid:
    """Learn the beam from images (height, width) of it at rest. Raises InputError."""
    return Centroid(learn_beam(images, guide))


def _windows(image: Grey, points: Floats, upright: npt.NDArray[np.bool_], half: int) -> Floats:
    """Return gray values (n, 2 half + 1) about points (n, 2), along their columns or rows."""
    u, v = np.rint(points).astype(np.int64).T
    reach = np.arange(-half, half + 1)
    rows = v[:, None] + np.where(upright[:, None], reach, 0)
    columns = u[:, None] + np.where(upright[:, None], 0, reach)
    return np.asarray(image[rows, columns], dtype=np.float64)


def _centroids(window: Floats, half: int, variance: Floats) -> tuple[Floats, Floats]:
    """Compute centroids (n,) from the windows' middles, and variances from pixels' `variance`."""
    x = np.arange(-half, half + 1, dtype=np.float64)
    outside = np.abs(x) > half - MARGIN
    line = np.column_stack([np.ones_like(x), x])
    # Matrix that subtracts from a window the straight line through its outer pixels.
    clear = np.eye(len(x))
    clear[:, outside] -= line @ np.linalg.pinv(line[outside])
    clear[outside] = 0.0
    over = window @ clear.T
    area = over.sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = over @ x / area
        # d centre / d gray, including the effect through the background.
        lever = ((x - centre[:, None]) / area[:, None]) @ clear
    return np.asarray(centre), np.asarray((lever**2 * variance).sum(axis=1))
