"""Video files and cameras as sources of images, by OpenCV."""

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import cv2

from solver.instrument.errors import IncompleteError, InputError
from solver.instrument.images import page_count, to_channels
from solver.lab.shots import Shot

# A video that ends this many frames, and this share of them, before its stated end is cut. Chosen:
# containers round their duration, and some decoders withhold the last frames.
MAX_MISSING, MAX_MISSING_SHARE = 2, 0.01
# Longest wait for a camera that hangs in a read, so that the program can end [s].
MAX_READ_S = 2.0


class Capture(Protocol):
    """Part of OpenCV's VideoCapture used to read frames."""

    def read(self) -> tuple[bool, Any]:
        """Read the next frame; return whether there is one, and the frame."""

    def get(self, prop: int) -> float:
        """Get a property by its number; return 0 if it is unknown."""

    def release(self) -> None:
        """Release the device or file."""


class Video:
    """Source of all frames of a video; no frame is skipped.

    Raises IncompleteError after the last frame if the video ends before its stated end.
    """

    live = False

    def __init__(self, name: str, capture: Capture, channel: str = "gray") -> None:
        self._name, self._capture, self._channel = name, capture, channel
        self.rate = _rate(capture)

    def __len__(self) -> int:
        return max(int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0)

    def __iter__(self) -> Iterator[Shot]:
        number, stated = 0, len(self)
        seconds = 0.0
        while True:
            ok, image = self._capture.read()
            if not ok:
                break
            seconds = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            pixels = to_channels(image, self._name, self._channel)
            yield Shot(str(number), number, pixels, time.perf_counter(), seconds=seconds)
            number += 1
        self._capture.release()
        if number == 0:
            raise InputError(f"{self._name}: has no frame that can be decoded")
        # By time: frames at uneven intervals are not as many as their rate would have them.
        missing = min(stated - number, stated - round(seconds * self.rate) - 1)
        if missing > MAX_MISSING + MAX_MISSING_SHARE * stated:
            raise IncompleteError(
                f"{self._name}: ends after {number} of {stated} frames: it is cut or damaged"
            )


class Stack:
    """Source of the images of one file, a film as microscopes store it; its rate is not known."""

    live = False
    rate = 25.0

    def __init__(self, path: Path, channel: str = "gray") -> None:
        self._path, self._channel = path, channel

    def __len__(self) -> int:
        return page_count(self._path)

    def __iter__(self) -> Iterator[Shot]:
        # OpenCV 5.0 reads a wrong image of a GIF if it is asked for one by its number.
        whole = self._read(0, len(self)) if self._path.suffix.lower() == ".gif" else None
        for number in range(len(self)):
            pages = self._read(number, 1) if whole is None else whole[number : number + 1]
            pixels, fault = None, f"{self._path}: image {number} cannot be decoded"
            if pages:
                try:
                    pixels, fault = to_channels(pages[0], str(self._path), self._channel), ""
                except InputError as error:
                    fault = str(error)
            yield Shot(str(number), number, pixels, time.perf_counter(), fault=fault)

    def _read(self, start: int, count: int) -> list[Any]:
        """Read some of the images, in OpenCV's format; none if they cannot be decoded."""
        try:
            return list(cv2.imreadmulti(str(self._path), start, count, [], cv2.IMREAD_UNCHANGED)[1])
        except cv2.error:
            return []


class CameraStream:
    """Source of the newest frame of a camera; a thread reads all frames and keeps only the newest.

    Raises InputError when the camera delivers no more images.
    """

    live = True

    def __init__(self, name: str, capture: Capture, channel: str = "gray") -> None:
        self._name, self._capture, self._channel = name, capture, channel
        self.rate = _rate(capture)
        self._arrival = threading.Condition()
        self._newest: tuple[int, Any, float, float] | None = None
        self._ended = False

    def __iter__(self) -> Iterator[Shot]:
        thread = threading.Thread(target=self._grab, daemon=True)
        thread.start()
        last_number = -1
        try:
            while True:
                with self._arrival:
                    while self._newest is None and not self._ended:
                        self._arrival.wait()
                    if self._newest is None:
                        raise InputError(f"{self._name} gives no more images")
                    number, image, seconds, loaded_at = self._newest
                    self._newest = None
                yield Shot(
                    str(number),
                    number,
                    to_channels(image, self._name, self._channel),
                    loaded_at,
                    seconds=seconds,
                    skipped=number - last_number - 1,
                )
                last_number = number
        finally:
            self._ended = True
            thread.join(MAX_READ_S)
            if not thread.is_alive():
                self._capture.release()

    def _grab(self) -> None:
        number = 0
        try:
            while not self._ended:
                ok, image = self._capture.read()
                if not ok:
                    break
                with self._arrival:
                    self._newest = number, image, time.time(), time.perf_counter()
                    self._arrival.notify()
                number += 1
        finally:  # also after an error, wake the consumer so that it does not wait for ever
            with self._arrival:
                self._ended = True
                self._arrival.notify()


def _rate(capture: Capture) -> float:
    """Return the frames per second; 25 if the camera or video does not report them."""
    rate = capture.get(cv2.CAP_PROP_FPS)
    return rate if 0.1 <= rate <= 1e5 else 25.0


def open_capture(address: str | int) -> Any:
    """Open a video file, or a camera by number or address, with OpenCV. Raises InputError."""
    # Only our own error message is shown, without the log output of OpenCV and FFmpeg.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    capture = cv2.VideoCapture(address)
    if not capture.isOpened():
        if isinstance(address, int):
            raise InputError(
                f"camera {address}: cannot be opened; try another number, close other programs "
                "that use it, or ask whether you may use it"
            )
        raise InputError(f"{address}: cannot be opened as a video or a camera")
    # Ignore the orientation tag, as `read_grey` does.
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    return capture
