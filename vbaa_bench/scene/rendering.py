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

    noise_near_beam: _Noise = Field(
        default=0.333, description="Noise within `near_beam_px` of the beam."
    )
    noise_elsewhere: _Noise = Field(default=0.5, description="Noise elsewhere.")
    noise_static_layer: _Noise = Field(
        default=0.1, description="Noise of the static layer, which is the same in every frame."
    )
    largest_outlier: _Noise | None = Field(
        default=None,
        description="Largest change of a pixel by one sample of a shadow, over the sensor's "
        "noise; without a limit, a penumbra in which almost all of a lamp is in view may have "
        "dark dots.",
    )
    shadow_places: Annotated[int, Field(ge=1, le=64)] = Field(
        default=1,
        description="Number of places in a pixel at which each of its two sets of samples "
        "measures a shadow. One is enough on plain ground; on fine texture, no number of "
        "samples there reaches the noise target.",
    )
    near_beam_px: Annotated[int, Field(ge=1, le=64)] = Field(
        default=4, description="Distance from the beam within which a pixel is near it."
    )
    mesh_tolerance_px: Annotated[float, Field(ge=1e-4, le=1)] = Field(
        default=0.006, description="Largest distance of the beam's mesh from the smooth beam."
    )
    static_layer: bool = Field(
        default=True,
        description="Whether surfaces that do not move are rendered once, with low noise: it "
        "costs time at the start, and pays in larger datasets.",
    )
    sample_table: bool = Field(
        default=True,
        description="Whether the numbers of samples are corrected by a few frames that are "
        "not kept: it costs time at the start, and pays in larger datasets.",
    )
    bounces: Annotated[int, Field(ge=1, le=16)] = Field(
        default=1,
        description="1: light goes from lamp to surface to camera. More: surfaces light each "
        "other.",
    )
