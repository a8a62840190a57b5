"""Overlay of measurements and estimates on an image: points, tip, contact, force."""

import math
from collections.abc import Sequence, Sized
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple, Self

import cv2
import numpy as np
import numpy.typing as npt

from solver.antenna import Antenna
from solver.centreline import Centreline, Flag
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.images import FORMATS, eight_bit
from solver.instrument.transforms import apply, turn_about_z
from solver.lab.console import sentence
from solver.lab.live import FrameResult
from solver.lab.shots import Source
from solver.lab.writing import check_no_input, check_two_files
from solver.to_measurement import to_measurement
from solver.tracing.beam_fit import Rejection, TracedBeam
from solver.tracker import FrameSolution

Picture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

# Colours in the order blue, green, red. They are those of the benchmark's report.
MEASURED: Final = (20, 232, 255)
REJECTED: Final = {
    Flag.HIDDEN: (255, 107, 47),
    Flag.SATURATED: (0, 74, 255),
    Flag.FOREIGN: (240, 28, 240),
}
REASONS: Final = {
    Rejection.HIDDEN: REJECTED[Flag.HIDDEN],
    Rejection.FAINT: REJECTED[Flag.SATURATED],
    Rejection.OUTLIER: REJECTED[Flag.FOREIGN],
}
TIP: Final = (255, 245, 60)
CONTACT: Final = (60, 60, 255)
FORCE: Final = (60, 150, 255)
_SHIFT: Final = 4  # OpenCV draws at sixteenths of a pixel
WIDTH = 1000  # smaller images are enlarged by a whole number to about this [px]
_FOURCC: Final = {".mp4": "mp4v", ".m4v": "mp4v", ".mov": "mp4v", ".avi": "MJPG", ".mkv": "MJPG"}


def draw(antenna: Antenna, given: FrameResult) -> Picture:
    """Draw measured points and estimates on the image; return a BGR picture (height, width, 3).

    Measured points are yellow dots, rejected ones blue (hidden), orange (saturated) or purple
    (foreign). The tip is a light blue ring, the estimated contact a red one. The arrow is the
    object's force on the beam; its length increases with the force and never exceeds a quarter of
    the height. Raises InputError if the shot has no image.
    """
    image = given.shot.pixels()
    factor = max(1, round(WIDTH / image.shape[1]))
    picture = _enlarged(image, factor)
    line = given.solved.line
    if line is not None:
        _mark(picture, line, factor)
        if line.tip is not None:
            _ring(picture, line.tip, factor, TIP)
    contact = contact_in_image(antenna, given.solved, given.shot.readings.motor_angle)
    if contact is not None:
        length = _arrow_px(antenna, given.solved, len(picture))
        _arrow(picture, contact.point, contact.direction, factor, length)
        _ring(picture, contact.point, factor, CONTACT)
    name = f"{Path(given.shot.name).name}  {1e3 * given.latency:.1f} ms"
    for number, text in enumerate((sentence(given.row), name)):
        _write(picture, text, number)
    return picture


class ImageContact(NamedTuple):
    """Estimated contact (2,) [px] as (u, v), and unit vector (2,) of the force on the beam."""

    point: Floats
    direction: Floats


