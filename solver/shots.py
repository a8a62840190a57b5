"""One image after the other, whatever they come from; colour becomes gray, bits stay."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import cv2
import numpy as np

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.observation import NOTHING_READ, Frame, Readings

_TO_GREY: Final = {3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}


@dataclass(frozen=True)
class Shot:
    """One image, and what is known of it.

    `number` is its place in the source, from 0; `seconds` its time: since 1970 of a camera, since
    the start of a video, None of a file. `taken` is when it stood in memory, by
    time.perf_counter. `skipped` frames of a camera came and went before it.
    """

    name: str
    number: int
    image: Grey
    taken: float
    readings: Readings = NOTHING_READ
    push_id: str = ""
    seconds: float | None = None
    skipped: int = 0


class Source(Protocol):
    """Images one after the other, `rate` a second; a `live` one waits for nobody."""

    live: bool
    rate: float

    def __iter__(self) -> Iterator[Shot]: ...


class Files:
    """Frames that lie on disk, push after push and step after step.

    Pushes come in the order of their first frames; `number` is a frame's place before sorting.
    """

    live = False
    rate = 25.0

    def __init__(self, frames: Sequence[Frame]) -> None:
        first = {frame.push_id: number for number, frame in reversed(list(enumerate(frames)))}
        self._frames = sorted(
            enumerate(frames), key=lambda item: (first[item[1].push_id], item[1].step)
        )

    def __len__(self) -> int:
        return len(self._frames)

    def __iter__(self) -> Iterator[Shot]:
        for number, frame in self._frames:
            image = read_image(frame.path)
            yield Shot(
                frame.frame_id,
                number,
                image,
                time.perf_counter(),
                frame.readings,
                frame.push_id,
            )


def read_image(path: Path) -> Grey:
    """An image file as gray (height, width), of 8 or 16 bits as it has them. Raises InputError."""
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    if image is None:
        raise InputError(f"{path}: is not an image that can be decoded")
    return to_grey(image, str(path))


def to_grey(image: Any, name: str) -> Grey:
    """Gray (height, width) of an image as OpenCV gives it: gray, BGR or BGRA. Raises InputError."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    if image.dtype not in (np.uint8, np.uint16) or channels not in (1, *_TO_GREY):
        raise InputError(
            f"{name}: has shape {image.shape} and type {image.dtype}, "
            "allowed are gray or colour of 8 or 16 bits"
        )
    if channels == 1:
        return np.asarray(image.reshape(image.shape[:2]))
    return np.asarray(cv2.cvtColor(image, _TO_GREY[channels]))
