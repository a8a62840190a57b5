"""Thresholds of the camera's calibration.

Derived: computed from what is stated. Measured: on what is stated. Chosen: by judgement.
"""

from typing import Final, NamedTuple


class CalibrationThresholds(NamedTuple):
    """Thresholds of the camera's calibration."""

    # Fewest points of a target that may be partly visible, in at least three rows and columns.
    # Chosen.
    min_target_points: int = 12
    # Least fraction of the beam at rest that the camera shows; some of it must be in the image.
    # Chosen: no method gives an estimate from less than half of a beam.
    min_visible: float = 0.5
    # Distance of a crossing from its expected pixel, over the distance to its neighbour. Chosen:
    # half of the distance at which it would be confused with the next crossing's.
    max_lattice_deviation: float = 0.25
    # A crossing's response over the typical one; line ends and dirt respond less. Chosen.
    min_response: float = 0.3
    # A thick line's width over its neighbours'. Chosen: it is printed twice as wide.
    min_thick_ratio: float = 1.5
    # Distance of a crossing of the curves from its detection, over the lines' distance. Chosen.
    max_crossing_deviation: float = 0.15
    # Fewest views of a board that determine a lens.
    min_views: int = 3
    # A point's error over the median error, above which it is an outlier. Derived: noise alone
    # exceeds it in one point of 100 000.
    outlier_ratio: float = 4.0
    # Stretch of a printed board, and its sigmas. First, chosen: the focal length errs by up to six
    # times as much. Second, derived: noise alone exceeds it once in two million.
    max_stretch: float = 1e-3
    max_stretch_sigmas: float = 5.0


THRESHOLDS: Final = CalibrationThresholds()
