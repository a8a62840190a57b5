"""Worlds beyond the paper's rig, seen through their rendered frames."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from results.pictures.contact_sheet import contact_sheet
from solver.instrument.arrays import Floats
from solver.instrument.image_frame import Readings
from solver.instrument.images import image_head, read_grey
from solver.instrument.observation import open_observations
from solver.methods import METHODS
from solver.set_up import set_up
from solver.tracker import PushTracker
from tests.conftest import SCENE_TEXT
from tests.draws import seeded
from vbaa_bench.dataset.exr import read_exr
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth, open_truth
from vbaa_bench.generation.generate import generate
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.overlay import overlay
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.workers import machine
from vbaa_bench.workers.jobs import SameProcess


def quiet(_done: int, _total: int) -> None:
    pass


# These tests compare positions: the render may be as noisy as the sensor.
COARSE = "render: {noise_near_beam: 1, noise_elsewhere: 1, noise_static_layer: 0.5}\n"
# Where no image is measured, noise does not matter.
NOISY = COARSE.replace("1,", "4,").replace("0.5", "4")


def made(tmp_path: Path, variant: str, *changes: tuple[str, str], render: str = COARSE) -> Layout:
    """Generate a changed scene in this process: four views of the board, coarse renders."""
    text = SCENE_TEXT.replace("views: 6", "views: 4") + render
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "scene.yaml"
    path.write_text(seeded(text), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machine, "Pool", SameProcess)
        return generate(load_scene(path), tmp_path / "data", variant, 0, quiet)


def layer(layout: Layout, name: str, frame_id: str) -> np.ndarray:
    found = next(layout.truth.glob(f"shard_*/{frame_id}.exr"))
    return np.asarray(read_exr(found)[name])


def beam_pixels(layout: Layout, frame_id: str) -> Floats:
    """Pixels (n, 2), as (u, v), in which the beam is seen."""
    return np.argwhere(layer(layout, "beam_mask", frame_id) > 0)[:, ::-1].astype(float)


def farthest(pixels: Floats, line: Floats) -> float:
    """Largest distance [px] of any pixel from a line of points."""
    return float(np.linalg.norm(pixels[:, None] - line[None], axis=2).min(axis=1).max())


@pytest.fixture(scope="module")
def hidden(variant: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Layout, Truth]:
    layout = made(
        tmp_path_factory.mktemp("hidden"),
        variant,
        ("[100, 200]", "[150]"),
        ("[10, 20]", "[10]"),
        (
            "seed: 11",
            "seed: 11\nocclusion: {kind: [removed, sheet], place: [middle], availability: [0.6]}",
        ),
    )
    return layout, open_truth(layout.truth)


@pytest.mark.thorough
def test_a_sheet_hides_the_stretch_that_the_truth_says(hidden: tuple[Layout, Truth]) -> None:
    layout, truth = hidden
    for row in truth.frames.iter_rows(named=True):
        s, x = (np.array(row[f"centreline_{axis}_mm"]) for axis in "sx")
        arc = layer(layout, "arc_length", row["frame_id"])
        seen = np.interp(arc[arc > 0], s, x)
        inside = (seen > row["hidden_from_mm"] + 1.5) & (seen < row["hidden_to_mm"] - 1.5)
        outside = (seen < row["hidden_from_mm"] - 1.5) | (seen > row["hidden_to_mm"] + 1.5)
        assert outside.sum() > 300
        assert inside.any() == (row["hidden_by"] == "removed")


def test_removed_data_are_left_out_by_the_solver(hidden: tuple[Layout, Truth]) -> None:
    layout, truth = hidden
    observations = open_observations(layout.observations)
    antenna = set_up(observations)
    removed = [frame for frame in observations if frame.readings.removed is not None]
    row = truth.frames.row(by_predicate=pl.col("hidden_by") == "removed", named=True)
    assert [frame.frame_id for frame in removed] == [row["frame_id"]]
    frame = removed[0]
    assert frame.readings.removed == pytest.approx(
        (row["hidden_from_mm"] / 1e3, row["hidden_to_mm"] / 1e3)
    )
    one, other = (
        PushTracker(antenna, METHODS["exact_fit"])
        .solve(frame.image(), Readings(removed=stretch))
        .estimate
        for stretch in (None, frame.readings.removed)
    )
    assert other.values["x_c_m"] == pytest.approx(row["x_c_mm"] / 1e3, abs=0.003 * 0.24)
    assert other.dof is not None
    assert one.dof is not None
    # Three fifths of the points are left; the fit rejects up to a tenth of them, from seed to seed.
    assert 0.5 < other.dof / one.dof < 0.75


@pytest.mark.thorough
def test_a_camera_in_the_world_sees_the_antenna_turn(variant: str, tmp_path: Path) -> None:
    layout = made(
        tmp_path,
        variant,
        ("width_px: 512", "width_px: 512\n  mount: world"),
        ("[100, 200]", "[150]"),
        (
            "deflection_pct: [10, 20]",
            "pushing_angle_deg: [-3, 5]\n  motor_angle_at_contact_deg: [2, 4]",
        ),
        ("seed: 11", "seed: 11\nbackground: {fixed_to: world, pattern: squares}"),
    )
    truth, observations = open_truth(layout.truth), open_observations(layout.observations)
    antenna = set_up(observations)
    assert antenna.rig.camera_mount == "world"
    for row in truth.frames.iter_rows(named=True):
        x, y = (np.array(row[f"centreline_{axis}_mm"]) / 1e3 for axis in "xy")
        turn = np.radians(row["true_motor_angle_deg"])
        line = np.column_stack(
            [np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, 0 * x]
        )
        assert farthest(beam_pixels(layout, row["frame_id"]), truth.camera.project(line)) < 1.1
        frame = next(f for f in observations if f.frame_id == row["frame_id"])
        assert frame.readings.motor_angle is None
    # The object has not moved in the image but for what is seen of it behind the beam.
    index = [layer(layout, "object_index", name) for name in truth.frames["frame_id"]]
    places = [np.argwhere(found == 2).mean(axis=0) for found in index]
    assert np.linalg.norm(places[0] - places[1]) < 0.5


@pytest.mark.thorough
def test_a_beam_above_plane_c_is_seen_where_it_is(variant: str, tmp_path: Path) -> None:
    layout = made(
        tmp_path,
        variant,
        ("[100, 200]", "[150]"),
        ("[10, 20]", "[8]\n  normal_deg: [40]\n  motor_angle_at_contact_deg: [70, 70]"),
        (
            "seed: 11",
            "seed: 11\nobject: {kind: knife_edge}\nmoment_sensor: {}\ngravity_m_s2: [0, 0, -9.81]\n"
            "tolerances: {true_rig: drawn, base_mm: 0.3}",
        ),
        render=NOISY,
    )
    truth = open_truth(layout.truth)
    row = truth.frames.row(0, named=True)
    base = np.array(truth.manifest["true_rig"]["base_position_mm"])
    line = np.column_stack([row[f"centreline_{axis}_mm"] for axis in "xyz"]) + base
    pixels = beam_pixels(layout, row["frame_id"])
    assert farthest(pixels, truth.camera.project(line / 1e3)) < 1.1
    flat = line * [1, 1, 0]
    assert farthest(pixels, truth.camera.project(flat / 1e3)) > 1.5
    assert row["model"] == "exact, in space"
    # The edge stands still in the world: the contact lies on it, within the beam's thickness.
    assert row["true_motor_angle_deg"] == pytest.approx(70, abs=0.5)
    phi = np.radians(row["true_motor_angle_deg"] + row["pushing_angle_deg"])
    edge = np.array([150 * np.cos(phi), 150 * np.sin(phi), 0.0]) + base
    along = np.array([np.sin(phi) * np.sin(np.radians(40)), -np.cos(phi) * np.sin(np.radians(40)),
                      np.cos(np.radians(40))])  # fmt: skip
    away = np.array(row["contact_world_mm"]) - edge
    away -= (away @ along) * along
    # At rest it hung a little below plane C; the edge was put where it hung.
    assert np.linalg.norm(away) < 2.5


def test_the_overlay_knows_where_the_camera_stands(hidden: tuple[Layout, Truth]) -> None:
    layout, truth = hidden
    name = truth.frames["frame_id"][0]
    none = pl.DataFrame(
        schema={"frame_id": pl.String, "failed": pl.Boolean, "method": pl.String, "x_c_mm": float}
    )
    seen = overlay(Results(layout.root), truth, none, name)
    assert farthest(beam_pixels(layout, name), seen.centreline) < 1.1
    assert seen.contact is not None


@pytest.mark.thorough
def test_a_contact_sheet_names_scenes_that_look_alike_below_one_picture(
    small_scene: Path, variant: str, tmp_path: Path
) -> None:
    dark = tmp_path / "back.yaml"
    text = small_scene.read_text(encoding="utf-8")
    dark.write_text(f"{text}background: {{reflectance: 0.6}}\n", encoding="utf-8")
    contact_sheet([small_scene, small_scene, dark], tmp_path / "sheet.png", variant, quiet)
    width, height, _ = image_head(tmp_path / "sheet.png")
    assert (width, height) == (4 * (468 + 8), 26 + 120 + 15 + 8)
    sheet = read_grey(tmp_path / "sheet.png")
    assert sheet[26:146, :348].max() > 150  # the beam
    assert (sheet[146:161, :476] < 100).any()  # the second name
    assert (sheet[146:161, 476:] == 245).all()
    assert np.median(sheet[26:146, 476:824]) > np.median(sheet[26:146, :348]) + 30
    assert (sheet[:, 2 * 476 :] == 245).all()
