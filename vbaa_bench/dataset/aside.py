"""Temporary folders of jobs, which name the frame being rendered, should the process die."""

import contextlib
import os
import shutil
import socket
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from solver.instrument.files import read_regular
from vbaa_bench.dataset.layout import Layout

_CURRENT: Final = "current"


@dataclass(frozen=True)
class Aside:
    """A job's temporary folder. Several processes that do the same job have one each."""

    folder: Path

    def begin(self, frame_id: str) -> None:
        """Leave the name of the next frame. Raises OSError."""
        (self.folder / _CURRENT).write_text(frame_id, encoding="utf-8")


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


def clear_aside(layout: Layout, job: str | None = None) -> Counter[str]:
    """Remove the folders of dead processes that did a job, or any; count the frames that they name.

    No living process may be doing the job.
    """
    names = Counter[str]()
    for folder in layout.all_aside(job):
        with contextlib.suppress(OSError, UnicodeDecodeError):  # it died before its first frame
            names[read_regular(folder / _CURRENT).decode()] += 1
        shutil.rmtree(folder, ignore_errors=True)
    return names
