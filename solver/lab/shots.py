"""Sequences of images from any source: interface, and files on disk."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.image_frame import NO_READINGS, ImageFrame, Readings, push_order


@dataclass(frozen=True)
class Shot:
    """One image and its metadata.

    `image` is None if it cannot be read; then `fault` is the reason. `number` is its index in the
    source, from 0. `seconds` is its time: since 1970 for a camera, since the start for a video,
    None for a file. `taken` is the time.perf_counter at which it was in memory. `skipped` is the
    number of a camera's frames that were dropped just before it.
    """

    name: str
    number: int
    image: Grey | None
    taken: float
    readings: Readings = NO_READINGS
    push_id: str = ""
    seconds: float | None = None
    skipped: int = 0
    fault: str = ""

    def pixels(self) -> Grey:
        """Return the image (height, width), or (height, width, 3) of all channels.

        Raises InputError if there is none.
        """
        if self.image is None:
            raise InputError(self.fault)
        return self.image


class Source(Protocol):
    """Source of images, `rate` per second; a `live` source does not wait for the consumer."""

    live: bool
    rate: float

    def __iter__(self) -> Iterator[Shot]: ...


class Files:
    """Source of frames on disk, ordered by push and step; `number` is the index in `frames`."""

    live = False
    rate = 25.0

    def __init__(self, frames: Sequence[ImageFrame]) -> None:
        self.frames = tuple(frames)

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[Shot]:
        for number in push_order(self.frames):
            frame = self.frames[number]
            image, fault = None, ""
            try:
                image = frame.image()
            except InputError as error:
                fault = str(error)
            yield Shot(
                frame.frame_id,
                number,
                image,
                time.perf_counter(),
                frame.readings,
                frame.push_id,
                fault=fault,
            )
