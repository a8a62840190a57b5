"""Measure seconds per frame against image error, for our renderer and for plain Mitsuba.

A frame is end to end, for both: new vertices of all moving parts, render, truth layers, sensor,
PNG and EXR; the mechanics are excluded. Our time includes each frame's part of the static layer,
which is rendered once for all frames of the scene. Plain Mitsuba renders all pixels by `mi.render`;
it computes no variance and coverage, for which its EXR holds zeros. Both run in this process on all
threads, with compiled kernels, except plain points for which there is time only once.
"""

import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from results.render_speed.curves import TARGET, Record, at_equal_error, write
from results.render_speed.image_error import Reference, beam_line, reference_of
from results.render_speed.plain import (
    SAMPLERS,
    Plain,
    Sampler,
    seconds_in_kernels,
    seconds_of_rays,
)
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes
from solver.instrument.images import png_bytes
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.dataset.exr import write_exr
from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering, metered_frames
from vbaa_bench.render.frame import (
    NoiseTarget,
    RenderedRadiance,
    StaticLayer,
    render_frame,
    render_static_layer,
)
from vbaa_bench.render.layers import every_pixel
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.render.world import World
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.workers.resources import cores

# Ours: factors of the scene's noise targets. Plain: samples per pixel.
_SCALES = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)
_SAMPLES = (4, 16, 64, 256, 1024)
# Number of samples that fit into memory.
_MAX_SAMPLES_PER_FRAME = 1 << 28
# Repetitions of each frame, if there is time; the median time and the mean squared error count.
_REPEATS = 3
# Dr.Jit orders the operations of one program at random; each order is compiled when it first
# occurs.
_WARM_UP_FRAMES = 4
# Maximum fraction of the time for the reference.
_REFERENCE_FRACTION = 0.25

RenderOnce = Callable[[int], RenderedRadiance]


@dataclass(frozen=True)
class PoseBenchmark:
    """One pose of a scene, rendered repeatedly."""

    renderer: FrameRenderer
    pose: Pose
    metering: Metering
    folder: Path

    def wanted(self, scale: float) -> NoiseTarget:
        """Scale the scene's noise targets by `scale`, except that of the static layer."""
        return self.renderer.frame_target(self.metering, 1).scaled(scale)

    def frame(self, shoot: RenderOnce, seed: int) -> Floats:
        """Make one frame, end to end, and return its radiance."""
        renderer = self.renderer
        renderer.pushed_world(self.pose)
        rendered = shoot(seed)
        noise = random_generator(renderer.scene, "speed", seed)
        image = renderer.sensor(self.metering.exposure).expose(
            rendered.radiance, noise, rendered.variance
        )
        write_bytes(self.folder / "frame.png", png_bytes(image))
        layers = rendered.by_name()
        write_exr(self.folder / "frame.exr", {str(k): layers[k] for k in renderer.scene.layers})
        return rendered.radiance

    def measured(self, shoot: RenderOnce, reference: Reference, deadline: float) -> Record:
        """Measure the seconds of a frame, and its errors."""
        seconds, squared_errors = list[float](), list[tuple[float, float]]()
        while not seconds or (len(seconds) < _REPEATS and perf_counter() < deadline):
            start = perf_counter()
            radiance = self.frame(shoot, len(seconds))
            seconds.append(perf_counter() - start)
            squared_errors.append(reference.errors(radiance))
        image, line = np.sqrt(np.mean(squared_errors, axis=0)).tolist()
        return {
            "seconds": median(seconds),
            "rmse_over_peak": image,
            "centreline_rmse_px": line,
            "repeats": len(seconds),
        }

    def kernel_share(self, shoot: RenderOnce) -> float:
        """Measure the fraction of a frame's time in which compiled kernels run."""
        start = perf_counter()
        busy = seconds_in_kernels(lambda: self.frame(shoot, 0))
        return busy / (perf_counter() - start)


