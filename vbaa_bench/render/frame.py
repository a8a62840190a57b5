"""Rendering of a whole image: a static layer rendered once, plus the pixels that motion affects.

Samples per pixel are chosen to reach noise targets. Pilot samples estimate the variance of each
pixel; they are discarded, because reusing them would bias the mean. A table that is learned once
per dataset corrects the numbers of samples that follow from them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Mask
from vbaa_bench.render.affected_pixels import shadows
from vbaa_bench.render.interpolated import Interpolated
from vbaa_bench.render.layers import Layers, every_pixel, layers
from vbaa_bench.render.pilots import PILOT_SAMPLES, Noise, PixelTargets, dilated, pilots
from vbaa_bench.render.sample_table import Sampled, SampleTable, kinds, rounded
from vbaa_bench.render.tracing import SETS, Quantity, trace
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.render.world import World

# Maximum samples per set. Each pixel gets SETS sets.
MAX_SAMPLES = 512
# Minimum samples per set. With fewer, one sample in a shadow gives a rare but large dark outlier.
MIN_SAMPLES = 4
# Samples per set of every pixel, for variants that only render whole images.
UNIFORM_SAMPLES = 32


@dataclass(frozen=True)
class NoiseTarget:
    """Noise targets: ratio of the render's standard deviation to the sensor's.

    `near` holds within `near_px` of the beam, `elsewhere` for other pixels, `static` for the static
    layer. `noise` maps radiances to the sensor's standard deviations. `table` corrects the numbers
    of samples, except those of the static layer. If `outlier` is stated, one sample of a shadow
    changes its pixel by at most about that many times the sensor's noise.
    """

    noise: Noise
    near_px: int = 4
    near: float = 1 / 3
    elsewhere: float = 1 / 2
    static: float = 1 / 10
    table: SampleTable = field(default_factory=SampleTable)
    outlier: float | None = None

    def scaled(self, factor: float) -> "NoiseTarget":
        """Scale the noise targets by a factor, except that of the static layer."""
        return replace(self, near=factor * self.near, elsewhere=factor * self.elsewhere)


@dataclass(frozen=True)
class RenderedRadiance:
    """Radiance (height, width) and the variance of its part that is sampled anew in every frame.

    `coverage` (height, width) is the fraction of each pixel that the beam covers, `samples`
    (height, width) the number of samples per pixel, `affected` (height, width) marks the pixels
    that moving surfaces can change: smooth shadows are not sampled in all of them. `sampled` holds
    the sampled pixels of an image by `render_frame`; it is None for averages.
    """

    radiance: Floats
    variance: Floats
    layers: Layers
    coverage: Floats
    samples: Floats
    affected: Mask
    sampled: Sampled | None = None

    @property
    def core(self) -> Mask:
        """Pixels (height, width) with at least half the largest beam coverage.

        A thin beam may cover no pixel completely and no pixel centre.
        """
        return np.asarray((self.coverage > 0) & (self.coverage >= 0.5 * self.coverage.max()))

    def at_level(self, level: float) -> "RenderedRadiance":
        """Scale the light by a factor."""
        if level == 1:
            return self
        return replace(self, radiance=level * self.radiance, variance=level**2 * self.variance)

    def by_name(self) -> dict[str, np.ndarray]:
        """Return all layers that can be saved for a frame, keyed as in a scene's `layers`."""
        truth = self.layers
        return {
            "radiance": self.radiance,
            "variance": self.variance,
            "beam_mask": truth.beam_mask,
            "coverage": self.coverage,
            "arc_length": truth.arc_length_mm,
            "depth": truth.depth_mm,
            "normal": truth.normal,
            "object_index": truth.object_index,
            "occlusion": truth.occlusion,
        }


@dataclass(frozen=True)
class StaticLayer:
    """The static layer: image of the surfaces that do not move, the same in every frame."""

    radiance: Floats
    layers: Layers


def render_static_layer(world: World, target: NoiseTarget, seed: int) -> StaticLayer:
    """Render the static layer, with noise well below the sensor's."""
    all_pixels = np.ones((world.camera.height, world.camera.width), np.bool_)
    shape = all_pixels.shape
    truth, canvas = every_pixel(world, still=True), _Canvas(*shape)
    edges = dilated(_edges(truth.object_index), 1)
    ratio = np.full(shape, target.static)
    targets = PixelTargets(target.noise, ratio, np.zeros(shape), edges, SampleTable())
    canvas.add(world, "still", all_pixels, targets, seed)
    return StaticLayer(canvas.radiance, truth)


