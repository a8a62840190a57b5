"""Rendering of a whole image: a static layer rendered once, plus the pixels that motion affects.

Samples per pixel are chosen to reach noise targets. Pilot samples estimate the variance of each
pixel; they are discarded, because reusing them would bias the mean.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Mask
from vbaa_bench.render.affected_pixels import shadows
from vbaa_bench.render.layers import Layers, every_pixel, layers
from vbaa_bench.render.tracing import SETS, Asked, trace
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.render.world import World

# Samples per set: of a pilot, and the maximum. Each pixel gets SETS sets.
PILOT, MOST = 4, 512
# Minimum samples per set. With fewer, one sample in a shadow gives a rare but large dark outlier.
LEAST = 3
# Samples per set of every pixel, for variants that only render whole images.
EVEN = 32
# The variance of a stratified mean falls as N^-1.5 where a beam's edge crosses the pixel, as N^-1
# in shadows, and as N^-0.85 in the narrow penumbra near the beam, where the beam occludes so small
# a part of a lamp that additional points hit that part only by chance.
FALL, FALL_OF_SHADOW, FALL_NEAR = 1.5, 1.0, 0.85
# Near the beam and at edges between surfaces, every pixel has a pilot of _PILOT_SETS sets; the
# largest variance among its neighbours is used, but in shadows, which are smooth, the mean over
# _NEIGHBOURS^2 pixels. Elsewhere one pixel in _SPARSE^2 has a pilot, averaged over _REACH^2 pixels.
_PILOT_SETS = 8
_NEIGHBOURS = 5
_SPARSE, _REACH = 4, 17

Noise = Callable[[Floats], Floats]


@dataclass(frozen=True)
class NoiseTarget:
    """Noise targets: ratio of the render's standard deviation to the sensor's.

    `near` holds within `near_px` of the beam, `elsewhere` for other pixels, `static` for the static
    layer. `noise` maps radiances to the sensor's standard deviations.
    """

    noise: Noise
    near_px: int = 4
    near: float = 1 / 3
    elsewhere: float = 1 / 2
    static: float = 1 / 10

    def scaled(self, factor: float) -> "NoiseTarget":
        """Scale the noise targets by a factor, except that of the static layer."""
        return replace(self, near=factor * self.near, elsewhere=factor * self.elsewhere)


@dataclass(frozen=True)
class RenderedRadiance:
    """Radiance (height, width) and the variance of its part that is sampled anew in every frame.

    `coverage` (height, width) is the share of each pixel that the beam covers, `samples` (height,
    width) the number of samples per pixel.
    """

    radiance: Floats
    variance: Floats
    layers: Layers
    coverage: Floats
    samples: Floats

    @property
    def core(self) -> Mask:
        """Pixels (height, width) with at least half the largest beam coverage.

        A thin beam may cover no pixel completely and no pixel centre.
        """
        return np.asarray((self.coverage > 0) & (self.coverage >= 0.5 * self.coverage.max()))

    def by_name(self) -> dict[str, np.ndarray]:
        """Return all layers that can be saved for a frame, keyed as in a scene's `layers`."""
        found = self.layers
        return {
            "radiance": self.radiance,
            "variance": self.variance,
            "beam_mask": found.beam_mask,
            "coverage": self.coverage,
            "arc_length": found.arc_length_mm,
            "depth": found.depth_mm,
            "normal": found.normal,
            "object_index": found.object_index,
            "occlusion": found.occlusion,
        }


@dataclass(frozen=True)
class StaticLayer:
    """The static layer: image of the surfaces that do not move, the same in every frame."""

    radiance: Floats
    layers: Layers


def render_static_layer(world: World, wanted: NoiseTarget, seed: int) -> StaticLayer:
    """Render the static layer, with noise well below the sensor's."""
    everywhere = np.ones((world.camera.height, world.camera.width), np.bool_)
    shape = everywhere.shape
    found, made = every_pixel(world, still=True), _Canvas(*shape)
    rims = _grown(_seams(found.object_index), 1)
    goal = _PixelTargets(wanted.noise, np.full(shape, wanted.static), np.zeros(shape), rims)
    made.add(world, "still", everywhere, goal, seed)
    return StaticLayer(made.radiance, found)


def render_frame(
    world: World, static: StaticLayer | None, wanted: NoiseTarget, seed: int
) -> RenderedRadiance:
    """Render the current state of the world: affected pixels on `static`, or all pixels."""
    shape = (world.camera.height, world.camera.width)
    nothing, blur = np.zeros(shape), world.blur_px
    made = _Canvas(*shape)
    beam = world.view.hulls(world.bodies({"beam"} & world.moving), blur)
    if static is None:
        found, whole, change = every_pixel(world), nothing == 0, nothing > 0
    else:
        # All pixels that a surface touches: a thin beam can pass between pixel centres.
        others = world.moving - world.sliding - {"beam"}
        whole = beam | world.view.hulls(world.bodies(others), blur)
        found = every_pixel(world) if world.sliding else layers(world, whole, static.layers)
        if world.sliding:
            whole |= _grown(_slid(found, static.layers), 1 + blur)
        change = _shaded(world, static) & ~whole
    # `beam` extends up to one pixel beyond the pixels whose centres the beam covers.
    near = _grown(beam, wanted.near_px - 1)
    share = np.where(near, wanted.near, wanted.elsewhere)
    rims = near | _grown(_seams(found.object_index), 1 + blur)
    made.add(world, "whole", whole, _PixelTargets(wanted.noise, share, nothing, rims), seed)
    if static is not None:
        goal = _PixelTargets(wanted.noise, share, static.radiance, near)
        made.add(world, "change", change, goal, seed + (1 << 30))
        made.radiance += np.where(whole, 0, static.radiance)
    # A scalar variant measures no coverage: use the value at the pixel centre.
    coverage = found.beam_mask.astype(float) if is_scalar() else made.coverage
    return RenderedRadiance(made.radiance, made.variance, found, coverage, made.samples)


