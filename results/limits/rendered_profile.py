"""Radiance across the beam and beside it, measured in a magnified image without blur.

The closed form of the information (`profile`) is computed from this radiance. Where it differs from
that of the re-rendered image, the difference is then not one of the light.
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.geometry.tube import sides
from vbaa_bench.limits.image_shape import ImageShape
from vbaa_bench.limits.profile import SurfaceProfile
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.world import World

# Pixels of the magnified image per pixel, and per place across the beam's radiance is constant.
# Chosen: a beam of 1 px has 16 offsets that are 2 magnified pixels apart.
_MAGNIFICATION: Final = 32
_OFFSETS: Final = 16
# Samples per set of a magnified pixel.
_SAMPLES: Final = 16
# Distance [px] from the beam's edge at which the background is measured, on both sides.
_BESIDE_PX: Final = 1.0


class RenderedProfiles(NamedTuple):
    """Profiles of n places, and the fraction (n,) of the beam's width that is visible there.

    Nothing is visible in a stretch that is declared as missing.
    """

    surfaces: list[SurfaceProfile]
    visible: Floats


def rendered_profiles(renderer: FrameRenderer, pose: Pose, shape: ImageShape) -> RenderedProfiles:
    """Measure the radiance that reaches the sensor across the beam at the n places of a shape."""
    camera = renderer.pushed_world(pose).camera
    scene = pose.spec.scene
    sharp = scene.optics.model_copy(update={"point_spread_px": 0.0, "aperture_mm": 0.0})
    scene = scene.model_copy(update={"optics": sharp})
    rig = replace(renderer.rig, camera=_magnified(camera))
    world = SceneAssembler(scene, rig, renderer.folder).pushed_world(pose)
    middle, half_width = _silhouette(world, camera, shape)
    even = (np.arange(_OFFSETS) + 0.5) / _OFFSETS * 2 - 1
    across = np.column_stack(
        [half_width[:, None] * even, half_width + _BESIDE_PX, -half_width - _BESIDE_PX]
    )
    places = middle[:, None] + across[..., None] * shape.normals[:, None]
    pixels = places.reshape(-1, 2)
    magnified = (camera.undistorted_pixels(pixels) + 0.5) * _MAGNIFICATION - 0.5
    size = np.full(len(pixels), _SAMPLES)
    traced = trace(world, np.rint(magnified).astype(np.int64), size, 0, "whole")
    light = pose.spec.scene.light_level * _light_at(renderer, pixels)
    radiance = (light * traced.radiance).reshape(across.shape)
    covered = traced.coverage.reshape(across.shape)[:, :_OFFSETS] > 0.5
    inside = camera.contains(pixels).reshape(across.shape)[:, :_OFFSETS]
    spread = pose.spec.scene.optics.point_spread_px
    lit, behind = radiance[:, :_OFFSETS], radiance[:, _OFFSETS:].mean(axis=1)
    surfaces = [
        SurfaceProfile(lit[i], float(behind[i]), float(half_width[i]), normal, spread)
        for i, normal in enumerate(shape.normals)
    ]
    visible = (covered & inside).mean(axis=1)
    return RenderedProfiles(surfaces, visible * ~is_removed(pose, camera, shape.pixels))


def is_removed(pose: Pose, camera: Camera, pixels: Floats) -> Mask:
    """Test whether places (n, 2) [px] are in the stretch of x on plane C declared as missing."""
    cover, hidden = pose.spec.cover, pose.hidden
    if cover is None or hidden is None or cover.in_image:
        return np.zeros(len(pixels), np.bool_)
    x = camera.on_plane(np.asarray(pixels, np.float64))[:, 0]
    start, end = hidden
    return np.asarray((start <= x) & (x <= end))


class _Silhouette(NamedTuple):
    """Middles (n, 2) [px] of the beam's image across its normals, and half its width (n,) [px]."""

    middle: Floats
    half_width: Floats


def _silhouette(world: World, camera: Camera, shape: ImageShape) -> _Silhouette:
    """Project the mesh's rings and interpolate their extent across the image of the beam."""
    s = world.arc_length
    assert s is not None
    facets = int(np.argmax(s != s[0]))
    rings = sides(world.vertices["beam"], facets)
    pixels = camera.project(rings.reshape(-1, 3)).reshape(*rings.shape[:2], 2)
    fractions = s[: len(rings) * facets : facets] / s.max()
    count = len(shape.steps)
    at = (np.arange(count) + 0.5) / count
    # At each place, the vertices of the rings before and after it, moved along to the place.
    after = np.clip(np.searchsorted(fractions, at), 1, len(rings) - 1)
    share = ((at - fractions[after - 1]) / (fractions[after] - fractions[after - 1]))[:, None, None]
    outline = (1 - share) * pixels[after - 1] + share * pixels[after]
    across = np.einsum("nfi,ni->nf", outline - shape.pixels[:, None], shape.normals)
    low, high = across.min(axis=1), across.max(axis=1)
    middle = shape.pixels + ((low + high) / 2)[:, None] * shape.normals
    return _Silhouette(middle, (high - low) / 2)


def _magnified(camera: Camera) -> Camera:
    """Return a camera without distortion whose pixels are smaller."""
    k = _MAGNIFICATION
    return replace(
        camera,
        width=k * camera.width,
        height=k * camera.height,
        fx=k * camera.fx,
        fy=k * camera.fy,
        cx=k * (camera.cx + 0.5) - 0.5,
        cy=k * (camera.cy + 0.5) - 0.5,
        distortion=(),
    )


def _light_at(renderer: FrameRenderer, pixels: Floats) -> Floats:
    """Look up the fraction (n,) of the light that the lens transmits to places (n, 2) [px]."""
    height, width = renderer.vignetting.shape
    column, row = np.rint(np.clip(pixels, 0, [width - 1, height - 1])).astype(int).T
    return np.asarray(renderer.vignetting[row, column])
