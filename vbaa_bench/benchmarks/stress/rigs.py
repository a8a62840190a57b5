"""Drawn rigs: a scene with another seed, another camera mount and a few random pushes."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.errors import InputError
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.generation.generate import generate
from vbaa_bench.scene.camera import CameraSpec
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.push import PushSpec
from vbaa_bench.scene.sampling import SamplingSpec
from vbaa_bench.scene.schema import Scene

# Rigs differ in the camera's position and aim by up to this fraction of their distance, and in its
# roll by up to this angle. Chosen: a few pixels, so that the beam crosses the pixel rows at another
# phase and angle in each rig, while beam and board stay in view of the shipped scenes.
MOUNT_FRACTION: Final = 0.005
MOUNT_ROLL_DEG: Final = 1.0
# Small shards occupy several workers. Not derived from their number: a dataset depends on it.
FRAMES_PER_SHARD: Final = 5

Progress = Callable[[int, int], None]


def drawn_rig(file: SceneFile, seed: int, number: int, frames: int) -> SceneFile:
    """Draw rig `number` of a scene: its true rig, its camera's mount and its pushes.

    Contact distances, deflections, normals and stiffnesses are Sobol points over the ranges
    of the scene. Raises InputError for a scene without contact distances and deflections, and for
    images that are not of 8 bits.
    """
    scene = file.scene
    random = np.random.default_rng([seed, number])
    update = {
        "seed": int(random.integers(2**62)),
        "tolerances": scene.tolerances.model_copy(update={"true_rig": "drawn"}),
        "camera": _mounted(scene.camera, random),
        "pushes": None,
        "sampling": _pushes(file, frames),
        "layers": (),
        "frames_per_shard": FRAMES_PER_SHARD,
    }
    if scene.sensor.bits != 8:
        message = f"is {scene.sensor.bits}, allowed is 8: videos and JPEG have 8 bits"
        raise InputError(file.message_at(("sensor", "bits"), message))
    return file.with_scene(Scene.model_validate(scene.model_dump() | _as_dict(update)))


def render(
    files: Sequence[SceneFile], work: Path, variant: str, workers: int, progress: Progress
) -> list[Layout]:
    """Make the datasets of drawn rigs in `work`, or finish them; `progress` counts their images.

    Raises InputError where a rig is impossible or its folder has other contents.
    """
    layouts, finished = [], 0
    totals = [_images(file.scene) for file in files]
    for number, (file, images) in enumerate(zip(files, totals, strict=True)):

        def count(done: int, _total: int, before: int = finished) -> None:
            progress(before + done, sum(totals))

        root = work / f"rig_{number:03d}"
        layouts.append(generate(file, root, variant, workers, count))
        finished += images
        progress(finished, sum(totals))
    return layouts


def _images(scene: Scene) -> int:
    assert scene.sampling is not None
    # The exposure is measured from one more image.
    return scene.calibration.views + scene.sensor.rest_images + scene.sampling.count + 1


def _as_dict(update: dict[str, object]) -> dict[str, object]:
    return {
        key: value.model_dump() if hasattr(value, "model_dump") else value
        for key, value in update.items()
    }


def _mounted(camera: CameraSpec, random: np.random.Generator) -> CameraSpec:
    position, aim = np.array(camera.position_mm), np.array(camera.look_at_mm)
    max_shift = MOUNT_FRACTION * float(np.linalg.norm(position - aim))
    shifts = random.uniform(-max_shift, max_shift, (2, 3))
    # The aim stays in plane C, as in the scene.
    shifts[1, 2] = 0.0
    roll = camera.roll_deg + MOUNT_ROLL_DEG * float(random.uniform(-1, 1))
    return camera.model_copy(
        update={
            "position_mm": tuple((position + shifts[0]).tolist()),
            "look_at_mm": tuple((aim + shifts[1]).tolist()),
            "roll_deg": float(np.clip(roll, -45, 45)),
        }
    )


def _pushes(file: SceneFile, frames: int) -> SamplingSpec:
    scene = file.scene
    if scene.sampling is not None:
        return scene.sampling.model_copy(update={"count": frames, "method": "sobol"})
    pushes = scene.pushes
    assert pushes is not None
    if pushes.contact_distance_mm is None or pushes.deflection_pct is None:
        message = "has no contact_distance_mm or no deflection_pct; stress needs ranges of both"
        raise InputError(file.message_at(("pushes",), message))
    return SamplingSpec(
        method="sobol",
        count=frames,
        contact_distance_mm=_range(pushes.contact_distance_mm),
        deflection_pct=_range(pushes.deflection_pct),
        normal_deg=_range(pushes.normal_deg),
        stiffness_n_m=_springs(pushes),
        motor_angle_at_contact_deg=pushes.motor_angle_at_contact_deg,
    )


def _springs(pushes: PushSpec) -> tuple[float, float] | None:
    springs = [value for value in pushes.stiffness_n_m if not isinstance(value, str)]
    return _range(springs) if springs else None


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)