def contact_in_image(
    antenna: Antenna, solved: FrameSolution, motor_angle: float | None = None
) -> ImageContact | None:
    """Project contact and force to the image; None where they were not estimated.

    A camera that is fixed in the world needs the `motor_angle` [rad], unless it was estimated.
    """
    values, rig = solved.estimate.values, antenna.rig
    if solved.line is None or not values:
        return None
    frame = "world" if rig.camera_mount == "world" else "antenna"
    names = [f"contact_{frame}_{axis}_m" for axis in "xyz"]
    pose = to_measurement(antenna, solved.line).antenna_from_beam
    if all(name in values for name in names):
        point = np.array([values[name] for name in names])
    elif frame == "antenna" and "x_c_m" in values and "y_c_m" in values:
        psi = values.get("psi_rad", 0.0)
        y = values["y_c_m"]
        beam_point = np.array([values["x_c_m"], y * math.cos(psi), y * math.sin(psi)])
        point = apply(pose, beam_point[None])[0]
    else:
        return None
    if "force_x_n" in values and "force_y_n" in values:
        force = np.array([values.get(f"force_{axis}_n", 0.0) for axis in "xyz"])
        if frame == "world":  # the force is in Sigma_a, which the motor has turned
            angle = values.get("motor_angle_rad", motor_angle)
            force = turn_about_z(angle or 0.0)[:3, :3] @ force
    else:
        theta, psi = values.get("theta_c_rad", 0.0), values.get("psi_rad", 0.0)
        normal = [
            -math.sin(theta),
            math.cos(theta) * math.cos(psi),
            math.cos(theta) * math.sin(psi),
        ]
        force = pose[:3, :3] @ np.array(normal)
    step = 1e-3 * rig.beam.length * force / max(float(np.linalg.norm(force)), 1e-12)
    projected = antenna.calibration.camera.project(np.vstack([point, point + step]))
    direction = projected[1] - projected[0]
    norm = float(np.linalg.norm(direction))
    if not np.isfinite(projected).all() or norm < 1e-9:
        return None
    return ImageContact(projected[0], direction / norm)


def _arrow_px(antenna: Antenna, solved: FrameSolution, height: int) -> float:
    """Compute the arrow's length; it tends to a quarter of the height for large forces.

    It is half of that at the force that deflects the tip by 10 %.
    """
    force = abs(solved.estimate.values.get("force_n", 0.0))
    beam = antenna.rig.beam
    reference_force = 0.3 * beam.flexural_rigidity / beam.length**2
    return height / 4 * force / (force + reference_force)


def draw_traced(image: Grey, beam: TracedBeam | None, texts: Sequence[str]) -> Picture:
    """Draw a traced beam and lines of text on its image; return a BGR picture (height, width, 3).

    Points are yellow dots, and the edges beside them small ones. Rejected places are blue (hidden),
    orange (faint) or purple (outlier).
    """
    factor = max(1, round(WIDTH / image.shape[1]))
    picture = _enlarged(image, factor)
    # Dots of a large photograph are as large as those of a small image that is enlarged.
    size = max(1.0, image.shape[1] / WIDTH)
    if beam is not None:
        half = beam.normals * beam.widths[:, None] / 2
        for points, part in (
            (beam.points - half, 0.5),
            (beam.points + half, 0.5),
            (beam.points, 1),
        ):
            _dots(picture, points, factor, MEASURED, part * size)
        for reason, colour in REASONS.items():
            places = beam.rejected[[one is reason for one in beam.reasons]]
            _dots(picture, places, factor, colour, size)
    for number, text in enumerate(texts):
        _write(picture, text, number)
    return picture


def _enlarged(image: Grey, factor: int) -> Picture:
    """Convert an image to BGR and enlarge it by the whole number `factor`."""
    large = eight_bit(image).repeat(factor, axis=0).repeat(factor, axis=1)
    if large.ndim == 3:
        return large
    return np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


def _place(point: Floats, factor: int) -> tuple[int, int]:
    """Map a pixel of the image to the enlarged picture, in 2^-_SHIFT px, clipped at 10^6."""
    scaled = (np.asarray(point) + 0.5) * factor - 0.5
    u, v = np.clip(np.rint(scaled * 2**_SHIFT), -1e6, 1e6)
    return int(u), int(v)


def _mark(picture: Any, line: Centreline, factor: int) -> None:
    """Draw measured and rejected points as dots."""
    _dots(picture, line.points, factor, MEASURED)
    for flag, colour in REJECTED.items():
        _dots(picture, line.rejected[line.flags == flag], factor, colour)


