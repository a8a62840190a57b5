"""Information from re-rendered images: the closed form, independence of step and render noise."""

from typing import NamedTuple

import numpy as np
import pytest

from results.limits.displacement import displacements
from results.limits.rendered import (
    LARGEST_NOISE,
    ImageChange,
    image_change,
    precise_change,
)
from results.limits.rendered_profile import is_removed, rendered_profiles
from solver.instrument.arrays import Floats
from tests.draws import generator, scene_seed, seeded
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.limits.image_shape import PlacesInformation, image_information, image_shape
from vbaa_bench.limits.imaged_beam import ImagedBeam
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.profile import SHIFT, PixelNoise, information
from vbaa_bench.limits.tip import BeamEnd, tip_information
from vbaa_bench.render.variant import is_scalar
from vbaa_bench.scene.frames import FrameSpec, frame_specs
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_rig
from vbaa_bench.sensor.ideal import Ideal
from vbaa_bench.sensor.sensor import Sensor

# A matt beam, 1.6 px wide, and an object below the image.
SCENE = seeded("""
title: A pushed beam in a small image
seed: 8
beam: {length_mm: 240, diameter_mm: 2, paint: matt}
camera:
  width_px: 200
  height_px: 72
  focal_length_px: 280
  position_mm: [120.0, 18.0, 360.0]
  look_at_mm: [120.6, 20.0, 0.0]
  roll_deg: 2
calibration: {columns: 15, rows: 4, square_mm: 12, center_mm: [120.0, 20.0]}
occlusion: {kind: [removed], place: [middle], availability: [1.0, 0.5]}
pushes: {contact_distance_mm: [180], deflection_pct: [8]}
""")
NAMES = ("s_c", "normal_force", "direction", "cy", "length")
PLANAR = ("s_c", "normal_force", "brightness", "background", "width")
EXPOSURE = 20_000.0


class Small(NamedTuple):
    renderer: FrameRenderer
    specs: list[FrameSpec]

    def pose(self) -> Pose:
        return self.renderer.pose(self.specs[0])