def measure(file: SceneFile, variant: str, seconds: float, out: Path) -> Record:
    """Measure curves of seconds per frame against error, for one pose of a scene.

    This takes about `seconds`. Writes render_speed.csv and render_speed.png to `out`. Raises
    InputError where plain Mitsuba cannot render the scene, and where `out` cannot be written.
    """
    _require_plain_mitsuba(file, variant)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror})") from error
    deadline = perf_counter() + seconds
    scene_plan = plan(file)
    folder, threads = file.folder.resolve(), cores()
    renderer = FrameRenderer(file.scene, scene_plan.rig, folder, variant, threads)
    spec = sorted(scene_plan.frame_specs, key=lambda spec: spec.index)[scene_plan.frames // 2]
    with tempfile.TemporaryDirectory() as temporary:
        metering = renderer.meter(metered_frames(scene_plan.frame_specs))
        stand = PoseBenchmark(renderer, renderer.pose(spec), metering, Path(temporary))
        record = _compare(stand, scene_plan.frames, deadline)
    record |= {"scene": file.path.stem, "threads": threads, "frame_id": spec.frame_id}
    write(record, out, ["ours", *SAMPLERS])
    return record


def _require_plain_mitsuba(file: SceneFile, variant: str) -> None:
    """Raise InputError where plain Mitsuba cannot render the scene."""
    scene = file.scene
    if variant == PLAIN:
        raise InputError(f"variant is {variant}, allowed are variants that compile kernels")
    unsupported = [
        key for key in ("point_spread_px", "aperture_mm") if getattr(scene.optics, key) > 0
    ]
    unsupported += ["distortion"] if any(scene.camera.distortion) else []
    unsupported += ["motor_speed_deg_s"] if scene.motor_speed_deg_s else []
    if unsupported:
        message = (
            f"has {', '.join(unsupported)}, allowed is a scene without: plain Mitsuba has none"
        )
        raise InputError(f"{file.path}: {message}")


def _compare(stand: PoseBenchmark, frames: int, deadline: float) -> Record:
    world, target = stand.renderer.pushed_world(stand.pose), stand.wanted(1)
    static_layer, layer_seconds = _timed_static_layer(world, target)
    for seed in range(_WARM_UP_FRAMES):
        stand.frame(_ours(world, static_layer, target), seed)
    rendered = render_frame(world, static_layer, target, 0)
    line = beam_line(stand.renderer.rig, stand.pose)
    budget = _REFERENCE_FRACTION * (deadline - perf_counter())
    reference = reference_of(world, rendered, line, budget)
    ours: list[Record] = []
    for scale in _SCALES:
        shoot = _ours(world, static_layer, stand.wanted(scale))
        point: Record = {"renderer": "ours", "noise_wanted": scale, "samples_per_pixel": None}
        ours.append(point | stand.measured(shoot, reference, math.inf))
        ours[-1]["seconds"] += layer_seconds / frames
    default = ours[_SCALES.index(1.0)]
    curves = {"ours": ours}
    for number, sampler in enumerate(SAMPLERS):
        budget = (deadline - perf_counter()) / (len(SAMPLERS) - number)
        curves[sampler] = _plain(stand, world, sampler, reference, perf_counter() + budget)
    at_target = {name: at_equal_error(curve) for name, curve in curves.items()}
    plain = min(at_target[name]["seconds"] for name in SAMPLERS)
    plain_at_scenes_noise = min(
        at_equal_error(curves[name], default["rmse_over_peak"])["seconds"] for name in SAMPLERS
    )
    busy = stand.kernel_share(_ours(world, static_layer, target))
    limit = _seconds_of_rays(world, rendered)
    few_samples = _shoot(world, SAMPLERS[0], _SAMPLES[1])
    return {
        "speedup_at_equal_rmse": plain / at_target["ours"]["seconds"],
        # Nearly always extrapolated: plain Mitsuba would need minutes.
        "speedup_at_scenes_noise": plain_at_scenes_noise / default["seconds"],
        "rmse_over_peak": default["rmse_over_peak"],
        "centreline_rmse_px": default["centreline_rmse_px"],
        "frames_per_s": 1 / default["seconds"],
        "rays_seconds": limit,
        "seconds_over_rays": default["seconds"] / limit,
        "target_rmse_over_peak": TARGET,
        "at_target": at_target,
        "plate_seconds": layer_seconds,
        "frames": frames,
        "kernel_share": {"ours": busy, SAMPLERS[0]: stand.kernel_share(few_samples)},
        "reference_noise_over_peak": reference.noise_over_peak,
        "curves": curves,
    }


def _seconds_of_rays(world: World, rendered: RenderedRadiance) -> float:
    """Measure the seconds of a frame's rays alone: each sample has one, and one to each light.

    All are timed as those of the camera; nothing is shaded.
    """
    rows, columns = np.nonzero(rendered.samples)
    pixels = np.column_stack([columns, rows])
    pixels = np.repeat(pixels, rendered.samples[rows, columns].astype(int), axis=0)
    once = min(seconds_of_rays(world, pixels, seed) for seed in range(_REPEATS))
    return (1 + len(world.lights)) * once


def _timed_static_layer(world: World, target: NoiseTarget) -> tuple[StaticLayer, float]:
    """Render and time the static layer."""
    render_static_layer(world, target, 0)  # compiles kernels
    start = perf_counter()
    return render_static_layer(world, target, 0), perf_counter() - start


def _ours(world: World, static_layer: StaticLayer, target: NoiseTarget) -> RenderOnce:
    return lambda seed: render_frame(world, static_layer, target, 1 + seed)


def _shoot(world: World, sampler: Sampler, samples: int) -> RenderOnce:
    plain = Plain(world, sampler)
    zeros = np.zeros((world.camera.height, world.camera.width))

    def shoot(seed: int) -> RenderedRadiance:
        radiance = plain.radiance(samples, seed)
        return RenderedRadiance(
            radiance, zeros, every_pixel(world), zeros, zeros + samples, zeros == 0
        )

    return shoot


def _plain(
    stand: PoseBenchmark, world: World, sampler: Sampler, reference: Reference, deadline: float
) -> list[Record]:
    """Measure plain Mitsuba; each point has four times the samples of the one before.

    Stops when the target error is reached or time is up.
    """
    points: list[Record] = []
    stand.frame(_shoot(world, sampler, _SAMPLES[0]), 0)  # compiles kernels
    for samples in _SAMPLES:
        lanes = samples * world.camera.width * world.camera.height
        no_time = len(points) > 2 and perf_counter() + 4 * points[-1]["seconds"] > deadline
        if (
            no_time
            or lanes > _MAX_SAMPLES_PER_FRAME
            or (points and points[-1]["rmse_over_peak"] < TARGET)
        ):
            break
        point: Record = {"renderer": sampler, "noise_wanted": None, "samples_per_pixel": samples}
        shoot = _shoot(world, sampler, samples)
        points.append(point | stand.measured(shoot, reference, deadline))
    return points
