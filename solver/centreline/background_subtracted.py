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

from solver.centreline import Centreline, Flag
from solver.centreline.extractor import BeamExtractor, learn_profile_fit
from solver.centreline.guide import Guide
from solver.centreline.profile_fit import MARGIN
from solver.centreline.stations import column_pixels
from solver.instrument.arrays import Floats, Grey


@dataclass(frozen=True)
class CentroidExtractor:
    """Beam extractor by the centroid, in every column in which `beam` measures the beam."""

    beam: BeamExtractor

    @property
    def shading(self) -> float:
        """Weight of the beam's own shading in its centroid."""
        return self.beam.appearance.shading

    @property
    def detector(self) -> BeamExtractor:
        """Extractor that detects the beam and its tip."""
        return self.beam

    def __call__(self, image: Grey) -> Centreline:
        """Extract the centreline of an image (height, width); empty where there is no beam.

        Columns with a pixel at full scale are rejected: its true brightness is unknown. Columns
        whose window the image cuts off are left out.
        """
        line, appearance = self.beam(image), self.beam.appearance
        half = appearance.half
        upright = line.directions[:, 1] != 0
        u, v = np.rint(line.points).astype(np.int64).T
        along, middle = np.where(upright, (u, v), (v, u))
        limit = np.asarray(np.where(upright, image.shape[0], image.shape[1]))
        whole = (middle >= half) & (middle < limit - half)
        upright, middle = upright[whole], middle[whole]
        pixels = column_pixels(along[whole], middle, upright, half)
        window = np.asarray(image[pixels], dtype=np.float64)
        centre, variance = _centroids(window, half, appearance.noise.variance(window))
        centre += middle
        reasons = np.zeros(len(middle), np.uint8)
        reasons[~(np.isfinite(centre) & np.isfinite(variance))] = Flag.FOREIGN
        reasons[(window >= appearance.full_scale).any(axis=1)] = Flag.SATURATED
        good = reasons == 0
        expected = line.points[whole]
        points = np.array(expected)
        points[upright, 1], points[~upright, 0] = centre[upright], centre[~upright]
        return replace(
            line,
            points=points[good],
            directions=line.directions[whole][good],
            sigma=np.sqrt(variance[good]),
            lost_light=line.lost_light[whole][good],
            rejected=np.vstack([line.rejected, expected[~good]]),
            flags=np.append(line.flags, reasons[~good]),
            grid_error=None,  # it is that of the profile fit
        )


def learn_centroid(images: Sequence[Grey], guide: Guide) -> CentroidExtractor:
    """Learn the beam from images (height, width) of it at rest. Raises InputError."""
    return CentroidExtractor(learn_profile_fit(images, guide))


def _centroids(window: Floats, half: int, variance: Floats) -> tuple[Floats, Floats]:
    """Compute centroids (n,) from the windows' middles, and variances from pixels' `variance`."""
    x = np.arange(-half, half + 1, dtype=np.float64)
    outside = np.abs(x) > half - MARGIN
    basis = np.column_stack([np.ones_like(x), x])
    # Matrix that subtracts from a window the straight line through its outer pixels.
    subtract = np.eye(len(x))
    subtract[:, outside] -= basis @ np.linalg.pinv(basis[outside])
    subtract[outside] = 0.0
    signal = window @ subtract.T
    area = signal.sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = signal @ x / area
        # d centre / d gray, including the effect through the background.
        gradient = ((x - centre[:, None]) / area[:, None]) @ subtract
    return np.asarray(centre), np.asarray((gradient**2 * variance).sum(axis=1))
