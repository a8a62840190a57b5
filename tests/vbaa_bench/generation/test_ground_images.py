"""Images of the ground without the beam: of the dataset, and what the antenna makes of them."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from solver.antenna import Antenna
from solver.instrument.hashes import read_hashes
from solver.instrument.images import read_grey
from solver.instrument.observation import Observations, open_observations
from solver.lab.check import calibration_report
from solver.lab.findings import findings
from solver.set_up import set_up
from tests.conftest import SCENE_TEXT
from tests.draws import seeded
from vbaa_bench.generation.generate import generate
from vbaa_bench.generation.inventory import image_names
from vbaa_bench.scene.load import load_scene
from vbaa_bench.workers import machine
from vbaa_bench.workers.jobs import SameProcess

FELT = """
background: {pattern: textured, contrast: 0.4, reflectance: 0.2}
render: {noise_near_beam: 1, noise_elsewhere: 1, noise_static_layer: 0.5}
"""
N_GROUND = 2


def ignore(_done: int, _total: int) -> None:
    pass


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory, variant: str) -> Path:
    folder = tmp_path_factory.mktemp("felt")
    text = SCENE_TEXT.replace("rest_images: 2", f"rest_images: 2, ground_images: {N_GROUND}")
    text = text.replace("[100, 200]", "[140]").replace("[10, 20]", "[10]") + FELT
    (folder / "felt.yaml").write_text(seeded(text), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machine, "Pool", SameProcess)
        generate(load_scene(folder / "felt.yaml"), folder / "data", variant, 0, ignore)
    return folder / "data"


@pytest.fixture(scope="module")
def opened(root: Path) -> Observations:
    return open_observations(root / "observations")


@pytest.fixture(scope="module")
def antenna(opened: Observations) -> Antenna:
    return set_up(opened)


def test_a_dataset_has_images_of_the_ground_only_if_its_scene_asks_for_them(
    root: Path, opened: Observations, dataset: Path
) -> None:
    names = [f"ground/ground_{number:02d}.png" for number in range(N_GROUND)]
    assert [path.relative_to(opened.root).as_posix() for path in opened.ground_images] == names
    assert set(names) <= set(read_hashes(opened.root) or ())
    assert not (dataset / "observations" / "ground").exists()
    manifests = [json.loads((one / "truth/manifest.json").read_text()) for one in (root, dataset)]
    assert manifests[0]["scene"]["sensor"]["ground_images"] == N_GROUND
    # Files of a scene without them are those of earlier versions.
    assert "ground_images" not in manifests[1]["scene"]["sensor"]


def test_their_names_follow_those_of_the_other_images(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE_TEXT.replace("rest_images: 2", "rest_images: 1, ground_images: 1"))
    assert image_names(load_scene(path).scene)[-2:] == ("rest/rest_00.png", "ground/ground_00.png")


def test_they_show_the_rest_images_without_the_beam(opened: Observations) -> None:
    ground, other = (read_grey(path).astype(float) for path in opened.ground_images)
    rest = np.mean([image.astype(float) for image in opened.read_rest_images()], axis=0)
    assert np.mean(ground != other) > 0
    noise = np.std(ground - other) / np.sqrt(2)
    beam = rest - ground > 10 * noise
    assert np.count_nonzero(beam) > 200
    # The beam and its hub are within a few rows.
    near = np.convolve(beam.any(axis=1), np.ones(21), "same") > 0
    assert np.count_nonzero(near) < len(rest) / 2
    difference = (ground - rest)[~near]
    assert abs(difference.mean()) < 0.1 * noise + 0.02 * ground.mean()
    assert np.std(difference) < 1.5 * noise


def test_check_states_their_use(antenna: Antenna, opened: Observations) -> None:
    report = calibration_report(antenna, opened.frames)
    assert report.ground_images == N_GROUND
    assert report.ground_gain == pytest.approx(1.0, abs=0.03)
    assert report.ground_shift_px == pytest.approx((0.0, 0.0), abs=0.05)
    assert f"{N_GROUND} images without the beam, used: since then the light is" in report.text()
    assert not [finding for finding in report.findings if finding.name.startswith("ground")]


@pytest.mark.thorough
def test_check_names_images_of_another_ground(opened: Observations, tmp_path: Path) -> None:
    """As where the camera was moved between them and the rest images."""
    turned = []
    for path in opened.ground_images:
        other = np.ascontiguousarray(read_grey(path)[::-1, ::-1])
        turned.append(tmp_path / path.name)
        _write(turned[-1], other)
    moved = set_up(replace(opened, ground_images=tuple(turned)))
    (finding,) = (one for one in findings(moved) if one.name.startswith("ground"))
    assert finding.name == "ground_inconsistent"
    assert "do not show the ground of the rest images" in finding.message
    report = calibration_report(moved)
    assert f"{N_GROUND} images without the beam, not used" in report.text()
    without = set_up(replace(opened, ground_images=()))
    np.testing.assert_array_equal(moved.rest.covariance, without.rest.covariance)


def test_check_names_frames_that_do_not_show_the_ground(
    antenna: Antenna, opened: Observations, tmp_path: Path
) -> None:
    frame = opened.frames[0]
    image = frame.image()
    path = tmp_path / "frame.png"
    _write(path, np.roll(image, (40, 60), axis=(0, 1)))
    (finding,) = (
        one
        for one in findings(antenna, [replace(frame, path=path)])
        if one.name.startswith("ground")
    )
    assert finding.name == "ground_not_in_frames"
    assert "1 of 1 images of pushes do not show" in finding.message


def test_the_line_at_rest_is_more_certain(antenna: Antenna, opened: Observations) -> None:
    without = set_up(replace(opened, ground_images=()))
    sigmas = [np.sqrt(np.diag(one.rest.line_covariance)) for one in (antenna, without)]
    assert (sigmas[0] < 0.7 * sigmas[1]).all()
    true = opened.rig.base_position[1]
    assert abs(antenna.rest.y_at_clamp - true) < 5 * np.hypot(sigmas[0][0], 5e-6)


def _write(path: Path, image: np.ndarray) -> None:
    assert cv2.imwrite(str(path), image)
