"""Light that changes from image to image, and from row to row, in rendered images."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.draws import seeded
from vbaa_bench.assembly.motion import exposure_poses
from vbaa_bench.assembly.plan import plan
from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering
from vbaa_bench.render.frame import RenderedRadiance
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.scene.frames import FrameSpec, frame_specs
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.random_streams import random_generator

ROWS = 88
SCENE = seeded(f"""
title: A small image
seed: 4
camera: {{width_px: 256, height_px: {ROWS}, focal_length_px: 350,
  position_mm: [120.0, 22.0, 360.0], look_at_mm: [120.6, 22.0, 0.0]}}
calibration: {{columns: 20, rows: 5, square_mm: 10, center_mm: [120.0, 22.0], views: 4}}
pushes: {{contact_distance_mm: [150], deflection_pct: [10, 20]}}
render: {{noise_near_beam: 1, noise_elsewhere: 1, noise_static_layer: 0.5}}
""")
FLICKER = "flicker: {mains_hz: 50, depth_pct: 40}\n"


# Photons per radiance: the beam has about 7,000 electrons of a full well of 10,000.
EXPOSURE = 20_000.0


@dataclass
class Laboratory:
    """Makes renderers of one scene with various keys; samples are the same whatever the light."""

    folder: Path
    variant: str

    def renderer(self, keys: str) -> FrameRenderer:
        path = self.folder / "scene.yaml"
        path.write_text(SCENE + keys, encoding="utf-8")
        file = load_scene(path)
        return FrameRenderer(file.scene, plan(file).rig, self.folder, self.variant, threads=1)


@pytest.fixture
def laboratory(tmp_path: Path, variant: str) -> Laboratory:
    if variant == PLAIN:
        pytest.skip("whole images take too long")
    return Laboratory(tmp_path, variant)


def spec_of(renderer: FrameRenderer, index: int) -> FrameSpec:
    return next(spec for spec in frame_specs(renderer.scene) if spec.index == index)


def rendered(renderer: FrameRenderer, index: int) -> RenderedRadiance:
    return renderer.expose_frame(spec_of(renderer, index), Metering(EXPOSURE))[1]


def power(renderer: FrameRenderer, stream: str, number: int) -> Floats:
    """Mean power (rows) of the light of an image: a cosine of 100 Hz, over the exposure."""
    sensor = renderer.scene.sensor
    phase = random_generator(renderer.scene, stream, number).uniform(0, 2 * np.pi)
    times = sensor.line_time_us * 1e-6 * (np.arange(ROWS) - (ROWS - 1) / 2)
    shrunk = 0.4 * np.sinc(100 * sensor.exposure_s)
    return np.asarray(1 + shrunk * np.cos(2 * np.pi * 100 * times + phase))


@pytest.mark.thorough
def test_flicker_scales_the_rows_of_each_frame(laboratory: Laboratory) -> None:
    sensor = "sensor: {exposure_s: 0.002, line_time_us: 100}\n"
    steady, renderer = laboratory.renderer(sensor), laboratory.renderer(sensor + FLICKER)
    powers = [power(renderer, "sensor flicker", index) for index in (0, 1)]
    assert np.abs(powers[0] - powers[1]).max() > 0.0005
    # A readout of 8.7 ms shows most of a period of 10 ms.
    assert np.ptp(powers[0]) > 0.5
    for index, gain in enumerate(powers):
        one, other = rendered(renderer, index), rendered(steady, index)
        assert one.radiance == pytest.approx(gain[:, None] * other.radiance, rel=1e-9)
        assert one.variance == pytest.approx(gain[:, None] ** 2 * other.variance, rel=1e-9)
        assert one.coverage == pytest.approx(other.coverage, abs=1e-12)


@pytest.mark.thorough
def test_rest_and_board_images_flicker_too(laboratory: Laboratory) -> None:
    steady, flickering = (
        laboratory.renderer("sensor: {exposure_s: 0.001}\n" + keys) for keys in ("", FLICKER)
    )
    for stream in ("rest", "board"):
        gains = [power(flickering, f"{stream} sensor flicker", number)[0] for number in range(8)]
        number = int(np.argmax(np.abs(np.subtract(gains, 1))))  # one that shows it clearly
        before, after = (
            getattr(each, f"{stream}_image")(number, EXPOSURE).astype(float)
            for each in (steady, flickering)
        )
        gain = gains[number]
        assert abs(gain - 1) > 0.05
        clear = (before > 5) & (before < 255 / 1.5)
        assert after[clear].mean() == pytest.approx(gain * before[clear].mean(), rel=0.01)


@pytest.mark.thorough
def test_a_level_scales_frames_but_not_the_beam_at_rest(laboratory: Laboratory) -> None:
    plain, darker = (laboratory.renderer(keys) for keys in ("", "light_level: 0.25\n"))
    bright, dark = rendered(plain, 0).radiance, rendered(darker, 0).radiance
    # Samples differ: the noise target is that of less light.
    assert dark.mean() == pytest.approx(0.25 * bright.mean(), rel=2e-3)
    assert np.corrcoef(dark.ravel(), bright.ravel())[0, 1] > 0.995
    one, other = (each.rest_image(0, EXPOSURE) for each in (plain, darker))
    assert (one == other).all()


@pytest.mark.thorough
def test_a_rolling_shutter_shows_the_beam_where_it_is_when_its_row_is_exposed(
    laboratory: Laboratory,
) -> None:
    renderer = laboratory.renderer(
        "motor_speed_deg_s: 60\nsensor: {exposure_s: 0.0005, line_time_us: 200}\n"
    )
    coverage = rendered(renderer, 1).coverage
    pose = renderer.pose(spec_of(renderer, 1))
    poses = exposure_poses(pose, renderer.scene, renderer.rig)
    turns = np.array([each.state.pushing_angle - pose.state.pushing_angle for each in poses])
    times, rows = turns / np.radians(60), np.arange(ROWS)
    columns = np.arange(190, 225)
    # Row (poses, columns) of the centreline, and the time at which that row is exposed.
    lines = [
        renderer.rig.camera.project(renderer.assembler.centreline(each)[:, 1:]) for each in poses
    ]
    v = np.array([np.interp(columns, line[:, 0], line[:, 1]) for line in lines])
    early = times[:, None] - 200e-6 * (v - (ROWS - 1) / 2)
    expected = np.array([np.interp(0, early[:, i], v[:, i]) for i in range(columns.size)])
    centres = rows @ coverage[:, columns] / coverage[:, columns].sum(axis=0)
    assert np.mean(centres - expected) == pytest.approx(0, abs=0.03)
    assert np.abs(centres - expected).max() < 0.3
    # A global shutter would show it elsewhere.
    assert np.abs(v[len(poses) // 2] - expected).min() > 0.5
