"""From images to estimates: calibrate -> rest -> centreline -> plane -> method."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from solver.calibrate import Calibration, calibrate
from solver.calibrate.certainty import certainty
from solver.centreline import Centreline, Extractor
from solver.centreline.beam import learn_beam
from solver.centreline.guide import Guide
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.images import read_grey
from solver.instrument.measurement import Measurement, Tip, View
from solver.instrument.observation import NOTHING_READ, Observations, Readings
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert
from solver.methods import Method
from solver.plane import on_plane
from solver.rest import Rest, learn_rest
from solver.sag import raised, scale_error

# From images of the beam at rest to what finds it in any image.
Learn = Callable[[Sequence[Grey], Guide], Extractor]

WORST_REPROJECTION_PX = 0.5
# A motor whose camera stands in the world may have turned by any angle of this order [rad].
ANY_TILT = 0.5


@dataclass(frozen=True)
class Antenna:
    """All that is learned once per rig: calibrated camera and the beam at rest.

    `clamp_sigma` [m] and `scale_sigma` are what the calibration leaves open along the beam.
    """

    rig: Rig
    calibration: Calibration
    rest: Rest
    extract: Extractor
    clamp_sigma: float = 0.0
    scale_sigma: float = 0.0


def set_up(observations: Observations, learn: Learn = learn_beam) -> Antenna:
    """Calibrate the camera, learn the beam's look and its rest pose.

    `learn` makes the extractor from the images of the beam at rest. Raises InputError if the
    images forbid it.
    """
    rig = observations.rig
    calibration = calibrate([read_grey(path) for path in observations.board_views], rig)
    if calibration.reprojection_px > WORST_REPROJECTION_PX:
        raise InputError(
            f"the calibration leaves {calibration.reprojection_px:.2f} px, allowed is "
            f"{WORST_REPROJECTION_PX:g} px: is the rig's board the one in the views, and has the "
            f"lens no more distortion than the rig's {rig.distortion_coefficients} coefficients "
            "can describe?"
        )
    images = [read_grey(path) for path in observations.rest_images]
    nominal = np.diag([1.0, rig.deflects_towards, 1.0, 1.0])
    nominal[:3, 3] = rig.base_position
    in_world = rig.camera_mount == "world"
    guide = Guide(calibration.camera, nominal, rig.beam.length, rig.beam.radius, in_world)
    extract = learn(images, guide)
    rest = learn_rest([extract(image) for image in images], calibration, rig)
    return Antenna(rig, calibration, rest, extract, *certainty(calibration, rig))


def measure(
    antenna: Antenna,
    line: Centreline,
    readings: Readings = NOTHING_READ,
    earlier: Sequence[Measurement] = (),
) -> Measurement:
    """The visible beam of an image, carried onto plane C, in the frame of the beam at rest.

    `earlier` are the measurements of the same push before this one. Points within the readings'
    removed stretch are left out. The angle of a motor whose camera stands in the world is not
    read: the clamp's tilt is then almost unknown, and is the motor's angle.
    """
    camera, rig, rest = antenna.calibration.camera, antenna.rig, antenna.rest
    points, sigmas = on_plane(camera, line.points, line.directions * line.sigma[:, None])
    points = raised(points, camera.viewpoint, rig)
    if readings.removed is not None:
        low, high = readings.removed
        kept = (points[:, 0] < low) | (points[:, 0] > high)
        points, sigmas = points[kept], sigmas[kept]
    if not rest.straight:
        points, sigmas = _unbowed(points, sigmas, rest, rig)
    clamp = np.array([rig.base_position[0], rest.y_at_clamp])
    tilt = math.atan(rest.slope)
    along = np.array([math.cos(tilt), math.sin(tilt)])
    across = np.array([-math.sin(tilt), math.cos(tilt)]) * rig.deflects_towards
    axes = np.column_stack([along, across])
    antenna_from_beam = np.eye(4)
    antenna_from_beam[:2, :2], antenna_from_beam[:2, 3] = axes, clamp
    viewpoint = invert(antenna_from_beam) @ camera.viewpoint
    tolerance = rig.tolerances
    base_covariance = np.zeros((3, 3))
    base_covariance[0, 0] = tolerance.base_position**2 + tolerance.board_translation**2
    base_covariance[0, 0] += antenna.clamp_sigma**2
    base_covariance[1:, 1:] = rest.line_covariance
    # A nanometre and a nanoradian keep a rig that claims to be exact from being singular.
    base_covariance += np.diag([1e-18, 1e-18, 1e-18])
    in_world = rig.camera_mount == "world"
    if in_world:
        base_covariance[2, 2] += ANY_TILT**2
    return Measurement(
        view=View((points - clamp) @ axes, sigmas @ axes, viewpoint, _tip(antenna, line, axes)),
        base_covariance=base_covariance,
        scale_sigma=math.hypot(_scale_sigma(antenna), _bow_error(points, rest)),
        motor_angle=None if in_world else readings.motor_angle,
        rig=rig,
        antenna_from_beam=antenna_from_beam,
        moment_y=readings.moment_y,
        base_force=readings.base_force,
        base_moment=readings.base_moment,
        earlier=tuple(earlier),
        viewpoint_known=antenna.calibration.viewpoint_known,
    )


def _tip(antenna: Antenna, line: Centreline, axes: Floats) -> Tip | None:
    """The tip on plane C, in the frame of the beam at rest.

    What is seen of a cylinder's end is the rim that is nearest to the camera: on the mean over the
    beam's width it stands pi/4 of the radius above the axis.
    """
    if line.tip is None or line.tip_covariance is None:
        return None
    camera, rig = antenna.calibration.camera, antenna.rig
    root = np.asarray(np.linalg.cholesky(line.tip_covariance), dtype=np.float64)
    points, sigmas = on_plane(camera, np.tile(line.tip, (2, 1)), root.T)
    viewpoint, point = camera.viewpoint, raised(points[:1], camera.viewpoint, rig)[0]
    lift = rig.beam.radius * math.pi / 4
    outward = (viewpoint[3] * point - viewpoint[:2]) / viewpoint[2]
    clamp = np.array([rig.base_position[0], antenna.rest.y_at_clamp])
    turned = sigmas @ axes
    return Tip((point - lift * outward - clamp) @ axes, turned.T @ turned)


def _unbowed(points: Floats, sigmas: Floats, rest: Rest, rig: Rig) -> tuple[Floats, Floats]:
    """Points (n, 2) on C and their one-sigma vectors, as a straight beam would show them.

    A bow moves every point of the bent beam along its normal there, by as much as at rest.
    """
    x, y = points[:, 0] - rig.base_position[0], points[:, 1] - rest.y_at_clamp
    curve = np.polynomial.Polynomial.fit(x, y, min(6, len(x) // 4), domain=[0, rest.length])
    slope = curve.deriv()(x)
    # Arc length from the clamp, which the bow is told by.
    fine = np.linspace(0, rest.length, 241)
    steps = np.hypot(1, curve.deriv()(fine))
    arc = np.interp(x, fine, cumulative_trapezoid(steps, fine, initial=0.0))
    bow, bow_sigma = rest.bow_at(np.minimum(arc, rest.length))
    normal = np.column_stack([-slope, np.ones_like(slope)]) / np.hypot(1, slope)[:, None]
    size = np.maximum(np.linalg.norm(sigmas, axis=1), 1e-15)
    return points - bow[:, None] * normal, sigmas * (np.hypot(size, bow_sigma) / size)[:, None]


def _bow_error(points: Floats, rest: Rest) -> float:
    """What taking a bow off leaves, a relative sigma of lengths.

    A bow also moves the bent beam along itself, by about its size times the slope there, and the
    force's lever with it.
    """
    if rest.straight or len(points) < 3:
        return 0.0
    bow, _ = rest.bow_at(np.linspace(0.0, rest.length, 50))
    slope = np.ptp(points[:, 1]) / max(float(np.ptp(points[:, 0])), 1e-12)
    return float(np.sqrt(np.mean(bow**2)) * slope / rest.length)


def _scale_sigma(antenna: Antenna) -> float:
    """What the rig's tolerances leave open of all lengths, a relative sigma.

    A clamp off plane C, or a board that did not lie in it, is nearer to the camera or farther from
    it than believed: all lengths err by the same share. A board tilted about its middle is off by
    its angle times half the beam. The calibration's own error comes to that.
    """
    camera, rig = antenna.calibration.camera, antenna.rig
    tolerance = rig.tolerances
    if camera.telecentric:  # distance does not change its scale, and tilt but to second order
        return math.hypot(tolerance.board_rotation**2, antenna.scale_sigma)
    height = float(invert(camera.camera_from_antenna)[2, 3])
    tilted = tolerance.board_rotation * rig.beam.length / 2
    off_plane = math.hypot(tolerance.base_position, tolerance.board_translation, tilted) / height
    return math.hypot(off_plane, scale_error(camera.viewpoint, rig), antenna.scale_sigma)


def see(antenna: Antenna, image: Grey) -> Centreline:
    """The beam's centreline in a gray image (height, width).

    Raises InputError if the image is not of the calibrated camera's size and kind.
    """
    camera = antenna.calibration.camera
    if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"the image has shape {image.shape} and type {image.dtype}, "
            "allowed is one channel of 8 or 16 bits"
        )
    if image.shape != (camera.height, camera.width):
        raise InputError(
            f"the image has {image.shape[1]} x {image.shape[0]} px, "
            f"the calibration {camera.width} x {camera.height}"
        )
    # Compiled for one layout of an image only.
    return antenna.extract(np.ascontiguousarray(image))


def estimate(
    antenna: Antenna,
    image: Grey,
    method: Method,
    readings: Readings = NOTHING_READ,
    earlier: Sequence[Measurement] = (),
) -> Estimate:
    """One frame's answer; an error of any kind becomes an outcome, never an exception."""
    try:
        measurement = measure(antenna, see(antenna, image), readings, earlier)
    except (InputError, ValueError) as error:
        return Estimate(Outcome.INVALID, str(error))
    except Exception as error:  # noqa: BLE001 - any failure is a row in the table
        return Estimate(Outcome.CRASHED, f"{type(error).__name__}: {error}")
    return answer(method, measurement)


def answer(method: Method, measurement: Measurement) -> Estimate:
    """What a method says of a measurement; whatever else it does is the outcome "crashed"."""
    try:
        given: object = method(measurement)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - any failure is a row in the table
        return Estimate(Outcome.CRASHED, f"{type(error).__name__}: {error}")
    if not isinstance(given, Estimate):  # a method of someone else's may return anything
        return Estimate(Outcome.CRASHED, f"returned {type(given).__name__}, not an Estimate")
    return given
