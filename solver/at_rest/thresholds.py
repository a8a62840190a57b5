"""Thresholds of what is learned from the rest images, and of the comparison with them.

Derived: computed from what is stated. Measured: on what is stated. Chosen: by judgement.
"""

from typing import Final, NamedTuple


class AtRestThresholds(NamedTuple):
    """Thresholds of what is learned from the rest images, and of the comparison with them."""

    # Fewest points of the beam at rest, for its pose. Chosen.
    min_points: int = 10
    # Decrease of chi^2 by the three coefficients of a bow, at which it is accepted. Derived: noise
    # alone decreases it by as much once in 700 000.
    bow_chi2: float = 30.0
    # An image differs from the others if it exceeds both: chi^2 for four coefficients, exceeded by
    # chance once in a million; and pixels. Chosen: compressed images differ by less without motion.
    disagreement_chi2: float = 33.0
    disagreement_px: float = 0.05
    # Difference [px] among rest images. Chosen: half of the motion to be detected.
    max_disagreement_px: float = 0.25
    # Angle [rad] between the beam and the rig's x axis. Derived: the search covers 0.12 rad, and a
    # bow adds to that.
    max_misalignment: float = 0.17
    # A landmark's gradient, per pixel, in sigmas of the noise. Chosen.
    min_gradient: float = 3.0
    # chi^2 of a shift (du, dv). Derived: as unlikely by chance as three sigmas of one normal
    # variable.
    moved_chi2: float = 11.83
    # Shadows and reflections move edges by about this much [px] without any motion. Chosen: a tenth
    # of the half pixel to be detected.
    steadiness_px: float = 0.05
    # Sigma [px] of a shift, in every direction, at which half a pixel is detected. Derived: five
    # sigmas.
    known_sigma_px: float = 0.1
    # The residuals over the noise, above which the pixels are not those of the rest images. Chosen:
    # it allows for compression and changed light.
    max_scatter: float = 4.0
    # Least fraction of landmarks that agree on the shift. Measured: with a chequered ground that
    # turns below the camera, half of them agree with any shift.
    min_share: float = 0.75
    # Change of the light. Chosen: an object that covers the landmarks lacks their edges.
    max_gain: float = 2.0
    # Difference of the landmarks' light from that of the whole image, over the latter. Chosen:
    # lamps drift together, and a shadow takes more.
    max_shade: float = 0.05


THRESHOLDS: Final = AtRestThresholds()
