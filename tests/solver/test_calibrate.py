"""The telecentric camera from one rendered board; the pinhole's road is tested end to end."""

import math

import numpy as np
import pytest

from solver.calibrate import calibrate
from solver.instrument.arrays import Grey
from solver.instrument.beam import Beam, circular_rigidity
from solver.instrument.camera import Camera
from solver.instrument.errors import InputError
from solver.instrument.rig import Chessboard, Rig, Tolerances
from solver.instrument.transforms import apply, camera_looking_at, rigid
from solver.plane import on_plane
from vbaa_bench.geometry.board import board
from vbaa_bench.geometry.objects import sheet
from vbaa_bench.render.picture import even_picture
from vbaa_bench.render.variant import activate
from vbaa_bench.render.world import Lamp, RenderUnit, Surface, World

FIELD = 12e-3
MIDDLE = np.array([5e-3, 0.3e-3, 0.0])


def micro_rig(telecentric: bool = True) -> Rig:
    """A pipette of 10 mm and 20 um under a microscope."""
    return Rig(
        beam=Beam(10e-3, 20e-6, circular_rigidity(70e9, 20e-6)),
        base_position=np.zeros(3),
        board=Chessboard(12, 7, 0.7e-3),
        antenna_from_board=rigid(np.array([0, 0, 0.01]), MIDDLE),
        deflects_towards=1,
        tolerances=Tolerances(**dict.fromkeys(Tolerances.__dataclass_fields__, 0.0)),
        telecentric=telecentric,
    )


def microscope(lean: float) -> Camera:
    """Leaning towards the reader by `lean` [rad], rolled, its axis off the image's middle."""
    away = np.array([0.3 * math.sin(lean), -math.sin(lean), math.cos(lean)])
    pose = camera_looking_at(MIDDLE + 50e-3 * away, MIDDLE, 0.03)
    return Camera(640, 480, 640 / FIELD, 640 / FIELD, 330.2, 231.9, pose, telecentric=True)


def picture(camera: Camera, rig: Rig) -> Grey:
    white, black = board(rig.board)
    for cells in (white, black):
        cells.vertices = apply(rig.antenna_from_board, np.asarray(cells.vertices))
    lamp = Lamp(sheet(MIDDLE + np.array([0.0, 0.0, 60e-3]), 100e-3, -1))
    surfaces = {"white": Surface(white, 0.7), "black": Surface(black, 0.04)}
    world = World(camera, lamp, surfaces, RenderUnit(10e-6, np.array([5e-3, 0.0, 0.0])))
    radiance = even_picture(world, 64, 1)
    return np.asarray(230 * radiance / radiance.max(), dtype=np.uint8)


@pytest.fixture(scope="module", autouse=True)
def _renderer(variant: str) -> None:
    activate(variant, 2)


@pytest.mark.parametrize("lean_deg", [0.0, 12.0])
def test_one_view_is_enough_for_a_telecentric_camera(lean_deg: float) -> None:
    true = microscope(math.radians(lean_deg))
    found = calibrate([picture(true, micro_rig())], micro_rig())
    assert found.camera.telecentric
    assert found.reprojection_px < 0.05
    assert found.camera.fx == pytest.approx(true.fx, rel=1e-3)
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, 10e-3, 9), np.linspace(-3e-3, 3e-3, 5)))
    points = np.column_stack([x, y, np.zeros_like(x)])
    back, _ = on_plane(found.camera, true.project(points), np.ones(len(x)))
    assert np.abs(back - points[:, :2]).max() < 1e-4 * FIELD
    # It looks down from above, and a lean shows as itself, to what noise makes of a cosine.
    right, down, forward = found.camera.camera_from_antenna[:3, :3]
    assert np.cross(right, down) == pytest.approx(forward)
    assert forward[2] < 0
    assert forward == pytest.approx(true.camera_from_antenna[2, :3], abs=0.05)


def test_a_pinhole_needs_three_views() -> None:
    view = picture(microscope(0.0), micro_rig())
    with pytest.raises(InputError, match="1 calibration views show the whole board, needed are 3"):
        calibrate([view], micro_rig(telecentric=False))


def test_a_view_without_the_board_is_refused() -> None:
    with pytest.raises(InputError, match="does not show the whole board"):
        calibrate([np.zeros((480, 640), np.uint8)], micro_rig())
