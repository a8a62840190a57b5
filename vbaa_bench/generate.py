"""A dataset, from scene to files: spec -> mechanics -> geometry -> render -> sensor -> dataset."""

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes, write_text
from solver.instrument.images import png_bytes
from solver.instrument.rig import rig_to_json
from solver.instrument.transforms import apply, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import read_json, seal, versions
from vbaa_bench.dataset.writer import ShardWriter
from vbaa_bench.mechanics.planar import Equilibrium
from vbaa_bench.plan import Plan, plan
from vbaa_bench.render.layers import layers
from vbaa_bench.render.picture import Sampling, even_picture, picture
from vbaa_bench.render.variant import activate
from vbaa_bench.render.world import World
from vbaa_bench.sensor.sensor import Sensor, exposure_for
from vbaa_bench.spec.load import SceneFile
from vbaa_bench.spec.rigs import TrueRig, nominal_rig
from vbaa_bench.spec.scene import Scene
from vbaa_bench.spec.trials import Trial, random_generator, render_seed
from vbaa_bench.studio import Studio
from vbaa_bench.workers import Pool

BOARD_SAMPLES = 64
Progress = Callable[[int, int], None]


def generate(file: SceneFile, root: Path, variant: str, workers: int, progress: Progress) -> Layout:
    """Make the dataset of a scene at `root`, or finish one that was interrupted.

    `progress(done, total)` is called as images are made. A complete dataset of the same scene
    and seed is left as it is. Raises InputError where the scene is impossible or `root` is
    not writable or holds something else.
    """
    scene, layout = file.scene, Layout(root)
    work = plan(file)
    try:
        if _claim(layout, scene, variant):
            return layout
        write_text(layout.observations / "rig.json", rig_to_json(nominal_rig(scene)))
        exposure = _make(scene, work, layout, (variant, workers), progress)
        seal(layout, _facts(scene, work.rig, exposure, variant))
    except OSError as error:
        raise InputError(f"{layout.root}: cannot be written ({error.strerror})") from error
    return layout


