"""Set up an antenna: calibrate its camera and learn the beam at rest, once per rig."""

import contextlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from solver.antenna import Antenna
from solver.at_rest.agreement import Learn
from solver.at_rest.rest_state import learn_rest_state
from solver.calibrate import ambiguous, calibrate
from solver.calibrate.uncertainty import calibration_uncertainty
from solver.centreline.bare_ground import bare_ground
from solver.centreline.extractor import learn_profile_fit
from solver.centreline.guide import Guide
from solver.first_start import compile_in_background
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.gray_scale import gray_scale
from solver.instrument.observation import Observations

# Chosen: a printed board and an ordinary lens leave 0.05 to 0.2 px; above, the model is wrong.
MAX_REPROJECTION_PX = 0.5
# OpenCV's rational lens describes an equidistant fisheye of up to 140 degrees, to 0.01 px:
# measured on points.
MOST_COEFFICIENTS = 8
# Share of a view's pixels with its largest gray value. Chosen: white squares fill more of it.
OVEREXPOSED = 0.1


def set_up(observations: Observations, learn: Learn = learn_profile_fit) -> Antenna:
    """Calibrate the camera, and learn the beam's appearance and rest pose.

    `learn` makes the extractor from the images of the beam at rest. Raises InputError if the
    images do not allow it; the message names the image, or else the folder.
    """
    with _named(observations), compile_in_background(observations.rig):
        try:
            return _set_up(observations, learn)
        except InputError:
            if not ambiguous(observations.rig.board):
                raise
            # The board looks the same after a turn: the beam at rest shows how the camera is
            # rolled.
            for quarter_turns in (2, 1, 3):
                with contextlib.suppress(InputError):
                    return _set_up(observations, learn, quarter_turns)
            raise


@contextlib.contextmanager
def _named(observations: Observations) -> Iterator[None]:
    """Put the folder before messages that name no image, such as those about all views together."""
    try:
        yield
    except InputError as error:
        images = (*observations.board_views, *observations.rest_images, *observations.ground_images)
        if any(str(image) in str(error) for image in images):
            raise
        raise InputError(f"{observations.root}: {error}") from error


def _set_up(observations: Observations, learn: Learn, quarter_turns: int = 0) -> Antenna:
    rig = observations.rig
    calibration = calibrate(observations.read_board_views(), rig, quarter_turns)
    if calibration.reprojection_px > MAX_REPROJECTION_PX:
        advice = (
            "check that rig.json describes the board in the views, and that "
            f"{rig.distortion_coefficients} coefficients describe the lens's distortion"
        )
        if _is_wide_angle(observations, quarter_turns):
            advice = (
                "the lens distorts as a fisheye or a strong wide-angle lens does: use a lens that "
                "keeps lines straight, or set camera.distortion_coefficients to "
                f"{MOST_COEFFICIENTS} instead of {rig.distortion_coefficients}, with views that "
                "fill the image"
            )
        if calibration.stretch is not None and calibration.stretch.is_significant:
            advice = calibration.stretch.sentence
        if _overexposed(next(observations.read_board_views())):
            advice = "the board is overexposed, so that its white squares look larger than they are"
        raise InputError(
            f"the reprojection error is {calibration.reprojection_px:.2f} px, allowed is "
            f"{MAX_REPROJECTION_PX:g} px: {advice}"
        )
    scale = gray_scale(observations.read_rest_images(), rig.bits)
    images = [scale(image) for image in observations.read_rest_images()]
    nominal = np.diag([1.0, rig.deflects_towards, 1.0, 1.0])
    nominal[:3, 3] = rig.base_position
    in_world = rig.camera_mount == "world"
    guide = Guide(
        calibration.camera,
        nominal,
        rig.beam.length,
        rig.beam.radius,
        in_world,
        scale.full_scale,
        strip_psi=rig.known_psi,
        bare_ground=bare_ground([scale(image) for image in observations.read_ground_images()]),
    )
    at_rest = learn_rest_state(images, guide, learn, calibration, rig)
    uncertainty = calibration_uncertainty(calibration, rig)
    return Antenna(rig, calibration, at_rest, uncertainty.clamp, uncertainty.scale, scale)


def _is_wide_angle(observations: Observations, quarter_turns: int) -> bool:
    """Return whether more distortion coefficients than the rig's describe the lens."""
    rig = observations.rig
    if rig.telecentric or rig.distortion_coefficients == MOST_COEFFICIENTS:
        return False
    with contextlib.suppress(InputError):
        wider = replace(rig, distortion_coefficients=MOST_COEFFICIENTS)
        calibration = calibrate(observations.read_board_views(), wider, quarter_turns)
        return calibration.reprojection_px <= MAX_REPROJECTION_PX
    return False


def _overexposed(view: Grey) -> bool:
    """Return whether a tenth of a view (height, width) has its largest gray value."""
    return bool(np.mean(view == view.max()) > OVEREXPOSED)
