"""Rendering of a dataset's images in one process: render and expose."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats, Grey
from solver.instrument.units import PERCENT
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.motion import averaged_poses, exposure_poses, pose_weights
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.pushes import PushSolver
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.assembly.shared_world import (
    SharedWorld,
    rest_grime_id,
    rest_static_pattern_id,
    shared_world,
)
from vbaa_bench.dataset.target import processor
from vbaa_bench.generation.readings import readings
from vbaa_bench.generation.truth_row import truth_row
from vbaa_bench.render.frame import (
    NoiseTarget,
    RenderedRadiance,
    StaticLayer,
    average_poses,
    render_frame,
    render_static_layer,
)
from vbaa_bench.render.pilots import Noise
from vbaa_bench.render.sample_table import Sampled, SampleTable
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.visibility import visibility
from vbaa_bench.render.world import World
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.random_scene import drawn_values, rest_scene
from vbaa_bench.scene.random_streams import random_generator, render_seed
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene
from vbaa_bench.sensor.fixed_pattern import FixedPattern
from vbaa_bench.sensor.from_spec import (
    fixed_pattern,
    flicker,
    image_sensor,
    metered_exposure,
    metered_peak,
    unsaturated_exposure,
)
from vbaa_bench.sensor.ideal import Ideal
from vbaa_bench.sensor.sensor import Sensor
from vbaa_bench.sensor.vignetting import relative_illumination

# Noise target of the image for metering the exposure, relative to its radiance.
METERING_NOISE = 0.05
# Factor of the noise targets for board views. Chosen: up to the sensor's own noise the sensor model
# adds what is missing, and a corner is measured by hundreds of pixels.
_BOARD_NOISE = 2.0
# Quantile of a board view's radiance that must not be saturated. Chosen: half of a board is white,
# and boards take a third of the image or more.
_BOARD_PEAK = 0.98
# Indices of the frames from which the sample table is learned. Chosen: they have ten thousands of
# pixels. They do not depend on the number of frames.
METERED = range(3)
# Rounds in which the sample table is learned. Chosen: the second one corrects the decay of the
# variance that the first one assumes.
_ROUNDS = 2


class Metering(NamedTuple):
    """Measured once per dataset before its frames: exposure, and the table of samples."""

    exposure: float
    table: SampleTable = SampleTable()


def metered_frames(specs: Iterable[FrameSpec]) -> list[FrameSpec]:
    """Choose the frames from which a dataset's sample table is learned."""
    return sorted((spec for spec in specs if spec.index in METERED), key=lambda spec: spec.index)


class RenderedFrame(NamedTuple):
    """A frame's gray image, columns of metadata.csv and truth row, and all its truth layers."""

    image: Grey
    readings: dict[str, str | float | int]
    truth: dict[str, Any]
    layers: dict[str, np.ndarray]


