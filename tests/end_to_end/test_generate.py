"""The dataset: same seed, same bytes; whole or resumable; and it calibrates to its true camera."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from solver.antenna import Antenna
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.observation import open_observations
from solver.methods import METHODS
from solver.planes.plane_c import on_plane
from solver.set_up import set_up
from solver.tracker import PushTracker
from tests.conftest import ALL_LAYERS, SMALL_SCENE
from tests.consistency import MOST_SIGMAS
from tests.draws import scene_seed
from tests.mortal import Mortal
from vbaa_bench.dataset.exr import read_exr
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.dataset.target import FAST
from vbaa_bench.generation.generate import generate
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.scene.load import load_scene
from vbaa_bench.workers import machine
from vbaa_bench.workers.jobs import SameProcess, WorkerDiedError
from vbaa_bench.workers.pool import Pool


def digests(root: Path) -> dict[str, str]:
    return {
        str(path.relative_to(root)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(root.rglob("*"))
        if path.is_file()
    }


def quiet(_done: int, _total: int) -> None:
    pass


@pytest.mark.thorough
def test_two_workers_finish_an_interrupted_dataset_to_the_same_bytes(
    dataset: Path, small_scene: Path, variant: str, tmp_path: Path
) -> None:
    root = tmp_path / "half"
    shutil.copytree(dataset, root)
    layout = Layout(root)
    layout.hashes.unlink()
    layout.manifest.unlink()
    shutil.rmtree(layout.shard(layout.observations, 1))  # its truth is there, its images are not
    for image in ("calibration/view_01.png", "calibration/view_04.png", "rest/rest_01.png"):
        (layout.observations / image).unlink()
    (root / ".shard_00001.part").mkdir()
    kept = layout.shard(layout.observations, 0) / "metadata.csv"
    written = kept.stat().st_mtime_ns
    with pytest.raises(InputError, match="incomplete"):
        open_observations(layout.observations)
    with pytest.raises(InputError, match="incomplete"):
        open_truth(layout.truth)
    # This process rendered everything in order. These jobs begin elsewhere, in two processes.
    generate(load_scene(small_scene), root, variant, 2, quiet)
    assert digests(root) == digests(dataset)
    assert kept.stat().st_mtime_ns == written


def test_a_dead_worker_is_an_error_and_no_hang() -> None:
    pool = Pool(1, Mortal, ())
    with pytest.raises(WorkerDiedError, match="repeat the command to resume"), pool:
        pool.call("die")
    with Pool(1, Mortal, ()) as pool:
        pieces: list[int] = []
        pool.run([("live", (i,)) for i in range(3)], pieces.append)
        assert pieces[-1] == 3


def test_a_dataset_is_finished_with_what_it_was_begun(
    dataset: Path, small_scene: Path, variant: str, tmp_path: Path
) -> None:
    root = tmp_path / "half"
    shutil.copytree(dataset, root)
    (root / "observations" / "hashes.json").unlink()
    other = PLAIN if variant != PLAIN else FAST
    with pytest.raises(InputError, match=f"begun with .*{variant}"):
        generate(load_scene(small_scene), root, other, 1, quiet)


def test_a_complete_dataset_is_left_alone_and_another_scene_refused(
    dataset: Path, small_scene: Path, variant: str
) -> None:
    before = digests(dataset)
    generate(load_scene(small_scene), dataset, variant, 1, quiet)
    with pytest.raises(InputError, match="another scene, seed or mesh"):
        generate(load_scene(small_scene, seed=12), dataset, variant, 1, quiet)
    with pytest.raises(InputError, match="holds other files"):
        generate(load_scene(small_scene), small_scene.parent, variant, 1, quiet)
    with pytest.raises(InputError, match="cannot be written"):
        generate(load_scene(small_scene), small_scene / "below_a_file", variant, 1, quiet)
    assert digests(dataset) == before


def test_the_truth_is_complete(dataset: Path) -> None:
    layout = Layout(dataset)
    truth = open_truth(layout.truth)
    assert truth.frames.height == 4
    assert truth.frames["residual"].max() < 1e-8  # type: ignore[operator]
    assert not truth.frames["above_yield"].any()
    names = {frame.frame_id for frame in open_observations(layout.observations)}
    assert names == set(truth.frames["frame_id"])
    assert truth.manifest["seed"] == scene_seed(11)
    assert set(truth.manifest["versions"]) >= {"mitsuba", "numpy", "drjit"}
    # Nothing covers the beam but the hub, its first hundredth or two.
    assert truth.frames["availability_seen"].min() >= 0.98  # type: ignore[operator]
    assert truth.frames["visible_share"].min() >= 0.98  # type: ignore[operator]
    for row in truth.frames.iter_rows(named=True):
        images = list(layout.truth.glob(f"shard_*/{row['frame_id']}.exr"))
        found = read_exr(images[0])
        assert found["radiance"].shape == (176, 512)
        # Frictionless: the force is normal to the beam; its size is that of the vector.
        assert np.linalg.norm(row["force_antenna_n"]) == pytest.approx(row["force_n"])
        # In the world the object has not moved: the contact stays within a beam's radius and
        # what the beam slides over it.
        onset = np.radians(row["true_motor_angle_deg"] + row["pushing_angle_deg"])
        rest = row["contact_distance_at_rest_mm"] * np.array([np.cos(onset), np.sin(onset)])
        assert np.hypot(*(row["contact_world_mm"][:2] - rest)) < 0.4 * (
            1 + 1e-6
        ) + 0.4 * np.radians(20)
        # The encoder's readings err, so that equal pushes do not show themselves by them.
        reading = next(
            f for f in open_observations(layout.observations) if f.frame_id == row["frame_id"]
        ).readings.motor_angle
        assert reading is not None
        assert np.degrees(reading) != row["true_motor_angle_deg"]
        assert abs(np.degrees(reading) - row["true_motor_angle_deg"]) < 0.05


def test_calibration_returns_the_true_camera(dataset: Path, antenna: Antenna) -> None:
    true = open_truth(Layout(dataset).truth).camera
    found = antenna.calibration
    assert found.camera.fx == pytest.approx(true.fx, rel=1e-3)
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 0.24, 9), np.linspace(0, 0.05, 3)))
    points = np.column_stack([x, y, np.zeros_like(x)])
    back, _ = on_plane(found.camera, true.project(points), np.ones((len(x), 2)))
    assert np.abs(back - points[:, :2]).max() < 2.5e-5
    # The calibration itself is not known better than this.
    assert abs(antenna.rest.slope) < 4 * np.sqrt(antenna.rest.covariance[1, 1]) + 3e-5
    assert abs(antenna.rest.y_at_clamp) < 4 * np.sqrt(antenna.rest.covariance[0, 0]) + 1e-5


def test_the_extracted_points_lie_on_the_true_centreline(dataset: Path, antenna: Antenna) -> None:
    layout = Layout(dataset)
    observations, truth = open_observations(layout.observations), open_truth(layout.truth)
    for frame in observations:
        row = truth.frames.row(by_predicate=pl.col("frame_id") == frame.frame_id, named=True)
        x, y = np.array(row["centreline_x_mm"]) / 1e3, np.array(row["centreline_y_mm"]) / 1e3
        line: Floats = truth.camera.project(np.column_stack([x, y, np.zeros_like(x)]))
        found = antenna.extract(frame.image())
        error = found.points[:, 1] - np.interp(found.points[:, 0], line[:, 0], line[:, 1])
        assert np.sqrt(np.mean(error**2)) < 0.02  # px
        assert np.abs(error).max() < 0.1
        assert len(error) > 300


# By how much of L a method may err: linear theory is biased at 20 % deflection.
WORST = {"two_point": 0.1, "linear_fit": 0.06, "exact_fit": 0.003, "exact_fit_3d": 0.005}


@pytest.mark.parametrize("method", WORST)
def test_estimates_agree_with_the_truth(dataset: Path, antenna: Antenna, method: str) -> None:
    layout = Layout(dataset)
    observations, truth = open_observations(layout.observations), open_truth(layout.truth)
    for frame in observations:
        row = truth.frames.row(by_predicate=pl.col("frame_id") == frame.frame_id, named=True)
        tracker = PushTracker(antenna, METHODS[method])
        estimate = tracker.solve(frame.image(), frame.readings).estimate
        assert estimate.outcome.has_values, estimate
        error = estimate.values["x_c_m"] - row["x_c_mm"] / 1e3
        assert abs(error) < WORST[method] * 0.24
        if method.startswith("exact_fit"):
            assert abs(error) < MOST_SIGMAS * estimate.sigma("x_c_m")
            assert estimate.values["force_n"] == pytest.approx(row["force_n"], rel=0.02)


@pytest.mark.thorough
def test_a_rig_off_its_nominal_is_made_and_stays_unknown_to_the_solver(
    variant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "Pool", SameProcess)
    path = tmp_path / "drawn.yaml"
    text = SMALL_SCENE.replace("[100, 200]", "[150]").replace("[10, 20]", "[20]")
    text = text.replace("views: 6", "views: 4")
    text = text.replace(ALL_LAYERS, "layers: []\n")
    text += "tolerances: {true_rig: drawn, base_mm: 0.2, flexural_rigidity_pct: 3}\n"
    text += "render: {noise_near_beam: 1, noise_elsewhere: 1, noise_static_layer: 0.3}\n"
    path.write_text(text, encoding="utf-8")
    layout = generate(load_scene(path), tmp_path / "drawn", variant, 0, quiet)
    truth = open_truth(layout.truth)
    observations = open_observations(layout.observations)
    rig = json.loads((layout.observations / "rig.json").read_text())
    assert rig["base"] == {"position_mm": [0, 0, 0], "position_sigma_mm": 0.2}
    true_base = np.array(truth.manifest["true_rig"]["base_position_mm"])
    assert 0.005 < np.linalg.norm(true_base) < 1.2
    assert not list(layout.truth.rglob("*.exr"))  # layers can be left out
    reading = observations.frames[0].readings.motor_angle
    assert reading is not None
    encoder = reading - np.radians(truth.frames["true_motor_angle_deg"][0])
    assert encoder != 0
    assert abs(encoder) < np.radians(0.05)
    tracker = PushTracker(set_up(observations), METHODS["exact_fit"])
    answer = tracker.solve(observations.frames[0].image()).estimate
    row = truth.frames.row(0, named=True)
    assert abs(answer.values["x_c_m"] - row["x_c_mm"] / 1e3) < MOST_SIGMAS * answer.sigma("x_c_m")
    assert abs(answer.values["force_n"] - row["force_n"]) < MOST_SIGMAS * answer.sigma("force_n")
    assert answer.sigma("force_n") > 0.03 * answer.values["force_n"]
