"""Tracking of a push: image -> centreline -> measurement -> estimate, offline or live."""

import time
import traceback
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from solver.antenna import Antenna
from solver.at_rest.landmarks import with_prior
from solver.centreline import Centreline
from solver.core.once import copied
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError, described
from solver.instrument.estimate import Assumption, Estimate, Outcome
from solver.instrument.image_frame import NO_READINGS, Carriage, Readings
from solver.instrument.images import to_grey
from solver.instrument.interlacing import rows_alternate
from solver.instrument.measurement import Measurement
from solver.instrument.units import DEGREE, MILLIMETRE
from solver.methods import Method
from solver.outline.contacts import CarriageContact, carriage_contact, placed
from solver.outline.fit import Outline, fit_outline
from solver.to_measurement import to_measurement

# Chosen: a longer push is thinned to every other frame, so that memory is bounded and the whole
# push stays covered.
MAX_PUSH_FRAMES = 32
# Most poses of a carriage that are remembered. Chosen: their outline is fitted in three seconds.
MAX_POSES = 1000
INTERLACED = "the image's rows alternate, as in interlaced video: record progressive images"


@dataclass(frozen=True)
class FrameSolution:
    """One frame's estimate, the centreline it came from, and the time it took [s].

    `line` is None where the image could not be used; times start with the image in memory.
    `processor_seconds` leaves out the time in which other programs ran. `traceback` is that of an
    error in the program, which has the outcome "crashed"; it is "" if there was none.
    """

    estimate: Estimate
    line: Centreline | None
    seconds: float
    processor_seconds: float
    traceback: str = ""


class PushTracker:
    """Estimator of contact and force in consecutive frames, with the memory of their push.

    It also remembers the last contact at each pose of a carriage, for `outline`.

    A push ends where its `push_id` changes; where frames have none, as from a live camera, it ends
    with a frame without contact.
    """

    def __init__(self, antenna: Antenna, method: Method) -> None:
        self._antenna, self._method = antenna, method
        self._push: list[Measurement] = []
        self._push_id = ""
        self._contacts: dict[Carriage, CarriageContact] = {}

    def solve(
        self, image: Grey, readings: Readings = NO_READINGS, push_id: str = ""
    ) -> FrameSolution:
        """Estimate from the next image (height, width); any failure becomes an outcome."""
        if push_id != self._push_id:
            self._push, self._push_id = [], push_id
        line, measurement, trace = None, None, ""
        start, processor_start = time.perf_counter(), time.process_time()
        try:
            line, moved = extract(self._antenna, image)
            if moved is None:
                measurement = to_measurement(self._antenna, line, readings, self._push)
                estimate = _estimate(self._method, measurement, line.remark)
            else:
                estimate = moved
        except InputError as error:
            estimate = Estimate(Outcome.INVALID, str(error))
        except (Exception, SystemExit) as error:  # noqa: BLE001 - any failure is a row in the table
            estimate = Estimate(Outcome.CRASHED, described(error))
            trace = "".join(traceback.format_exception(error))
        if line is not None and _is_unusable(estimate) and rows_alternate(image):
            estimate = replace(estimate, message=f"{estimate.message}; {INTERLACED}")
        seconds = time.perf_counter() - start
        processor_seconds = time.process_time() - processor_start
        if measurement is not None:
            if estimate.outcome is Outcome.NO_CONTACT and not push_id:
                self._push = []
            else:
                self._remember(measurement)
        contact = carriage_contact(estimate, readings)
        if contact is not None:
            # The last contact at each pose: frames of one pose share its errors.
            self._contacts.pop(contact.carriage, None)
            self._contacts[contact.carriage] = contact
            if len(self._contacts) > MAX_POSES:
                del self._contacts[next(iter(self._contacts))]
        return FrameSolution(estimate, line, seconds, processor_seconds, trace)

    def update(
        self,
        image: ArrayLike,
        *,
        motor_angle_deg: float | None = None,
        moment_y_n_mm: float | None = None,
        base_force_n: ArrayLike | None = None,
        base_moment_n_mm: ArrayLike | None = None,
        carriage: Carriage | None = None,
        push_id: str = "",
    ) -> Estimate:
        """Estimate from the next image of a camera and the readings taken with it.

        `image` (height, width) is gray, or (height, width, 3) in OpenCV's order, of 8 or 16 bits;
        the rig's channel of a colour image is used. `base_force_n` and `base_moment_n_mm` (3,) are
        the force sensor's readings in Sigma_a, `carriage` the pose of an antenna that is carried
        about its object: see `outline`. Any failure becomes an outcome; `solve` also gives
        the traceback of an error in the program.
        """
        try:
            force, moment = base_force_n, base_moment_n_mm
            readings = Readings(
                motor_angle=None if motor_angle_deg is None else motor_angle_deg * DEGREE,
                moment_y=None if moment_y_n_mm is None else moment_y_n_mm * MILLIMETRE,
                base_force=None if force is None else _vector(force),
                base_moment=None if moment is None else _vector(np.multiply(moment, MILLIMETRE)),
                carriage=carriage,
            )
            gray = to_grey(np.asarray(image), "the image", self._antenna.rig.channel)
        except InputError as error:
            return Estimate(Outcome.INVALID, str(error))
        except Exception as error:  # noqa: BLE001 - a loop in a laboratory must not end here
            return Estimate(Outcome.CRASHED, described(error))
        return self.solve(gray, readings, push_id).estimate

    def outline(self) -> Outline:
        """Fit the outline of an object to the last contact at each pose of the carriage.

        These are the last MAX_POSES poses; another object needs another tracker. Points are in [m]
        on the object's table, normals in [rad]. Raises InputError if there are too few contacts in
        Sigma_o with a motor angle, or if they fit no convex outline.
        """
        if not self._contacts:
            raise InputError(
                "no frame with the outcome 'contact' had a carriage, a motor angle, and a contact "
                "in Sigma_o with its force and covariance"
            )
        names = {str(i): contact for i, contact in enumerate(self._contacts.values())}
        return fit_outline(placed(names, self._antenna.rig))

    def _remember(self, measurement: Measurement) -> None:
        if len(self._push) == MAX_PUSH_FRAMES:
            self._push = self._push[::2]
        # Drop its own `earlier`, or the chain of them would keep everything in memory.
        # What was computed of the frame alone does not depend on it.
        self._push.append(copied(measurement, earlier=()))