def render_frame(
    world: World, static: StaticLayer | None, target: NoiseTarget, seed: int
) -> RenderedRadiance:
    """Render the current state of the world: affected pixels on `static`, or all pixels."""
    shape = (world.camera.height, world.camera.width)
    zeros, blur = np.zeros(shape), world.blur_px
    canvas = _Canvas(*shape)
    beam = world.view.hulls(world.bodies({"beam"} & world.moving), blur)
    if static is None:
        truth, complete, change = every_pixel(world), zeros == 0, zeros > 0
    else:
        # All pixels that a surface touches: a thin beam can pass between pixel centres.
        others = world.view.hulls(world.bodies(world.moving - world.sliding - {"beam"}), blur)
        truth = every_pixel(world) if world.sliding else layers(world, beam | others, static.layers)
        silhouette = world.silhouette
        complete = others | (beam if silhouette is None else silhouette.touched)
        if world.sliding:
            complete |= dilated(_changed_by_sliding(truth, static.layers), 1 + blur)
        change = (_shaded(world, static) | beam) & ~complete
    # `beam` extends up to one pixel beyond the pixels whose centres the beam covers.
    near = dilated(beam, target.near_px - 1)
    ratio = np.where(near, target.near, target.elsewhere)
    dense = near | dilated(_edges(truth.object_index), 1 + blur)
    targets = PixelTargets(target.noise, ratio, zeros, dense, target.table)
    canvas.add(world, "whole", complete, targets, seed)
    if static is not None:
        targets = replace(targets, base=static.radiance, dense=near, outlier=target.outlier)
        canvas.add(world, "change", change, targets, seed + (1 << 30))
        canvas.radiance += np.where(complete, 0, static.radiance)
    # A scalar variant measures no coverage: use the value at the pixel centre.
    coverage = truth.beam_mask.astype(float) if is_scalar() else canvas.coverage
    sampled = (canvas.samples > 0) & canvas.always
    sigma = ratio[sampled] * target.noise(canvas.radiance[sampled])
    excess = canvas.variance[sampled] / np.maximum(sigma**2, 1e-30)
    pixels = Sampled(canvas.kind[sampled], canvas.predicted[sampled], excess)
    return RenderedRadiance(
        canvas.radiance,
        canvas.variance,
        truth,
        coverage,
        canvas.samples,
        complete | change,
        pixels,
    )


