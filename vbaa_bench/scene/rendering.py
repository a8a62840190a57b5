"""Noise targets and mesh tolerance of the rendering, and the truth layers to keep."""

from typing import Annotated, Literal

from pydantic import Field

from vbaa_bench.scene.part import Part

Layer = Literal[
    "radiance",
    "variance",
    "beam_mask",
    "coverage",
    "arc_length",
    "depth",
    "normal",
    "object_index",
    "occlusion",
]

_Noise = Annotated[float, Field(ge=0.01, le=10)]


class RenderSpec(Part):
    """Noise targets; samples per pixel are chosen to reach them, up to 1,024.

    A noise target is the render's standard deviation over the sensor's: within `near_beam_px` of
    the beam, elsewhere, and in the static layer, whose noise is the same in every frame.
    """

    noise_near_beam: _Noise = 0.333
    noise_elsewhere: _Noise = 0.5
    noise_static_layer: _Noise = 0.1
    # Largest change of a pixel by one sample of a shadow, over the sensor's noise. Without a limit,
    # a penumbra in which almost all of a lamp is in view may have dark dots.
    largest_outlier: _Noise | None = None
    # Number of places in a pixel at which each of its two sets of samples measures a shadow. One is
    # enough on plain ground; on fine texture, no number of samples there reaches the noise target.
    shadow_places: Annotated[int, Field(ge=1, le=64)] = 1
    near_beam_px: Annotated[int, Field(ge=1, le=64)] = 4
    # Largest distance of the beam's mesh from the smooth beam.
    mesh_tolerance_px: Annotated[float, Field(ge=1e-4, le=1)] = 0.006
    # Whether surfaces that do not move are rendered once, with the low noise above, and whether the
    # numbers of samples are corrected by a few frames that are not kept. Both cost as much as ten
    # frames, and pay in larger datasets.
    static_layer: bool = True
    sample_table: bool = True
    # 1: light goes from lamp to surface to camera. More: surfaces light each other.
    bounces: Annotated[int, Field(ge=1, le=16)] = 1
