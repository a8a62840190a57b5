"""A worker of a dataset whose process dies at some frames, in a module that imports quickly."""

import os
import signal
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

from vbaa_bench.dataset.aside import aside
from vbaa_bench.dataset.layout import Layout

FATAL_NUMBER = 3
KILLED_NUMBER = 4
FATAL_IMAGE = "calibration/view_07.png"
KILLED_IMAGE = "rest/rest_00.png"


class Name(NamedTuple):
    """In the place of a FrameName, without the scene."""

    frame_id: str
    number: int


class Rig(NamedTuple):
    """In the place of a RigResult, without the renderer."""

    number: int
    row: dict[str, str | None]
    reason: str


class Metered(NamedTuple):
    """In the place of a MeteringRecord, without the renderer."""

    metering: SimpleNamespace
    failed: Mapping[str, str]

    def encoded(self) -> bytes:
        return b"{}"


class PoisonedWorker:
    """Its process dies in metering at frame 1, at another frame always, and at two images once."""

    def __init__(self, root: Path) -> None:
        self.layout = Layout(root)

    def meter(self, tick: Callable[[], None], given_up: Mapping[str, str]) -> Metered:
        with aside(self.layout, "meter") as own:
            if "frame 1" not in given_up:
                own.begin("frame 1")
                os.kill(os.getpid(), signal.SIGKILL)
        tick()
        return Metered(SimpleNamespace(exposure=2.0), given_up)

    def image(self, tick: Callable[[], None], name: str, exposure: float) -> str:
        with aside(self.layout, Path(name).stem) as own:
            own.begin_image(name)
            if name == FATAL_IMAGE or (name == KILLED_IMAGE and self._is_first(name)):
                os.kill(os.getpid(), signal.SIGKILL)
        tick()
        return f"{name} at {exposure}"

    def shard(
        self,
        tick: Callable[[], None],
        number: int,
        frames: Sequence[Name],
        _metering: SimpleNamespace,
        given_up: Mapping[str, str],
    ) -> SimpleNamespace:
        # Imported here: most of these processes die before.
        import numpy as np

        from vbaa_bench.dataset.writer import shard_writer

        with shard_writer(self.layout, number) as writer:
            for name in frames:
                writer.begin(name.frame_id)
                if name.frame_id in given_up:
                    writer.add_failure(name.frame_id, given_up[name.frame_id])
                else:
                    self._die_at(name)
                    image = np.zeros((4, 4), np.uint8)
                    writer.add(name.frame_id, image, {"step": 0}, {"x_c_mm": 1.0}, {})
                tick()
        return SimpleNamespace(digests=writer.digests, failed=writer.failed)

    def _die_at(self, name: Name) -> None:
        if name.number == FATAL_NUMBER or (
            name.number == KILLED_NUMBER and self._is_first(name.frame_id)
        ):
            os.kill(os.getpid(), signal.SIGKILL)

    def _is_first(self, name: str) -> bool:
        """Test whether this is the first attempt to render an image."""
        once = self.layout.root / f"killed once at {Path(name).name}"
        is_first = not once.exists()
        once.touch()
        return is_first


class PoisonedRigs:
    """A generator of rigs; its process dies at an image of rig 1."""

    def __init__(self, *_: object) -> None: ...

    def rig(self, _tick: Callable[[], None], number: int, root: Path, _given_up: object) -> Rig:
        with aside(Layout(root), "meter") as own:
            own.begin_image("the board")
            if number == 1:
                os.kill(os.getpid(), signal.SIGKILL)
        return Rig(number, {"rig": str(number), "reason": None}, "")
