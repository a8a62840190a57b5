import numpy as np
import pytest

from solver.calibrate import calibrate
from solver.calibrate.uncertainty import calibration_uncertainty
from solver.instrument.board import Chessboard
from solver.planes.plane_c import on_plane
from tests.drawn import drawn
from tests.solver.calibrate.rigs import board_pose, camera, rig

BOARD = Chessboard(12, 9, 0.013)


@pytest.mark.thorough
def test_what_a_calibration_leaves_open_along_the_beam_is_what_it_errs_by(
    random: np.random.Generator,
) -> None:
    """Calibrations from independent noise scatter by what each says of itself."""
    true, nominal, errors = camera(), rig(BOARD), []
    x = nominal.beam.length * np.linspace(0.05, 0.95, 10)
    places = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    line = np.linalg.pinv(np.column_stack([np.ones_like(x), x]))
    # Drawn once without noise, of which 16 bits keep enough levels.
    exact = [
        drawn(
            BOARD,
            true,
            board_pose(view),
            random,
            samples=21,
            generator=13,
            noise=0.0,
            bits=16,
        )
        for view in range(3)
    ]
    for _ in range(12):
        noisy = [view + 0.01 * 65535 * random.standard_normal(view.shape) for view in exact]
        views = [np.clip(np.rint(view / 257), 0, 255).astype(np.uint8) for view in noisy]
        found = calibrate(views, nominal)
        seen, _ = on_plane(found.camera, true.project(places), np.zeros((len(x), 2)))
        errors.append(line @ (seen[:, 0] - x) / calibration_uncertainty(found, nominal)[:2])
    # 24 numbers, whose mean square is above 3 once in a million runs; errors of the pixel grid are
    # in it too.
    assert 0.05 < np.mean(np.square(errors)) < 3.0
