"""A worker of a dataset whose process dies at some frames, in a module that imports quickly."""

import os
import signal
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from vbaa_bench.dataset.aside import aside
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.writer import shard_writer
from vbaa_bench.scene.frames import FrameName

FATAL_NUMBER = 3
KILLED_NUMBER = 4


class PoisonedWorker:
    """Its process dies in metering at frame 1, at another frame always, and at a third once."""

    def __init__(self, root: Path) -> None:
        self.layout = Layout(root)

    def meter(self, tick: Callable[[], None], given_up: Collection[str]) -> SimpleNamespace:
        with aside(self.layout, "meter") as own:
            if "frame 1" not in given_up:
                own.begin("frame 1")
                os.kill(os.getpid(), signal.SIGKILL)
        tick()
        return SimpleNamespace(exposure=2.0)

    def image(self, tick: Callable[[], None], name: str, exposure: float) -> str:
        tick()
        return f"{name} at {exposure}"

    def shard(
        self,
        tick: Callable[[], None],
        number: int,
        frames: Sequence[FrameName],
        _metering: SimpleNamespace,
        given_up: Mapping[str, str],
    ) -> SimpleNamespace:
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

    def _die_at(self, name: FrameName) -> None:
        once = self.layout.root / "killed once"
        if name.number == FATAL_NUMBER or (name.number == KILLED_NUMBER and not once.exists()):
            once.touch()
            os.kill(os.getpid(), signal.SIGKILL)
