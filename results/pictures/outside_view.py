"""Picture of a scene's rig from outside, in colour."""

from pathlib import Path
from typing import Final

import cv2

from results.pictures.outside_render import picture
from results.pictures.outside_rig import rig_bodies, viewpoint
from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.render.illumination import lights
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import SceneFile

SIZE_PX: Final = (1280, 1000)
SAMPLES: Final = 32


def outside_view(
    file: SceneFile,
    number: int,
    out: Path,
    variant: str,
    *,
    size_px: tuple[int, int] = SIZE_PX,
    samples: int = SAMPLES,
) -> None:
    """Render a frame's rig, with camera, motor and lamps, and write it as a PNG.

    `variant` is one of those that `choose` returns; its colour variant is used. Raises InputError.
    """
    frames = Frames(file.scene)
    if not 0 <= number < frames.count:
        raise InputError(f"frame {number} does not exist, allowed is 0 to {frames.count - 1}")
    planned, folder = plan(file, pushes=[frames.push_of(number)]), file.folder.resolve()
    rig, spec = planned.rig, next(s for s in planned.frame_specs if s.index == number)
    activate(variant, 0, colour=True)
    assembler = SceneAssembler(spec.scene, rig, folder)
    experiment = Experiment(spec.scene, rig, spec.push, folder)
    pose = Pose(experiment, spec, experiment.states()[spec.step])
    lamps = lights(spec.scene, folder)
    bodies = rig_bodies(assembler, assembler.surfaces(pose), lamps)
    unit = assembler.unit
    image = picture(bodies, lamps, viewpoint(assembler), unit, size_px, samples)
    success, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert success
    write_bytes(out, data.tobytes())
