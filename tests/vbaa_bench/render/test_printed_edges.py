"""Edges of printed cells: where the image shows them, and images of boards with less noise."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, invert, rigid
from tests.consistency import MOST_SIGMAS
from tests.draws import scene_seed
from tests.vbaa_bench.render.test_thin_beams import CAMERA, MIDDLE, PIXEL
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.render.printed_edges import PrintedEdges
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_rig

SCENES = Path(__file__).parents[3] / "scenes"
# Edges [m] of three columns and two rows of cells; the upper right one is black.
X, Y = np.array([-0.01, -0.003, 0.004, 0.01]), np.array([-0.008, 0.001, 0.007])
BLACK = np.array([[False, False, True], [False, False, False]])
TURNED = rigid(np.array([0.0, 0.0, 0.3]), MIDDLE)


@pytest.fixture(scope="module")
def board(variant: str) -> World:
    """The tilted board of a scene, seen by a distorting lens."""
    activate(variant, 2)
    if is_scalar():
        pytest.skip("without wavefronts whole images are rendered")
    path = SCENES / "camera" / "distortion.yaml"
    scene = load_scene(path).scene
    return SceneAssembler(scene, true_rig(scene), path.parent).calibration_board(1)


@pytest.mark.parametrize("distortion", [(), (-0.3, 0.0, 0.0, 0.0, 0.0)])
def test_edges_are_where_the_camera_sees_them(distortion: tuple[float, ...]) -> None:
    camera = replace(CAMERA, distortion=distortion)
    edges = PrintedEdges.of(X, Y, BLACK, TURNED, camera)
    rows, columns = np.nonzero(edges.sides[0] >= 0)
    assert len(rows) > 100
    upright = edges.upright[rows, columns]
    assert 0.2 < upright.mean() < 0.8
    middle = edges.sides[:, rows, columns].mean(axis=0)
    pixels = np.where(upright, [middle - 0.5, rows], [columns, middle - 0.5]).T
    place = on_board(camera, pixels)
    errors = [np.abs(place[:, axis, None] - lines) for axis, lines in enumerate((X, Y))]
    error = np.minimum(errors[0].min(axis=1), errors[1].min(axis=1))
    assert error.max() < 0.01 * PIXEL
    # Between white cells there is no edge.
    white = (place[:, 0] > X[0] + PIXEL) & (place[:, 0] < X[2] - PIXEL)
    assert not (white & (np.abs(place[:, 1] - Y[1]) < PIXEL)).any()


def on_board(camera: Camera, pixels: Floats) -> Floats:
    """Places (n, 2) [m] on the board that pixels (n, 2) show."""
    antenna_from_camera = invert(camera.camera_from_antenna)
    ray = np.column_stack([camera.normalised(pixels), np.ones(len(pixels))])
    ray = ray @ antenna_from_camera[:3, :3].T
    start = antenna_from_camera[:3, 3]
    points = start - start[2] / ray[:, 2:] * ray
    return apply(invert(TURNED), points)[:, :2]


def near_edges(board: World) -> np.ndarray:
    """Pixels (n, 2) with an edge, and one in ten of them."""
    assert board.printed is not None
    return np.argwhere(board.printed.sides[0] >= 0)[::10, ::-1]


@pytest.mark.parametrize("shift_px", [0.0, 0.3, -5.0])
def test_the_mean_does_not_depend_on_the_edges(board: World, shift_px: float) -> None:
    right, pixels = board.printed, near_edges(board)
    assert right is not None
    wrong = replace(right, sides=np.where(right.sides >= 0, right.sides + shift_px, -1.0))
    sums = []
    for board.printed in (None, wrong):
        images = [
            trace(
                board, pixels, np.full(len(pixels), 8), scene_seed(10 * seed), "whole", 8
            ).radiance
            for seed in range(12)
        ]
        sums.append(np.sum(images, axis=1))
    board.printed = right
    error = np.hypot(*(one.std(ddof=1) for one in sums)) / np.sqrt(12)
    assert abs(sums[0].mean() - sums[1].mean()) < MOST_SIGMAS * error
    assert error < 3e-3 * sums[0].mean()


def test_pixels_at_edges_have_less_noise(board: World) -> None:
    right, pixels, noise = board.printed, near_edges(board), []
    for board.printed in (right, None):
        found = trace(board, pixels, np.full(len(pixels), 8), scene_seed(3), "whole", 16)
        noise.append(np.sqrt(np.median(found.variance)))
    board.printed = right
    assert noise[0] < 0.2 * noise[1]
