"""One worker's bench, on which a dataset's images are made: render, expose, write."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from solver.instrument.arrays import Grey
from solver.instrument.files import write_bytes
from solver.instrument.images import png_bytes
from solver.instrument.units import PERCENT
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.writer import ShardWriter
from vbaa_bench.experiment import Experiment
from vbaa_bench.mechanics.state import State
from vbaa_bench.readings import readings
from vbaa_bench.render.layers import layers, visible_share
from vbaa_bench.render.picture import Sampling, even_picture, picture
from vbaa_bench.render.variant import activate
from vbaa_bench.render.world import World
from vbaa_bench.sensor.sensor import Sensor, exposure_for
from vbaa_bench.spec.rigs import TrueRig
from vbaa_bench.spec.scene import Scene
from vbaa_bench.spec.trials import Push, Trial, random_generator, render_seed
from vbaa_bench.studio import Pose, Studio
from vbaa_bench.truth import truth_row

BOARD_SAMPLES = 64
# Of so many pushes a worker remembers the states.
LAST_PUSHES = 64


@dataclass
class Bench:
    """One worker's bench: a renderer whose scene is loaded once. Its methods are the jobs."""

    scene: Scene
    rig: TrueRig
    folder: Path
    layout: Layout
    variant: str
    threads: int
    _pushed: World | None = None

    def __post_init__(self) -> None:
        activate(self.variant, self.threads)
        self.studio = Studio(self.scene, self.rig, self.folder)
        # Frames come in the order of their names; those of one push lie apart.
        self.states = lru_cache(maxsize=LAST_PUSHES)(self._states)

    def _states(self, push: Push) -> tuple[Experiment, list[State]]:
        experiment = Experiment(self.scene, self.rig, push, self.folder)
        return experiment, experiment.states()

    @cached_property
    def rest_world(self) -> World:
        """The beam before contact."""
        nothing = Push(0.5 * self.rig.beam.length, 0.0, 0.0, ())
        return self.studio.rest(Experiment(self.scene, self.rig, nothing, self.folder))

    def pose(self, trial: Trial) -> Pose:
        """What is to be set up for a frame."""
        experiment, states = self.states(trial.push)
        return Pose(experiment, trial, states[trial.step])

    def pushed_world(self, pose: Pose) -> World:
        """The beam as a pose has it: put up once, reposed for every frame."""
        if self._pushed is None:
            self._pushed = self.studio.bench(pose)
        self.studio.repose(self._pushed, pose)
        return self._pushed

    def measure_exposure(self, tick: Callable[[], None]) -> float:
        """Exposure that puts the brightest hundredth of the resting beam where the scene says."""
        spec = self.scene.sensor
        radiance, found = self._look(self.rest_world, render_seed(self.scene, "exposure"))
        peak = float(np.quantile(radiance[found["beam_mask"] > 0], 0.99))
        tick()
        return exposure_for(peak, spec.full_well_e, spec.beam_peak_pct * PERCENT)

    def board_view(self, tick: Callable[[], None], view: int, exposure: float) -> None:
        """Save one calibration image."""
        world = self.studio.card(view)
        seed = render_seed(self.scene, "board render", view)
        radiance = even_picture(world, BOARD_SAMPLES, seed)
        self._save(f"calibration/view_{view:02d}.png", radiance, exposure, "board sensor", view)
        tick()

    def rest_image(self, tick: Callable[[], None], number: int, exposure: float) -> None:
        """Save one image of the beam before contact."""
        seed = render_seed(self.scene, "rest", number)
        radiance, _ = self._look(self.rest_world, seed)
        self._save(f"rest/rest_{number:02d}.png", radiance, exposure, "rest sensor", number)
        tick()

    def shard(
        self,
        tick: Callable[[], None],
        number: int,
        trials: Sequence[Trial],
        exposure: float,
    ) -> None:
        """Make and save the frames of one shard."""
        with ShardWriter(self.layout, number) as writer:
            for trial in trials:
                self._frame(writer, trial, exposure)
                tick()

    def _frame(self, writer: ShardWriter, trial: Trial, exposure: float) -> None:
        pose = self.pose(trial)
        image, found = self._photograph(trial, exposure)
        truth = truth_row(pose.experiment, trial, pose.state, pose.hidden)
        length_mm = self.scene.beam.length_mm
        truth["visible_share"] = visible_share(found["arc_length"], found["beam_mask"], length_mm)
        kept = {str(layer): found[layer] for layer in self.scene.layers}
        told = readings(self.scene, trial, pose.state, pose.hidden)
        writer.add(trial.frame_id, image, told, truth, kept)

    def photograph(self, trial: Trial, exposure: float) -> Grey:
        """The image of one frame."""
        return self._photograph(trial, exposure)[0]

    def _photograph(self, trial: Trial, exposure: float) -> tuple[Grey, dict[str, np.ndarray]]:
        """The image of one frame, and its truth layers."""
        seed = render_seed(self.scene, "frame", trial.index)
        radiance, found = self._look(self.pushed_world(self.pose(trial)), seed)
        noise = random_generator(self.scene, "sensor", trial.index)
        return self._sensor(exposure).expose(radiance, noise), found

    def _look(self, world: World, seed: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Radiance of a world and its truth layers."""
        seen, spec = layers(world), self.scene.render
        sampling = Sampling(spec.near_beam_px, spec.samples_near_beam, spec.samples_elsewhere)
        radiance = picture(world, seen.beam_mask, sampling, seed)
        return radiance, {
            "radiance": radiance,
            "beam_mask": seen.beam_mask,
            "arc_length": seen.arc_length_mm,
            "depth": seen.depth_mm,
            "object_index": seen.object_index,
        }

    def _sensor(self, exposure: float) -> Sensor:
        spec = self.scene.sensor
        return Sensor(exposure, spec.full_well_e, spec.read_noise_e)

    def _save(
        self, name: str, radiance: np.ndarray, exposure: float, stage: str, number: int
    ) -> None:
        noise = random_generator(self.scene, stage, number)
        image = self._sensor(exposure).expose(radiance, noise)
        write_bytes(self.layout.observations / name, png_bytes(image))
