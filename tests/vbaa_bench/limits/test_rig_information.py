"""What is known before contact: the board's edges, rest images, and the metered exposure."""

from pathlib import Path

import numpy as np
import pytest

from tests.draws import scene_seed
from tests.vbaa_bench.limits.experiments import paper_push, push
from vbaa_bench.api.scene import Scene
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.limits.board_information import BOARD, board_information
from vbaa_bench.limits.camera_parameters import INTRINSICS, POSE
from vbaa_bench.limits.profile import edge_information
from vbaa_bench.limits.rig_information import RigInformation
from vbaa_bench.limits.visible_places import visible_by_plan, visible_in_image
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_rig

PUSHES = {"contact_distance_mm": [140], "deflection_pct": [10]}


@pytest.fixture(autouse=True)
def _active(variant: str) -> None:
    activate(variant, 1)


def assembler(**keys: object) -> SceneAssembler:
    scene = Scene(**{"title": "Board", "seed": scene_seed(1), "pushes": PUSHES, **keys}).scene
    return SceneAssembler(scene, true_rig(scene), Path())


def test_an_edge_of_one_pixel_has_the_information_of_its_contrast() -> None:
    # Noise of 2, a contrast of 6 over one pixel: (6 / 2)^2 for a shift by a pixel.
    information = edge_information(
        1.0, np.array([7.0]), np.array([1.0, 0.0]), 0.0, lambda mean: np.full_like(mean, 4.0)
    )
    assert information[0] == pytest.approx(9.0, rel=0.01)


def test_upright_edges_of_the_board_inform_on_the_shift_along_the_rows() -> None:
    """A board of 13 x 10 squares has 12 x 10 upright and 9 x 13 level edges between squares.

    Those around the pattern have white beside them: where a square is black, 10 and 13 more.
    """
    level = {"position_mm": [120.0, 18.0, 360.0], "look_at_mm": [120.0, 18.0, 0.0], "roll_deg": 0}
    board = assembler(camera=level, calibration={"views": 3})
    one_view = board_information(board, 2e4).without({*INTRINSICS[:2], *POSE, *BOARD})
    three = {name: i for i, name in enumerate(one_view.names)}
    per_x, per_y = (one_view.matrix[three[name], three[name]] for name in ("cx", "cy"))
    # The tilted views inform less than this on the shift: their own poses are unknown.
    edges_x, edges_y = 12 * 10 + 10, 9 * 13 + 13
    assert per_x / per_y == pytest.approx(edges_x / edges_y, rel=0.1)


def test_the_board_fixes_the_cameras_place_up_to_its_own() -> None:
    known = paper_push()[0].rig.before_contact
    names = [{"move_x": 1.0}, {"board_move_x": 1.0}, {"fx": 1.0}, {"cx": 1.0}]
    moves = known.sigmas(known.gradients(names))
    assert moves[0] > 0.5 * 1e-5  # the stated tolerance of the board remains in the camera's place
    assert moves[1] <= 1e-5 * (1 + 1e-9)
    assert moves[2] < 0.02
    assert moves[3] < 0.02


def test_the_exposure_is_that_of_rendered_images(small_scene: Path, variant: str) -> None:
    file = load_scene(small_scene)
    rig = true_rig(file.scene)
    rendered = FrameRenderer(file.scene, rig, small_scene.parent, variant, 1).measure_exposure()
    exposure = RigInformation(file.scene, rig, small_scene.parent).exposure
    # The largest hundredth of a noisy image, against the largest hundredth of a smooth profile.
    assert exposure == pytest.approx(rendered, rel=0.03)


def test_hidden_stretches_are_left_out() -> None:
    visible = visible_in_image(paper_push()[0].pose, [0.0, 24.0, 120.0, 132.0])
    assert visible.sum() == pytest.approx(200 * (1 - 36 / 240), abs=1)
    assert visible[:20].sum() == 0
    assert visible[-20:].all()


def test_a_stretch_that_is_declared_as_missing_is_left_out() -> None:
    cover = {"kind": ["removed"], "place": ["middle"], "availability": [0.75]}
    pose = push(occlusion=cover)[0].pose
    # The middle quarter of the beam's x axis, and the hub.
    for visible, missing in ((visible_in_image(pose, []), 0), (visible_by_plan(pose), 2)):
        assert visible.sum() == pytest.approx(150 - missing, abs=2)
        assert not visible[95:105].any()
