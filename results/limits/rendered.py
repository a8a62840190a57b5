"""Fisher information of one frame, from its expected image and that of changed parameters.

`image_shape` computes the same in closed form, with the assumption that a pixel shows a straight,
evenly lit stretch of the beam before an even background. This derivation makes none.
"""

from collections.abc import Collection, Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import eigh

from results.limits.rendered_beam import SAMPLES, STEP_PX, beam_change, near_beam
from results.limits.rendered_profile import is_removed
from solver.instrument.arrays import Floats, Mask
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from vbaa_bench.assembly.motion import exposure_poses
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.dataset.target import FAST
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.limits.image_shape import APPEARANCE
from vbaa_bench.limits.imaged_beam import PARAMETERS, ImagedBeam
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.profile import PixelNoise
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.random_streams import render_seed

# Largest share of render noise. Measured: with 0.03 and less, limits of x_c, s_c and force are
# within 1 % of the closed form; with 0.1 to 0.4 up to 5 % away.
LARGEST_NOISE: Final = 0.03
# Samples per pixel that are not exceeded for it. Chosen: a frame takes half a minute.
MAX_SAMPLES: Final = 16 * SAMPLES


class ImageChange(NamedTuple):
    """Expected image of a frame in n pixels, its derivatives, and its noise.

    `names` are the parameters, and APPEARANCE after them. `pixels` (n, 2) are columns and rows,
    `mean` (n,) is the radiance that reaches the sensor, and `variance` (n,) that of the sensor's
    noise. `slopes` (2, p + 3, n) are as in `BeamChange`.
    """

    names: tuple[str, ...]
    pixels: np.ndarray
    mean: Floats
    slopes: Floats
    variance: Floats

    @property
    def information(self) -> Information:
        """The information, from the product of two independent sets of samples."""
        product = (self.slopes[0] / self.variance) @ self.slopes[1].T
        return Information(self.names, (product + product.T) / 2)

    @property
    def information_with_noise(self) -> Information:
        """The same from each set's own square, the mean of two: render noise raises it."""
        squares = [(one / self.variance) @ one.T for one in self.slopes]
        return Information(self.names, np.mean(squares, axis=0))

    def render_noise(self, names: Collection[str]) -> float:
        """Compute the share of render noise in a set's own information on some parameters.

        It is the largest for any combination of them. The product of both sets does not contain
        this noise, but is itself uncertain by some of it.
        """
        others = set(self.names) - set(names)
        own, product = (
            data.without(others).matrix for data in (self.information_with_noise, self.information)
        )
        scale = np.sqrt(np.outer(own.diagonal(), own.diagonal()))
        return float(eigh((own - product) / scale, own / scale, eigvals_only=True)[-1])


def precise_change(
    renderer: FrameRenderer,
    spec: FrameSpec,
    exposure: float,
    parameters: Sequence[str],
    *,
    step_px: float = STEP_PX,
    seed: int = 0,
) -> ImageChange:
    """Differentiate the expected image with as many samples as its information needs.

    All combinations of the parameters and APPEARANCE are to have a share of render noise below
    LARGEST_NOISE; a combination that the image hardly shows may not reach it. Raises what
    `image_change` raises.
    """
    samples = SAMPLES
    while True:
        change = image_change(
            renderer, spec, exposure, parameters, step_px=step_px, samples=samples, seed=seed
        )
        if samples >= MAX_SAMPLES or change.render_noise(change.names) < LARGEST_NOISE:
            return change
        samples *= 4


def image_change(
    renderer: FrameRenderer,
    spec: FrameSpec,
    exposure: float,
    parameters: Sequence[str] = PARAMETERS,
    *,
    step_px: float = STEP_PX,
    samples: int = SAMPLES,
    seed: int = 0,
) -> ImageChange:
    """Differentiate the expected image of a frame by parameters and by APPEARANCE.

    Only pixels that show a part of the beam count, and their neighbours: the beam's shadow on the
    background gives no information. Pixels of a removed stretch are left out. `exposure` is that of
    the dataset. Raises EquilibriumError, and InputError with a scalar variant, which renders whole
    images only.
    """
    if is_scalar():
        raise InputError(f"limits from renders need a variant such as {FAST}, not a scalar one")
    scene = renderer.scene
    poses = exposure_poses(renderer.pose(spec), scene, renderer.rig)
    where = np.any([near_beam(renderer.pushed_world(pose)) for pose in poses], axis=0)
    camera = renderer.pushed_world(poses[0]).camera
    where &= ~_removed(poses[len(poses) // 2], camera)
    rows, columns = np.nonzero(where)
    pixels = np.column_stack([columns, rows])
    weights = renderer.exposure_weights(len(poses), "sensor", spec.index)
    if weights is None:
        weights = np.full((len(where), len(poses)), 1 / len(poses))
    names = (*parameters, *APPEARANCE)
    level = spec.scene.light_level
    light = level * renderer.vignetting[rows, columns]
    mean, slopes = np.zeros(len(rows)), np.zeros((2, len(names), len(rows)))
    for number, pose in enumerate(poses):
        imaged = ImagedBeam.of(pose, camera)
        change = beam_change(
            renderer.pushed_world(pose),
            imaged,
            imaged.neighbours(parameters),
            pixels,
            render_seed(scene, f"limits, pose {number}, {seed}", spec.index),
            step_px=step_px,
            samples=samples,
        )
        share = light * weights[rows, number]
        mean += share * change.mean
        slopes += share * change.slopes
    noise = PixelNoise.of(scene.sensor, renderer.sensor(exposure))
    return ImageChange(names, pixels, mean, slopes, noise.variance(mean))


def _removed(pose: Pose, camera: Camera) -> Mask:
    """Mark the pixels (height, width) that are declared as missing."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64)
    return is_removed(pose, camera, pixels).reshape(rows.shape)
