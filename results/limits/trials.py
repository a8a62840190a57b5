"""Test information limits by Monte Carlo: most likely estimates from noisy exposures.

One expected image is rendered with many samples and exposed repeatedly, with the sensor's whole
noise drawn anew. Each exposure is estimated with another render of the same expected image and its
derivatives: at this noise the image is linear in the parameters, so that one step of Gauss and
Newton finds the most likely values. Some exposures get a second step, with the image rendered again
at the first estimate: it must change nothing.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from results.limits.agreement import LimitedFrame, LitScene
from results.limits.rendered import ImageChange, image_change
from results.limits.rendered_beam import SAMPLES, of_vertices
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply
from vbaa_bench.limits.image_shape import APPEARANCE
from vbaa_bench.limits.imaged_beam import CONTACT, ImagedBeam
from vbaa_bench.limits.quantities import QUANTITIES
from vbaa_bench.render.tracing import trace

# Samples of the expected image, relative to those of a limit.
_MORE_SAMPLES: Final = 16
# Exposures whose estimate is repeated with an image rendered at the first one.
_REPEATED: Final = 10
# Parameters that are estimated: the plane is known.
_ESTIMATED: Final = (*CONTACT[:2], *APPEARANCE)

Record = dict[str, Any]


def trials(frame: LimitedFrame, count: int) -> Record:
    """Estimate the contact in `count` exposures of a frame; compare the spread with the limit.

    Raises InputError for a sensor with a fixed pattern, and EquilibriumError.
    """
    _check_sensor(frame.lit)
    lit, samples = frame.lit, _MORE_SAMPLES * SAMPLES
    limit = image_change(lit.renderer, frame.spec, lit.exposure, CONTACT[:2])
    exposed, model = (
        image_change(lit.renderer, frame.spec, lit.exposure, names, samples=samples, seed=seed)
        for names, seed in (((), 2), (CONTACT[:2], 3))
    )
    random = np.random.default_rng(frame.spec.index)
    images = _exposures(frame, exposed, count, random)
    fit = _Fit.of(model)
    estimates = fit.steps(images - model.mean)
    gradient = frame.quantities[QUANTITIES.index("x_c"), :2]
    own = limit.information
    bound = own.sigmas(own.gradients([dict(zip(CONTACT[:2], gradient, strict=True))]))[0]
    x_c = estimates[:, :2] @ gradient
    second = np.array(
        [
            fit.steps((image - _image_at(frame, model, estimate, samples))[None])[0]
            for image, estimate in zip(images[:_REPEATED], estimates, strict=False)
        ]
    )
    return {
        "scene": lit.file.path.stem,
        "frame": frame.spec.index,
        "trials": count,
        "x_c_limit_mm": 1e3 * float(bound),
        "spread_over_limit": float(x_c.std(ddof=1) / bound),
        "bias_over_limit": float(x_c.mean() / bound),
        "second_step_over_limit": float(np.sqrt(np.mean((second[:, :2] @ gradient) ** 2)) / bound),
    }


class _Fit(NamedTuple):
    """Linear estimator of p parameters: covariance (p, p), and slopes over variance (p, n)."""

    covariance: Floats
    weighted: Floats

    @classmethod
    def of(cls, model: ImageChange) -> "_Fit":
        slopes = model.slopes.mean(axis=0)
        weighted = slopes / model.variance
        return cls(np.linalg.inv(weighted @ slopes.T), weighted)

    def steps(self, residuals: Floats) -> Floats:
        """Estimate changes (m, p) of the parameters from residuals (m, n) of images."""
        return np.asarray(residuals @ self.weighted.T @ self.covariance)


def _check_sensor(lit: LitScene) -> None:
    """Raise InputError unless all noise of the sensor is drawn anew in every exposure."""
    spec = lit.file.scene.sensor
    if spec.prnu_pct or spec.dsnu_e or spec.bayer is not None or spec.jpeg_quality is not None:
        raise InputError(
            f"{lit.file.path}: the sensor has a fixed pattern, a mosaic or compression, allowed "
            "are sensors whose noise is drawn anew in every pixel of every exposure"
        )


def _exposures(
    frame: LimitedFrame, exposed: ImageChange, count: int, random: np.random.Generator
) -> Floats:
    """Expose an expected image `count` times; return radiances (count, n) of its pixels."""
    sensor = frame.lit.renderer.sensor(frame.lit.exposure)
    # Pixels are independent: they may be in one row.
    return np.concatenate(
        [sensor.radiance(sensor.expose(exposed.mean[None], random)) for _ in range(count)]
    )


def _image_at(frame: LimitedFrame, model: ImageChange, estimate: Floats, samples: int) -> Floats:
    """Render the expected image (n,) of a beam at an estimate of `_ESTIMATED`."""
    renderer = frame.lit.renderer
    world = renderer.pushed_world(renderer.pose(frame.spec))
    imaged, resting = frame.imaged, world.vertices["beam"]
    changed = imaged
    for name, change in zip(CONTACT[:2], estimate, strict=False):
        changed = changed.changed(name, float(change))
    brighter, lighter, wider = 1 + estimate[2:]
    line = of_vertices(world, _points(imaged))
    moved = of_vertices(world, _points(changed)) + wider * (resting - line)
    size = np.full(len(model.pixels), samples)
    world.move({"beam": moved})
    whole = trace(world, model.pixels, size, 5, "whole").radiance
    beam = trace(world, model.pixels, size, 5, "beam").radiance
    world.move({"beam": resting})
    columns, rows = model.pixels.T
    light = frame.spec.scene.light_level * renderer.vignetting[rows, columns]
    return np.asarray(light * (brighter * beam + lighter * (whole - beam)))


def _points(imaged: ImagedBeam) -> Floats:
    return apply(imaged.frame_from_clamp, imaged.beam.centreline[:, 1:])


HEADS: Final = (
    "scene, frame",
    "exposures",
    "limit of x_c, mm",
    "spread / limit",
    "bias / limit",
    "second step / limit",
)


def lines(records: Sequence[Record]) -> list[tuple[str, ...]]:
    """Format records as rows of a table; HEADS are the columns."""
    return [
        (
            f"{one['scene']} {one['frame']}",
            str(one["trials"]),
            f"{one['x_c_limit_mm']:.2g}",
            f"{one['spread_over_limit']:.3f}",
            f"{one['bias_over_limit']:+.2f}",
            f"{one['second_step_over_limit']:.3f}",
        )
        for one in records
    ]