def _make(
    scene: Scene, work: Plan, layout: Layout, machine: tuple[str, int], progress: Progress
) -> float:
    """All images and shards that are not there yet; the exposure they were made with."""
    variant, workers = machine
    threads = max((os.cpu_count() or 1) // workers, 1)
    # One more than there are images: the exposure is measured from one that is not kept.
    total = work.frames + scene.calibration.views + scene.sensor.rest_images + 1
    with Pool(workers, Bench, (scene, work.rig, layout, variant, threads)) as pool:
        exposure = float(pool.call("measure_exposure"))
        jobs: list[tuple[str, tuple[Any, ...]]] = [
            ("board_view", (view, exposure)) for view in range(scene.calibration.views)
        ]
        jobs += [("rest_image", (i, exposure)) for i in range(scene.sensor.rest_images)]
        finished = 0
        for number, shard in enumerate(work.shards):
            if layout.shard(layout.observations, number).is_dir():
                finished += len(shard)
            else:
                states = [work.equilibria[trial.push] for trial in shard]
                jobs.append(("shard", (number, shard, states, exposure)))
        pool.run(jobs, lambda done: progress(finished + done, total))
    return exposure


def _claim(layout: Layout, scene: Scene, variant: str) -> bool:
    """Take `root` for this scene; True if its dataset is already complete. Raises InputError."""
    marker = layout.truth / "identity.json"
    identity = {
        "scene": scene.model_dump(mode="json"),
        "made_with": {"variant": variant, **versions()},
    }
    if not marker.is_file():
        if layout.root.exists() and any(layout.root.iterdir()):
            raise InputError(f"{layout.root}: holds something else; choose an empty folder")
        layout.truth.mkdir(parents=True)
        write_text(marker, json.dumps(identity) + "\n")
    found = read_json(marker)
    if found.get("scene") != identity["scene"]:
        raise InputError(
            f"{layout.root}: holds the dataset of another scene or seed; "
            "choose another folder, or remove it"
        )
    if layout.hashes.is_file() and layout.manifest.is_file():
        return True
    if found.get("made_with") != identity["made_with"]:
        raise InputError(
            f"{layout.root}: was begun with {found.get('made_with')}, here is "
            f"{identity['made_with']}; a dataset is of one kind, so remove the folder or finish "
            "it where it was begun"
        )
    for folder in ("calibration", "rest"):
        (layout.observations / folder).mkdir(parents=True, exist_ok=True)
    return False


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
        seed = render_seed(self.scene, "board view", view)
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
        motor_angle = self._motor_angle(equilibrium)
        encoder = random_generator(self.scene, "encoder", trial.index)
        reading = encoder.normal(motor_angle, self.scene.tolerances.encoder_deg * DEGREE)
        truth = self._truth(trial, equilibrium, motor_angle)
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

    def _motor_angle(self, equilibrium: Equilibrium) -> float:
        """Seen from the camera the motor turns clockwise, so contact bends the beam towards +y."""
        at_contact = self.scene.pushes.motor_angle_at_contact_deg * DEGREE
        return at_contact - equilibrium.pushing_angle

    def _truth(self, trial: Trial, e: Equilibrium, motor_angle: float) -> dict[str, Any]:
        """The truth row of a frame: lengths in mm, angles in degrees, stress in MPa."""
        scene, mm = self.scene, MILLIMETRE
        base = self.rig.base_position
        contact_d = np.array([e.x_c, e.y_c, 0.0])
        contact_a = contact_d + base
        # Eq. (1). The motor turns clamp and beam about the clamp, wherever that truly stands.
        contact_o = apply(turn_about_z(motor_angle), contact_d[None])[0] + base
        stress = e.largest_stress(scene.beam.youngs_modulus_gpa * 1e9) / 1e6
        return {
            "model": "exact, planar, frictionless edge fixed in the world",
            "trial": trial.index,
            "repeat": trial.repeat,
            "push": str(trial.push),
            "contact_distance_at_rest_mm": e.contact_distance / mm,
            "deflection_pct": float(e.tip[1]) / e.beam.length / PERCENT,
            "pushing_angle_deg": e.pushing_angle / DEGREE,
            "motor_angle_deg": motor_angle / DEGREE,
            "x_c_mm": e.x_c / mm,
            "y_c_mm": e.y_c / mm,
            "s_c_mm": e.s_c / mm,
            "theta_c_deg": e.theta_c / DEGREE,
            "psi_deg": 0.0,
            "force_n": e.force,
            "force_antenna_n": [-e.force * np.sin(e.theta_c), e.force * np.cos(e.theta_c), 0.0],
            "contact_antenna_mm": (contact_a / mm).tolist(),
            "contact_world_mm": (contact_o / mm).tolist(),
            "tip_mm": (e.tip / mm).tolist(),
            "base_moment_n_mm": e.moment / mm,
            "largest_stress_mpa": stress,
            "above_yield": stress > scene.beam.yield_stress_mpa,
            "residual": e.residual,
            "contact_row": e.contact_row,
            "centreline_s_mm": (e.centreline[:, 0] / mm).tolist(),
            "centreline_x_mm": (e.centreline[:, 1] / mm).tolist(),
            "centreline_y_mm": (e.centreline[:, 2] / mm).tolist(),
        }


def _facts(scene: Scene, rig: TrueRig, exposure: float, variant: str) -> dict[str, Any]:
    camera, mm = rig.camera, MILLIMETRE
    return {
        "scene": scene.model_dump(mode="json"),
        "seed": scene.seed,
        "variant": variant,
        "exposure_e_per_radiance": exposure,
        "true_rig": {
            "beam_length_mm": rig.beam.length / mm,
            "beam_diameter_mm": rig.beam.diameter / mm,
            "flexural_rigidity_n_mm2": rig.beam.flexural_rigidity * 1e6,
            "base_position_mm": (rig.base_position / mm).tolist(),
            "antenna_from_board": rig.antenna_from_board.tolist(),
            "camera": {
                "width_px": camera.width,
                "height_px": camera.height,
                "fx_px": camera.fx,
                "fy_px": camera.fy,
                "cx_px": camera.cx,
                "cy_px": camera.cy,
                "camera_from_antenna": camera.camera_from_antenna.tolist(),
            },
        },
    }