@pytest.fixture(scope="module")
def small(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Small:
    path = tmp_path_factory.mktemp("limits") / "small.yaml"
    path.write_text(SCENE, encoding="utf-8")
    scene = load_scene(path).scene
    renderer = FrameRenderer(scene, true_rig(scene), path.parent, variant, 2)
    if is_scalar():
        pytest.skip("a scalar variant renders whole images only")
    # The whole beam first, then the one without a stretch.
    return Small(renderer, sorted(frame_specs(scene), key=_has_gap))


def _has_gap(spec: FrameSpec) -> bool:
    return spec.cover is not None and spec.cover.availability < 1


@pytest.fixture(scope="module")
def change(small: Small) -> ImageChange:
    return image_change(small.renderer, small.specs[0], EXPOSURE, NAMES)


def sigmas(data: Information, names: tuple[str, ...]) -> Floats:
    """Limits of parameters that are all unknown, while the others are known."""
    own = data.without(set(data.names) - set(names))
    return own.sigmas(np.eye(len(own.names)))


def test_the_closed_form_agrees(small: Small, change: ImageChange) -> None:
    renderer, pose = small.renderer, small.pose()
    imaged = ImagedBeam.of(pose, renderer.pushed_world(pose).camera)
    shape = image_shape(imaged, imaged.neighbours(NAMES))
    profiles = rendered_profiles(renderer, pose, shape)
    variance = PixelNoise.of(renderer.scene.sensor, renderer.sensor(EXPOSURE)).variance
    of_places = np.array([information(surface, variance) for surface in profiles.surfaces])
    of_tip = tip_information(profiles.surfaces[-1], BeamEnd.of(imaged), variance)
    visible = profiles.visible[:, None, None] * of_places
    closed = image_information(shape, PlacesInformation(visible, of_tip))
    for names in (("s_c",), ("cy",), ("s_c", "normal_force"), (*NAMES[:3], "width")):
        ratio = sigmas(change.information, names) / sigmas(closed, names)
        np.testing.assert_allclose(ratio, 1.0, atol=0.05)
    # The closed form counts the background up to another distance from the beam.
    ratio = sigmas(change.information, PLANAR) / sigmas(closed, PLANAR)
    np.testing.assert_allclose(ratio[:3], 1.0, atol=0.05)
    assert (of_places[:, SHIFT, SHIFT] > 0).all()


def test_render_noise_does_not_raise_the_information(small: Small, change: ImageChange) -> None:
    # With four samples a set's own square is far too large, the product of two sets is not.
    few = [
        image_change(
            small.renderer, small.specs[0], EXPOSURE, ("cy",), samples=4, seed=scene_seed(seed)
        )
        for seed in range(24)
    ]
    expected = change.information.matrix[NAMES.index("cy"), NAMES.index("cy")]
    square = np.mean([one.information_with_noise.matrix[0, 0] for one in few])
    product = [one.information.matrix[0, 0] for one in few]
    excess = square / expected - 1
    assert excess > 0.01
    assert abs(np.mean(product) / expected - 1) < 0.5 * excess


@pytest.mark.false_alarm(0.0, "samples are added until the noise is below its limit")
def test_samples_are_added_until_render_noise_is_small(small: Small) -> None:
    names = ("s_c", "normal_force")
    few = image_change(small.renderer, small.specs[0], EXPOSURE, names, samples=4)
    enough = precise_change(small.renderer, small.specs[0], EXPOSURE, names)
    assert few.render_noise(few.names) > LARGEST_NOISE
    assert enough.render_noise(enough.names) < LARGEST_NOISE
    assert few.render_noise(("brightness",)) < few.render_noise(few.names)


def test_brightness_changes_the_beams_part_of_a_pixel(change: ImageChange) -> None:
    beam, background = change.slopes.mean(axis=0)[len(NAMES) :][:2]
    np.testing.assert_allclose(beam + background, change.mean, rtol=1e-3)
    # Beside the beam nothing is the beam's; the beam is ten times as bright as the background.
    beside = beam == 0
    assert 0.2 < beside.mean() < 0.8
    assert np.median(change.mean[beside]) < 0.15 * change.mean.max()


def test_a_shift_of_the_image_moves_the_beam_at_its_depth(small: Small) -> None:
    pose = small.pose()
    imaged = ImagedBeam.of(pose, small.renderer.pushed_world(pose).camera)
    moved = displacements(imaged, imaged.neighbours(("cy", "fx")))
    assert moved.largest_px[0] == pytest.approx(1.0, rel=1e-6)
    axis = imaged.camera.camera_from_antenna[2, :3]
    np.testing.assert_allclose(moved.metres @ axis, 0.0, atol=1e-9)


def test_the_world_is_as_before(small: Small) -> None:
    world = small.renderer.pushed_world(small.pose())
    before = world.vertices["beam"].copy()
    image_change(small.renderer, small.specs[0], EXPOSURE, ("cy",), samples=2)
    np.testing.assert_array_equal(world.vertices["beam"], before)


def test_a_removed_stretch_has_no_pixels(small: Small, change: ImageChange) -> None:
    spec = small.specs[1]
    pose = small.renderer.pose(spec)
    other = image_change(small.renderer, spec, EXPOSURE, ("cy",), samples=4)
    camera = small.renderer.pushed_world(pose).camera
    assert not is_removed(pose, camera, other.pixels.astype(float)).any()
    assert 0.4 < len(other.pixels) / len(change.pixels) < 0.6


def test_saturated_pixels_have_no_information() -> None:
    sensors = (Sensor(100.0, 10_000, 10, dark_signal=50.0), Ideal(0.01, 8))
    for sensor in sensors:
        largest = sensor.largest_radiance
        variance = PixelNoise(sensor).variance(largest * np.array([0.5, 0.99, 1.01]))
        assert np.isinf(variance).tolist() == [False, False, True]
        full = sensor.expose(np.full((1, 1), 2 * largest), generator(__name__, 1))
        assert sensor.radiance(full).item() == pytest.approx(largest, rel=1e-6)


def test_an_unknown_fixed_pattern_is_noise(random: np.random.Generator) -> None:
    sensor = Sensor(100.0, 1e6, 10, bits=16)
    noise, level = PixelNoise(sensor, response=0.02, offset=30.0), np.full((300, 300), 40.0)
    electrons = 100 * level * (1 + 0.02 * random.standard_normal(level.shape))
    electrons += 30 * random.standard_normal(level.shape)
    images = sensor.radiance(sensor.expose(electrons / 100, random))
    assert images.var() == pytest.approx(noise.variance(level)[0, 0], rel=0.03)