@dataclass
class FrameRenderer:
    """One process's renderer of a scene's images. `folder` has the files that the scene names."""

    scene: Scene
    rig: TrueRig
    folder: Path
    variant: str
    threads: int

    def __post_init__(self) -> None:
        activate(self.variant, self.threads)
        self.assembler = SceneAssembler(self.scene, self.rig, self.folder)
        self._knocked = self.rig.knocked(self.scene)
        self._last_world: SharedWorld | None = None
        # The static layer rendered last, by its pattern and by where the image's centre is: the
        # camera may have been knocked between the rest images and the frames.
        self._static_layers: dict[tuple[int, float, float], StaticLayer] = {}
        self.pushes = PushSolver(self.scene, self.rig, self.folder)

    def rest_world(self, number: int) -> World:
        """World of the beam before contact, with the motor at angle zero, in one rest image."""
        if not self.scene.random_keys:
            return self._rest_world
        return self._at_rest(self._rest_assembler(number))

    def _rest_assembler(self, number: int) -> SceneAssembler:
        """Return the assembler of a rest image."""
        if not self.scene.random_keys:
            return self.assembler
        scene = rest_scene(self.scene, number)
        pattern_id = rest_static_pattern_id(self.scene, number)
        # What does not move must not depend on the object that was drawn for this image.
        still_scene = None if pattern_id else self.scene
        grime_id = rest_grime_id(self.scene, number)
        return SceneAssembler(
            scene,
            self.rig,
            self.folder,
            pattern_id,
            grime_id=grime_id,
            still_scene=still_scene,
        )

    @cached_property
    def _rest_world(self) -> World:
        return self._at_rest(self.assembler)

    def _at_rest(self, assembler: SceneAssembler) -> World:
        return assembler.rest(Experiment.at_rest(assembler.scene, self.rig, self.folder))

    def pose(self, spec: FrameSpec) -> Pose:
        """Compute the pose of a frame."""
        return self.pushes.pose(spec)

    def pushed_world(self, pose: Pose) -> World:
        """Return the world in a pose; while the draws are the same, only its vertices are moved."""
        self._last_world = shared_world(
            self.scene, self._knocked, self.folder, pose.spec, self._last_world
        )
        return self._last_world.posed_world(pose)

    def measure_exposure(self) -> float:
        """Meter the exposure on the image of the resting beam."""
        seed = render_seed(self.scene, "exposure")
        target = self._noise_target(lambda radiance: METERING_NOISE * radiance)
        rendered = render_frame(self.rest_world(0), None, target, seed)
        light = self.vignetting * rendered.radiance
        return metered_exposure(self.scene.sensor, metered_peak(light[rendered.core], light))

    def meter(self, specs: Sequence[FrameSpec]) -> Metering:
        """Measure the exposure, and learn from some frames how many samples pixels need."""
        return self.learned(Metering(self.measure_exposure()), specs)

    def learned(
        self,
        metering: Metering,
        specs: Sequence[FrameSpec],
        begin: Callable[[str], None] = lambda _frame_id: None,
    ) -> Metering:
        """Learn from some frames how many samples pixels need.

        Nothing is learned without frames, or if the scene says so. Of a moving beam, one pose per
        frame is rendered. The renders are not kept. `begin` is called with the frame's name before
        each.
        """
        learns = bool(specs) and self.scene.render.sample_table and not is_scalar()
        for number in range(_ROUNDS if learns else 0):
            sampled = []
            for spec in specs:
                begin(spec.frame_id)
                sampled.append(self._sampled(spec, metering, number))
            together = Sampled(*map(np.concatenate, zip(*sampled, strict=True)))
            metering = metering._replace(table=metering.table.refined(together))
        return metering

    def _sampled(self, spec: FrameSpec, metering: Metering, number: int) -> Sampled:
        """Render one pose of a frame; return its sampled pixels."""
        poses = exposure_poses(self.pose(spec), self.scene, self.rig)
        target = self.frame_target(metering, averaged_poses(self.scene, len(poses)))
        world = self.pushed_world(poses[len(poses) // 2])
        seed = render_seed(self.scene, f"sample table, round {number}", spec.index)
        static = self._shared_layer(world, metering.exposure)
        sampled = render_frame(world, static, target, seed).sampled
        assert sampled is not None
        return sampled

    def board_image(self, view: int, exposure: float) -> Grey:
        """Render one calibration image, with a shorter exposure if it would be overexposed.

        A dark beam on a dark ground needs an exposure in which a white card is saturated.
        """
        seed = render_seed(self.scene, "board render", view)
        target = self._noise_target(self.sensor(exposure).noise_sigma).scaled(_BOARD_NOISE)
        rendered = render_frame(self.assembler.calibration_board(view), None, target, seed)
        lit = self._exposed([rendered], "board sensor", view)
        peak = float(np.quantile(self.vignetting * rendered.radiance, _BOARD_PEAK))
        exposure = unsaturated_exposure(self.scene.sensor, exposure, peak)
        return self._expose(lit, exposure, "board sensor", view)

    def rest_image(self, number: int, exposure: float) -> Grey:
        """Render one image of the beam before contact."""
        seed = render_seed(self.scene, "rest", number)
        target = self._noise_target(self.sensor(exposure).noise_sigma)
        world, pattern_id = self.rest_world(number), rest_static_pattern_id(self.scene, number)
        static = None if pattern_id else self._static_layer(world, pattern_id, exposure)
        rendered = render_frame(world, static, target, seed)
        lit = self._exposed([rendered], "rest sensor", number)
        return self._expose(lit, exposure, "rest sensor", number)

    def ground_image(self, number: int, exposure: float) -> Grey:
        """Render one image of the ground, as in the rest image of this number without the beam."""
        seed = render_seed(self.scene, "ground", number)
        target = self._noise_target(self.sensor(exposure).noise_sigma)
        assembler = self._rest_assembler(number)
        world = assembler.without_beam(Experiment.at_rest(assembler.scene, self.rig, self.folder))
        pattern_id = rest_static_pattern_id(self.scene, number)
        # The layer of the world with the beam, whose surfaces have the indices of all frames.
        static = (
            None
            if pattern_id
            else self._static_layer(self.rest_world(number), pattern_id, exposure)
        )
        rendered = render_frame(world, static, target, seed)
        lit = self._exposed([rendered], "ground sensor", number)
        return self._expose(lit, exposure, "ground sensor", number)

    def frame(self, spec: FrameSpec, metering: Metering) -> RenderedFrame:
        """Render one frame and collect its truth."""
        pose = self.pose(spec)
        image, rendered = self.expose_frame(spec, metering)
        line = self.assembler.centreline(pose)
        visible = visibility(rendered.coverage, self._knocked.camera, line, self.rig.beam.radius)
        truth = truth_row(pose.experiment, spec, pose.state, pose.hidden, visible)
        drawn = drawn_values(self.scene.random_keys, spec.scene)
        truth |= {f"drawn.{key}": value for key, value in drawn.items()}
        truth["processor"] = processor()
        values = readings(
            self.scene,
            spec,
            pose.state,
            pose.hidden,
            pose.experiment.table_from_antenna(spec.onset) if self.scene.carriage else None,
        )
        return RenderedFrame(image, values, truth, rendered.by_name())

    def expose_frame(self, spec: FrameSpec, metering: Metering) -> tuple[Grey, RenderedRadiance]:
        """Render one frame: its gray image, and the radiance it was exposed to."""
        poses = exposure_poses(self.pose(spec), self.scene, self.rig)
        level, averaged = spec.scene.light_level, averaged_poses(self.scene, len(poses))
        target, rendered = self.frame_target(metering, averaged, level), []
        for number, pose in enumerate(poses):
            world = self.pushed_world(pose)
            seed = render_seed(self.scene, f"frame, pose {number}", spec.index)
            static = self._shared_layer(world, metering.exposure)
            rendered.append(render_frame(world, static, target, seed))
        blurred = self._exposed(rendered, "sensor", spec.index).at_level(level)
        return self._expose(blurred, metering.exposure, "sensor", spec.index), blurred

    def frame_target(self, metering: Metering, poses: float, level: float = 1.0) -> NoiseTarget:
        """Noise target of each of a frame's poses: their average may have the scene's noise.

        `level` is that of the light. The sensor's noise is relative to the radiance at level 1.
        """
        target = self._noise_target(self.sensor(metering.exposure * level).noise_sigma)
        return replace(target, table=metering.table).scaled(poses**0.5)

    def _shared_layer(self, world: World, exposure: float) -> StaticLayer | None:
        """Return the static layer of a frame; None if no other frame shares it."""
        assert self._last_world is not None
        if not self._last_world.shared:
            return None
        return self._static_layer(world, self._last_world.static_pattern_id, exposure)

    def _static_layer(self, world: World, pattern_id: int, exposure: float) -> StaticLayer | None:
        """Return the static layer of a pattern; None if only whole images are rendered.

        It has the noise for light level 1, whatever the level of the first frame.
        """
        if is_scalar() or not self.scene.render.static_layer:
            return None
        key = pattern_id, world.camera.cx, world.camera.cy
        if key not in self._static_layers:
            target = self._noise_target(self.sensor(exposure).noise_sigma)
            seed = render_seed(self.scene, "plate", pattern_id)
            self._static_layers = {key: render_static_layer(world, target, seed)}
        return self._static_layers[key]

    def _noise_target(self, noise: Noise) -> NoiseTarget:
        spec = self.scene.render
        ratios = (spec.noise_near_beam, spec.noise_elsewhere, spec.noise_static_layer)
        return NoiseTarget(noise, spec.near_beam_px, *ratios, outlier=spec.largest_outlier)

    def sensor(self, exposure: float) -> Sensor | Ideal:
        """Build the scene's image sensor."""
        return image_sensor(self.scene.sensor, exposure, self._fixed_pattern)

    @cached_property
    def _fixed_pattern(self) -> FixedPattern | None:
        camera, random = self.rig.camera, random_generator(self.scene, "fixed pattern")
        return fixed_pattern(self.scene.sensor, (camera.height, camera.width), random)

    def _exposed(
        self, images: Sequence[RenderedRadiance], stream: str, number: int
    ) -> RenderedRadiance:
        """Integrate the poses of one image over its exposure; the phase of flicker is random."""
        return average_poses(images, self.exposure_weights(len(images), stream, number))

    def exposure_weights(self, poses: int, stream: str, number: int) -> Floats | None:
        """Compute the weights (rows, poses) of an image's poses; None if all are equal."""
        random = random_generator(self.scene, f"{stream} flicker", number)
        return pose_weights(self.scene, poses, flicker(self.scene.flicker, random))

    def _expose(
        self, rendered: RenderedRadiance, exposure: float, stream: str, number: int
    ) -> Grey:
        noise, light = random_generator(self.scene, stream, number), self.vignetting
        sensor = self.sensor(exposure)
        return sensor.expose(light * rendered.radiance, noise, light**2 * rendered.variance)

    @cached_property
    def vignetting(self) -> Floats:
        """Relative illumination (height, width): fraction of the light that the lens transmits."""
        camera = self.rig.camera
        rows, columns = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64)
        darker = self.scene.optics.vignetting_pct * PERCENT
        return relative_illumination(columns, rows, (camera.height, camera.width), darker)