def average_poses(
    images: Sequence[RenderedRadiance], weights: Floats | None = None
) -> RenderedRadiance:
    """Average successive images; the layers are those of the middle one.

    Without `weights` (height, images) all have equal weight. Weights include the relative power of
    the light; the coverage is averaged without it.
    """
    middle = images[len(images) // 2]
    if weights is not None:
        return _weighted(images, weights)
    if len(images) == 1:
        return middle
    return RenderedRadiance(
        np.mean([image.radiance for image in images], axis=0),
        np.sum([image.variance for image in images], axis=0) / len(images) ** 2,
        middle.layers,
        np.mean([image.coverage for image in images], axis=0),
        np.sum([image.samples for image in images], axis=0),
        np.any([image.affected for image in images], axis=0),
    )


def _weighted(images: Sequence[RenderedRadiance], weights: Floats) -> RenderedRadiance:
    """Add images, each row with its own weights."""
    # A row may be exposed while lamps that flicker emit almost nothing.
    shares = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)

    def added(layer: str, factors: Floats) -> Floats:
        layers = [getattr(image, layer) for image in images]
        return np.asarray(np.einsum("rk,krc->rc", factors, np.stack(layers)))

    return replace(
        images[len(images) // 2],
        radiance=added("radiance", weights),
        variance=added("variance", weights**2),
        coverage=added("coverage", shares),
        samples=np.sum([image.samples for image in images], axis=0),
        affected=np.any([image.affected for image in images], axis=0),
        sampled=None,
    )


class _Canvas:
    """Images (height, width) that are filled part by part."""

    def __init__(self, height: int, width: int) -> None:
        images = np.zeros((5, height, width))
        self.radiance, self.variance, self.coverage, self.samples, self.predicted = images
        self.kind = np.zeros((height, width), np.uint8)
        self.always = np.zeros((height, width), np.bool_)

    def add(
        self, world: World, quantity: Quantity, where: Mask, targets: PixelTargets, seed: int
    ) -> None:
        """Sample the pixels of `where` until they reach the noise target."""
        if not where.any():
            return
        count = int(np.count_nonzero(where))
        size, smooth = np.full(count, UNIFORM_SAMPLES), Interpolated.nothing(count)
        if not is_scalar():
            pilot = pilots(world, quantity, where, targets, seed)
            _check_finite(pilot.excess)
            kind = kinds(targets.dense[where], pilot.covered, quantity == "change")
            predicted = targets.table.predicted(kind, PILOT_SAMPLES, pilot.excess)
            corrected = targets.table.corrected(kind, predicted)
            fewest = targets.fewest_samples(where)
            needed = np.clip(np.maximum(corrected, fewest), MIN_SAMPLES, MAX_SAMPLES)
            size = np.ceil(rounded(needed))
            # A correction divides by the probability: an outlier would be larger.
            smooth = pilot.smooth.rendered_if((corrected > MIN_SAMPLES) | (fewest > 0))
            self.kind[where], self.predicted[where] = kind, predicted
        rows, columns = np.nonzero(where)
        chosen = np.flatnonzero(smooth.chosen(rows, columns, seed))
        # Equal sizes side by side keep the processor's lanes busy.
        order = chosen[np.argsort(size[chosen], kind="stable")]
        pixels = rows, columns = rows[order], columns[order]
        traced = trace(world, np.column_stack([columns, rows]), size[order], seed + 1, quantity)
        _check_finite(traced.radiance)
        self.radiance[where] = smooth.value
        self.radiance[pixels], self.variance[pixels] = smooth.corrected(
            order, traced.radiance, traced.variance
        )
        self.coverage[pixels] = traced.coverage
        self.samples[pixels] = SETS * size[order]
        self.always[where] = smooth.probability == 1


def _check_finite(values: Floats) -> None:
    """Raise ArithmeticError if a value of a pixel (n,) is no number.

    It would become a number of samples, or a gray value.
    """
    if count := int(np.count_nonzero(~np.isfinite(values))):
        raise ArithmeticError(f"{count} of {len(values)} pixels have no radiance")


def _shaded(world: World, static: StaticLayer) -> Mask:
    """Mark the pixels of static surfaces on which moving surfaces may cast a shadow."""
    index, bodies = static.layers.object_index, world.bodies(world.moving - world.sliding)
    blur, grounds = world.blur_px, world.grounds
    shadow_hulls = [shadows(bodies, world.lights, ground) for ground in grounds]
    # Light that is reflected by moving surfaces reaches all pixels.
    if None in shadow_hulls or world.optics.lens.aperture > 0 or world.bounces > 1:
        return np.ones(index.shape, np.bool_)
    levels = [_is_level(world.vertices[name][:, 2], grounds) for name in world.names]
    raised = (index > 0) & ~np.isin(index, np.flatnonzero(levels) + 1)
    hulls = [hull for ground_hulls in shadow_hulls for hull in ground_hulls or ()]
    return world.view.hulls(hulls, blur) | dilated(raised, 2 + blur)


def _is_level(z: Floats, grounds: Sequence[float]) -> bool:
    """Test whether a surface with heights `z` [m] is one of the grounds, or below the lowest."""
    low, high = float(z.min()), float(z.max())
    return high <= grounds[0] + 1e-9 or any(
        ground - 1e-9 <= low and high <= ground + 1e-9 for ground in grounds
    )


def _changed_by_sliding(current: Layers, still: Layers) -> Mask:
    """Mark the pixels where a sliding pattern differs from the still scene."""
    differs = current.object_index != still.object_index
    return np.asarray(differs | _edges(current.object_index) | _edges(still.object_index))


def _edges(index: np.ndarray) -> Mask:
    """Mark the pixels whose neighbours show a different surface."""
    labels = index.astype(np.uint8)
    kernel = np.ones((3, 3), np.uint8)
    return np.asarray(cv2.dilate(labels, kernel) != cv2.erode(labels, kernel))