class Extracted(NamedTuple):
    """The beam's centreline in an image; `moved` refuses an image of a camera that has moved."""

    line: Centreline
    moved: Estimate | None


def extract_centreline(antenna: Antenna, image: Grey) -> Centreline:
    """Extract the beam's centreline, as `extract` does, whether or not the camera has moved."""
    return extract(antenna, image).line


def extract(antenna: Antenna, image: Grey) -> Extracted:
    """Extract the beam's centreline from a gray image (height, width).

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
    scaled = _plain(antenna.scale(image))
    line, sigma = antenna.extract(scaled), antenna.rig.tolerances.camera_shift_px
    measured = antenna.at_rest.landmarks.shift_of(scaled)
    if sigma:
        shift = with_prior(measured, sigma)
        line = replace(line, shift=shift.shift, shift_covariance=shift.covariance)
    if measured is None or not measured.exceeds(sigma):
        return Extracted(line, None)
    along, down = measured.shift
    message = (
        f"the image has shifted by {along:.2f} px along its rows and {down:.2f} px "
        "down since the rest images: record new ones"
    )
    moved = Estimate(Outcome.CAMERA_MOVED, message, assumption=Assumption.CAMERA_AT_REST)
    return Extracted(line, moved)


def _is_unusable(estimate: Estimate) -> bool:
    """Return whether an estimate without values may be due to the image."""
    return not estimate.values and estimate.outcome is not Outcome.NO_CONTACT


def _plain(image: Grey) -> Grey:
    """Copy an image of another memory layout, and one that is read-only.

    Compiled code would be compiled once more for each: 4 s.
    """
    return np.require(image, requirements=("C", "W"))


def run_method(method: Method, measurement: Measurement, remark: str = "") -> Estimate:
    """Run a method on a measurement; any error or other result gives the outcome "crashed".

    A `remark` on the light of the image is added to the message; a misfit that contradicts nothing
    else contradicts the light.
    """
    try:
        return _estimate(method, measurement, remark)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - any failure is a row in the table
        return Estimate(Outcome.CRASHED, described(error))


def _estimate(method: Method, measurement: Measurement, remark: str) -> Estimate:
    """Run a method, whose errors are raised."""
    result: object = method(measurement)
    if not isinstance(result, Estimate):  # an external method may return anything
        return Estimate(Outcome.CRASHED, f"returned {type(result).__name__}, not an Estimate")
    if not remark:
        return result
    assumption = result.assumption
    if result.outcome is Outcome.INVALID and assumption is None:
        assumption = Assumption.LIGHT
    message = "; ".join(filter(None, (result.message, remark)))
    return replace(result, message=message, assumption=assumption)


def _vector(values: ArrayLike) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in np.asarray(values, np.float64).ravel())
    return x, y, z
