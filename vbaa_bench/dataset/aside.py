"""Temporary folders of jobs, which name what is being rendered, should the process die."""

import contextlib
import json
import os
import shutil
import socket
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.files import read_regular
from vbaa_bench.dataset.layout import Layout

_CURRENT: Final = "current"


class Rendering(NamedTuple):
    """What a process renders: a frame, or an image without which there is no dataset."""

    name: str
    is_frame: bool


@dataclass(frozen=True)
class Aside:
    """A job's temporary folder. Several processes that do the same job have one each."""

    folder: Path

    def begin(self, frame_id: str) -> None:
        """Leave the name of the next frame. Raises OSError."""
        self._leave(Rendering(frame_id, True))

    def begin_image(self, name: str) -> None:
        """Leave the name of the next image that is not a frame. Raises OSError."""
        self._leave(Rendering(name, False))

    def _leave(self, rendering: Rendering) -> None:
        (self.folder / _CURRENT).write_text(json.dumps(rendering), encoding="utf-8")


@contextlib.contextmanager
def aside(layout: Layout, job: str) -> Iterator[Aside]:
    """Create the temporary folder of a job, and remove it at the end. Raises OSError."""
    folder = layout.aside(job, f"{socket.gethostname()}-{os.getpid()}")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    try:
        yield Aside(folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def clear_aside(layout: Layout, job: str | None = None) -> Counter[Rendering]:
    """Remove the folders of dead processes that did a job, or any; count what they rendered.

    No living process may be doing the job.
    """
    renderings = Counter[Rendering]()
    for folder in layout.all_aside(job):
        with contextlib.suppress(OSError, ValueError):  # it died before its first image
            renderings[Rendering(*json.loads(read_regular(folder / _CURRENT)))] += 1
        shutil.rmtree(folder, ignore_errors=True)
    return renderings