def average_poses(pictures: Sequence[RenderedRadiance]) -> RenderedRadiance:
    """Average successive pictures; the layers are those of the middle one."""
    middle = pictures[len(pictures) // 2]
    if len(pictures) == 1:
        return middle
    return RenderedRadiance(
        np.mean([seen.radiance for seen in pictures], axis=0),
        np.sum([seen.variance for seen in pictures], axis=0) / len(pictures) ** 2,
        middle.layers,
        np.mean([seen.coverage for seen in pictures], axis=0),
        np.sum([seen.samples for seen in pictures], axis=0),
    )


class _Canvas:
    """Images (height, width) that are filled part by part."""

    def __init__(self, height: int, width: int) -> None:
        self.radiance, self.variance, self.coverage, self.samples = np.zeros((4, height, width))

    def add(
        self, world: World, asked: Asked, where: Mask, goal: "_PixelTargets", seed: int
    ) -> None:
        """Sample the pixels of `where` until they reach the noise target."""
        if not where.any():
            return
        size = np.full(np.count_nonzero(where), EVEN)
        if not is_scalar():
            excess = _excess(world, asked, where, goal, seed)
            shadow = np.where(goal.dense[where], FALL_NEAR, FALL_OF_SHADOW)
            fall = shadow if asked == "change" else FALL
            size = np.clip(np.ceil(PILOT * excess ** (1 / fall)), LEAST, MOST)
        # Equal sizes side by side keep the processor's lanes busy.
        order = np.argsort(size, kind="stable")
        place = rows, columns = tuple(places[order] for places in np.nonzero(where))
        found = trace(world, np.column_stack([columns, rows]), size[order], seed + 1, asked)
        self.radiance[place] = found.radiance
        self.variance[place] = found.variance
        self.coverage[place] = found.coverage
        self.samples[place] = SETS * size[order]


@dataclass(frozen=True)
class _PixelTargets:
    """The noise target of each pixel, as a standard deviation.

    It is `share` (height, width) times the sensor's `noise` at the sampled radiance plus `base`
    (height, width). Each pixel of `dense` has its own pilot; the others share pilots.
    """

    noise: Noise
    share: Floats
    base: Floats
    dense: Mask


def _excess(world: World, asked: Asked, where: Mask, goal: _PixelTargets, seed: int) -> Floats:
    """Estimate the ratio (n,) of the pilot variance to the target variance in pixels of `where`."""
    pilots = where & goal.dense
    pilots[::_SPARSE, ::_SPARSE] |= where[::_SPARSE, ::_SPARSE]
    rows, columns = np.nonzero(pilots)
    pixels, size = np.column_stack([columns, rows]), np.full(len(rows), PILOT)
    found = trace(world, pixels, size, seed, asked, _PILOT_SETS)
    sigma = goal.share[pilots] * goal.noise(goal.base[pilots] + found.radiance)
    # Variance for SETS sets instead of the pilot's.
    excess = _PILOT_SETS / SETS * found.variance / np.maximum(sigma**2, 1e-30)
    image, count = np.zeros(where.shape, np.float32), pilots.astype(np.float32)
    image[pilots] = excess
    near = _NEIGHBOURS if asked == "change" else 3
    fine, coarse = (
        cv2.blur(image, (reach, reach)) / np.maximum(cv2.blur(count, (reach, reach)), reach**-2)
        for reach in (near, _REACH)
    )
    worst = fine if asked == "change" else cv2.dilate(fine, np.ones((3, 3), np.uint8))
    return np.maximum(np.where(goal.dense, worst, coarse)[where], 0)


def _shaded(world: World, static: StaticLayer) -> Mask:
    """Mark the pixels of static surfaces on which moving surfaces may cast a shadow."""
    index, bodies = static.layers.object_index, world.bodies(world.moving - world.sliding)
    blur, ground = world.blur_px, world.ground
    thrown = shadows(bodies, world.lights, ground)
    if thrown is None or world.optics.lens.aperture > 0:
        return np.ones(index.shape, np.bool_)
    lowest = [n for n in world.names if world.vertices[n][:, 2].max() <= ground + 1e-9]
    flat = [world.names.index(name) + 1 for name in lowest]
    raised = (index > 0) & ~np.isin(index, flat)
    return world.view.hulls(thrown, blur) | _grown(raised, 2 + blur)


def _slid(found: Layers, still: Layers) -> Mask:
    """Mark the pixels where a sliding pattern differs from the still scene."""
    differs = found.object_index != still.object_index
    return np.asarray(differs | _seams(found.object_index) | _seams(still.object_index))


def _seams(index: np.ndarray) -> Mask:
    """Mark the pixels whose neighbours show a different surface."""
    few = index.astype(np.uint8)
    around = np.ones((3, 3), np.uint8)
    return np.asarray(cv2.dilate(few, around) != cv2.erode(few, around))


def _grown(mask: Mask, pixels: int) -> Mask:
    reach = np.ones((2 * pixels + 1, 2 * pixels + 1), np.uint8)
    return cv2.dilate(mask.astype(np.uint8), reach) > 0
