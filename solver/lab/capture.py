"""Videos and cameras, through OpenCV."""

import os
import threading
import time
from collections.abc import Iterator
from typing import Any, Protocol

import cv2

from solver.instrument.errors import InputError
from solver.instrument.images import to_grey
from solver.lab.shots import Shot

# A camera that hangs in a read does not keep the program from ending [s].
LONGEST_READ_S = 2.0


class Capture(Protocol):
    """What is used of OpenCV's VideoCapture."""

    def read(self) -> tuple[bool, Any]:
        """Whether there is one more frame, and the frame."""

    def get(self, prop: int) -> float:
        """A property by its number, 0 if it is not known."""

    def release(self) -> None:
        """Give the device or file back."""


class Video:
    """Every frame of a video, however long each takes."""

    live = False

    def __init__(self, name: str, capture: Capture, channel: str = "gray") -> None:
        self._name, self._capture, self._channel = name, capture, channel
        self.rate = _rate(capture)

    def __len__(self) -> int:
        return max(int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0)

    def __iter__(self) -> Iterator[Shot]:
        number = 0
        while True:
            there, image = self._capture.read()
            if not there:
                break
            seconds = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            grey = to_grey(image, self._name, self._channel)
            yield Shot(str(number), number, grey, time.perf_counter(), seconds=seconds)
            number += 1
        self._capture.release()
        if number == 0:
            raise InputError(f"{self._name}: holds no frame that can be decoded")


class CameraStream:
    """The newest frame whenever one is asked for; a thread fetches all and forgets the rest.

    Raises InputError when the camera gives no more images.
    """

    live = True

    def __init__(self, name: str, capture: Capture, channel: str = "gray") -> None:
        self._name, self._capture, self._channel = name, capture, channel
        self.rate = _rate(capture)
        self._arrival = threading.Condition()
        self._newest: tuple[int, Any, float, float] | None = None
        self._ended = False

    def __iter__(self) -> Iterator[Shot]:
        grabbing = threading.Thread(target=self._grab, daemon=True)
        grabbing.start()
        last = -1
        try:
            while True:
                with self._arrival:
                    while self._newest is None and not self._ended:
                        self._arrival.wait()
                    if self._newest is None:
                        raise InputError(f"{self._name} gives no more images")
                    number, image, seconds, taken = self._newest
                    self._newest = None
                yield Shot(
                    str(number),
                    number,
                    to_grey(image, self._name, self._channel),
                    taken,
                    seconds=seconds,
                    skipped=number - last - 1,
                )
                last = number
        finally:
            self._ended = True
            grabbing.join(LONGEST_READ_S)
            if not grabbing.is_alive():
                self._capture.release()

    def _grab(self) -> None:
        number = 0
        try:
            while not self._ended:
                there, image = self._capture.read()
                if not there:
                    break
                with self._arrival:
                    self._newest = number, image, time.time(), time.perf_counter()
                    self._arrival.notify()
                number += 1
        finally:  # whatever ended it, nobody waits for ever
            with self._arrival:
                self._ended = True
                self._arrival.notify()


def _rate(capture: Capture) -> float:
    """Frames a second; 25 where a camera or a video does not tell."""
    rate = capture.get(cv2.CAP_PROP_FPS)
    return rate if 0.1 <= rate <= 1e5 else 25.0


def open_capture(address: str | int) -> Any:
    """OpenCV's capture of a video file, a camera's number or its address. Raises InputError."""
    # A mistake is our sentence, not a page of OpenCV's and FFmpeg's own.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    capture = cv2.VideoCapture(address)
    if not capture.isOpened():
        what = f"camera {address}" if isinstance(address, int) else str(address)
        raise InputError(f"{what}: cannot be opened as a video or a camera")
    # Pixels as they are stored, as `read_grey` has them: no turning by a tag.
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    return capture