def _dots(picture: Any, points: Floats, factor: int, colour: Colour, size: float = 1.0) -> None:
    radius = round(0.25 * size * factor * 2**_SHIFT)
    for point in points:
        cv2.circle(picture, _place(point, factor), radius, colour, cv2.FILLED, cv2.LINE_AA, _SHIFT)


def _ring(picture: Any, point: Floats, factor: int, colour: Colour) -> None:
    cv2.circle(picture, _place(point, factor), 9 << _SHIFT, colour, 2, cv2.LINE_AA, _SHIFT)


def _arrow(picture: Any, point: Floats, direction: Floats, factor: int, length: float) -> None:
    """Draw an arrow from the object's side, with its head at the ring of the contact."""
    if length < 1:
        return
    tail = point - direction * (length + 12) / factor
    head = point - direction * 12 / factor
    cv2.arrowedLine(
        picture,
        _place(tail, factor),
        _place(head, factor),
        FORCE,
        2,
        cv2.LINE_AA,
        _SHIFT,
        min(0.3, 10 / length),
    )


def _write(picture: Any, text: str, number: int) -> None:
    font, size = cv2.FONT_HERSHEY_SIMPLEX, 0.55
    ascii_text = text.encode("ascii", "replace").decode()
    width = cv2.getTextSize(ascii_text, font, size, 1)[0][0]
    clipped = ascii_text[: int(len(ascii_text) * min(1.0, (picture.shape[1] - 20) / max(width, 1)))]
    origin = (10, 24 + 22 * number)
    shadow = origin[0] + 1, origin[1] + 1
    cv2.putText(picture, clipped, shadow, font, size, (0, 0, 0), 1, cv2.LINE_AA)
    cv2.putText(picture, clipped, origin, font, size, (255, 255, 255), 1, cv2.LINE_AA)


def check_overlay(
    overlay: Path | None, source: Source, read: Sequence[Path], table: Path | None
) -> None:
    """Raise InputError for an input, for the `table` that is written, and for one image of several.

    One image cannot hold the overlays of several.
    """
    if overlay is None:
        return
    check_no_input(overlay, read)
    check_two_files(table, overlay, "--overlay")
    count = len(source) if isinstance(source, Sized) else 0
    if overlay.suffix.lower() in FORMATS and count != 1:
        raise InputError(
            f"{overlay}: is a single image, allowed for {count or 'a stream of'} images is a "
            "folder, or a video such as overlay.mp4"
        )


class OverlayWriter:
    """Writer of pictures: into a video, one image, or a folder, as the path's suffix says.

    A folder gets numbered PNGs.

    Raises InputError if the path cannot be written.
    """

    def __init__(self, path: Path, frames_per_second: float = 25.0) -> None:
        self._path, self._rate = path, frames_per_second
        self._fourcc = _FOURCC.get(path.suffix.lower())
        self._video: Any = None
        self._one_image = path.suffix.lower() in FORMATS
        is_file = self._one_image or self._fourcc
        try:
            (path.parent if is_file else path).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror})") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._video is not None:
            self._video.release()

    def write(self, picture: Picture, number: int, name: str) -> None:
        """Write one more frame; in a folder, its file name consists of its number and name."""
        if self._fourcc is None:
            numbered = self._path / f"{number:06d}_{Path(name).stem}.png"
            target = self._path if self._one_image else numbered
            _, data = cv2.imencode(target.suffix, picture)
            try:
                target.write_bytes(bytes(data))
            except OSError as error:
                raise InputError(f"{target}: cannot be written ({error.strerror})") from error
            return
        if self._video is None:
            height, width = picture.shape[:2]
            code = cv2.VideoWriter.fourcc(*self._fourcc)
            self._video = cv2.VideoWriter(str(self._path), code, self._rate, (width, height))
            if not self._video.isOpened():
                raise InputError(f"{self._path}: cannot be written as a video")
        self._video.write(picture)
