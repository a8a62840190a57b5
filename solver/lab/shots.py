"""One image after the other, whatever they come from."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.observation import NOTHING_READ, Frame, Readings, push_order


@dataclass(frozen=True)
class Shot:
    """One image, and what is known of it.

    `image` is None where there is none to be had, and `fault` says why. `number` is its place in
    the source, from 0; `seconds` its time: since 1970 of a camera, since the start of a video, None
    of a file. `taken` is when it stood in memory, by time.perf_counter. `skipped` frames of a
    camera came and went before it.
    """

    name: str
    number: int
    image: Grey | None
    taken: float
    readings: Readings = NOTHING_READ
    push_id: str = ""
    seconds: float | None = None
    skipped: int = 0
    fault: str = ""

    def grey(self) -> Grey:
        """The image (height, width). Raises InputError where there is none."""
        if self.image is None:
            raise InputError(self.fault)
        return self.image


class Source(Protocol):
    """Images one after the other, `rate` a second; a `live` one waits for nobody."""

    live: bool
    rate: float

    def __iter__(self) -> Iterator[Shot]: ...


class Files:
    """Frames on disk, push after push and step after step; `number` is a frame's first place."""

    live = False
    rate = 25.0

    def __init__(self, frames: Sequence[Frame]) -> None:
        self._frames = [(place, frames[place]) for place in push_order(frames)]

    def __len__(self) -> int:
        return len(self._frames)

    def __iter__(self) -> Iterator[Shot]:
        for number, frame in self._frames:
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
