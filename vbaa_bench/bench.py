"""One worker's bench, on which a dataset's images are made: render, expose, write."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.instrument.files import write_bytes
from solver.instrument.images import png_bytes
from solver.instrument.units import DEGREE, PERCENT
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.writer import ShardWriter
from vbaa_bench.mechanics.planar import Equilibrium
from vbaa_bench.render.layers import layers
from vbaa_bench.render.picture import Sampling, even_picture, picture
from vbaa_bench.render.variant import activate
from vbaa_bench.render.world import World
from vbaa_bench.sensor.sensor import Sensor, exposure_for
from vbaa_bench.spec.rigs import TrueRig
from vbaa_bench.spec.scene import Scene
from vbaa_bench.spec.trials import Trial, random_generator, render_seed
from vbaa_bench.studio import Studio
from vbaa_bench.truth import motor_angle, truth_row

BOARD_SAMPLES = 64


@dataclass
class Bench:
    """One worker's bench: a renderer whose scene is loaded once. Its methods are the jobs."""

    scene: Scene
    rig: TrueRig
    layout: Layout
    variant: str
    threads: int
    _pushed: World | None = None

    def __post_init__(self) -> None:
        activate(self.variant, self.threads)
        self.studio = Studio(self.scene, self.rig)

    @cached_property
    def rest_world(self) -> World:
        """The beam before contact."""
        return self.studio.bench(None)

    def pushed_world(self, equilibrium: Equilibrium) -> World:
        """The beam pushed into `equilibrium`: put up once, reposed for every frame."""
        if self._pushed is None:
            self._pushed = self.studio.bench(equilibrium)
        self.studio.repose(self._pushed, equilibrium)
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
        states: Sequence[Equilibrium],
        exposure: float,
    ) -> None:
        """Make and save the frames of one shard."""
        with ShardWriter(self.layout, number) as writer:
            for trial, equilibrium in zip(trials, states, strict=True):
                self._frame(writer, trial, equilibrium, exposure)
                tick()

    def _frame(
        self, writer: ShardWriter, trial: Trial, equilibrium: Equilibrium, exposure: float
    ) -> None:
        seed = render_seed(self.scene, "frame", trial.index)
        radiance, found = self._look(self.pushed_world(equilibrium), seed)
        noise = random_generator(self.scene, "sensor", trial.index)
        image = self._sensor(exposure).expose(radiance, noise)
        encoder = random_generator(self.scene, "encoder", trial.index)
        encoder_sigma = self.scene.tolerances.encoder_deg * DEGREE
        reading = encoder.normal(motor_angle(self.scene, equilibrium), encoder_sigma)
        truth = truth_row(self.scene, self.rig, trial, equilibrium)
        kept = {str(layer): found[layer] for layer in self.scene.layers}
        writer.add(trial.frame_id, image, reading, truth, kept)

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
