"""Thresholds of the centreline, from the image to the points and the tip.

Derived: computed from what is stated. Measured: on what is stated. Chosen: by judgement.
"""

from typing import Final, NamedTuple


class CentrelineThresholds(NamedTuple):
    """Thresholds of the centreline, from the image to the points and the tip."""

    # A candidate's contrast, in sigmas of the noise. Chosen.
    candidate_sigmas: float = 5.0
    # A candidate supports a shape up to this distance, the larger of pixels and beam radii. Chosen:
    # a beam of large deflection departs from the linear shapes that are tried by less.
    near_px: float = 3.0
    near_radii: float = 2.0
    # The same for a beam at rest, which is straight. Chosen: a wide band would hold structure of
    # the ground by chance.
    near_radii_at_rest: float = 0.5
    # Fewest agreeing scan lines, of 72, for which the beam is detected. Chosen.
    min_lines: int = 6
    # Smallest fraction of scan lines in the image for a beam at rest. Chosen.
    min_support_at_rest: float = 0.25
    # Mean contrast along a beam at rest, in robust sigmas of that along lines elsewhere. Chosen: of
    # thousands of lines along a texture, the best reaches 4, and the weakest visible beam 9.
    min_line_sigmas: float = 6.0
    # Difference of a beam at rest from the ground about it, over that from its two sides. Chosen:
    # between two lines it is 0 for the ground, and -1 for the lines.
    min_relief: float = 0.5
    # Contrast of a second line beside the beam at rest, over the beam's. Chosen: fainter lines are
    # in the sigma of the points; 16 rendered scenes have none of this contrast.
    min_second_contrast: float = 0.05
    # Such a line within the pixels of a fit moves the beam, at rest and bent almost alike: sigma
    # [px] of the difference over the line's contrast, and largest contrast. Measured: on drawn
    # beams of radius 0.8 and 1.7 px, with sharp and soft lines of up to this contrast 4 and 6 px
    # away; the root mean square was 0.18, the largest difference 0.39.
    overlap_sigma_px: float = 0.2
    max_overlap_contrast: float = 0.3
    # Distance [px] of its middle from the beam's edge, where the beam's contrast has fallen to the
    # share `beam_edge`. Chosen: with 2 px, shadows 5 px beside a beam of radius 0.8 px are missed.
    min_gap_px: float = 1.5
    beam_edge: float = 0.1
    # Relief on the beam's other side that makes a line of opposite sign a flank of sharpening, over
    # its own. Chosen: a beam that is lit from one side has flanks of less different heights.
    flank_symmetry: float = 0.5
    # Fewest pixels of a column: four parameters and two degrees of freedom. Derived.
    min_pixels: int = 6
    # Range of a column's amplitude, over the amplitude at rest. Chosen.
    min_brightness: float = 0.4
    max_brightness: float = 2.2
    # A column's chi^2 per degree of freedom, over the typical value at rest. Derived: with seven
    # degrees of freedom one column in 300 exceeds it.
    max_misfit: float = 3.0
    # Share of the columns whose misfit is usual with a profile that was seen in part. Chosen: an
    # object that disturbs more columns also changes their brightness.
    in_part_share: float = 0.9
    # A column's amplitude, in its sigmas. Chosen, as for candidates.
    amplitude_sigmas: float = 5.0
    # Largest sigma [px] of a centre. Chosen: the profile fit moves a centre by few pixels.
    max_sigma_px: float = 1.0
    # Relative deviation of the brightness from its smooth course. Chosen: an object near the beam
    # shades more.
    max_brightness_deviation: float = 0.012
    # Where two consecutive columns are foreign, this many on either side are rejected too: the edge
    # of a shadow or a leaf begins in them. Chosen.
    edge_columns: int = 3
    # A centre's distance from the smooth curve; outliers exceed both. Chosen: white noise exceeds
    # six sigmas once in 500 million points.
    max_residual_sigmas: float = 6.0
    max_residual_px: float = 0.15
    # Fewest points of a smooth curve. Chosen: twice the terms of a cubic.
    min_curve_points: int = 8
    # Tukey's biweight is 0 beyond this many times the points' own scatter. Chosen: at 6 it has 98 %
    # of the efficiency of least squares.
    tukey_cut: float = 6.0
    # Beyond the end, a column is dark below this fraction of the beam's brightness. Chosen.
    dark_fraction: float = 0.25
    # Change of the background at the end, in its own scatter; rounding is added. Chosen.
    max_step_sigmas: float = 5.0
    # A column's chi^2 per degree of freedom near the end: a larger one adds to the tip's variance.
    # As `max_misfit`.
    max_tip_misfit: float = 3.0
    # A beam without a tip whose points end before this fraction of its length, within the image, is
    # followed further. Chosen: the last columns may be hidden.
    min_extent: float = 0.95
    # Range of the tip's distance along the beam, over the beam's length. Chosen.
    min_length: float = 0.75
    max_length: float = 1.3
    # An image differs from the rest images if its beam or background is brighter or darker by this
    # factor; the background must also differ by this fraction of full scale. Chosen: twice a
    # typical drift of lamps.
    max_light_ratio: float = 1.4
    min_light_step: float = 0.02
    # Largest turn [rad] of the beam about its clamp where the camera does not turn with it. Chosen.
    max_tilt: float = 0.6
    # Largest angle [rad] between a mounted beam and the rig's x axis. Chosen: seven degrees.
    max_askew: float = 0.12
    # Fewest stations of a rest image that show the beam. Chosen.
    min_stations: int = 20
    # A finer curve replaces the smooth one if it reduces the inflation of the sigmas to this
    # fraction. Chosen: eight more terms reduce the scatter of 25 independent values only to 0.7.
    max_fine_inflation: float = 0.5
    # Largest scatter [px] of a rest image's centres about a smooth curve. Chosen: compression and
    # sharpening leave 0.3; above, the columns show something else than the beam.
    max_scatter_px: float = 1.0
    # Images with a chi^2 per degree of freedom above this are processed. Chosen: the section of an
    # unprocessed beam leaves about 1.
    processed_misfit: float = 2.0
    # Above this chi^2 per degree of freedom, a section's profile is compared with the sampled one.
    # Chosen: the centre's sigma is then larger than necessary by a fifth.
    max_section_misfit: float = 1.5
    # Images with a smaller noise sigma [gray levels] count as compressed or denoised. Chosen: a
    # camera needs more noise to round well.
    min_noise: float = 0.5
    # For `area_weighted`, a column's threshold over the contrast between beam and background.
    # Chosen: low enough to keep the flanks of a line two pixels wide, high enough to exclude a dark
    # object beside it.
    area_level: float = 0.25
    # For `area_weighted`, a column shows the beam if its brightest pixel exceeds its background by
    # this fraction of the image's contrast and by this many sigmas of the background. Chosen.
    area_contrast: float = 0.5
    area_sigmas: float = 8.0
    # For `area_weighted`, the largest width [px] of the beam; a window of four rows more holds the
    # band and its flanks. Chosen.
    area_width_px: int = 12


THRESHOLDS: Final = CentrelineThresholds()
