"""What is drawn lies where it was measured."""

import itertools
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from solver.antenna import Antenna
from solver.centreline import Flag
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.observation import Observations
from solver.lab.live import FrameResult, solve_shots
from solver.lab.overlay import CONTACT, FORCE, MEASURED, REJECTED, TIP, OverlayWriter, draw
from solver.lab.shots import Files
from solver.lab.table import row
from solver.methods import METHODS


@pytest.fixture(scope="module")
def answered(observations: Observations, antenna: Antenna) -> list[FrameResult]:
    return list(solve_shots(Files(observations.frames), antenna, METHODS["exact_fit"]))


def painted(picture: np.ndarray, colour: tuple[int, int, int]) -> Floats:
    """Places (n, 2), as (u, v), of exactly this colour, in pixels of the image it enlarges by 2."""
    v, u = np.nonzero((picture == np.array(colour)).all(axis=2))
    return np.column_stack([(u + 0.5) / 2 - 0.5, (v + 0.5) / 2 - 0.5])


def test_points_ring_and_arrow_lie_on_the_beam(
    antenna: Antenna, answered: list[FrameResult]
) -> None:
    for given in answered:
        picture = draw(antenna, given)
        assert picture.shape == (2 * 176, 2 * 512, 3)
        line = given.solved.line
        assert line is not None
        u, v = line.points[np.argsort(line.points[:, 0])].T
        dots = painted(picture, MEASURED)
        assert len(dots) > len(u) / 4
        assert np.abs(dots[:, 1] - np.interp(dots[:, 0], u, v)).max() < 1.5
        ring = painted(picture, CONTACT)
        at = (ring.max(axis=0) + ring.min(axis=0)) / 2
        assert abs(at[1] - np.interp(at[0], u, v)) < 1
        # Half a millimetre a pixel, and the contact distance of the truth: 100 or 200 mm.
        x_c = given.solved.estimate.values["x_c_m"]
        camera = antenna.calibration.camera
        there = camera.project(np.array([[x_c, given.solved.estimate.values["y_c_m"], 0.0]]))[0]
        assert np.abs(at - there).max() < 1
        # The object pushes towards +y, which is up in the image: the arrow comes from below.
        arrow = painted(picture, FORCE)
        assert arrow[:, 1].mean() > at[1] + 5
        assert abs(arrow[:, 0].mean() - at[0]) < 20


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_a_camera_in_the_world_sees_the_force_turn_with_the_motor(
    antenna: Antenna, answered: list[FrameResult], angle: float
) -> None:
    fixed = replace(antenna, rig=replace(antenna.rig, camera_mount="world"))
    values = {"contact_world_x_m": 0.12, "contact_world_y_m": 0.0, "contact_world_z_m": 0.0}
    values |= {"force_x_n": 0.0, "force_y_n": 0.05, "force_n": 0.05, "motor_angle_rad": angle}
    estimate = Estimate(Outcome.CONTACT, values=values)
    solved = replace(answered[0].solved, estimate=estimate)
    picture = draw(fixed, replace(answered[0], solved=solved, row=row("a", estimate, 1.0)))
    ring, arrow = painted(picture, CONTACT), painted(picture, FORCE)
    at = (ring.max(axis=0) + ring.min(axis=0)) / 2
    # The arrow comes from the object; up in the image is +y.
    u, v = at - arrow.mean(axis=0)
    assert np.arctan2(-u, -v) == pytest.approx(angle, abs=0.1)


def test_more_force_is_a_longer_arrow(antenna: Antenna, answered: list[FrameResult]) -> None:
    """Half of the longest at the force that deflects a tip by 10 %; never above a quarter."""
    beam, given = antenna.rig.beam, answered[0]
    reference = 3 * beam.flexural_rigidity * 0.1 / beam.length**2
    lengths = []
    for factor in (0.3, 1.0, 3.0, 1e6):
        values = {**given.solved.estimate.values, "force_n": factor * reference}
        values = {name: value for name, value in values.items() if name != "force_z_n"}
        solved = replace(given.solved, estimate=Estimate(Outcome.CONTACT, values=values))
        places = painted(draw(antenna, replace(given, solved=solved)), FORCE)
        lengths.append(float(np.hypot(*np.ptp(places, axis=0))))
    # The arrow's head is wider than its shaft.
    assert lengths[1] == pytest.approx(176 / 8, abs=3)
    assert lengths[3] == pytest.approx(176 / 4, abs=3)
    assert all(second > first + 3 for first, second in itertools.pairwise(lengths))


def test_what_was_rejected_has_its_own_colour(
    antenna: Antenna, answered: list[FrameResult]
) -> None:
    line = answered[0].solved.line
    assert line is not None
    places = np.array([[100.0, 160.0], [200.0, 165.0], [300.0, 170.0]])
    flags = np.array([Flag.HIDDEN, Flag.SATURATED, Flag.FOREIGN], dtype=np.uint8)
    marked = replace(line, rejected=places, flags=flags, tip=np.array([400.0, 50.0]))
    estimate = Estimate(Outcome.NO_CONTACT)
    solved = replace(answered[0].solved, line=marked, estimate=estimate)
    given = replace(answered[0], solved=solved, row=row("a", estimate, 1.0))
    picture = draw(antenna, given)
    for place, flag in zip(places, Flag, strict=True):
        dots = painted(picture, REJECTED[flag])
        near = np.abs(dots - place).max(axis=1) < 1
        assert near.any()
    ring = painted(picture, TIP)
    assert np.abs((ring.max(axis=0) + ring.min(axis=0)) / 2 - [400, 50]).max() < 1
    assert not len(painted(picture, CONTACT))
    assert not len(painted(picture, FORCE))


def test_sixteen_bits_are_drawn_as_they_look(antenna: Antenna, answered: list[FrameResult]) -> None:
    given = answered[0]
    deep = replace(given.shot, image=given.shot.pixels().astype(np.uint16) * 16)
    one, other = draw(antenna, given), draw(antenna, replace(given, shot=deep))
    assert other.dtype == np.uint8
    assert other.max() == 255
    assert len(painted(one, MEASURED)) == pytest.approx(len(painted(other, MEASURED)), rel=0.1)


@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".mkv"])
def test_videos_are_written(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / "new" / f"seen{suffix}"
    with OverlayWriter(path, 10.0) as writer:
        for number in range(4):
            writer.write(np.full((48, 64, 3), 50 * number, np.uint8), number, "x")
    capture = cv2.VideoCapture(str(path))
    assert capture.get(cv2.CAP_PROP_FPS) == 10
    means = []
    while (shown := capture.read())[0]:
        means.append(float(shown[1].mean()))
    assert means == pytest.approx([0, 50, 100, 150], abs=4)


def test_pictures_are_numbered_and_a_bad_place_is_named(tmp_path: Path) -> None:
    with OverlayWriter(tmp_path / "seen") as writer:
        writer.write(np.zeros((4, 5, 3), np.uint8), 7, "shard/frame.png")
    assert [path.name for path in (tmp_path / "seen").iterdir()] == ["000007_frame.png"]
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file: cannot be written"):
        OverlayWriter(tmp_path / "file")
    (tmp_path / "folder.avi").mkdir()
    with (
        pytest.raises(InputError, match=r"folder\.avi: cannot be written as a video"),
        OverlayWriter(tmp_path / "folder.avi") as writer,
    ):
        writer.write(np.zeros((48, 64, 3), np.uint8), 0, "x")
