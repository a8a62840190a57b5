"""Measure what one scene costs on one core, part by part, with compiled kernels.

A fresh process prints one line of JSON after each part, so that a process that has to be ended
leaves the parts before. All seconds are of one worker with one renderer thread:

- `plan_s`: solve one push;
- `table_s`: meter the exposure and learn the sample table, once per dataset;
- `static_s`: render the static layer, once per dataset; 0 if the scene has none;
- `boards_s`: render all calibration views of a rig;
- `frame_s`: make a frame, which is the sum of `mechanics_s`, `mesh_s`, `render_s`, `sensor_s` and
  `files_s`. Of the measured frames, this is the one of median cost. `mechanics_s` contains the
  frame's part of its push, `render_s` the truth row, and `files_s` neither metadata.csv nor
  truth.parquet, which are written once per shard;
- `samples`: number of samples of one frame;
- `noise_over_target`: noise of the render on the beam over the scene's target, in the median
  frame.
"""

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from solver.instrument.errors import InputError
from vbaa_bench.assembly.motion import exposure_poses
from vbaa_bench.assembly.plan import plan
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.writer import ShardWriter, shard_writer
from vbaa_bench.generation.frame_renderer import (
    METERED,
    FrameRenderer,
    Metering,
    RenderedFrame,
    metered_frames,
)
from vbaa_bench.render.frame import render_static_layer
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.scene.frames import Frames, FrameSpec, frame_specs
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scene.random_streams import random_generator, render_seed

# Frames and calibration views that are measured. Chosen: an odd number of frames has a median, and
# two views differ by a few per cent.
_FRAMES: Final = 5
_VIEWS: Final = 2

Record = dict[str, Any]
Result = TypeVar("Result")


class FrameCost(NamedTuple):
    """Seconds of the parts of a frame."""

    mechanics_s: float
    mesh_s: float
    render_s: float
    sensor_s: float
    files_s: float


def parts(file: SceneFile, variant: str, folder: Path) -> Iterator[Record]:
    """Yield the costs of a scene as they are measured. Raises InputError.

    A few images are written to `folder`.
    """
    scene = file.scene
    frames = Frames(scene)
    indices = _spread(frames.count)
    plan(file, pushes=[0])  # compiles the mechanics
    needed = {frames.push_of(i) for i in (*indices, *METERED) if i < frames.count}
    planned, seconds = _timed(lambda: plan(file, pushes=needed))
    specs = {spec.index: spec for spec in planned.frame_specs}
    chosen, metered = [specs[i] for i in indices], metered_frames(specs.values())
    push_s = seconds / len({spec.push for spec in planned.frame_specs})
    camera = planned.rig.camera
    yield {"width_px": camera.width, "height_px": camera.height, "plan_s": push_s}

    layout = Layout(folder)
    renderer = FrameRenderer(scene, planned.rig, file.folder.resolve(), variant, threads=1)
    # Builds the world, renders the static layer and compiles kernels.
    renderer.expose_frame(metered[0], Metering(renderer.measure_exposure()))
    metering, table_s = _timed(lambda: renderer.meter(metered))
    yield {"table_s": table_s}
    yield {"static_s": _static_layer(renderer, metered[0], metering)}

    _, rendered = renderer.expose_frame(chosen[len(chosen) // 2], metering)
    yield {"samples": int(rendered.samples.sum())}
    for tree in layout.trees:
        tree.mkdir()
    # Repetitions of a push are solved once.
    distinct = len({spec.push for spec in frame_specs(scene)})
    push_share_s = push_s * distinct / frames.count
    costs, noise = list[FrameCost](), list[float]()
    with shard_writer(layout, 0) as writer:
        for spec in chosen:
            frame, cost = _frame(renderer, spec, metering, writer)
            costs.append(cost._replace(mechanics_s=cost.mechanics_s + push_share_s))
            noise += _noise_over_target(renderer, frame, metering)
    middle = sorted(costs, key=sum)[len(costs) // 2]
    yield {
        **middle._asdict(),
        "frame_s": sum(middle),
        "noise_over_target": median(noise) if noise else None,
    }
    yield {"boards_s": _boards(renderer, metering)}


def _spread(frames: int) -> list[int]:
    """Choose indices of frames evenly spread over a dataset."""
    count = min(_FRAMES, frames)
    return [(2 * i + 1) * frames // (2 * count) for i in range(count)]


def _static_layer(renderer: FrameRenderer, spec: FrameSpec, metering: Metering) -> float:
    """Measure the seconds of the static layer."""
    scene = renderer.scene
    if is_scalar():
        return 0.0
    world, target = renderer.pushed_world(renderer.pose(spec)), renderer.frame_target(metering, 1)
    _, seconds = _timed(lambda: render_static_layer(world, target, render_seed(scene, "plate")))
    return seconds


def _boards(renderer: FrameRenderer, metering: Metering) -> float:
    """Measure the seconds of a rig's calibration views, from one or two of them."""
    views = renderer.scene.calibration.views
    renderer.board_image(0, metering.exposure)  # compiles kernels
    measured = range(1, min(views, 1 + _VIEWS)) or range(1)
    _, seconds = _timed(lambda: [renderer.board_image(v, metering.exposure) for v in measured])
    return views * seconds / len(measured)


def _frame(
    renderer: FrameRenderer, spec: FrameSpec, metering: Metering, writer: ShardWriter
) -> tuple[RenderedFrame, FrameCost]:
    """Make a frame and measure its parts, without the mechanics of its push.

    Meshes and sensor are measured by themselves; what remains of the frame is its render.
    """
    scene, pose = renderer.scene, renderer.pose(spec)
    poses, motion_s = _timed(lambda: exposure_poses(pose, scene, renderer.rig))
    _, mesh_s = _timed(lambda: [renderer.pushed_world(each) for each in poses])
    frame, frame_s = _timed(lambda: renderer.frame(spec, metering))
    light, variance = frame.layers["radiance"], frame.layers["variance"]
    random = random_generator(scene, "speed", spec.index)
    _, sensor_s = _timed(lambda: renderer.sensor(metering.exposure).expose(light, random, variance))
    saved = frame._replace(layers={str(layer): frame.layers[layer] for layer in scene.layers})
    _, files_s = _timed(lambda: writer.add(spec.frame_id, *saved))
    render_s = frame_s - motion_s - mesh_s - sensor_s
    return frame, FrameCost(motion_s, mesh_s, render_s, sensor_s, files_s)


def _noise_over_target(
    renderer: FrameRenderer, frame: RenderedFrame, metering: Metering
) -> list[float]:
    """Compute the noise of a frame's render on the beam over its target; [] without a beam."""
    layers = frame.layers
    beam = layers["coverage"] > 0
    if not beam.any():
        return []
    sigma = renderer.sensor(metering.exposure).noise_sigma(layers["radiance"])
    ratio = np.sqrt(np.mean((layers["variance"] / sigma**2)[beam]))
    return [float(ratio / renderer.scene.render.noise_near_beam)]


def _timed(action: Callable[[], Result]) -> tuple[Result, float]:
    """Return an action's result and its seconds."""
    start = perf_counter()
    result = action()
    return result, perf_counter() - start


def _main(path: str, variant: str, folder: str) -> None:
    try:
        for part in parts(load_scene(Path(path)), variant, Path(folder)):
            print(json.dumps(part), flush=True)
    except InputError as error:
        sys.exit("; ".join(str(error).splitlines()))


if __name__ == "__main__":
    _main(*sys.argv[1:])
